"""Parameters of a fit: value, hard bounds, literature prior and the coordinate the optimiser works in.

Stiffness-like quantities live over decades and are fitted by their logarithm; ``nu`` and ``mu`` linearly.
In that *internal* coordinate ``z`` the prior is normal, and its 95 % range is the range of the literature:

    mean = (z(prior_low) + z(prior_high)) / 2,    sd = (z(prior_high) - z(prior_low)) / (2 * 1.96)

The prior of several parameters is a normal one with these means and standard deviations. Two of them may be correlated
in it, as a stiff food is a strong one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from calib.errors import MaterialError
from calib.material.properties import OF_TRACE, property_of
from mpm.arrays import FloatArray
from mpm.scene.material import RESISTANCES

Scale = Literal["log", "linear"]

#: Half width of a normal distribution's central 95 % in standard deviations.
Z95 = 1.959963984540054

#: Width of a finite difference in a log coordinate: 10 %. An explicit solver repeats its curve to 0.5-1 %, so that a
#: parameter to which the force is proportional then moves it by ten times the noise; the truncation error of a forward
#: difference of a power law with an exponent below 1 stays under 1 % of the force.
LOG_STEP = math.log(1.1)

#: Width of a finite difference in a linear coordinate, as a part of the prior's 95 % range (same argument).
LINEAR_STEP = 0.1

#: Material properties with the dimension of a force per length or of a stress. Multiplying all of them by k multiplies
#: every quasi-static force by k and leaves the geometry of the cut alone.
STRESS_LIKE = ("E", "yield_stress", *RESISTANCES, "tensile_strength", "fracture_energy")


def parameter_of(name: str, owner: str) -> str:
    """Name of the parameter that a property is for one trace alone, or for the cuts of one knife.

    >>> parameter_of("R_skin", "cut2")
    'R_skin@cut2'
    """
    return f"{name}{OF_TRACE}{owner}"


def is_shared(name: str) -> bool:
    """Whether a parameter of this name is the same for all traces."""
    return OF_TRACE not in name


@dataclass(frozen=True)
class Parameter:
    """One fitted material property.

    Attributes:
        name: Property name as in ``materials.yaml``.
        value: Present value [unit], inside the hard bounds.
        low: Hard lower bound [unit]; never crossed.
        high: Hard upper bound [unit]; never crossed.
        unit: Unit of all values, for people.
        prior_low: Lower end of the literature's 95 % range [unit].
        prior_high: Upper end of the literature's 95 % range [unit].
        scale: ``log`` or ``linear``: the coordinate in which the prior is normal and the fit works.

    Raises:
        MaterialError: A number that is not finite, an empty interval, a value or prior centre outside the hard
            bounds, or a log parameter that is not positive.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str
    prior_low: float
    prior_high: float
    scale: Scale = "log"

    def __post_init__(self) -> None:
        numbers = (self.value, self.low, self.high, self.prior_low, self.prior_high)
        if not all(math.isfinite(x) for x in numbers):
            raise self._error(f"has a number that is not finite among {numbers}", "give finite numbers")
        if self.scale not in ("log", "linear"):
            raise self._error(f"has scale {self.scale!r}", "use 'log' or 'linear'")
        if self.scale == "log" and min(numbers) <= 0.0:
            raise self._error(f"is on a log scale but {min(numbers):g} is not positive", "use scale 'linear'")
        if not self.low < self.high:
            raise self._error(f"has bounds [{self.low:g}, {self.high:g}]", "give low < high")
        if not self.prior_low < self.prior_high:
            raise self._error(f"has the prior range [{self.prior_low:g}, {self.prior_high:g}]", "give low < high")
        centre = math.exp(self.prior_mean) if self.log else self.prior_mean
        for what, x in (("value", self.value), ("prior centre", centre)):
            if not self.low <= x <= self.high:
                raise self._error(
                    f"has its {what} {x:g} outside the bounds [{self.low:g}, {self.high:g}]",
                    "widen the bounds or correct it",
                )

    def _error(self, what: str, remedy: str) -> MaterialError:
        return MaterialError(f"parameter {self.name} [{self.unit}] {what}; {remedy}.")

    @property
    def log(self) -> bool:
        """Whether the parameter is fitted by its logarithm."""
        return self.scale == "log"

    @property
    def prior_mean(self) -> float:
        """Centre of the prior in the internal coordinate."""
        return 0.5 * (self.to_internal(self.prior_low) + self.to_internal(self.prior_high))

    @property
    def prior_sd(self) -> float:
        """Standard deviation of the prior in the internal coordinate."""
        return (self.to_internal(self.prior_high) - self.to_internal(self.prior_low)) / (2.0 * Z95)

    @property
    def prior_centre(self) -> float:
        """Centre of the prior [unit] (its median)."""
        return self.from_internal(self.prior_mean)

    @property
    def prior_range(self) -> tuple[float, float]:
        """The prior's 95 % range [unit] as far as it lies within the hard bounds."""
        return max(self.prior_low, self.low), min(self.prior_high, self.high)

    @property
    def step(self) -> float:
        """Width of a finite difference in the internal coordinate."""
        return LOG_STEP if self.log else LINEAR_STEP * (self.prior_high - self.prior_low)

    def to_internal(self, value: float) -> float:
        """Internal coordinate of a value [unit]: its logarithm on a log scale, else itself."""
        return math.log(value) if self.log else float(value)

    def from_internal(self, z: float) -> float:
        """Value [unit] at an internal coordinate, never beyond the hard bounds; inverts ``to_internal``."""
        low, high = self.to_internal(self.low), self.to_internal(self.high)
        if z <= low or z >= high:
            return self.low if z <= low else self.high
        return min(max(math.exp(z), self.low), self.high) if self.log else float(z)

    def round_trip_error(self, samples: int = 33) -> float:
        """Largest error of value -> internal -> value, relative to the larger bound [-]."""
        z = np.linspace(self.to_internal(self.low), self.to_internal(self.high), samples)
        there = [self.from_internal(x) for x in z]
        back = [self.from_internal(self.to_internal(x)) for x in there]
        return float(np.max(np.abs(np.subtract(there, back))) / max(abs(self.low), abs(self.high)))


