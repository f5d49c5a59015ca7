"""What numerical choices do to a calibrated force: the best values once more, slower and elsewhere on the grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from calib.provenance import code_key
from calib.scenes import elsewhere
from calib.store import EvaluationStore, content_key
from calib.workers import Workers
from mpm.scene import Scene


def _slower(scene: Scene) -> Scene:
    return replace(scene, motion=replace(scene.motion, mach=scene.motion.mach / 2))


FINER = 2 / 3
"""Cell of the finer grid over that of the calibration: five times the cost of the cut."""


def _finer(scene: Scene) -> Scene:
    return replace(scene, numerics=replace(scene.numerics, dx=FINER * scene.numerics.dx))


def otherwise(scene: Scene) -> Scene:
    """The scene at half the speed, with other particles and the grid elsewhere: what an answer should not depend on."""
    return elsewhere(_slower(scene), 2)


FINER_GRID = "cells of two thirds"
VARIANTS: Mapping[str, Callable[[Scene], Scene]] = {
    "half the simulated speed": _slower,
    "grid and particles elsewhere": lambda scene: elsewhere(scene, 1),
    FINER_GRID: _finer,
}
"""What should not matter, by name. The order of convergence, and an uncertainty, are the business of a convergence study."""


def _haste(scene: Scene) -> float:
    """Inverse of what a run takes, but for a factor: the longest is begun first, or the others' workers wait for it."""
    return scene.motion.mach * scene.numerics.dx**4


@dataclass(frozen=True)
class Check:
    """A repeated simulation against the one that is reported.

    Attributes: name; reason why it broke down, or None; changes of peak and work, as fractions, and of the part of the work that
    no law has taken, None where it broke down.
    """

    name: str
    reason: str | None
    peak_change: float | None
    work_change: float | None
    unbooked_change: float | None = None

    @property
    def change(self) -> float | None:
        """The larger of the two, without its sign."""
        if self.peak_change is None or self.work_change is None:
            return None
        return max(abs(self.peak_change), abs(self.work_change))

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def check(
    scene: Scene, own: Mapping[str, float], pool: Workers, store: EvaluationStore, say: Callable[[str], None]
) -> list[Check]:
    """Simulate the variants of a scene; what the store knows is not simulated again.

    Args:
        scene: The scene with its calibrated material.
        own: Its ``peak_N``, ``work_J`` and ``unbooked_J``.
        pool: Where they run.
        store: Where they are kept.
        say: Told when they are simulated.
    """
    scenes = [vary(scene) for vary in VARIANTS.values()]
    keys = [content_key(s.as_dict(), {}, code_key()) for s in scenes]
    found = {k: known for k, key in enumerate(keys) if (known := store.get(key))}
    new = sorted((k for k in range(len(scenes)) if k not in found), key=lambda k: _haste(scenes[k]))
    if new:
        say("simulating them at half the speed, with the grid and the particles elsewhere, and on cells of two thirds")
    for result in pool.run([(scenes[k], {}) for k in new]):
        k = new[result.index]
        store.append(keys[k], result, "check")
        found[k] = result
    out = []
    for k, name in enumerate(VARIANTS):
        run = found[k]
        if run.ok and own["peak_N"] > 0 and own["work_J"] > 0:
            peak, work = (run.scalars[q] / own[q] - 1 for q in ("peak_N", "work_J"))
            unbooked = run.scalars["unbooked_J"] / run.scalars["work_J"] - own["unbooked_J"] / own["work_J"]
            out.append(Check(name, None, peak, work, unbooked))
        else:
            out.append(Check(name, run.reason or "no force", None, None))
    return out
