"""Columns that are called otherwise than usual, and rows that programs write beside the samples, give the same cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.conditioning import Conditioned, condition
from calib.trace.names import from_joint_torques
from calib.trace.trace import Trace
from tests.calib.made_cuts import made_cut, plain_rows, read, text_of

CUT = made_cut()
TRUE = condition(CUT.trace())
HEADER = "time_s,force_N,position_m"
DAY = [f"17:33:{33 + t:06.3f}" for t in CUT.time]


def is_the_cut(trace: Trace) -> Conditioned:
    """Contact, peak and stroke are those of the made-up cut."""
    done = condition(trace)
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=5e-3)
    assert done.stroke_source == "position"
    assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, rel=5e-3)
    assert done.onset_s == pytest.approx(TRUE.onset_s, abs=0.01)
    return done


def cells(place: np.ndarray, clock: list[str] | np.ndarray = CUT.time) -> list[tuple[str, str, str]]:
    """Time [s] or another clock, force [N] and a place of the knife."""
    times = [t if isinstance(t, str) else f"{t:.4f}" for t in clock]
    return [(t, f"{f:.4f}", f"{p:.4f}") for t, f, p in zip(times, CUT.force, place, strict=True)]


UP, DOWN = 1e3 * CUT.height, CUT.depth_mm


@pytest.mark.parametrize(
    ("name", "place", "kind"),
    [
        ("Crosshead position (mm)", 250.0 - DOWN, "height"),
        ("Crosshead position (mm)", 50.0 + DOWN, "depth"),
        ("Axial position [mm]", -DOWN, "height"),
        ("z_act_mm", UP, "height"),
        ("actual_position_mm", UP, "height"),
        ("tcp_pose_z_mm", UP, "height"),
        ("s [mm]", DOWN, "depth"),
        ("Z Position (mm)", UP, "height"),
        ("Gap [mm]", UP, "height"),
        ("Crosshead separation (mm)", 250.0 - DOWN, "height"),
        ("Deformation [mm]", DOWN, "depth"),
        ("Ext(mm)", DOWN, "depth"),
    ],
)
def test_the_force_tells_how_a_place_is_counted(tmp_path: Path, name: str, place: np.ndarray, kind: str) -> None:
    """A name that does not say it is read beside one that was commanded, and what it was taken for is said."""
    body = [(*row, "7.0") for row in cells(place)]
    done = is_the_cut(read(tmp_path, text_of(f"time_s,force_N,{name},z_cmd_mm", body)))
    assert any(f"{name} " in note and f"so it is taken for its {kind}" in note for note in done.warnings)


def test_a_place_whose_name_says_how_it_is_counted_goes_before_another(tmp_path: Path) -> None:
    """A second column does not make the first one doubtful."""
    body = [(*row, "7.0") for row in cells(UP)]
    is_the_cut(read(tmp_path, text_of("time_s,force_N,position_mm,z_act_mm", body)))


@pytest.mark.parametrize(
    "header",
    [
        "Temps (s);Effort (N);Déplacement (mm)",
        "Temps en s;Force en N;Course en mm",
        "Zeit [s];Schneidkraft [N];Verfahrweg [mm]",
        "s;N;mm",
        "seconds;Force (N);Stroke (mm)",
        "sec;Force (N);Stroke (mm)",
        "Time..s.;Force..N.;Stroke..mm.",
        "Time.s;Force.N;Stroke.mm",
        "time_s [s];force_N [N];stroke_mm [mm]",
        "Time  1 - default sample rate [s];Force [N];Stroke [mm]",
        "Zeit  1 - Standardmessrate [s];Kraft [N];Weg [mm]",
        "time_s;ForceZ_N;Stroke [mm]",
        "Time;Force;Stroke\ns;N;mm\nFloat64;Float64;Float64",
        "timeSec;forceNewton;strokeMm",
        "TimeS;ForceN;StrokeMM",
    ],
)
def test_further_names_of_time_force_and_way(tmp_path: Path, header: str) -> None:
    """Words, and units that stand in place of a name."""
    is_the_cut(read(tmp_path, text_of(header, cells(DOWN), ";")))


def test_a_unit_is_no_name_beside_other_names(tmp_path: Path) -> None:
    """``mm`` beside a position is another length, ``N`` beside words may be a number of samples."""
    with pytest.raises(TraceError, match="no force column"):
        read(tmp_path, text_of("time_s,N,position_mm", cells(UP)))


def test_a_named_clock_goes_before_one_that_is_called_by_its_unit(tmp_path: Path) -> None:
    """Milliseconds within a second are no second clock."""
    body = [(*row, f"{1e3 * (float(row[0]) % 1):.0f}") for row in cells(UP)]
    is_the_cut(read(tmp_path, text_of("time_s,force_N,position_mm,ms", body)))


def test_seconds_and_nanoseconds_without_a_stamp_in_their_names(tmp_path: Path) -> None:
    """They are one clock."""
    stamps = [(1_700_000_000 + int(t), round(1e9 * (t % 1))) for t in CUT.time]
    body = [(*stamp, *row[1:]) for stamp, row in zip(stamps, cells(UP), strict=True)]
    is_the_cut(read(tmp_path, text_of("sec,nanosec,force_N,position_mm", body)))


@pytest.mark.parametrize("name", ["Uhrzeit", "Zeitstempel", "Time (hh:mm:ss.fff)", "Time of day", "Klo"])
def test_times_of_the_day_under_any_name(tmp_path: Path, name: str) -> None:
    """Their cells show what they are; a date beside them does not matter."""
    body = [("12.06.2024", *row) for row in cells(UP, DAY)]
    is_the_cut(read(tmp_path, text_of(f"Datum;{name};Kraft [N];position_mm", body, ";")))


def test_a_named_clock_goes_before_times_of_the_day(tmp_path: Path) -> None:
    """A stamp in whole seconds beside it is not its rival."""
    body = [(*row, day[:8]) for row, day in zip(cells(UP), DAY, strict=True)]
    is_the_cut(read(tmp_path, text_of("time_s,force_N,position_mm,Uhrzeit", body)))


def test_milliseconds_behind_a_colon_may_lack_their_zeros(tmp_path: Path) -> None:
    """``17:33:33:5`` is five milliseconds where another row has ``17:33:33:995``."""
    milli = np.round(1e3 * CUT.time).astype(int)
    clock = [f"17:33:{33 + k // 1000}:{k % 1000}" for k in milli]
    is_the_cut(read(tmp_path, text_of("Time,force_N,position_mm", cells(UP, clock))))


@pytest.mark.parametrize("unit", ["g-f", "gmf"])
def test_further_units_of_force(tmp_path: Path, unit: str) -> None:
    """They are grams of a load cell."""
    body = [(t, f"{float(f) / 9.80665e-3:.3f}", z) for t, f, z in plain_rows(CUT)]
    is_the_cut(read(tmp_path, text_of(f"time_s,Force ({unit}),position_m", body)))


def test_how_numbers_are_written_does_not_hide_a_column_that_is_not_used(tmp_path: Path) -> None:
    """A length that could be the knife's place is named, although its decimals were said to follow a comma."""
    body = [tuple(cell.replace(".", ",") for cell in row) for row in cells(DOWN)]
    notes = read(tmp_path, text_of("Zeit [s];Kraft [N];Prüfweg [mm]", body, ";")).notes
    assert any("not used: Prüfweg [mm] (a length; --position-col takes it" in note for note in notes)


