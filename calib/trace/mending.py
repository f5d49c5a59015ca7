"""Faults of a record that are repaired before it is looked at: values that stand out alone, and a sensor that is zeroed
while it runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.io.wording import LONG, brief
from calib.trace.contact_onset import MAD_TO_SD
from calib.trace.trace import Trace

SPIKE_SD = 12.0
"""Noise standard deviations by which a value stands out from those on both sides to be a spike."""
SPIKE_PART = 0.1
"""Part of the force's usual range by which it does."""
SPIKE_SAMPLES = 3
"""Most samples of a spike."""
MOST_SPIKES = 0.01
"""Part of the samples that may be spikes; a record with more of them has another fault."""
SIDE = 3
"""Samples on each side with which a spike is compared."""
STEP_SIDE = 12
"""Samples on each side of a step of the level, which are level themselves."""
SUDDEN_PART = 0.7
"""Part of a step of the level that one sample makes, at least."""
SLOW_STEP_S = 0.15
"""Time within which a step of the level is over that a filter has spread [s]: low-passes of 5 Hz and more."""
STEP_SD = 8.0
"""Noise standard deviations by which the level steps."""
STEP_PART = 0.02
"""Part of the force's usual range by which it does."""
FEWEST_BEHIND = 5
"""Samples behind the cut from which on they have a level."""
STOPPED = 4
"""Samples for which a position stands that did not reach the file, at least."""
NEAR_ZERO = 0.05
"""Part of a step within which the level behind it is zero: the sensor was zeroed there."""


@dataclass(frozen=True)
class Mended:
    """A record whose faults are repaired.

    Attributes:
        trace: The record.
        level_sd: Standard uncertainty of the force's level that the repair leaves [N].
        notes: What was done, with row and time, one sentence each.
    """

    trace: Trace
    level_sd: float = 0.0
    notes: tuple[str, ...] = ()


def mended(trace: Trace) -> Mended:
    """Repair spikes and steps of the level before contact.

    A spike is replaced by the line between its neighbours. A step of the level is where the force, level on both sides,
    goes to zero, or falls, from one sample to the next: the sensor was zeroed. What is before it is moved to the level
    behind it.

    Args:
        trace: The record.

    Returns:
        The repaired record, and what was done.

    Raises:
        TraceError: So many values stand out that nothing is left of the record.
    """
    force, spikes = without_spikes(trace, trace.force, "force")
    position = trace.position
    lost: list[str] = []
    if position is not None:
        position, lost = without_spikes(trace, position, "position")
        position, stood = _without_stops(trace, position)
        lost = [*lost, *stood]
    force, level_sd, steps = _without_steps(replace(trace, force=force))
    if not spikes and not steps and not lost:
        return Mended(trace)
    return Mended(replace(trace, force=force, position=position), level_sd, (*spikes, *lost, *steps))


def noise_of(force: np.ndarray) -> float:
    """Standard deviation of independent noise from the differences of neighbours [N], whatever the trend."""
    steps = np.diff(force)
    return MAD_TO_SD * float(np.median(np.abs(steps - np.median(steps)))) / float(np.sqrt(2.0))


def usual_range(force: np.ndarray) -> float:
    """Range of the force without its rarest values [N]."""
    low, high = np.percentile(force, (1.0, 99.0))
    return float(high - low)


def _place(trace: Trace, i: int, role: str = "force") -> str:
    return f"{trace.source}, {trace.where(i)}, column {brief(trace.columns.get(role, role), LONG)}"


