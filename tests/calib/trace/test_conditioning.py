"""Conditioning on traces of known truth: baseline, onset, stroke, filter, and every refusal."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from calib.errors import CurveError, TraceError
from calib.trace.conditioning import Conditioned, condition
from calib.trace.filters import FILTER_SD_M, N_STROKE, BandLimited, delay_of, filter_simulated, resample, smooth
from calib.trace.trace import Trace, read_trace
from tests.data_dir import ROOT, data_file

SPEED = 0.02  # [m/s]
CONTACT = 1.0  # [s]
PEAK = 20.0  # [N]
LEVEL = 25.0  # [N]
CUT = 1.5  # [s]


def made(
    *,
    rate: float = 200.0,
    noise: float = 0.1,
    power: float = 1.0,
    seed: int = 0,
    drift: float = 0.0,
    position: bool = False,
    release: bool = True,
    after: float = 0.5,
    contact: float = CONTACT,
) -> Trace:
    """A cut that rises to 20 N over 15 mm and stays there for 15 mm, above 25 N, with noise and drift."""
    time = np.arange(int((contact + CUT + after) * rate) + 1) / rate
    part = np.clip((time - contact) / CUT, 0.0, None)
    force = PEAK * np.minimum(1.0, 2.0 * part) ** power * ((part < 1.0) | (not release))
    force = force + LEVEL + drift * time + noise * np.random.default_rng(seed).normal(size=len(time))
    height = 0.05 - SPEED * np.minimum(time, contact + CUT)
    columns = {"time": "time_s", "force": "force_N", "position": "ee_z_m"}
    return Trace(time, force, height if position else None, "made.csv", "", columns)


def truth(stroke: np.ndarray) -> np.ndarray:
    """Force of the linear cut over its stroke [N]."""
    return PEAK * np.clip(2.0 * stroke / (SPEED * CUT), 0.0, 1.0)


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("rate", [60.0, 200.0])
def test_onset_and_tare_are_within_their_uncertainty(power: float, rate: float) -> None:
    """Over 40 noisy cuts, onset and baseline errors are as large as stated, and not far smaller."""
    cuts = [condition(made(rate=rate, power=power, seed=s), speed=SPEED) for s in range(40)]
    onset = np.array([(c.onset_s - CONTACT) / c.onset_sd_s for c in cuts])
    tare = np.array([(c.baseline_N - LEVEL) / c.baseline_sd_N for c in cuts])
    assert np.abs(onset).max() < 3.0
    assert np.abs(tare).max() < 4.0
    assert 0.15 < np.sqrt(np.mean(onset**2)) < 1.2
    assert 0.5 < np.sqrt(np.mean(tare**2)) < 1.4
    assert np.mean([c.noise_sd_N for c in cuts]) == pytest.approx(0.1, rel=0.1)
    late = (
        0.02 if power < 2.0 else 0.045
    )  # [s], 0.4 and 0.9 mm of stroke: the square has risen by 0.4 of the noise there
    assert np.mean([abs(c.onset_s - CONTACT) for c in cuts]) < late


def test_onset_does_not_wait_for_a_threshold() -> None:
    """With hardly any noise the kink is found within a fifth of a sample, where no threshold trips."""
    cut = condition(made(noise=0.002), speed=SPEED)
    assert cut.onset_s == pytest.approx(CONTACT, abs=1e-3)
    assert cut.onset_sd_s >= 0.005 / np.sqrt(12.0)


def test_the_stroke_ends_at_the_board() -> None:
    """A stroke of 30 mm through a specimen of 29 mm counts for 29 mm, which is said; through one of 20 mm something is
    wrong."""
    plain = condition(made(position=True))
    cut = condition(made(position=True), board=0.029)
    assert plain.stroke_length_m == pytest.approx(0.030, abs=3e-4)
    assert cut.stroke_length_m == 0.029 == cut.stroke[-1]
    assert cut.end_s < plain.end_s and cut.peak_N == pytest.approx(plain.peak_N, rel=0.01)
    assert any("goes beyond the specimen's height of 29.0 mm" in text for text in cut.warnings)
    assert condition(made(position=True), board=0.04).stroke_length_m == plain.stroke_length_m
    for given in ({}, {"speed": SPEED}):
        with pytest.raises(TraceError, match="but the specimen is 20.0 mm high; check the height"):
            condition(made(position=not given), board=0.020, **given)


def test_robot_start_is_not_taken_for_contact() -> None:
    """A start-up of the arm by 7 N long before contact changes neither onset nor baseline."""
    plain = made()
    moved = replace(plain, force=plain.force - 7.0 * np.exp(-plain.time / 0.05))
    one, two = condition(plain, speed=SPEED), condition(moved, speed=SPEED)
    assert two.onset_s == pytest.approx(one.onset_s, abs=2e-3)
    assert two.baseline_N == pytest.approx(one.baseline_N, abs=0.01)
    assert any("not constant" in w for w in two.warnings)
    assert not any("not constant" in w for w in one.warnings)


def test_drift_is_reported_and_not_removed() -> None:
    """A drift of 0.8 N/s is measured, warned about, and left in the force; without drift nobody is warned."""
    cut = condition(made(drift=0.8), speed=SPEED)
    assert cut.drift_N_per_s == pytest.approx(0.8, rel=0.2)
    assert any("drifts by" in w and "--air" in w for w in cut.warnings)
    at_end = cut.force[np.searchsorted(cut.time, CONTACT + CUT) - 20]
    assert at_end == pytest.approx(PEAK + 0.8 * (CONTACT + CUT - 0.75), abs=0.5)
    assert condition(made(), speed=SPEED).warnings == ()


def test_air_run_removes_what_it_shares_with_the_cut() -> None:
    """Drift and start-up of the arm cancel against the air run; a constant left over is measured."""
    shared = 3.0 * np.exp(-np.arange(2000) / 60.0) - 0.8 * np.arange(2000) / 200.0
    cut = made()
    cut = replace(cut, force=cut.force + shared[: len(cut.time)])
    time = np.arange(700) / 200.0
    noise = 0.1 * np.random.default_rng(5).normal(size=700)
    air = Trace(time, 24.0 + shared[:700] + noise, None, "air.csv", "", cut.columns)
    done = condition(cut, air=air, speed=SPEED)
    assert done.baseline_kind == "air"
    assert done.baseline_N == pytest.approx(LEVEL - 24.0, abs=3 * done.baseline_sd_N)
    np.testing.assert_allclose(done.curve[130:220], PEAK, atol=0.25)
    assert done.warnings == ()


def test_short_air_run_names_the_missing_times() -> None:
    """An air run that ends or begins inside the cut is refused with the range that it lacks; t_end helps."""
    cut, air = made(), made(noise=0.0)
    short = replace(air, time=air.time[20:400], force=0 * air.force[20:400] + 24.0)
    with pytest.raises(TraceError, match="0 to 0.1 s and 1.995 to 3 s is missing.*--t-end"):
        condition(cut, air=short, speed=SPEED)
    whole_start = replace(air, time=air.time[:400], force=0 * air.force[:400] + 24.0)
    assert condition(cut, air=whole_start, speed=SPEED, t_end=1.99).stroke_length_m < 0.021


def test_air_run_of_another_motion_is_noticed() -> None:
    """An air run at another height, or from another column, is used but reported."""
    cut = made(position=True)
    assert cut.position is not None
    columns = {**cut.columns, "force": "fz_N"}
    air = replace(cut, force=np.full_like(cut.force, 24.0), position=cut.position - 0.004, columns=columns)
    warnings = condition(cut, air=air).warnings
    assert any("4.0 mm in height" in w for w in warnings)
    assert any("force_N in the cut, fz_N in the air run" in w for w in warnings)


def test_three_stroke_axes_agree() -> None:
    """Position, speed and height give one curve for a uniform motion; only the guess is warned about."""
    by_position = condition(made(position=True))
    by_speed = condition(made(), speed=SPEED)
    by_height = condition(made(), height=SPEED * CUT)
    for cut, source in ((by_position, "position"), (by_speed, "speed"), (by_height, "height")):
        assert cut.stroke_source == source
        assert cut.stroke_length_m == pytest.approx(SPEED * CUT, rel=0.015)
        assert len(cut.stroke) == len(cut.curve) == N_STROKE
        assert cut.stroke[0] == 0.0
        np.testing.assert_allclose(cut.curve[:200], truth(cut.stroke[:200]), atol=0.6)
    assert any("food's height" in w for w in by_height.warnings)
    assert by_position.warnings == by_speed.warnings == ()
    assert any("speed is not used" in w for w in condition(made(position=True), speed=SPEED).warnings)


def test_retraction_and_dwell_are_dropped() -> None:
    """After the lowest position a relaxing force, a jitter and a pull of -12 N are not part of the curve."""
    down = made(position=True, release=False, after=0.0)
    assert down.position is not None
    steps = np.arange(1, 401) / 200.0
    jitter = 2e-5 * np.random.default_rng(3).normal(size=400)
    up = np.where(steps < 1.0, jitter, SPEED * (steps - 1.0))
    after = np.where(steps < 1.0, PEAK * np.exp(-3.0 * steps), -12.0)
    whole = replace(
        down,
        time=np.concatenate([down.time, down.time[-1] + steps]),
        force=np.concatenate([down.force, LEVEL + after]),
        position=np.concatenate([down.position, down.position[-1] + up]),
    )
    one, two = condition(down), condition(whole)
    # the stroke ends where the knife is within 0.1 mm of its lowest point
    assert two.stroke_length_m == pytest.approx(one.stroke_length_m, abs=0.1e-3)
    np.testing.assert_allclose(two.curve, one.curve, atol=0.1)
    assert len(two.force) == len(whole.time)


def test_t_end_cuts_the_record() -> None:
    """What comes after t_end, such as the knife meeting the board, changes nothing before it."""
    cut = made(release=False)
    board = replace(cut, force=cut.force + np.where(cut.time > 2.3, 500.0, 0.0))
    one, two = (condition(t, speed=SPEED, t_end=2.2) for t in (cut, board))
    np.testing.assert_array_equal(one.curve, two.curve)
    assert one.stroke_length_m == pytest.approx(1.2 * SPEED, rel=0.02)
    for t_end in (0.01, 99.0):
        with pytest.raises(TraceError, match="--t-end"):
            condition(cut, speed=SPEED, t_end=t_end)


def test_unsteady_motion_is_undone_by_the_position() -> None:
    """With a knife that speeds up fivefold, the force over the stroke is still the straight line."""
    time = np.arange(700) / 200.0
    depth = 0.03 * np.clip((time - 0.5) / 2.5, 0.0, 1.0) ** 2 - 0.01
    force = 3.0 + 800.0 * np.maximum(depth, 0.0) + 0.02 * np.random.default_rng(1).normal(size=700)
    cut = condition(Trace(time, force, -depth, "ramp.csv", "", {}))
    assert cut.stroke_length_m == pytest.approx(0.02, rel=0.01)
    np.testing.assert_allclose(cut.curve[20:], 800.0 * cut.stroke[20:], atol=0.3)


def test_position_noise_does_not_fold_the_curve() -> None:
    """A position that jitters by 30 um still gives a force that is single-valued and right."""
    cut = made(position=True)
    assert cut.position is not None
    jitter = 3e-5 * np.random.default_rng(2).normal(size=len(cut.time))
    noisy = condition(replace(cut, position=cut.position + jitter))
    np.testing.assert_allclose(noisy.curve[:200], truth(noisy.stroke[:200]), atol=0.6)


@pytest.mark.parametrize(
    ("back", "noise", "said"), [(0.0, 1e-3, 0), (1.2e-2, 0.0, 1), (1.2e-2, 1e-4, 1), (4e-3, 0.0, 0)]
)
def test_a_knife_that_goes_up_within_its_stroke_is_said(back: float, noise: float, said: int) -> None:
    """By how much; a position that is as rough as that says nothing."""
    trace = made(position=True)
    assert trace.position is not None
    within = (trace.time > 1.7) & (trace.time < 2.2)
    turned = trace.position + back * np.sin(np.pi * (trace.time - 1.7) / 0.5) * within
    way = noise * np.random.default_rng(0).normal(size=len(turned))
    told = [text for text in condition(replace(trace, position=turned + way)).warnings if "goes up by" in text]
    assert len(told) == said
    if said and not noise:
        smooth_way = 0.05 - SPEED * np.minimum(trace.time, CONTACT + CUT) + (turned - trace.position)
        rise = np.max(smooth_way - np.minimum.accumulate(smooth_way))
        assert f"goes up by {1e3 * rise:.1f} mm" in told[0]


def test_strokes_with_a_withdrawal_keep_what_is_new() -> None:
    """A knife that draws back by 6 mm half-way and goes on shows the force of the advance alone."""
    time = np.arange(900) / 200.0
    steps = np.select([time < 2.0, time < 2.3, time < 2.6], [1.0, -1.0, 1.0], 1.0) * SPEED / 200.0
    depth = np.cumsum(steps) - 0.02
    new = depth >= np.maximum.accumulate(depth)
    force = LEVEL + np.where(new, 700.0 * np.maximum(depth, 0.0), -3.0)
    noise = 0.02 * np.random.default_rng(8).normal(size=900)
    cut = condition(Trace(time, force + noise, -depth, "peck.csv", "", {}))
    np.testing.assert_allclose(cut.curve[20:220], 700.0 * cut.stroke[20:220], atol=0.5)


def test_peak_lies_between_the_samples() -> None:
    """The apex of a 1 mm bump, less what the filter takes off, is found to 0.1 % between grid points."""
    time = np.arange(2201) / 1000.0
    for shift in np.linspace(0.0, 0.2e-3, 9):
        depth = SPEED * time - 0.004
        force = 20.0 * np.exp(-0.5 * ((depth - 0.004 - shift) / 1e-3) ** 2)
        cut = condition(Trace(time, LEVEL + force, -depth, "apex.csv", "", {}))
        step = cut.stroke[1] - cut.stroke[0]
        expected = 20.0 / np.sqrt(1.0 + (FILTER_SD_M**2 + step**2 / 12.0) / 1e-6)
        assert cut.peak_N == pytest.approx(expected, rel=1e-3)


def test_drift_that_cannot_be_told_is_not_claimed() -> None:
    """Neither noise nor a baseline a tenth of the cut long is turned into a drift over the cut."""
    noisy = [condition(made(noise=1.0, seed=s), speed=SPEED).warnings for s in range(20)]
    assert sum(any("drifts by" in w for w in warnings) for warnings in noisy) <= 1
    short = condition(made(noise=0.01, contact=0.2, drift=1.5), speed=SPEED)
    assert not any("drifts by" in w for w in short.warnings)


def test_peak_has_an_uncertainty_that_covers_the_truth() -> None:
    """The plateau's level is 20 N within the uncertainty of the peak, allowing for the largest of many."""
    cuts = [condition(made(seed=s), speed=SPEED) for s in range(20)]
    z = np.array([(c.peak_N - PEAK) / c.peak_sd_N for c in cuts])
    assert 0.0 < z.mean() < 3.0  # the maximum of a noisy plateau lies above it
    assert all(c.baseline_sd_N < c.peak_sd_N < 0.1 for c in cuts)


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_is_no_contact(seed: int) -> None:
    """A trace without a cut is refused with its largest excursion and its noise."""
    trace = made()
    noise = 0.2 * np.random.default_rng(seed).normal(size=len(trace.time))
    with pytest.raises(TraceError, match="no contact found: the largest excursion is 0.* N against a noise of 0.(1|2)"):
        condition(replace(trace, force=LEVEL + noise), speed=SPEED)


