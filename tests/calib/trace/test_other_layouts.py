"""Records of further programs and loggers give the same cut, or one clear error."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.conditioning import Conditioned, condition
from calib.trace.trace import Trace
from cutcal import Calibration
from tests.calib.made_cuts import made_cut, plain_rows, read, text_of

CUT = made_cut()
TRUE = condition(CUT.trace())
EPOCH = 1_700_000_000
HEADER = "time_s,force_N,position_m"


def is_the_cut(trace: Trace) -> Conditioned:
    """Contact, peak and stroke are those of the made-up cut."""
    done = condition(trace)
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=5e-3)
    assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, rel=5e-3)
    assert done.onset_s == pytest.approx(TRUE.onset_s, abs=0.01)
    return done


def rows(length: float = 1e-3, force: float = 1.0) -> list[tuple[str, ...]]:
    """Time [s], force and way down in other units."""
    columns = zip(CUT.time, CUT.force / force, 1e-3 * CUT.depth_mm / length, strict=True)
    return [(f"{t:.4f}", f"{f:.5f}", f"{d:.5f}") for t, f, d in columns]


def comma(cells: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Decimals after a comma."""
    return [tuple(cell.replace(".", ",") for cell in row) for row in cells]


@pytest.mark.parametrize(
    ("header", "encoding"),
    [
        ("Temps d'essai [s];Force standard [N];Course standard [mm]", "cp1252"),
        ("Tiempo de ensayo [s];Fuerza estándar [N];Recorrido [mm]", "cp1252"),
        ("Tempo di prova [s];Forza standard [N];Corsa traversa [mm]", "utf-8"),
        ("Zeit [Sekunden];Last [N];Distanz [mm]", "utf-8"),
        ("Prüfzeit [s];Prüfkraft [N];Traversenweg [mm]", "mac_roman"),
        ("Время, с;Нагрузка, Н;Перемещение, мм", "cp1251"),
        ("Czas [s];Siła [N];Przemieszczenie [mm]", "cp1250"),
        ("时间(s);力(N);位移(mm)", "gb18030"),
        ("시간(s);하중(N);변위(mm)", "cp949"),
        ("Time measurement (s);Load cell 1 (N);Disp (mm)", "utf-8"),
    ],
)
def test_headers_of_other_countries(tmp_path: Path, header: str, encoding: str) -> None:
    """Words for time, force and way in the encodings of their countries."""
    is_the_cut(read(tmp_path, text_of(header, comma(rows()), ";").encode(encoding)))


@pytest.mark.parametrize("unit", ["kg-force", "lb-force", "g-force"])
def test_units_of_force_written_out(tmp_path: Path, unit: str) -> None:
    """They are those of a load cell given as a mass."""
    factor = {"kg": 9.80665, "lb": 4.4482216152605, "g-": 9.80665e-3}[unit[:2]]
    is_the_cut(read(tmp_path, text_of(f"Time,Force,Distance\nsec,{unit},mm", rows(force=factor))))


def test_results_above_the_data_are_no_table(tmp_path: Path) -> None:
    """A short list of results with its own header, as Bluehill writes it."""
    results = '"Results Table 1"\n"","Maximum Load (N)","Extension at Maximum Load (mm)"\n"1","15.1","22.0"\n\n'
    is_the_cut(read(tmp_path, text_of(results + "Time (s),Load (N),Compressive extension (mm)", rows())))


def test_headers_in_comments(tmp_path: Path) -> None:
    """The comment that names columns is found among others; a remark below the data is none."""
    body = text_of("", [(t, f, z) for t, f, z in plain_rows(CUT)]).lstrip("\n")
    for head in (
        "# time_s,force_N,position_m\n# knife: straight, 2 mm, sharp\n",
        "# time,force,position\n# s,N,m\n",
        "# units: s, N, m\n# time, force, position\n",
        "# columns: time (s), force (N), position (m)\n",
    ):
        is_the_cut(read(tmp_path, head + body + "# end,of,data\n"))
    blanks = "# Time [s]  Force [N]  Position [m]\n" + body.replace(",", " ")
    is_the_cut(read(tmp_path, blanks))


