"""Records as laboratories and robots write them give the same cut: the same contact, stroke and peak."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.errors import TraceError
from calib.problem.nuisance import TORQUE_GAIN_SD, sensor_of
from calib.trace.conditioning import condition
from calib.trace.trace import Trace, read_trace
from tests.calib.made_cuts import Cut, made_cut, plain_rows, text_of

CUT = made_cut()
TRUE = condition(CUT.trace())
EPOCH = 1_700_000_000
Written = tuple[str | bytes, dict[str, Any]]


def _quoted(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    return [tuple(f'"{cell}"' for cell in row) for row in rows]


def _comma(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    return [tuple(cell.replace(".", ",") for cell in row) for row in rows]


def _with_depth(cut: Cut, sign: float = 1.0) -> list[tuple[str, ...]]:
    return [
        (f"{t:.4f}", f"{sign * d:.4f}", f"{sign * f:.4f}")
        for t, d, f in zip(cut.time, cut.depth_mm, cut.force, strict=True)
    ]


def _clock(seconds: float) -> str:
    whole = 17 * 3600 + 33 * 60 + 33.5 + seconds
    return f"{int(whole // 3600):02d}:{int(whole // 60 % 60):02d}:{whole % 60:06.3f}"


def _bluehill(cut: Cut) -> Written:
    head = '"Sample : Label","gel A"\r\n"Specimen : Width","20.00","mm"\r\n\r\n"Time","Extension","Load"\r\n"(s)","(mm)","(N)"'
    return text_of(head, _quoted(_with_depth(cut))), {}


def _bluehill_quoted_head(cut: Cut) -> Written:
    return text_of('"Specimen label","gel 1"\n"Time","Extension","Load"\n"(s)","(mm)","(N)"', _with_depth(cut)), {}


def _instron_counted_negative(cut: Cut) -> Written:
    down = cut.time <= 2.6
    part = Cut(cut.time[down], cut.force[down], cut.height[down])
    return text_of('"Time","Extension","Load"\n"(s)","(mm)","(N)"', _quoted(_with_depth(part, -1.0))), {"sign": "-"}


def _zwick_cp1252(cut: Cut) -> Written:
    rows = [(t, f, d) for t, d, f in _comma(_with_depth(cut))]
    text = text_of("Pr\u00fcfzeit;Standardkraft;Standardweg\ns;N;mm", rows, ";")
    names = {"time_col": "Pr\u00fcfzeit", "force_col": "Standardkraft", "depth_col": "Standardweg"}
    return text.replace("\n", "\r\n").encode("cp1252"), names


def _utf16(cut: Cut) -> Written:
    return text_of("time_s\tforce_N\tposition_m", plain_rows(cut), "\t").encode("utf-16"), {}


def _utf16_without_mark(cut: Cut) -> Written:
    return text_of("time_s\tforce_N\tposition_m", plain_rows(cut), "\t").encode("utf-16-le"), {}


def _zero_bytes_at_the_end(cut: Cut) -> Written:
    return text_of("time_s,force_N,position_m", plain_rows(cut)).encode() + b"\0" * 512, {}


def _semicolon_thousands(cut: Cut) -> Written:
    rows = [
        (f"{t:.3f}", f"{1e3 * f:,.0f}", f"{1e3 * z:.2f}")
        for t, f, z in zip(cut.time, cut.force, cut.height, strict=True)
    ]
    return text_of("time_s;force_mN;position_mm", rows, ";"), {}


def _thousands_and_decimal_commas(cut: Cut) -> Written:
    rows = [
        (
            f"{t:.3f}".replace(".", ","),
            f"{1e3 * f:,.1f}".translate(str.maketrans(",.", ".,")),
            f"{1e3 * z:.2f}".replace(".", ","),
        )
        for t, f, z in zip(cut.time, cut.force, cut.height, strict=True)
    ]
    return text_of("time_s;force_mN;position_mm", rows, ";"), {}


def _quoted_decimal_commas(cut: Cut) -> Written:
    return text_of("time_s,force_N,position_m", _quoted(_comma(plain_rows(cut)))), {}


def _labview(cut: Cut) -> Written:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nDate\t2024/08/11\nTime\t14:37:48.2\n"
        "***End_of_Header***\t\t\t\t\n\nChannels\t2\t\t\t\nSamples\t640\t640\t\t\nDate\t2024/08/11\t2024/08/11\t\t\n"
        "Y_Unit_Label\tN\tm\t\t\nX_Dimension\tTime\tTime\t\t\nX0\t0.0E+0\t0.0E+0\t\t\nDelta_X\t0.005\t0.005\t\t\n"
        "***End_of_Header***\t\t\t\t\nX_Value\tForce\tPosition\tComment\t"
    )
    rows = [(*row, "", "") for row in plain_rows(cut)]
    return text_of(head, rows, "\t"), {"time_col": "X_Value", "force_col": "Force", "position_col": "Position"}


def _numpy_savetxt(cut: Cut) -> Written:
    return text_of(
        "# time_s,force_N,position_m", [tuple(f"{float(x):.18e}" for x in row) for row in plain_rows(cut)]
    ), {}


def _savetxt_with_blanks(cut: Cut) -> Written:
    return text_of("# time_s force_N position_m", plain_rows(cut), " "), {}


def _ros2_echo(cut: Cut) -> Written:
    rows = [
        (EPOCH + int(t), int(1e9 * (t % 1)), "tool0", 0.1, 0.2, f"{f:.4f}", 0.01, 0.01, 0.0)
        for t, f in zip(cut.time, cut.force, strict=True)
    ]
    return "\n".join(",".join(map(str, row)) for row in rows), {}


def _without_header(cut: Cut) -> Written:
    text = "\n".join(",".join(row) for row in plain_rows(cut))
    return text, {"time_col": "column 1=s", "force_col": "column 2=N", "position_col": "column 3=m"}


def _plotjuggler_sparse(cut: Cut) -> Written:
    rows: list[tuple[str, str, str]] = []
    for t, f, z in zip(cut.time, cut.force, cut.height, strict=True):
        late = z - (0.02 if t <= 2.6 else -0.1) * 0.0021
        rows += [(f"{EPOCH + t:.6f}", "", f"{f:.4f}"), (f"{EPOCH + t + 0.0021:.6f}", f"{late:.6f}", "")]
    return text_of("__time,/ee/pose/position/z,/ft/wrench/force/z", rows), {}


def _iso_dates(cut: Cut) -> Written:
    rows = [(f"2024-06-12T{_clock(float(r[0]))}", *r[1:]) for r in plain_rows(cut)]
    return text_of("timestamp,force_N,position_m", rows), {"time_col": "timestamp"}


def _times_over_midnight(cut: Cut) -> Written:
    rows = []
    for r in plain_rows(cut):
        at = (86399.0 + float(r[0])) % 86400.0
        rows.append((f"{int(at // 3600):02d}:{int(at // 60 % 60):02d}:{at % 60:06.3f}", *r[1:]))
    return text_of("time,force_N,position_m", rows), {}


def _german_dates(cut: Cut) -> Written:
    rows = [(f"12.06.2024 {_clock(float(r[0]))}".replace(".5", ".5"), *r[1:]) for r in plain_rows(cut)]
    return text_of("timestamp;force_N;position_m", rows, ";"), {}


def _frame_counter(cut: Cut) -> Written:
    rows = [(k, *r[1:]) for k, r in enumerate(plain_rows(cut))]
    how = {"rate": 200.0, "force_col": "observation.force_z", "position_col": "observation.ee_z"}
    return text_of("frame_index,observation.force_z,observation.ee_z", rows), how


def _no_clock(cut: Cut) -> Written:
    return text_of("force_N,position_m", [r[1:] for r in plain_rows(cut)]), {"rate": 200.0}


def _grams(cut: Cut) -> Written:
    rows = [
        (f"{f / 9.80665e-3:.3f}", f"{d:.3f}", f"{t:.4f}")
        for t, d, f in zip(cut.time, cut.depth_mm, cut.force, strict=True)
    ]
    return text_of("Force (g),Distance (mm),Time (sec)", rows), {}


def _universal_robots(cut: Cut) -> Written:
    rows = [(f"{1234.5 + float(t):.4f}", z, f) for t, f, z in plain_rows(cut)]
    return text_of("timestamp actual_TCP_pose_2 actual_TCP_force_2", rows, " "), {}


def _two_stamps(cut: Cut) -> Written:
    rows = [(EPOCH + int(float(t)), int(1e9 * (float(t) % 1)), f, z) for t, f, z in plain_rows(cut)]
    return text_of("header.stamp.sec,header.stamp.nanosec,wrench.force.z,pose.position.z", rows), {}


def _last_row_cut_off(cut: Cut) -> Written:
    return text_of("time_s,force_N,position_m", plain_rows(cut))[:-20], {}


def _empty_columns(cut: Cut) -> Written:
    return text_of("time_s,,force_N,position_m,,", [(t, "", f, z, "", "") for t, f, z in plain_rows(cut)]), {}


LAYOUTS = [
    _bluehill, _bluehill_quoted_head, _instron_counted_negative, _zwick_cp1252, _utf16, _utf16_without_mark, _zero_bytes_at_the_end,
    _semicolon_thousands, _thousands_and_decimal_commas, _quoted_decimal_commas, _labview, _numpy_savetxt, _savetxt_with_blanks,
    _without_header, _plotjuggler_sparse, _iso_dates, _times_over_midnight, _german_dates, _frame_counter, _no_clock, _grams,
    _universal_robots, _two_stamps, _last_row_cut_off, _empty_columns, _ros2_echo,
]  # fmt: skip


def read(folder: Path, write: Callable[[Cut], Written], cut: Cut = CUT) -> Trace:
    """The trace of a record in some layout."""
    content, how = write(cut)
    path = folder / "cut.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return read_trace(path, **how)


@pytest.mark.parametrize("write", LAYOUTS, ids=lambda write: write.__name__.strip("_"))
def test_every_layout_gives_the_same_cut(tmp_path: Path, write: Callable[[Cut], Written]) -> None:
    """Contact within a sample, stroke within 0.2 mm, peak within half a percent."""
    done = condition(read(tmp_path, write), speed=0.02)
    assert done.onset_s == pytest.approx(TRUE.onset_s, abs=0.005)
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.005)
    assert done.baseline_N == pytest.approx(TRUE.baseline_N, abs=0.01)
    if done.stroke_source == "position":
        assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, abs=2e-4)


@pytest.mark.parametrize("column", ["Extension", "position"])
def test_a_negative_extension_is_named_either_way(tmp_path: Path, column: str) -> None:
    """A machine's Extension, counted negative downwards, is a depth and a height, whatever it is called by."""
    content, _ = _instron_counted_negative(CUT)
    path = tmp_path / "cut.csv"
    path.write_text(str(content))
    how = {"depth_col": "Extension"} if column == "Extension" else {"position_col": "Extension"}
    trace = read_trace(path, sign="-", **how)
    assert condition(trace).peak_N == pytest.approx(TRUE.peak_N, rel=0.005)
    assert any("taken as negative downwards" in note for note in trace.notes)


