"""What is said of the law of a direction: its parameters, and each speed that it predicts without having seen it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from calib.io.type_schema import NotNegative, NumberOrNull, Positive, keywords

ONE = keywords(description="One of them")


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a law, with its 95 % interval.

    Attributes:
        name: Its name.
        value: Its value, in the unit of its name.
        low: Lower end of its 95 % interval.
        high: Upper end.
    """

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class PredictedQuantity:
    """A quantity of a group that was predicted, against the scatter of its repeats.

    Attributes:
        quantity: Its name.
        predicted: What the law predicts.
        mean: Mean of the repeats.
        low: Lower end of the 95 % scatter: the interval of one more repeat; null for one repeat.
        high: Upper end; null for one repeat.
        inside: Whether the prediction lies within the scatter; null for one repeat, which has none.
        area_metric: Area between prediction and distribution of the repeats over their mean (Ferson and Oberkampf) [-].
        area_of_mean: The same for the mean of the repeats itself: what no law without scatter goes below [-].
    """

    quantity: str
    predicted: float
    mean: float
    low: NumberOrNull
    high: NumberOrNull
    inside: bool | None
    area_metric: NotNegative
    area_of_mean: NotNegative


@dataclass(frozen=True)
class LeftOutSpeed:
    """A speed that was predicted by the law of the other speeds.

    Attributes:
        group: Name of the group.
        descent_s: Time in which the plate goes down [s].
        parameters: Law of the other speeds.
        quantities: Texture profile, predicted and measured.
        curve_inside: Part of the curve that lies within the scatter of the repeats, where the mean is above 5 % of its
            peak [-]; null for one repeat.
        extrapolated: Whether the speed lies outside those that were fitted.
        factor: Factor of the group in the fit to all speeds [-]: how much stiffer its specimens are than the law.
        factor_sd: Standard deviation of the factor's logarithm that the scatter of the repeats lets expect [-].
        why: Why the prediction fails, or is not judged; empty where it passes.
    """

    group: str
    descent_s: Positive
    parameters: tuple[Annotated[LawParameter, ONE], ...]
    quantities: tuple[Annotated[PredictedQuantity, ONE], ...]
    curve_inside: NumberOrNull
    extrapolated: bool
    factor: Positive
    factor_sd: Positive
    why: str


@dataclass(frozen=True)
class LawResult:
    """Law of one direction.

    Attributes:
        direction: The direction.
        parameters: The law fitted to all speeds.
        damage_evidence: Bayesian information criterion without damage less that with it; above 0 the law has damage.
        left_out: Each speed, predicted by the law of the others; empty for fewer than three speeds.
    """

    direction: str
    parameters: tuple[Annotated[LawParameter, ONE], ...]
    damage_evidence: float
    left_out: tuple[Annotated[LeftOutSpeed, ONE], ...]
