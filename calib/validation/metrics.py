"""How far a simulated force curve is from a measured one: scalars, curve norms and published ratings.

Both curves lie on one stroke grid and have passed the same filter. The measured curve is the reference r, the
simulated one the model m; integrals are trapezium sums over the stroke. Errors are fractions (0.05 = 5 %).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from calib.errors import CurveError
from calib.io.typed_document import NULL

ISO_SAMPLES = 240
"""Samples to which curves are brought for the ISO rating (docs/theory.md, "Measured choices")."""
ISO_INNER = 0.05
"""Half width of the corridor's inner band over the largest reference value [-] (ISO/TS 18571)."""
ISO_OUTER = 0.50
"""Half width of the corridor's outer band [-] (ISO/TS 18571)."""
ISO_SHIFT = 0.20
"""Largest phase shift over the number of samples [-] (ISO/TS 18571)."""
ISO_WARP = 0.10
"""Half width of the time-warping window over the number of samples [-] (ISO/TS 18571)."""
ISO_MAGNITUDE = 0.50
"""Magnitude error at which that part is zero [-] (ISO/TS 18571)."""
ISO_SLOPE = 2.0
"""Slope error at which that part is zero [-] (ISO/TS 18571)."""
ISO_MEAN_POINTS = 9
"""Points of the moving mean of the slope (ISO/TS 18571)."""
ISO_WEIGHTS = (0.4, 0.2, 0.2, 0.2)
"""Weights of corridor, phase, magnitude and slope (ISO/TS 18571)."""
RAMP_RANGE = (0.05, 0.40)
"""Fractions of a curve's own peak between which, on its first rise, the initial stiffness is fitted."""
PEAK_LEVEL = 0.90
"""Fraction of the reference peak that bounds the peak window of the shape error."""
MIN_SAMPLES = 20
"""Fewest samples of a curve that can be rated: the slope part needs two moving means."""


@dataclass(frozen=True)
class SpragueGeers:
    """Sprague-Geers errors, 0 is perfect: magnitude M signed, phase P in 0..1, C = hypot(M, P)."""

    M: float
    P: float
    C: float


@dataclass(frozen=True)
class Russell:
    """Russell's errors of magnitude, phase and both (0 is perfect); C <= 0.15 is usually called excellent."""

    M: float
    P: float
    C: float


@dataclass(frozen=True)
class IsoRating:
    """ISO/TS 18571-style rating (1 is perfect).

    Attributes:
        Z: Corridor rating.
        EP: Phase rating.
        EM: Magnitude rating.
        ES: Slope rating.
        R: Overall rating, 0.4 Z + 0.2 (EP + EM + ES).
        shift: Samples by which the model lags the reference (negative: leads), of 240; None where an older document
            does not say.
        at_bound: Whether the shift stopped at the end of the searched range; EP then says nothing.
        without_phase: Where at_bound what Z, EM and ES of the curves as they are give, in R's proportions; else None.
    """

    Z: float
    EP: float
    EM: float
    ES: float
    R: float
    shift: int | None
    at_bound: bool
    without_phase: float | None = field(default=None, metadata=NULL)

    @property
    def caveat(self) -> str:
        """What has to be said beside the ISO rating, as a clause; empty where there is nothing."""
        if self.without_phase is None:
            return ""
        return (
            "the phase search of the ISO rating ran to its end, where its phase part is 0 whatever the model; "
            f"without it the ISO rating is {self.without_phase:.3f}"
        )


@dataclass(frozen=True)
class Metrics:
    """Comparison of a simulated with a measured curve.

    Attributes:
        peak_real_N, peak_sim_N: Largest force of each curve [N].
        peak_error: Simulated over measured peak - 1.
        peak_position_error: Difference of the peaks' positions over the length of the stroke, simulated -
            measured.
        shape_error: Root mean square difference of the curves, each divided by its own peak.
        shape_ramp, shape_peak, shape_release: The same before, within and after the stretch around the
            measured peak in which the measured force is at least 90 % of it; NaN where that stretch leaves
            nothing.
        nrmse: Root mean square difference over the measured peak.
        relative_l2: Norm of the difference over the norm of the measured curve.
        work_real_J, work_sim_J: Work over the stroke [J].
        work_error: Simulated over measured work - 1.
        stiffness_error: Ratio - 1 of the slopes between 5 % and 40 % of each curve's peak on its first rise.
        best_scale: Factor k on the simulated curve that brings it closest to the measured one.
        best_scale_residual: Norm of that remaining difference over the norm of the measured curve.
        sprague_geers, russell, iso18571: Published ratings.
    """

    peak_real_N: float
    peak_sim_N: float
    peak_error: float
    peak_position_error: float
    shape_error: float
    shape_ramp: float
    shape_peak: float
    shape_release: float
    nrmse: float
    relative_l2: float
    work_real_J: float
    work_sim_J: float
    work_error: float
    stiffness_error: float
    best_scale: float
    best_scale_residual: float
    sprague_geers: SpragueGeers
    russell: Russell
    iso18571: IsoRating

    def as_dict(self) -> dict[str, Any]:
        """Nested plain dictionary for JSON; what is not defined for a curve (NaN) becomes None."""
        return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in asdict(self).items()}


