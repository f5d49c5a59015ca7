"""Traces from JSON, HDF5, exports of ROS messages and DataFrames: the same cut, the same trace, errors with their
place."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest

from calib.compression.measured import read_repeats
from calib.errors import TraceError
from calib.trace.conditioning import condition
from calib.trace.trace import Trace, read_trace
from mpm.scene.shapes import Shape

N = 40
TIME = 0.01 * np.arange(N)
LOAD = 2.0 + np.maximum(0.0, np.arange(N) - 10.0)
HEIGHT = 0.3 - 0.05 * TIME
WRENCH = np.column_stack([0.1 * LOAD, 0.2 * LOAD, -LOAD, 0 * LOAD, 0 * LOAD, 0 * LOAD])
"""Force on the world in the base frame, which presses down, and its moments."""
POSE = np.zeros((N, 16))
POSE[:, 12:] = np.column_stack([0.4 + 0 * TIME, 0 * TIME, HEIGHT, 1 + 0 * TIME])


def of_json(folder: Path, content: Any, name: str = "cut.json") -> Path:
    """A JSON file."""
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def of_hdf5(folder: Path, name: str = "cut.h5", units: dict[str, str] | None = None, **sets: Any) -> Path:
    """An HDF5 file; a name with __ lies in a group."""
    path = folder / name
    with h5py.File(path, "a") as file:
        for key, values in sets.items():
            item = file.create_dataset(key.replace("__", "/"), data=values)
            if units and key in units:
                item.attrs["units"] = units[key]
    return path


def channels() -> dict[str, Any]:
    """A robot log as lists per channel, its clock as it runs since the robot was started."""
    return {
        "robot": "arm 2",
        "gains": [1.0, 2.0, 3.0],
        "look_up_table": [0.0] * (2 * N),
        "time": (12460.0 + TIME).tolist(),
        "O_F_ext_hat_K": WRENCH.tolist(),
        "K_F_ext_hat_K": (-WRENCH).tolist(),
        "O_T_EE": POSE.tolist(),
    }


def records() -> list[dict[str, Any]]:
    """The same log as a list of records."""
    lists = {k: v for k, v in channels().items() if len(v) == N}
    return [{name: values[i] for name, values in lists.items()} for i in range(N)]


LAYOUTS: dict[str, Callable[[], Any]] = {
    "lists per channel": channels,
    "records": records,
    "a list for each part": lambda: channels() | {"O_F_ext_hat_K": WRENCH.T.tolist()},
    "channels in a group": lambda: {"about": {"food": "apple"}, "log": channels()},
    "records in a group": lambda: {"food": "apple", "log": records()},
    "groups in records": lambda: [{"time": r.pop("time"), "state": r} for r in records()],
    "numbered rows": lambda: {k: dict(enumerate(v)) for k, v in channels().items() if len(v) == N},
    "a record a line": lambda: "\n".join(json.dumps(r) for r in records()) + "\n",
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_robot_logs_in_json(tmp_path: Path, layout: str) -> None:
    """Every layout of the same log gives the same trace: upwards resistance, the height of the tool, time from zero."""
    path = of_json(tmp_path, LAYOUTS[layout]())
    trace = read_trace(path)
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.time, TIME, atol=1e-9)
    np.testing.assert_allclose(trace.position, HEIGHT)
    assert trace.columns == {"time": "time", "force": "base_Fz_N", "position": "ee_z_m"}
    assert (trace.source, trace.start) == ("cut.json", 12460.0)
    assert trace.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_wrench_in_the_tools_frame_has_its_own_sign(tmp_path: Path) -> None:
    """K_F_ext_hat_K is taken where it is alone or asked for, positive when the knife presses down."""
    log = channels()
    by_name = read_trace(of_json(tmp_path, log), force_col="knife_Fz_N")
    del log["O_F_ext_hat_K"]
    np.testing.assert_allclose(read_trace(of_json(tmp_path, log)).force, LOAD)
    np.testing.assert_allclose(by_name.force, LOAD)


def test_other_json_names_need_units_or_options(tmp_path: Path) -> None:
    """Without libfranka's fields nothing is guessed; units in names do, also of vectors, and so do the options."""
    content = {"time": TIME.tolist(), "tip": [[0, 0, 1e3 * z] for z in HEIGHT], "pull": LOAD.tolist()}
    with pytest.raises(TraceError, match="cut.json: no time column.*did you mean 'time'.*--time-col"):
        read_trace(of_json(tmp_path, content))
    named = {"clock": {"time_s": content["time"]}, "ee_position_mm": content["tip"], "load_kN": (LOAD / 1e3).tolist()}
    trace = read_trace(of_json(tmp_path, {**named, "clock": None, **named["clock"]}))
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.position, HEIGHT)
    assert trace.columns["position"] == "ee_position_z_mm"
    chosen = read_trace(of_json(tmp_path, content), time_col="time", force_col="pull", position_col="none")
    np.testing.assert_allclose(chosen.force, LOAD)


