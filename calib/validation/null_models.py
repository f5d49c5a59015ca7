"""Curves that explain nothing, rated like a simulation: a model that does not beat them has shown nothing."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.optimize import least_squares

from calib.errors import CurveError
from calib.validation.metrics import Metrics, compare
from mpm.arrays import FloatArray

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
class ThreeTermCurve:
    """A descriptive cutting curve: an edge term, a skin bump, and a face term that grows to a depth.

    F(s) = edge (1 - exp(-s/rise)) + skin exp(-((s - centre)/width)^2 / 2) + face min(s, depth).

    >>> float(ThreeTermCurve(5.0, 1e-9, 0.0, 0.0, 1e-3, 100.0, 0.005).force(np.array([0.01]))[0])
    5.5

    Attributes:
        edge_N: Plateau of the edge term [N].
        rise_m: Stroke in which it rises [m].
        skin_N: Height of the skin bump [N].
        skin_centre_m: Its place [m].
        skin_width_m: Its width [m].
        face_N_per_m: Slope of the face term [N/m].
        face_depth_m: Stroke at which it stops growing [m].
    """

    edge_N: float
    rise_m: float
    skin_N: float
    skin_centre_m: float
    skin_width_m: float
    face_N_per_m: float
    face_depth_m: float

    def force(self, stroke: FloatArray) -> FloatArray:
        """Force [N] (n,) over a stroke from contact [m] (n,)."""
        edge = self.edge_N * (1.0 - np.exp(-stroke / self.rise_m))
        skin = self.skin_N * np.exp(-0.5 * ((stroke - self.skin_centre_m) / self.skin_width_m) ** 2)
        return np.asarray(edge + skin + self.face_N_per_m * np.minimum(stroke, self.face_depth_m))


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
    curve: FloatArray
    metrics: Metrics
    parameters: dict[str, float]


def null_models(stroke: FloatArray, real: FloatArray) -> dict[str, NullModel]:
    """The null curves of a measured curve.

    ``ramp`` is the straight line from zero at contact to the measured peak at the end of the stroke: a linear
    spring. ``half_sine`` is half a sine period over the stroke with the measured peak as its height. Both
    know one number. ``three_term`` is a description with seven numbers fitted to the curve by least squares
    (:class:`ThreeTermCurve`).

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
    three = fit_three_term(stroke, real)
    curves = {
        "ramp": (peak * x, {"peak_N": peak}),
        "half_sine": (peak * np.sin(np.pi * x), {"peak_N": peak}),
        "three_term": (three.force(stroke - stroke[0]), asdict(three)),
    }
    return {name: NullModel(name, curve, compare(stroke, real, curve), p) for name, (curve, p) in curves.items()}


def fit_three_term(stroke: FloatArray, real: FloatArray) -> ThreeTermCurve:
    """Fit the three-term curve by bounded least squares from a few fixed starts.

    Args:
        stroke: Stroke, strictly increasing [m], shape (n,).
        real: Measured force with a positive peak [N], shape (n,).

    Returns:
        The curve.

    Raises:
        CurveError: No start converged to a finite curve.
    """
    length, peak = float(stroke[-1] - stroke[0]), float(np.max(real))
    x, y = (stroke - stroke[0]) / length, real / peak

    def residual(p: FloatArray) -> FloatArray:
        return ThreeTermCurve(*p).force(x) - y

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
    return ThreeTermCurve(*map(float, best * scale))
