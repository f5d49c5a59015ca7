"""Texture profile of two bites: hardness, cohesiveness, springiness and resilience by their standard definitions.

The chart is load over time, as of Friedman, Whitney and Szczesniak (1963, J. Food Sci. 28:390-396) and of Bourne
(1978, Food Technol. 32(7):62-66, 72), in compression to the same place twice. Areas are integrals of the load over
time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calib.errors import TraceError
from calib.io.type_schema import NumberOrNull, Positive
from calib.texture.bites import Bite, find_bites
from calib.texture.plate_record import PlateRecord
from mpm.arrays import FloatArray

RUN_ON = 0.02
"""Part of the depth by which the recorded way may go on behind the peak of the load [-]: a plate whose way is recorded
later than its load goes on by more."""
UNEVEN = 0.05
"""Difference of the deepest places of the two bites, part of the deeper, from which on they are said to differ [-]."""


@dataclass(frozen=True)
class TextureProfile:
    """Texture profile of one specimen.

    Attributes:
        hardness_N: Largest load of the first bite (Bourne 1978) [N].
        cohesiveness: Area under the second bite over that under the first, from contact until the plate has left the
            food (Friedman et al. 1963) [-].
        springiness: Way of the plate from contact to the peak of the second bite over that of the first: the height
            that the food has recovered between the bites (Friedman et al. 1963, as a ratio after Bourne 1978) [-].
        resilience: Area of the first bite after its peak over that before it [-].
        work_cohesiveness: Work of the second bite over that of the first, load over way up to the peak [-].
        work_resilience: Work that the first bite gives back over the work that was put in [-]; null where the recorded
            way runs on behind the peak, and so is not of the same time as the load.
        adhesiveness_Ns: Area below load zero between the first bite and the second (Friedman et al. 1963) [N s].
        second_hardness_N: Largest load of the second bite [N].
        descent_s: Time from contact to the peak of the first bite [s].
        depth_m: Way from contact to the peak of the first bite [m].
    """

    hardness_N: Positive
    cohesiveness: float
    springiness: float
    resilience: float
    work_cohesiveness: float
    work_resilience: NumberOrNull
    adhesiveness_Ns: float
    second_hardness_N: Positive
    descent_s: Positive
    depth_m: Positive

    @property
    def speed_m_s(self) -> float:
        """Depth over descent [m/s]."""
        return self.depth_m / self.descent_s

    @property
    def gumminess_N(self) -> float:
        """Hardness times cohesiveness (Bourne 1978) [N]."""
        return self.hardness_N * self.cohesiveness

    @property
    def chewiness_N(self) -> float:
        """Gumminess times springiness (Bourne 1978) [N]."""
        return self.gumminess_N * self.springiness


def in_words(quantity: str) -> str:
    """Name of a quantity as it is said: its key without the unit."""
    return quantity.removesuffix("_Ns").removesuffix("_N")


@dataclass(frozen=True)
class Remark:
    """What a reader of a profile should know of a record: of which kind it is, the same for many records, and a
    sentence."""

    kind: str
    text: str


def texture_profile(record: PlateRecord, trigger: float | None = None) -> tuple[TextureProfile, list[Remark]]:
    """The texture profile of a record with two bites.

    Args:
        record: The record; the plate presses twice.
        trigger: Load from which the plate touches the food [N]; None for 5 % of the first peak.

    Returns:
        The profile, and what its reader should know of the record.

    Raises:
        TraceError: The plate does not press twice, or a bite cannot be used.
    """
    bites = find_bites(record, trigger)
    if len(bites) != 2:
        times = {0: "never", 1: "once"}.get(len(bites), f"{len(bites)} times")
        raise TraceError(f"{record.file.name}: the plate presses {times}, and a texture profile has two bites")
    first, second = bites
    down, up = area(record, first.contact, first.peak), area(record, first.peak, first.end)
    again = area(record, second.contact, second.end)
    if first.way <= 0.0:
        raise TraceError(
            f"{record.file.name}: the plate does not go on between contact and peak of the first bite; check "
            "--compression-col"
        )
    put_in, back = work(record, first.contact, first.peak), -work(record, first.peak, first.end)
    late = run_on(record, first) > RUN_ON * first.way
    profile = TextureProfile(
        hardness_N=first.hardness,
        cohesiveness=again / (down + up),
        springiness=second.way / first.way,
        resilience=up / down,
        work_cohesiveness=work(record, second.contact, second.peak) / put_in,
        work_resilience=math.nan if late else back / put_in,
        adhesiveness_Ns=_below_zero(record, first.end, second.contact),
        second_hardness_N=second.hardness,
        descent_s=first.descent,
        depth_m=first.way,
    )
    return profile, _remarks(record, first, second)


def _times(record: PlateRecord, start: float, end: float) -> FloatArray:
    """Two times, and those of the samples between them.

    Args:
        record: The record.
        start: The first time [s].
        end: The last time [s].

    Returns:
        The times [s], increasing, shape (n,).
    """
    inside = record.time[(record.time > start) & (record.time < end)]
    return np.concatenate([[start], inside, [end]])


def area(record: PlateRecord, start: float, end: float) -> float:
    """Integral of the load over time between two times [N s].

    Args:
        record: The record.
        start: The first time [s].
        end: The last time [s].

    Returns:
        The integral of the line through the samples.
    """
    time = _times(record, start, end)
    return float(np.trapezoid(np.interp(time, record.time, record.load), time))


def work(record: PlateRecord, start: float, end: float) -> float:
    """Integral of the load over the way between two times [J].

    Args:
        record: The record.
        start: The first time [s].
        end: The last time [s].

    Returns:
        The integral of the line through the samples.
    """
    time = _times(record, start, end)
    load, way = (np.interp(time, record.time, values) for values in (record.load, record.way))
    return float(np.trapezoid(load, way))


def run_on(record: PlateRecord, bite: Bite) -> float:
    """Way by which the plate is recorded to go on behind the peak of the load [m]."""
    after = (record.time >= bite.peak) & (record.time <= bite.end)
    return float(record.way[after].max() - np.interp(bite.peak, record.time, record.way)) if after.any() else 0.0


def _below_zero(record: PlateRecord, start: float, end: float) -> float:
    """Area of the loads below zero between two times, which is positive [N s]."""
    if end <= start:
        return 0.0
    on = (record.time >= start) & (record.time <= end)
    return float(-np.trapezoid(np.minimum(record.load[on], 0.0), record.time[on])) if np.count_nonzero(on) > 1 else 0.0


def _remarks(record: PlateRecord, first: Bite, second: Bite) -> list[Remark]:
    """What a reader of the profile should know of the record."""
    out: list[Remark] = []
    name = record.file.name
    split = 0.5 * (first.end + second.contact)
    deepest = [float(record.way[on].max()) for on in (record.time < split, record.time >= split)]
    if abs(deepest[1] - deepest[0]) > UNEVEN * max(deepest):
        text = (
            f"{name}: the bites go {1e3 * deepest[0]:.3g} and {1e3 * deepest[1]:.3g} mm deep; a texture profile has "
            f"two of the same depth"
        )
        out.append(Remark("depth", text))
    late = run_on(record, first)
    if late > RUN_ON * first.way:
        text = (
            f"{name}: the way goes on by {1e3 * late:.2g} mm behind the peak of the load: it is recorded some "
            f"{1e3 * late / (first.way / first.descent):.0f} ms late, so no work is given back that could be trusted"
        )
        out.append(Remark("late", text))
    held = dwell(record, first)
    if held > UNEVEN * first.descent:
        text = (
            f"{name}: the plate stands for {held:.2g} s at the peak; the area of that time counts in cohesiveness "
            f"and in resilience, which may then be above 1"
        )
        out.append(Remark("dwell", text))
    return out


def dwell(record: PlateRecord, bite: Bite) -> float:
    """Time from the peak of a bite until the plate goes back [s]."""
    after = (record.time >= bite.peak) & (record.time <= bite.end)
    way, time = record.way[after], record.time[after]
    if not len(way):
        return 0.0
    back = np.flatnonzero(way < way[0] - 0.01 * bite.way)
    return float(time[back[0]] - bite.peak) if len(back) else float(bite.end - bite.peak)