def test_constant_force_is_no_contact() -> None:
    """A sensor that was never read out gives the same number all along, and no contact."""
    trace = made()
    with pytest.raises(TraceError, match="no contact found: the largest excursion is 0 N"):
        condition(replace(trace, force=np.full_like(trace.force, LEVEL)), speed=SPEED)


def test_skin_that_gives_way_does_not_end_or_start_the_cut() -> None:
    """Contact is the first rise although the force falls back to nothing after it and then rises higher."""
    trace = made(noise=0.0)
    t = trace.time
    force = np.select([t < 1.0, t < 1.2, t < 1.4, t < 2.5], [0 * t, 50.0 * (t - 1.0), 0 * t, 30.0 * (t - 1.4)])
    noise = 0.1 * np.random.default_rng(4).normal(size=len(t))
    cut = condition(replace(trace, force=force + LEVEL + noise), speed=SPEED)
    assert cut.onset_s == pytest.approx(1.0, abs=0.01)
    assert cut.stroke_length_m == pytest.approx(0.03, rel=0.02)


def test_short_baseline_before_a_slow_rise_is_found() -> None:
    """Two tenths of a second of baseline before two seconds of rise are enough."""
    trace = made(noise=0.0)
    t = trace.time
    noise = 0.1 * np.random.default_rng(6).normal(size=len(t))
    force = np.where(t < 2.4, 9.0 * np.maximum(0.0, t - 0.2), 0.0)
    cut = condition(replace(trace, force=force + LEVEL + noise), speed=SPEED)
    assert cut.onset_s == pytest.approx(0.2, abs=3 * cut.onset_sd_s)
    assert cut.onset_sd_s < 0.03