def test_labview_without_a_column_of_times(tmp_path: Path) -> None:
    """Its header says the step of the time; comments may stand in some rows alone."""
    head = "LabVIEW Measurement\t\nX_Columns\tNo\n***End_of_Header***\t\n\nX0\t0.0\t0.0\t\nDelta_X\t0.005\t0.005\t\n"
    body = [("", f, z) for _, f, z in plain_rows(CUT)]
    trace = read(tmp_path, text_of(head + "X_Value\tforce_N\tposition_m\tComment", body, "\t"))
    is_the_cut(trace)
    assert any("times go on by the Delta_X of 0.005 s" in note for note in trace.notes)
    ragged = [(*row, "start") if k == 3 else row for k, row in enumerate(plain_rows(CUT))]
    is_the_cut(read(tmp_path, text_of("X_Value\tforce_N\tposition_m\tComment", ragged, "\t")))


def test_the_same_column_twice_is_one(tmp_path: Path) -> None:
    """With the same numbers it is left out with a note; with others it is refused."""
    twice = [(t, f, t, z) for t, f, z in plain_rows(CUT)]
    trace = read(tmp_path, text_of("time_s,force_N,time_s,position_m", twice))
    is_the_cut(trace)
    assert any("column time_s stands there twice with the same numbers" in note for note in trace.notes)
    other = [(t, f, f"{2 * float(f)}", z) for t, f, z in plain_rows(CUT)]
    with pytest.raises(TraceError, match="'force_N' occurs 2 times"):
        read(tmp_path, text_of("time_s,force_N,force_N,position_m", other))


def test_compressed_records(tmp_path: Path) -> None:
    """gzip, bzip2, xz and an archive of one file; one of several is refused with their names."""
    text = text_of(HEADER, plain_rows(CUT)).encode()
    for name, raw in (
        ("cut.csv.gz", gzip.compress(text)),
        ("cut.csv.bz2", bz2.compress(text)),
        ("cut.xz", lzma.compress(text)),
    ):
        is_the_cut(read(tmp_path, raw, name))
    for names in (("cut.csv",), ("a.csv", "b.csv")):
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for name in names:
                archive.writestr(name, text)
        if len(names) == 1:
            is_the_cut(read(tmp_path, packed.getvalue(), "cut.zip"))
    with pytest.raises(TraceError, match=r"cut.zip: an archive of 2 files \(a.csv, b.csv\); unpack it"):
        read(tmp_path, packed.getvalue(), "cut.zip")
    with pytest.raises(TraceError, match="cut.csv.gz: damaged"):
        read(tmp_path, gzip.compress(text)[:900], "cut.csv.gz")


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_clock_since_1970_says_its_unit(tmp_path: Path, unit: str, factor: float) -> None:
    """The size of its numbers does; a clock from zero does not, and the error names the likely unit."""
    times = [f"{(EPOCH + t) * factor:.6f}" if unit == "s" else str(round((EPOCH + t) * factor)) for t in CUT.time]
    body = [(t, f, z) for t, (_, f, z) in zip(times, plain_rows(CUT), strict=True)]
    trace = read(tmp_path, text_of("timestamp,force_N,position_m", body))
    is_the_cut(trace)
    assert any(f"timestamp counts since 1970, so it is taken in {unit}" in note for note in trace.notes)
    since_zero = [(f"{t * factor:.3f}", *row[1:]) for t, row in zip(CUT.time, plain_rows(CUT), strict=True)]
    with pytest.raises(TraceError, match=f"name it with its unit: --time-col 't={unit}'.*--rate"):
        read(tmp_path, text_of("t,force_N,position_m", since_zero))


