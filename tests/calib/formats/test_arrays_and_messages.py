"""Arrays of numpy, messages that ROS has printed, and lists of channels: the same cut, or one clear error."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from calib.errors import TraceError
from calib.trace.conditioning import condition
from calib.trace.trace import read_trace
from tests.calib.made_cuts import made_cut, same_cut

CUT = made_cut()
TRUE = condition(CUT.trace())
COLUMNS = {"time_s": CUT.time, "force_N": CUT.force, "position_m": CUT.height}


def test_arrays_of_numpy(tmp_path: Path) -> None:
    """An archive of vectors, packed or not, with other things in it, rows, dates, and one array with named parts."""
    np.savez(tmp_path / "a.npz", **COLUMNS, gain=3.0, robot="arm", torque=np.zeros((640, 3)))
    np.savez_compressed(tmp_path / "b.npz", **{name: x[None, :] for name, x in COLUMNS.items()})
    parts = np.rec.fromarrays(list(COLUMNS.values()), names=",".join(COLUMNS))
    np.save(tmp_path / "c.npy", parts)
    np.savez(tmp_path / "d.npz", log=parts)
    stamps = np.datetime64("2024-06-12T17:33:33") + (1e9 * CUT.time).round().astype("timedelta64[ns]")
    np.savez(tmp_path / "e.npz", time=stamps, force_N=CUT.force, position_m=CUT.height)
    for name in ("a.npz", "b.npz", "c.npy", "d.npz", "e.npz"):
        same_cut(read_trace(tmp_path / name))


def test_files_of_python_that_are_not_read(tmp_path: Path) -> None:
    """An array without names says how to give them; objects are never loaded."""
    np.save(tmp_path / "a.npy", np.column_stack(list(COLUMNS.values())))
    with pytest.raises(TraceError, match=r"a.npy: an array of numpy without names of columns.*numpy.savez\(file"):
        read_trace(tmp_path / "a.npy")
    np.savez(tmp_path / "b.npz", time_s=CUT.time, force_N=CUT.force.astype(object))
    with pytest.raises(TraceError, match="b.npz: damaged, or no arrays of numbers"):
        read_trace(tmp_path / "b.npz")
    (tmp_path / "c.pkl").write_bytes(pickle.dumps(COLUMNS))
    with pytest.raises(TraceError, match=r"c.pkl: objects of Python \(pickle\), which are not read"):
        read_trace(tmp_path / "c.pkl")
    (tmp_path / "d.npz").write_bytes((tmp_path / "b.npz").read_bytes()[:900])
    with pytest.raises(TraceError, match="d.npz: damaged"):
        read_trace(tmp_path / "d.npz")


def test_a_structure_beside_single_values_of_matlab(tmp_path: Path) -> None:
    """All vectors are in it, so its name says nothing."""
    savemat(tmp_path / "cut.mat", {"data": COLUMNS, "operator": "me", "gain": 3.0})
    same_cut(read_trace(tmp_path / "cut.mat"))


def message(time: float, force: float, seconds: str, nanos: str) -> str:
    """A stamped wrench as ROS prints it."""
    parts = "".join(
        f"  {kind}:\n    x: 0.0\n    y: 0.0\n    z: {z}\n" for kind, z in (("force", force), ("torque", 0.0))
    )
    stamp = f"  stamp:\n    {seconds}: {1_700_000_000 + int(time)}\n    {nanos}: {round(1e9 * (time % 1))}\n"
    return f"header:\n{stamp}  frame_id: tool0\nwrench:\n{parts}"


@pytest.mark.parametrize("names", [("sec", "nanosec"), ("secs", "nsecs")])
@pytest.mark.parametrize("ending", ["", "header:\n  stamp:\n    sec: 17000", message(9.0, 12.0, "sec", "nanosec")[:-3]])
def test_messages_that_ros_has_printed(tmp_path: Path, names: tuple[str, str], ending: str) -> None:
    """``ros2 topic echo`` and ``rostopic echo``, also where the last message was cut off, by any name of the file."""
    text = "".join(f"{message(t, f, *names)}---\n" for t, f in zip(CUT.time, CUT.force, strict=True))
    (tmp_path / "wrench.txt").write_text(text + ending)
    trace = read_trace(tmp_path / "wrench.txt")
    assert trace.columns == {"time": "header.stamp", "force": "wrench.force.z"} and len(trace.time) == 640
    assert any("the last message is cut off" in note for note in trace.notes) == bool(ending)
    done = condition(trace, speed=0.02)
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.002)


def test_yaml_that_is_no_record(tmp_path: Path) -> None:
    """One that is damaged, and one whose parts stand elsewhere."""
    lists = "".join(f"{name}: {x.tolist()}\n" for name, x in COLUMNS.items())
    (tmp_path / "cut.yaml").write_text(lists)
    same_cut(read_trace(tmp_path / "cut.yaml"))
    (tmp_path / "cut.yaml").write_text(lists + "more: [")
    with pytest.raises(TraceError, match="cut.yaml: not YAML"):
        read_trace(tmp_path / "cut.yaml")
    (tmp_path / "cut.yaml").write_text("a: &a [1, 2]\nb: *a\n")
    with pytest.raises(TraceError, match="cut.yaml: YAML with aliases"):
        read_trace(tmp_path / "cut.yaml")


@pytest.mark.parametrize("names", [("name", "data"), ("channel", "values")])
def test_a_list_of_channels(tmp_path: Path, names: tuple[str, str]) -> None:
    """Each has its name, its unit and its numbers."""
    channels = [
        {names[0]: name, "unit": unit, names[1]: x.tolist()}
        for name, unit, x in (("time", "s", CUT.time), ("force", "mN", 1e3 * CUT.force), ("position", "m", CUT.height))
    ]
    (tmp_path / "cut.json").write_text(json.dumps({"food": "banana", "channels": channels}))
    same_cut(read_trace(tmp_path / "cut.json"))


def test_samples_below_a_list_of_names(tmp_path: Path) -> None:
    """Rows called samples are rows."""
    content = {"columns": list(COLUMNS), "samples": np.column_stack(list(COLUMNS.values())).tolist()}
    (tmp_path / "cut.json").write_text(json.dumps(content))
    same_cut(read_trace(tmp_path / "cut.json"))


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"ARROW1" + b"\0" * 90, "Arrow"),
        (b"<html><table>1</table>", "a web page"),
        (b"<?xml?>", "an XML"),
    ],
)
def test_other_programs_files_are_called_by_their_kind(tmp_path: Path, content: bytes, what: str) -> None:
    """The error says what the file is."""
    (tmp_path / "cut.xls").write_bytes(content)
    with pytest.raises(TraceError, match=rf"cut.xls: .*{what}.*; export the record as CSV"):
        read_trace(tmp_path / "cut.xls")
