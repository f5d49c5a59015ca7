"""What a simulation is compared with: the conditioned real curve, and how far a right model may be from it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib.errors import TraceError
from mpm.arrays import FloatArray

#: Smooths a simulated record like the real one was: (grid [m] (n,), stroke [m] (k,), force [N] (k,)) -> force [N] (n,).
Smoother = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]

#: Model discrepancy as a part of the peak [-]: no more than simpler curves fitted to single cuts leave
#: (docs/theory.md, "Measured choices").
DISCREPANCY = 0.03

#: Correlation length of that discrepancy as a part of the stroke [-]: a structural misfit (a peak of the skin, a
#: slope, a plateau) extends over about a twentieth of a cut, so that at most 20 of the grid points count as
#: independent.
CORRELATION = 0.05

#: Tolerance of the peak, as a part of it [-], so that an error of 5 % (the limit of a passed calibration) costs 2.5
#: standard deviations.
PEAK = 0.02


@dataclass(frozen=True)
class ErrorModel:
    """How far a right model may be from the trace; see the constants of this module for the reasons.

    Attributes:
        discrepancy: Model discrepancy along the curve, part of the real peak [-].
        correlation: Correlation length of the residuals, part of the stroke [-], at most 1.
        peak: Tolerance of the peak force, part of the real peak [-].
    """

    discrepancy: float = DISCREPANCY
    correlation: float = CORRELATION
    peak: float = PEAK

    def __post_init__(self) -> None:
        if not (self.discrepancy > 0.0 and self.peak > 0.0 and 0.0 < self.correlation <= 1.0):
            raise TraceError(
                f"error model {self} needs discrepancy > 0, peak > 0 and 0 < correlation <= 1; "
                "give parts of the peak and of the stroke, for instance 0.03."
            )


@dataclass(frozen=True)
class Target:
    """The conditioned real curve that a simulation is compared with.

    Attributes:
        stroke: Uniform stroke grid from 0 [m] (n,).
        curve: Smoothed real force [N] (n,).
        noise_sd: Standard deviation of the noise of ``curve`` [N].
        peak_sd: Standard deviation of its peak [N].
        smooth: Puts a raw simulated record on given strokes, smoothed like ``curve``.
        u_num: Numerical standard uncertainty of the simulated curve [N], one for all or (n,).

    Raises:
        TraceError: A curve that is not finite, not matching its grid, or without a positive peak.
    """

    stroke: FloatArray
    curve: FloatArray
    noise_sd: float
    peak_sd: float
    smooth: Smoother
    u_num: float | FloatArray = 0.0

    def __post_init__(self) -> None:
        if self.stroke.ndim != 1 or self.stroke.shape != self.curve.shape or self.stroke.size < 2:
            raise TraceError(
                f"target has {self.stroke.shape} strokes and {self.curve.shape} forces; give two "
                "vectors of equal length, at least 2."
            )
        if not (np.isfinite(self.curve).all() and np.all(np.diff(self.stroke) > 0.0)):
            raise TraceError("target has forces that are not finite or strokes that do not rise; condition it first.")
        if not self.peak > 0.0:
            raise TraceError(f"target has the peak {self.peak:g} N; it must be positive, check the sign of the force.")
        if not (0.0 <= self.noise_sd < math.inf and 0.0 <= self.peak_sd < math.inf):
            raise TraceError(
                f"target has noise_sd {self.noise_sd:g} N and peak_sd {self.peak_sd:g} N; "
                "give finite values that are not negative."
            )

    @property
    def peak(self) -> float:
        """Largest force of the real curve [N]."""
        return float(self.curve.max())

    @property
    def length(self) -> float:
        """Length of the stroke [m]."""
        return float(self.stroke[-1] - self.stroke[0])