@pytest.mark.parametrize("orient", ["split", "records", "columns", "index", "table"])
def test_what_pandas_writes_as_json(tmp_path: Path, orient: Any) -> None:
    """Names above rows, records, and rows by number are one cut; rows of other lengths are none."""
    frame = pd.DataFrame({"time_s": TIME, "force_N": LOAD, "depth_mm": -1e3 * (HEIGHT - HEIGHT[0])})
    trace = read_trace(of_json(tmp_path, frame.to_json(orient=orient)))
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.time, TIME)
    assert trace.position is not None and np.ptp(trace.position) == pytest.approx(np.ptp(HEIGHT))
    uneven = {"columns": ["time_s", "force_N"], "data": [[0.0, 1.0], [0.1]]}
    with pytest.raises(TraceError, match="cut.json"):
        read_trace(of_json(tmp_path, uneven))


@pytest.mark.parametrize(
    "write", [repr, lambda numbers: str(np.array(numbers)), lambda numbers: f"({numbers[0]};{numbers[1]};{numbers[2]})"]
)
def test_vectors_in_the_cells_of_a_csv(tmp_path: Path, write: Callable[[list[float]], str]) -> None:
    """As a frame of lists is written, or of arrays. An empty cell is no sample; words in brackets are none."""
    force = [write([0.0, 0.1, float(load)]) for load in LOAD]
    force[17] = ""
    path = tmp_path / "cut.csv"
    pd.DataFrame({"time_s": TIME, "force_N": force, "state": "[cutting, now]"}).to_csv(path, index=False)
    trace = read_trace(path, force_col="force_z_N")
    np.testing.assert_allclose(trace.force, np.delete(LOAD, 17))
    assert any("the cells of force_N hold vectors, read as force_x_N, force_y_N, force_z_N" in n for n in trace.notes)


def test_a_libfranka_log_as_csv_of_vectors(tmp_path: Path) -> None:
    """Its fields have their documented meaning there, too."""
    path = tmp_path / "cut.csv"
    fields = {"time": TIME, "O_F_ext_hat_K": WRENCH.tolist(), "O_T_EE": POSE.tolist()}
    pd.DataFrame(fields).to_csv(path, index=False)
    trace = read_trace(path)
    np.testing.assert_allclose(trace.force, LOAD)
    assert trace.position is not None
    np.testing.assert_allclose(trace.position, HEIGHT)


def test_label_of_a_json_file(tmp_path: Path) -> None:
    """A document may say that it is a reconstruction."""
    content = {"label": "reconstructed", "time_s": TIME.tolist(), "force_N": LOAD.tolist()}
    assert read_trace(of_json(tmp_path, content)).label == "reconstructed"


