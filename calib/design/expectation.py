"""What each test is expected to leave open: covariances about one food, and their mean over several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calib.design.candidates import (
    PHOTOGRAPH_SIZES_SD,
    PHOTOGRAPH_WIDTH_SD,
    WIDTH_SD,
    Candidate,
)
from calib.design.linear import LinearTest, gained_bits, information, posterior
from calib.design.measurement import CutTest, compression_measurement, cut_measurement, sizes_measurement
from calib.design.start import Start
from calib.design.stencil import Stencil
from calib.multi_specimen.spec import KNIFE_PROPERTIES, SPECIMEN_PROPERTIES
from mpm.arrays import FloatArray

FIRST = "first"
"""The cut that was calibrated."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Covariances about one food.

    Attributes:
        now: Before any test (p, p).
        after: After each test (p, p), by name; tests whose cut breaks down are missing. Where the model errs as in the
            first cut there are two: as much as it can, and not at all. What leaves more open counts.
        gradient: Logarithm of the quantity that was asked for by the internal coordinates (p,); None for parameters.
    """

    now: FloatArray
    after: Mapping[str, tuple[FloatArray, ...]]
    gradient: FloatArray | None = None


def judge(
    start: Start, tests: list[Candidate], about: Mapping[str, Stencil], z: FloatArray, gradient: FloatArray | None
) -> Judged:
    """Judge tests about one food.

    Args:
        start: What is known.
        tests: The tests.
        about: Cuts about the food, by the name of their test; the first cut too, where it was made.
        z: Internal coordinates of the food [-], (p,).
        gradient: Logarithm of what is asked for by the internal coordinates [-], (p,), or None.

    Returns:
        The covariances.
    """
    prior = start.parameters.prior_covariance
    before = [] if start.run is None else [first_cut(start, about[FIRST], start.width_sd)]
    known = information(before) if before else np.zeros_like(prior)
    now = posterior(prior, known)
    after: dict[str, tuple[FloatArray, ...]] = {}
    for test in tests:
        if test.scene is not None and not about[test.name].sound:
            continue
        together = _together(start, test, about, z, before)
        ways = [together]
        if test.same_model:
            ways.append([replace(one, model="") for one in together])
        after[test.name] = tuple(posterior(now, information(way) - known) for way in ways)
    return Judged(now, after, gradient)


def first_cut(start: Start, stencil: Stencil, width_sd: float) -> LinearTest:
    """What the cut that was made says.

    Args:
        start: What is known.
        stencil: The cut and its neighbours.
        width_sd: Relative standard deviation of the width of its specimen [-].

    Returns:
        The measurement.
    """
    return cut_measurement(start, stencil, first_test(start, width_sd))


def first_test(start: Start, width_sd: float) -> CutTest:
    """How the cut that was made is measured, where the width of its specimen has this relative deviation [-]."""
    return CutTest(FIRST, start.stroke, width_sd, model=FIRST)


def next_cut(start: Start, test: Candidate) -> CutTest:
    """How a cut of another specimen is measured; its skin and start are its own where one was cut before, and
    the friction of another knife.

    Args:
        start: What is known.
        test: The test, a cut.

    Returns:
        The measurement.
    """
    assert test.scene is not None
    others = KNIFE_PROPERTIES if test.scene.knife.name != start.knife.name else ()
    chosen = (*SPECIMEN_PROPERTIES, *others)
    own = () if start.run is None else tuple(n for n in chosen if n in start.parameters.names)
    stroke = min(start.stroke, test.scene.motion.stroke)
    return CutTest(test.name, stroke, WIDTH_SD, own, FIRST if test.same_model else "")


def _together(
    start: Start, test: Candidate, about: Mapping[str, Stencil], z: FloatArray, before: list[LinearTest]
) -> list[LinearTest]:
    """All measurements that there are after a test."""
    if test.scene is not None:
        return [*before, cut_measurement(start, about[test.name], next_cut(start, test))]
    if test.kind == "compression":
        return [*before, compression_measurement(start, z)]
    spread = {"width": WIDTH_SD, "photograph": PHOTOGRAPH_WIDTH_SD}[test.kind]
    width = start.width_sd * spread / np.hypot(start.width_sd, spread) if start.width_sd > 0.0 else 0.0
    sizes = PHOTOGRAPH_SIZES_SD if test.kind == "photograph" else {"aspect": WIDTH_SD}
    seen = sizes_measurement(start.parameters, z, sizes)
    return [first_cut(start, about[FIRST], float(width)), *([] if seen is None else [seen])]


@dataclass(eq=False)
class Expectation:
    """Mean over several foods of what is known before and after the tests.

    Attributes:
        foods: What was judged about each food.
    """

    foods: list[Judged] = field(default_factory=list)

    def sd_now(self) -> FloatArray:
        """Standard deviations in internal coordinates (p,)."""
        return np.mean([_sd(one.now) for one in self.foods], axis=0)

    def asked_now(self) -> float:
        """Standard deviation of the logarithm of the quantity that was asked for [-]."""
        return float(np.mean([_along(one.now, one.gradient) for one in self.foods]))

    def of(self, test: str) -> Outlook | None:
        """What a test is expected to leave open; None where it broke down about every food."""
        used = [one for one in self.foods if test in one.after]
        if not used:
            return None
        before = np.mean([_sd(one.now) for one in used], axis=0)
        after = np.mean([np.max([_sd(c) for c in one.after[test]], axis=0) for one in used], axis=0)
        asked = None
        if used[0].gradient is not None:
            whole = np.mean([_along(one.now, one.gradient) for one in used])
            left = np.mean([max(_along(c, one.gradient) for c in one.after[test]) for one in used])
            asked = float(left / whole) if whole else 1.0
        bits = float(np.mean([min(gained_bits(one.now, c) for c in one.after[test]) for one in used]))
        return Outlook(after / before, asked, max(bits, 0.0), len(used))


@dataclass(frozen=True, eq=False)
class Outlook:
    """What a test is expected to leave open.

    Attributes:
        parts: Standard deviations after over before (p,).
        asked: The same of the quantity that was asked for [-], None for parameters.
        bits: Expected information [bit].
        foods: Foods that it is a mean of.
    """

    parts: FloatArray
    asked: float | None
    bits: float
    foods: int


def _sd(covariance: FloatArray) -> FloatArray:
    out: FloatArray = np.sqrt(np.diag(covariance))
    return out


def _along(covariance: FloatArray, gradient: FloatArray | None) -> float:
    assert gradient is not None
    return float(np.sqrt(gradient @ covariance @ gradient))
