"""Reading traces: columns, units, signs, and what a user reads when a file is wrong."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.trace import MIN_SAMPLES, Trace, read_trace
from mpm.scene.errors import CutcalError
from tests.data_dir import ROOT, data_file

N = 40


def write(folder: Path, header: str, columns: list[np.ndarray], *, before: str = "", sep: str = ",") -> Path:
    """A CSV file with the given header and columns."""
    path = folder / "cut.csv"
    rows = "".join(sep.join(f"{value:.9g}" for value in row) + "\n" for row in zip(*columns, strict=True))
    path.write_text(f"{before}{header}\n{rows}")
    return path


def clock() -> np.ndarray:
    """Forty samples at 100 Hz [s]."""
    return np.arange(N) / 100.0


def load() -> np.ndarray:
    """A force that rises after ten samples [N]."""
    return 2.0 + np.maximum(0.0, np.arange(N) - 10.0)


@pytest.mark.parametrize(
    ("name", "scale"),
    [
        ("force_N", 1.0),
        ("fz_N", 1.0),
        ("cut_force_z_N", 1.0),
        ("force_kN", 1e-3),
        ("Force [mN]", 1e3),
        ("Load (N)", 1.0),
    ],
)
def test_force_units_come_from_the_name(tmp_path: Path, name: str, scale: float) -> None:
    """Each spelling of a force column is found and converted to newtons."""
    trace = read_trace(write(tmp_path, f"time_s,{name}", [clock(), load() * scale]))
    np.testing.assert_allclose(trace.force, load())
    assert trace.columns == {"time": "time_s", "force": name}
    assert trace.position is None


@pytest.mark.parametrize(("name", "scale"), [("time_s", 1.0), ("t_s", 1.0), ("time_ms", 1e3), ("Time [s]", 1.0)])
def test_time_units_come_from_the_name(tmp_path: Path, name: str, scale: float) -> None:
    """Seconds and milliseconds give the same clock."""
    trace = read_trace(write(tmp_path, f"{name},force_N", [clock() * scale, load()]))
    np.testing.assert_allclose(trace.time, clock())
    assert trace.dt == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("name", "scale"),
    [("ee_z_m", 1.0), ("position_m", 1.0), ("knife_z_m", 1.0), ("position_mm", 1e3), ("stroke_m", -1.0)]
    + [("displacement_mm", -1e3)],
)
def test_heights_and_depths_become_heights(tmp_path: Path, name: str, scale: float) -> None:
    """A depth that counts downwards is turned into a height that counts upwards, in metres."""
    height = 0.05 - 0.01 * clock()
    trace = read_trace(write(tmp_path, f"time_s,force_N,{name}", [clock(), load(), height * scale]))
    assert trace.position is not None
    np.testing.assert_allclose(trace.position, height)


def test_robot_log_prefers_the_raw_force_and_turns_its_sign(tmp_path: Path) -> None:
    """base_Fz_N, negative when pressing down, wins over a derived column and becomes positive."""
    header = "time_s,ee_z_m,base_Fx_N,base_Fz_N,knife_Fz_N,cut_force_z_N"
    columns = [clock(), -clock(), 0 * clock(), -load(), load(), 99.0 + clock()]
    trace = read_trace(write(tmp_path, header, columns))
    np.testing.assert_allclose(trace.force, load())
    assert trace.columns == {"time": "time_s", "force": "base_Fz_N", "position": "ee_z_m"}


def test_simulated_force_file_reads_back(tmp_path: Path) -> None:
    """The columns of a simulated force file need no options: knife force by name, stroke as depth."""
    header = "stroke_m,time_s,knife_fx_N,knife_fy_N,knife_fz_N,board_fz_N"
    columns = [clock(), clock(), 0 * clock(), 0 * clock(), load(), -load()]
    trace = read_trace(write(tmp_path, header, columns))
    np.testing.assert_allclose(trace.force, load())
    assert trace.position is not None
    np.testing.assert_allclose(trace.position, -clock())


@pytest.mark.parametrize(("sign", "factor"), [("+", 1.0), ("-", -1.0), (1, 1.0), (-1, -1.0)])
def test_sign_overrides(tmp_path: Path, sign: str | int, factor: float) -> None:
    """The sign option says which numbers mean resistance, whatever the column's own convention."""
    for name in ("force_N", "base_Fz_N"):
        trace = read_trace(write(tmp_path, f"time_s,{name}", [clock(), load()]), sign=sign)
        np.testing.assert_allclose(trace.force, factor * load())


def test_named_columns_without_units_are_si(tmp_path: Path) -> None:
    """Columns named by the user are SI if their names carry no unit; position can be switched off."""
    path = write(tmp_path, "clock,pull,ee_z_m", [clock(), load(), -clock()])
    trace = read_trace(path, time_col="clock", force_col="pull", position_col="none")
    np.testing.assert_allclose(trace.force, load())
    assert trace.position is None


