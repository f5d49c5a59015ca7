"""Records in formats that need further packages, and in MATLAB and HDF5 files of several layouts: the same cut."""

from __future__ import annotations

import datetime
import importlib
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from calib.errors import TraceError
from calib.formats import extras
from calib.trace.trace import read_trace
from tests.calib.made_cuts import made_cut, same_cut

CUT = made_cut()
COLUMNS = {"time_s": CUT.time, "force_N": CUT.force, "position_m": CUT.height}


def test_matlab_before_7_3(tmp_path: Path) -> None:
    """Vectors, rows or columns, at the top, in a structure, with a structure of units."""
    savemat(tmp_path / "a.mat", COLUMNS)
    savemat(tmp_path / "b.mat", {name: x[:, None] for name, x in COLUMNS.items()} | {"robot": "arm", "gain": 3.0})
    savemat(tmp_path / "c.mat", {"log": COLUMNS, "air": {"time_s": CUT.time, "force_N": 0.0 * CUT.time}})
    plain = {"time": CUT.time, "force": CUT.force / 9.80665, "stroke": CUT.depth_mm}
    savemat(tmp_path / "d.mat", plain | {"units": {"time": "s", "force": "kgf", "stroke": "mm"}})
    for name in ("a.mat", "b.mat", "c.mat:log", "d.mat"):
        same_cut(read_trace(f"{tmp_path / name}"))
    assert read_trace(tmp_path / "c.mat:log").source == "c.mat:log"
    with pytest.raises(TraceError, match=r"c.mat:knife: nothing is called knife in the file; it holds log, air"):
        read_trace(tmp_path / "c.mat:knife")
    (tmp_path / "e.mat").write_bytes((tmp_path / "a.mat").read_bytes()[:900])
    with pytest.raises(TraceError, match="e.mat: damaged, or not a MATLAB file"):
        read_trace(tmp_path / "e.mat")


