"""A descent follows a bent valley of many parameters to its end with few runs, and stops where it must."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.fit.descent import DAMPINGS, descend

COUNT = 10
STEPS = np.full(COUNT, 0.3)


def residual(z: np.ndarray) -> np.ndarray:
    """A bent valley along pairs of parameters (Rosenbrock 1960, Comput. J. 3:175), least at 1, where it is 0."""
    return np.concatenate([3.0 * (z[1:] - z[:-1] ** 2), 1.0 - z[:-1]])


class Runs:
    """Runs points, as many as can be paid, and counts them; those of some points break down."""

    def __init__(self, most: int = 10_000, breaks: float | None = None) -> None:
        self.most, self.breaks, self.made = most, breaks, 0

    def one(self, z: np.ndarray) -> Any:
        """A run."""
        rows, ok = residual(z), self.breaks is None or z[0] <= 0.4
        rows = rows if ok else np.full_like(rows, self.breaks)
        return SimpleNamespace(z=z, residual=rows, misfit=float(rows @ rows), ok=ok)

    def __call__(self, points: Sequence[np.ndarray]) -> list[Any]:
        paid = points[: self.most - self.made]
        self.made += len(paid)
        return [self.one(z) for z in paid]


def found(runs: Runs, **more: Any) -> Any:
    """Where a descent from the origin ends."""
    return descend(runs, STEPS, np.zeros(COUNT), runs.one(np.zeros(COUNT)), **more)


def test_a_bent_valley_is_followed_to_its_end() -> None:
    """Ten parameters: a hundredth of the misfit in ten sets of differences, nothing at the end, where it stops."""
    runs = Runs(10 * (COUNT + len(DAMPINGS)))
    assert found(runs).misfit < 0.01 * (COUNT - 1)
    runs = Runs()
    assert found(runs).misfit < 1e-12 and runs.made < runs.most


def test_correcting_the_jacobian_saves_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same 150 runs end at a thousandth of the misfit where what was tried corrects the differences (1e-5)."""
    corrected = found(Runs(150)).misfit
    monkeypatch.setattr("calib.fit.descent.REFINED", 1.0)
    assert 1000 * corrected < found(Runs(150)).misfit < COUNT - 1


@pytest.mark.parametrize("most", [0, 4, COUNT, COUNT + 3])
def test_what_cannot_be_paid_is_not_run(most: int) -> None:
    """It ends with the best of what there is, and never above its start."""
    runs = Runs(most)
    end = found(runs)
    assert runs.made <= most and end.misfit <= COUNT - 1


@pytest.mark.parametrize("rows", [1e3, 0.0])
def test_runs_that_break_down_are_no_way(rows: float) -> None:
    """Where steps lead into a breakdown, the end is a run that did not, however well its curve looks."""
    end = found(Runs(breaks=rows))
    assert end.ok and end.misfit < COUNT - 1
