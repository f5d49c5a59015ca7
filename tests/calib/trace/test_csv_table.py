"""CSV files as loggers write them give the same trace as a plain one; what is damaged is refused, not guessed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.conditioning import condition
from calib.trace.trace import read_trace

N = 60
TIME = 0.01 * np.arange(N)
LOAD = 2.0 + np.maximum(0.0, np.arange(N) - 20.0)
DEPTH = 0.02 * TIME


def plain(
    folder: Path, header: str = "time_s,force_N,stroke_m", separator: str = ",", comma: bool = False, above: str = ""
) -> Path:
    """A file of the cut."""
    rows = [f"{t:.3f}{separator}{f:.2f}{separator}{z:.5f}" for t, f, z in zip(TIME, LOAD, DEPTH, strict=True)]
    text = "\n".join(rows).replace(".", ",") if comma else "\n".join(rows)
    path = folder / "cut.csv"
    path.write_text(f"{above}{header}\n{text}\n", encoding="utf-8")
    return path


ABOVE = "Record 4, banana\nDate;2026-11-01\n\nOperator: A. B.\n"
AS_WIDE = "Record 4;banana;kitchen knife\nDate;2026-11-01\n"


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({}, ()),
        ({"separator": ";", "header": "time_s;force_N;stroke_m", "comma": True}, ("follow a comma",)),
        ({"separator": "\t", "header": "time_s\tforce_N\tstroke_m"}, ()),
        ({"above": "Record 4\n"}, ("1 line above the header was left out",)),
        ({"above": ABOVE, "separator": ";", "header": "time_s;force_N;stroke_m", "comma": True},
         ("3 lines above the header were left out", "time_s, force_N, stroke_m follow a comma")),
        ({"above": AS_WIDE, "separator": ";", "header": "time_s;force_N;stroke_m", "comma": True},
         ("2 lines above the header were left out", "follow a comma")),
        # as wide as each other and narrower than the table; filled up to its width, as spreadsheets do; a number among
        # the words
        ({"above": "Sample;Gel 7\nDate;12.03.2026\nNumber;7\n", "separator": ";", "header": "time;force;stroke\ns;N;m", "comma": True},
         ("3 lines above the header", "follow a comma")),
        ({"above": "Sample;Gel 7;\nDate;12.03.2026;\nNumber;7;\n", "separator": ";", "header": "time_s;force_N;stroke_m", "comma": True},
         ("3 lines above the header", "follow a comma")),
        ({"above": "Sample,Gel 7,\nDate,12.03.2026,\n"}, ("2 lines above the header",)),
        ({"header": "time,force,stroke\n[s],[N],[m]"}, ()),
        ({"header": "Time,Force,Stroke\ns,N,m", "above": "x\ny\n"}, ("2 lines above",)),
    ],
)  # fmt: skip
def test_layouts_of_loggers_give_the_same_trace(tmp_path: Path, how: dict, said: tuple[str, ...]) -> None:
    """Separators, decimals with a comma, words above the header, units below it: the same numbers; what was done is
    said."""
    trace = read_trace(plain(tmp_path, **how))
    np.testing.assert_allclose(trace.time, TIME, atol=1e-9)
    np.testing.assert_allclose(trace.force, LOAD, atol=1e-9)
    assert trace.position is not None
    np.testing.assert_allclose(trace.position, -DEPTH, atol=6e-6)
    assert len(trace.notes) == len(said) and all(words in note for words, note in zip(said, trace.notes, strict=True))
    assert list(condition(trace).warnings[: len(said)]) == list(trace.notes)


def test_units_below_the_header_count(tmp_path: Path) -> None:
    """Milliseconds, kilonewtons and millimetres stated there are read as such."""
    path = plain(tmp_path, header="time,force,stroke\nms,kN,mm")
    text = path.read_text().splitlines()
    path.write_text(
        "\n".join(
            [
                *text[:2],
                *(f"{10 * k},{0.001 * f:.6f},{1e3 * z:.4f}" for k, (f, z) in enumerate(zip(LOAD, DEPTH, strict=True))),
            ]
        )
    )
    trace = read_trace(path)
    np.testing.assert_allclose(trace.time, TIME, atol=1e-9)
    np.testing.assert_allclose(trace.force, LOAD, atol=1e-6)
    np.testing.assert_allclose(trace.position, -DEPTH, atol=1e-7)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda s: s.replace("0.300,12.00", "0.300"), r"row 32: 2 cells, the header has 3"),
        (lambda s: "Record\n" + s.replace("0.300,12.00", "0.300"), r"row 33: 2 cells, the header has 3"),
        (lambda s: s.replace("0.300,12.00", "0.300,N"), r"row 32, column force_N: 'N' is not a number"),
        (lambda s: s.split("\n", 1)[1], "the first row holds numbers"),
        (lambda s: "\n".join(f"word {k}" for k in range(80)) + "\n" + s, "not a CSV file with a force column"),
        (lambda s: s.replace(",", ";").replace("12.00", "1.2,00"), r"'1\.2,00' is not a number"),
        (lambda s: s.replace("time_s,force_N,stroke_m", "time_s,force_N,stroke_m\n[s],[N],x y z"), "'\\[s\\]' is not a number"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused_with_their_place(tmp_path: Path, change, says: str) -> None:
    """A row too short with and without words above, text among numbers, no header, no table within sixty lines, mixed
    decimals."""
    path = plain(tmp_path)
    path.write_text(change(path.read_text()))
    with pytest.raises(TraceError, match=says):
        read_trace(path)


def test_names_that_mean_nothing_are_listed_with_their_units(tmp_path: Path) -> None:
    """Which column is which is not guessed; the units that the file states help to say it."""
    with pytest.raises(TraceError, match=r"only one in a unit of time is 'Tid': name it.*of force is 'Voima': name it"):
        read_trace(plain(tmp_path, header="Tid,Voima,Matka\ns,N,m"))
    with pytest.raises(
        TraceError, match=r"the columns are time_s \[s\], Voima \[N\], Vino \[N\]; name one with --force-col"
    ):
        read_trace(plain(tmp_path, header="time_s,Voima,Vino\ns,N,N"))


def test_a_depth_may_be_named_as_one(tmp_path: Path) -> None:
    """A column that grows as the knife descends is turned round, whatever its name says; beside --position-col it is
    refused."""
    path = plain(tmp_path, header="time_s,force_N,Matka [mm]")
    trace = read_trace(path, depth_col="Matka [mm]")
    np.testing.assert_allclose(trace.position, -1e-3 * DEPTH, atol=6e-9)
    np.testing.assert_allclose(read_trace(path, position_col="Matka [mm]").position, 1e-3 * DEPTH, atol=6e-9)
    stroke = plain(tmp_path, header="time_s,force_N,stroke_m")
    np.testing.assert_allclose(read_trace(stroke, depth_col="stroke_m").position, -DEPTH, atol=6e-6)
    with pytest.raises(TraceError, match="--position-col beside --depth-col"):
        read_trace(stroke, depth_col="stroke_m", position_col="stroke_m")
