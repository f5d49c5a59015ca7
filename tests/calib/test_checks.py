"""What is reported for what a search found: the same cut at half the speed, which is also a check."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from calib.checks import SPEED, VARIANTS, report, slower
from calib.knives import load_knife
from calib.materials import load_food
from calib.scenes import MACH, SEARCH_MACH, Sizing, cut_scene, specimen
from calib.store import EvaluationStore, Header
from calib.workers import Workers
from mpm.scene import Scene
from tests.calib.cheap import cut


class Formula(Workers):
    """Records by formula, of which those at a speed of :data:`MACH` may break down."""

    def __init__(self, sound: bool) -> None:
        super().__init__(2, "cpu", 1)
        self.sound, self.asked = sound, 0

    def close(self) -> None:
        """Nothing runs."""

    def each(self, work: Any, jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """The last job ends first."""
        for k, (scene, *_) in reversed(list(enumerate(jobs))):
            self.asked += 1
            broken = not self.sound and scene.motion.mach < SEARCH_MACH
            yield k, replace(cut(scene), status="inverted", fraction=0.9) if broken else cut(scene)


def found() -> Scene:
    """A scene as a search has it."""
    food = load_food("banana")
    return cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"), mach=SEARCH_MACH)


@pytest.mark.parametrize("sound", [True, False])
def test_what_is_reported_runs_at_half_the_speed_if_it_can(tmp_path: Path, sound: bool) -> None:
    """The slower cut is reported and is the check of the speed; where it breaks down, the search's own is, and the check says why.
    Neither is simulated twice."""
    scene, pool = found(), Formula(sound)
    peak, work = cut(scene).peak, cut(scene).work
    for again in (False, True):
        with EvaluationStore(tmp_path / "evaluations.h5", Header("", "key"), resume=again) as store:
            shown, record, checks = report(scene, peak, work, pool, store, tmp_path / "record.h5", lambda text: None)
        assert pool.asked == (3 if sound else 4)
        assert shown.motion.mach == (MACH if sound else SEARCH_MACH)
        assert record.peak == cut(shown).peak and record.status == "done"
        assert [c.name for c in checks] == list(VARIANTS)
        first = checks[0]
        assert first.name == SPEED and first.reason == (None if sound else "inverted")
        assert first.peak_change == (pytest.approx(cut(slower(scene)).peak / peak - 1) if sound else None)
        assert all(c.reason is None for c in checks[1:])


def test_a_record_that_was_written_before_a_kill_is_not_made_again(tmp_path: Path) -> None:
    """The whole record is on disk, the store does not know of it yet: it is taken from there."""
    scene, pool = found(), Formula(sound=True)
    for name in ("before", "after"):
        with EvaluationStore(tmp_path / f"{name}.h5", Header("", "key"), resume=False) as store:
            report(scene, 1.0, 1.0, pool, store, tmp_path / "record.h5", lambda text: None, checked=False)
    assert pool.asked == 1
