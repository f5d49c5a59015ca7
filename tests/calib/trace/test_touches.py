"""Touches and ways in the air beside a cut, a level that is reached slowly, and ends of a record that stand out."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import TraceError
from calib.trace.conditioning import Conditioned, condition
from calib.trace.trace import Trace
from tests.calib.made_cuts import LEVEL, RATE, made_cut

CUT = made_cut()
TRUE = condition(CUT.trace())
COLUMNS = {"time": "time_s", "force": "force_N", "position": "position_m"}
SPEED = 0.02


def way(scale: float, depth: float = 0.032) -> tuple[np.ndarray, np.ndarray]:
    """Force above its level [N] and height [m] of a way down to a depth in the food and up again."""
    end = (0.02 + depth) / SPEED
    time = np.arange(int((end + 0.6) * RATE)) / RATE
    height = 0.06 - SPEED * np.minimum(time, end) + 0.1 * np.maximum(time - end, 0.0)
    inside = np.where(time <= end, 0.04 - height, 0.0)
    return scale * np.interp(inside, [0.0, 0.022, 0.032], [0.0, 12.0, 9.6]), height


def joined(*ways: tuple[np.ndarray, np.ndarray], position: bool = True) -> Trace:
    """One record of several ways."""
    load, height = (np.concatenate(parts) for parts in zip(*ways, strict=True))
    force = LEVEL + load + 0.03 * np.random.default_rng(5).normal(size=len(load))
    return Trace(np.arange(len(load)) / RATE, force, height if position else None, "made.csv", columns=COLUMNS)


def is_the_cut(done: Conditioned) -> None:
    """Peak and stroke are those of the made-up cut."""
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.01)
    assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, rel=0.01)


@pytest.mark.parametrize("other", [(0.0, 0.032), (0.1, 0.032), (0.02, 0.034)])
@pytest.mark.parametrize("first", [True, False])
def test_a_way_without_load_is_no_cut(other: tuple[float, float], first: bool) -> None:
    """A way in the air, or one that only touches, before the cut or behind it, also a deeper one; it is said."""
    ways = (way(*other), way(1.0)) if first else (way(1.0), way(*other))
    done = condition(joined(*ways))
    is_the_cut(done)
    assert any("the knife comes down under no load elsewhere" in note for note in done.warnings), done.warnings


def test_a_way_under_a_third_of_the_load_is_a_cut() -> None:
    """It is not dropped: the number of cuts is said."""
    with pytest.raises(TraceError, match="the record holds 2 cuts.*--cut 1"):
        condition(joined(way(0.3), way(1.0)))


@pytest.mark.parametrize("first", [True, False])
def test_a_slight_touch_without_a_position(first: bool) -> None:
    """The stroke is not counted from the touch, or to it."""
    ways = (way(1.0, 0.003), way(1.0)) if first else (way(1.0), way(0.05))
    done = condition(joined(*ways, position=False), speed=SPEED)
    is_the_cut(done)
    assert any("the knife is under little load elsewhere" in note for note in done.warnings), done.warnings


@pytest.mark.parametrize("samples", [3, 5, 20])
@pytest.mark.parametrize("level", [-3.0, 3.0])
def test_a_zeroing_that_a_filter_has_spread(samples: int, level: float) -> None:
    """What is before is moved to the level after it, with a position and without."""
    before = level * np.clip((0.7 * RATE - np.arange(640)) / samples, 0.0, 1.0)
    for position in (CUT.height, None):
        done = condition(
            Trace(CUT.time, CUT.force - LEVEL + before, position, "made.csv", columns=COLUMNS), speed=SPEED
        )
        assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.01)
        assert done.onset_s == pytest.approx(TRUE.onset_s, abs=0.01)
        assert any("samples, as where a sensor is zeroed" in note for note in done.warnings), done.warnings


def test_a_level_that_has_fallen_is_said_without_a_position() -> None:
    """The sensor was zeroed too near to contact to be told there; the end of the record shows it."""
    force = np.where(CUT.time < 0.98, CUT.force, CUT.force - LEVEL)
    done = condition(Trace(CUT.time, force, None, "made.csv", columns=COLUMNS), speed=SPEED)
    assert any("the force is 3 N below its level before it" in note for note in done.warnings), done.warnings
    assert done.peak_sd_N > 0.5


@pytest.mark.parametrize(("at", "value"), [(0, 500.0), (slice(0, 3), 77.0), (639, -500.0), (slice(638, 640), 77.0)])
def test_the_ends_of_a_record_may_stand_out(at: int | slice, value: float) -> None:
    """The first or last samples are replaced by the value beside them, and said."""
    force = CUT.force.copy()
    force[at] = value
    for position in (CUT.height, None):
        done = condition(Trace(CUT.time, force, position, "made.csv", columns=COLUMNS), speed=SPEED)
        assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.01)
        assert any("stands out alone from what is beside it" in note for note in done.warnings), done.warnings


def test_a_position_that_jumps_shows_missing_samples() -> None:
    """Times that were counted from the rows do not show them; a larger gap at the peak is refused."""
    for lost, refused in ((np.r_[200:262], False), (np.r_[360:470], True)):
        keep = np.setdiff1d(np.arange(640), lost)
        trace = Trace(CUT.time[: len(keep)], CUT.force[keep], CUT.height[keep], "made.csv", columns=COLUMNS)
        if refused:
            with pytest.raises(TraceError, match="the position jumps from one sample to the next, others are missing"):
                condition(trace)
        else:
            is_the_cut(done := condition(trace))
            assert any("the position jumps from one sample to the next" in note for note in done.warnings)


def test_a_depth_that_is_called_a_position_is_refused_with_the_option() -> None:
    """It rises as the force grows."""
    with pytest.raises(TraceError, match="column position_m: the position does not descend .*it rises.*--depth-col"):
        condition(Trace(CUT.time, CUT.force, 0.06 - CUT.height, "made.csv", columns=COLUMNS))


@pytest.mark.parametrize("pause", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("load", [0.5, 0.8])
@pytest.mark.parametrize("relaxing", [False, True])
def test_a_knife_that_pauses_on_the_food_touched_it_before(pause: float, load: float, relaxing: bool) -> None:
    """Contact is where the force began to rise, not in the approach, however long the knife stands at a small load."""
    touch, end = 1.0 + load / 12.0 * 0.022 / SPEED, 2.6 + pause
    time = np.arange(int((end + 0.6) * RATE)) / RATE
    height = 0.06 - SPEED * np.where(time < touch, time, np.maximum(time - pause, touch))
    height = np.where(time < end, height, 0.008 + 0.1 * (time - end))
    rise = np.interp(np.where(time <= end, 0.04 - height, 0.0), [0.0, 0.022, 0.032], [0.0, 12.0, 9.6])
    if relaxing:
        rise *= np.where((time >= touch) & (time < touch + pause), 0.6 + 0.4 * np.exp(-(time - touch) / 0.2), 1.0)
    force = LEVEL + rise + 0.03 * np.random.default_rng(1).normal(size=len(time))
    done = condition(Trace(time, force, height, "made.csv", columns=COLUMNS))
    assert done.onset_s == pytest.approx(1.0, abs=0.03)
    is_the_cut(done)


@pytest.mark.parametrize("adhesion", [6.0, 15.0])
def test_a_food_that_holds_the_knife_on_its_way_up(adhesion: float) -> None:
    """The force may go further below its level than it went above it; the stroke is that of the way down."""
    time = np.arange(900) / RATE
    height = np.where(time < 2.6, 0.06 - SPEED * time, 0.008 + 0.03 * (time - 2.6))
    load = np.interp(np.where(time <= 2.6, 0.04 - height, 0.0), [0.0, 0.022, 0.032], [0.0, 12.0, 9.6])
    held = np.where(time > 2.6, np.sin(np.pi * np.clip((height - 0.008) / 0.032, 0.0, 1.0)), 0.0)
    force = LEVEL + load - adhesion * held + 0.03 * np.random.default_rng(1).normal(size=900)
    is_the_cut(condition(Trace(time, force, height, "made.csv", columns=COLUMNS)))


def test_a_force_that_falls_far_below_its_level_is_not_through() -> None:
    """A counter that overflows within the cut is no end of the food: the change is said, and the stroke is whole."""
    force = np.where(CUT.force > 10.0, CUT.force - 20.0, CUT.force)
    done = condition(Trace(CUT.time, force, CUT.height, "made.csv", columns=COLUMNS))
    assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, rel=0.02)
    assert any("the force changes by -20 N from one sample to the next" in note for note in done.warnings)


@pytest.mark.parametrize("cutoff", [None, 15.0])
@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_force_that_grows_until_the_knife_turns(cutoff: float | None, power: float) -> None:
    """Without a position the fall to nothing is no part of the cut, at once or behind the sensor's filter."""
    time = np.arange(640) / RATE
    load = np.where(time <= 2.6, 12.0 * np.clip((time - 1.0) / 1.6, 0.0, None) ** power, 0.0)
    for k in range(1, 640 if cutoff else 0):
        load[k] = load[k - 1] + (1.0 - np.exp(-2.0 * np.pi * cutoff / RATE)) * (load[k] - load[k - 1])
    force = LEVEL + load + 0.03 * np.random.default_rng(1).normal(size=640)
    done = condition(Trace(time, force, None, "made.csv", columns=COLUMNS), speed=SPEED)
    assert done.peak_N == pytest.approx(12.0, rel=0.02)
    assert done.stroke_length_m == pytest.approx(0.032, abs=8e-4)
    assert done.curve[-1] > 0.95 * done.peak_N


