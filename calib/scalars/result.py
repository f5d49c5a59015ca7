"""What a fit to published numbers ends with: ``scalars.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from calib.io.typed_document import FLAT

RESULT_FILE = "scalars.json"
MET_WITHIN = 2.0
"""Standard deviations within which a given number is met."""


@dataclass(frozen=True, kw_only=True)
class PropertyResult:
    """A property of the food.

    Attributes:
        role: ``fitted``, or ``drawn`` for the band.
        value: Best value, or that of the food [unit].
        unit: SI unit, ``-`` where there is none.
        low95: Lower end of 95 % of the draws that met the given numbers [unit], NaN without draws.
        high95: Upper end [unit].
        prior_low: Lower end of the prior's 95 % range [unit].
        prior_high: Upper end [unit].
    """

    role: str
    value: float
    unit: str
    low95: float
    high95: float
    prior_low: float
    prior_high: float


@dataclass(frozen=True, kw_only=True)
class NumberResult:
    """A published number and what is simulated of it.

    Attributes:
        specimen: Name of its cut.
        quantity: What it is, with its unit.
        role: ``given`` to the fit, or ``predicted``.
        published: Its value [unit of the quantity].
        relative_sd: Its standard deviation, a fraction of the value [-].
        simulated: What the fitted properties give [unit of the quantity].
        error: Simulated over published, less 1 [-].
        misfit_sd: Logarithm of simulated over published, in standard deviations [-].
        low95: Lower end of 95 % of the draws [unit of the quantity], NaN without draws.
        high95: Upper end [unit of the quantity].
        inside: Whether the published value is between them, None without draws.
    """

    specimen: str
    quantity: str
    role: str
    published: float
    relative_sd: float
    simulated: float
    error: float
    misfit_sd: float
    low95: float
    high95: float
    inside: bool | None


@dataclass(frozen=True)
class FullnessResult:
    """Largest over mean force of a cut [-].

    Attributes:
        specimen: Name of the cut.
        published: As published, None where one of both numbers is missing.
        simulated: As simulated.
        uniform: Where the force goes with the width that is cut.
    """

    specimen: str
    published: float | None
    simulated: float
    uniform: float


@dataclass(frozen=True)
class DrawCounts:
    """How many draws met the given numbers, could not, and broke down."""

    met: int
    unmet: int
    broke_down: int


@dataclass(frozen=True, kw_only=True)
class FittedNumbers:
    """Published numbers, given to the fit or predicted by it.

    Attributes:
        source: Where they were published.
        food: Name of the food.
        knife: Name of the knife.
        limit: Largest error of a predicted number that passes [-].
        fit: Properties that were fitted.
        vary: Properties that were drawn.
        parameters: The properties, by name.
        numbers: The numbers.
        fullness: Largest over mean force of each cut.
        draws: What the draws came to.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "passed", "consistent", "predicted", "source", "food", "knife", "limit", "fit", "vary", "parameters", "numbers",
        "fullness", "draws",
    )  # fmt: skip

    source: str
    food: str
    knife: str
    limit: float
    fit: tuple[str, ...]
    vary: tuple[str, ...]
    parameters: Mapping[str, PropertyResult]
    numbers: tuple[NumberResult, ...]
    fullness: tuple[FullnessResult, ...]
    draws: DrawCounts

    @property
    def consistent(self) -> bool:
        """Whether the given numbers are met within two of their standard deviations."""
        return all(abs(one.misfit_sd) <= MET_WITHIN for one in self.numbers if one.role == "given")

    @property
    def predicted(self) -> bool:
        """Whether the predicted numbers are within the limit."""
        return all(abs(one.error) <= self.limit for one in self.numbers if one.role == "predicted")

    @property
    def passed(self) -> bool:
        """Whether both are so."""
        return self.consistent and self.predicted


@dataclass(frozen=True, kw_only=True)
class ScalarFitResult:
    """A finished fit to published numbers.

    Attributes:
        fitted: The numbers and the properties.
        draws_asked: Draws that were asked for.
        seed: Seed of draws and particles.
        evaluations: Simulations that were asked for, known ones included.
        failed_evaluations: Those of them that broke down.
        dx_m: Cell size of the default grid [m], by cut.
        device: Device of the simulations.
        cutcal: Version of cutcal.
        commit: Commit of the checkout.
    """

    DOCUMENT: ClassVar[str] = "scalars"

    fitted: FittedNumbers = field(metadata=FLAT)
    draws_asked: int
    seed: int
    evaluations: int
    failed_evaluations: int
    dx_m: Mapping[str, float]
    device: str
    cutcal: str
    commit: str | None
