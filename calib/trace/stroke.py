"""How far the edge is in the food at each sample: from the position, the knife's speed or the food's height."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.trace.baselines import release_of
from calib.trace.contact_onset import ContactOnset
from calib.trace.filters import N_STROKE, resample, smooth
from calib.trace.trace import Trace

DWELL_M = 0.1e-3
"""Height above the lowest position so far [m] at which the knife still counts as there: a robot arm's
repeatability. The stroke is over where it comes that near to the lowest of all; higher, it is retracting."""
BACKING_UP_M, BACKING_UP_SD = 1e-3, 5.0
"""A knife goes up within its stroke if it does so by more than this, and than so many standard deviations of the change
of its pace from sample to sample."""
STROKE_RANGE_M = (1e-3, 0.5)
"""Strokes outside are taken for a unit mix-up [m]: less than a grape's skin, more than any kitchen
knife's way."""
STROKE_EXCESS = 0.1
"""Part of the specimen's height by which a stroke may exceed it: 10 N bend an arm of 3 kN/m by 3 mm, a tenth of a fruit
of 3 cm."""
BOARD_PART = 0.08
"""Last part of a stroke in which an edge that touches the board raises the force [-]."""
BOARD_SLOPE, BOARD_RISE = 3.0, 0.04
"""Slope in that part over the usual one [-], and rise in it over the peak [-], from which on it may be the board."""
BOARD_JUMP = 6.0
"""Slope in that part over the usual one from which on it is the board [-]: the force of an edge on a board rises by
55 N/mm (arm of a Franka, without food), those of seven cuts of apple, potato and cucumber by at most 1.2 times their
own usual slope there."""
THROUGH_LEVEL, THROUGH_FALL = 0.1, 0.5
"""Part of the peak below which the force stays once the edge is through [-], and above which it was shortly before."""
THROUGH_FALL_M, THROUGH_REST_M = 3e-3, 1e-3
"""Way over which the force falls from the one to the other at most, and way of the knife behind it at least [m]: a
force that falls with the chord of a round food, or where the stroke ends, does not tell where the board is."""
CLOCK_STEP = 1e-9
"""Least step of the clock, part of its whole time [-], so that it rises."""
MAX_DESCENT_FRACTION = 0.5
"""Part of the position's range that must lie before its lowest point for a record to be a downward stroke."""


@dataclass(frozen=True)
class StrokeAxis:
    """The stroke of a record.

    Attributes:
        stroke: Way of the edge after contact at each sample, negative before contact [m], shape (n,).
        end: Stroke at the end of the cut [m].
        source: Where it comes from: ``position``, ``speed`` or ``height``.
        warnings: What a reader should know of it, one sentence each.
        at_board: Whether it ends where the force says that the edge is on the board.
        turned: Whether it ends with the first sample behind a knife that turned under load.
    """

    stroke: np.ndarray
    end: float
    source: str
    warnings: tuple[str, ...] = ()
    at_board: bool = False
    turned: bool = False


def end_of_descent(trace: Trace) -> int:
    """Index of the sample that ends the descent: the first within ``DWELL_M`` of the lowest position.

    It is the last sample where the trace has no position, or where the lowest position is not at the end of a descent.
    """
    if trace.position is None:
        return len(trace.time) - 1
    lowest = int(np.argmin(trace.position))
    descent = float(np.max(trace.position[: lowest + 1]) - trace.position[lowest])
    if descent < MAX_DESCENT_FRACTION * np.ptp(trace.position):
        return len(trace.time) - 1
    top = int(np.argmax(trace.position[: lowest + 1]))
    return top + int(np.argmax(trace.position[top : lowest + 1] <= trace.position[lowest] + DWELL_M))