def test_matlab_7_3(tmp_path: Path) -> None:
    """HDF5 behind a block of MATLAB's own, vectors as rows."""
    with h5py.File(tmp_path / "cut.mat", "w", userblock_size=512) as file:
        for name, x in COLUMNS.items():
            file.create_dataset(name, data=x[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with open(tmp_path / "cut.mat", "r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    same_cut(read_trace(tmp_path / "cut.mat"))
    same_cut(read_trace(f"{tmp_path / 'cut.mat'}:/"))


def test_demonstrations_of_robots(tmp_path: Path) -> None:
    """robomimic has several demonstrations with groups of their own and no clock, DROID one with nested groups."""
    position = np.column_stack([0.4 + 0 * CUT.time, 0 * CUT.time, CUT.height])
    wrench = np.column_stack([0 * CUT.time, 0 * CUT.time, CUT.force])
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        for k, stop in ((0, 640), (1, 500)):
            group = file.create_group(f"data/demo_{k}")
            group["actions"] = np.zeros((stop, 7))
            group["obs/robot0_eef_pos"], group["obs/robot0_eef_force"] = position[:stop], wrench[:stop]
    how = {"rate": 200.0, "force_col": "obs/robot0_eef_force_z=N", "position_col": "obs/robot0_eef_pos_z=m"}
    same_cut(read_trace(f"{tmp_path / 'demo.hdf5'}:/data/demo_0", **how))
    with pytest.raises(TraceError, match="several groups could be the record.*demo.hdf5:/data/demo_0"):
        read_trace(tmp_path / "demo.hdf5", **how)
    with h5py.File(tmp_path / "trajectory.h5", "w") as file:
        file["observation/timestamp/control/step_start"] = (1e3 * (1.7e9 + CUT.time)).round().astype("i8")
        file["observation/robot_state/cartesian_position"] = np.column_stack([position, wrench])
        file["action/gripper_position"] = 0 * CUT.time
    named = {
        "time_col": "observation/timestamp/control/step_start=ms",
        "force_col": "observation/robot_state/cartesian_position_rz=N",
        "position_col": "observation/robot_state/cartesian_position_z=m",
    }
    same_cut(read_trace(tmp_path / "trajectory.h5", **named))


def test_parquet(tmp_path: Path) -> None:
    """Columns, lists in rows, dates, and units in the metadata of a column."""
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    pd.DataFrame(COLUMNS).to_parquet(tmp_path / "a.parquet")
    dates = pd.Timestamp("2024-05-01", tz="UTC") + pd.to_timedelta(CUT.time, unit="s")
    listed = {"timestamp": dates, "force_N": CUT.force, "ee_position_m": [[0.0, 0.0, z] for z in CUT.height]}
    pd.DataFrame(listed).to_parquet(tmp_path / "b.parquet")
    units = {"time": "ms", "load": "lbf", "height": "mm"}
    fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, unit in units.items()]
    values = [1e3 * CUT.time, CUT.force / 4.4482216152605, 1e3 * CUT.height]
    parquet.write_table(arrow.table(values, schema=arrow.schema(fields)), tmp_path / "c.parquet")
    for name in ("a", "b", "c"):
        same_cut(read_trace(tmp_path / f"{name}.parquet"))
    (tmp_path / "d.parquet").write_bytes((tmp_path / "a.parquet").read_bytes()[:3000])
    with pytest.raises(TraceError, match="d.parquet: damaged, or not a Parquet file"):
        read_trace(tmp_path / "d.parquet")


def test_spreadsheets(tmp_path: Path) -> None:
    """Words above the header, a row of units, times of the day; a sheet of two is named."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Cut"
    for row in (["Specimen", "gel 1"], [], ["Time", "Extension", "Load"], ["(s)", "(mm)", "(N)"]):
        sheet.append(row)
    start = datetime.datetime(2024, 6, 12, 17, 33, 33)
    for t, d, f in zip(CUT.time.tolist(), CUT.depth_mm.tolist(), CUT.force.tolist(), strict=True):
        sheet.append([t, d, f])
    book.create_sheet("Notes").append(["nothing", "here"])
    book.save(tmp_path / "a.xlsx")
    same_cut(read_trace(tmp_path / "a.xlsx"))
    air = book.create_sheet("Air")
    air.append(["time", "force_N"])
    for k in range(30):
        air.append([start + datetime.timedelta(milliseconds=5 * k), 3.0])
    book.save(tmp_path / "b.xlsx")
    same_cut(read_trace(f"{tmp_path / 'b.xlsx'}:Cut"))
    assert read_trace(f"{tmp_path / 'b.xlsx'}:Air").dt == pytest.approx(0.005)
    with pytest.raises(TraceError, match=r"b.xlsx: several sheets hold a table, Cut, Air; name one as b.xlsx:SHEET"):
        read_trace(tmp_path / "b.xlsx")
    sheet["C40"] = "oops"
    book.remove(air)
    book.save(tmp_path / "c.xlsx")
    with pytest.raises(TraceError, match="c.xlsx, row 40, column Load: 'oops' is not a number"):
        read_trace(tmp_path / "c.xlsx")
    (tmp_path / "d.xlsx").write_bytes((tmp_path / "c.xlsx").read_bytes()[:500])
    with pytest.raises(TraceError, match="d.xlsx: damaged, or not an .xlsx file"):
        read_trace(tmp_path / "d.xlsx")


def test_tdms(tmp_path: Path) -> None:
    """Channels of a group with their units, and the waveform's clock."""
    nptdms = pytest.importorskip("nptdms")
    wave = {"wf_increment": 0.005, "wf_start_offset": 0.0, "wf_samples": 640}
    channels = [
        nptdms.ChannelObject("cut", "Force", CUT.force / 9.80665, properties={"unit_string": "kgf", **wave}),
        nptdms.ChannelObject("cut", "Position", 1e3 * CUT.height, properties={"unit_string": "mm", **wave}),
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(channels)
    same_cut(read_trace(tmp_path / "a.tdms"))
    (tmp_path / "b.tdms").write_bytes(b"TDSm" + b"\x01" * 40)
    with pytest.raises(TraceError, match="b.tdms: damaged, or not a TDMS file"):
        read_trace(tmp_path / "b.tdms")


def _stamped(types: object, kind: str, topic: str, t: float) -> object:
    """The header of a message."""
    stamp = types["builtin_interfaces/msg/Time"](sec=1_700_000_000 + int(t), nanosec=round(1e9 * (t % 1)))
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=topic) if kind == "2" else None


@pytest.mark.parametrize("storage", ["sqlite3", "mcap", "mcap alone"])
def test_bags_of_ros_2(tmp_path: Path, storage: str) -> None:
    """Force and position are messages of their own, each at its own time."""
    pytest.importorskip("rosbags")
    rosbag2 = importlib.import_module("rosbags.rosbag2")
    typesys = importlib.import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.LATEST)
    types = store.types
    vector, point, quaternion = (types[f"geometry_msgs/msg/{n}"] for n in ("Vector3", "Point", "Quaternion"))
    plugin = {"sqlite3": rosbag2.StoragePlugin.SQLITE3}.get(storage, rosbag2.StoragePlugin.MCAP)
    zero = vector(0.0, 0.0, 0.0)
    with rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=plugin) as writer:
        ft = writer.add_connection("/ft/wrench", "geometry_msgs/msg/WrenchStamped", typestore=store)
        ee = writer.add_connection("/ee/pose", "geometry_msgs/msg/PoseStamped", typestore=store)
        for t, f, z in zip(CUT.time.tolist(), CUT.force.tolist(), CUT.height.tolist(), strict=True):
            wrench = types["geometry_msgs/msg/Wrench"](force=vector(0.0, 0.0, f), torque=zero)
            pose = types["geometry_msgs/msg/Pose"](point(0.0, 0.0, z), quaternion(0.0, 0.0, 0.0, 1.0))
            at = round(1e9 * (1.7e9 + t))
            messages = (
                (ft, types["geometry_msgs/msg/WrenchStamped"](_stamped(types, "2", "tool", t), wrench)),
                (ee, types["geometry_msgs/msg/PoseStamped"](_stamped(types, "2", "base", t + 0.001), pose)),
            )
            for connection, message in messages:
                writer.write(connection, at, store.serialize_cdr(message, connection.msgtype))
    path = tmp_path / "bag"
    trace = read_trace(next(path.glob("*.mcap")) if storage == "mcap alone" else path)
    assert trace.columns["force"] == "/ft/wrench/wrench/force/z" and len(trace.sha256) == 64
    same_cut(trace)


