"""What a measurement leaves open of its own curve: tare, drift, lag, bandwidth and gain, each to a standard deviation.

To first order each of them moves the measured curve along one known shape g. Its size is normal about zero with a
standard deviation of its own, so that it joins the covariance of the residuals (Kennedy & O'Hagan 2001, J. R. Statist.
Soc. B 63:425, section 4; for the offset and the gain of a sensor this is the marginal likelihood of a linear Gaussian
model, Rasmussen & Williams 2006, section 2.7):

    V = diag(sigma^2) + sum_k sd_k^2 g_k g_k^T

    ======  =========================================================
    tare    1
    drift   s / L: 0 at contact, 1 at the end of the stroke
    lag     -dF/ds
    bandwidth  dF/d(ln f): of a low-pass of cut-off f that the force went through
    gain    F
    width   F: that of the specimen, where nobody measured it
    ======  =========================================================

Tare, drift, lag and bandwidth are integrated out of the curve while the search runs: an onset found 0.3 mm late costs
the right material a chi-square of hundreds where the model is right to 1 %, and the search would go elsewhere for it.
The headline figures use none of them: they compare the trace with the simulation as the sensor would have felt it, its
low-pass at the stated cut-off. So does the peak in the search: a drift widens its tolerance and cannot explain it away.
Gain and width only scale a curve, as the stress-like parameters do: the search leaves them at their likely values, and
they widen the intervals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.trace.conditioning import Conditioned
from calib.trace.filters import BandLimited, delay_of
from calib.trace.names import from_joint_torques
from mpm.arrays import FloatArray

#: Relative standard deviation of the gain of a calibrated force sensor, where nothing is said of it [-]. Assumed: no
#: source was found that holds for all; give --gain-sd from the sensor's own calibration.
GAIN_SD = 0.02
#: The same for a wrench that a robot estimates from its joint torques [-] (docs/theory.md, "Measured choices").
TORQUE_GAIN_SD = 0.15
#: A drift is extrapolated over the cut. Beyond this part of the peak [-] it is a broken measurement, which is warned of
#: and not fitted away.
LARGEST_DRIFT = 0.05
#: A size that is this many standard deviations of its prior away contradicts it.
OUTSIDE = 3.0
LATE_SPREAD = 0.5
"""Standard deviation of how late contact is found behind a low-pass, over the delay of it [-]: made-up rises in a line,
with the power 1.5 and in a parabola are found 0.2 to 1.7 delays late (docs/theory.md, "Measured choices")."""
TORQUE_BANDWIDTH, TORQUE_BANDWIDTH_SPREAD = 15.0, 0.35
"""Cut-off of the low-pass that such a wrench goes through [Hz], and the standard deviation of its logarithm, a factor
of two at 95 % [-]: above it the noise of an arm that cuts air falls by 40 dB a decade (docs/theory.md, "Measured
choices")."""


@dataclass(frozen=True)
class Sensor:
    """What is known of a force sensor.

    Attributes:
        gain_sd: Relative standard deviation of its gain [-].
        lag_sd: Standard deviation of the delay between its force and its position or clock [s].
        bandwidth: Cut-off of the low-pass that its force went through [Hz]; infinite for none.
        bandwidth_sd: Standard deviation of the logarithm of that [-].

    Raises:
        TraceError: A negative or infinite one, or a gain that is not known to a factor.
    """

    gain_sd: float = GAIN_SD
    lag_sd: float = 0.0
    bandwidth: float = math.inf
    bandwidth_sd: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.gain_sd < 1.0:
            raise TraceError(f"--gain-sd {self.gain_sd:g}: give the relative uncertainty of the sensor's gain, 0 to 1")
        if not 0.0 <= self.lag_sd < 1.0:
            raise TraceError(f"--lag-sd {self.lag_sd:g} s: give the uncertainty of the sensor's delay, 0 to 1 s")


def sensor_of(
    curve: Conditioned, gain_sd: float | None, lag_sd: float | None, bandwidth: float | None = None
) -> tuple[Sensor, tuple[str, ...]]:
    """The sensor of a trace, by the name of its force column where nothing is given, and what was assumed.

    Args:
        curve: The conditioned trace.
        gain_sd: Given relative standard deviation of the gain [-], or None.
        lag_sd: Given standard deviation of the delay [s], or None.
        bandwidth: Given cut-off of the low-pass that the force went through [Hz], or None.

    Returns:
        The sensor, and what was assumed of it, one sentence each.

    Raises:
        TraceError: Impossible values.
    """
    column = curve.trace.columns.get("force", "")
    torques, said = from_joint_torques(column), []
    if gain_sd is None and torques:
        said.append(
            f"{column} is estimated from joint torques: its gain is taken as known to {TORQUE_GAIN_SD:.0%} (hung "
            "masses read 1 to 25 % too little on such an arm); give --gain-sd if you measured it"
        )
    if bandwidth is None and torques:
        said.append(
            f"{column} is estimated from joint torques and filtered: the simulated force goes through a low-pass of "
            f"{TORQUE_BANDWIDTH:g} Hz, known to a factor of two; give --bandwidth if you know it"
        )
    usual = Sensor(TORQUE_GAIN_SD, 0.0, TORQUE_BANDWIDTH, TORQUE_BANDWIDTH_SPREAD) if torques else Sensor()
    sensor = replace(
        usual,
        gain_sd=usual.gain_sd if gain_sd is None else gain_sd,
        lag_sd=usual.lag_sd if lag_sd is None else lag_sd,
        bandwidth=usual.bandwidth if bandwidth is None else bandwidth,
        bandwidth_sd=usual.bandwidth_sd if bandwidth is None else 0.0,
    )
    return sensor, tuple(said)


@dataclass(frozen=True, eq=False)
class Nuisance:
    """One thing that the measurement leaves open.

    Attributes:
        name: ``tare``, ``drift``, ``lag``, ``bandwidth``, ``gain`` or ``width``.
        unit: Unit of its size.
        sd: Prior standard deviation [unit]; the prior mean is zero.
        shape: Change of the measured curve by one unit [N/unit] (n,).
        peak: Change of the measured peak by one unit [N/unit], 0 where the peak's own standard deviation has it.
        searched: Whether the search integrates it out of the curve.
    """

    name: str
    unit: str
    sd: float
    shape: FloatArray
    peak: float
    searched: bool


@dataclass(frozen=True)
class NuisanceEstimate:
    """What a fitted curve says of a nuisance: its posterior beside its prior.

    Attributes:
        name: Which it is.
        unit: Unit of its size.
        prior_sd: Prior standard deviation [unit].
        value: Posterior mean [unit].
        sd: Posterior standard deviation [unit].
    """

    name: str
    unit: str
    prior_sd: float
    value: float
    sd: float

    @property
    def outside(self) -> bool:
        """Whether it contradicts its prior."""
        return abs(self.value) > OUTSIDE * self.prior_sd

    def as_dict(self) -> dict[str, float | str | bool]:
        """Plain data."""
        return {
            "value": self.value,
            "sd": self.sd,
            "prior_sd": self.prior_sd,
            "unit": self.unit,
            "outside": self.outside,
        }


def real_speed(curve: Conditioned) -> float:
    """Mean real speed of the knife in a cut, its way over its time [m/s]."""
    return curve.stroke_length_m / (curve.end_s - curve.onset_s)


def nuisances(
    curve: Conditioned, sensor: Sensor, *, width_sd: float = 0.0, scaled: bool = False
) -> tuple[Nuisance, ...]:
    """What the measurement of a curve leaves open.

    Args:
        curve: The conditioned trace.
        sensor: Its sensor.
        width_sd: Relative standard deviation of the specimen's width [-], 0 where it was measured.
        scaled: Whether gain and width are one factor that the objective has (``scale_sd``), as where specimens share
            their flesh.

    Returns:
        The nuisances whose standard deviation is not zero.
    """
    length, speed = curve.stroke_length_m, real_speed(curve)
    peak = float(curve.curve.max())
    drift = min(float(np.hypot(curve.drift_N_per_s, curve.drift_sd_N_per_s)) * length / speed, LARGEST_DRIFT * peak)
    late = LATE_SPREAD * delay_of(sensor.bandwidth)
    lag = math.hypot(curve.onset_sd_s, sensor.lag_sd, late) * speed
    sizes = {"tare": curve.baseline_sd_N, "drift": drift, "lag": lag}
    if not scaled:
        sizes |= {"gain": sensor.gain_sd, "width": width_sd}
    found = nuisances_of_size(curve.stroke, curve.curve, sizes)
    if not (sensor.bandwidth_sd > 0.0 and math.isfinite(sensor.bandwidth)):
        return found
    shape = _by_bandwidth(curve, sensor.bandwidth)
    at_peak = float(shape[int(curve.curve.argmax())])
    return (*found, Nuisance("bandwidth", "-", sensor.bandwidth_sd, shape, at_peak, True))


def _by_bandwidth(curve: Conditioned, bandwidth: float) -> FloatArray:
    """Change of a curve by the logarithm of the cut-off that it goes through [N], (n,); that of the measured one."""
    low, high = (
        BandLimited(bandwidth * math.exp(h), curve.stroke, curve.clock)(curve.stroke, curve.stroke, curve.curve)
        for h in (-TORQUE_BANDWIDTH_SPREAD, TORQUE_BANDWIDTH_SPREAD)
    )
    return (high - low) / (2.0 * TORQUE_BANDWIDTH_SPREAD)


def nuisances_of_size(stroke: FloatArray, curve: FloatArray, sizes: Mapping[str, float]) -> tuple[Nuisance, ...]:
    """What a measurement leaves open of a curve, where its sizes are known.

    Args:
        stroke: Stroke from contact [m], shape (n,).
        curve: Force on it [N], shape (n,).
        sizes: Prior standard deviations [unit] of ``tare``, ``drift``, ``lag``, ``gain`` and ``width``, by name.

    Returns:
        The nuisances whose standard deviation is not zero, in the order of their sizes.
    """
    peak = float(curve.max())
    top = float(stroke[int(curve.argmax())] / stroke[-1])
    known = {
        "tare": ("N", np.ones_like(curve), 0.0, True),
        "drift": ("N", stroke / stroke[-1], top, True),
        "lag": ("m", -np.gradient(curve, stroke), 0.0, True),
        "gain": ("-", curve, peak, False),
        "width": ("-", curve, peak, False),
    }
    out = []
    for name, sd in sizes.items():
        unit, shape, of_peak, searched = known[name]
        if sd > 0.0:
            out.append(Nuisance(name, unit, sd, shape, of_peak, searched))
    return tuple(out)


class Whitening:
    """Turns residuals of unit variance, which nuisances correlate, into independent ones of unit variance.

    With the columns G of one prior standard deviation of each nuisance, V = 1 + G G^T = 1 + U S^2 U^T, and
    V^(-1/2) = 1 - U (1 - (1 + S^2)^(-1/2)) U^T.

    Args:
        columns: Residual by one prior standard deviation of each nuisance (n, k).
    """

    def __init__(self, columns: FloatArray) -> None:
        self._u, size, _ = np.linalg.svd(columns, full_matrices=False)
        self._part = 1.0 - 1.0 / np.sqrt(1.0 + size**2)

    def __call__(self, rows: FloatArray) -> FloatArray:
        """V^(-1/2) times residuals (n,) or columns of them (n, m)."""
        out: FloatArray = rows - self._u @ ((self._part * (self._u.T @ rows).T).T)
        return out


def estimate_nuisances(
    given: Sequence[Nuisance], columns: FloatArray, rows: FloatArray
) -> tuple[NuisanceEstimate, ...]:
    """Posterior of each nuisance given the residuals of a simulated curve.

    Args:
        given: The nuisances.
        columns: Residual (simulated less measured) by one prior standard deviation of each (n, k), in standard
            deviations [-].
        rows: The residuals (n,), in standard deviations [-].

    Returns:
        An estimate for each nuisance, in their order.
    """
    if not given:
        return ()
    covariance = np.linalg.inv(columns.T @ columns + np.eye(len(given)))
    mean = covariance @ (columns.T @ rows)
    sd = np.sqrt(np.diag(covariance))
    return tuple(
        NuisanceEstimate(n.name, n.unit, n.sd, float(m) * n.sd, float(s) * n.sd)
        for n, m, s in zip(given, mean, sd, strict=True)
    )
