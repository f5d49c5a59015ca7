"""What numerical choices do to a calibrated force: the best values once more, slower, elsewhere on the grid, and on a finer one.

A search runs at twice the speed of what is reported; the best values at half that speed are both the reported cut and one of the
checks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.evaluation import Evaluation
from calib.provenance import code_key
from calib.records import keep_record, kept_record, whole_record
from calib.scenes import elsewhere
from calib.store import EvaluationStore, content_key
from calib.workers import DIED, Workers, plain
from mpm.record import ForceRecord
from mpm.scene import Scene


def slower(scene: Scene) -> Scene:
    """The scene at half the speed: the one that is reported for what a search found."""
    return replace(scene, motion=replace(scene.motion, mach=scene.motion.mach / 2))


FINER = 2 / 3
"""Cell of the finer grid over that of the calibration: five times the cost of the cut."""


def _finer(scene: Scene) -> Scene:
    return replace(scene, numerics=replace(scene.numerics, dx=FINER * scene.numerics.dx))


def otherwise(scene: Scene) -> Scene:
    """The scene at half the speed, with other particles and the grid elsewhere: what an answer should not depend on."""
    return elsewhere(slower(scene), 2)


SPEED = "half the simulated speed"
VARIANTS: Mapping[str, Callable[[Scene], Scene]] = {
    SPEED: slower,
    "grid and particles elsewhere": lambda scene: elsewhere(scene, 1),
    "cells of two thirds": _finer,
}
"""What should not matter, by name. The order of convergence, and an uncertainty, are the business of a convergence study."""


@dataclass(frozen=True)
class Check:
    """A repeated simulation against that of the search.

    Attributes: name; reason why it broke down, or None; changes of peak and work, as fractions, None where it broke down.
    """

    name: str
    reason: str | None
    peak_change: float | None
    work_change: float | None

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
    scene: Scene, peak: float, work: float, pool: Workers, store: EvaluationStore, say: Callable[[str], None]
) -> list[Check]:
    """Simulate the variants of a scene; what the store knows is not simulated again.

    Args:
        scene: The scene of the search with its calibrated material.
        peak: Its peak force [N].
        work: Its work [J].
        pool: Where they run.
        store: Where they are kept.
        say: Told when they are simulated.
    """
    return _checks(_runs(scene, VARIANTS, pool, store, None, say), peak, work)


def report(
    scene: Scene,
    peak: float,
    work: float,
    pool: Workers,
    store: EvaluationStore,
    path: Path,
    say: Callable[[str], None],
    *,
    checked: bool = True,
) -> tuple[Scene, ForceRecord, list[Check]]:
    """The cut that is reported for what a search found, with its whole record, and the checks.

    It is the search's at half the speed; where that breaks down, the search's own.

    Args:
        scene: The scene of the search with its calibrated material.
        peak: Its peak force [N].
        work: Its work [J].
        pool: Where they run.
        store: Where they are kept.
        path: File of the record; a record of something else in it is replaced.
        say: Told when they are simulated.
        checked: Whether there are checks.

    Raises:
        OutputError: The record cannot be written.
        SimulationError: The process of a simulation was killed twice.
    """
    variants = VARIANTS if checked else {SPEED: slower}
    found = _runs(scene, variants, pool, store, path, say)
    reported = slower(scene) if found[SPEED].ok else scene
    checks = _checks(found, peak, work) if checked else []
    return reported, whole_record(reported, pool, path, say), checks


def _runs(
    scene: Scene,
    variants: Mapping[str, Callable[[Scene], Scene]],
    pool: Workers,
    store: EvaluationStore,
    path: Path | None,
    say: Callable[[str], None],
) -> dict[str, Evaluation]:
    """Variants of a scene by name; where there is a ``path``, the whole record of the slower one is kept there."""
    scenes = {name: vary(scene) for name, vary in variants.items()}
    keys = {name: content_key(s.as_dict(), {}, code_key()) for name, s in scenes.items()}
    found = {name: known for name, key in keys.items() if (known := store.get(key))}
    if path is not None and SPEED not in found and (record := kept_record(scenes[SPEED], path)):
        found[SPEED] = Evaluation(index=0, parameters={}, **plain(record))  # killed between the two files
        store.append(keys[SPEED], found[SPEED], "check")
    new = [name for name in scenes if name not in found]
    if new:
        say(f"simulating the best values once more: {', '.join(new)}")
    asked = [scenes[name] for name in new]
    runs = (
        pool.run([(s, {}) for s in asked])
        if path is None
        else _kept(asked, new.index(SPEED) if SPEED in new else -1, pool, path)
    )
    for run in runs:
        found[new[run.index]] = run
        store.append(keys[new[run.index]], run, "check")
    return found


def _kept(scenes: Sequence[Scene], which: int, pool: Workers, path: Path) -> Iterator[Evaluation]:
    """Run scenes and keep the whole record of one of them; yields in order of completion, ``index`` is the place among them."""
    for index, record in pool.records(scenes):
        if record is None:
            yield Evaluation(index, {}, "failed", DIED, 0.0, np.empty(0), np.empty(0))
            continue
        if index == which:
            keep_record(scenes[index], record, path)
        yield Evaluation(index=index, parameters={}, **plain(record))


def _checks(found: Mapping[str, Evaluation], peak: float, work: float) -> list[Check]:
    """Changes of peak [N] and work [J] in each variant."""
    out = []
    for name in VARIANTS:
        run = found[name]
        if run.ok and peak > 0 and work > 0:
            out.append(Check(name, None, run.scalars["peak_N"] / peak - 1, run.scalars["work_J"] / work - 1))
        else:
            out.append(Check(name, run.reason or "no force", None, None))
    return out
