"""HDF5 files that hold more than they say, or less: values of other files, and bombs."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from calib.errors import TraceError
from calib.formats import hdf5_table
from calib.trace.trace import read_trace

N = 40
TIME = 0.01 * np.arange(N)
LOAD = 2.0 + np.maximum(0.0, np.arange(N) - 10.0)


def external_link(folder, load):
    """The force behind a link to another file."""
    with h5py.File(folder / "other.h5", "w") as other:
        other["load"] = load
    with h5py.File(folder / "cut.h5", "w") as file:
        file["time_s"], file["force_N"] = TIME, h5py.ExternalLink("other.h5", "/load")


def external_storage(folder, load):
    """The force as raw bytes beside the file."""
    load.astype("<f8").tofile(folder / "load.bin")
    with h5py.File(folder / "cut.h5", "w") as file:
        file["time_s"] = TIME
        file.create_dataset("force_N", (N,), "<f8", external=[(str(folder / "load.bin"), 0, 8 * N)])


def virtual(folder, load):
    """The force as a view of another file."""
    with h5py.File(folder / "other.h5", "w") as other:
        other["load"] = load
    layout = h5py.VirtualLayout((N,), "<f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "load", (N,))
    with h5py.File(folder / "cut.h5", "w") as file:
        file["time_s"] = TIME
        file.create_virtual_dataset("force_N", layout)


@pytest.mark.parametrize("store", [external_link, external_storage, virtual])
def test_the_hash_covers_values_of_other_files(store, tmp_path):
    """Where the force lies in another file, another force has another hash though the file named is the same."""
    hashes, files = [], []
    for load in (LOAD, LOAD, 2 * LOAD):
        store(tmp_path, load)
        path = tmp_path / "cut.h5"
        if files:
            path.write_bytes(files[0])
        files.append(path.read_bytes())
        trace = read_trace(path)
        assert np.array_equal(trace.force, load)
        hashes.append(trace.sha256)
    assert hashes[0] == hashes[1] != hashes[2]


def test_columns_are_limited_together(tmp_path, monkeypatch):
    """Many columns that are each small enough are refused as a whole, before they are read."""
    monkeypatch.setattr(hdf5_table, "MOST_VALUES", 1000)
    with h5py.File(tmp_path / "cut.h5", "w") as file:
        file["time_s"], file["force_N"] = TIME, LOAD
        for k in range(30):
            file.create_dataset(f"zeros{k}", (N,), "f8", chunks=True, compression="gzip")
    with pytest.raises(TraceError, match="1280 values, at most 1000 are read"):
        read_trace(tmp_path / "cut.h5")


def test_groups_with_twins_are_records_of_their_own(tmp_path: Path) -> None:
    """Two groups with the same columns are two records, not one with columns of both."""
    path = tmp_path / "runs.h5"
    with h5py.File(path, "w") as file:
        for run in ("run1", "run2"):
            for name in ("time_s", "force_N", "position_m"):
                file[f"{run}/{name}"] = np.linspace(0.0, 1.0, 40)
    with pytest.raises(TraceError, match="several groups could be the record; name one: runs.h5:/run1, runs.h5:/run2"):
        read_trace(path)


def test_the_clock_may_be_in_another_group(tmp_path: Path) -> None:
    """As in DROID, where one group has the robot's state, and another its times."""
    path = tmp_path / "droid.h5"
    with h5py.File(path, "w") as file:
        file["observation/robot_state/wrench_N"] = np.tile(np.linspace(0.0, 1.0, 40)[:, None], 3)
        file["observation/robot_state/joints"] = np.zeros((40, 7))
        file["observation/timestamp/step_ms"] = 5 * np.arange(40)
    trace = read_trace(path, time_col="observation/timestamp/step_ms", force_col="observation/robot_state/wrench_z_N")
    np.testing.assert_allclose(trace.time, 0.005 * np.arange(40))