def spoilt(**change: Any) -> list[dict[str, Any]]:
    """Records whose seventeenth is another one; a value None goes."""
    rows = [{"time_s": t, "force_N": f} for t, f in zip(TIME.tolist(), LOAD.tolist(), strict=True)]
    rows[17] = {k: v for k, v in {**rows[17], **change}.items() if v is not None}
    return rows


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "cut.json: not JSON .*is the file complete"),
        ('{"time_s": [0, 1', "cut.json: not JSON"),
        ('{"a": 1}\n{"a": 2\n', "cut.json, row 2: not JSON"),
        ('{"time_s": [0], "time_s": [1]}', "column name 'time_s' occurs 2 times"),
        ("[" * 100000, "nested too deeply"),
        ({"food": "apple"}, "no lists of values with names"),
        ([1, 2, 3], "no lists of values with names"),
        ({"log": [{"time_s": 0.0}, 3]}, "list 'log' holds records and other values"),
        (spoilt(force_N="oops"), "cut.json, index 17, column force_N: 'oops' is not a number"),
        (spoilt(force_N=True), "index 17, column force_N: True is not a number"),
        (spoilt(force_N=10**400), "index 17, column force_N: 1000.* is not finite"),
        (spoilt(force_N=1e9), r"index 17, column force_N: 1000000000.0 is beyond 1e\+06 N, too much for a force"),
        (spoilt(time_s=float(TIME[16])), "index 17, column time_s: time does not increase"),
        (
            {"time_s": TIME.tolist(), "z_m": HEIGHT.tolist(), "force_N": LOAD[:-1].tolist()},
            "no force column.*force_N was left out, it has 39 values where others have 40",
        ),
        (
            {"time_s": TIME.tolist(), "z_m": HEIGHT.tolist(), "force_N": [[1.0]] * 39 + [[1.0, 2.0]]},
            "force_N was left out, its values are lists of unequal length",
        ),
    ],
)
def test_json_errors_name_the_place(tmp_path: Path, content: Any, message: str) -> None:
    """What is wrong with a JSON file, where, and what to do."""
    with pytest.raises(TraceError, match=message):
        read_trace(of_json(tmp_path, content))


def test_missing_vectors_are_empty_cells(tmp_path: Path) -> None:
    """A record without its wrench is named as such, not as a list of another length; too many of them are refused."""
    rows = records()
    del rows[17]["O_F_ext_hat_K"]
    trace = read_trace(of_json(tmp_path, rows))
    assert len(trace.time) == N - 1 and 17 not in trace.rows
    assert "cut.json: index 17 was left out, without a number in column base_Fz_N" in trace.notes
    for row in rows[20:25]:
        del row["O_F_ext_hat_K"]
    with pytest.raises(TraceError, match="index 17, column base_Fz_N: an empty cell"):
        read_trace(of_json(tmp_path, rows))


@pytest.mark.parametrize("value", [None, float("nan")])
def test_a_sample_without_a_number_is_left_out(tmp_path: Path, value: float | None) -> None:
    """It is a sample that is missing, and said."""
    trace = read_trace(of_json(tmp_path, spoilt(force_N=value)))
    np.testing.assert_allclose(trace.force, np.delete(LOAD, 17))
    assert "cut.json: index 17 was left out, without a number in column force_N" in trace.notes


def test_hdf5_in_all_places(tmp_path: Path) -> None:
    """Data sets at the root, in the only group, in a group that is named, and fields of a structured one."""
    sets = {"time_s": TIME, "force_N": LOAD, "stroke_mm": 1e3 * (0.3 - HEIGHT), "sensor": [3]}
    root = of_hdf5(tmp_path, "a.h5", **sets)
    one = of_hdf5(tmp_path, "b.h5", **{f"runs__cut__{k}": v for k, v in sets.items()})
    two = of_hdf5(tmp_path, "c.hdf5", **{f"{g}__{k}": v for g in ("cut", "air") for k, v in sets.items()})
    table = np.zeros(N, [("time_s", "f8"), ("force_N", "f4"), ("ee_position_m", "f8", 3)])
    table["time_s"], table["force_N"], table["ee_position_m"][:, 2] = TIME, LOAD, HEIGHT - 0.3
    structured = of_hdf5(tmp_path, "d.h5", run__cut=table)
    for path in (root, one, f"{two}:/cut", f"{two}:cut", structured, f"{structured}:/run/cut"):
        trace = read_trace(path)
        np.testing.assert_allclose(trace.force, LOAD)
        np.testing.assert_allclose(trace.position, HEIGHT - 0.3, atol=1e-12)
    assert read_trace(root).sha256 == hashlib.sha256(root.read_bytes()).hexdigest()
    assert read_trace(f"{two}:/cut").source == "c.hdf5:/cut"
    assert read_trace(f"{two}:/cut").sha256 != read_trace(f"{two}:/air").sha256
    with h5py.File(one, "a") as file:
        file["runs/cut/settings"] = table[:1]
    assert read_trace(one).source == "b.h5"
    with pytest.raises(
        TraceError, match=r"c.hdf5: several groups could be the record; name one: c.hdf5:/air, c.hdf5:/cut"
    ):
        read_trace(two)
    with pytest.raises(TraceError, match=r"c.hdf5:/knife: nothing of that name in the file; name one: c.hdf5:/air"):
        read_trace(f"{two}:/knife")
    with pytest.raises(TraceError, match="c.hdf5:/cut/sensor: no columns there; name one"):
        read_trace(f"{two}:/cut/sensor")