def test_a_slow_clock_is_spread_over_its_rows(tmp_path: Path) -> None:
    """A kilohertz of rows on a clock of 10 ms: the same peak; the contact is open by the tick."""
    time = np.arange(3200) / 1000.0
    force, height = (np.interp(time, CUT.time, x) for x in (CUT.force, CUT.height))
    rows = [
        (f"{np.floor(100 * t + 1e-9) / 100:.2f}", f"{f:.4f}", f"{z:.6f}")
        for t, f, z in zip(time, force, height, strict=True)
    ]
    path = tmp_path / "cut.csv"
    path.write_text(text_of("time_s,force_N,position_m", rows))
    trace = read_trace(path)
    np.testing.assert_allclose(trace.time, time, atol=0.001)
    done = condition(trace)
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.005) and done.onset_sd_s >= 0.01 / 12**0.5
    assert any("ticks every 0.01 s and stands for about 10 rows" in note for note in done.warnings)
    given = read_trace(path, rate=1000.0)
    np.testing.assert_allclose(given.time, time, atol=1e-9)
    assert any("the clock time_s is not used" in note for note in given.notes)


@pytest.mark.parametrize(
    ("header", "how", "says"),
    [
        ("frame_index,force_N", {}, r"column frame_index: .*it counts rows: give their rate in Hz with --rate"),
        ("t_ms,force_N", {}, r"column t_ms: samples are 5 s apart; this looks like microseconds: say --time-col 't_ms=us'"),
        ("time_s,target_force_kN,Fz", {}, r"did you mean 'Fz'.*--force-col 'Fz=N' \(target_force_kN was commanded or der"),
        ("time_s,target_force_N,Fz,load", {}, r"did you mean 'Fz'.*--force-col 'Fz=N' \(target_force_N was commanded or"),
        ("time_s,max_force_N", {}, "max_force_N was commanded or derived and is not chosen unasked"),
        ("time_s,force_filtered_N", {}, "force_filtered_N was commanded or derived"),
        ("time_s,Stress (kPa)", {"force_col": "Stress (kPa)"}, r"column Stress \(kPa\): its unit is 'kPa'.*none of a force"),
        ("a,b", {"rate": 200.0, "time_col": "b", "force_col": "a"}, "column b: not a counter that rises"),
    ],
)  # fmt: skip
def test_what_is_not_guessed_says_what_to_do(tmp_path: Path, header: str, how: dict[str, Any], says: str) -> None:
    """Counters, units of another size, commanded forces, stresses: one line with the column and the remedy."""
    width = header.count(",") + 1
    step = {"frame_index": 1.0, "t_ms": 5000.0}.get(header.split(",")[0], 0.005)
    rows = [(f"{k * step:g}", *[f"{f:.4f}"] * (width - 1)) for k, f in enumerate(CUT.force)]
    path = tmp_path / "cut.csv"
    path.write_text(text_of(header, rows))
    if "frame_index" in header:
        how = how | {"time_col": "frame_index"}
    with pytest.raises(TraceError, match=says):
        read_trace(path, **how)