def compare(stroke: np.ndarray, real: np.ndarray, sim: np.ndarray) -> Metrics:
    """Compare a simulated curve with a measured one on a common stroke grid.

    A model 10 % too strong on a half sine has peak error, work error and relative L2 norm 0.1, NRMSE 0.0707
    and shape error 0.

    Args:
        stroke: Stroke, strictly increasing [m], shape (n,).
        real: Measured force, the reference [N], shape (n,).
        sim: Simulated force [N], shape (n,).

    Returns:
        All metrics.

    Raises:
        CurveError: Different lengths, values that are not finite, a stroke that does not increase, a curve
            without a positive force, or a measured curve without positive work.
    """
    s, r, m = _checked(stroke, real, sim)
    length = s[-1] - s[0]
    rr, mm, mr = _integral(s, r * r), _integral(s, m * m), _integral(s, m * r)
    square = _integral(s, (m - r) ** 2)
    peak_r, peak_m = float(r.max()), float(m.max())
    difference = (m / peak_m - r / peak_r) ** 2
    ramp, peak, release = _windows(r)
    work_r, work_m = _integral(s, r), _integral(s, m)
    cosine = _cosine(mm, rr, mr)
    return Metrics(
        peak_real_N=peak_r,
        peak_sim_N=peak_m,
        peak_error=peak_m / peak_r - 1.0,
        peak_position_error=float((s[np.argmax(m)] - s[np.argmax(r)]) / length),
        shape_error=_rms(s, difference),
        shape_ramp=_rms(s[ramp], difference[ramp]),
        shape_peak=_rms(s[peak], difference[peak]),
        shape_release=_rms(s[release], difference[release]),
        nrmse=float(np.sqrt(square / length) / peak_r),
        relative_l2=float(np.sqrt(square / rr)),
        work_real_J=work_r,
        work_sim_J=work_m,
        work_error=work_m / work_r - 1.0,
        stiffness_error=_initial_slope(s, m) / _initial_slope(s, r) - 1.0,
        best_scale=mr / mm,
        best_scale_residual=float(np.sqrt(1.0 - cosine**2)),
        sprague_geers=sprague_geers_from_integrals(mm, rr, mr),
        russell=russell_from_integrals(mm, rr, mr),
        iso18571=iso18571(s, r, m),
    )


def sprague_geers_from_integrals(mm: float, rr: float, mr: float) -> SpragueGeers:
    """Sprague-Geers errors from integrals over the stroke.

    M = sqrt(mm/rr) - 1, P = arccos(mr / sqrt(mm rr)) / pi, C = hypot(M, P).

    Source: Schwer (2007), Engineering with Computers 23, 295, doi 10.1007/s00366-007-0070-1.

    Args:
        mm: Integral of the squared model [N^2 m, or any unit that all three have].
        rr: Integral of the squared reference [the same].
        mr: Integral of their product [the same].

    Returns:
        The errors.

    Raises:
        CurveError: A curve that is zero.

    >>> round(sprague_geers_from_integrals(1.21, 1.0, 1.1).M, 6)
    0.1
    """
    magnitude = float(np.sqrt(mm / rr)) - 1.0
    phase = float(np.arccos(_cosine(mm, rr, mr)) / np.pi)
    return SpragueGeers(magnitude, phase, float(np.hypot(magnitude, phase)))


