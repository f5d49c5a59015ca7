"""Apparent modulus of an elastic disc between plates that stick to it: a Ritz solution, and formulas with their errors.

| a/h | nu | Ritz, in the limit | linear in r | Gent and Lindley |
|---|---|---|---|---|
| 0.83 | 0.30 | 1.097 | +2 % | -53 % |
| 0.83 | 0.45 | 1.285 | +6 % | -25 % |
| 0.83 | 0.49 | 1.376 | +7 % | -9 % |
| 2.5 | 0.45 | 2.173 | +10 % | -15 % |
| 2.5 | 0.49 | 3.359 | +9 % | -2 % |
| 20 | 0.49 | 13.97 | +14 % | +10 % |

So discs of food, about as wide as they are high and of nu 0.3 to 0.49, lie outside the regime of both formulas, thin
and nearly incompressible or bulging like a parabola; compare with :func:`apparent_modulus`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

DEGREES = (12, 20)  # of the polynomials that the limit is taken from


def apparent_modulus(ratio: float, nu: float) -> float:
    """Stress over strain of a short compression, over Young's modulus: the limit of :func:`ritz`.

    The errors of the Ritz solution come from the singular edge of the bond and fall as degree^-2; two degrees give the
    limit, to about 0.02 %.

    Args:
        ratio: Radius over height a/h [-].
        nu: Poisson's ratio [-], below 0.5.

    Returns:
        Apparent modulus over E [-].
    """
    low, high = DEGREES
    return (high**2 * ritz(ratio, nu, high) - low**2 * ritz(ratio, nu, low)) / (high**2 - low**2)


def gent_lindley(ratio: float, nu: float) -> float:
    """Formula of Gent and Lindley (1959): ``1/E_a = 1 / (E (1 + 2 S^2)) + 1/K`` with the shape factor S = a / (2 h).

    For thin, nearly incompressible discs.

    Args:
        ratio: Radius over height a/h [-].
        nu: Poisson's ratio [-].

    Returns:
        Apparent modulus over E [-].
    """
    return 1 / (1 / (1 + 2 * (ratio / 2) ** 2) + 3 * (1 - 2 * nu))


def linear_in_radius(ratio: float, nu: float) -> float:
    """Least energy of all radial displacements that are linear in r, which Williams and Gamonpilas (2008) assume.

    With ``u_r = r f(z)`` and ``u_z = w(z)`` the energy over the section is
    ``(lambda/2) (2 f + w')^2 + mu (2 f^2 + w'^2) + mu a^2 f'^2 / 4``. It is stationary for a constant stress
    ``sigma = lambda (2 f + w') + 2 mu w'`` and ``f = -(nu sigma / E) (1 - cosh k z / cosh (k h / 2))`` with
    ``(k a)^2 = 8 (lambda + mu - lambda^2 / (lambda + 2 mu)) / mu``. An upper bound.

    Args:
        ratio: Radius over height a/h [-].
        nu: Poisson's ratio [-].

    Returns:
        Apparent modulus over E [-].
    """
    lam, mu = _lame(nu)
    k = math.sqrt(8 * (lam + mu - lam**2 / (lam + 2 * mu)) / mu) / ratio / 2  # k h / 2
    f = -nu * (1 - math.tanh(k) / k)
    return (lam + 2 * mu) / (1 - 2 * lam * f)


def ritz(ratio: float, nu: float, degree: int) -> float:
    """Upper bound by polynomials in r and z of small displacements; of a high degree they do not lock.

    Args:
        ratio: Radius over height a/h [-].
        nu: Poisson's ratio [-], below 0.5.
        degree: Degree of the polynomials in each direction.

    Returns:
        Apparent modulus over E [-].
    """
    lam, mu = _lame(nu)
    radius, half = ratio, 0.5  # the height is 1; the upper half 0 < z < half, its face goes down by half
    points, weights = legendre.leggauss(degree + 6)
    base = legendre.legvander(points, degree)
    slope = np.stack([legendre.legval(points, legendre.legder(row)) for row in np.eye(degree + 1)], axis=1)
    r, z = radius * (1 + points) / 2, half * (1 + points) / 2
    in_r, slope_r, in_z, slope_z = base, slope * 2 / radius, base, slope * 2 / half
    # u_r = r (half - z) p, u_z = z (half - z) q - z: the face moves as one and sticks, the middle stays a plane
    across, change = (half - z)[:, None] * in_z, -in_z + (half - z)[:, None] * slope_z
    along = (z * (half - z))[:, None] * in_z
    along_change = (half - 2 * z)[:, None] * in_z + (z * (half - z))[:, None] * slope_z
    none = np.zeros((len(points) ** 2, (degree + 1) ** 2))
    radial = np.hstack([_pairs(in_r + r[:, None] * slope_r, across), none])
    hoop = np.hstack([_pairs(in_r, across), none])
    axial = np.hstack([none, _pairs(in_r, along_change)])
    shear = np.hstack([_pairs(r[:, None] * in_r, change), _pairs(slope_r, along)])
    volume = np.outer(r / radius * weights, weights / 2).ravel()  # over that of the half, sum 1
    trace, w = radial + hoop + axial, volume[:, None]
    k = lam * trace.T @ (w * trace) + mu * shear.T @ (w * shear)
    for strain in (radial, hoop, axial):
        k += 2 * mu * strain.T @ (w * strain)
    load = (lam * trace + 2 * mu * axial).T @ volume
    scale = 1 / np.sqrt(np.diag(k))
    answer = scale * np.linalg.lstsq(k * scale[:, None] * scale, load * scale, rcond=1e-13)[0]
    return float(lam + 2 * mu - load @ answer)


def _lame(nu: float) -> tuple[float, float]:
    """Lame's constants over E."""
    return nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))


def _pairs(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products of functions of r and of z at all points of a grid."""
    return np.einsum("ai,bj->abij", a, b).reshape(len(a) * len(b), -1)
