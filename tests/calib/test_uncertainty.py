"""Intervals that cover, verdicts that are earned, and a process that tells signal from noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.objective import Evaluation, Objective, Target, Trial
from calib.parameters import Z95, Parameter, ParameterSet
from calib.uncertainty import CurveProcess, Uncertainty, uncertainty

POINTS, CORRELATION = 240, 0.05
X = np.linspace(0.0, 1.0, POINTS)

#: Sensitivities of the curve [standard deviations per unit of the internal coordinate]: a plateau, a ramp, a
#: bump.
BASIS = np.column_stack([1.0 - np.exp(-X / 0.1), X, 1.5 * np.exp(-(((X - 0.2) / 0.1) ** 2))])
WEIGHT = math.sqrt(1.0 / CORRELATION / POINTS)


def parameters(count: int = 3, value: float = 1.0) -> ParameterSet:
    """Log parameters with priors of one unit (a factor e) standard deviation about 1."""
    end = math.exp(Z95)
    return ParameterSet(tuple(Parameter(f"p{k}", value, 1e-9, 1e9, "-", 1 / end, end) for k in range(count)))


def correlated_noise(random: np.random.Generator) -> np.ndarray:
    """Noise of unit variance whose autocorrelation integrates to the correlation length (240,)."""
    grid = np.linspace(-0.2, 1.2, 700)
    kernel = np.exp(-0.5 * ((X[:, None] - grid) * 2.0 * math.sqrt(math.pi) / CORRELATION) ** 2)
    return (kernel / np.linalg.norm(kernel, axis=1)[:, None]) @ random.standard_normal(grid.size)


def linear_fit(random: np.random.Generator, noise: float) -> tuple[np.ndarray, Uncertainty]:
    """Draw a truth from the prior and fit its noisy trace exactly; the truth and what the fit says of it."""
    truth = random.standard_normal(3)
    data = BASIS @ truth + noise * correlated_noise(random)
    jacobian = np.vstack([WEIGHT * BASIS, np.eye(3)])
    z = np.linalg.lstsq(jacobian, np.concatenate([WEIGHT * data, np.zeros(3)]), rcond=None)[0]
    residual = np.concatenate([WEIGHT * (BASIS @ z - data), z])
    fitted = parameters().with_values({f"p{k}": math.exp(x) for k, x in enumerate(z)})
    return truth, uncertainty(fitted, jacobian, residual, effective_rows=1.0 / CORRELATION)


def coverage(noise: float) -> np.ndarray:
    """In how many of 100 synthetic traces the 95 % interval of each parameter contains the truth (3,)."""
    random = np.random.default_rng(1)
    hits = np.zeros(3, dtype=int)
    for _ in range(100):
        truth, found = linear_fit(random, noise)
        hits += [i.low95 <= math.exp(t) <= i.high95 for i, t in zip(found.intervals, truth, strict=True)]
    return hits


def test_95_percent_intervals_cover_95_percent() -> None:
    """100 synthetic traces with the stated errors: each interval contains the truth 90 to 99 times."""
    hits = coverage(noise=1.0)
    assert np.all((hits >= 90) & (hits <= 99)), hits


def test_intervals_cover_where_errors_are_three_times_the_stated_ones() -> None:
    """Understated errors show in chi-square; widened by it, the intervals still cover."""
    hits = coverage(noise=3.0)
    assert np.all(hits >= 88), hits


def known(jacobian: np.ndarray, *, reduced: float = 0.5, count: int | None = None) -> Uncertainty:
    """Uncertainty for data rows (k, p) at the prior centre with a given chi-square per row."""
    p = jacobian.shape[1] if count is None else count
    rows = np.vstack([jacobian, np.eye(p)])
    residual = np.zeros(len(rows))
    residual[0] = math.sqrt(reduced * 100.0)
    return uncertainty(parameters(p), rows, residual, effective_rows=100.0)


def test_closed_form_of_one_parameter() -> None:
    """Sensitivity 3 and prior sd 1: posterior variance 1 / (9 + 1), symmetric in the logarithm."""
    found = known(np.array([[3.0]]), reduced=0.5)
    interval = found.intervals[0]
    assert interval.width == pytest.approx(math.sqrt(0.1))
    assert interval.high95 == pytest.approx(math.exp(Z95 * math.sqrt(0.1))) and interval.low95 < 1.0
    assert interval.low95 * interval.high95 == pytest.approx(1.0)
    assert interval.verdict == "identified" and not interval.clipped
    assert set(interval.as_dict()) == {
        "value",
        "unit",
        "low95",
        "high95",
        "prior_low",
        "prior_high",
        "verdict",
    }


@pytest.mark.parametrize(
    ("sensitivity", "verdict"), [(0.0, "not_seen"), (0.45, "not_seen"), (1.0, "weak"), (1.8, "identified")]
)
def test_verdict_follows_the_width(sensitivity: float, verdict: str) -> None:
    """Posterior widths 1, 0.91, 0.71 and 0.49 of the prior: not seen, not seen, weak, identified."""
    assert known(np.array([[sensitivity]])).intervals[0].verdict == verdict


def test_unseen_parameter_keeps_its_prior() -> None:
    """A misfit of the curve widens what the cut says; it does not make the literature less certain."""
    found = known(np.array([[5.0, 0.0]]), reduced=25.0)
    seen, unseen = found.intervals
    assert unseen.width == pytest.approx(1.0) and unseen.high95 == pytest.approx(unseen.parameter.prior_high)
    assert found.reduced_chi2 == pytest.approx(25.0, rel=0.02)
    assert seen.width == pytest.approx(1.0 / math.sqrt(25.0 / found.reduced_chi2 + 1.0))


def test_a_small_misfit_does_not_narrow_the_intervals() -> None:
    """A chi-square below its expectation is luck, or errors stated too large: the interval stays."""
    assert known(np.array([[3.0]]), reduced=0.01).intervals[0].width == pytest.approx(math.sqrt(0.1))


def test_interval_ends_at_the_hard_bound() -> None:
    """Half an interval beyond a bound is cut off and flagged; an estimate on the bound is called so."""
    near = Parameter("mu", 0.02, 0.0, 1.0, "-", 0.0, 0.6, "linear")
    rows = np.array([[20.0], [1.0 / near.prior_sd]])
    for value, verdict in ((0.02, "identified"), (0.0, "at_bound")):
        found = uncertainty(ParameterSet((near,)).with_values({"mu": value}), rows, np.zeros(2), effective_rows=20.0)
        interval = found.intervals[0]
        assert interval.low95 == 0.0 and interval.clipped and interval.verdict == verdict
        assert interval.high95 > value + 0.05


@pytest.mark.parametrize(("row", "combination"), [([9.0, 9.0], "p0 * p1"), ([9.0, -9.0], "p0 / p1")])
def test_only_the_product_or_the_ratio_is_known(row: list[float], combination: str) -> None:
    """Two parameters that act only together are reported as their product, or as their ratio."""
    found = known(np.array([row]))
    assert [tie.combination for tie in found.only_as_product] == [combination]
    assert abs(found.correlation[0, 1]) == pytest.approx(81.0 / 82.0)
    best, worst = found.directions
    assert best.width == pytest.approx(1.0 / math.sqrt(163.0)) and worst.width == pytest.approx(1.0)
    assert best.weights["p0"] * best.weights["p1"] * row[1] > 0.0


def test_independent_parameters_are_not_tied() -> None:
    """Orthogonal sensitivities give no hint, and directions along the axes."""
    found = known(np.diag([9.0, 2.0]))
    assert found.only_as_product == () and found.correlation == pytest.approx(np.eye(2))
    assert [abs(found.directions[0].weights[n]) for n in ("p0", "p1")] == pytest.approx([1.0, 0.0])


# The process: curves in which one parameter scales, one shifts, and one does nothing.

PEAK = 10.0
THREE = ParameterSet(
    (
        Parameter("E", 1e5, 1e3, 1e7, "Pa", 2.5e4, 4e5),
        Parameter("depth", 0.01, 1e-3, 0.1, "m", 5e-3, 2e-2),
        Parameter("idle", 1.0, 1e-2, 1e2, "-", 0.25, 4.0),
    )
)


def cut(z: np.ndarray) -> np.ndarray:
    """Force over the stroke at internal coordinates, without noise [N] (240,)."""
    values = THREE.to_dict(z)
    return PEAK * values["E"] / 1e5 * (1.0 - np.exp(-0.04 * X / values["depth"])) / (1.0 - math.exp(-4.0))


def goal() -> Objective:
    """The objective of the cut at the values."""
    target = Target(0.04 * X, cut(THREE.start), 0.0, 0.0, lambda grid, s, f: np.interp(grid, s, f))
    return Objective(target, THREE)


def trials(count: int, noise: float, spread: float = 0.3, seed: int = 2) -> list[Trial]:
    """Runs at and about the values, with correlated noise (part of the peak)."""
    random, objective = np.random.default_rng(seed), goal()
    points = THREE.start + spread * random.standard_normal((count, 3)) * (np.arange(count) > 0)[:, None]
    out = []
    for z in points:
        force = cut(z) * (1.0 + noise * correlated_noise(random))
        out.append(objective.trial(Evaluation(0, THREE.to_dict(z), "ok", "", 1.0, 0.04 * X, force)))
    return out


def true_jacobian(z: np.ndarray) -> np.ndarray:
    """Jacobian of the noise-free residual vector by central differences (k, 3)."""
    objective = goal()
    rows = [
        objective.residual(cut(z + d), 1.0, z + d) - objective.residual(cut(z - d), 1.0, z - d)
        for d in np.eye(3) * 1e-4
    ]
    return np.array(rows).T / 2e-4


def test_process_goes_through_the_runs_and_knows_where_it_does_not() -> None:
    """Between noise-free runs the curve is met to 1 % of the peak; doubt is small there, large far away."""
    runs = trials(25, noise=0.0)
    process = CurveProcess(goal(), runs, runs[0])
    z = THREE.start + np.array([0.15, -0.1, 0.1])
    assert np.abs(process.predict(z)[0] - cut(z)).max() < 0.01 * PEAK
    assert process.doubt(z) < 0.3 * process.doubt(z + 3.0)


def test_process_scales_force_with_stress_exactly() -> None:
    """From a single run the force at 5 times the stress-like parameter is 5 times the force."""
    run = trials(1, noise=0.0)
    process = CurveProcess(goal(), run, run[0])
    z = THREE.start + np.array([math.log(5.0), 0.0, 0.0])
    assert process.predict(z)[0] == pytest.approx(cut(z), abs=0.02 * PEAK)


def test_process_estimates_the_noise_of_a_run() -> None:
    """The noise of curves of 2 % is found to a third from 40 runs."""
    runs = trials(40, noise=0.02)
    assert CurveProcess(goal(), runs, runs[0]).noise == pytest.approx(0.02, rel=0.35)


def test_jacobian_of_noise_free_runs_is_the_true_one() -> None:
    """Without noise the process's Jacobian is the derivative of the residual vector to 5 %."""
    runs = trials(40, noise=0.0, spread=0.2)
    found, true = CurveProcess(goal(), runs, runs[0]).jacobian(THREE.start), true_jacobian(THREE.start)
    assert np.linalg.norm(found - true) < 0.05 * np.linalg.norm(true)