def russell_from_integrals(mm: float, rr: float, mr: float) -> Russell:
    """Russell's errors from integrals over the stroke.

    q = (mm - rr) / sqrt(mm rr), M = sign(q) log10(1 + |q|), P as Sprague and Geers, C = sqrt(pi/4 (M^2 + P^2)).

    Source: Russell (1997), Proc. 68th Shock and Vibration Symposium.

    Args:
        mm: Integral of the squared model [N^2 m, or any unit that all three have].
        rr: Integral of the squared reference [the same].
        mr: Integral of their product [the same].

    Returns:
        The errors.

    Raises:
        CurveError: A curve that is zero.

    >>> round(russell_from_integrals(1.21, 1.0, 1.1).M, 4)
    0.0759
    """
    q = (mm - rr) / float(np.sqrt(mm * rr))
    magnitude = float(np.sign(q) * np.log10(1.0 + abs(q)))
    phase = float(np.arccos(_cosine(mm, rr, mr)) / np.pi)
    return Russell(magnitude, phase, float(np.sqrt(np.pi / 4.0 * (magnitude**2 + phase**2))))


def iso18571(stroke: np.ndarray, real: np.ndarray, sim: np.ndarray) -> IsoRating:
    """Rate a curve in the manner of ISO/TS 18571, on 240 samples over the stroke.

    The standard is made for crash pulses. On curves that only rise the phase search runs to its bound
    (``at_bound``): the phase part is then 0 whatever the model, and R must be read without it.

    Args:
        stroke: Stroke, strictly increasing [m], shape (n,).
        real: Reference [N], shape (n,).
        sim: Model [N], shape (n,).

    Returns:
        The parts and the overall rating; 1 for equal curves.

    Raises:
        CurveError: As compare.
    """
    s, r, m = _checked(stroke, real, sim)
    grid = np.linspace(s[0], s[-1], ISO_SAMPLES)
    r, m = np.interp(grid, s, r), np.interp(grid, s, m)
    norm = float(np.abs(r).max())
    gap = np.abs(r - m) / norm
    corridor = float(np.mean(np.clip((ISO_OUTER - gap) / (ISO_OUTER - ISO_INNER), 0.0, 1.0) ** 2))
    most = int(ISO_SHIFT * ISO_SAMPLES)
    shift = _best_shift(r, m, most)
    phase, at_bound = (most - abs(shift)) / most, abs(shift) == most
    magnitude, slope = _magnitude_and_slope(*_overlap(r, m, shift))
    rating = float(np.dot(ISO_WEIGHTS, (corridor, phase, magnitude, slope)))
    if not at_bound:
        return IsoRating(corridor, phase, magnitude, slope, rating, shift, at_bound)
    whole, _, *others = ISO_WEIGHTS
    rest = float(np.dot((whole, *others), (corridor, *_magnitude_and_slope(r, m)))) / (whole + sum(others))
    return IsoRating(corridor, phase, magnitude, slope, rating, shift, at_bound, rest)


def _magnitude_and_slope(r: np.ndarray, m: np.ndarray) -> tuple[float, float]:
    """The magnitude and the slope part of a rating of two curves."""
    path_r, path_m = _warp(r, m, int(np.ceil(ISO_WARP * len(r))) - 1)
    error = float(np.abs(m[path_m] - r[path_r]).sum() / np.abs(r[path_r]).sum())
    magnitude = max(0.0, 1.0 - error / ISO_MAGNITUDE)
    slope_r, slope_m = _smoothed_slope(r), _smoothed_slope(m)
    steep = float(np.abs(slope_r).sum())
    slope_gap = float(np.abs(slope_m - slope_r).sum())
    slope = max(0.0, 1.0 - slope_gap / (ISO_SLOPE * steep)) if steep > 0.0 else float(slope_gap == 0.0)
    return magnitude, slope


