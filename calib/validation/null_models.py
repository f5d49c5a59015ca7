"""Curves that explain nothing, rated like a simulation: a model that does not beat them has shown nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from calib.errors import CurveError
from calib.validation.metrics import Metrics, compare

BUMP_STARTS = (0.05, 0.15, 0.3)
"""Centres of the skin bump over the stroke from which the three-term fit starts, beside the peak's
position [-]."""
DEPTH_STARTS = (0.15, 0.5, 0.9)
"""Depths at which the face term stops growing, over the stroke, from which the fit starts [-]."""
LOWER = np.array([0.0, 2e-3, 0.0, 0.0, 1e-2, 0.0, 2e-2])
UPPER = np.array([3.0, 1.0, 3.0, 1.0, 0.3, 3.0, 1.0])
"""Bounds of the seven numbers with force over the peak and stroke over its length: A, d, B, c, w, face,
depth."""
MAX_EVALUATIONS = 200
"""Most evaluations of one start; the curve has seven numbers and converges in a few tens."""


@dataclass(frozen=True)
class NullModel:
    """A null curve and its comparison with the measured one.

    Attributes:
        name: ``ramp``, ``half_sine`` or ``three_term``.
        curve: Force on the stroke grid [N], shape (n,).
        metrics: Comparison with the measured curve.
        parameters: Numbers of the curve by name, with the unit in the name.
    """

    name: str
    curve: np.ndarray
    metrics: Metrics
    parameters: dict[str, float]


def null_models(stroke: np.ndarray, real: np.ndarray) -> dict[str, NullModel]:
    """The null curves of a measured curve.

    ``ramp`` is the straight line from zero at contact to the measured peak at the end of the stroke: a linear
    spring. ``half_sine`` is half a sine period over the stroke with the measured peak as its height. Both
    know one number. ``three_term`` is a description with seven numbers fitted to the curve by least squares,
    see three_term.

    Args:
        stroke: Stroke from contact, strictly increasing [m], shape (n,).
        real: Measured force [N], shape (n,).

    Returns:
        The models by name.

    Raises:
        CurveError: As metrics.compare.
    """
    compare(stroke, real, real)
    peak = float(np.max(real))
    x = (stroke - stroke[0]) / (stroke[-1] - stroke[0])
    numbers = fit_three_term(stroke, real)
    curves = {
        "ramp": (peak * x, {"peak_N": peak}),
        "half_sine": (peak * np.sin(np.pi * x), {"peak_N": peak}),
        "three_term": (three_term(stroke - stroke[0], **numbers), numbers),
    }
    return {name: NullModel(name, curve, compare(stroke, real, curve), p) for name, (curve, p) in curves.items()}


def three_term(
    stroke: np.ndarray,
    edge_N: float,
    rise_m: float,
    skin_N: float,
    skin_centre_m: float,
    skin_width_m: float,
    face_N_per_m: float,
    face_depth_m: float,
) -> np.ndarray:
    """Descriptive cutting curve: edge term, skin bump, and a face term that grows to a depth [N].

    F(s) = edge (1 - exp(-s/rise)) + skin exp(-((s - centre)/width)^2 / 2) + face min(s, depth).

    >>> float(three_term(np.array([0.01]), 5.0, 1e-9, 0.0, 0.0, 1e-3, 100.0, 0.005)[0])
    5.5
    """
    edge = edge_N * (1.0 - np.exp(-stroke / rise_m))
    skin = skin_N * np.exp(-0.5 * ((stroke - skin_centre_m) / skin_width_m) ** 2)
    return np.asarray(edge + skin + face_N_per_m * np.minimum(stroke, face_depth_m))


def fit_three_term(stroke: np.ndarray, real: np.ndarray) -> dict[str, float]:
    """Fit the three-term curve by bounded least squares from a few fixed starts.

    Args:
        stroke: Stroke, strictly increasing [m], shape (n,).
        real: Measured force with a positive peak [N], shape (n,).

    Returns:
        The seven arguments of three_term by name.

    Raises:
        CurveError: No start converged to a finite curve.
    """
    length, peak = float(stroke[-1] - stroke[0]), float(np.max(real))
    x, y = (stroke - stroke[0]) / length, real / peak

    def residual(p: np.ndarray) -> np.ndarray:
        return three_term(x, *p) - y

    best, least = None, np.inf
    for centre in (float(x[np.argmax(y)]), *BUMP_STARTS):
        for depth in DEPTH_STARTS:
            start = np.clip([0.3, 0.05, 0.3, centre, 0.05, 0.4 / depth, depth], LOWER + 1e-6, UPPER - 1e-6)
            found = least_squares(residual, start, bounds=(LOWER, UPPER), max_nfev=MAX_EVALUATIONS)
            if found.cost < least:
                best, least = found.x, found.cost
    if best is None:
        raise CurveError("the three-term curve could not be fitted: the measured curve is not finite")
    scale = np.array([peak, length, peak, length, length, peak / length, length])
    names = ("edge_N", "rise_m", "skin_N", "skin_centre_m", "skin_width_m", "face_N_per_m", "face_depth_m")
    return {name: float(value) for name, value in zip(names, best * scale, strict=True)}