def test_noise_does_not_pass_for_information() -> None:
    """With 2 % noise the idle parameter stays unseen in nine of ten fits.

    Forward differences over 10 % of the same curves call it identified nearly always.
    """
    unseen = claimed = 0
    for seed in range(10):
        runs = trials(25, noise=0.02, seed=seed)
        jacobian = CurveProcess(goal(), runs, runs[0]).jacobian(THREE.start)
        found = uncertainty(THREE, jacobian, runs[0].residual, effective_rows=goal().effective_rows)
        unseen += found.intervals[2].verdict == "not_seen"
        assert found.intervals[0].verdict == "identified"
        plain = jacobian.copy()
        change = trials(1, noise=0.02, seed=100 + seed)[0].residual - runs[0].residual
        plain[:-3, 2] = change[:-3] / math.log(1.1)
        naive = uncertainty(THREE, plain, runs[0].residual, effective_rows=goal().effective_rows)
        claimed += naive.intervals[2].verdict == "identified"
    assert unseen >= 9 and claimed >= 9


def test_coarse_runs_inform_through_their_common_offset() -> None:
    """Coarse curves that are all 8 % too strong teach the response without moving the fine curve."""
    runs = trials(1, noise=0.0)
    for t in trials(15, noise=0.0, seed=3)[1:]:
        runs.append(Trial(t.z, t.evaluation, 1.08 * t.curve, t.residual, coarse=True))
    process = CurveProcess(goal(), runs, runs[0])
    z = THREE.start + np.array([0.0, 0.25, 0.0])
    assert np.abs(process.predict(THREE.start)[0] - cut(THREE.start)).max() < 0.015 * PEAK
    assert np.abs(process.predict(z)[0] - cut(z)).max() < 0.03 * PEAK


