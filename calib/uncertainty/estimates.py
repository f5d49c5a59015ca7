"""What a fit says of a parameter or a nuisance, as a document has it."""

from __future__ import annotations

from dataclasses import dataclass

from calib.material.properties import Property
from calib.problem.nuisance import NuisanceEstimate
from calib.problem.parameters import Parameter
from calib.uncertainty.intervals import Interval

UNKNOWN = "unknown"
"""Verdict of a parameter whose fit ended before its curvature was known."""


@dataclass(frozen=True)
class FittedParameter:
    """A fitted parameter.

    Attributes:
        value: Best value [unit].
        unit: SI unit, - where there is none.
        low95: Lower end of the 95 % interval [unit]; None where the fit ended too early.
        high95: Upper end of the 95 % interval [unit]; None where the fit ended too early.
        prior_low: Lower end of the literature's 95 % range [unit].
        prior_high: Upper end of the literature's 95 % range [unit].
        verdict: Its identifiability (:data:`calib.uncertainty.intervals.Identifiability`), ``only_as_product`` or
            :data:`UNKNOWN`; ``at_limit`` where the bound is the end of what is possible.
        status: How far the value at the start can be trusted, as in ``materials.yaml``.
        source: Where the value at the start and the range come from.
        sampled95: Ends of the 95 % interval of a sample of the posterior [unit], where one was drawn.
    """

    value: float
    unit: str
    low95: float | None
    high95: float | None
    prior_low: float | None
    prior_high: float | None
    verdict: str
    status: str
    source: str | None
    sampled95: tuple[float, float] | None = None

    @classmethod
    def of(cls, found: Interval | Parameter, known: Property, sampled: tuple[float, float] | None) -> FittedParameter:
        """A parameter of a fit.

        Args:
            found: Its interval; only the parameter where the fit ended too early for one.
            known: What the literature says of it.
            sampled: Its 95 % interval from a sample of the posterior [unit], where one was drawn.

        Returns:
            The parameter as a document has it.
        """
        interval = found if isinstance(found, Interval) else None
        p = found.parameter if isinstance(found, Interval) else found
        return cls(
            value=p.value,
            unit=p.unit,
            low95=None if interval is None else interval.low95,
            high95=None if interval is None else interval.high95,
            prior_low=p.prior_range[0],
            prior_high=p.prior_range[1],
            verdict=UNKNOWN if interval is None else interval.verdict,
            status=known.status,
            source=known.source,
            sampled95=sampled,
        )


@dataclass(frozen=True)
class FittedNuisance:
    """What the fit says of one part of the measurement.

    Attributes:
        value: Best value [unit].
        sd: Its standard deviation [unit].
        prior_sd: Standard deviation that the sensor leaves open [unit].
        unit: SI unit, - where there is none.
        outside: Whether the trace asks for more than three standard deviations of the sensor's.
    """

    value: float
    sd: float
    prior_sd: float
    unit: str
    outside: bool

    @classmethod
    def of(cls, estimate: NuisanceEstimate) -> FittedNuisance:
        """The estimate of a fit."""
        return cls(estimate.value, estimate.sd, estimate.prior_sd, estimate.unit, estimate.outside)
