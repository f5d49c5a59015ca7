"""A made-up cut of known contact, stroke and peak, from which tests write records in all kinds of files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.trace.conditioning import condition
from calib.trace.trace import Trace, read_trace

RATE, LEVEL, PEAK, CONTACT_S, END_S, STROKE_M = 200.0, 3.0, 12.0, 1.0, 2.6, 0.032
"""Samples a second, level before contact [N], largest force above it [N], contact and end of the stroke [s], stroke."""
NOISE = 0.03


@dataclass(frozen=True)
class Cut:
    """Time [s], force with its level [N], height [m], each of shape (640,)."""

    time: np.ndarray
    force: np.ndarray
    height: np.ndarray

    @property
    def depth_mm(self) -> np.ndarray:
        """Way down since the start [mm]."""
        return 1e3 * (self.height[0] - self.height)

    def trace(self) -> Trace:
        """The same as a trace."""
        return Trace(self.time, self.force, self.height, "made.csv", "", {"force": "force_N", "time": "time_s"})

    def but(self, **changed: np.ndarray) -> Cut:
        """The same with other numbers."""
        return replace(self, **changed)


def made_cut(*, level: float = LEVEL, peak: float = PEAK, seed: int = 0) -> Cut:
    """Down at 20 mm/s with a ramp to the peak at 22 mm and a fall behind it, up at 100 mm/s."""
    time = np.arange(640) / RATE
    height = 0.06 - 0.02 * np.minimum(time, END_S) + 0.1 * np.maximum(time - END_S, 0.0)
    depth = np.where(time <= END_S, 0.04 - height, 0.0)
    load = np.interp(depth, [0.0, 0.022, 0.032], [0.0, peak, 0.8 * peak])
    noise = NOISE * np.random.default_rng(seed).normal(size=len(time))
    return Cut(time, level + load + noise, height)


def text_of(header: str, rows: Sequence[Sequence[object]], separator: str = ",") -> str:
    """A header and rows of cells."""
    return header + "\n" + "\n".join(separator.join(str(cell) for cell in row) for row in rows) + "\n"


def plain_rows(cut: Cut) -> list[tuple[str, str, str]]:
    """Time [s], force [N] and height [m] with four decimals."""
    return [(f"{t:.4f}", f"{f:.4f}", f"{z:.5f}") for t, f, z in zip(cut.time, cut.force, cut.height, strict=True)]


def read(folder: Path, text: str | bytes, name: str = "cut.csv", **how: Any) -> Trace:
    """The trace in a text."""
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_trace(path, **how)


def same_cut(trace: Trace) -> None:
    """Contact, stroke and peak are those of the cut that was made up."""
    done, true = condition(trace), condition(made_cut().trace())
    assert done.onset_s == pytest.approx(true.onset_s, abs=0.005)
    assert done.peak_N == pytest.approx(true.peak_N, rel=0.002)
    assert done.stroke_length_m == pytest.approx(true.stroke_length_m, abs=2e-4)