def test_comments_label_and_hash(tmp_path: Path) -> None:
    """Comment lines are skipped, the label is read, and the hash is that of the file's bytes."""
    path = write(tmp_path, "time_s,force_N", [clock(), load()], before="# label: reconstructed\n# more\n\n")
    trace = read_trace(path)
    assert trace.label == "reconstructed"
    assert trace.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert trace.source == "cut.csv"


def test_semicolons_and_tabs_separate_too(tmp_path: Path) -> None:
    """The separator follows from the header."""
    for sep in (";", "\t"):
        trace = read_trace(write(tmp_path, f"time_s{sep}force_N", [clock(), load()], sep=sep))
        np.testing.assert_allclose(trace.force, load())


def test_missing_file_names_its_neighbour(tmp_path: Path) -> None:
    """A mistyped file name is answered with the nearest one in the folder; a folder is refused."""
    write(tmp_path, "time_s,force_N", [clock(), load()])
    with pytest.raises(TraceError, match="no such file; did you mean cut.csv"):
        read_trace(tmp_path / "cuts.csv")
    with pytest.raises(TraceError, match="is a directory"):
        read_trace(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"# only words\n", "nothing but comments"),
        (b"time_s,force_N\n", "a header but no data"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "not a text CSV"),
        (b"time_s,force_N\n0,\0\n", "zero bytes"),
        (b"just some words\nand more\n", "not a CSV file"),
        (b"0.0,1.0\n0.1,1.0\n", "add a header"),
        (b"time_s,force_N,force_N\n0,1,1\n", "'force_N' occurs 2 times"),
        (b'time_s,force_N\n0,"1\n', "row 2: not CSV .unexpected end of data.; check the quotes"),
        (b"time_s,force_N\n0," + b"1" * 140_000, "row 2: not CSV .field larger than field limit"),
        (b'time_s,force_N\n0,"1\n\n2"\n1,2,3\n', "row 5: 3 cells, the header has 2"),
        (
            b",".join(b"c%d" % i for i in range(3000)) + b"\n" + b"1," * 2999 + b"1\n",
            "the columns are c0, .* and 2992 more;",
        ),
        (b"odd\x07,f%s\n0,1\n" % (b"x" * 500), r"the columns are odd\\x07, fxxx.*xxx\.\.\.;"),
        (
            b"# label: guessed\ntime_s,force_N\n" + b"".join(b"0.%02d,1\n" % i for i in range(30)),
            "label 'guessed'",
        ),
    ],
)
def test_unusable_files(tmp_path: Path, content: bytes, message: str) -> None:
    """Each way in which a file is no trace has its own message."""
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(TraceError, match=message):
        read_trace(path)


def test_too_few_rows(tmp_path: Path) -> None:
    """A file with fewer rows than the minimum is refused with both numbers."""
    with pytest.raises(TraceError, match=f"19 rows of data, at least {MIN_SAMPLES}"):
        read_trace(write(tmp_path, "time_s,force_N", [clock()[:19], load()[:19]]))


def test_missing_columns_suggest_names(tmp_path: Path) -> None:
    """A misspelt column, found or asked for, is answered with the nearest existing one and the option."""
    path = write(tmp_path, "time_s,forse_N", [clock(), load()])
    with pytest.raises(TraceError, match="no force column.*did you mean 'forse_N'.*--force-col"):
        read_trace(path)
    with pytest.raises(TraceError, match="no column 'Forse' .--force-col.; did you mean 'forse_N'"):
        read_trace(path, force_col="Forse")
    with pytest.raises(TraceError, match="no column 'depth'.*the columns are time_s, forse_N"):
        read_trace(path, force_col="forse_N", position_col="depth")


def test_ambiguous_force_lists_the_candidates(tmp_path: Path) -> None:
    """Two possible force columns are not guessed between; naming one helps."""
    path = write(tmp_path, "time_s,force_N,fz_N,fx_N", [clock(), load(), 2 * load(), load()])
    with pytest.raises(TraceError, match="several columns could be the force: force_N, fz_N; .*--force-col"):
        read_trace(path)
    np.testing.assert_allclose(read_trace(path, force_col="fz_N").force, 2 * load())


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("abc", "row 8, column force_N: 'abc' is not a number"),
        ("inf", "row 8, column force_N: 'inf' is not finite"),
        ("1_000", "row 8, column force_N: '1_000' is not a number"),
        ("1\x0c2", r"row 8, column force_N: '1\\x0c2' is not a number"),
        ("9" * 300, r"row 8, column force_N: '9999.*9\.\.\.' is beyond 1e\+06 N"),
        ("1,5", "row 8: 3 cells, the header has 2"),
        ('"1,5"', "row 8, column force_N: '1,5' is not a number; write decimals with a point"),
    ],
)
def test_bad_cells_are_located(tmp_path: Path, cell: str, message: str) -> None:
    """A cell that is no number is named with the file's own row number, comment and blank lines counted."""
    path = write(tmp_path, "time_s,force_N", [clock(), load()], before="# a comment\n\n")
    lines = path.read_text().splitlines()
    lines[7] = f"{lines[7].split(',')[0]},{cell}"
    path.write_text("\n".join(lines))
    with pytest.raises(TraceError, match=f"cut.csv, {message}"):
        read_trace(path)


