"""Texture profiles from the files of two-bite tests: read, evaluate, group, compare directions, write."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.io.folder import prepare
from calib.io.provenance import git_commit, versions
from calib.texture.bite_path import path_of
from calib.texture.bites import find_bites, plate_descent
from calib.texture.law_fit import SpeedGroup
from calib.texture.law_result import LawResult, LeftOutSpeed
from calib.texture.left_out import JUDGED_TOTAL, heights_of, law_of_direction, outside, passes
from calib.texture.plate_record import PlateColumns, PlateRecord, read_records
from calib.texture.repeats import ratio_of_means, scatter
from calib.texture.texture_profile import Remark, TextureProfile, texture_profile
from calib.texture.texture_result import (
    ACROSS,
    ALONG,
    ONLY,
    QUANTITIES,
    BiteCurves,
    DirectionRatio,
    RepeatProfile,
    TextureGroup,
    TextureResult,
    write_result,
)
from calib.validation.acceptance import Verdict

SAME_SPEED = 1.4
"""Ratio of two times of descent up to which they are of one speed [-]: machines scatter by some per cent, and speeds
of a test differ by a factor of two or more."""
CURVE_SAMPLES = 400
BEFORE, BEHIND = 1.2, 1.0
"""Times of descent before the first peak and behind the second one that curves show."""
Say = Callable[[str], None]


@dataclass(frozen=True)
class TextureTest:
    """What was measured.

    Attributes:
        along: Files of one direction, each of one specimen; of the direction along the fibres where there are others.
        across: Files across the fibres, none where one direction was measured.
        columns: How their columns are found.
        trigger: Load from which the plate touches the food [N]; None for 5 % of the first peak.
        seed: Seed of the draws of the bootstrap.
        area: Area of the specimens under the plate [m^2]; with it, a law of rate is fitted to each direction.
        height: Height of every specimen [m]; None for the first gap of each record.
    """

    along: Sequence[str | Path]
    across: Sequence[str | Path]
    columns: PlateColumns
    trigger: float | None = None
    seed: int = 0
    area: float | None = None
    height: float | None = None


@dataclass(frozen=True, eq=False)
class Specimen:
    """A record with its direction, its texture profile and the time in which its plate goes down [s]."""

    record: PlateRecord
    direction: str
    profile: TextureProfile
    descent: float


def evaluate_texture(test: TextureTest, out: Path, *, command: Sequence[str], say: Say) -> TextureResult:
    """Evaluate and write tpa.json, curves.csv, report.pdf and report.html.

    Args:
        test: What was measured.
        out: Output folder.
        command: Words of the command line.
        say: Called with a sentence about the records.

    Returns:
        What tpa.json holds.

    Raises:
        CutcalError: Bad input, or a folder that cannot be used.
    """
    specimens, notes = _specimens(test)
    for text in notes:
        say(f"note: {text}")
    groups = grouped(specimens)
    with prepare(out, "tpa", resume=False):
        names = names_of(groups)
        curves = [bite_curves(members, name) for members, name in zip(groups, names, strict=True)]
        laws: list[LawResult] = []
        if test.area is not None:
            laws, curves = _laws(groups, curves, test, say)
        result = TextureResult(
            command=tuple(command),
            trigger_N=math.nan if test.trigger is None else test.trigger,
            groups=tuple(_group(members, name) for members, name in zip(groups, names, strict=True)),
            ratios=tuple(_ratios(groups, test.seed)),
            laws=tuple(laws),
            verdicts=tuple(_verdict(one) for law in laws for one in law.left_out),
            not_shown=(*_unshown(test, groups), *notes),
            seed=test.seed,
            files=tuple(one.record.file for one in specimens),
            versions=versions(),
            git=git_commit(),
        )
        write_result(result, curves, out)
        from reports.press.texture import write_report

        write_report(result, curves, out)
        return result


def _specimens(test: TextureTest) -> tuple[list[Specimen], list[str]]:
    """The specimens of both directions, and what a reader should know of them."""
    out: list[Specimen] = []
    notes: list[str] = []
    told: list[Remark] = []
    directions = ((ALONG, test.along), (ACROSS, test.across)) if test.across else ((ONLY, test.along),)
    records = read_records([path for _, paths in directions for path in paths], test.columns)
    names = [direction for direction, paths in directions for _ in paths]
    for record, direction in zip(records, names, strict=True):
        if test.height is not None:
            record.height(test.height)
        profile, remarks = texture_profile(record, test.trigger)
        notes += record.notes
        told += remarks
        out.append(Specimen(record, direction, profile, plate_descent(record)))
    for kind in dict.fromkeys(remark.kind for remark in told):
        first, *others = [remark.text for remark in told if remark.kind == kind]
        notes.append(first + (f" (and so in {_several(len(others), 'other record')})" if others else ""))
    return out, notes


def grouped(specimens: Sequence[Specimen]) -> list[list[Specimen]]:
    """Specimens of one direction and speed together; the fastest first.

    Args:
        specimens: All of them.

    Returns:
        The groups.
    """
    out: list[list[Specimen]] = []
    for direction in dict.fromkeys(one.direction for one in specimens):
        own = sorted((one for one in specimens if one.direction == direction), key=lambda one: one.descent)
        for one in own:
            last = out[-1] if out else []
            same = last and last[0].direction == direction and one.descent < SAME_SPEED * last[0].descent
            if same:
                last.append(one)
            else:
                out.append([one])
    return out


def descent_of(group: Sequence[Specimen]) -> float:
    """Median time in which the plate goes down [s]."""
    return float(np.median([one.descent for one in group]))


def common_descent(group: Sequence[Specimen], groups: Sequence[Sequence[Specimen]]) -> float:
    """Time in which the plate goes down at the speed of a group [s]: the median of both directions that have it.

    Args:
        group: The group.
        groups: All groups.

    Returns:
        The time.
    """
    other = _nearest(group, groups)
    mutual = other and _nearest(other, groups) is group and _apart(group, other) < math.log(SAME_SPEED)
    return descent_of([*group, *other] if mutual else group)


def _apart(one: Sequence[Specimen], other: Sequence[Specimen]) -> float:
    """How far the speeds of two groups are apart: logarithm of the ratio of their times, none below zero [-]."""
    return abs(math.log(descent_of(one) / descent_of(other)))


def _nearest(group: Sequence[Specimen], groups: Sequence[Sequence[Specimen]]) -> Sequence[Specimen]:
    """The group of the other direction with the nearest speed; empty where there is none."""
    others = [one for one in groups if one[0].direction != group[0].direction]
    return min(others, key=lambda one: _apart(group, one), default=())


def names_of(groups: Sequence[Sequence[Specimen]]) -> list[str]:
    """Names of groups: the direction, where there are two, and the time in which the plate goes down at that speed.

    Args:
        groups: The groups of all directions.

    Returns:
        A name for each; one speed has the same time in both directions.
    """
    times = [f"{common_descent(group, groups):.2g} s" for group in groups]
    return [
        time if group[0].direction == ONLY else f"{group[0].direction} {time}"
        for group, time in zip(groups, times, strict=True)
    ]


def _several(count: int, thing: str) -> str:
    """A number of things in words."""
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def _group(group: Sequence[Specimen], name: str) -> TextureGroup:
    """The group as it is reported."""
    values = {name: scatter([getattr(one.profile, name) for one in group]) for name in QUANTITIES}
    repeats = tuple(
        RepeatProfile(one.record.name, one.profile) for one in sorted(group, key=lambda one: one.record.name)
    )
    return TextureGroup(name=name, direction=group[0].direction, descent_s=descent_of(group), repeats=repeats, **values)


def _ratios(groups: Sequence[Sequence[Specimen]], seed: int) -> list[DirectionRatio]:
    """Along over across of each quantity at each speed that both directions have, and of those speeds together."""
    along, across = ([group for group in groups if group[0].direction == direction] for direction in (ALONG, ACROSS))
    pairs = [
        (common_descent(one, groups), one, other)
        for one in along
        for other in across
        if 1 / SAME_SPEED < descent_of(one) / descent_of(other) < SAME_SPEED
    ]
    if not pairs:
        return []
    together = [(math.nan, [x for _, one, _ in pairs for x in one], [x for _, _, other in pairs for x in other])]
    out = []
    for descent, one, other in [*(together if len(pairs) > 1 else []), *pairs]:
        for name in QUANTITIES:
            above, below = ([float(getattr(x.profile, name)) for x in group] for group in (one, other))
            if sum(below) != 0.0:
                out.append(DirectionRatio(name, descent, ratio_of_means(above, below, seed)))
    return out


def bite_curves(group: Sequence[Specimen], name: str) -> BiteCurves:
    """Load over time of each repeat of a group, the peaks of either bite at one time.

    Args:
        group: Specimens of one direction and speed.
        name: Name of the group.

    Returns:
        Their loads on common times.
    """
    bites = [find_bites(one.record) for one in group]
    descent = descent_of(group)
    apart = float(np.median([second.peak - first.peak for first, second in bites]))
    time = np.linspace(-BEFORE * descent, apart + BEHIND * descent, CURVE_SAMPLES)
    loads = []
    for one, (first, second) in zip(group, bites, strict=True):
        clock = np.where(time < 0.5 * apart, first.peak + time, second.peak + time - apart)
        loads.append(np.interp(clock, one.record.time, one.record.load))
    return BiteCurves(name, time, np.array(loads))


def _laws(
    groups: Sequence[Sequence[Specimen]], curves: Sequence[BiteCurves], test: TextureTest, say: Say
) -> tuple[list[LawResult], list[BiteCurves]]:
    """The law of each direction, and the curves with what it predicts."""
    out, told = [], {}
    area = float(test.area or 0.0)
    for direction in dict.fromkeys(group[0].direction for group in groups):
        own = [(group, one) for group, one in zip(groups, curves, strict=True) if group[0].direction == direction]
        say(f"fitting a law of rate to {_several(len(own), 'speed')}, direction: {direction}")
        speeds = [_speed_group(group, one, area, test.height) for group, one in own]
        law, predicted = law_of_direction(direction, speeds, [[x.profile for x in group] for group, _ in own], area)
        out.append(law)
        for speed in speeds:
            if speed.name in predicted:
                told[speed.name] = (speed.path.history()[0], area * predicted[speed.name])
    curves = [
        replace(one, predicted=np.interp(one.time, *told[one.group])) if one.group in told else one for one in curves
    ]
    return out, list(curves)


def _speed_group(group: Sequence[Specimen], curves: BiteCurves, area: float, height: float | None) -> SpeedGroup:
    """The group as a law is fitted to it."""
    records = [one.record for one in group]
    path = path_of(records, heights_of(records, height))
    time, _ = path.history()
    stress = np.array([np.interp(time, curves.time, load) for load in curves.loads]) / area
    return SpeedGroup(curves.group, path, stress)


def _verdict(one: LeftOutSpeed) -> Verdict:
    """The line of a speed that was left out: how much of it is outside the scatter of its repeats."""
    name = (
        f"{one.group} by the law of the other speeds: quantities of {JUDGED_TOTAL} outside the scatter of the repeats"
    )
    return Verdict(name, outside(one), 0, "", passes(one), one.why)


def _unshown(test: TextureTest, groups: Sequence[Sequence[Specimen]]) -> list[str]:
    """What the result does not show, in words."""
    trigger = "5 % of the first peak" if test.trigger is None else f"{test.trigger:g} N"
    out = [
        f"contact is where the load, smoothed over a tenth of the first descent, passes {trigger}; another trigger "
        "moves springiness",
        "nothing is subtracted from the load: an offset of the sensor is part of hardness and areas",
        "hardness depends on the size of the specimen, and every quantity on the speed and depth of the bites",
    ]
    if any(len(group) == 1 for group in groups):
        out.append("a group of one repeat has no scatter and no interval")
    if test.area is not None:
        out.append(
            "a law is of the whole specimen between plates that do not hold it: friction, adhesion and water that is "
            "pressed out are in its parameters"
        )
    if test.across:
        out.append("the ratio's interval is of the specimens that were drawn; batches are not told from directions")
    return out