def stroke_axis(
    trace: Trace, tared: np.ndarray, contact: ContactOnset, *, last: int, speed: float | None, height: float | None
) -> StrokeAxis:
    """The stroke of every sample: from the position where there is one, else from the speed, else from the height.

    Args:
        trace: The cut.
        tared: Its force above the baseline [N], shape (n,).
        contact: Where it touches the food.
        last: Index of the sample that ends the descent, see :func:`end_of_descent`.
        speed: Knife speed [m/s], where it is known.
        height: Height of the food [m], where it is known; contact to release is taken for it when nothing else is
            known.

    Returns:
        The stroke, and where it comes from.

    Raises:
        TraceError: The position does not descend after contact, or the stroke is outside ``STROKE_RANGE_M``.
    """
    if trace.position is not None:
        axis = _from_position(trace, trace.position, contact, last, speed)
    else:
        axis = _at_constant_speed(trace, tared, contact, speed, height)
    low, high = STROKE_RANGE_M
    if not low <= axis.end <= high:
        raise TraceError(
            f"{trace.source}: the stroke after contact is {axis.end:.3g} m (from {axis.source}), outside {low:g} to "
            f"{high:g} m; check millimetres against metres in the position, speed or height"
        )
    return axis


def _from_position(
    trace: Trace, position: np.ndarray, contact: ContactOnset, last: int, speed: float | None
) -> StrokeAxis:
    """The way down from the height at contact."""
    stroke = float(np.interp(contact.onset, trace.time, position)) - position
    end = float(stroke[last])
    if not end > 0.0:
        raise TraceError(
            f"{trace.source}, column {trace.columns.get('position')}: the position does not descend "
            f"after contact at {contact.onset:.4g} s (it changes by {-end:.3g} m); it must be a height, "
            "or a depth (--depth-col); name another with --position-col, or none and give --speed"
        )
    unused = () if speed is None else ("the speed is not used: the stroke comes from the position column",)
    return StrokeAxis(stroke, end, "position", (*unused, *_backing_up(stroke[(stroke >= 0.0).argmax() : last + 1])))


def _backing_up(stroke: np.ndarray) -> tuple[str, ...]:
    """A sentence on a knife that goes up within its way down (n,) [m], further than its position's own noise."""
    back = float(np.max(np.maximum.accumulate(stroke) - stroke, initial=0.0))
    if back <= max(BACKING_UP_M, BACKING_UP_SD * float(np.std(np.diff(stroke, n=2))) if len(stroke) > 2 else 0.0):
        return ()
    return (
        f"the knife goes up by {1e3 * back:.1f} mm within the stroke: of the force, that is used with which the edge "
        "came to each depth first",
    )


def _at_constant_speed(
    trace: Trace, tared: np.ndarray, contact: ContactOnset, speed: float | None, height: float | None
) -> StrokeAxis:
    """The time since contact at a known speed, or at that which goes through the food from contact to release."""
    release, released, turned = release_of(trace.time, tared, contact)
    warnings: tuple[str, ...] = ()
    if speed is not None:
        rate, source = speed, "speed"
    else:
        assert height is not None
        rate, source = height / (release - contact.onset), "height"
        until = "release" if released else "the end of the record (the force is not released in it)"
        warnings = (
            f"no position and no speed: contact to {until} was taken for the food's height of "
            f"{1e3 * height:.3g} mm at constant speed ({1e3 * rate:.3g} mm/s); a fitted stiffness or R "
            "inherits that guess",
        )
    stroke, end = rate * (trace.time - contact.onset), rate * (release - contact.onset)
    return StrokeAxis(stroke, end, source, warnings, turned=turned)


def stroke_in_food(
    trace: Trace, tared: np.ndarray, axis: StrokeAxis, onset: float, *, board: float | None, board_z: float | None
) -> StrokeAxis:
    """The stroke, ended where the edge is at the board: where that is said, or where the force says so.

    Args:
        trace: The cut.
        tared: Its force above the baseline [N], shape (n,).
        axis: The stroke of every sample.
        onset: Time of contact [s].
        board: Stroke at which the edge is at the board [m], the specimen's height where that was measured.
        board_z: Reading of the knife's height, or of its depth, with the edge on the board [m].

    Returns:
        The same, or one that ends earlier, with a warning.

    Raises:
        TraceError: A reading that the knife has not, or a stroke that goes far beyond the board.
    """
    if board_z is not None:
        board = board_stroke(trace, onset, board_z)
    if board is not None:
        return ending_at_board(axis, board, trace.source)
    if axis.source != "position":
        return axis
    touch = edge_on_board(axis.stroke, tared, axis.end)
    through = edge_through(axis.stroke, tared, axis.end if touch is None else touch)
    if through is None:
        return axis if touch is None else _on_board(axis, touch)
    said = (
        f"the force falls to little at {1e3 * through:.1f} mm of the stroke of {1e3 * axis.end:.1f} mm and stays so: "
        "the edge is through, and that stroke is taken for the specimen's height; what is later is the board or the "
        "arm's ringing and left out; say --height or --board-z if the specimen ends elsewhere"
    )
    return replace(axis, end=through, warnings=(*axis.warnings, said))