def _checked(stroke: np.ndarray, real: np.ndarray, sim: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The curves as float arrays, or an error that says why they cannot be compared."""
    s, r, m = (np.asarray(x, dtype=float) for x in (stroke, real, sim))
    if s.ndim != 1 or not s.shape == r.shape == m.shape:
        raise CurveError(f"stroke, measured and simulated curve have shapes {s.shape}, {r.shape} and {m.shape}")
    if len(s) < MIN_SAMPLES:
        raise CurveError(f"curves of {len(s)} samples cannot be rated; at least {MIN_SAMPLES} are needed")
    for name, values in (("stroke", s), ("measured curve", r), ("simulated curve", m)):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise CurveError(f"the {name} is not finite at sample {bad[0]} ({values[bad[0]]})")
    if np.any(np.diff(s) <= 0.0):
        i = int(np.argmax(np.diff(s) <= 0.0))
        raise CurveError(f"the stroke does not increase at sample {i + 1} ({s[i]:g} m, then {s[i + 1]:g} m)")
    for name, values in (("measured", r), ("simulated", m)):
        if not values.max() > 0.0:
            raise CurveError(f"the {name} curve has no positive force (its largest value is {values.max():g} N)")
    if not _integral(s, r) > 0.0:
        raise CurveError(f"the measured curve does no work ({_integral(s, r):g} J); check its sign and its baseline")
    return s, r, m


def _integral(s: np.ndarray, values: np.ndarray) -> float:
    """Trapezium sum of values over s."""
    return float(np.sum(0.5 * np.diff(s) * (values[1:] + values[:-1])))


def _rms(s: np.ndarray, square: np.ndarray) -> float:
    """Square root of the mean of a squared quantity over s; NaN for fewer than two points."""
    return float(np.sqrt(_integral(s, square) / (s[-1] - s[0]))) if len(s) > 1 else float("nan")


def _cosine(mm: float, rr: float, mr: float) -> float:
    """Cosine between two curves, kept within -1..1 against rounding."""
    if not (mm > 0.0 and rr > 0.0):
        raise CurveError(f"a curve whose square has the integral {min(mm, rr):g} is zero and cannot be rated")
    return float(np.clip(mr / np.sqrt(mm * rr), -1.0, 1.0))


def _windows(real: np.ndarray) -> tuple[slice, slice, slice]:
    """Ramp, peak and release: before, within and after the stretch around the peak at 90 % of it or more."""
    top = int(np.argmax(real))
    low = np.flatnonzero(real < PEAK_LEVEL * real[top])
    start = int(low[low < top].max()) + 1 if np.any(low < top) else 0
    stop = int(low[low > top].min()) if np.any(low > top) else len(real)
    return slice(0, start), slice(start, stop), slice(stop, len(real))


def _initial_slope(s: np.ndarray, force: np.ndarray) -> float:
    """Least-squares slope of the first rise from 5 % to 40 % of the peak [N/m]."""
    low, high = (f * float(force.max()) for f in RAMP_RANGE)
    last = int(np.argmax(force >= high))
    under = np.flatnonzero(force[: last + 1] <= low)
    first = int(under[-1]) if len(under) else 0
    if last == first:
        last += 1
    x, f = s[first : last + 1], force[first : last + 1]
    x = x - x.mean()
    return float(x @ f / (x @ x))


def _best_shift(r: np.ndarray, m: np.ndarray, most: int) -> int:
    """Samples by which m lags r: largest correlation of the overlap within +-most, nearest 0 if tied."""

    def correlation(shift: int) -> float:
        a, b = _overlap(r, m, shift)
        a, b = a - a.mean(), b - b.mean()
        norm = float(np.sqrt((a @ a) * (b @ b)))
        return float(a @ b) / norm if norm > 0.0 else -1.0

    return max(sorted(range(most, -most - 1, -1), key=abs), key=correlation)


def _overlap(r: np.ndarray, m: np.ndarray, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """The common part of both curves after the model was moved back by ``shift`` samples."""
    return (r[: len(r) - shift], m[shift:]) if shift >= 0 else (r[-shift:], m[: len(m) + shift])


def _warp(r: np.ndarray, m: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices into r and m of the cheapest warping path (squared differences) within +-width samples."""
    n = len(r)
    cost = np.full((n + 1, n + 1), np.inf)
    cost[0, 0] = 0.0
    local = (r[:, None] - m[None, :]) ** 2
    for i in range(1, n + 1):
        for j in range(max(1, i - width), min(n, i + width) + 1):
            cost[i, j] = local[i - 1, j - 1] + min(cost[i - 1, j - 1], cost[i - 1, j], cost[i, j - 1])
    i, j = n, n
    path = []
    while i > 0 and j > 0:
        path.append((i - 1, j - 1))
        i, j = min(((i - 1, j - 1), (i - 1, j), (i, j - 1)), key=lambda c: cost[c])
    pairs = np.array(path[::-1])
    return pairs[:, 0], pairs[:, 1]


def _smoothed_slope(values: np.ndarray) -> np.ndarray:
    """Central differences, then a moving mean of nine points that narrows to 7, 5, 3, 1 towards the ends."""
    slope = np.gradient(values)
    total = np.concatenate([[0.0], np.cumsum(slope)])
    i = np.arange(len(slope))
    half = np.minimum(np.minimum(i, i[::-1]), ISO_MEAN_POINTS // 2)
    return np.asarray((total[i + half + 1] - total[i - half]) / (2 * half + 1))
