"""Levels that move, sensors that stand or fall out, and positions that stand: each gives the truth or is said."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.conditioning import Conditioned, condition
from tests.calib.made_cuts import Cut, made_cut

CUT = made_cut()
TRUE = condition(CUT.trace())


def between(start: float, stop: float) -> np.ndarray:
    """Whether each sample lies between two times [s]."""
    return (CUT.time >= start - 1e-9) & (CUT.time < stop - 1e-9)


def conditioned(cut: Cut) -> Conditioned:
    """The cut as it is used."""
    return condition(replace(cut.trace(), columns={"force": "force_N", "time": "time_s", "position": "z_m"}))


def said(done: Conditioned, words: str) -> bool:
    """Whether one of the warnings says this."""
    return any(re.search(words, note) for note in done.warnings)


@pytest.mark.parametrize("shift", [0.75, 0.5, -0.6, -1.2])
@pytest.mark.parametrize("time", [1.2, 1.9, 2.05])
def test_a_small_shift_within_the_cut_is_refused(shift: float, time: float) -> None:
    """A shift of a twentieth of the peak is told from the slope of the cut, and the level behind shows it."""
    with pytest.raises(TraceError, match=r"force changes by .* N from one sample to the next within the cut, and so"):
        conditioned(CUT.but(force=CUT.force + shift * (CUT.time >= time)))


def test_a_level_that_has_moved_slowly_is_said_and_is_in_the_uncertainty() -> None:
    """Nothing sudden shows a drift within the cut, but the level behind it does."""
    moved = 1.5 * np.clip((CUT.time - 1.5) / 0.05, 0.0, 1.0)
    done = conditioned(CUT.but(force=CUT.force + moved))
    assert said(done, r"behind the cut, from sample \d+ \(.* s\) on, the force is 1.5 N above its level before it")
    assert done.peak_sd_N == pytest.approx(1.5 / 12**0.5, rel=0.05)
    assert not said(TRUE, "behind the cut") and TRUE.peak_sd_N < 0.05


def test_a_level_that_rises_before_contact_and_stays_is_moved() -> None:
    """The level behind the cut tells a sensor that has moved from food."""
    done = conditioned(CUT.but(force=CUT.force + 2.0 * (CUT.time >= 0.6)))
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.005)
    assert done.onset_s == pytest.approx(TRUE.onset_s, abs=0.01)
    assert said(done, r"sample 120 \(0.6 s\).*the level goes from 3.* to 4.9")


@pytest.mark.parametrize("top", [8.0, 11.0, 14.0])
def test_an_amplifier_at_its_end_that_has_noise_is_clipped(top: float) -> None:
    """Its noise is a part of the sensor's."""
    hiss = 0.002 * np.random.default_rng(1).normal(size=640)
    with pytest.raises(TraceError, match="the sensor is clipped there and the peak is higher"):
        conditioned(CUT.but(force=np.minimum(CUT.force, top) + hiss))


def test_a_sensor_that_stands_over_contact_is_refused() -> None:
    """The force jumps when it comes back, which is not contact."""
    frozen = np.where(between(0.9, 1.1), CUT.force[180], CUT.force)
    with pytest.raises(TraceError, match="the force is frozen for 0.2 s, and contact is there"):
        conditioned(CUT.but(force=frozen))


def test_a_sensor_that_falls_out_before_contact_was_not_zeroed() -> None:
    """Exact zeros amid noise are no measurements."""
    done = conditioned(CUT.but(force=np.where(between(0.95, 1.0), 0.0, CUT.force)))
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.005)
    assert not said(done, "zeroed")


@pytest.mark.parametrize(("start", "stop"), [(0.9, 1.1), (1.5, 2.4)])
def test_a_position_that_stands_and_jumps_is_bridged(start: float, stop: float) -> None:
    """The knife has moved on; its force is at the right stroke again."""
    inside = between(start, stop)
    done = conditioned(CUT.but(height=np.where(inside, CUT.height[int(np.argmax(inside))], CUT.height)))
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.005)
    assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, abs=3e-4)
    assert said(done, r"column z_m: the position stands until sample \d+ .* and then jumps by .* mm")