def test_zeros_behind_the_record_are_no_samples(tmp_path: Path) -> None:
    """An array that was longer than the record; nothing is left out of one whose clock ends at zero."""
    cut = [*plain_rows(CUT), *[("0.0", "0.0", "0.0")] * 90]
    done = is_the_cut(read(tmp_path, text_of(HEADER, cut)))
    assert any("90 rows of zeros from row 642 to the end are no samples" in note for note in done.warnings)
    before = [(f"{t - CUT.time[-1]:.4f}", f, z) for t, (_, f, z) in zip(CUT.time, plain_rows(CUT), strict=True)]
    before[-1] = ("0.0", "0.0", "0.0")
    assert len(read(tmp_path, text_of(HEADER, before)).time) == 640


@pytest.mark.parametrize("word", ["nan", "", "-----", ".", "-nan(ind)"])
def test_an_array_that_was_not_filled(tmp_path: Path, word: str) -> None:
    """Any number of rows at the end may hold nothing; a force that fails while the clock runs on is refused."""
    cut = plain_rows(CUT)
    is_the_cut(read(tmp_path, text_of(HEADER, [*cut, *[(word, word, word)] * 300])))
    with pytest.raises(TraceError, match="not a number|not finite"):
        read(tmp_path, text_of(HEADER, [*cut[:400], *[(t, word, z) for t, _, z in cut[400:]]]))


@pytest.mark.parametrize("word", ["#DIV/0!", "#NV", "-NaN(ind)", "...", "-----"])
def test_further_words_for_no_number(tmp_path: Path, word: str) -> None:
    """The row is left out, and said."""
    cut = plain_rows(CUT)
    cut[100] = (cut[100][0], word, cut[100][2])
    trace = read(tmp_path, text_of(HEADER, cut))
    is_the_cut(trace)
    assert trace.notes == ("cut.csv: row 102 was left out, without a number in column force_N",)