@pytest.mark.parametrize(
    "written",
    ["20240612T1733{:09.6f}", "Jun 12, 2024 05:33:{:09.6f} PM", "Wed Jun 12 17:33:{:09.6f} 2024"],
)
def test_further_stamps(tmp_path: Path, written: str) -> None:
    """Stamps without marks, with the month first, and as Unix prints them; the column needs no name."""
    body = [(written.format(t + 10.0), f, z) for t, (_, f, z) in zip(CUT.time, plain_rows(CUT), strict=True)]
    for header in ("timestamp;force_N;position_m", ";force_N;position_m"):
        is_the_cut(read(tmp_path, text_of(header, body, ";")))


def test_two_columns_of_one_clock(tmp_path: Path) -> None:
    """The first is used with a note; two that differ are refused."""
    body = [(f"{EPOCH + t:.4f}", *row) for t, row in zip(CUT.time, plain_rows(CUT), strict=True)]
    trace = read(tmp_path, text_of("timestamp_s,time_s,force_N,position_m", body))
    is_the_cut(trace)
    assert any("timestamp_s, time_s are one clock; timestamp_s is used" in note for note in trace.notes)
    body = [(f"{1.1 * t:.4f}", *row) for t, row in zip(CUT.time, plain_rows(CUT), strict=True)]
    with pytest.raises(TraceError, match="several columns could be the time"):
        read(tmp_path, text_of("timestamp_s,time_s,force_N,position_m", body))


@pytest.mark.parametrize("mark", ["'", ",", "."])
def test_thousands_of_whole_numbers(tmp_path: Path, mark: str) -> None:
    """An apostrophe sets them off, or a mark that the numbers below a thousand of a column have not."""
    body = [tuple(f"{x:,.0f}".replace(",", mark) for x in (1e3 * t, 1e3 * f, 1e6 * z)) for t, f, z in _triples()]
    is_the_cut(read(tmp_path, text_of("time_ms;force_mN;position_um", body, ";")))


def _triples() -> list[tuple[float, float, float]]:
    """Time, force and height of each sample."""
    return [(float(t), float(f), float(z)) for t, f, z in zip(CUT.time, CUT.force, CUT.height, strict=True)]


def test_messages_say_which_column_was_meant(tmp_path: Path) -> None:
    """A unit of something else, the only column in newtons, and that --force-col Fz=N is not said of pounds."""
    with pytest.raises(TraceError, match=r"'force \(kPa\)' has the unit 'kPa', which is none of a force"):
        read(tmp_path, text_of("time_s,force (kPa),position_m", plain_rows(CUT)))
    with pytest.raises(TraceError, match=r"the only one in a unit of force is 'Channel 1 \(N\)'"):
        read(tmp_path, text_of("time_s,Channel 1 (N),position_m", plain_rows(CUT)))
    pounds = [(t, f"{float(f) / 4.4482216152605:.6f}", z) for t, f, z in plain_rows(CUT)]
    is_the_cut(read(tmp_path, text_of('"Force Units: lbf"\ntime_s,Fz,position_m', pounds)))
    both = [(t, z, f, f"{0.9 * float(f):.4f}") for t, f, z in plain_rows(CUT)]
    with pytest.raises(TraceError, match="several columns could be the force: ft_raw_wrench_2, actual_TCP_force_2"):
        read(tmp_path, text_of("timestamp,actual_TCP_pose_2,ft_raw_wrench_2,actual_TCP_force_2", both))


Order = Callable[[np.ndarray], np.ndarray]