def test_broken_runs_are_expected_to_break_again() -> None:
    """Where a run broke down at 40 % of the stroke the process expects that again; not at a good one."""
    runs = trials(8, noise=0.0)
    z = THREE.start + np.array([0.0, 0.0, 1.5])
    part = slice(0, 96)
    broken = Evaluation(0, THREE.to_dict(z), "failed", "inverted", 0.4, 0.04 * X[part], cut(z)[part])
    runs.append(goal().trial(broken))
    process = CurveProcess(goal(), runs, runs[0])
    assert process.predict(z)[2] < 0.8 and process.predict(THREE.start)[2] == 1.0
    assert process.expected(z, 0.0) > process.expected(THREE.start, 0.0) + 100.0


def test_a_failure_is_no_measurement() -> None:
    """The penalty of runs that broke down adds nothing to the information of the Jacobian."""
    runs = trials(8, noise=0.0)
    z = THREE.start + np.array([0.0, 0.0, 1.5])
    part = slice(0, 96)
    broken = Evaluation(0, THREE.to_dict(z), "failed", "inverted", 0.4, 0.04 * X[part], cut(z)[part])
    process = CurveProcess(goal(), [*runs, goal().trial(broken)], runs[0])
    assert process.residual(z)[goal().data_rows - 1] > 10.0
    assert np.all(process.jacobian(z)[goal().data_rows - 1] == 0.0)


def test_least_stays_within_bounds_and_radius() -> None:
    """The proposed point is better than the best run, within the radius and the hard bounds."""
    runs = trials(25, noise=0.0)[1:]
    best = min(runs, key=lambda t: t.misfit)
    process = CurveProcess(goal(), runs, best)
    z = process.least(best.z, 1.0, 1.0)
    assert process.expected(z, 1.0) < process.expected(best.z, 1.0)
    close = process.least(best.z, 0.01, 1.0)
    assert np.abs(close - best.z).max() <= 0.01 + 1e-6
    assert np.all(z >= THREE.lower) and np.all(z <= THREE.upper)