def without_spikes(trace: Trace, force: np.ndarray, role: str) -> tuple[np.ndarray, list[str]]:
    """The force, or the position, without values that stand out alone.

    Args:
        trace: The record.
        force: Its force [N], or position [m], shape (n,).
        role: ``force`` or ``position``.

    Returns:
        The same with those values replaced, shape (n,), and what was done, one sentence each.

    Raises:
        TraceError: So many values stand out that nothing is left of the record.
    """
    n, unit = len(force), {"force": "N", "position": "m"}[role]
    limit = max(SPIKE_SD * noise_of(force), SPIKE_PART * usual_range(force), 1e-9)
    out, at_ends = _with_sound_ends(force, limit)
    count = int(np.count_nonzero(out != force))
    notes = [
        f"{_place(trace, i, role)}: {force[i]:.4g} {unit} stands out alone from what is beside it; it was replaced by "
        "the value there"
        for i in at_ends
    ]
    i = 1
    while i < n - 1:
        length = next((k for k in range(1, SPIKE_SAMPLES + 1) if _stands_out(out, i, k, limit)), 0)
        if not length:
            i += 1
            continue
        value = force[i : i + length][int(np.argmax(np.abs(force[i : i + length] - out[i - 1])))]
        after = min(i + length, n - 1)
        out[i : i + length] = np.interp(trace.time[i : i + length], trace.time[[i - 1, after]], out[[i - 1, after]])
        count += length
        if len(notes) < 3:
            many = f", and {length - 1} after it," if length > 1 else ""
            notes.append(
                f"{_place(trace, i, role)}: {value:.4g} {unit}{many} stands out alone from its neighbours; it was "
                "replaced by the line between them"
            )
        i += length
    if count > max(SPIKE_SAMPLES, MOST_SPIKES * n):
        if count <= 0.1 * n:
            raise TraceError(
                f"{notes[0].partition(';')[0]}, and so do {count - 1} other samples; repair the sensor or its "
                "cable, or remove those rows"
            )
        return force, []
    if count > len(notes) > 2:
        notes[-1] += f" ({count} samples in all)"
    return out, notes


def _with_sound_ends(force: np.ndarray, limit: float) -> tuple[np.ndarray, list[int]]:
    """The values with those at the first and the last samples replaced that stand out from the next, and which.

    A sensor that starts, or a last row that is not whole, writes such values.
    """
    out, found = force.copy(), []
    for values, outer in ((out, 0), (out[::-1], len(out) - 1)):  # the second is the record from its end
        for length in range(1, SPIKE_SAMPLES + 1):
            beside = values[length : length + 2 * SIDE]
            if len(beside) < 2 * SIDE or abs(values[length - 1] - values[length]) <= limit:
                continue
            off = np.abs(values[:length] - float(np.median(beside)))
            if np.all(off > max(limit, 3.0 * float(np.ptp(beside)))):
                values[:length] = values[length]
                found.append(outer)
                break
    return out, found


