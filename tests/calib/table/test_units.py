"""Units of force, length and time: converted where they are known, refused on every path where they are not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

from calib.errors import TraceError
from calib.table.units import Quantity, split_unit, unit_of
from calib.trace.trace import read_trace

N = 40
TIME, FORCE = 0.01 * np.arange(N), 1.0 + np.arange(N)
G = 9.80665


@pytest.mark.parametrize(
    ("text", "quantity", "factor"),
    [
        ("kgf", "force", G), ("g", "force", G / 1e3), ("[kg]", "force", G), ("lbf", "force", 4.4482216152605),
        ("ozf", "force", 0.27801385095378), ("cN", "force", 0.01), ("kN", "force", 1e3), ("mN", "force", 1e-3),
        ("MN", "force", 1e6), ("KGF", "force", G), ("min", "time", 60.0), ("us", "time", 1e-6), ("\u00b5s", "time", 1e-6),
        ("\u03bcm", "length", 1e-6), ("inch", "length", 0.0254), ("mil", "length", 2.54e-5), ("(sec)", "time", 1.0),
        ("MM", "length", 1e-3), ("kPa", "other", None), ("N/mm", "other", None), ("N\u00b7m", "other", None),
        ("Nm", "other", None), ("mm/min", "other", None), ("%", "other", None), ("V", "other", None), ("kg/m3", "other", None),
    ],
)  # fmt: skip
def test_units_and_what_one_is(text: str, quantity: str, factor: float | None) -> None:
    """Each unit has its quantity and, where it is one of ours, its size in SI (NIST SP 811, appendix B)."""
    unit = unit_of(text)
    assert unit is not None and unit.quantity is Quantity(quantity)
    if factor is not None:
        assert unit.factor == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("text", ["", "z", "x", "Force", "raw", "wrench/force/z", "O_F_ext_hat_K", "1", "time_s"])
def test_words_that_are_no_units(text: str) -> None:
    """Names and numbers are none."""
    assert unit_of(text) is None


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("force_N", "force", "N"), ("Force (g)", "Force", "g"), ("Kraft / N", "Kraft", "N"), ("Load in kN", "Load", "kN"),
        ("Stress (kPa)", "Stress", "kPa"), ("Force [xyz]", "Force", "xyz"), ("Force (raw)", "Force (raw)", ""),
        ("/ft/wrench/force/z", "/ft/wrench/force/z", ""), ("force_A", "force_A", ""), ("Time(min)", "Time", "min"),
        ("Fz", "Fz", ""), ("field.O_F_ext_hat_K2", "field.O_F_ext_hat_K2", ""),
        ("ForceN", "Force", "N"),
        ("timeSec", "time", "s"),
        ("knifeDepthMm", "knifeDepth", "mm"),
        ("LoadKN", "Load", "kN"),
        ("Times", "Times", ""),
        ("GripForces", "GripForces", ""),
    ],
)  # fmt: skip
def test_units_in_names(name: str, stem: str, unit: str) -> None:
    """What stands in brackets is a unit, known or not; a last word only where it is known."""
    found = split_unit(name)
    assert (found.stem, found.text) == (stem, unit)


def _csv(folder: Path, head: str, force: np.ndarray) -> Path:
    path = folder / "cut.csv"
    rows = "\n".join(f"{t:.3f},{f!r}" for t, f in zip(TIME, force.tolist(), strict=True))
    path.write_text(f"{head}\n{rows}\n", encoding="utf-8")
    return path


def _by_name(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    return _csv(folder, f"time_s,Load ({unit})", force), f"Load ({unit})"


def _by_row(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    return _csv(folder, f"Time,Load\ns,{unit}", force), "Load"


def _by_line(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    return _csv(folder, f"Force Units: {unit}\ntime_s,Load", force), "Load"


def _by_attribute(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    path = folder / "cut.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = TIME
        file["Load"] = force
        file["Load"].attrs["units"] = unit
    return path, "Load"


def _by_json(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    path = folder / "cut.json"
    path.write_text(json.dumps({"time_s": TIME.tolist(), "Load": force.tolist(), "units": {"Load": unit}}))
    return path, "Load"


def _by_group(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    path = folder / "cut.json"
    path.write_text(json.dumps({"time_s": TIME.tolist(), "Load": {"values": force.tolist(), "unit": unit}}))
    return path, "Load"


def _by_frame(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    frame = pd.DataFrame({"time_s": TIME, "Load": force})
    frame.attrs["units"] = {"Load": unit}
    return frame, "Load"


def _by_levels(folder: Path, unit: str, force: np.ndarray) -> tuple[Path | pd.DataFrame, str]:
    names = pd.MultiIndex.from_tuples([("Time", "s"), ("Load", unit)])
    return pd.DataFrame(np.column_stack([TIME, force]), columns=names), f"Load.{unit}"


PATHS = [_by_name, _by_row, _by_line, _by_attribute, _by_json, _by_group, _by_frame, _by_levels]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(("unit", "factor"), [("kgf", G), ("g", G / 1e3), ("lbf", 4.4482216152605), ("kN", 1e3)])
def test_units_count_on_every_path(tmp_path: Path, path: Callable, unit: str, factor: float) -> None:
    """Name, row of units, line above the header, attribute, JSON and DataFrame: the same newtons, chosen or named."""
    source, name = path(tmp_path, unit, FORCE / factor)
    for how in ({"force_col": name}, {}) if path is not _by_levels else ({"force_col": name, "time_col": "Time.s"},):
        trace = read_trace(source, **how)
        np.testing.assert_allclose(trace.force, FORCE, rtol=1e-9)
        assert any(f"is in {unit}" in note for note in trace.notes) == (unit != "kN")


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("unit", ["kPa", "Nm", "N/mm", "mm", "min"])
def test_units_of_another_quantity_are_refused_on_every_path(tmp_path: Path, path: Callable, unit: str) -> None:
    """None is taken for newtons: the error names the column, the unit and the option that says another."""
    source, name = path(tmp_path, unit, FORCE)
    with pytest.raises(
        TraceError, match=r"column Load.*its unit is '.*', which is none of a force; use one of N, .*=N'"
    ):
        read_trace(source, force_col=name, time_col="Time.s" if path is _by_levels else None)


def test_a_unit_is_said_behind_the_name(tmp_path: Path) -> None:
    """``NAME=UNIT`` gives one where there is none, or another one with a note; one of another quantity is refused."""
    bare = _csv(tmp_path, "time_s,Fz", FORCE)
    assert any("no unit is stated for Fz" in note for note in read_trace(bare, force_col="Fz").notes)
    np.testing.assert_allclose(read_trace(bare, force_col="Fz=lbf").force, 4.4482216152605 * FORCE)
    with pytest.raises(TraceError, match="'mm' is no unit of a force"):
        read_trace(bare, force_col="Fz=mm")
    other = read_trace(_csv(tmp_path, "time_s,Load (kPa)", FORCE), force_col="Load (kPa)=N")
    np.testing.assert_allclose(other.force, FORCE)
    assert any("as asked" in note for note in other.notes)
    with pytest.raises(TraceError, match=r"its unit is 'xyz', which is not known.*--force-col 'Load \(xyz\)=N'"):
        read_trace(_csv(tmp_path, "time_s,Load (xyz)", FORCE), force_col="Load (xyz)")


def test_units_of_time_and_length(tmp_path: Path) -> None:
    """Minutes, microseconds with either micro sign, inches and mils."""
    for name, factor in (("time_min", 60.0), ("time (\u00b5s)", 1e-6), ("time [\u03bcs]", 1e-6)):
        path = tmp_path / "cut.csv"
        rows = "\n".join(f"{t / factor!r},{f!r}" for t, f in zip(TIME.tolist(), FORCE.tolist(), strict=True))
        path.write_text(f"{name},force_N\n{rows}\n", encoding="utf-8")
        np.testing.assert_allclose(read_trace(path).time, TIME, rtol=1e-9)
    for name, factor in (("position_mil", 2.54e-5), ("Position (in)", 0.0254), ("position_um", 1e-6)):
        frame = pd.DataFrame({"time_s": TIME, "force_N": FORCE, name: -TIME / factor})
        np.testing.assert_allclose(read_trace(frame).position, -TIME, rtol=1e-9)
