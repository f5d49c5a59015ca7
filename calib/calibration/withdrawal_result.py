"""What a result says of the way up that was fitted beside the way down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from calib.io.type_schema import Fraction, NotNegative, Positive, Shared
from calib.io.typed_document import NULL
from calib.uncertainty.estimates import FittedNuisance


@dataclass(frozen=True)
class FitWithout:
    """The fit without one property, and what the trace says for that property.

    Attributes:
        value: What the property is held at instead, the least that it may have [unit].
        chi_square: Least chi-square found so, without the property's own prior.
        whole: That of the fit with it.
        evidence: Bayesian information criterion without the property less that with it; above 10 it is very strong,
            below 0 the trace does not need the property.
    """

    value: float
    chi_square: NotNegative
    whole: NotNegative
    evidence: float


@dataclass(frozen=True, kw_only=True)
class WithdrawalAgreement:
    """The way up: the pull on the knife, downwards positive, simulated against measured.

    Attributes:
        from_m: Way above the lowest point from which it is compared: before, the edge gives back its slip [m].
        to_m: Way above the lowest point up to which it was recorded and is compared [m].
        speed_m_s: Mean speed on it [m/s].
        peak_real_N: Largest measured pull [N].
        peak_sim_N: Largest simulated pull at the best values [N].
        nrmse: Root mean square difference over the largest measured pull, a fraction.
        work_real_J: Work of the measured pull [J].
        work_sim_J: Work of the simulated pull [J].
        predictive_inside: Part of the measured points within the 95 % band; null where the fit ended too early.
        nuisances: What the fit says of the measurement on the way up, by name: tare, gain, width; empty where the fit
            ended too early.
        without: The fit without the cutting resistance, without friction and without adhesion, by property; empty
            where none of them was fitted or the fit ended too early.
    """

    from_m: NotNegative
    to_m: Positive
    speed_m_s: NotNegative
    peak_real_N: Positive
    peak_sim_N: float
    nrmse: NotNegative
    work_real_J: float
    work_sim_J: float
    predictive_inside: Fraction | None = field(default=None, metadata=NULL)
    nuisances: Mapping[str, Annotated[FittedNuisance, Shared("nuisance")]] = field(default_factory=dict)
    without: Mapping[str, FitWithout] = field(default_factory=dict)
