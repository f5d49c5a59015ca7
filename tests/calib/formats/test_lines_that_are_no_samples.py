"""Text files with lines below or between the samples, without the cells that others have, or with specimens beside each
other; names in other languages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.conditioning import condition
from calib.trace.cuts import find_cuts
from calib.trace.trace import Trace, read_trace
from tests.calib.made_cuts import made_cut, plain_rows, text_of

CUT = made_cut()
ROWS = plain_rows(CUT)
HEADER = "time_s,force_N,position_m"
TRUE = condition(CUT.trace())


def read(folder: Path, text: str, encoding: str = "utf-8") -> Trace:
    """The record of a text."""
    path = folder / "cut.csv"
    path.write_bytes(text.encode(encoding))
    return read_trace(path)


def is_the_cut(trace: Trace) -> None:
    """Force, time and way are those of the made-up cut."""
    np.testing.assert_allclose(trace.force, CUT.force, atol=1e-3)
    np.testing.assert_allclose(trace.time, CUT.time, atol=1e-3)
    assert trace.position is not None
    np.testing.assert_allclose(trace.position - trace.position[0], -1e-3 * CUT.depth_mm, atol=2e-5)


@pytest.mark.parametrize(
    ("below", "lines"),
    [
        ("End of data\n", "row 642 was"),
        ("Max,14.9,\n", "row 642 was"),
        ("\nOperator: A. B.\nPrinted at noon\n", "2 lines that are no samples, the first is row 643, were"),
        ("Mean,5.2,0.04\nMax,15,0.06\n", "2 lines that are no samples, the first is row 642, were"),
        (",,\n,,\n", "2 lines that are no samples, the first is row 642, were"),
    ],
)
def test_lines_below_the_last_row_are_left_out(tmp_path: Path, below: str, lines: str) -> None:
    """Machines write summaries there; what was left out is said with its row."""
    trace = read(tmp_path, text_of(HEADER, ROWS) + below)
    is_the_cut(trace)
    assert any(f"{lines} left out" in note for note in trace.notes), trace.notes


def test_a_remark_between_rows_is_left_out_but_a_torn_row_is_not(tmp_path: Path) -> None:
    """A line without a number is no sample; one with too few numbers is."""
    lines = text_of(HEADER, ROWS).splitlines()
    trace = read(tmp_path, "\n".join([*lines[:200], "*** contact ***", *lines[200:]]))
    is_the_cut(trace)
    assert "cut.csv: row 201 was left out, it is no sample" in trace.notes
    with pytest.raises(TraceError, match="row 201: 2 cells, the header has 3"):
        read(tmp_path, "\n".join([*lines[:200], lines[200][:9], *lines[201:]]))


def test_rows_may_lack_the_comment_and_the_header_the_number_of_rows(tmp_path: Path) -> None:
    """LabVIEW names a comment that no row has; R writes no name above its numbers of rows."""
    is_the_cut(read(tmp_path, text_of("X_Value\tforce_N\tposition_m\tComment", ROWS, "\t")))
    is_the_cut(read(tmp_path, text_of(HEADER, [(str(k), *row) for k, row in enumerate(ROWS, start=1)])))
    with pytest.raises(TraceError, match="row 2: 3 cells, the header has 4"):
        read(tmp_path, text_of("time_s,force_N,position_m,speed_m", ROWS))


def test_decimals_after_a_comma_between_commas_are_refused_with_the_remedy(tmp_path: Path) -> None:
    """Nothing tells where such cells end."""
    rows = [[cell.replace(".", ",") for cell in row] for row in ROWS]
    with pytest.raises(TraceError, match="row 2: 6 cells, the header has 3; separate cells by semicolons if decimals"):
        read(tmp_path, text_of(HEADER, rows))


@pytest.mark.parametrize("empty", [[], [""]])
def test_specimens_beside_each_other_are_records_of_their_own(tmp_path: Path, empty: list[str]) -> None:
    """The same columns again, with an empty one between them or not; the second specimen is shorter."""
    names = [*"Time (s),Force (N),Height (m)".split(","), *empty]
    short = [*ROWS[:600], *[("", "", "")] * 40]
    rows = [("one", *a, *empty, *b)[1:] for a, b in zip(ROWS, short, strict=True)]
    trace = read(tmp_path, text_of(",".join([*names, *names[:3]]), rows))
    (first, middle), (_, last) = find_cuts(trace)
    assert (first, middle, last) == (0, 640, 1240)
    np.testing.assert_allclose(trace.force[640:], CUT.force[:600], atol=1e-4)
    assert any("stand beside each other 2 times; each is a record of its own" in note for note in trace.notes)


@pytest.mark.parametrize(
    ("header", "encoding"),
    [
        ("Prüfzeit [s],Standardkraft [N],Höhe [m]", "cp1252"),
        ("Temps (s),Force (N),Hauteur (m)", "utf-8"),
        ("Tiempo (s),Fuerza (N),Altura (m)", "utf-8"),
        ("時間(s),試験力(N),高さ(m)", "cp932"),
        ("Latest: Time (s),Latest: Force (N),Latest: Position (m)", "utf-8"),
        ("Run 1: Time (s),Run 1: Force (N),Run 1: Position (m)", "utf-8"),
    ],
)
def test_names_in_other_languages_and_with_the_run_before_them(tmp_path: Path, header: str, encoding: str) -> None:
    """Headers of machines and of teaching loggers."""
    is_the_cut(read(tmp_path, text_of(header, ROWS), encoding))


def test_the_only_measured_force_beside_a_commanded_one_is_taken_in_its_unit(tmp_path: Path) -> None:
    """Its unit is not stated, that of the command is; what was assumed is said."""
    rows = [(t, "5.0", f, z) for t, f, z in ROWS]
    trace = read(tmp_path, text_of("time_s,target_force_N,Fz,position_m", rows))
    is_the_cut(trace)
    assert trace.columns["force"] == "Fz"
    assert any("no unit is stated for Fz, which is taken in N as target_force_N is" in note for note in trace.notes)