def test_wrong_sign_names_the_option() -> None:
    """A cut whose resistance is negative asks for the other sign; so does one with a pull on retraction."""
    cut = made()
    with pytest.raises(TraceError, match="the largest sustained excursion is -20.* N.*--sign -"):
        condition(replace(cut, force=-cut.force), speed=SPEED)
    pulled = replace(cut, force=-(cut.force - 5.0 * (cut.time > CONTACT + CUT + 0.1)))
    with pytest.raises(TraceError, match="--sign -"):
        condition(pulled, speed=SPEED)


def test_too_little_baseline() -> None:
    """A record that starts at contact, or three samples before, has no baseline."""
    for contact in (0.0, 0.01):
        with pytest.raises(TraceError, match="before contact.*keep the approach"):
            condition(made(contact=contact), speed=SPEED)


def test_stroke_must_be_known() -> None:
    """Without position, speed and height the stroke is unknown; none of them may be zero, negative or NaN."""
    with pytest.raises(TraceError, match="no position column.*--speed.*--position-col"):
        condition(made())
    for options in ({"speed": 0.0}, {"speed": -1.0}, {"height": float("nan")}):
        with pytest.raises(TraceError, match="must be positive"):
            condition(made(), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speed": 20.0}, "30.* m .from speed.*millimetres"),
        ({"speed": 1e-5}, "millimetres"),
        ({"height": 30.0}, "from height"),
    ],
)
def test_stroke_unit_mix_up(options: dict[str, float], message: str) -> None:
    """A stroke of metres or micrometres is taken for a unit mix-up."""
    with pytest.raises(TraceError, match=message):
        condition(made(), **options)  # type: ignore[arg-type]