def test_hdf5_units_from_attributes(tmp_path: Path) -> None:
    """An attribute gives the unit, also in words and of a vector; one that the name contradicts is refused."""
    sets = {"clock": TIME, "time": 1e3 * TIME, "load": LOAD / 1e3, "tool_position": [[0, 0, 1e3 * z] for z in HEIGHT]}
    units = {"time": "ms", "load": "kN", "tool_position": "millimetres"}
    trace = read_trace(of_hdf5(tmp_path, "a.h5", units, **sets))
    np.testing.assert_allclose(trace.time, TIME)
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.position, HEIGHT)
    with pytest.raises(TraceError, match="column load: its unit is 'psi', which is none of a force; use one of N"):
        read_trace(of_hdf5(tmp_path, "b.h5", units | {"load": "psi"}, **sets), force_col="load")
    twice = of_hdf5(tmp_path, "c.h5", {"force_N": "kN"}, time_s=TIME, force_N=LOAD)
    with pytest.raises(TraceError, match="column force_N: its unit is stated as 'kN'; correct one"):
        read_trace(twice)


def test_hdf5_robot_log_and_texts(tmp_path: Path) -> None:
    """The fields of libfranka are known here too, and numbers may be texts; whole clocks count nanoseconds."""
    log = {"time": 12460.0 + TIME, "O_F_ext_hat_K": WRENCH, "O_T_EE": POSE}
    trace = read_trace(of_hdf5(tmp_path, "a.h5", **log))
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.position, HEIGHT)
    texts = of_hdf5(
        tmp_path, "b.h5", time_ns=1_600_000_000_000_000_000 + (1e9 * TIME).astype("i8"), force_N=[f"{x}" for x in LOAD]
    )
    trace = read_trace(texts)
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.time, TIME, atol=1e-6)
    assert trace.start == pytest.approx(1.6e9)


def test_hdf5_errors(tmp_path: Path) -> None:
    """A file that is cut off, one that is none, one without columns, and a bad number with its index."""
    whole = of_hdf5(tmp_path, "a.h5", time_s=TIME, force_N=np.where(np.arange(N) == 17, np.nan, LOAD))
    assert "a.h5: index 17 was left out, without a number in column force_N" in read_trace(whole).notes
    (tmp_path / "cut.h5").write_bytes(whole.read_bytes()[:1000])
    (tmp_path / "none.h5").write_text("time_s,force_N\n0,1\n")
    for name in ("cut.h5", "none.h5"):
        with pytest.raises(TraceError, match=f"{name}: damaged, or not an HDF5 file"):
            read_trace(tmp_path / name)
    with pytest.raises(TraceError, match="empty.h5: no data sets"):
        read_trace(of_hdf5(tmp_path, "empty.h5", force_N=LOAD))
    with pytest.raises(TraceError, match="no such file"):
        read_trace(f"{tmp_path / 'gone.h5'}:/cut")


def rows(folder: Path, **columns: Any) -> Path:
    """A CSV file whose names may hold anything; clocks in whole numbers stay whole."""
    path = folder / "bag.csv"
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.9g")
    return path


