"""Resampling over the stroke, the zero-phase filter that measured and simulated curves share, and the sensor's own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calib.errors import CurveError, TraceError
from calib.trace.contact_onset import Baseline

N_STROKE = 240
"""Number of stroke points of every curve; the slope part of the ISO rating depends on it, so it is fixed."""
FILTER_SD_M = 0.5e-3
"""Standard deviation of the Gaussian filter over the stroke [m]: a fifth of the shortest skin peak seen
in cuts."""
REACH_SD = 4.0
"""Half width of the filter's kernel in standard deviations; 6e-5 of a Gaussian lies beyond."""
PEAK_HALF_WIDTH = 2
"""Points on each side of the maximum through which the parabola of the peak is fitted."""
UNIFORM_TOLERANCE = 1e-6
"""Largest relative deviation of a step from the mean step in a uniform stroke (rounding in a CSV of 7
digits)."""

LOWPASS_ORDER = 2
"""Order of the low-pass; the delay below is that of this order [-]."""
LOWPASS_STEPS = 400
"""Time steps in a period of the cut-off [-]: a ramp through the filter is then right to 1e-4 of its height."""
UNFELT = 0.02
"""Way of the edge in the delay of a low-pass, over the width of the filter over the stroke, that is not felt [-]."""
BANDWIDTH_HZ = (1.0, 1e5)
"""Cut-offs that are not taken for a mistake of the unit [Hz]."""