def test_position_that_does_not_descend() -> None:
    """A depth given as a height rises after contact and is refused, with the option that helps."""
    cut = made(position=True)
    assert cut.position is not None
    with pytest.raises(TraceError, match="column ee_z_m: the position does not descend after contact.*--position-col"):
        condition(replace(cut, position=-cut.position))


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_peak_unit_mix_up(factor: float) -> None:
    """A peak of millinewtons or tens of kilonewtons is taken for a unit mix-up."""
    cut = made()
    with pytest.raises(TraceError, match="column force_N: the peak is .*force_mN"):
        condition(replace(cut, force=cut.force * factor), speed=SPEED)


def test_noiseless_baseline_is_mentioned() -> None:
    """Digitised data without noise before contact work, but their uncertainty is called too small."""
    cut = condition(made(noise=0.0), speed=SPEED)
    assert cut.noise_sd_N == pytest.approx(0.0, abs=1e-12)
    assert any("hardly varies" in w for w in cut.warnings)


def grid(n: int = 201, length: float = 0.04) -> np.ndarray:
    """A stroke grid of 0.2 mm."""
    return np.linspace(0.0, length, n)


def test_filter_has_no_phase_shift() -> None:
    """A symmetric pulse stays symmetric and centred, and is widened by exactly the filter's variance."""
    s = grid()
    pulse = np.exp(-0.5 * ((s - 0.02) / 1e-3) ** 2)
    out = smooth(s, pulse)
    np.testing.assert_allclose(out, out[::-1], atol=1e-12)
    assert np.argmax(out) == 100
    variance = np.sum(out * (s - 0.02) ** 2) / np.sum(out)
    assert variance == pytest.approx(1e-6 + FILTER_SD_M**2, rel=1e-3)