@pytest.mark.parametrize(
    "header",
    [
        "% time_s force_N position_m",
        "% time force position\n% s N m",
        "Time (s) Force (N) Position (m)",
        "Cut of a banana\nTest time (s)   Load cell (N)   Position (m)",
    ],
)
def test_headers_above_cells_that_blanks_separate(tmp_path: Path, header: str) -> None:
    """Units behind a blank, names with blanks in them, and the mark of a comment."""
    is_the_cut(read(tmp_path, text_of(header, plain_rows(CUT), " ")))


@pytest.mark.parametrize(
    ("header", "row", "separator"),
    [
        ("Reading,Load,Travel,Time", "{k},{f:.3f} N,{d:.4f} mm,{t:.3f} s", ","),
        ("Time (s),Force (N),Travel (mm)", "{t:.3f},{f:.3f} N,{d:.4f}", ","),
        ("Zeit;Kraft;Weg", "{t:.3f} s;{f:.3f} N;{d:.4f} mm", ";"),
        ("Time,Force,Travel", "{t:.3f}s,{m:.1f}mN,{d:.4f}mm", ","),
    ],
)
def test_units_behind_the_numbers(tmp_path: Path, header: str, row: str, separator: str) -> None:
    """A gauge writes them into each cell."""
    samples = zip(range(640), CUT.time, CUT.force, 1e3 * CUT.force, CUT.depth_mm, strict=True)
    body = [row.format(k=k, t=t, f=f, m=m, d=d) for k, t, f, m, d in samples]
    text = "\n".join([header, *(line.replace(".", ",") if separator == ";" else line for line in body)])
    is_the_cut(read(tmp_path, text))


def test_units_that_change_within_a_column_are_none(tmp_path: Path) -> None:
    """A gauge that switches its range is not read as one unit."""
    body = [
        f"{t:.3f},{f:.3f} N" if f > 5 else f"{t:.3f},{1e3 * f:.0f} mN" for t, f in zip(CUT.time, CUT.force, strict=True)
    ]
    with pytest.raises(TraceError, match="no force column"):
        read(tmp_path, "\n".join(["time_s,Force", *body]))
    with pytest.raises(TraceError, match="'3004 mN' is not a number"):
        read(tmp_path, "\n".join(["time_s,Force", *body]), force_col="Force=N")


def test_a_printed_minus_is_one(tmp_path: Path) -> None:
    """U+2212, in a column that needs nothing else."""
    body = [(t, f"{float(f) - 5.0:.4f}".replace("-", "\u2212"), z) for t, f, z in plain_rows(CUT)]
    is_the_cut(read(tmp_path, text_of(HEADER, body)))


@pytest.mark.parametrize(
    ("name", "estimated"),
    [("knife_force_N", False), ("blade_force_N", False), ("knife_Fz_N", True), ("base_Fz_N", True), ("base_fx", True)],
)
def test_a_force_on_a_knife_is_no_estimate_of_an_arm(name: str, estimated: bool) -> None:
    """Only the columns of libfranka are called so."""
    assert from_joint_torques(name) == estimated


def test_a_unit_that_is_said_twice_may_not_differ(tmp_path: Path) -> None:
    """Nothing tells which of them is right."""
    with pytest.raises(TraceError, match="no force column"):
        read(tmp_path, text_of("time_s,force_N [mN],position_m", plain_rows(CUT)))


@pytest.mark.parametrize("name", ["weight_g", "Mass (g)"])
def test_a_weight_is_a_force_where_there_is_no_other(tmp_path: Path, name: str) -> None:
    """A load cell shows grams; that of the specimen beside a force is none."""
    body = [(t, f"{float(f) / 9.80665e-3:.3f}", z) for t, f, z in plain_rows(CUT)]
    is_the_cut(read(tmp_path, text_of(f"time_s,{name},position_m", body)))
    beside = [(*row, "120.0") for row in plain_rows(CUT)]
    is_the_cut(read(tmp_path, text_of(f"{HEADER},{name}", beside)))


@pytest.mark.parametrize(
    ("before", "row", "behind"),
    [
        ("| time_s | force_N | position_m |\n|---|:--:|---|", "| {} | {} | {} |", ""),
        (" time_s | force_N | position_m \n--------+---------+---------", " {} | {} | {} ", "(640 rows)"),
        ("  time_s    force_N    position_m\n--------  ---------  ------------", "{:>8}  {:>9}  {:>12}", ""),
    ],
)
def test_tables_that_are_drawn(tmp_path: Path, before: str, row: str, behind: str) -> None:
    """Lines of dashes below the names, as in Markdown and as databases print them."""
    is_the_cut(read(tmp_path, "\n".join([before, *(row.format(*cells) for cells in plain_rows(CUT)), behind])))
