"""Prony series: relaxation as a sum of exponentials, its moduli in oscillation, its stress under a strain in time.

Linear viscoelasticity (Ferry 1980, Viscoelastic Properties of Polymers, 3rd ed., chapters 1 and 3); the step in time
is exact for strains that are straight between samples (Taylor, Pister and Goudreau 1970, Int. J. Numer. Meth. Eng.
2:45-59).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import CurveError
from mpm.arrays import FloatArray


@dataclass(frozen=True)
class PronySeries:
    """A relaxing modulus over its instantaneous value.

    Attributes:
        shares: Share of each branch in the instantaneous modulus [-]; together at most 1.
        times: Relaxation time of each branch [s].
    """

    shares: tuple[float, ...]
    times: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the branches.

        Raises:
            CurveError: Shares or times are impossible.
        """
        if len(self.shares) != len(self.times):
            raise CurveError(f"a Prony series of {len(self.shares)} shares and {len(self.times)} times")
        if any(share < 0.0 for share in self.shares) or sum(self.shares) > 1.0 + 1e-12:
            raise CurveError(f"shares of a Prony series are none below 0 and together at most 1, not {self.shares}")
        if any(not time > 0.0 for time in self.times):
            raise CurveError(f"relaxation times are above 0 s, not {self.times}")

    @property
    def equilibrium(self) -> float:
        """What remains in the end, over the instantaneous modulus [-]."""
        return max(1.0 - sum(self.shares), 0.0)

    def relaxation(self, time: FloatArray) -> FloatArray:
        """Modulus over the instantaneous one at times after a step of strain [s]; shape (n,) [-]."""
        branches = [share * np.exp(-np.asarray(time) / tau) for share, tau in zip(self.shares, self.times, strict=True)]
        return self.equilibrium + np.sum(branches, axis=0) if branches else np.ones(len(time))

    def storage(self, frequency: FloatArray) -> FloatArray:
        """Storage modulus over the instantaneous one at angular frequencies [rad/s]; shape (n,) [-]."""
        out = np.full(len(frequency), self.equilibrium)
        for share, tau in zip(self.shares, self.times, strict=True):
            x = (frequency * tau) ** 2
            out = out + share * x / (1.0 + x)
        return out

    def loss(self, frequency: FloatArray) -> FloatArray:
        """Loss modulus over the instantaneous one at angular frequencies [rad/s]; shape (n,) [-]."""
        out = np.zeros(len(frequency))
        for share, tau in zip(self.shares, self.times, strict=True):
            x = frequency * tau
            out = out + share * x / (1.0 + x**2)
        return out

    def stress(self, time: FloatArray, elastic: FloatArray) -> FloatArray:
        """Stress that follows from the history of the instantaneous elastic stress.

        Args:
            time: Times, increasing [s], shape (n,).
            elastic: Instantaneous elastic stress at them [Pa], shape (n,); zero before the first.

        Returns:
            Stress [Pa], shape (n,).
        """
        out = self.equilibrium * elastic
        for share, tau in zip(self.shares, self.times, strict=True):
            out = out + share * branch(time, elastic, tau)
        return out


def branch(time: FloatArray, elastic: FloatArray, tau: float) -> FloatArray:
    """Stress of one branch of share 1: the integral of exp(-(t - s) / tau) over the rise of the elastic stress.

    Args:
        time: Times, increasing [s], shape (n,).
        elastic: Elastic stress at them [Pa], shape (n,); a step to the first value is taken at the first time.
        tau: Relaxation time [s].

    Returns:
        Stress [Pa], shape (n,).
    """
    step = np.diff(time) / tau
    decay, mean = np.exp(-step), -np.expm1(-step) / step
    rise = np.diff(elastic) * mean
    out = np.empty(len(time))
    out[0] = held = elastic[0]
    for k in range(len(step)):
        held = decay[k] * held + rise[k]
        out[k + 1] = held
    return out