def test_filter_keeps_straight_lines_and_is_linear() -> None:
    """A straight line passes unchanged, ends included; the filter of a sum is the sum of the filtered."""
    s = grid()
    np.testing.assert_allclose(smooth(s, 3.0 - 500.0 * s), 3.0 - 500.0 * s, atol=1e-9)
    a, b = np.random.default_rng(0).normal(size=(2, len(s)))
    np.testing.assert_allclose(smooth(s, 2.0 * a - b), 2.0 * smooth(s, a) - smooth(s, b), atol=1e-12)
    np.testing.assert_allclose(
        smooth(s, a + b, before=b[:10]), smooth(s, a, before=b[:10]) + smooth(s, b, before=0.0), atol=1e-12
    )


def test_filter_width_is_physical() -> None:
    """Two grids of different spacing give the same filtered curve: the width does not count samples."""
    fine, coarse = grid(801), grid(201)
    step = (fine > 0.02).astype(float) * 10.0 + 100.0 * fine
    on_coarse = resample(fine, step, coarse)
    np.testing.assert_allclose(smooth(fine, step)[::4], smooth(coarse, on_coarse), atol=0.12)


def test_filter_averages_noise_at_the_ends() -> None:
    """Noise is reduced at the last point too, where a mirror image would return the raw sample."""
    s = grid()
    noise = np.random.default_rng(3).normal(size=(500, len(s)))
    out = np.array([smooth(s, row) for row in noise])
    inside = np.sqrt(0.2e-3 / (2.0 * np.sqrt(np.pi) * FILTER_SD_M))
    assert out[:, 100].std() == pytest.approx(inside, rel=0.1)
    assert inside < out[:, -1].std() < 0.85


def test_samples_before_contact_enter_the_filter() -> None:
    """Known zeros before contact lift the first point of a ramp by what a Gaussian mean gives."""
    s = grid()
    ramp = 1000.0 * s
    whole = np.arange(-40, len(s)) * (s[1] - s[0])
    expected = smooth(whole, np.maximum(0.0, 1000.0 * whole))[40:]
    np.testing.assert_allclose(smooth(s, ramp, before=0.0), expected, atol=1e-9)
    # mean of max(0, x) over a Gaussian: sd / sqrt(2 pi)
    assert expected[0] == pytest.approx(1000.0 * FILTER_SD_M / np.sqrt(2.0 * np.pi), rel=0.02)


def test_simulated_and_measured_curves_pass_the_same_filter() -> None:
    """The exact force of a noiseless cut, filtered as a simulation, is the conditioned curve."""
    cut = condition(made(noise=0.0, position=True, rate=1000.0))
    fine = np.linspace(1e-5, 0.0301, 4000)
    sim = filter_simulated(cut.stroke, fine, truth(fine))
    np.testing.assert_allclose(sim[:225], cut.curve[:225], atol=0.03)
    with pytest.raises(CurveError, match="simulate or record the whole stroke"):
        filter_simulated(cut.stroke, fine[:3000], truth(fine[:3000]))


