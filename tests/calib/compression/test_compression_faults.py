"""Faults of a compression record: repaired, said or refused, with row and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.compression.measured import MeasuredCompression, read_repeats
from calib.errors import TraceError
from mpm.scene.shapes import Shape
from tests.calib.made_cuts import text_of

N = 300
SHAPE = Shape("upright_cylinder", 0.05, 0.05, 0.03)
WAY = np.linspace(0.0, 14.0, N)
LOAD = 98.0 * WAY / 30.0 + 0.02 * np.random.default_rng(0).normal(size=N)


def read(folder: Path, load: np.ndarray, keep: np.ndarray | None = None) -> MeasuredCompression:
    """The repeat of a load."""
    rows = [(f"{w:.5f}", f"{f:.4f}") for w, f in zip(WAY, load, strict=True)]
    path = folder / "press.csv"
    path.write_text(text_of("compression_mm,force_N", rows if keep is None else [rows[i] for i in keep]))
    return read_repeats([path], SHAPE, 0.4)


def test_a_value_that_stands_out_alone_is_replaced(tmp_path: Path) -> None:
    """It is said with its row, and the modulus is that of the sound record."""
    load = LOAD.copy()
    load[150] = 9999.0
    found, sound = read(tmp_path, load), read(tmp_path, LOAD)
    np.testing.assert_allclose(found.stress, sound.stress, atol=100.0)
    assert any("press.csv, row 152, column force_N: 9999 N stands out alone" in note for note in found.notes)
    assert not sound.notes


def test_a_clipped_or_frozen_load_is_refused(tmp_path: Path) -> None:
    """The rows are named."""
    for load in (np.minimum(LOAD, 25.0), np.where((WAY > 4.0) & (WAY < 7.0), LOAD[86], LOAD)):
        with pytest.raises(TraceError, match=r"press.csv, row \d+, column force_N: the load is .* N from there to"):
            read(tmp_path, load)


def test_missing_samples_and_sudden_changes_are_said(tmp_path: Path) -> None:
    """A gap of some millimetres, and a sensor that was moved."""
    gap = read(tmp_path, LOAD, np.r_[0:60, 200:N])
    assert any("row 61, column force_N: no samples for 6.6 mm of the way" in note for note in gap.notes), gap.notes
    moved = read(tmp_path, LOAD - 5.0 * (np.arange(N) >= 150))
    assert any("row 152, column force_N: the load changes by -5" in note for note in moved.notes), moved.notes


def written(folder: Path, header: str, rows: list[tuple[str, ...]]) -> MeasuredCompression:
    """The repeats in a file of cells."""
    path = folder / "press.csv"
    path.write_text(text_of(header, rows))
    return read_repeats([path], SHAPE, 0.4)


@pytest.mark.parametrize("column", ["Probe", "Label", "Campione", "ID"])
def test_a_column_of_labels_splits_a_file(tmp_path: Path, column: str) -> None:
    """By whatever name, where the way begins anew with each; one that counts the cycles of a specimen does not."""
    rows = [
        (name, f"{w:.5f}", f"{k * f:.4f}")
        for name, k in (("A", 1.0), ("B", 1.2))
        for w, f in zip(WAY, LOAD, strict=True)
    ]
    found = written(tmp_path, f"{column},displacement_mm,load_N", rows)
    assert found.names == ["A", "B"]
    assert found.slope[1] / found.slope[0] == pytest.approx(1.2, rel=0.01)
    assert any(f"each value of column {column} is taken for a specimen" in note for note in found.notes)
    assert len(written(tmp_path, "cycle,displacement_mm,load_N", rows).names) == 1


@pytest.mark.parametrize("second", ["Way (mm).1,Load (N).1", "Way 2 (mm),Load 2 (N)", "Way (mm),Load (N)"])
def test_specimens_beside_each_other_however_they_are_told_apart(tmp_path: Path, second: str) -> None:
    """By the numbers of pandas, by numbers in the names, or not at all."""
    first = "Travel 1 (mm),Load 1 (N)" if "2" in second else "Travel (mm),Load (N)"
    rows = [(f"{w:.5f}", f"{f:.4f}", f"{w:.5f}", f"{1.2 * f:.4f}") for w, f in zip(WAY, LOAD, strict=True)]
    found = written(tmp_path, f"{first},{second.replace('Way', 'Travel')}", rows)
    assert found.slope[1] / found.slope[0] == pytest.approx(1.2, rel=0.01)


def test_a_first_sample_that_stands_out_is_no_zero(tmp_path: Path) -> None:
    """The zero of the load would be off by it."""
    load = LOAD.copy()
    load[0] = 50.0
    np.testing.assert_allclose(read(tmp_path, load).stress, read(tmp_path, LOAD).stress, atol=100.0)


def test_a_way_before_contact_is_said(tmp_path: Path) -> None:
    """The load stays at nothing over the first strain: no toe is corrected, so the modulus is too small."""
    approach = np.r_[np.zeros(60), LOAD[:-60]]
    noise = 0.02 * np.random.default_rng(1).normal(size=N)
    found = read(tmp_path, approach + np.where(np.arange(N) < 60, noise, 0.0))
    assert any("the load stays at nothing over the first 9" in note for note in found.notes), found.notes
    assert not any("stays at nothing" in note for note in read(tmp_path, LOAD).notes)
