"""A law fitted to the mean bites of several speeds, and the speeds that it predicts without having seen them.

Specimens of one food scatter in stiffness, those of one batch together. So the mean of a group has a factor of its
own, whose logarithm has the standard deviation of the mean of its peaks; a prediction has none. The shape of a bite is
fitted to 5 % of its peak, as if a bite had three independent samples: what a law does not have is the same along much
of a curve.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from calib.errors import CurveError
from calib.texture.bite_path import BitePath
from calib.texture.quasi_linear import QuasiLinearLaw, stresses
from mpm.arrays import FloatArray

INADEQUACY = 0.05
"""Part of the peak to which a law is expected to follow a mean bite [-]."""
SAMPLES = 6.0
"""Independent samples of a curve of two bites [-]."""
LEAST_FACTOR_SD = 0.05
"""Least standard deviation of the logarithm of a group's factor [-]: that of a caliper and a load cell."""
PARAMETERS = ("E_Pa", "stiffening", "equilibrium", "power", "damage")
LOW = np.array([3.0, 0.1, -8.0, -1.0, -5.0])
HIGH = np.array([25.0, 25.0, 6.0, 2.0, 4.0])
"""Bounds of the parameters as they are searched: logarithm, number, logit, number, logit."""
STEPS = 80  # of a search
STEP = 1e-5  # of a parameter, for the slope of a residual


@dataclass(frozen=True, eq=False)
class SpeedGroup:
    """Bites of repeats of one direction at one speed.

    Attributes:
        name: Its name.
        path: Way of the plate.
        stress: Engineering stress of each repeat at the times of the path [Pa], shape (repeats, n).
    """

    name: str
    path: BitePath
    stress: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean of the repeats [Pa], shape (n,)."""
        return np.asarray(self.stress.mean(axis=0))

    @property
    def factor_sd(self) -> float:
        """Standard deviation of the logarithm of the mean peak [-]."""
        peaks = self.stress.max(axis=1)
        if len(peaks) < 2:
            return 1.0
        return max(float(peaks.std(ddof=1) / peaks.mean()) / math.sqrt(len(peaks)), LEAST_FACTOR_SD)


@dataclass(frozen=True)
class LawFit:
    """A law, fitted.

    Attributes:
        law: The law.
        low: Law at the lower ends of the 95 % intervals of its parameters.
        high: That at the upper ends.
        factors: Factor of each group [-].
        bic: Bayesian information criterion.
    """

    law: QuasiLinearLaw
    low: tuple[float, ...]
    high: tuple[float, ...]
    factors: tuple[float, ...]
    bic: float


def fit_law(groups: Sequence[SpeedGroup], *, damaged: bool) -> LawFit:
    """The law of these groups.

    Args:
        groups: Groups of one direction, of two speeds or more.
        damaged: Whether the law has damage.

    Returns:
        The fit.

    Raises:
        CurveError: There is one speed alone, of which a law of rate tells nothing.
    """
    if len(groups) < 2:
        raise CurveError("a law of rate needs bites of two speeds or more; one speed does not tell stiffness from rate")
    free = np.array([True, True, True, True, damaged])
    count, m = int(free.sum()), len(groups)
    scale = np.array([1.0 / (INADEQUACY * group.mean.max()) for group in groups])[:, None]
    scale = scale * math.sqrt(SAMPLES / groups[0].stress.shape[1])
    means = np.stack([group.mean for group in groups])
    time, strain = (np.stack(each) for each in zip(*(group.path.history() for group in groups), strict=True))
    sds = np.array([group.factor_sd for group in groups])

    def curves(several: Sequence[FloatArray]) -> FloatArray:
        """Stress of the groups under the laws of several parameter vectors [Pa], (vectors, groups, n)."""
        laws = [_law(x[:count], free) for x in several for _ in groups]
        found = stresses(laws, np.tile(time, (len(several), 1)), np.tile(strain, (len(several), 1)))
        return found.reshape(len(several), m, -1)

    def residual_of(x: FloatArray) -> FloatArray:
        found = np.exp(x[count:])[:, None] * curves([x])[0]
        return np.concatenate([x[count:] / sds, ((found - means) * scale).ravel()])

    def jacobian_of(x: FloatArray) -> FloatArray:
        moved = [x, *(x + STEP * np.eye(len(x))[k] for k in range(count))]
        base, *others = np.exp(x[count:])[:, None] * curves(moved) * scale
        out = np.zeros((m + base.size, count + m))
        out[:m, count:] = np.diag(1.0 / sds)
        out[m:, :count] = np.stack([((other - base) / STEP).ravel() for other in others], axis=1)
        for k in range(m):
            out[m + k * base.shape[1] : m + (k + 1) * base.shape[1], count + k] = base[k]
        return out

    top = float(np.median([group.mean.max() for group in groups]))
    start = np.array([math.log(5.0 * top), 5.0, -2.0, 0.3, -1.0])
    bounds = tuple(np.concatenate([end[free], np.full(m, side)]) for end, side in ((LOW, -3.0), (HIGH, 3.0)))
    begin = np.concatenate([start[free], np.zeros(m)])
    found = least_squares(residual_of, begin, jacobian_of, bounds=bounds, max_nfev=STEPS, ftol=1e-6)
    samples = SAMPLES * m
    sd = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac, rcond=1e-12)))[:count]
    ends = [_law(np.clip(found.x[:count] + side * sd, LOW[free], HIGH[free]), free) for side in (-1.959964, 1.959964)]
    low, high = (tuple(float(getattr(law, name)) for name in PARAMETERS) for law in ends)
    bic = 2.0 * float(found.cost) + count * math.log(samples)
    return LawFit(_law(found.x[:count], free), low, high, tuple(np.exp(found.x[count:]).tolist()), bic)


def _law(x: FloatArray, free: np.ndarray) -> QuasiLinearLaw:
    """The law of parameters as they are searched; without damage where that is not free."""
    full = np.full(len(free), -math.inf)
    full[free] = x
    equilibrium = 1.0 / (1.0 + math.exp(-full[2]))
    damage = 1.0 / (1.0 + math.exp(-full[4])) if free[4] else 0.0
    return QuasiLinearLaw(math.exp(full[0]), float(full[1]), equilibrium, float(full[3]), damage)