def test_samples_that_are_missing_where_the_knife_turns_are_said() -> None:
    """The lowest place is not in the record."""
    keep = ~between(2.5, 2.8)
    done = conditioned(Cut(CUT.time[keep], CUT.force[keep], CUT.height[keep]))
    assert said(done, "no samples were written, and the knife turns there; the stroke may be longer")


@pytest.mark.parametrize(("count", "value"), [(4, 100.0), (6, 20.0), (6, -6.0)])
def test_samples_that_stand_out_together_are_refused(count: int, value: float) -> None:
    """No food makes the force jump and come back from one sample to the next."""
    force = CUT.force.copy()
    force[418 : 418 + count] += value
    with pytest.raises(TraceError, match=rf"sample 418 .*: this sample and {count - 1} after it stand out together"):
        conditioned(CUT.but(force=force))


@pytest.mark.parametrize("slope", [0.3, 0.5])
def test_a_drift_that_a_short_approach_does_not_tell_is_said(slope: float) -> None:
    """Neither a tenth of a second before contact nor anything behind the cut tells of it."""
    keep = between(0.9, 2.6)
    short = Cut(CUT.time[keep], (CUT.force + slope * CUT.time)[keep], CUT.height[keep])
    assert said(conditioned(short), r"a drift of up to .* N over the cut cannot be told from the \d+ samples before")
    long = Cut(CUT.time[between(0.0, 2.6)], CUT.force[between(0.0, 2.6)], CUT.height[between(0.0, 2.6)])
    assert not said(conditioned(long), "cannot be told")


def test_four_equal_samples_at_the_top_are_clipped() -> None:
    """A sensor may end just below the peak."""
    top = np.sort(CUT.force)[-5]
    force = np.where(between(2.07, 2.09), 15.5, np.minimum(CUT.force, top))
    with pytest.raises(TraceError, match="the sensor is clipped there"):
        conditioned(CUT.but(force=force))


def test_a_sensor_that_stands_on_the_way_up_is_not_said_to_stand_before_contact() -> None:
    """It comes back when the knife is above the food again; samples that are missing before contact are said."""
    done = conditioned(CUT.but(force=np.where(between(2.75, 3.05), CUT.force[550], CUT.force)))
    assert not said(done, "before contact")
    keep = ~between(0.3, 0.5)
    assert said(conditioned(Cut(CUT.time[keep], CUT.force[keep], CUT.height[keep])), "s, before contact")


def test_the_noise_is_that_of_the_food_where_the_edge_comes_to_the_board() -> None:
    """A board that bears a hundred newtons makes no smooth data of a sensor's noise."""
    board = np.where(between(2.4, 2.605), 500.0 * (CUT.time - 2.4), 0.0)
    done = conditioned(CUT.but(force=CUT.force + board))
    assert done.at_board and not said(done, "hardly varies")


@pytest.mark.parametrize("step", [0.25, 0.5, 1.0])
def test_contact_is_as_uncertain_as_the_steps_of_the_force_leave_it(step: float) -> None:
    """A load that grows slowly is not seen below half a step; one that grows at once is."""
    way = np.clip((CUT.time - 1.0) / 1.6, 0.0, None) * (CUT.time <= 2.6)
    noise = 0.02 * np.random.default_rng(2).normal(size=640)
    slow, fast = (
        conditioned(CUT.but(force=np.round((3.0 + load + noise) / step) * step))
        for load in (12.0 * way**2, 12.0 * np.minimum(20.0 * way, 1.0 - 0.2 * way) * (way > 0))
    )
    assert abs(slow.onset_s - 1.0) < 4.0 * slow.onset_sd_s
    assert abs(fast.onset_s - 1.0) < 0.02 and fast.onset_sd_s < 0.02