@pytest.mark.parametrize(
    ("order", "said"),
    [
        (lambda n: n[::-1], "time falls from row to row; the record was turned round"),
        (lambda n: np.r_[n[:300], n[290:]], "10 rows, the first is row 302, repeat earlier ones"),
        (lambda n: np.r_[n[:300], 301, 300, n[302:]], "2 rows are not in the order of their times; they were sorted"),
    ],
)
def test_rows_out_of_order(tmp_path: Path, order: Order, said: str) -> None:
    """A record from its end, pieces that overlap, and a row that came late."""
    cells = plain_rows(CUT)
    trace = read(tmp_path, text_of(HEADER, [cells[i] for i in order(np.arange(640))]))
    is_the_cut(trace)
    assert any(said in note for note in trace.notes), trace.notes


@pytest.mark.parametrize("wrong", [0.0, 9999.0])
def test_a_lone_wrong_time(tmp_path: Path, wrong: float) -> None:
    """Its row is left out, and said."""
    cells = plain_rows(CUT)
    cells[300] = (f"{wrong:.4f}", *cells[300][1:])
    trace = read(tmp_path, text_of(HEADER, cells))
    if wrong == 0.0:
        assert any("row 302, column time_s: 1 of the times stand out alone" in note for note in trace.notes)
    is_the_cut(trace)


def test_a_clock_that_begins_again_while_the_knife_moves_on(tmp_path: Path) -> None:
    """The knife's place shows that it is one cut."""
    time = np.where(np.arange(640) < 300, CUT.time, CUT.time - CUT.time[300])
    cells = [(f"{t:.4f}", *row[1:]) for t, row in zip(time, plain_rows(CUT), strict=True)]
    done = is_the_cut(read(tmp_path, text_of(HEADER, cells)))
    assert any("the clock jumps back by 1.5" in note for note in done.warnings), done.warnings


CUT_AND = "time_s,force_N"
"""Columns of a record without a position."""
JOINTS = [f"{kind}{k}" for kind in ("q", "dq", "tau") for k in range(7)]


@pytest.mark.parametrize(
    ("header", "how", "words"),
    [
        (CUT_AND + ",position_m", {}, None),
        (CUT_AND + ",frame", {}, None),
        (CUT_AND + ",temp_C,operator", {}, "temp_C, operator"),
        ("time_s,Fx_N,Fz_N", {"force_col": "Fz_N"}, "Fx_N"),
        (
            CUT_AND + ",Prüfweg [mm]",
            {},
            "Prüfweg [mm] (a length; --position-col takes it as the knife's height, --depth-col as its depth)",
        ),
        (CUT_AND + ",Prüfweg [mm]", {"position_col": "none"}, "Prüfweg [mm]"),
        (CUT_AND + ",weg", {}, "weg (no unit; if it is the knife's place: --position-col 'weg=mm')"),
        (CUT_AND + ",position_m,Prüfweg [mm]", {}, "Prüfweg [mm]"),
        (",".join([CUT_AND, *JOINTS]), {}, "q0, q1, q2, q3, q4 and 16 more columns"),
    ],
)
def test_columns_that_are_not_used_are_named(
    tmp_path: Path, header: str, how: dict[str, Any], words: str | None
) -> None:
    """One sentence names them, what could be the knife's place with its option, and of many the first."""
    number = {"time_s": 0, "force_N": 1, "Fz_N": 1, "position_m": 2}
    cells = [
        ",".join(row[number[name]] if name in number else str(k) for name in header.split(","))
        for k, row in enumerate(rows())
    ]
    trace = read(tmp_path, "\n".join([header, *cells]), **how)
    said = [note for note in trace.notes if note.startswith("cut.csv: not used: ")]
    assert said == ([] if words is None else [f"cut.csv: not used: {words}"])


def test_no_column_is_called_unused_twice(tmp_path: Path) -> None:
    """What another note names is left to it: a clock beside a rate, and a force that was commanded."""
    cells = [f"{row[0]},{row[1]},0.0" for row in rows()]
    beside = read(tmp_path, "\n".join(["time_s,force_N,temp_C", *cells]), rate=1000.0)
    assert [note.partition(": ")[2] for note in beside.notes] == [
        "time is counted by rows at 1000 a second (--rate); the clock time_s is not used",
        "not used: temp_C",
    ]
    bare = read(tmp_path, "\n".join(["time_s,Fz,target_force_N", *cells]))
    assert len(bare.notes) == 1 and "target_force_N" in bare.notes[0]


