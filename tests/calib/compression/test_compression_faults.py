"""Faults of a compression record: repaired, said or refused, with row and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.compression.measured import MeasuredCompression, read_repeats
from calib.errors import TraceError
from mpm.scene.shapes import Shape
from tests.calib.made_cuts import text_of

N = 300
SHAPE = Shape("upright_cylinder", 0.05, 0.05, 0.03)
WAY = np.linspace(0.0, 14.0, N)
LOAD = 98.0 * WAY / 30.0 + 0.02 * np.random.default_rng(0).normal(size=N)


def read(folder: Path, load: np.ndarray, keep: np.ndarray | None = None) -> MeasuredCompression:
    """The repeat of a load."""
    rows = [(f"{w:.5f}", f"{f:.4f}") for w, f in zip(WAY, load, strict=True)]
    path = folder / "press.csv"
    path.write_text(text_of("compression_mm,force_N", rows if keep is None else [rows[i] for i in keep]))
    return read_repeats([path], SHAPE, 0.4)


def test_a_value_that_stands_out_alone_is_replaced(tmp_path: Path) -> None:
    """It is said with its row, and the modulus is that of the sound record."""
    load = LOAD.copy()
    load[150] = 9999.0
    found, sound = read(tmp_path, load), read(tmp_path, LOAD)
    np.testing.assert_allclose(found.stress, sound.stress, atol=100.0)
    assert any("press.csv, row 152, column force_N: 9999 N stands out alone" in note for note in found.notes)
    assert not sound.notes


def test_a_clipped_or_frozen_load_is_refused(tmp_path: Path) -> None:
    """The rows are named."""
    for load in (np.minimum(LOAD, 25.0), np.where((WAY > 4.0) & (WAY < 7.0), LOAD[86], LOAD)):
        with pytest.raises(TraceError, match=r"press.csv, row \d+, column force_N: the load is .* N from there to"):
            read(tmp_path, load)


def test_missing_samples_and_sudden_changes_are_said(tmp_path: Path) -> None:
    """A gap of some millimetres, and a sensor that was moved."""
    gap = read(tmp_path, LOAD, np.r_[0:60, 200:N])
    assert any("row 61, column force_N: no samples for 6.6 mm of the way" in note for note in gap.notes), gap.notes
    moved = read(tmp_path, LOAD - 5.0 * (np.arange(N) >= 150))
    assert any("row 152, column force_N: the load changes by -5" in note for note in moved.notes), moved.notes
