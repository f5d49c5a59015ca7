"""Whether an episode was a success: the four published criteria, stricter ones, and pieces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from intsim.task.kinematic_table import axis_crossing
from intsim.task.rollout import Rollout
from intsim.task.targets import CutSpec, Item, TaskError, coefficient_of_variation, target

TIP_HEIGHT, STRICT_TIP_HEIGHT = 0.05, 0.005
"""Height of the edge above the table that counts as reaching it, published and strict [m]."""
ANGLE_TOLERANCE = math.radians(10.0)  # most that the edge may deviate from across the food
PLACE_TOLERANCE = 0.1  # most error of the place, over the size of the food
CRITERIA = ("tip", "region", "angle", "place", "strict_tip", "count", "even")
"""All criteria; the first four are published, the last two are of equal pieces alone."""
LENGTH_VARIATION_LIMIT = 0.1  # most spread of the lengths of equal pieces, over their mean


@dataclass(frozen=True)
class GeometricOutcome:
    """What geometry says of an episode.

    Attributes:
        height: Lowest height of the edge above the table [m].
        angle: Between the edge and across the food, in plan, at the lowest point [rad]; NaN where the food was not met.
        offset: Place of the cut less the one asked for, over the food's length [-]; NaN where it was not met.
        pieces: Pieces of the food at the end, in plain geometry.
        length_variation: Standard deviation of the lengths of the pieces over their mean; NaN for one piece.
        criteria: Which of :data:`CRITERIA` are met; ``count`` and ``even`` for equal pieces alone.
        offsets: Of every cut in order, the error of its place over the length of what was cut [-].
        volume_variation: Standard deviation of the volumes of the pieces over their mean: 0 for equal ones, NaN for one
            piece. The published measure of a split is the number and uniformity of its pieces, without a formula.
    """

    height: float
    angle: float
    offset: float
    pieces: int
    length_variation: float
    criteria: Mapping[str, bool]
    offsets: tuple[float, ...] = ()
    volume_variation: float = math.nan

    @property
    def published(self) -> bool:
        """The four published criteria together."""
        return all(self.criteria[name] for name in CRITERIA[:4])

    @property
    def strict(self) -> bool:
        """The same with an edge that comes within 5 mm of the table, and as many equal pieces as asked for."""
        return self.published and all(self.criteria.values())


def judge_geometry(spec: CutSpec, item: Item, rollout: Rollout, after: Item) -> GeometricOutcome:
    """Judge an episode by geometry.

    The published criteria are read so that each fails by itself: the tip's error is its height above the table, the
    region is the food, into which the edge has to go, the place is along its axis. A tip within 50 mm of the table says
    nothing of a grape 25 mm high: a knife that has not touched it has not met the region, and ``strict_tip`` asks for
    5 mm. For equal pieces every cut counts against the piece that was there: the worst angle
    and place.

    Args:
        spec: What was asked for.
        item: The food at the beginning.
        rollout: What happened.
        after: The food at the end.

    Returns:
        What was found, and which criteria are met.
    """
    poses = np.array(rollout.pose)
    low = int(np.argmin(poses[:, 2]))
    height = float(poses[low, 2])
    made = [(was, along) for was, along in rollout.cuts if (was.name, was.x, was.y) == (item.name, item.x, item.y)]
    if spec.pieces:
        tries = made
        errors = [_offset(spec, was, along) for was, along in made]
        angles = [_angle(item, rollout, k) for k in range(len(made))]
    else:
        place = axis_crossing(item.whole, poses[low])
        tries = [(item, place)] if place is not None else []
        errors = [_offset(spec, was, along) for was, along in tries]
        angles = [_from_across(item, poses[low])] if tries else []
    offset = max(errors, key=abs) if errors else math.nan
    angle = max(angles) if angles else math.nan
    lengths = [p.length for p in after.pieces]
    even = coefficient_of_variation(lengths) if len(lengths) > 1 else math.nan
    criteria = {
        "tip": height < TIP_HEIGHT,
        "region": bool(tries) and (bool(spec.pieces) or height < item.top(tries[0][1])),
        "angle": angle <= ANGLE_TOLERANCE,
        "place": abs(offset) <= PLACE_TOLERANCE,
        "strict_tip": height < STRICT_TIP_HEIGHT,
    }
    if spec.pieces:
        criteria |= {"count": len(lengths) == spec.pieces, "even": even <= LENGTH_VARIATION_LIMIT}
    uneven = coefficient_of_variation(after.volumes()) if len(lengths) > 1 else math.nan
    return GeometricOutcome(height, angle, offset, len(lengths), even, criteria, tuple(errors), uneven)


def _offset(spec: CutSpec, was: Item, along: float) -> float:
    """Error of a cut over the length of what was cut: the whole food, or for equal pieces the piece that was left."""
    try:
        wanted = target(spec, was)
    except TaskError:  # in as many pieces as asked for: one cut too many
        return math.inf
    length = was.shape.length
    if spec.pieces:
        length = max(p.length for p in was.pieces)
    return (along - wanted) / length


def _from_across(item: Item, pose: np.ndarray) -> float:
    edge = np.array([math.cos(pose[3]), math.sin(pose[3])])
    return math.asin(min(1.0, abs(float(edge @ item.axis))))


def _angle(item: Item, rollout: Rollout, k: int) -> float:
    """Of the k-th cut: the pose in which the edge was lowest while it was down for it."""
    down = np.array([pose[2] for pose in rollout.pose]) < STRICT_TIP_HEIGHT
    starts = np.flatnonzero(down & ~np.concatenate([[False], down[:-1]]))
    return _from_across(item, rollout.pose[starts[min(k, len(starts) - 1)]])


def wilson(successes: int, trials: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % interval of a rate of success (Wilson 1927, J. Am. Stat. Assoc. 22:209).

    Args:
        successes: Successes.
        trials: Trials.
        z: Quantile of the normal distribution at 97.5 % [-].

    Returns:
        Lower and upper end [-]; 0 and 1 without trials.
    """
    if trials == 0:
        return 0.0, 1.0
    p, n = successes / trials, trials
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(middle - half, 0.0), min(middle + half, 1.0)