def test_a_check_names_the_columns_that_are_not_used(tmp_path: Path) -> None:
    """From the command line with its options, and from Python with its arguments."""
    path = tmp_path / "cut.csv"
    path.write_text("\n".join(["time_s,force_N,Prüfweg [mm]", *(",".join(row) for row in rows())]), encoding="utf-8")
    (said,) = [line for line in Calibration("banana", path).check().splitlines() if "not used" in line]
    assert said.startswith("note: cut.csv: not used: Prüfweg [mm] (a length; position_col takes it")


@pytest.mark.parametrize(
    ("how", "missing"),
    [
        ({"time_col": "zeit", "force_col": "kraft", "position_col": "weg"}, ["zeit", "kraft", "weg"]),
        ({"time_col": "zeit", "force_col": "kraft", "depth_col": "weg"}, ["zeit", "kraft", "weg"]),
        ({"force_col": "kraft", "position_col": "weg"}, ["kraft", "weg"]),
        ({"time_col": "zeit", "position_col": "weg"}, ["zeit", "weg"]),
        ({"position_col": "weg"}, ["weg"]),
    ],
)
def test_all_columns_that_are_missing_are_named_at_once(
    tmp_path: Path, how: dict[str, str], missing: list[str]
) -> None:
    """One error for time, force and place, which says once what columns there are."""
    with pytest.raises(TraceError) as caught:
        read(tmp_path, text_of("time_s,force_N", [row[:2] for row in rows()]), **how)
    options = {name: option for option, name in how.items()}
    said = [f"no column '{name}' (--{options[name].replace('_', '-')})" for name in missing]
    said[0] += "; the columns are time_s, force_N"
    assert str(caught.value) == f"cut.csv: {'; and '.join(said)}"


@pytest.mark.parametrize("fault", ["late", "twice", "ticks"])
def test_a_record_from_its_end_may_have_other_faults(tmp_path: Path, fault: str) -> None:
    """It is turned round first, and said; then a row that came late, one that is there twice, or a slow clock."""
    cells = plain_rows(CUT)[::-1]
    if fault == "late":
        cells[50], cells[51] = cells[51], cells[50]
    elif fault == "twice":
        cells[50] = cells[49]
    else:
        cells = [(f"{int(25 * float(row[0])) / 25:.2f}", *row[1:]) for row in cells]
    trace = read(tmp_path, text_of(HEADER, cells))
    assert trace.notes[0] == "cut.csv: time falls from row to row; the record was turned round"
    assert len(trace.notes) == 2
    is_the_cut(trace)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("word", "there"), [("nan", True), ("", True), ("left out", False)])
def test_rows_without_a_number_are_told_from_rows_that_are_not_there(
    tmp_path: Path, word: str, there: bool, turned: bool
) -> None:
    """A gap that is bridged: in the file are rows with nan or nothing in them, or none, also where the file begins with
    the last sample; the rows beside it are named as the file counts them."""
    cells = plain_rows(CUT)
    cells[300:306] = [(row[0], word, row[2]) for row in cells[300:306]] if there else []
    last = len(cells)
    cells = cells[::-1] if turned else cells
    said = [note for note in condition(read(tmp_path, text_of(HEADER, cells))).warnings if "a line bridges it" in note]
    what = "rows without a number (empty or nan) were written" if there else "no samples were written"
    assert len(said) == 1 and f": {what} for " in said[0]
    beside = [299, 306 if there else 300]
    numbers = [last - 1 - i if turned else i for i in beside]
    assert re.findall(r"row (\d+) \(", said[0]) == [str(2 + number) for number in numbers]