def test_bags_of_ros_1(tmp_path: Path) -> None:
    """Definitions of messages that nobody knows are in the bag; vectors become columns, with libfranka's meaning."""
    pytest.importorskip("rosbags")
    rosbag1 = importlib.import_module("rosbags.rosbag1")
    typesys = importlib.import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    text = "std_msgs/Header header\nfloat64[6] O_F_ext_hat_K\nfloat64[16] O_T_EE\n"
    store.register(typesys.get_types_from_msg(text, "franka_msgs/msg/FrankaState"))
    types = store.types
    state = types["franka_msgs/msg/FrankaState"]
    with rosbag1.Writer(tmp_path / "cut.bag") as writer:
        franka = writer.add_connection("/franka_state", state.__msgtype__, typestore=store)
        for k, (t, f, z) in enumerate(zip(CUT.time.tolist(), CUT.force.tolist(), CUT.height.tolist(), strict=True)):
            stamp = types["builtin_interfaces/msg/Time"](sec=1_700_000_000 + int(t), nanosec=round(1e9 * (t % 1)))
            header = types["std_msgs/msg/Header"](seq=k, stamp=stamp, frame_id="base")
            wrench, pose = np.zeros(6), np.zeros(16)
            wrench[2], pose[14] = -f, z
            writer.write(
                franka, round(1e9 * (1.7e9 + t)), store.serialize_ros1(state(header, wrench, pose), state.__msgtype__)
            )
    trace = read_trace(tmp_path / "cut.bag")
    assert trace.columns["force"] == "/franka_state/O_F_ext_hat_K[2]"
    same_cut(trace)
    (tmp_path / "bad.bag").write_bytes((tmp_path / "cut.bag").read_bytes()[:700])
    with pytest.raises(TraceError, match="bad.bag: damaged, or not a bag of ROS"):
        read_trace(tmp_path / "bad.bag")


def test_a_package_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra the error says what installs it; files that nobody reads say what to do."""
    (tmp_path / "a.tdms").write_bytes(b"TDSm" + b"\x00" * 40)

    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(extras.importlib, "import_module", missing)
    with pytest.raises(
        TraceError, match=r"a.tdms: a TDMS file needs nptdms; install it with pip install 'cutcal\[formats\]'"
    ):
        read_trace(tmp_path / "a.tdms")
    for raw, words in (
        (b"\xd0\xcf\x11\xe0" + b"0" * 600, "Office before 2007; export the record as CSV"),
        (b"\x93NUMPY" + b"0" * 600, "numpy without names of columns; export the record as CSV"),
        (b"\x1f\x8b\x08" + b"0" * 30, "damaged, or not compressed as its name says"),
    ):
        (tmp_path / "a.xls").write_bytes(raw)
        with pytest.raises(TraceError, match=f"a.xls: .*{words}"):
            read_trace(tmp_path / "a.xls")
