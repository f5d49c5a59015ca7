"""Traces that come with cutcal are read by their names."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from calib.errors import TraceError
from calib.formats.bundled import BUNDLED
from calib.trace.trace import read_trace
from tests.data_dir import ROOT


@pytest.mark.parametrize("name", BUNDLED)
def test_a_name_is_enough(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In any folder, with and without the suffix, the same record as by its path; a name before it is refused."""
    there = read_trace(ROOT / "force_data" / f"{name}.csv")
    monkeypatch.chdir(tmp_path)
    for said in (name, f"{name}.csv", Path(name)):
        found = read_trace(said)
        assert (found.source, found.sha256) == (there.source, there.sha256)
        np.testing.assert_array_equal(found.force, there.force)
    with pytest.raises(TraceError, match="no such file"):
        read_trace(tmp_path / "elsewhere" / name)


def test_a_file_of_ones_own_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of that name in the current folder is read, and not the bundled one."""
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "force_data" / f"{BUNDLED[0]}.csv").read_text()
    Path(f"{BUNDLED[0]}.csv").write_text("# mine\n" + text)
    assert read_trace(f"{BUNDLED[0]}.csv").sha256 != read_trace(BUNDLED[0]).sha256


def test_a_slip_names_the_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that is nearly one is told so; a copy beside is named too."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TraceError, match="did you mean banana_reconstructed"):
        read_trace("banana_reconstruction")
    with pytest.raises(TraceError, match="did you mean banana_reconstructed"):
        read_trace("banana")
    shutil.copy(ROOT / "force_data" / f"{BUNDLED[0]}.csv", tmp_path / "banana_mine.csv")
    with pytest.raises(TraceError, match=r"did you mean banana_mine.csv"):
        read_trace("banana_mne.csv")