def _kept(values: FloatArray) -> FloatArray:
    """An array that is kept, and so cannot be written to."""
    values.setflags(write=False)
    return values


@dataclass(frozen=True)
class PriorCorrelation:
    """What the literature says of two parameters together.

    Attributes:
        first: Name of the one parameter.
        second: Name of the other.
        value: Correlation of their internal coordinates in the prior [-].
    """

    first: str
    second: str
    value: float


@dataclass(frozen=True)
class ParameterSet:
    """The fitted parameters in a fixed order, as a vector in internal coordinates or as a dictionary [units].

    Attributes:
        items: The parameters; names must be unique and there must be at least one.
        correlations: Which of them are correlated in the prior; all others are independent.

    Raises:
        MaterialError: No parameter, a name given twice, or correlations that no prior has.
    """

    items: tuple[Parameter, ...]
    correlations: tuple[PriorCorrelation, ...] = ()

    def __post_init__(self) -> None:
        self._check_items()
        strangers = [n for c in self.correlations for n in (c.first, c.second) if n not in self.names]
        if strangers:
            raise MaterialError(f"{', '.join(strangers)} is correlated with another parameter and is none; add it.")
        if np.linalg.eigvalsh(self.prior_covariance / np.outer(self.prior_sd, self.prior_sd))[0] <= 0.0:
            raise MaterialError(f"no prior has the correlations {self.correlations}; give smaller ones.")

    def _check_items(self) -> None:
        object.__setattr__(self, "items", tuple(self.items))
        if not self.items:
            raise MaterialError("there is no parameter to fit; name at least one, for instance E.")
        twice = sorted({n for n in self.names if self.names.count(n) > 1})
        if twice:
            raise MaterialError(f"parameter {', '.join(twice)} is given more than once; name each parameter once.")

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.items)

    def __getitem__(self, name: str) -> Parameter:
        return self.items[self.names.index(name)]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in order, (p,)."""
        return tuple(p.name for p in self.items)

    @property
    def start(self) -> FloatArray:
        """Internal coordinates of the present values, (p,)."""
        return self.to_vector({p.name: p.value for p in self.items})

    @cached_property
    def lower(self) -> FloatArray:
        """Internal coordinates of the hard lower bounds, (p,)."""
        return _kept(np.array([p.to_internal(p.low) for p in self.items]))

    @cached_property
    def upper(self) -> FloatArray:
        """Internal coordinates of the hard upper bounds, (p,)."""
        return _kept(np.array([p.to_internal(p.high) for p in self.items]))

    @cached_property
    def prior_mean(self) -> FloatArray:
        """Prior centre in internal coordinates, (p,)."""
        return _kept(np.array([p.prior_mean for p in self.items]))

    @cached_property
    def prior_sd(self) -> FloatArray:
        """Prior standard deviation in internal coordinates, (p,)."""
        return _kept(np.array([p.prior_sd for p in self.items]))

    @cached_property
    def steps(self) -> FloatArray:
        """Finite-difference widths in internal coordinates, (p,)."""
        return _kept(np.array([p.step for p in self.items]))

    @cached_property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """The prior's 95 % box inside the hard bounds, in internal coordinates: two arrays (p,)."""
        reach = Z95 * self.prior_sd
        low = np.maximum(self.lower, self.prior_mean - reach)
        return _kept(low), _kept(np.minimum(self.upper, self.prior_mean + reach))

    def to_vector(self, values: Mapping[str, float]) -> FloatArray:
        """Internal coordinates (p,) of a mapping name -> value [unit].

        Raises:
            MaterialError: A fitted parameter is missing, or outside the domain of its scale.
        """
        missing = [n for n in self.names if n not in values]
        if missing:
            raise MaterialError(f"parameter {', '.join(missing)} has no value; give one for each of {self.names}.")
        bad = [p for p in self.items if p.log and not values[p.name] > 0.0]
        if bad:
            raise MaterialError(
                f"parameter {bad[0].name} = {values[bad[0].name]:g} {bad[0].unit} must be positive "
                "because it is fitted on a log scale; give a positive value."
            )
        return np.array([p.to_internal(values[p.name]) for p in self.items])

    def to_dict(self, z: Sequence[float] | FloatArray) -> dict[str, float]:
        """Values [unit] by name at internal coordinates ``z`` (p,)."""
        return {p.name: p.from_internal(float(x)) for p, x in zip(self.items, z, strict=True)}

    def clip(self, z: FloatArray) -> FloatArray:
        """The point (p,) of the hard bounds that is nearest to ``z`` (p,)."""
        return np.clip(z, self.lower, self.upper)

    @cached_property
    def prior_covariance(self) -> FloatArray:
        """Covariance of the prior in internal coordinates, (p, p)."""
        out = np.diag(self.prior_sd**2)
        for c in self.correlations:
            i, j = self.names.index(c.first), self.names.index(c.second)
            out[i, j] = out[j, i] = c.value * self.prior_sd[i] * self.prior_sd[j]
        return _kept(out)

    @cached_property
    def prior_root(self) -> FloatArray:
        """Lower triangle (p, p) whose product with its transpose is the covariance of the prior."""
        return _kept(np.asarray(np.linalg.cholesky(self.prior_covariance), dtype=np.float64))

    def prior_residual(self, z: FloatArray) -> FloatArray:
        """Distance from the prior centre in prior standard deviations, each after those before it: (p,) of a point
        (p,), (q, p) of many. The sum of its squares is the prior's chi-square."""
        out = z - self.prior_mean
        for i, row in enumerate(self.prior_root):
            for j in np.flatnonzero(row[:i]):
                out[..., i] -= row[j] * out[..., j]
            out[..., i] /= row[i]
        return out

    def prior_jacobian(self) -> FloatArray:
        """Derivative of :meth:`prior_residual`, (p, p): a lower triangle, diagonal where nothing is correlated."""
        return np.asarray(np.linalg.inv(self.prior_root), dtype=np.float64)

    def from_steps(self, steps: FloatArray) -> FloatArray:
        """Internal coordinates, (p,) or (q, p), of independent steps in prior standard deviations from the prior's
        centre, of the same shape; the nearest ones within the hard bounds.

        The sums are made one by one: a matrix product rounds otherwise with other points beside it.
        """
        out = np.empty(np.shape(steps))
        for i, row in enumerate(self.prior_root):
            out[..., i] = self.prior_mean[i] + sum(row[j] * steps[..., j] for j in np.flatnonzero(row))
        return self.clip(out)

    def in_box(self, cube: FloatArray) -> FloatArray:
        """Points that fill the prior's 95 % box evenly, which is sheared where parameters are correlated.

        Args:
            cube: Places in the box along each parameter, from 0 to 1, (p,) or (q, p).

        Returns:
            Internal coordinates, of the same shape.
        """
        low, high = self.box
        return self.from_steps((low + (high - low) * cube - self.prior_mean) / self.prior_sd)

    def from_cube(self, cube: FloatArray) -> FloatArray:
        """Draws from the prior between the hard bounds.

        Args:
            cube: Uniform numbers between 0 and 1, (p,) or (q, p).

        Returns:
            Internal coordinates, of the same shape.
        """
        root, steps = self.prior_root, np.zeros(np.shape(cube))
        for i in range(len(self)):
            shift = self.prior_mean[i] + sum(root[i, j] * steps[..., j] for j in np.flatnonzero(root[i, :i]))
            low, high = (ndtr((end - shift) / root[i, i]) for end in (self.lower[i], self.upper[i]))
            steps[..., i] = ndtri(low + (high - low) * cube[..., i])
        return self.from_steps(steps)

    def only(self, names: Sequence[str]) -> ParameterSet:
        """The parameters of these names alone, with what the prior says of them."""
        kept = tuple(c for c in self.correlations if c.first in names and c.second in names)
        return ParameterSet(tuple(p for p in self.items if p.name in names), kept)

    def stress_like(self, names: Sequence[str] = STRESS_LIKE) -> FloatArray:
        """Direction (p,) of a joint scaling of the stress-like parameters: 1 for each on a log scale."""
        return np.array([1.0 if p.log and property_of(p.name) in names else 0.0 for p in self.items])

    def with_values(self, values: Mapping[str, float]) -> ParameterSet:
        """The same parameters with other present values [unit]; names not mentioned keep theirs."""
        items = tuple(replace(p, value=float(values.get(p.name, p.value))) for p in self.items)
        return ParameterSet(items, self.correlations)
