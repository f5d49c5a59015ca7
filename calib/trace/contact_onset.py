"""Where a cut begins: baseline, noise and contact onset of a force, each with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import TraceError

MIN_BASELINE = 5
"""Fewest samples before contact from which a baseline and a noise level are taken."""
EXCEED_SD = 5.0
"""Excursion in noise standard deviations that counts as contact when it lasts ``SUSTAIN`` samples."""
SUSTAIN = 3
"""Number of consecutive samples that make an excursion, or a release, a sustained one."""
FLOOR_FRACTION = 1e-3
"""Smallest noise assumed, as a fraction of the excursion: digitised and simulated traces have none of
their own."""
COARSE_FRACTION = 0.5
"""Fraction of the largest excursion, counted from the record's first tenth, where the search for a
baseline begins."""
FLAT_FRACTION = 0.03
"""Change between the halves of a window, over the largest excursion, up to which it can be a baseline."""
STEADY_SAMPLES, STEADY_SD = 10, 15.0
"""Samples over which noise is taken to be correlated where a stretch is told from a slow rise, and standard deviations
of it that an excursion must have for that."""
HINGE_TOP_SD = 10.0
"""The hinge is fitted up to this many noise standard deviations above the baseline ..."""
HINGE_TOP_FRACTION = 0.1
"""... or to this fraction of the largest excursion, whichever is higher."""
STANDING_SD, STANDING_PART, STANDING_TOP = 3.0, 0.5, 0.25
"""A force stands under load within so many noise standard deviations of one level for so much of its rise, where the
rise is high enough for that to be told: the band is at most this part of it."""
HINGE_FLAT_RATIO = 3.0
"""Length of the hinge's flat part over that of its rise: long enough to fix the level, too short to feel
drift."""
HINGE_POWERS = (1.0, 1.5, 2.0)
"""Powers of the rise after contact: a straight edge on a flat food, a round food or blunt edge (Hertz), and what widens
as it sinks in, a cone (Sneddon 1965, Int. J. Eng. Sci. 3:47) or an edge across a round food. What simulated cuts do,
and what the 2 is for: docs/theory.md, "Measured choices"."""
HINGE_GRID = 200
"""Trial positions of the kink in each of the two passes of its search."""
MOST_HINGE_VALUES = 10**7  # numbers of trial rises at a time: a record of millions of samples has more
COARSE_SD = 2.0
"""Noise standard deviations in the step of a force from which on a rise below it is not seen: half the time from the
kink to the second step is then a standard uncertainty."""
MAD_TO_SD = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""
MEDIAN_VARIANCE = np.pi / 2.0
"""Variance of the median of normal samples over that of their mean."""
BASELINE_GUARD = 2.0
"""Standard uncertainties of the onset by which the baseline window ends before it."""
MAX_CORRELATION = 0.95
"""Cap of the lag-one correlation from which the effective number of samples follows."""


@dataclass(frozen=True)
class Baseline:
    """Level and noise of the force before contact.

    Attributes:
        level: Median of the window [N].
        level_sd: Standard uncertainty of the level: noise, its correlation and the drift inside the window
            [N].
        noise_sd: Robust standard deviation of a single sample [N].
        inflation: Variance of a mean of correlated samples over that of independent ones, (1+r)/(1-r) [-].
        slope: Drift inside the window, least squares [N/s].
        slope_sd: Its standard uncertainty [N/s].
        start, stop: Indices of the window, stop exclusive.
    """

    level: float
    level_sd: float
    noise_sd: float
    inflation: float
    slope: float
    slope_sd: float
    start: int
    stop: int


@dataclass(frozen=True)
class ContactOnset:
    """Baseline and contact onset of a record.

    Attributes:
        baseline: Level and noise before contact.
        onset: Time of contact [s].
        onset_sd: Its standard uncertainty [s].
        peak: Largest excursion above the baseline, mean of three samples [N].
    """

    baseline: Baseline
    onset: float
    onset_sd: float
    peak: float


@dataclass(frozen=True)
class _Coarse:
    """First sustained excursion: its index (None: there is none), height, window start and noise found."""

    index: int | None
    height: float
    start: int
    noise: float


def find_contact_onset(time: np.ndarray, force: np.ndarray, *, source: str) -> ContactOnset:
    """Find baseline and contact onset by a change-point fit.

    The first sustained excursion is located against the noise of the second half of the record before it (the
    start of a robot's motion is thus left out). Around it, ``b + a max(0, t - t0)^q`` is fitted by least
    squares for q = 1, 1.5 and 2, and the kinks t0 are averaged with Akaike weights, so that a soft toe does not
    shift the onset and a toe that the noise hides widens its uncertainty. That joins the covariance of the
    fits, with correlated noise counted, the spread between the powers, the sampling interval, and half the
    shift of the kink when the rise is fitted to half its height.

    Args:
        time: Time [s], shape (n,).
        force: Force, resistance positive [N], shape (n,); the record ends at the end of the downward stroke.
        source: Name of the record for messages.

    Returns:
        Time of contact and the baseline before it.

    Raises:
        TraceError: No contact, the wrong sign, or too little baseline before contact.
    """
    coarse = _coarse_contact(force)
    opposite = _coarse_contact(-force)
    if opposite.index is not None and (
        coarse.index is None or (opposite.height > coarse.height and opposite.index < coarse.index)
    ):
        raise TraceError(
            f"{source}: the largest sustained excursion is {-opposite.height:.3g} N, away from resistance "
            "to the knife; the force has the other sign: use --sign - (or --sign + where - was given)"
        )
    if coarse.index is None:
        raise TraceError(_no_contact_message(force, coarse, source))
    onset, onset_sd = _hinge_onset(time, force, coarse.index, coarse)
    before = int(np.searchsorted(time, onset - BASELINE_GUARD * onset_sd))
    if before < MIN_BASELINE:
        raise TraceError(
            f"{source}: only {before} samples before contact at {onset:.4g} s, at least {MIN_BASELINE} are "
            "needed for the baseline; keep the approach of the knife in the record, or say --baseline zero if it "
            "starts at the trigger of a zeroed machine"
        )
    baseline = estimate_baseline(time, force, before - max(before // 2, MIN_BASELINE), before)
    return ContactOnset(baseline, onset, onset_sd, coarse.height)


def estimate_baseline(time: np.ndarray, force: np.ndarray, start: int, stop: int) -> Baseline:
    """Robust level, noise and drift of ``force[start:stop]``.

    The correlation of neighbouring samples is that of the window without its drift, corrected for its bias in a short
    window (Marriott and Pope 1954).

    Args:
        time: Time [s], shape (n,).
        force: Force [N], shape (n,).
        start: Index of the first sample of the window.
        stop: Index after its last one.

    Returns:
        Level, noise and drift, and the uncertainty of each.
    """
    t, f = time[start:stop], force[start:stop]
    level, noise = _median_and_sd(f)
    centred = t - t.mean()
    slope = float(centred @ f / (centred @ centred))
    rest = f - f.mean() - slope * centred
    power = float(rest @ rest)
    correlation = float(rest[1:] @ rest[:-1]) / power if power > 0.0 else 0.0
    n = len(f)
    if n > MIN_BASELINE:  # a detrended sample of n shows r - (2 + 4 r)/n on average (Marriott and Pope 1954)
        correlation = (n * correlation + 2.0) / (n - 4.0)
    correlation = min(max(correlation, 0.0), MAX_CORRELATION)
    inflation = (1.0 + correlation) / (1.0 - correlation)
    slope_sd = float(np.sqrt(inflation * power / max(n - 2, 1) / (centred @ centred)))
    statistical = noise * np.sqrt(MEDIAN_VARIANCE * inflation / n)
    drift = slope * (t[-1] - t[0]) / np.sqrt(12.0)
    return Baseline(level, float(np.hypot(statistical, drift)), noise, inflation, slope, slope_sd, start, stop)


def quantum(force: np.ndarray) -> float:
    """The step in which a force counts [N]: the smallest difference of its values, of which all others are multiples.

    Zero where there is none.
    """
    values = np.unique(force)
    if len(values) < 3 or len(values) > len(force) / 2:
        return 0.0
    steps = np.diff(values)
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    off = np.abs(steps / step - np.round(steps / step))
    return step if float(np.mean(off < 0.1)) > 0.95 else 0.0


def first_sustained(mask: np.ndarray) -> int | None:
    """Index of the first of ``SUSTAIN`` consecutive true values, or None."""
    runs = np.convolve(mask.astype(int), np.ones(SUSTAIN, dtype=int), mode="valid") == SUSTAIN
    return int(np.argmax(runs)) if runs.any() else None


def _median_and_sd(values: np.ndarray) -> tuple[float, float]:
    """Median and robust standard deviation; the ordinary one where most values are equal."""
    level = float(np.median(values))
    sd = MAD_TO_SD * float(np.median(np.abs(values - level)))
    if sd > 0.0 or np.ptp(values) == 0.0:
        return level, sd
    return level, float(np.std(values))


def _coarse_contact(force: np.ndarray) -> _Coarse:
    """First sustained excursion above a stretch that is as flat as its noise lets it be told, else nearly flat."""
    found = _excursion(force, STEADY_SAMPLES)
    clear = found.index is not None and found.height > STEADY_SD * found.noise
    return found if clear else _excursion(force, None)


def _excursion(force: np.ndarray, steady: int | None) -> _Coarse:
    """First sustained excursion above a flat stretch, searched backwards from half the largest excursion.

    The stretch is the second half of the record before the current guess; where it is not flat (it lies on
    the rise), the guess moves to its start, where it is, the guess moves to the first sustained excursion
    from it.
    """
    running = np.convolve(force, np.full(SUSTAIN, 1.0 / SUSTAIN), mode="same")
    running[0], running[-1] = force[0], force[-1]
    top = int(np.argmax(running))
    reference = float(np.median(force[: max(MIN_BASELINE, len(force) // 10)]))
    height = float(running[top] - reference)
    index = int(np.argmax(running >= reference + COARSE_FRACTION * height))
    least = _difference_noise(force[: max(top, MIN_BASELINE)])
    seen: set[int] = set()
    while True:
        start = min(index // 2, index - MIN_BASELINE)
        if start < 0:
            return _Coarse(None, height, 0, float("nan"))
        window = force[start:index]
        level, noise = _median_and_sd(window)
        height = float(running[top] - level)
        if not _is_flat(window, height, steady):
            index = start
            continue
        noise = max(noise, least)
        limit = level + EXCEED_SD * max(noise, FLOOR_FRACTION * abs(height))
        found = first_sustained(force[start : top + SUSTAIN] > limit)
        if found is None:
            return _Coarse(None, height, start, noise)
        index = start + found
        if index in seen:
            start = min(start, index - MIN_BASELINE)
            return _Coarse(index if start >= 0 else None, height, max(start, 0), noise)
        seen.add(index)


def _is_flat(window: np.ndarray, height: float, steady: int | None) -> bool:
    """Whether the level of a window's halves differs by no more than noise, or a little of the excursion.

    The noise of a half's level is that of a sample, or that of a mean of every so many of them.
    """
    half = len(window) // 2
    change = abs(float(np.median(window[half:]) - np.median(window[:half])))
    noise = _difference_noise(window)
    if steady is not None:
        noise *= float(np.sqrt(min(1.0, steady / max(half, 1))))
    return change <= max(EXCEED_SD * noise, FLAT_FRACTION * abs(height))


def _difference_noise(values: np.ndarray) -> float:
    """Standard deviation of independent noise from the differences of neighbours, whatever the trend."""
    return _median_and_sd(np.diff(values))[1] / float(np.sqrt(2.0))


def _no_contact_message(force: np.ndarray, coarse: _Coarse, source: str) -> str:
    """Tell a record without contact from one whose contact leaves no baseline."""
    noise = coarse.noise if np.isfinite(coarse.noise) else _difference_noise(force)
    level = float(np.median(force))
    excursion = float(np.max(force) - level)
    if np.isfinite(coarse.noise) or np.ptp(force) <= 2.0 * EXCEED_SD * noise:
        return (
            f"{source}: no contact found: the largest excursion is {excursion:.3g} N against a noise of "
            f"{noise:.3g} N (standard deviation), {EXCEED_SD:g} of them over {SUSTAIN} samples are needed; "
            "check the force column, its unit, and that the file holds the cut"
        )
    return (
        f"{source}: the force rises within the first samples, so that fewer than {MIN_BASELINE} of them are "
        "a baseline before contact; keep the approach of the knife in the record, or say --baseline zero if it "
        "starts at the trigger of a zeroed machine"
    )


def _hinge_onset(time: np.ndarray, force: np.ndarray, index: int, coarse: _Coarse) -> tuple[float, float]:
    """Kink of the flat-then-rising fit around a coarse onset and its standard uncertainty [s]."""
    baseline = estimate_baseline(time, force, coarse.start, index)
    step = quantum(force)
    noise = max(baseline.noise_sd, FLOOR_FRACTION * coarse.height, step / 12**0.5)
    high = max(HINGE_TOP_SD * noise, HINGE_TOP_FRACTION * coarse.height)
    high = _below_a_pause(force[index:] - baseline.level, noise, high)
    kinks = []
    for top in (high, 0.5 * high):
        above = first_sustained(force[index:] > baseline.level + top)
        stop = index + (SUSTAIN if above is None else max(above + 1, SUSTAIN))
        flat = max(MIN_BASELINE, int(HINGE_FLAT_RATIO * (stop - index)))
        first = max(coarse.start, index - flat)
        kinks.append(_averaged_hinge(time[first:stop], force[first:stop], noise, baseline.inflation))
    (kink, variance), (other, _) = kinks
    dt = float(np.median(np.diff(time)))
    unseen = 0.0
    if step > COARSE_SD * baseline.noise_sd:
        second = first_sustained(force[index:] > baseline.level + 1.5 * step)
        unseen = 0.5 * float(time[index + (second or 0)] - min(kink, time[index]))
    return kink, float(np.sqrt(variance + dt**2 / 12.0 + (0.5 * (kink - other)) ** 2 + unseen**2))


def _below_a_pause(rise: np.ndarray, noise: float, top: float) -> float:
    """The height up to which a rise is one [N]: its top, or less where a knife that pauses on the food lets the force
    stand below it.

    Args:
        rise: Force above the baseline from the first excursion on [N], shape (n,).
        noise: Noise of one sample [N].
        top: Height up to which the rise would be fitted [N].

    Returns:
        The height [N].
    """
    above = first_sustained(rise > top)
    below = rise if above is None else rise[:above]
    band = STANDING_SD * noise
    if len(below) < 2 * SUSTAIN or 2.0 * band > STANDING_TOP * top:
        return top
    stood = float(np.median(below))
    stands = stood > EXCEED_SD * noise and np.mean(np.abs(below - stood) <= band) > STANDING_PART
    return stood - band if stands else top


def _averaged_hinge(time: np.ndarray, force: np.ndarray, noise: float, inflation: float) -> tuple[float, float]:
    """Kink averaged over the powers of the rise with Akaike weights, and its variance [s, s^2]."""
    fits = np.array([_fit_hinge(time, force, power) for power in HINGE_POWERS])
    kink, variance, total = fits.T
    scale = inflation * max(noise**2, float(total.min()) / max(len(time) - 3, 1))
    weight = np.exp(-0.5 * (total - total.min()) / scale)
    weight /= weight.sum()
    mean = float(weight @ kink)
    return mean, float(weight @ (inflation * variance + (kink - mean) ** 2))


def _fit_hinge(time: np.ndarray, force: np.ndarray, power: float) -> tuple[float, float, float]:
    """Kink of ``b + a max(0, t - t0)^power``, its variance for independent noise, and what is left."""
    low, high = time[0], time[-3]
    centred = force - force.mean()
    parts = 1 + HINGE_GRID * len(time) // MOST_HINGE_VALUES
    for _ in range(2):
        trial = np.linspace(low, high, HINGE_GRID)
        gains = []
        for some in np.array_split(trial, parts):
            rise = _rises(time, some, power)
            gains.append(np.maximum(rise @ centred, 0.0) ** 2 / np.sum(rise**2, axis=1))
        gain = np.concatenate(gains)
        best = int(np.argmax(gain))
        low, high = trial[max(best - 1, 0)], trial[min(best + 1, HINGE_GRID - 1)]
    t0 = float(trial[best])
    after = np.maximum(0.0, time - t0)
    (own,) = _rises(time, trial[best : best + 1], power)
    slope = float(own @ centred / (own @ own))
    bend = np.where(after > 0.0, -slope * power * np.maximum(after, 1e-300) ** (power - 1.0), 0.0)
    jacobian = np.column_stack([np.ones_like(time), after**power, bend])
    total = max(float(centred @ centred - gain[best]), 0.0)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * total / max(len(time) - 3, 1)
    return t0, float(covariance[2, 2]), total


def _rises(time: np.ndarray, kinks: np.ndarray, power: float) -> np.ndarray:
    """``max(0, t - t0)^power`` less its mean for each kink t0, shape (kinks, n)."""
    rise = np.maximum(0.0, time - kinks[:, None]) ** power
    rise -= rise.mean(axis=1, keepdims=True)
    return rise
