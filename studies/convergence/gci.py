"""How far numbers and curves are from what an infinitely fine grid would give: order, GCI, least squares, verdict.

The grid convergence index follows Celik et al. (2008), J. Fluids Eng. 130:078001; the least-squares estimate for
scattered data follows Eca and Hoekstra (2014), J. Comput. Phys. 262:104.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.errors import CurveError
from mpm.arrays import FloatArray

SAFETY_FACTOR = 1.25
"""Factor of safety with three grids and an order that was observed (Celik et al. 2008)."""
SAFETY_FACTOR_DOUBT = 3.0
"""Factor of safety with two grids, or where the observed order is not credible (Roache; Eca and Hoekstra 2014)."""
ORDERS = (0.5, 2.1)
"""Observed orders that are credible for a formally first- to second-order scheme (Eca and Hoekstra 2014)."""
REPEATABILITY = 2.8
"""Two values of one distribution differ by less than this many standard deviations 95 times in 100 (ISO 5725-6)."""
AS_GOOD = 3.0
"""A first-order fit counts beside that of free order when its standard deviation is at most this many times larger."""
ALMOST = 0.1
"""It also counts when that is less than this part of the mean difference between neighbouring grids."""
COVERAGE = 2.0
"""An uncertainty band of about 95 % is this many standard uncertainties wide on each side."""

TRENDS = ("monotone", "oscillatory", "divergent", "noise-limited", "two grids")
"""What the three finest grids can do; the word ``verdict`` of a document."""


@dataclass(frozen=True)
class Estimate:
    """What a sequence of grids says about one number.

    Attributes:
        verdict: One of :data:`TRENDS`, from the three finest grids.
        order: Observed order of the three finest grids [-], or None: two grids, divergent, equal values, or where the
            differences are noise and give none that is credible.
        extrapolated: Richardson's value for an infinitely fine grid, or None.
        change: Difference of the two finest over the finest [-].
        gci: Grid convergence index of the finest, a fraction of its value [-].
        gci_coarsest: The same index of the coarsest: the way from it to the extrapolated value instead.
        fitted: Value of the least-squares fit for an infinitely fine grid, or None with fewer than four grids.
        fitted_order: Order of that fit [-], or None.
        uncertainty: Numerical uncertainty of the finest at about 95 %, a fraction of its value [-]: of the
            least-squares estimate where there is one, else the index, and of the runs that should agree.
    """

    verdict: str
    order: float | None
    extrapolated: float | None
    change: float
    gci: float
    gci_coarsest: float
    fitted: float | None
    fitted_order: float | None
    uncertainty: float


def estimate(h: Sequence[float], values: Sequence[float], repeat_sd: float = 0.0) -> Estimate:
    """Order, index and verdict of a number over cell size.

    Args:
        h: Cell sizes [m], shape (n,), n >= 2, all different, in any order.
        values: The number on each grid [its unit], shape (n,).
        repeat_sd: Its standard deviation between runs that should agree (other particles, the grid elsewhere).

    Returns:
        What the grids say of the number.

    Raises:
        CurveError: Fewer than two grids, equal cell sizes, or values that are not finite.
    """
    cells, phi = _sorted(h, values)
    scale = abs(phi[0]) if phi[0] else 1.0
    fine = phi[0] - phi[1]
    change = float(fine / scale)
    noise = COVERAGE * repeat_sd / scale
    verdict = "two grids" if len(phi) == 2 else _verdict(cells, fine, phi[1] - phi[2], repeat_sd)
    order = None if verdict in ("two grids", "divergent") else observed_order(cells[:3], phi[:3])
    if verdict == "noise-limited" and order is not None and not ORDERS[0] <= order <= ORDERS[1]:
        order = None  # of the noise, not of the grid
    factor, used = _credible(order)
    limit = float(phi[0] + fine / ((cells[1] / cells[0]) ** used - 1))
    gci, far = (float(factor * abs(phi[k] - limit) / scale) for k in (0, -1))
    extrapolated = None if order is None else float(phi[0] + fine / ((cells[1] / cells[0]) ** order - 1))
    if len(phi) < 4:
        return Estimate(verdict, order, extrapolated, change, gci, far, None, None, math.hypot(gci, noise))
    fitted, p, band = _least_squares(cells, phi)
    return Estimate(verdict, order, extrapolated, change, gci, far, fitted, p, math.hypot(band / scale, noise))


def observed_order(h: FloatArray, values: FloatArray) -> float | None:
    """Observed order of three grids [-] (Celik et al. 2008, eq. 3), None where two of the values agree.

    Args:
        h: Cell sizes from fine to coarse [m], shape (3,).
        values: The number on each grid [its unit], shape (3,).

    Returns:
        The order.
    """
    r21, r32 = h[1] / h[0], h[2] / h[1]
    e21, e32 = values[1] - values[0], values[2] - values[1]
    if e21 == 0 or e32 == 0:
        return None
    sign = math.copysign(1.0, e32 / e21)
    drop = math.log(abs(e32 / e21))
    p = max(abs(drop) / math.log(r21), 0.05)
    for _ in range(200):
        low, high = r21**p - sign, r32**p - sign
        q = math.log(low / high) if low > 0 and high > 0 else 0.0
        new = min(abs(drop + q) / math.log(r21), 20.0)
        if abs(new - p) < 1e-10:
            break
        p = 0.5 * (p + max(new, 1e-3))
    return float(p)


@dataclass(frozen=True, eq=False)
class CurveEstimate:
    """What a sequence of grids says about a curve.

    Attributes:
        order: Order by which the curves approach each other, in the root mean square [-], or None.
        gci: Index at each point, over the peak of the finest curve [-], shape (m,).
        u_num: Standard numerical uncertainty of the finest curve, of the grid and of the runs that should agree
            [unit of the curve], shape (m,).
        u_coarsest: The same of the coarsest curve, shape (m,).
    """

    order: float | None
    gci: FloatArray
    u_num: FloatArray
    u_coarsest: FloatArray


def curve_estimate(
    h: Sequence[float], curves: Sequence[FloatArray], repeat_sd: FloatArray | float = 0.0
) -> CurveEstimate:
    """Index along a curve, with one order for all of it (local orders of a wavy curve mean nothing).

    Args:
        h: Cell sizes [m], shape (n,), n >= 2.
        curves: The curve on each grid [unit of the curve], all at the same strokes, each of shape (m,).
        repeat_sd: Standard deviation between curves that should agree [unit of the curve], shape (m,) or scalar.

    Returns:
        What the grids say of the curve.

    Raises:
        CurveError: Fewer than two grids, or curves of different lengths.
    """
    if len({len(c) for c in curves}) > 1:
        raise CurveError("convergence of a curve: the curves have different lengths; bring them onto one stroke grid")
    place = np.argsort(np.asarray(h, float))
    cells = np.asarray(h, float)[place]
    _sorted(h, [0.0] * len(cells))
    rows = np.array([curves[k] for k in place], float)
    order = None
    if len(cells) > 2:
        near, far = (float(np.sqrt(np.mean((rows[k] - rows[k + 1]) ** 2))) for k in (0, 1))
        if 0 < near and _shrinks(cells, near, far):
            order = observed_order(cells[:3], np.array([0.0, near, near + far]))
    factor, used = _credible(order)
    limit = rows[0] + (rows[0] - rows[1]) / ((cells[1] / cells[0]) ** used - 1)
    peak = float(np.abs(rows[0]).max()) or 1.0
    near, far = (factor * np.abs(rows[k] - limit) for k in (0, -1))
    return CurveEstimate(order, near / peak, *(np.hypot(band / COVERAGE, repeat_sd) for band in (near, far)))


def _sorted(h: Sequence[float], values: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    cells, phi = np.asarray(h, float), np.asarray(values, float)
    if cells.ndim != 1 or cells.shape != phi.shape or len(cells) < 2:
        raise CurveError(f"convergence needs the same number of cells and values, at least 2; got {len(cells)}")
    if len(np.unique(cells)) < len(cells) or (cells <= 0).any():
        raise CurveError(f"convergence needs cell sizes that differ and are positive; got {list(cells)}")
    if not np.isfinite(phi).all():
        raise CurveError("convergence: a value is not finite; leave out the grid whose run broke down")
    place = np.argsort(cells)
    return cells[place], phi[place]


def _verdict(h: FloatArray, fine: float, coarse: float, repeat_sd: float) -> str:
    if max(abs(fine), abs(coarse)) < REPEATABILITY * repeat_sd or (fine == 0 and coarse == 0):
        return "noise-limited"
    if not _shrinks(h, fine, coarse):
        return "divergent"
    return "oscillatory" if fine * coarse < 0 else "monotone"


def _shrinks(h: FloatArray, fine: float, coarse: float) -> bool:
    """Whether the difference of the two finest of three grids is smaller than that of order 0 would be."""
    return bool(abs(fine) * math.log(h[2] / h[1]) < abs(coarse) * math.log(h[1] / h[0]))


def _credible(order: float | None) -> tuple[float, float]:
    """Factor of safety, and the order to use: the observed one where it is credible, else first order or its limits."""
    if order is None:
        return SAFETY_FACTOR_DOUBT, 1.0
    low, high = ORDERS
    if low <= order <= high:
        return SAFETY_FACTOR, order
    return SAFETY_FACTOR_DOUBT, min(max(order, low), high)


def _least_squares(h: FloatArray, phi: FloatArray) -> tuple[float, float, float]:
    """Fit phi = phi0 + a h^p; returns phi0, p and the uncertainty of the finest value at about 95 %.

    The order is free between the credible limits; outside, the better of first and second order is taken, with the
    larger factor of safety. A free order is easily too high where the values scatter, and then the error it promises is
    too small. A first-order fit that is nearly as good (:data:`AS_GOOD`) therefore counts too, and the larger
    uncertainty is taken.
    """

    def power_law(p: float) -> tuple[float, float, float]:
        columns = np.stack([np.ones_like(h), h**p], axis=1)
        solution = np.linalg.lstsq(columns, phi, rcond=None)[0]
        rest = float(((phi - columns @ solution) ** 2).sum())
        return rest, float(solution[0]), float(columns[0] @ solution)

    orders = np.linspace(*ORDERS, 161)
    best = int(np.argmin([power_law(p)[0] for p in orders]))
    p, free, factor = float(orders[best]), 3, SAFETY_FACTOR
    if best in (0, len(orders) - 1):
        p, free, factor = min((1.0, 2.0), key=lambda q: power_law(q)[0]), 2, SAFETY_FACTOR_DOUBT
    spread, bands = [], []
    scatter = (phi.max() - phi.min()) / (len(phi) - 1)
    for order, unknowns in ((p, free), (1.0, 2)):
        rest, limit, at_finest = power_law(order)
        spread.append(math.sqrt(rest / (len(h) - unknowns)))
        bands.append(_band(abs(at_finest - limit), spread[-1], abs(phi[0] - at_finest), scatter, factor))
    return power_law(p)[1], p, max(bands) if spread[1] <= max(AS_GOOD * spread[0], ALMOST * scatter) else bands[0]


def _band(error: float, spread: float, miss: float, scatter: float, factor: float) -> float:
    """Uncertainty of the finest value from one fit (Eca and Hoekstra 2014, eq. 20 and 21).

    Args:
        error: Fitted value on the finest grid less the fitted limit.
        spread: Standard deviation of the fit.
        miss: Finest value less the fitted one.
        scatter: Range of the values over their number less one.
        factor: Factor of safety.
    """
    if scatter == 0:
        return 0.0
    if spread < scatter:
        return float(factor * error + spread + miss)
    return float(SAFETY_FACTOR_DOUBT * spread / scatter * (error + spread + miss))