@pytest.mark.parametrize("duration", [0.02, 0.05, 0.1])
def test_a_knife_that_is_unloaded_slowly(duration: float) -> None:
    """The way in which it turns and the food springs back is no part of the stroke."""
    time = np.arange(640) / RATE
    load = np.interp(time, [1.0, 2.1, 2.6, 2.6 + duration], [0.0, 12.0, 9.6, 0.0])
    force = LEVEL + load + 0.03 * np.random.default_rng(1).normal(size=640)
    done = condition(Trace(time, force, None, "made.csv", columns=COLUMNS), speed=SPEED)
    assert done.stroke_length_m == pytest.approx(0.032, abs=5e-4)


@pytest.mark.parametrize("noise", [0.03, 1e-3])
def test_a_force_that_fades_is_followed_to_its_end(noise: float) -> None:
    """A round food bears the knife less and less; that is no knife that turns."""
    time = np.arange(640) / RATE
    load = 12.0 * np.sqrt(np.clip(1.0 - ((time - 1.8) / 0.8) ** 2, 0.0, None))
    force = LEVEL + load + noise * np.random.default_rng(1).normal(size=640)
    done = condition(Trace(time, force, None, "made.csv", columns=COLUMNS), speed=SPEED)
    assert done.stroke_length_m == pytest.approx(0.032, abs=1e-3)