def test_resampling_averages_instead_of_picking() -> None:
    """A ripple finer than the grid averages out, while picking every tenth sample would return it whole."""
    fine = np.linspace(0.0, 0.04, 2001)
    ripple = np.cos(np.pi * np.arange(2001))
    out = resample(fine, 5.0 + 100.0 * fine + ripple, grid())
    np.testing.assert_allclose(out, 5.0 + 100.0 * grid(), atol=0.06)
    assert np.ptp(ripple[::10]) == 0.0 and ripple[0] == 1.0


def test_resampling_is_exact_for_lines_and_for_repeated_strokes() -> None:
    """A straight line survives any uneven sampling; samples at one stroke count by their mean."""
    uneven = np.sort(np.concatenate([[0.0, 0.04], 0.04 * np.random.default_rng(0).random(300)]))
    np.testing.assert_allclose(resample(uneven, 2.0 + 300.0 * uneven, grid()), 2.0 + 300.0 * grid(), atol=1e-9)
    twice = np.repeat(uneven, 2)
    force = 2.0 + 300.0 * twice + np.tile([1.0, -1.0], len(uneven))
    np.testing.assert_allclose(resample(twice, force, grid()), 2.0 + 300.0 * grid(), atol=1e-9)


def test_filters_refuse_bad_grids() -> None:
    """An uneven grid, a decreasing stroke, and a width that is no width are refused."""
    s = grid()
    with pytest.raises(CurveError, match="not uniform"):
        smooth(s**2, s)
    with pytest.raises(CurveError, match="must be positive"):
        smooth(s, s, 0.0)
    with pytest.raises(CurveError, match="never decreases"):
        resample(s[::-1], s, s)
    with pytest.raises(CurveError, match="increasing points"):
        smooth(s[::-1], s)


def test_forces_of_nothing_are_no_contact() -> None:
    """A force that varies by less than a micronewton, down to where squares vanish, is refused before it is fitted."""
    for scale in (1e-8, 1e-160, 1e-300):
        with pytest.raises(TraceError, match="column force_N: no contact found: the force varies by .* in all; check"):
            condition(replace(made(), force=made().force * scale), speed=SPEED)


def test_position_without_a_way_down() -> None:
    """A position that is at its lowest in the first samples, or never moves, is named before a baseline is looked
    for."""
    trace = made(position=True)
    for height in (np.full(len(trace.time), 0.1), np.where(trace.time < 0.02, 0.1, 0.05)):
        with pytest.raises(TraceError, match="column ee_z_m: the position is at its lowest after [0-9]+ samples"):
            condition(replace(trace, position=height))


def test_conditioned_refuses_broken_curves() -> None:
    """A curve with NaN cannot become a conditioned cut."""
    cut = condition(made(), speed=SPEED)
    with pytest.raises(TraceError, match="not finite"):
        replace(cut, curve=cut.curve * np.nan)


