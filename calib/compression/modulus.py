"""Young's modulus of measured repeats from a unit curve, and what it hangs on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from calib.compression.measured import MeasuredCompression, slope
from calib.compression.press import homogeneous, largest_error
from calib.io.type_schema import Positive
from mpm.arrays import FloatArray

NU_STEP = 0.05
"""Change of Poisson's ratio whose effect on the modulus is reported [-]."""
NU_TOP = 0.499
"""Largest Poisson's ratio of the closed form [-]."""


@dataclass(frozen=True)
class ModulusFit:
    """Young's modulus and how well its curve fits.

    Attributes:
        E: Modulus of each repeat [Pa], shape (repeats,).
        mean: Mean modulus [Pa].
        sd: Standard deviation between the repeats [Pa], NaN for one.
        low: Lower end of the 95 % interval of the mean (Student's t) [Pa], NaN for one repeat.
        high: Its upper end [Pa].
        stress: Fitted stress [Pa], shape (n,).
        slope: Its slope over 0 to 5 % strain [Pa].
        slope_error: That slope over the measured one, less 1 [-].
        nrmse: Root mean square of the difference from the mean measured stress over the largest of that [-].
        force_error: Largest relative error of the force beyond 2 % strain, with its sign [-].
        force_error_at: Strain where it is [-].
    """

    E: FloatArray
    mean: float
    sd: float
    low: float
    high: float
    stress: FloatArray
    slope: float
    slope_error: float
    nrmse: float
    force_error: float
    force_error_at: float


def scaled_modulus(unit: FloatArray, stress: FloatArray) -> FloatArray:
    """Least-squares modulus of one or several stresses, shapes (n,) and (..., n) [Pa]."""
    return stress @ unit / (unit @ unit)


def fit_modulus(measured: MeasuredCompression, unit: FloatArray) -> ModulusFit:
    """Fit Young's modulus to each repeat.

    Args:
        measured: The repeats.
        unit: Stress over Young's modulus [-] at their strains, shape (n,).

    Returns:
        The fit.
    """
    moduli = scaled_modulus(unit, measured.stress)
    n, mean = len(moduli), float(moduli.mean())
    sd = float(moduli.std(ddof=1)) if n > 1 else math.nan
    half = float(student.ppf(0.975, n - 1)) * sd / math.sqrt(n) if n > 1 else math.nan
    fitted, want = mean * unit, measured.mean
    error, at = largest_error(measured.strain, fitted, want)
    small = slope(measured.strain, fitted)
    return ModulusFit(
        E=moduli,
        mean=mean,
        sd=sd,
        low=mean - half,
        high=mean + half,
        stress=fitted,
        slope=small,
        slope_error=small / float(measured.slope.mean()) - 1,
        nrmse=float(np.sqrt(np.mean((fitted - want) ** 2)) / want.max()),
        force_error=error,
        force_error_at=at,
    )


@dataclass(frozen=True)
class ModulusAtNu:
    """Young's modulus [Pa] that the same curve gives at another Poisson's ratio [-].

    Attributes:
        nu: Poisson's ratio.
        E_Pa: Modulus [Pa].
    """

    nu: float
    E_Pa: Positive


def modulus_at_other_nu(measured: MeasuredCompression, nu: float, modulus: float) -> tuple[ModulusAtNu, ModulusAtNu]:
    """Modulus that the same curve gives at other Poisson's ratios, between frictionless plates, by the closed form.

    Args:
        measured: The repeats.
        nu: Poisson's ratio of the fit [-].
        modulus: Fitted modulus [Pa].

    Returns:
        The moduli below and above.
    """
    base = float(scaled_modulus(homogeneous(nu, measured.strain), measured.mean))

    def refitted(other: float) -> ModulusAtNu:
        again = float(scaled_modulus(homogeneous(other, measured.strain), measured.mean))
        return ModulusAtNu(other, modulus * again / base)

    return refitted(nu - NU_STEP), refitted(min(nu + NU_STEP, NU_TOP))