def test_the_sample_in_which_a_fading_force_ends_is_part_of_the_cut() -> None:
    """In a record of few samples the force before it would be held to the end of the stroke."""
    time = np.arange(96) / 30.0
    load = np.interp(time, [1.0, 1.8, 2.6], [0.0, 12.0, 0.0])
    force = LEVEL + load + 0.03 * np.random.default_rng(1).normal(size=96)
    done = condition(Trace(time, force, None, "made.csv", columns=COLUMNS), speed=SPEED)
    assert done.curve[-1] == pytest.approx(0.0, abs=0.05 * done.peak_N)  # the filter rounds the corner


def noisy(noise: float, depths: tuple[float, ...], loads: tuple[float, ...], seed: int) -> Conditioned:
    """A cut whose force [N] is given at depths [mm], with noise [N]."""
    load = np.interp(1e3 * np.where(CUT.time <= 2.6, 0.04 - CUT.height, 0.0), depths, loads)
    force = LEVEL + load + noise * np.random.default_rng(seed).normal(size=640)
    return condition(Trace(CUT.time, force, CUT.height, "made.csv", columns=COLUMNS))


@pytest.mark.parametrize("seed", range(3))
def test_a_slow_rise_is_no_baseline(seed: int) -> None:
    """Of a hard core under soft flesh, with much noise, contact is where the flesh is met."""
    done = noisy(0.6, (0.0, 12.0, 13.0, 20.0, 21.0, 32.0), (0.0, 5.0, 30.0, 30.0, 6.0, 6.0), seed)
    assert done.onset_s == pytest.approx(1.0, abs=max(0.06, 3.0 * done.onset_sd_s))
    assert done.onset_sd_s < 0.15


def test_a_twentieth_of_the_peak_in_noise_is_no_reason_to_refuse() -> None:
    """The rise from which contact is told is not taken for noise."""
    depths = np.linspace(0.0, 32.0, 33)
    for seed in range(6):
        done = noisy(0.6, tuple(depths), tuple(12.0 * (depths / 32.0) ** 1.5), seed)
        assert done.onset_s == pytest.approx(1.0, abs=3.0 * done.onset_sd_s)
        assert done.peak_N == pytest.approx(12.0, rel=0.05)