def board_stroke(trace: Trace, onset: float, board_z: float) -> float:
    """Stroke at which the edge is at the board [m].

    Args:
        trace: The cut.
        onset: Time of contact [s].
        board_z: Reading of the knife's height, or of its depth, with the edge on the board [m].

    Returns:
        The height of the board below contact, the specimen's height.

    Raises:
        TraceError: There is no height, or the board would not be below contact.
    """
    if trace.position is None:
        raise TraceError(f"{trace.source}: --board-z is a reading of the knife's height, but the trace has none")
    contact = float(np.interp(onset, trace.time, trace.position))
    low, high = STROKE_RANGE_M
    below = contact - (board_z if contact > 0 else -abs(board_z))  # a depth is kept as a height below 0
    if not low <= below <= high:
        raise TraceError(
            f"{trace.source}: --board-z {board_z:g} m is no height below contact, which is at {contact:.4g} m of "
            f"column {trace.columns.get('position')}; give what that column reads with the edge on the board"
        )
    return below


def clock_of(time: np.ndarray, stroke: np.ndarray, grid: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Time after contact at which the edge comes to each point of the stroke first.

    Args:
        time: Of the samples [s], shape (n,).
        stroke: Way of the edge after contact at each [m], shape (n,).
        grid: Points of the stroke [m], shape (k,).
        ends: Time of contact, and of the end of the descent [s].

    Returns:
        The times [s], shape (k,), rising.
    """
    onset, end = ends
    inside = (time > onset) & (time <= end)
    deepest = np.maximum.accumulate(np.concatenate([[0.0], stroke[inside]]))
    after = np.concatenate([[0.0], time[inside] - onset])
    first = np.concatenate([[True], np.diff(deepest) > 0.0])
    out: np.ndarray = np.interp(grid, deepest[first], after[first])
    return out + np.arange(len(out)) * CLOCK_STEP * max(float(out[-1]), CLOCK_STEP)


def edge_through(stroke: np.ndarray, tared: np.ndarray, end: float) -> float | None:
    """Stroke at which the edge comes through the food: there a force that was large falls to little, and stays so.

    Args:
        stroke: Way of the edge after contact [m], shape (n,).
        tared: Force above the baseline [N], shape (n,).
        end: Stroke at the end of the descent [m].

    Returns:
        The stroke [m], None where there is no such fall.
    """
    inside = (stroke >= 0.0) & (np.maximum.accumulate(stroke) <= end)
    deepest = np.maximum.accumulate(stroke[inside])
    if deepest.size < 2 or deepest[-1] < THROUGH_FALL_M + THROUGH_REST_M:
        return None
    grid = np.linspace(deepest[0], deepest[-1], N_STROKE)
    force = smooth(grid, resample(deepest, tared[inside], grid))
    high = np.flatnonzero(force > THROUGH_LEVEL * force.max())
    last = int(high[-1])
    before = float(np.interp(grid[last] - THROUGH_FALL_M, grid, force))
    rest = force[last + 1 :]
    if grid[-1] - grid[last] < THROUGH_REST_M or before < THROUGH_FALL * force.max():
        return None
    if np.median(rest) < -THROUGH_LEVEL * force.max():  # an overflow, or a level that has moved
        return None
    return float(grid[last + 1])


def edge_on_board(stroke: np.ndarray, tared: np.ndarray, end: float) -> float | None:
    """Stroke at which the edge comes to the board: from there to the end of the descent the force shoots up.

    Args:
        stroke: Way of the edge after contact [m], shape (n,).
        tared: Force above the baseline [N], shape (n,).
        end: Stroke at the end of the descent [m].

    Returns:
        The stroke [m], None where the force does not rise as on a board.
    """
    inside = (stroke >= 0.0) & (np.maximum.accumulate(stroke) <= end)
    deepest = np.maximum.accumulate(stroke[inside])
    if deepest.size < 2 or not deepest[-1] > deepest[0]:
        return None
    grid = np.linspace(deepest[0], deepest[-1], N_STROKE)
    force = smooth(grid, resample(deepest, tared[inside], grid))
    rise = _end_rise(grid, force)
    if rise.steep <= BOARD_JUMP or rise.height <= BOARD_RISE * float(force[: rise.last].max()):
        return None
    return rise.start


@dataclass(frozen=True)
class _Rise:
    """How a force rises at the end of a stroke: where it begins to [m] (its steepest tangent meets the level before
    it), by how much [N], its slope over the usual one [-], and where the part begins in which it is looked for."""

    start: float
    height: float
    steep: float
    last: int


def _end_rise(stroke: np.ndarray, curve: np.ndarray) -> _Rise:
    """The rise of a curve (n,) over its stroke (n,) in the last part of it."""
    last = int((1.0 - BOARD_PART) * len(curve))
    slopes = np.gradient(curve, stroke)
    usual = max(float(np.percentile(np.abs(slopes[:last]), 90)), 1e-12)
    steepest = last + int(np.argmax(slopes[last:]))
    gentle = np.flatnonzero(slopes[:steepest] <= BOARD_SLOPE * usual)
    first = int(gentle[-1]) if len(gentle) else 0
    slope = max(float(slopes[steepest]), 1e-12)
    start = float(stroke[steepest] - (curve[steepest] - curve[first]) / slope)
    start = min(max(start, float(stroke[first])), float(stroke[steepest]))
    return _Rise(start, float(curve[-1] - curve[first]), float(slopes[steepest]) / usual, last)


def _on_board(axis: StrokeAxis, touch: float) -> StrokeAxis:
    """The stroke, ended where the edge comes to the board."""
    said = (
        f"the force shoots up at {1e3 * touch:.1f} mm of the stroke of {1e3 * axis.end:.1f} mm, as on a board: the "
        "edge is on it, that stroke is taken for the specimen's height, and what is later is left out; say --height or "
        "--board-z if the specimen ends elsewhere"
    )
    return replace(axis, end=touch, warnings=(*axis.warnings, said), at_board=True)


def ending_at_board(axis: StrokeAxis, board: float, source: str) -> StrokeAxis:
    """The stroke, ended where the edge is at the board: what is recorded beyond is no cut.

    Args:
        axis: The stroke.
        board: Stroke at which the edge is at the board [m].
        source: Name of the record for messages.

    Returns:
        The same, or one that ends at the board, with a warning.

    Raises:
        TraceError: The stroke goes beyond the board by more than ``STROKE_EXCESS``.
    """
    if axis.end <= board * (1 + 1e-9):
        return axis
    if axis.end > (1 + STROKE_EXCESS) * board:
        raise TraceError(
            f"{source}: the stroke after contact is {1e3 * axis.end:.1f} mm (from {axis.source}), but the specimen is "
            f"{1e3 * board:.1f} mm high; check the height, or the position or speed, or say with --t-end where the cut "
            "ends"
        )
    said = (
        f"the stroke of {1e3 * axis.end:.1f} mm goes beyond the specimen's height of {1e3 * board:.1f} mm; what is "
        "below the board's top is left out"
    )
    return replace(axis, end=board, warnings=(*axis.warnings, said))


def board_warnings(source: str, stroke: np.ndarray, curve: np.ndarray) -> list[str]:
    """Whether the force rises at the end of the stroke as no food makes it rise, one sentence or none.

    Args:
        source: Name of the record for messages.
        stroke: Stroke [m], shape (n,).
        curve: Force on it [N], shape (n,).

    Returns:
        The sentence, or nothing.
    """
    last = int((1.0 - BOARD_PART) * len(curve))
    low = last + int(np.argmin(curve[last:]))
    peak, rise = float(curve.max()), float(curve[-1] - curve[low])
    slopes = np.gradient(curve, stroke)
    usual = max(float(np.percentile(np.abs(slopes[:last]), 90)), 1e-12)
    steep = float(slopes[last:].max()) / usual
    if rise <= BOARD_RISE * peak or steep <= BOARD_SLOPE:
        return []
    return [
        f"{source}: the force rises by {rise:.3g} N over the last {1e3 * (stroke[-1] - stroke[low]):.2g} mm of the "
        f"stroke, up to {steep:.0f} times as steeply as before: the edge may be on the board; end the cut before it "
        "with --t-end, or give --height or --board-z"
    ]