def resample(stroke: np.ndarray, force: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Average a force over the cells of a uniform stroke grid, so that a fine record is not aliased.

    Each value is the mean of the piecewise linear force over one cell, centred on the grid point; at the two
    ends the half cell inside the record is used and carried to the grid point along the slope, so that a
    straight line stays the same line. Samples at an equal stroke are averaged first.

    Args:
        stroke: Stroke of the samples, not decreasing [m], shape (m,).
        force: Force of the samples [N], shape (m,).
        grid: Uniform grid inside the record's range [m], shape (n,).

    Returns:
        Force at the grid points [N], shape (n,).

    Raises:
        CurveError: The stroke decreases, or the grid reaches beyond the record.
    """
    step = _uniform_step(grid)
    if stroke.shape != force.shape or len(stroke) < 2 or np.any(np.diff(stroke) < 0.0):
        raise CurveError("resampling needs a force and a stroke of equal length with a stroke that never decreases")
    if stroke[0] > grid[0] + UNIFORM_TOLERANCE * step or stroke[-1] < grid[-1] - UNIFORM_TOLERANCE * step:
        raise CurveError(
            f"the record covers strokes {stroke[0]:g} to {stroke[-1]:g} m, the grid asks for {grid[0]:g} to "
            f"{grid[-1]:g} m; simulate or record the whole stroke"
        )
    s, group = np.unique(stroke, return_inverse=True)
    f = np.bincount(group, weights=force) / np.bincount(group)
    half = 0.5 * step
    low = np.clip(grid - half, s[0], s[-1])
    high = np.clip(grid + half, s[0], s[-1])
    mean = (_integral(s, f, high) - _integral(s, f, low)) / (high - low)
    centre = 0.5 * (low + high)
    for end, inner in ((0, 1), (-1, -2)):
        mean[end] += (mean[end] - mean[inner]) * (grid[end] - centre[end]) / (centre[end] - centre[inner])
    return mean


def smooth(
    stroke: np.ndarray,
    force: np.ndarray,
    sd_m: float = FILTER_SD_M,
    *,
    before: np.ndarray | float | None = None,
) -> np.ndarray:
    """Filter a force over the stroke with a Gaussian of fixed physical width and without phase shift.

    Each value is that of the straight line fitted around it with Gaussian weights (local linear regression):
    inside the curve this is the plain Gaussian mean, at the ends a straight line stays straight and noise is
    still averaged, which a mirror image about the last sample would not do. The result is linear in the
    force.

    Args:
        stroke: Uniform stroke [m], shape (n,).
        force: Force [N], shape (n,).
        sd_m: Standard deviation of the Gaussian [m].
        before: Force before ``stroke[0]``: samples on the same grid, the last one nearest [N], shape (k,), or
            one value for all of them (0.0 for a simulated curve, which starts at contact). None: nothing is
            known, and the curve's start is treated like its end.

    Returns:
        The filtered force [N], shape (n,).

    Raises:
        CurveError: The stroke is not uniform, or the width is not positive.
    """
    step = _uniform_step(stroke)
    if not sd_m > 0.0:
        raise CurveError(f"the filter's standard deviation is {sd_m:g} m; it must be positive")
    reach = max(1, int(np.ceil(REACH_SD * sd_m / step)))
    if before is None:
        lead = np.empty(0)
    else:
        lead = np.full(reach, before) if np.ndim(before) == 0 else np.asarray(before, dtype=float)[-reach:]
    padded = np.concatenate([lead, force])
    offset = np.arange(-reach, reach + 1)
    weight = np.exp(-0.5 * (offset * step / sd_m) ** 2)
    moments = [_correlate(np.ones_like(padded), weight * offset**k) for k in range(3)]
    first = [_correlate(padded, weight * offset**k) for k in range(2)]
    line = (moments[2] * first[0] - moments[1] * first[1]) / (moments[0] * moments[2] - moments[1] ** 2)
    return line[len(lead) :]


def filter_simulated(grid: np.ndarray, stroke: np.ndarray, force: np.ndarray, sd_m: float = FILTER_SD_M) -> np.ndarray:
    """Put a simulated force on the stroke grid of a trace and filter it exactly as the trace was.

    The force before contact is zero.

    Args:
        grid: Stroke grid of the conditioned trace [m], shape (n,).
        stroke: Simulated stroke, 0 at contact, increasing [m], shape (m,).
        force: Simulated force on the knife [N], shape (m,).
        sd_m: Standard deviation of the filter [m].

    Returns:
        Filtered force on the grid [N], shape (n,).

    Raises:
        CurveError: The simulated stroke ends before the grid.
    """
    lead = leading_grid(grid, sd_m)
    rest = np.array([x for x in (lead[0], 0.0) if x < stroke[0]])
    s = np.concatenate([rest, stroke])
    f = np.concatenate([np.zeros(len(rest)), force])
    values = resample(s, f, np.concatenate([lead, grid]))
    return smooth(grid, values[len(lead) :], sd_m, before=values[: len(lead)])


@dataclass(frozen=True, eq=False)
class BandLimited:
    """Puts a simulated record on the strokes of a trace as :func:`filter_simulated` does, after
    the sensor's low-pass.

    A force that falls in a millisecond when a skin parts takes some 20 ms in the log of a robot that filters at 15 Hz.
    The simulated force is sent through such a filter, a second-order Butterworth low-pass, in the real time of the cut.
    A filter delays. But contact was found in the filtered force, and so is late as well: the delay is taken off.

    Attributes:
        bandwidth: Cut-off of the low-pass [Hz]; infinite for none.
        stroke: Stroke of the trace from contact [m], shape (n,).
        clock: Time after contact at which the edge was there [s], shape (n,), rising.

    Raises:
        TraceError: A cut-off beyond :data:`BANDWIDTH_HZ`.
    """

    bandwidth: float
    stroke: np.ndarray
    clock: np.ndarray

    def __post_init__(self) -> None:
        low, high = BANDWIDTH_HZ
        if not (low <= self.bandwidth <= high or math.isinf(self.bandwidth)):
            raise TraceError(
                f"--bandwidth {self.bandwidth:g} Hz: give the cut-off of the sensor's low-pass, {low:g} to {high:g} "
                "Hz, or leave it out where the force is not filtered"
            )

    def __call__(self, grid: np.ndarray, stroke: np.ndarray, force: np.ndarray) -> np.ndarray:
        """The record on some strokes.

        Args:
            grid: Strokes [m], shape (k,).
            stroke: Simulated stroke from contact [m], shape (m,), rising.
            force: Simulated force [N], shape (m,).

        Returns:
            Filtered force on the strokes [N], shape (k,).

        Raises:
            CurveError: The simulated stroke ends before the grid.
        """
        fastest = float(np.max(np.diff(self.stroke) / np.diff(self.clock)))
        delay, step = delay_of(self.bandwidth), 1.0 / (LOWPASS_STEPS * self.bandwidth)
        if delay * fastest < UNFELT * FILTER_SD_M:
            return filter_simulated(grid, stroke, force)
        from scipy.signal import butter, lfilter  # takes long to import, and most records need none of it

        end = float(np.interp(stroke[-1], self.stroke, self.clock)) + max(stroke[-1] - self.stroke[-1], 0.0) / self._end
        time = np.arange(-delay - step, end + delay + 2.0 * step, step)
        way = np.interp(time, self.clock, self.stroke)
        way += np.minimum(time, 0.0) * self._begin + np.maximum(time - self.clock[-1], 0.0) * self._end
        there = np.interp(way, np.append(0.0, stroke), np.append(0.0, force), left=0.0)
        felt = lfilter(*butter(LOWPASS_ORDER, self.bandwidth, fs=1.0 / step), there)
        seen = time <= end + step
        return filter_simulated(grid, way[seen], np.interp(time[seen] + delay, time, felt))

    @property
    def _begin(self) -> float:
        """Speed at contact [m/s]."""
        return float((self.stroke[1] - self.stroke[0]) / (self.clock[1] - self.clock[0]))

    @property
    def _end(self) -> float:
        """Speed at the end [m/s]."""
        return float((self.stroke[-1] - self.stroke[-2]) / (self.clock[-1] - self.clock[-2]))


def delay_of(bandwidth: float) -> float:
    """Time by which a sensor's low-pass delays what changes slowly.

    Args:
        bandwidth: Its cut-off [Hz]; infinite for none.

    Returns:
        The delay [s].
    """
    return math.sqrt(2.0) / (2.0 * math.pi * bandwidth)


def parabola_peak(curve: np.ndarray) -> float:
    """Largest force of a curve [N], shape (n,), by a parabola around its maximum [N]."""
    i = int(np.argmax(curve))
    if PEAK_HALF_WIDTH <= i < len(curve) - PEAK_HALF_WIDTH:
        x = np.arange(-PEAK_HALF_WIDTH, PEAK_HALF_WIDTH + 1)
        a, b, c = np.polyfit(x, curve[i + x], 2)
        if a < 0.0 and abs(b / (2.0 * a)) <= PEAK_HALF_WIDTH:
            return float(c - b * b / (4.0 * a))
    return float(curve[i])


def leading_grid(grid: np.ndarray, sd_m: float = FILTER_SD_M) -> np.ndarray:
    """Grid points before contact that the filter reaches [m], shape (k,), on the same spacing as the grid."""
    step = _uniform_step(grid)
    count = max(1, int(np.ceil(REACH_SD * sd_m / step)))
    return grid[0] + step * np.arange(-count, 0)


def _uniform_step(grid: np.ndarray) -> float:
    """Spacing of a uniform, increasing grid [m]."""
    steps = np.diff(grid)
    if len(grid) < 2 or not np.all(np.isfinite(grid)) or not steps.mean() > 0.0:
        raise CurveError("a stroke grid needs at least two finite, increasing points")
    step = float(steps.mean())
    if np.any(np.abs(steps - step) > UNIFORM_TOLERANCE * step):
        raise CurveError("the stroke is not uniform; put the curve on a uniform grid with resample() first")
    return step


def _integral(s: np.ndarray, f: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Integral of the piecewise linear function through (s, f) from s[0] to each x [N m]."""
    width = np.diff(s)
    total = np.concatenate([[0.0], np.cumsum(0.5 * width * (f[1:] + f[:-1]))])
    i = np.clip(np.searchsorted(s, x, side="right") - 1, 0, len(width) - 1)
    u = x - s[i]
    slope = (f[i + 1] - f[i]) / width[i]
    return total[i] + u * (f[i] + 0.5 * slope * u)


def _correlate(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Sum of weight[k] * values[i + k - reach] for each i, zero outside, shape of values."""
    reach = len(weight) // 2
    full: np.ndarray = np.convolve(values, weight[::-1])
    return full[reach : reach + len(values)]


def filtered_noise(baseline: Baseline, samples: int, length: float) -> float:
    """Standard deviation of the noise that is left in a point of the filtered curve [N].

    The Gaussian averages 2 sqrt(pi) of its standard deviations' worth of samples.

    Args:
        baseline: Noise of one sample, and its correlation.
        samples: Samples on the stroke.
        length: Length of the stroke [m].

    Returns:
        The standard deviation [N].
    """
    averaged = 2.0 * np.sqrt(np.pi) * FILTER_SD_M * samples / length
    return float(baseline.noise_sd * np.sqrt(min(1.0, baseline.inflation / max(averaged, 1.0))))