def test_doubtful_thousands_are_not_guessed(tmp_path: Path) -> None:
    """Where nothing tells whether 3,062 is three thousand, it is refused with its row; ``decimal`` says it."""
    rows = [(f"{5 * k}", f"{1e3 * f:,.0f}") for k, f in enumerate(CUT.force)]
    path = tmp_path / "cut.csv"
    path.write_text(text_of("time_ms;force_mN", rows, ";"))
    with pytest.raises(
        TraceError, match=r"row 2, column force_mN: '3,0\d\d' is not a number; write decimals with a point"
    ):
        read_trace(path)
    np.testing.assert_allclose(read_trace(path, decimal=".").force, CUT.force, atol=6e-4)
    np.testing.assert_allclose(read_trace(path, decimal=",").force, 1e-3 * CUT.force, atol=6e-7)


@pytest.mark.parametrize(
    "name",
    ["field.O_F_ext_hat_K2", "/franka/O_F_ext_hat_K[2]", "base_Fz_N", "state.o_f_ext_hat_k.wrench.force.z",
     "tool_external_wrench_force_z", "actual_TCP_force_2", "K_F_ext_hat_K_2", "/iiwa/external_wrench/force/z"],
)  # fmt: skip
def test_wrenches_from_joint_torques_are_known_by_every_name(name: str) -> None:
    """Their gain is known to 15 %, and that is said; a sensor's is not."""
    cut = CUT.trace()
    done = condition(Trace(cut.time, cut.force, cut.position, "made.csv", "", {"force": name}))
    sensor, said = sensor_of(done, None, None)
    assert sensor.gain_sd == TORQUE_GAIN_SD and "--gain-sd" in said[0] and all(name in text for text in said)
    assert sensor_of(condition(cut), None, None)[0].gain_sd < TORQUE_GAIN_SD


def test_long_topic_names_are_shown_whole(tmp_path: Path) -> None:
    """A name that is to be typed is not cut off."""
    names = [f"/arm/left/sensors/force_torque/wrench_stamped/{part}/wrench/force/z" for part in ("raw", "tared")]
    path = tmp_path / "cut.csv"
    path.write_text(text_of(f"__time,{names[0]},{names[1]}", [(t, f, f) for t, f, _ in plain_rows(CUT)]))
    with pytest.raises(TraceError, match="several columns could be the force") as refused:
        read_trace(path)
    assert all(name in str(refused.value) for name in names)


def test_all_missing_columns_are_said_at_once(tmp_path: Path) -> None:
    """A table with neither time nor force names both options in one line, and lists its columns once."""
    path = tmp_path / "odd.csv"
    path.write_text("a,b\n" + "".join(f"{k},{k}\n" for k in range(30)))
    with pytest.raises(TraceError) as caught:
        read_trace(path)
    said = str(caught.value)
    assert "--time-col" in said and "--force-col" in said and "\n" not in said
    assert said.count("the columns are a, b") == 1