def _without_stops(trace: Trace, position: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The position without stretches in which it stands and then jumps to where the knife has gone meanwhile."""
    steps = np.abs(np.diff(position))
    moving = steps[steps > 0.02 * np.percentile(steps, 95)]
    if not len(moving):
        return position, []
    usual = float(np.median(moving))
    still = np.r_[False, steps == 0.0, False]
    edges = np.flatnonzero(np.diff(still.astype(int)))
    out, notes = position.copy(), []
    for first, last in zip(edges[::2], edges[1::2], strict=True):  # the position is one value from first to last
        if last + 1 >= len(position) or last - first < STOPPED:
            continue
        speed = float(np.median(steps[max(first - STEP_SIDE, 0) : first])) if first else 0.0
        jump = float(steps[last])
        if jump < max(3.0 * usual, 0.5 * speed * (last + 1 - first)) or jump < STOPPED * usual:
            continue
        ends = [first, last + 1]
        out[first : last + 2] = np.interp(trace.time[first : last + 2], trace.time[ends], position[ends])
        notes.append(
            f"{_place(trace, int(first), 'position')}: the position stands until {trace.where(int(last))} and then "
            f"jumps by {1e3 * jump:.3g} mm; a line bridges it"
        )
    return out, [*notes[:3], *([f"{len(notes) - 3} more places like these"] if len(notes) > 3 else [])]


def _stands_out(force: np.ndarray, i: int, length: int, limit: float) -> bool:
    """Whether some samples on end are far from those on both sides, which are near each other."""
    if abs(force[i] - force[i - 1]) <= limit or i + length >= len(force):
        return False
    left, right = force[max(i - SIDE, 0) : i], force[i + length : i + length + SIDE]
    before, after = float(np.median(left)), float(np.median(right))
    inside = force[i : i + length]
    away = np.minimum(np.abs(inside - before), np.abs(inside - after))
    same = np.sign(inside - before) == np.sign(inside - after)
    calm = max(np.ptp(left), np.ptp(right))
    needed = max(limit, 3.0 * abs(before - after), 3.0 * calm)
    return bool(same.all() and np.all(away > needed))


def _without_steps(trace: Trace) -> tuple[np.ndarray, float, list[str]]:
    """The force with one level before the load, the uncertainty of that level, and what was done."""
    force, side = trace.force, STEP_SIDE
    noise = noise_of(force)
    limit = max(STEP_SD * noise, STEP_PART * usual_range(force), 1e-9)
    out, variance = force.copy(), 0.0
    notes: list[str] = []
    done: list[tuple[int, int]] = []
    for i, width in _changes(force, limit, int(min(SLOW_STEP_S / trace.dt, len(force) / 8))):
        j = i + width  # the new level begins
        if not side <= i <= j <= len(force) - side or any(i < b + side and j > a - side for a, b in done):
            continue
        left, right = force[i - side : i], force[j : j + side]
        step = float(np.median(right) - np.median(left))
        behind = _level_behind(trace, j)
        same = behind is not None and abs(behind - float(np.median(right))) <= 0.2 * abs(step)
        if not _is_step(out, (i, j), (step, same), limit, noise):
            continue
        out[:i] += step
        out[i:j] = np.median(right)
        variance += np.pi / side * max(noise, 1e-12) ** 2
        within = "one sample" if not width else f"{width + 1} samples"
        notes.append(
            f"{_place(trace, i)}: the level goes from {np.median(left):.4g} to {np.median(right):.4g} N in {within}, "
            "as where a sensor is zeroed; what is before was moved to the level after it"
        )
        done.append((i, j))
    if len(notes) > 3:
        return force, 0.0, []
    return out, float(np.sqrt(variance)), notes


def _changes(force: np.ndarray, limit: float, widest: int) -> list[tuple[int, int]]:
    """Where the level may step: the first sample of a change, and how many samples it takes beyond one, fewest first.

    A change within one sample is most of the step. One that a filter has spread is between two levels: the force
    hardly varies on either side of it.
    """
    sharp = [(int(i) + 1, 0) for i in np.flatnonzero(np.abs(np.diff(force)) >= SUDDEN_PART * limit)]
    side, n = STEP_SIDE, len(force)
    if n < 3 * side:
        return sharp
    windows = np.lib.stride_tricks.sliding_window_view(force, side)
    level, spread = windows.mean(axis=1), windows.std(axis=1)
    slow: list[tuple[int, int]] = []
    width = 2
    while width <= widest:
        i = np.arange(side, n - side - width)
        change = np.abs(level[i + width] - level[i - side])
        calm = np.maximum(spread[i + width], spread[i - side]) <= 0.02 * change
        slow += [(int(k), width) for k in i[calm & (change > limit)]]
        width += max(1, width // 4)
    return [*sharp, *slow]


def _level_behind(trace: Trace, i: int) -> float | None:
    """The force at the end of the record while the knife is above where it was at a sample [N], None if it is not."""
    if trace.position is None:
        return None
    below = np.flatnonzero(trace.position < trace.position[i])
    out = trace.force[int(below[-1]) + 1 :] if len(below) else trace.force[:0]
    return float(np.median(out)) if FEWEST_BEHIND <= len(out) < len(trace.force) - i else None


def _is_step(force: np.ndarray, ends: tuple[int, int], change: tuple[float, bool], limit: float, noise: float) -> bool:
    """Whether the sensor was zeroed from one sample to another, and not the food touched.

    The force is level before, from the record's start or the step before, and after. Then it is at zero, or it has
    fallen, or, in one sample, its new level is that behind the cut; and it leaves its new level by more than the step
    later on.
    """
    side, (i, j) = STEP_SIDE, ends
    step, same = change
    sharp = float(np.abs(np.diff(force[i - 1 : j + 1])).max()) >= SUDDEN_PART * abs(step)
    if abs(step) <= limit or sharp != (i == j):
        return False
    left, right = force[i - side : i], force[j : j + side]
    flat = max(3.0 * noise, 0.003 * abs(step))
    if np.std(left) > flat or np.std(right) > flat or abs(np.median(right[:4]) - np.median(right[-4:])) > 2.0 * flat:
        return False
    level = float(np.median(right))
    if step < 0.0 and np.ptp(right) == 0.0 < np.ptp(left):
        return False  # a sensor that has fallen out, not one that was zeroed
    zeroed = abs(level) <= max(4.0 * noise, NEAR_ZERO * abs(step)) and abs(np.median(left)) > 2.0 * abs(level)
    before = force[:i]
    loaded = np.percentile(before, 98) - np.percentile(before, 2) > 0.5 * abs(step) + 8.0 * noise
    rises = float(np.percentile(force[j:], 98)) - level
    return bool((zeroed or step < 0.0 or (same and sharp)) and not loaded and rises > max(limit, 10.0 * noise))