def test_rostopic_export(tmp_path: Path) -> None:
    """The header of rostopic echo -p: nanoseconds, the message's own stamp before the bag's time, unless nobody set
    it."""
    stamp = 1_620_000_000_123_456_789 + (1e9 * TIME).astype("i8")
    late = np.sort(stamp + 10**6 * (np.arange(N) % 3))
    columns = {
        "%time": late,
        "field.header.seq": np.arange(N),
        "field.header.stamp": stamp,
        "field.wrench.force.x": 0 * LOAD,
        "field.wrench.force.z": LOAD,
        "field.pose.position.z": HEIGHT,
    }
    trace = read_trace(rows(tmp_path, **columns))
    np.testing.assert_allclose(trace.time, TIME, atol=1e-6)
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.position, HEIGHT)
    assert trace.columns["time"] == "field.header.stamp" and trace.start == pytest.approx(1620000000.123, abs=1e-3)
    unset = read_trace(rows(tmp_path, **{**columns, "field.header.stamp": 0 * stamp}))
    assert unset.columns["time"] == "%time"


def test_plotjuggler_export(tmp_path: Path) -> None:
    """Paths of fields as names, a clock in seconds since 1970; two wrenches are not chosen between."""
    columns = {
        "__time": [f"{1.62e9 + t:.6f}" for t in TIME],
        "/wrench/wrench/force/x": 0 * LOAD,
        "/wrench/wrench/force/z": LOAD,
        "/ee/pose/position/z": HEIGHT,
    }
    trace = read_trace(rows(tmp_path, **columns))
    np.testing.assert_allclose(trace.time, TIME, atol=1e-6)
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.position, HEIGHT)
    with pytest.raises(TraceError, match="several columns could be the force: /wrench/wrench/force/z, /other/force/z"):
        read_trace(rows(tmp_path, **columns, **{"/other/force/z": LOAD}))


def test_robot_state_messages(tmp_path: Path) -> None:
    """The wrench of libfranka in a message, part by part, with its sign."""
    columns = {"%time": (1e9 * TIME).astype("i8"), "field.time": TIME}
    columns |= {f"field.O_F_ext_hat_K{i}": WRENCH[:, i] for i in range(6)}
    columns |= {f"field.O_T_EE{i}": POSE[:, i] for i in range(16)}
    trace = read_trace(rows(tmp_path, **columns))
    np.testing.assert_allclose(trace.force, LOAD)
    np.testing.assert_allclose(trace.position, HEIGHT)
    assert trace.columns["force"] == "field.O_F_ext_hat_K2"


def test_nanoseconds_by_name(tmp_path: Path) -> None:
    """A clock in nanoseconds whose name says so is one; whose name says seconds is refused."""
    clock = (1e9 * TIME).astype("i8")
    np.testing.assert_allclose(read_trace(rows(tmp_path, time_ns=clock, force_N=LOAD)).time, TIME, atol=1e-9)
    with pytest.raises(TraceError, match="column time_s.*check the unit"):
        read_trace(rows(tmp_path, time_s=1_620_000_000_000_000_000 + clock, force_N=LOAD))


def test_milliseconds_of_a_kilohertz_clock(tmp_path: Path) -> None:
    """A clock that counts 0, 1, 2 is one of milliseconds, not one of seconds; fifty hertz in seconds are no
    milliseconds."""
    with pytest.raises(TraceError, match="1 s apart; this looks like milliseconds"):
        read_trace(rows(tmp_path, time_s=np.arange(N), force_N=LOAD))
    with pytest.raises(TraceError, match="1e-05 s apart, more than 50000 a second"):
        read_trace(rows(tmp_path, time_ms=TIME, force_N=LOAD))


