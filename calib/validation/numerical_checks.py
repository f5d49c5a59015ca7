"""What numerical choices do to a calibrated force: the best values once more, slower, elsewhere on the grid, and with
each constant of the method halved and doubled."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from calib.io.provenance import code_key
from calib.io.typed_document import NULL, to_document
from calib.material.scene import with_other_particles
from calib.problem.setup import slower
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, content_key
from calib.simulation.workers import Errand, Workers
from calib.validation.method_constants import varied
from mpm.scene import Scene

FINER = 2 / 3
"""Cell of the finer grid over that of the calibration: five times the cost of the cut."""


CHANGE_LIMIT = 0.05
"""Of peak and work by numerical choices [-]: as much as the peak may miss the trace."""


def _finer(scene: Scene) -> Scene:
    return replace(scene, numerics=replace(scene.numerics, dx=FINER * scene.numerics.dx))


FINER_GRID, HALF_SPEED = "cells of two thirds", "half the simulated speed"
QUARTER_SPEED = "a quarter of the simulated speed"
"""Simulated where half the speed, carried on to rest, changes the force by more than :data:`CHANGE_LIMIT`."""
VARIANTS: Mapping[str, Callable[[Scene], Scene]] = {
    HALF_SPEED: slower,
    "grid and particles elsewhere": lambda scene: with_other_particles(scene, 1),
    FINER_GRID: _finer,
}
"""What should not matter and has a line of its own, by name. Order of convergence and uncertainty are the business of
a convergence study."""
VARIED = (
    "at half the speed, with the grid and the particles elsewhere, on cells of two thirds, and with the constants of "
    "the method halved and doubled"
)


def variants(scene: Scene, fitted: Collection[str] = ()) -> dict[str, Scene]:
    """The scenes that are compared with a scene, by what was changed; what is ``fitted`` is no constant."""
    return {name: vary(scene) for name, vary in VARIANTS.items()} | dict(varied(scene, fitted))


def check_errands(scene: Scene, store: EvaluationStore, fitted: Collection[str] = ()) -> list[Errand]:
    """The simulations that :func:`check` compares: those of the variants that the store does not know.

    Args:
        scene: The scene with its calibrated material.
        store: Where simulations are kept.
        fitted: Names of what was fitted.

    Returns:
        The simulations to make.
    """
    others = {_key(other): other for other in variants(scene, fitted).values()}
    return [Errand(other, _keeper(store, key)) for key, other in others.items() if store.get(key) is None]


class FinerCells:
    """Runs candidates on cells of two thirds, each once: what :func:`check` compares is kept where it looks for it.

    Args:
        scene: Makes the scene of a candidate, on the cells of the calibration.
        pool: Where the simulations run.
        store: Where they are kept.
    """

    def __init__(self, scene: Callable[[Mapping[str, float]], Scene], pool: Workers, store: EvaluationStore) -> None:
        self.scene, self.pool, self.store = scene, pool, store

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Run each candidate; yields in their order."""
        scenes = [_finer(self.scene(values)) for values in batch]
        self.pool.errands([Errand(s, _keeper(self.store, _key(s))) for s in scenes if self.store.get(_key(s)) is None])
        for index, (values, scene) in enumerate(zip(batch, scenes, strict=True)):
            yield replace(self.store.last(_key(scene)), index=index, parameters=dict(values))


def _keeper(store: EvaluationStore, key: str) -> Callable[[Evaluation], None]:
    return lambda run: store.append(key, run, "check")


def _key(scene: Scene) -> str:
    return content_key(scene.as_dict(), {}, code_key())


@dataclass(frozen=True)
class Check:
    """A repeated simulation against the one that is reported.

    Attributes:
        name: What was changed.
        reason: Why that run broke down; None where it did not.
        peak_change: Change of the peak, a fraction; None where the run broke down.
        work_change: Change of the work, a fraction; None where the run broke down.
        unbooked_change: Change of the part of the work that no law has taken; None where the run broke down.
    """

    name: str
    reason: str | None
    peak_change: float | None
    work_change: float | None
    unbooked_change: float | None = field(default=None, metadata=NULL)

    @property
    def change(self) -> float | None:
        """The larger change of peak and work, without its sign."""
        if self.peak_change is None or self.work_change is None:
            return None
        return max(abs(self.peak_change), abs(self.work_change))

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return to_document(self)


def further_errands(scene: Scene, own: Evaluation, store: EvaluationStore, stroke: float) -> list[Errand]:
    """The simulation at a quarter of the speed, where half of it cannot tell what a slow cut would give.

    A bias of first order in the speed is twice the change at half of it. A force whose bias falls faster is not that
    far from a slow one, and the two slowest runs say so.

    Args:
        scene: The scene with its calibrated material.
        own: Its simulation.
        store: Where :func:`check_errands` were kept.
        stroke: What the trace has of the stroke [m].

    Returns:
        One simulation, or none where half the speed says enough or broke down.
    """
    half = _against(own, HALF_SPEED, store.last(_key(slower(scene))), stroke)
    slowest = slower(slower(scene))
    if store.get(_key(slowest)) is not None or half.change is None or 2.0 * half.change <= CHANGE_LIMIT:
        return []
    return [Errand(slowest, _keeper(store, _key(slowest)))]


def check(
    scene: Scene, own: Evaluation, store: EvaluationStore, stroke: float, fitted: Collection[str] = ()
) -> list[Check]:
    """The variants of a scene against it.

    Args:
        scene: The scene with its calibrated material.
        own: Its simulation.
        store: Where :func:`check_errands` were kept.
        stroke: What the trace has of the stroke [m].
        fitted: Names of what was fitted.

    Returns:
        A check for each variant, and one of a quarter of the speed where that was made.

    Raises:
        KeyError: They were not made.
    """
    out = [_against(own, name, store.last(_key(other)), stroke) for name, other in variants(scene, fitted).items()]
    slowest = store.get(_key(slower(slower(scene))))
    return out if slowest is None else [*out, _against(own, QUARTER_SPEED, slowest, stroke)]


def _against(own: Evaluation, name: str, run: Evaluation, stroke: float) -> Check:
    """A repeated simulation against the one that is reported."""
    if not run.ok or min(own.until(stroke)) <= 0:
        return Check(name, run.reason or "no force", None, None)
    peak, work = (new / old - 1 for new, old in zip(run.until(stroke), own.until(stroke), strict=True))
    return Check(name, None, peak, work, run.unbooked - own.unbooked)


def at_rest(checks: Sequence[Check], which: Callable[[Check], float | None]) -> float | None:
    """Change from the reported simulation to a slow one, carried on from the slowest two speeds.

    The bias of the slowest run is taken to be of first order in the speed. What is carried on is never nearer than the
    slowest run itself: a force that scatters with the speed is not slow because a line through two runs ends well.

    Args:
        checks: The repeated simulations.
        which: Gives a check's change, such as of the peak.

    Returns:
        The change [-]; None where a run broke down, or none was at half the speed.
    """
    found = {check.name: which(check) for check in checks}
    half, quarter = found.get(HALF_SPEED), found.get(QUARTER_SPEED, math.nan)
    if half is None or quarter is None:
        return None
    return 2.0 * half if math.isnan(quarter) else max(2.0 * quarter - half, quarter, key=abs)
