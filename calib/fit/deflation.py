"""Parameters whose prior sends a search away from a food that is known (deflation: Farrell et al. 2015, SIAM J. Sci.
Comput. 37:A2026)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.problem.parameters import ParameterSet
from mpm.arrays import FloatArray

DEFLATION = 10.0
"""Residual in the middle of what is deflated [standard deviations]."""
TELLING = ("E", "R")
"""What is deflated of a food: the first of these parameters that is fitted, or the first at all, as far about its value
as its prior's standard deviation. Foods that draw one curve differ in stiffness before all else."""


@dataclass(frozen=True)
class DeflatedParameterSet(ParameterSet):
    """Parameters whose prior has a row more: how deep a point lies within all claimed intervals at once.

    Attributes:
        claims: Place of each claimed parameter among the items, and the middle and the half width of what is deflated
            of it, in internal coordinates.
    """

    claims: tuple[tuple[int, float, float], ...] = ()

    def prior_residual(self, z: FloatArray) -> FloatArray:
        """That of the parameters, and the depth: (p + 1,) of a point (p,), (q, p + 1) of many."""
        depth = [1.0 - np.abs(z[..., place] - middle) / half for place, middle, half in self.claims]
        row = DEFLATION * np.maximum(np.min(depth, axis=0), 0.0)
        return np.concatenate([super().prior_residual(z), row[..., None]], axis=-1)


def telling(parameters: ParameterSet) -> int:
    """Place of the parameter in which foods that draw one curve differ: the first of :data:`TELLING`, or the first."""
    return next((parameters.names.index(name) for name in TELLING if name in parameters.names), 0)


def deflated_about(parameters: ParameterSet, z: FloatArray) -> DeflatedParameterSet:
    """The parameters with the food at a point (p,) deflated."""
    place = telling(parameters)
    claim = (place, float(z[place]), float(parameters.prior_sd[place]))
    return DeflatedParameterSet(parameters.items, parameters.correlations, (claim,))