@pytest.mark.parametrize("cell", ["", "nan", "N/A", "#N/A", "-", "1.#QNAN"])
def test_a_row_without_a_force_is_left_out(tmp_path: Path, cell: str) -> None:
    """It is a sample that is missing, and said with its row; the first of more is named."""
    path = write(tmp_path, "time_s,force_N", [clock(), load()])
    lines = path.read_text().splitlines()
    lines[7] = f"{lines[7].split(',')[0]},{cell}"
    path.write_text("\n".join(lines))
    trace = read_trace(path)
    np.testing.assert_allclose(trace.force, np.delete(load(), 6))
    assert "cut.csv: row 8 was left out, without a number in column force_N" in trace.notes
    lines[9] = lines[7]
    path.write_text("\n".join(lines))
    assert any("2 rows, the first is row 8, were left out" in note for note in read_trace(path).notes)


def test_cells_of_several_lines_do_not_shift_the_rows(tmp_path: Path) -> None:
    """A remark in quotes may hold a line break; the rows after it keep their numbers."""
    path = write(tmp_path, "time_s,force_N", [clock(), load()])
    lines = [f"{line},fine" for line in path.read_text().splitlines()]
    lines[0], lines[3] = "time_s,force_N,remark", lines[3].replace("fine", '"not\nfine"')
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(read_trace(path).force, load())
    path.write_text("\n".join(lines).replace("0.1,", "now,"))
    with pytest.raises(TraceError, match="row 13, column time_s: 'now'"):
        read_trace(path)


def test_bad_cells_of_unused_columns_do_not_matter(tmp_path: Path) -> None:
    """A column that is not used may hold anything."""
    path = write(tmp_path, "time_s,force_N,remark", [clock(), load(), np.full(N, np.nan)])
    assert len(read_trace(path).time) == N


def test_time_must_increase(tmp_path: Path) -> None:
    """A clock that stands or restarts is located by row."""
    time = clock()
    time[20] = time[19]
    with pytest.raises(TraceError, match="row 22, column time_s: time does not increase"):
        read_trace(write(tmp_path, "time_s,force_N", [time, load()]))


def test_swapped_columns_are_recognised(tmp_path: Path) -> None:
    """A force that runs like a clock beside a time that does not is called swapped."""
    with pytest.raises(TraceError, match="time_s and force_N look swapped"):
        read_trace(write(tmp_path, "time_s,force_N", [np.sin(clock() * 50.0), clock()]))


def test_milliseconds_named_seconds(tmp_path: Path) -> None:
    """Samples ten seconds apart are taken for milliseconds."""
    with pytest.raises(TraceError, match="10 s apart; this looks like milliseconds"):
        read_trace(write(tmp_path, "time_s,force_N", [clock() * 1e3, load()]))


def test_bad_sign(tmp_path: Path) -> None:
    """A sign that is none is refused, as a CutcalError that the command line can print."""
    with pytest.raises(CutcalError, match="sign 'up'"):
        read_trace(write(tmp_path, "time_s,force_N", [clock(), load()]), sign="up")


def test_traces_made_in_memory_are_checked() -> None:
    """The data class refuses unequal lengths, NaN, and a clock that does not run."""
    good: dict[str, Any] = {
        "time": clock(),
        "force": load(),
        "position": None,
        "source": "x",
        "sha256": "",
        "columns": {},
    }
    assert Trace(**good).label == "measured"
    for change, message in (
        ({"force": load()[:-1]}, "shape"),
        ({"force": np.full(N, np.nan)}, "NaN"),
        ({"time": clock()[::-1]}, "increasing"),
        ({"time": clock()[:5], "force": load()[:5]}, "5 samples"),
        ({"label": "dreamt"}, "label"),
    ):
        with pytest.raises(TraceError, match=message):
            Trace(**{**good, **change})


def test_reconstructed_banana_reads_as_reconstructed() -> None:
    """The trace that ships with the package carries its label and the published rate."""
    trace = read_trace(ROOT / "force_data" / "banana_reconstructed.csv")
    assert trace.label == "reconstructed"
    assert trace.dt == pytest.approx(1.0 / 60.0, rel=1e-3)
    assert trace.position is None


def test_published_traces_need_no_options() -> None:
    """A robot log and a digitised curve with a model beside it are read as they are."""
    log = read_trace(data_file("franka_knife_cutting", "apple1_edc_cut1.csv"))
    assert log.columns == {"time": "time_s", "force": "base_Fz_N", "position": "ee_z_m"}
    assert 45.0 < log.force.max() < 50.0
    digitised = read_trace(data_file("sliceit_digitised", "cucumber_20mms.csv"))
    assert digitised.columns == {"time": "time_s", "force": "force_N"}