def test_frames(tmp_path: Path) -> None:
    """A DataFrame follows the rules of files; a named index is a column; its hash is that of its CSV text."""
    frame = pd.DataFrame({"time_ms": 1e3 * TIME, "load_N": LOAD, "depth_mm": 1e3 * (0.3 - HEIGHT)})
    for one in (frame, frame.set_index("time_ms"), frame.astype("Float64"), frame.astype(object)):
        trace = read_trace(one)
        np.testing.assert_allclose(trace.time, TIME)
        np.testing.assert_allclose(trace.force, LOAD)
        np.testing.assert_allclose(trace.position, HEIGHT - 0.3, atol=1e-12)
    assert trace.columns == {"time": "time_ms", "force": "load_N", "position": "depth_mm"}
    assert (trace.source, trace.label) == ("DataFrame", "measured")
    assert read_trace(frame).sha256 == hashlib.sha256(frame.to_csv(index=False).encode()).hexdigest()
    assert read_trace(frame).sha256 != read_trace(frame.assign(load_N=LOAD + 1)).sha256
    dates = frame.assign(time=pd.Timestamp("2024-05-01") + pd.to_timedelta(TIME, unit="s")).drop(columns="time_ms")
    np.testing.assert_allclose(read_trace(dates).time, TIME)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda f: f.assign(force_N=f.force_N.astype(object).where(f.index != 17, "x")),
            r"mine \(DataFrame\), row 17, column force_N: 'x'",
        ),
        (
            lambda f: f.assign(force_N=f.force_N.where((f.index < 17) | (f.index > 24))),
            r"mine \(DataFrame\), row 17, column force_N: nan is not finite",
        ),
        (
            lambda f: f.set_index(pd.Index(list(range(100, 140)))).assign(time_s=0.0),
            r"mine \(DataFrame\), row 101, column time_s: time",
        ),
        (lambda f: f.rename(columns={"force_N": "time_s"}), r"mine \(DataFrame\): column name 'time_s' occurs 2 times"),
        (lambda f: f.rename(columns={"force_N": "forse_N"}), "did you mean 'forse_N'"),
        (
            lambda f: f.astype("Float64").reindex(range(17)).reindex(range(40)),
            r"mine \(DataFrame\), row 17, column time_s: an empty cell is not a number",
        ),
        (lambda f: f.iloc[:0], r"mine \(DataFrame\): 0 rows"),
        (lambda f: f.iloc[:5], r"mine \(DataFrame\): 5 rows of data"),
        (lambda f: f.force_N, "a Series is no record"),
    ],
)
def test_errors_in_frames(change: Callable[[pd.DataFrame], Any], message: str) -> None:
    """Errors name the row by its index, and the frame as the caller calls it."""
    frame = pd.DataFrame({"time_s": TIME, "force_N": LOAD})
    with pytest.raises(TraceError, match=message):
        Trace.from_frame(change(frame), source="mine")


def test_frame_out_and_in_again() -> None:
    """A trace as a DataFrame is the same trace again, still reconstructed, and says that it passed through one."""
    trace = Trace(TIME, LOAD, HEIGHT, source="cut.csv", label="reconstructed")
    frame = trace.frame()
    assert list(frame) == ["time_s", "force_N", "position_m"]
    again = Trace.from_frame(frame)
    for name in ("time", "force", "position"):
        np.testing.assert_array_equal(getattr(again, name), getattr(trace, name))
    assert (again.source, again.label) == ("cut.csv (DataFrame)", "reconstructed")
    assert Trace.from_frame(again.frame()).source == "cut.csv (DataFrame)"
    assert list(Trace(TIME, LOAD).frame()) == ["time_s", "force_N"]


def test_clock_offset_is_said(tmp_path: Path) -> None:
    """Conditioning warns that times count from the first sample, and only then."""
    force = np.r_[np.zeros(100), np.linspace(0, 10, 100)] + 0.01 * np.random.default_rng(0).normal(size=200)
    for start in (0.0, 12460.0):
        frame = pd.DataFrame({"time_s": start + 0.01 * np.arange(200), "force_N": force})
        done = condition(read_trace(frame), speed=0.02)
        assert any("starts at 12460 s" in text for text in done.warnings) == bool(start)
        assert done.onset_s == pytest.approx(1.0, abs=0.05)


def test_compression_tests_from_json_and_hdf5(tmp_path: Path) -> None:
    """``cutcal compress`` reads the same files, repeats included."""
    way = np.r_[np.linspace(0, 6, 121), np.linspace(0, 6, 121)]
    columns = {"replicate": ["a"] * 121 + ["b"] * 121, "compression_mm": way, "load_N": 30 * way}
    shape = Shape("block", 0.02, 0.02, 0.02)
    path = tmp_path / "gel.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    want = read_repeats([path], shape, 0.2)
    for other in (
        of_json(tmp_path, {k: list(v) for k, v in columns.items()}, "gel.json"),
        of_hdf5(tmp_path, "gel.h5", **columns),
    ):
        got = read_repeats([other], shape, 0.2)
        np.testing.assert_allclose(got.stress, want.stress)
        assert got.names == ["a", "b"]
