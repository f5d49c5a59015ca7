"""A descent follows a bent valley of many parameters to its end with few runs, and stops where it must; of several the
deepest is found, which need not be the lowest at first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.fit.descent import DAMPINGS, Descent, race

COUNT = 10


def space(count: int, step: float, upper: Sequence[float] | None = None) -> Any:
    """Parameters whose prior says next to nothing, with no bounds but upper ones, where they are given."""
    far = np.full(count, math.inf)
    return SpaceOf(np.full(count, step), np.zeros(count), far, -far, far if upper is None else np.array(upper))


@dataclass(frozen=True)
class SpaceOf:
    """What a descent asks of a set of parameters."""

    steps: np.ndarray
    prior_mean: np.ndarray
    prior_sd: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def __len__(self) -> int:
        return len(self.steps)


SHALLOW, FLOOR = -10.0, 4.0


def residual(z: np.ndarray) -> np.ndarray:
    """A bent valley along pairs of parameters (Rosenbrock 1960, Comput. J. 3:175), least at 1, where it is 0.

    Far from it a straight one, least at SHALLOW, where it is FLOOR.
    """
    if z[0] < 0.5 * SHALLOW:
        return np.concatenate([z - SHALLOW, [math.sqrt(FLOOR)], np.zeros(COUNT - 3)])
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


def found(runs: Runs) -> Any:
    """Where a descent from the origin ends."""
    return race([descent(runs, 0.0)])[0]


def descent(runs: Runs, where: float) -> Descent:
    """A descent from a point on the diagonal."""
    return Descent(runs, space(COUNT, 0.3), runs.one(np.full(COUNT, where)))


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


def test_the_deepest_valley_wins_though_another_is_lower_at_first() -> None:
    """After one set of differences the shallow valley is the lowest; the other is followed on and ends at nothing."""
    runs = Runs()
    shallow, deep = descent(runs, SHALLOW + 0.3), descent(runs, -0.5)
    for one in (shallow, deep):
        one.go_on()
    assert shallow.best.misfit < 0.5 * deep.best.misfit
    ends = race([descent(runs, SHALLOW + 0.3), descent(runs, -0.5)])
    assert ends[1].misfit < 1e-12 and ends[0].misfit == pytest.approx(FLOOR)


def test_what_can_no_longer_win_is_not_followed() -> None:
    """A valley that has ended above another costs its first sets alone; one whose start broke down costs nothing."""
    alone = Runs()
    race([descent(alone, 0.0)])
    runs = Runs()
    race([descent(runs, 0.0), descent(runs, SHALLOW + 0.3)])
    assert 0 < runs.made - alone.made <= 2 * (COUNT + len(DAMPINGS))
    broken = Runs(breaks=1e3)
    assert not race([descent(broken, 1.0)])[0].ok and broken.made == 0


def test_what_a_parameter_at_its_bound_cannot_do_is_left_to_the_others() -> None:
    """The rows 2 a + b - 5 and a - b - 1 are nothing at (2, 1). With a at most 1 they are least at b = 3/2, and not at
    the 1 of the free answer; nothing beyond the bound is run."""
    asked: list[np.ndarray] = []

    def run(points: Sequence[np.ndarray]) -> list[Any]:
        asked.extend(points)
        rows = [np.array([2 * a + b - 5, a - b - 1]) for a, b in points]
        return [
            SimpleNamespace(z=z, residual=r, misfit=float(r @ r), ok=True) for z, r in zip(points, rows, strict=True)
        ]

    (end,) = race([Descent(run, space(2, 0.1, upper=[1.0, math.inf]), run([np.zeros(2)])[0])])
    assert end.z == pytest.approx([1.0, 1.5], rel=1e-3) and max(z[0] for z in asked) <= 1.0 + 1e-12


def test_no_step_is_longer_than_the_prior_is_wide() -> None:
    """Where the slope leads far beyond a prior of 0.5, what is run next lies at most that far away along each."""
    asked: list[np.ndarray] = []

    def run(points: Sequence[np.ndarray]) -> list[Any]:
        asked.extend(points)
        each = [(z, 100.0 - 0.1 * z) for z in points]
        return [SimpleNamespace(z=z, residual=rows, misfit=float(rows @ rows), ok=True) for z, rows in each]

    one = Descent(run, replace(space(3, 0.1), prior_sd=np.full(3, 0.5)), run([np.zeros(3)])[0])
    one.go_on()
    assert np.abs(asked).max() == pytest.approx(0.5)


@pytest.mark.parametrize(("part", "over"), [(0.02, True), (0.05, False)])
def test_a_descent_ends_where_a_set_of_differences_hardly_gains(
    part: float, over: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A set that takes 2 % off the chi-square is the last, one that takes 5 % is not."""

    def follow(self: Descent) -> bool:
        self.best = SimpleNamespace(misfit=(1.0 - part) * self.best.misfit, ok=True)
        return True

    monkeypatch.setattr(Descent, "_follow", follow)
    one = descent(Runs(), 0.0)
    one.go_on()
    assert one.over is over and one.gained == pytest.approx(part * (COUNT - 1))