def banana() -> Any:
    """The script that writes the reconstructed banana, as a module."""
    spec = importlib.util.spec_from_file_location("banana", ROOT / "force_data" / "reconstruct_banana.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_banana_is_reproduced_to_the_last_byte() -> None:
    """The committed reconstruction is what its script writes."""
    assert (ROOT / "force_data" / "banana_reconstructed.csv").read_bytes() == banana().text().encode()


@pytest.mark.parametrize("options", [{"height": 0.030}, {"speed": 0.030 / 1.8}])
def test_banana_has_the_published_peak_and_baseline(options: dict[str, float]) -> None:
    """The reconstruction shows 12.5 N within 1 % above about 25 N, and says that it is no measurement."""
    trace = read_trace(ROOT / "force_data" / "banana_reconstructed.csv")
    cut = condition(trace, **options)  # type: ignore[arg-type]
    assert cut.peak_N == pytest.approx(12.5, rel=0.01)
    assert cut.baseline_N == pytest.approx(25.0, abs=0.2)
    assert cut.onset_s == pytest.approx(1.0, abs=2 * cut.onset_sd_s)
    assert cut.stroke_length_m == pytest.approx(0.030, rel=0.02)
    assert any("not a measurement" in w for w in cut.warnings)


PUBLISHED = [
    # cut, air run, contact by threshold [s], travel [mm], peak [N], work [J]
    ("apple1_edc_cut1", "apple_session_edc_air", 1.040, 38.92, 45.93, 1.342),
    ("cucumber_edc_cut1", "cucumber_session_edc_air1", 1.058, 39.46, 20.52, 0.4143),
    ("cucumber_edc_cut2", "cucumber_session_edc_air1", 1.066, 38.91, 51.04, 0.6335),
    ("potato_edc_slow_cut1", "potato_session_edc_air1", 2.274, 46.64, 57.70, 1.953),
    ("potato_edc_slow_cut2", "potato_session_edc_air1", 2.244, 48.73, 39.99, 1.3815),
]


def measured(cut: str, air: str) -> Conditioned:
    """A conditioned robot log with its air run."""
    folder = "franka_knife_cutting"
    return condition(read_trace(data_file(folder, f"{cut}.csv")), air=read_trace(data_file(folder, f"{air}.csv")))


@pytest.mark.parametrize(("cut", "air", "contact", "travel", "peak", "work"), PUBLISHED)
def test_robot_logs(cut: str, air: str, contact: float, travel: float, peak: float, work: float) -> None:
    """Contact comes just before a 1 N threshold trips, work agrees, peaks lose little to the filter.

    The force of the second potato leaves its noise some 2 mm before it trips the threshold, that of the others less.
    """
    done = measured(cut, air)
    assert contact - 0.1 < done.onset_s < contact
    assert travel < 1e3 * done.stroke_length_m < travel + 2.0
    assert 0.95 * peak < done.peak_N < 1.01 * peak
    integral = float(np.sum(0.5 * np.diff(done.stroke) * (done.curve[1:] + done.curve[:-1])))
    assert integral == pytest.approx(work, rel=0.025)
    columns = "not used: ee_x_m, ee_y_m, ee_vz_m_s, base_Fx_N, base_Fy_N and 17 more columns"
    assert done.warnings == (f"{cut}.csv: {columns}",)


def test_robot_log_without_air_run_is_warned_about() -> None:
    """The same cut with a constant baseline works and says that the force before contact moved."""
    done = condition(read_trace(data_file("franka_knife_cutting", "cucumber_edc_cut1.csv")))
    assert done.baseline_kind == "constant"
    assert any("--air" in w for w in done.warnings)


def test_slow_log_stops_before_the_board() -> None:
    """A 10 Hz log whose air run meets the board at 4.8 s is usable up to there."""
    folder = "franka_knife_cutting"
    cut, air = (read_trace(data_file(folder, f"cucumber_slow10hz_{k}.csv")) for k in ("cut1", "air"))
    done = condition(cut, air=air, t_end=4.8)
    assert done.onset_s == pytest.approx(2.0, abs=0.15)
    assert done.peak_N == pytest.approx(10.0, abs=0.5)


@pytest.mark.parametrize(("food", "length", "peak"), [("cucumber", 0.0227, 16.0), ("potato", 0.0369, 28.5)])
def test_digitised_cuts(food: str, length: float, peak: float) -> None:
    """Curves digitised from a figure start at about 0.15 s and need the published speed."""
    done = condition(read_trace(data_file("sliceit_digitised", f"{food}_20mms.csv")), speed=SPEED)
    assert done.onset_s == pytest.approx(0.152, abs=0.005)
    assert done.stroke_length_m == pytest.approx(length, rel=0.01)
    assert done.peak_N == pytest.approx(peak, rel=0.01)


def falling(fall: float, rest: float = 0.003) -> Trace:
    """A cut of 40 mm whose force falls from 20 N to nothing over the last ``fall`` m; ``rest`` m of stroke come after,
    in which the arm rings."""
    stroke = np.arange(-0.01, 0.04 + rest, 1e-4)
    level = 20 * np.clip(stroke / 0.004, 0, 1) * np.clip((0.04 - stroke) / fall, 0, 1)
    ring = -4.0 * np.sin(2 * np.pi * (stroke - 0.04) / 0.002) * np.exp(-(stroke - 0.04) / 0.001) * (stroke > 0.04)
    noise = np.random.default_rng(3).normal(0, 0.05, len(stroke))
    return Trace(
        stroke / SPEED, level + ring + noise, 0.09 - stroke, "fruit.csv", "", {"position": "z_m"}, label="measured"
    )


def test_the_edge_is_through_where_the_force_falls_to_little() -> None:
    """A steep fall before the stroke's end is the height of the food; what rings behind it is no cut."""
    cut = condition(falling(0.002))
    assert cut.stroke_length_m == pytest.approx(0.040, abs=4e-4)
    assert any("edge is through" in text for text in cut.warnings)
    assert cut.curve[-1] < 0.1 * cut.peak_N


def test_the_edge_is_through_before_it_comes_to_the_board() -> None:
    """A fall, two millimetres of nothing and the board: the height is where the force fell."""
    cut = falling(0.002)
    stroke = 0.08 - cut.position if cut.position is not None else np.zeros(0)
    board = np.clip(55e3 * (stroke - 0.0422), 0.0, None)
    seen = condition(replace(cut, force=cut.force + board))
    assert seen.stroke_length_m == pytest.approx(0.040, abs=4e-4) and not seen.at_board
    assert any("edge is through" in text for text in seen.warnings)
    told = condition(replace(cut, force=cut.force + board), board=0.0395)
    assert told.stroke_length_m == pytest.approx(0.0395)


@pytest.mark.parametrize(("fall", "rest"), [(0.02, 0.003), (0.002, 0.0005)])
def test_a_fall_that_says_nothing_of_the_board_is_left_in(fall: float, rest: float) -> None:
    """A force that falls with the chord, or at the very end, leaves the stroke as it is."""
    cut = condition(falling(fall, rest))
    assert cut.stroke_length_m == pytest.approx(0.04 + rest, abs=4e-4)
    assert not any("edge is through" in text for text in cut.warnings)


def test_the_board_may_be_a_reading_of_the_height() -> None:
    """The stroke ends where the height reads what it does on the board, also where the column is a depth."""
    trace = falling(0.02)
    assert trace.position is not None
    assert condition(trace, board_z=0.050).stroke_length_m == pytest.approx(0.040, abs=2e-4)
    depth = replace(trace, position=trace.position - 0.1)
    assert condition(depth, board_z=0.050).stroke_length_m == pytest.approx(0.040, abs=2e-4)
    with pytest.raises(TraceError, match="--board-z 0.3 m is no height below contact"):
        condition(trace, board_z=0.3)
    with pytest.raises(TraceError, match="the trace has none"):
        condition(replace(trace, position=None), speed=SPEED, board_z=0.05)


def test_a_force_is_filtered_as_its_sensor_does() -> None:
    """A step of a fast knife is the step response of a Butterworth low-pass in closed form, less its delay."""
    speed, cut_off = 2.0, 15.0  # [m/s, Hz]: so fast that the filter over the stroke is none beside the sensor's
    grid = np.linspace(0.0, 0.4, N_STROKE)
    stroke = np.linspace(0.0, 0.5, 5001)
    got = BandLimited(cut_off, grid, grid / speed)(grid, stroke, np.where(stroke > 0.1, 1.0, 0.0))
    part = 2.0 * np.pi * cut_off / np.sqrt(2.0)
    time = np.maximum(grid / speed + 1.0 / part - 0.1 / speed, 0.0)
    want = 1.0 - np.exp(-part * time) * (np.cos(part * time) + np.sin(part * time))
    np.testing.assert_allclose(got, want, atol=4e-3)


def test_what_changes_slowly_passes_a_sensor_without_delay() -> None:
    """A ramp comes through as it is, and a high cut-off changes nothing at all."""
    grid = np.linspace(0.0, 0.04, N_STROKE)
    clock = grid / 0.02
    stroke = np.linspace(0.0, 0.041, 500)
    got = BandLimited(15.0, grid, clock)(grid, stroke, 250.0 * stroke)
    late = grid > 0.01
    np.testing.assert_allclose(got[late], 250.0 * grid[late], rtol=4e-3)
    plain = filter_simulated(grid, stroke, np.sqrt(stroke))
    for none in (np.inf, 1e5):
        np.testing.assert_array_equal(BandLimited(none, grid, clock)(grid, stroke, np.sqrt(stroke)), plain)
    with pytest.raises(TraceError, match=r"--bandwidth 0\.015 Hz: give the cut-off"):
        BandLimited(0.015, grid, clock)


def test_a_filtered_record_is_that_of_the_filtered_simulation() -> None:
    """A cut whose skin parts at once, logged behind a low-pass: wherever contact is within its delay, the force is that
    of the simulation to 1 % of the peak once the same low-pass is known, and off by 5 % without it."""
    time, speed = np.arange(0.0, 1.5, 1e-3), 0.05
    stroke = speed * (time - 0.5)
    force = np.where(stroke < 0.012, 24.0 * np.maximum(stroke / 0.012, 0.0) ** 1.5, 10.0)
    logged = lfilter(*butter(2, 12.0, fs=1e3), force) + 5.0
    cut = condition(Trace(time, logged, -stroke, "made.csv", ""))
    way = np.linspace(0.0, 0.05, 4000)
    sent = np.interp(way, stroke, force)
    moves = np.linspace(-1.0, 1.0, 81) * delay_of(12.0) * speed

    def missed(cut_off: float) -> float:
        found = BandLimited(cut_off, cut.stroke, cut.clock)(cut.stroke, way, sent)
        shifted = [np.interp(cut.stroke + move, cut.stroke, found) for move in moves]
        return min(float(np.max(np.abs(one - cut.curve)[3:-3])) for one in shifted) / 24.0

    assert missed(12.0) < 0.01 and missed(np.inf) > 0.04
