"""NumPy twins of the kernels' laws, written from the formulas and not from the kernels."""

from __future__ import annotations

import numpy as np
from scipy.linalg import polar
from scipy.optimize import brentq


def kirchhoff(f: np.ndarray, mu: float, lam: float) -> np.ndarray:
    """Fixed-corotated Kirchhoff stress 2 mu (F - R) F^T + lambda (J - 1) J I [Pa]."""
    r, _ = polar(f)
    j = np.linalg.det(f)
    return 2 * mu * (f - r) @ f.T + lam * j * (j - 1) * np.eye(3)


def energy(f: np.ndarray, mu: float, lam: float) -> float:
    """Fixed-corotated energy density mu |S - I|^2 + lambda/2 (J - 1)^2 [J/m^3]."""
    _, s = polar(f)
    return float(mu * np.sum((s - np.eye(3)) ** 2) + lam / 2 * (np.linalg.det(f) - 1) ** 2)


def mises(tau: np.ndarray) -> float:
    """von Mises equivalent of a stress [Pa]."""
    dev = tau - np.trace(tau) / 3 * np.eye(3)
    return float(np.sqrt(1.5 * np.sum(dev**2)))


def j2_return(stretch: np.ndarray, mu: float, yield_stress: float) -> np.ndarray:
    """The stretch of the same volume and direction of deviator whose corotated stress has the yield stress."""
    mean = np.trace(stretch) / 3 * np.eye(3)

    def scaled(a: float) -> np.ndarray:
        out = mean + a * (stretch - mean)
        return out * np.cbrt(np.linalg.det(stretch) / np.linalg.det(out))

    return scaled(brentq(lambda a: mises(kirchhoff(scaled(a), mu, 0.0)) - yield_stress, 0.0, 1.0, xtol=1e-15))


def wedge(y: float, z: float, spine: float, angle: float) -> float:
    """Signed distance to the right half of a wedge with its edge at the origin, by brute force over its outline [m]."""
    shoulder = spine / 2 / np.tan(angle / 2)
    face = np.linspace([0, 0], [spine / 2, shoulder], 20001)
    side = np.linspace([spine / 2, shoulder], [spine / 2, 10 * shoulder], 20001)
    outline = np.concatenate([face, side])
    distance = np.sqrt(((outline - [y, z]) ** 2).sum(1)).min()
    inside = y < min(z * np.tan(angle / 2), spine / 2)
    return float(-distance if inside else distance)


def bspline(r: np.ndarray) -> np.ndarray:
    """Quadratic B-spline as the threefold convolution of a box, evaluated by its truncated powers."""
    r = np.asarray(r, float)
    return sum(c * np.maximum(r + s, 0) ** 2 for c, s in ((0.5, 1.5), (-1.5, 0.5), (1.5, -0.5), (-0.5, -1.5)))
