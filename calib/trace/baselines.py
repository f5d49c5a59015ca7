"""Kinds of baseline beside the constant one: a drift that is removed, and the zero of a machine that starts loaded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import TraceError
from calib.trace.contact_onset import (
    MIN_BASELINE,
    SUSTAIN,
    Baseline,
    ContactOnset,
    estimate_baseline,
    first_sustained,
)
from calib.trace.mending import noise_of
from calib.trace.trace import Trace

CONSTANT, LINEAR, ZERO = "constant", "linear", "zero"
BASELINES = (CONSTANT, LINEAR, ZERO)
"""What is subtracted from a force without an air run: the level before contact, the line through it, nothing."""
RISING_PART, RISING_SD = 0.5, 3.0
"""Slope of the force before contact over that after it [-], and over its standard uncertainty, from which on a record
starts under load."""
UNTOLD_PART = 0.2
"""Standard uncertainty of the slope before contact, over the slope after it, from which on it tells nothing [-]."""
CLEAR_M = 1e-3
"""Height above that at contact from which on a knife that was raised is out of the food [m]."""


BEHIND_PART, BEHIND_SD = 0.03, 4.0
"""Part of the peak, and noise standard deviations, by which the level behind a cut differs from that before it to be
told."""
UNTOLD_REACH = 5.0
"""Lengths of what is before contact over which a drift may be carried on without a word."""
LEVEL_BEHIND, REST_SD = 20, 3.0
"""Samples at the end of a record without a position that show a level, and noise standard deviations within which they
do."""
BEHIND_SAMPLES = 5
"""Samples behind the cut from which on they have a level."""

RELEASE_SD = 4.0
"""The force is released when it stays within this many noise standard deviations of the baseline ..."""
RELEASE_FRACTION = 0.05
"""... or below this fraction of the peak, whichever is higher: a baseline drifts during a cut."""
UNLOADING_TIME, UNLOADING_PART, UNLOADING_FROM, UNLOADING_STEEP = 0.1, 0.1, 0.25, 0.01
"""A knife that turns is unloaded within this part of the time from contact to release, in steps of at least this part
of the largest, from at least this part of the peak. The largest step comes within the last part of that time: a load
that fades, as of a round food, falls ever faster."""
UNLOADING_TOP, UNLOADING_HIGH, UNLOADING_SLOPE = 0.9, 0.5, 4.0
"""A knife that is unloaded more slowly turned where the force was last at this part of its largest of that time,
which is at least this part of the peak, and the force changes by so many times less in as many samples of the cut."""


@dataclass(frozen=True)
class Drift:
    """A drift that is removed from a force.

    Attributes:
        slope: The drift [N/s].
        slope_sd: Its standard uncertainty [N/s].
        origin: Time at which nothing is removed [s].
        both: Whether it was measured before contact and after the cut, and not before contact alone.
    """

    slope: float
    slope_sd: float
    origin: float
    both: bool

    def removed(self, time: np.ndarray, force: np.ndarray) -> np.ndarray:
        """The force without it [N], shape (n,)."""
        return force - self.slope * (time - self.origin)

    def sd(self, time: float) -> float:
        """Standard uncertainty that it leaves in a force at a time [N]."""
        return self.slope_sd * abs(time - self.origin)

    def note(self, source: str, end: float) -> str:
        """What was done, in one sentence."""
        where = "before contact and after the cut" if self.both else "before contact, and carried on over the cut"
        return (
            f"{source}: a drift of {self.slope:.3g} +- {self.slope_sd:.2g} N/s was removed, measured {where}; it is "
            f"{self.slope * (end - self.origin):.3g} +- {self.sd(end):.2g} N at the end of the cut"
        )


def drift_of(trace: Trace, force: np.ndarray, contact: ContactOnset) -> Drift:
    """The drift of a force, from its samples before contact and, where the knife was raised again, after the cut.

    Args:
        trace: The cut.
        force: Its force [N], shape (n,).
        contact: Its contact.

    Returns:
        The drift. Between two levels it is certain to their noise; from that before contact alone it is carried on.
    """
    base = estimate_baseline(trace.time, force, contact.baseline.start, contact.baseline.stop)
    whole = estimate_baseline(trace.time, force, 0, contact.baseline.stop)
    if whole.slope_sd < base.slope_sd:
        base = whole
    middle = float(trace.time[base.start : base.stop].mean())
    out = out_of_the_food(trace, contact)
    if len(out) < MIN_BASELINE:
        return Drift(base.slope, base.slope_sd, middle, False)
    after = estimate_baseline(trace.time, force, int(out[0]), int(out[-1]) + 1)
    late = float(trace.time[out].mean())
    slope = (after.level - base.level) / (late - middle)
    own = float(np.hypot(_level_noise(base), _level_noise(after)))
    return Drift(float(slope), own / (late - middle), middle, True)


def check_approach(trace: Trace, force: np.ndarray, contact: ContactOnset) -> list[str]:
    """Refuse a record that starts under load: what would be its baseline rises as the force does after contact.

    Args:
        trace: The cut.
        force: Its force [N], shape (n,).
        contact: Its contact.

    Returns:
        One sentence where too few samples are before contact to tell.

    Raises:
        TraceError: It is so.
    """
    before = int(np.searchsorted(trace.time, contact.onset))
    if before < MIN_BASELINE:
        return []
    base = estimate_baseline(trace.time, force, 0, before)
    top = before + int(np.argmax(force[before:] >= base.level + 0.9 * contact.peak))
    rise = contact.peak / max(float(trace.time[top]) - contact.onset, trace.dt)
    if base.slope > RISING_PART * rise and base.slope > RISING_SD * base.slope_sd:
        raise TraceError(
            f"{trace.source}: the force rises by {base.slope:.3g} N/s from the first sample on, and by {rise:.3g} N/s "
            f"after what looks like contact at {contact.onset:.4g} s: the record starts under load; keep the approach "
            "of the knife in the record, or say --baseline zero if it starts at the trigger of a zeroed machine"
        )
    if base.slope_sd <= UNTOLD_PART * rise:
        return []
    return [
        f"{trace.source}: {before} samples before contact at {contact.onset:.4g} s do not tell whether the force is "
        "level there or the record starts under load, which would make the peak too low"
    ]


def _level_noise(base: Baseline) -> float:
    """Uncertainty of a level by noise alone, without the drift within its window [N]."""
    return base.noise_sd * float(np.sqrt(0.5 * np.pi * base.inflation / max(base.stop - base.start, 1)))


def out_of_the_food(trace: Trace, contact: ContactOnset) -> np.ndarray:
    """Samples at the end of the record in which the knife is above the height of contact.

    Args:
        trace: The cut.
        contact: Its contact.

    Returns:
        Their indices, none without a position.
    """
    if trace.position is None:
        return np.empty(0, dtype=int)
    height = float(np.interp(contact.onset, trace.time, trace.position))
    below = np.flatnonzero(trace.position < height + CLEAR_M)
    last = int(below[-1]) + 1 if len(below) else len(trace.time)
    return np.arange(last, len(trace.time))


def behind_the_cut(trace: Trace, tared: np.ndarray, contact: ContactOnset) -> np.ndarray:
    """Samples at the end of the record that show the level behind the cut.

    Without a position they are those of a force that has come to rest below its level before the cut: no food pulls a
    knife down for as long.

    Args:
        trace: The cut.
        tared: Its force above the baseline [N], shape (n,).
        contact: Its contact.

    Returns:
        Their indices, shape (k,) [-]; none where nothing tells them.
    """
    if trace.position is not None:
        return out_of_the_food(trace, contact)
    count = max(LEVEL_BEHIND, len(tared) // 20)
    last, noise = tared[-count:], contact.baseline.noise_sd
    level = float(np.median(last))
    still = float(np.std(last)) <= REST_SD * noise
    return np.arange(len(tared) - count, len(tared)) if still and level < 0.0 else np.empty(0, dtype=int)


def release_of(time: np.ndarray, tared: np.ndarray, contact: ContactOnset) -> tuple[float, bool, bool]:
    """Time from which on the food no longer bears the knife, whether the record has it, and whether the knife turned.

    The force is then back at the baseline for good. Where it got there at once, the knife turned when it began to fall.

    Args:
        time: Time [s], shape (n,).
        tared: Force above the baseline [N], shape (n,).
        contact: Its contact.

    Returns:
        The time of the first such sample [s]; the end of the record, and False, where the force is not released;
        whether it fell at once, which is no part of the cut.
    """
    noise = contact.baseline.noise_sd
    limit = max(RELEASE_SD * noise, RELEASE_FRACTION * contact.peak)
    after_last = first_sustained((tared > limit)[::-1])
    last = len(tared) - 1 - (after_last or 0)
    if last >= len(tared) - SUSTAIN:
        return float(time[-1]), False, False
    release = float(time[last + 1])
    falls = tared[:-1] - tared[1:]
    first = int(np.searchsorted(time, release - UNLOADING_TIME * (release - contact.onset)))
    at = first + int(np.argmax(falls[first : last + 2]))
    least = max(UNLOADING_PART * float(falls[at]), 2.0 * RELEASE_SD * noise)
    gentle = np.flatnonzero(falls[first:at] < least)
    if len(gentle):
        turn = first + int(gentle[-1]) + 1
        at_once = at - turn <= max(2.0, UNLOADING_STEEP * (last + 1 - np.searchsorted(time, contact.onset)))
        if at_once and falls[at] >= least and tared[turn] > UNLOADING_FROM * contact.peak:
            return float(time[turn + 1]), True, True
    end = _steep_fall(tared, (int(np.searchsorted(time, contact.onset)), first, last), contact.peak)
    return float(time[end]), True, end <= last


def _steep_fall(tared: np.ndarray, places: tuple[int, int, int], peak: float) -> int:
    """Index of the sample from which on a force falls to the baseline far more steeply than it changed before.

    Args:
        tared: Force above the baseline [N], shape (n,).
        places: Indices of contact, of the first sample in which the fall may begin, and of the last loaded one.
        peak: Largest force [N].

    Returns:
        The first sample of the fall; the one behind the last loaded sample where it is not so steep.
    """
    begin, first, last = places
    near = tared[first : last + 1]
    turn = first + int(np.flatnonzero(near >= UNLOADING_TOP * near.max())[-1])
    steps = last + 1 - turn
    before = tared[begin : turn + 1]
    if turn == first or len(before) <= steps or tared[turn] < UNLOADING_HIGH * peak:
        return last + 1
    usual = float(np.max(np.abs(before[steps:] - before[:-steps])))
    return turn + 1 if tared[turn] - tared[last + 1] > UNLOADING_SLOPE * usual else last + 1


def trigger_contact(trace: Trace, force: np.ndarray) -> ContactOnset:
    """Contact of a record that starts at its trigger, with the machine's own zero for a baseline.

    Args:
        trace: The cut.
        force: Its force [N], shape (n,).

    Returns:
        Contact at the first sample; the force there is the uncertainty of the zero.

    Raises:
        TraceError: The first force is no small part of the largest, so that the machine was not zeroed.
    """
    top = float(np.max(np.convolve(force, np.full(3, 1 / 3), mode="same")))
    first = float(np.median(force[:3]))
    if not top > 0.0 or abs(first) > 0.2 * top:
        raise TraceError(
            f"{trace.source}, {trace.where(0)}: the force begins at {first:.3g} N, of {top:.3g} N at most: the machine "
            "was not zeroed, or the record does not start at the trigger (--baseline zero); keep the approach in the "
            "record"
        )
    noise = noise_of(force[: max(MIN_BASELINE, len(force) // 4)])
    base = Baseline(0.0, float(np.hypot(abs(first), noise)), noise, 1.0, 0.0, 0.0, 0, MIN_BASELINE)
    return ContactOnset(base, float(trace.time[0]), trace.dt, top)


def untold_drift(trace: Trace, force: np.ndarray, contact: ContactOnset, out: np.ndarray, end: float) -> list[str]:
    """Whether neither the samples before contact nor those behind the cut tell of a drift that would matter.

    Args:
        trace: The cut.
        force: Its force [N], shape (n,).
        contact: Its contact.
        out: Indices of the samples in which the knife is out of the food, shape (k,) [-].
        end: Time at the end of the cut [s].

    Returns:
        One sentence, or none.
    """
    before = int(np.searchsorted(trace.time, contact.onset))
    if len(out) >= BEHIND_SAMPLES or before < MIN_BASELINE:
        return []
    base = estimate_baseline(trace.time, force, 0, before)
    long = end - contact.onset
    most = (abs(base.slope) + 2.0 * base.slope_sd) * long
    if long < UNTOLD_REACH * float(trace.time[before - 1] - trace.time[0]) or most <= BEHIND_PART * contact.peak:
        return []
    return [
        f"{trace.source}: a drift of up to {most:.2g} N over the cut cannot be told from the {before} samples before "
        f"contact ({most / contact.peak:.1%} of the peak); record a longer approach, or the way back out of the food"
    ]


def level_behind(
    trace: Trace, tared: np.ndarray, out: np.ndarray, peak: float, noise: float
) -> tuple[float, list[str]]:
    """Whether the force is back at its level when the knife is out of the food.

    Args:
        trace: The cut.
        tared: Its force above the baseline [N], shape (n,).
        out: Indices of the samples in which the knife is out of the food, shape (k,) [-].
        peak: Largest force [N].
        noise: Noise of a sample [N].

    Returns:
        The standard uncertainty that a level which has moved leaves in the peak [N], and one sentence, or none.
    """
    if len(out) < BEHIND_SAMPLES:
        return 0.0, []
    behind = float(np.median(tared[out[len(out) // 2 :]]))
    if abs(behind) <= max(BEHIND_PART * peak, BEHIND_SD * noise):
        return 0.0, []
    side = "above" if behind > 0.0 else "below"
    return abs(behind) / 12**0.5, [
        f"{trace.source}: behind the cut, from {trace.where(int(out[0]))} on, the force is {abs(behind):.3g} N {side} "
        f"its level before it ({abs(behind) / peak:.1%} of the peak): the sensor has drifted or moved, or food sticks "
        "to the blade; the peak may be off by as much"
    ]
