"""What a fit to published numbers ends with: ``scalars.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from calib.io.provenance import Commit, DeviceName, Seed
from calib.io.type_schema import Count, NumberOrNull, Positive, keywords, one_of
from calib.io.typed_document import FLAT

RESULT_FILE = "scalars.json"
MET_WITHIN = 2.0
"""Standard deviations within which a given number is met."""


@dataclass(frozen=True, kw_only=True)
class PropertyResult:
    """A property of the food.

    Attributes:
        role: Whether it is fitted, or drawn for the band.
        value: Best value, or that of materials.yaml [unit].
        unit: SI unit, - where there is none.
        low95: Lower end of 95 % of the draws that met the given numbers [unit]; null without draws.
        high95: Upper end [unit]; null without draws.
        prior_low: Lower end of the literature's 95 % range [unit].
        prior_high: Upper end [unit].
    """

    role: Annotated[str, one_of("fitted", "drawn")]
    value: float
    unit: str
    low95: NumberOrNull
    high95: NumberOrNull
    prior_low: float
    prior_high: float


@dataclass(frozen=True, kw_only=True)
class NumberResult:
    """A published number and what is simulated of it.

    Attributes:
        specimen: Cut it is of.
        quantity: What it is, with its unit: peak_N or energy_J_m2.
        role: Whether the fit was given it.
        published: Published value [unit of the quantity].
        relative_sd: Its relative standard deviation.
        simulated: Simulated value [unit of the quantity].
        error: Simulated over published less 1.
        misfit_sd: Logarithm of simulated over published, in standard deviations.
        low95: Lower end of 95 % of the draws; null without draws.
        high95: Upper end; null without draws.
        inside: Whether the published value is between them; null without draws.
    """

    specimen: str
    quantity: str
    role: Annotated[str, one_of("given", "predicted")]
    published: Positive
    relative_sd: Positive
    simulated: Positive
    error: float
    misfit_sd: float
    low95: NumberOrNull
    high95: NumberOrNull
    inside: bool | None


@dataclass(frozen=True)
class FullnessResult:
    """Largest over mean force of a cut [-].

    Attributes:
        specimen: The cut.
        published: As published; null where it is not.
        simulated: As simulated.
        uniform: Where the force goes with the width that is cut.
    """

    specimen: str
    published: float | None
    simulated: Positive
    uniform: Positive


@dataclass(frozen=True)
class DrawCounts:
    """How many draws met the given numbers, could not, and broke down.

    Attributes:
        met: Met the given numbers.
        unmet: Could not.
        broke_down: Broke down.
    """

    met: Count
    unmet: Count
    broke_down: Count


@dataclass(frozen=True, kw_only=True)
class FittedNumbers:
    """Published numbers, given to the fit or predicted by it.

    Attributes:
        source: Publication.
        food: Food of materials.yaml, or of the file given.
        knife: Knife of knives.yaml, or of the file given.
        limit: Largest error of a predicted number, a fraction.
        fit: Properties that are fitted.
        vary: Properties that are drawn.
        parameters: Properties, by name.
        numbers: Published numbers.
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
    limit: Positive
    fit: tuple[str, ...]
    vary: tuple[str, ...]
    parameters: Mapping[str, Annotated[PropertyResult, keywords(description="One of them")]]
    numbers: tuple[Annotated[NumberResult, keywords(description="One of them")], ...]
    fullness: tuple[Annotated[FullnessResult, keywords(description="One cut")], ...]
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
        """Whether the given numbers are met and the predicted ones within the limit."""
        return self.consistent and self.predicted


@dataclass(frozen=True, kw_only=True)
class ScalarFitResult:
    """Properties from published numbers.

    ``scalars.json`` of ``cutcal scalars``, and what ``cutcal scalars --json`` prints.

    Attributes:
        fitted: The numbers and the properties.
        draws_asked: Draws asked for.
        seed: Seed of the particles, and of the search or the draws where there are any.
        evaluations: Simulations asked for, known ones included.
        failed_evaluations: Those that broke down.
        dx_m: Cell of the default grid [m], by cut.
        device: Device of the simulations.
        cutcal: Version of cutcal.
        commit: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed
            without one.
    """

    DOCUMENT: ClassVar[str] = "scalars"

    fitted: FittedNumbers = field(metadata=FLAT)
    draws_asked: Count
    seed: Seed
    evaluations: Count
    failed_evaluations: Count
    dx_m: Mapping[str, Positive]
    device: DeviceName
    cutcal: str
    commit: Commit
