"""Young's modulus from the compression tests of a study, and the prior that it narrows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.compression.measured import CompressionFile, read_repeats, strain_grid
from calib.compression.modulus import fit_modulus
from calib.compression.press import homogeneous
from calib.io.type_schema import Count, NotNegative, Positive
from calib.material.food import FoodSpec
from calib.multi_specimen.spec import CompressionSpec
from calib.problem.food_parameters import with_yield_strain
from calib.problem.parameters import Z95, ParameterSet
from mpm.scene.shapes import Shape

COMPRESSION_STRAIN = 0.2
"""Strain up to which a compression test is fitted [-]: flesh yields beyond."""
PLATES_SD = 0.13
"""Relative standard deviation of a modulus from plates whose friction is not known [-]: half of what lies between
frictionless plates and bonded ones (docs/compression.md)."""


@dataclass(frozen=True)
class CompressionModulus:
    """One of them.

    Attributes:
        name: Its name.
        E: Young's modulus [Pa].
        spread: Its relative standard deviation.
        repeats: Number of repeats.
        nu: Poisson's ratio that was assumed.
        files: Files it is from.
    """

    name: str
    E: Positive
    spread: NotNegative
    repeats: Count
    nu: float
    files: tuple[CompressionFile, ...]


def compression_modulus(spec: CompressionSpec) -> CompressionModulus:
    """Young's modulus of a compression test between frictionless plates, in closed form of the solver's law.

    Raises:
        CutcalError: The test cannot be used.
    """
    sizes = spec.sizes
    width = sizes.get("diameter", sizes.get("width", 0.0))
    kind = "upright_cylinder" if "diameter" in sizes else "block"
    shape = Shape(kind, sizes.get("length", width), width, sizes["height"])
    measured = read_repeats(spec.traces, shape, COMPRESSION_STRAIN)
    grid = strain_grid(COMPRESSION_STRAIN)
    found = fit_modulus(measured, homogeneous(spec.nu, grid))
    spread = float(np.hypot(found.sd / found.mean if len(found.E) > 1 else 0.0, PLATES_SD))
    return CompressionModulus(spec.name, found.mean, spread, len(found.E), spec.nu, measured.files)


def with_measured_modulus(
    parameters: ParameterSet, tests: Sequence[CompressionModulus], food: FoodSpec
) -> ParameterSet:
    """The parameters with the prior of E narrowed by compression tests, as independent lognormal measurements.

    That of the food's yield stress follows it.

    Args:
        parameters: The fitted parameters.
        tests: Compression tests of the food.
        food: The food.

    Returns:
        The parameters; as they were without a test or without E among them.
    """
    if not tests or "E" not in parameters.names:
        return parameters
    old = parameters["E"]
    means = [old.prior_mean, *(float(np.log(t.E)) for t in tests)]
    precisions = np.array([old.prior_sd**-2, *(t.spread**-2 for t in tests)])
    mean = float(np.dot(means, precisions) / precisions.sum())
    half = Z95 / float(np.sqrt(precisions.sum()))
    low, high = float(np.exp(mean - half)), float(np.exp(mean + half))
    new = replace(
        old,
        value=float(np.exp(mean)),
        low=min(old.low, low / 2.0),
        high=max(old.high, high * 2.0),
        prior_low=low,
        prior_high=high,
    )
    measured = ParameterSet(tuple(new if p.name == "E" else p for p in parameters))
    return with_yield_strain(measured, food)
