"""A process that tells signal from noise: curves in which one parameter scales, one shifts, and one does nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.fit.surrogate import Surrogate
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.scored_run import ScoredRun
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluation
from calib.uncertainty.intervals import linearised_likelihood, uncertainty
from tests.calib.synthetic import X, correlated_noise

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


def trials(count: int, noise: float, spread: float = 0.3, seed: int = 2) -> list[ScoredRun]:
    """Runs at and about the values, with correlated noise (part of the peak)."""
    random, objective = np.random.default_rng(seed), goal()
    points = THREE.start + spread * random.standard_normal((count, 3)) * (np.arange(count) > 0)[:, None]
    out = []
    for z in points:
        force = cut(z) * (1.0 + noise * correlated_noise(random))
        out.append(objective.score(Evaluation(0, THREE.to_dict(z), "ok", "", 1.0, 0.04 * X, force)))
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
    process = Surrogate(goal(), runs, runs[0])
    z = THREE.start + np.array([0.15, -0.1, 0.1])
    assert np.abs(process.each[0].predict(z)[0] - cut(z)).max() < 0.01 * PEAK
    unknown, far = (process.expected(x, 1.0) - process.expected(x, 0.0) for x in (z, z + 3.0))
    assert unknown < 0.3**2 * far


def test_process_scales_force_with_stress_exactly() -> None:
    """From a single run the force at 5 times the stress-like parameter is 5 times the force."""
    run = trials(1, noise=0.0)
    process = Surrogate(goal(), run, run[0])
    z = THREE.start + np.array([math.log(5.0), 0.0, 0.0])
    assert process.each[0].predict(z)[0] == pytest.approx(cut(z), abs=0.02 * PEAK)


def test_process_estimates_the_noise_of_a_run() -> None:
    """The noise of curves of 2 % is found to a third from 40 runs."""
    runs = trials(40, noise=0.02)
    assert Surrogate(goal(), runs, runs[0]).noise == pytest.approx(0.02, rel=0.35)


def test_jacobian_of_noise_free_runs_is_the_true_one() -> None:
    """Without noise the process's Jacobian is the derivative of the residual vector to 5 %."""
    runs = trials(40, noise=0.0, spread=0.2)
    found, true = Surrogate(goal(), runs, runs[0]).jacobian(THREE.start), true_jacobian(THREE.start)
    assert np.linalg.norm(found - true) < 0.05 * np.linalg.norm(true)


def test_fewer_runs_than_parameters_have_a_jacobian() -> None:
    """A search that begins anew has one where two runs of three parameters ended."""
    runs = trials(2, 0.01)
    jacobian = Surrogate(goal(), runs, runs[0]).jacobian(THREE.start)
    assert np.isfinite(jacobian).all() and jacobian.shape == true_jacobian(THREE.start).shape


def test_noise_does_not_pass_for_information() -> None:
    """With 2 % noise the idle parameter stays unseen in nine of ten fits.

    Forward differences over 10 % of the same curves call it identified nearly always.
    """
    unseen = claimed = 0
    for seed in range(10):
        runs = trials(25, noise=0.02, seed=seed)
        jacobian = Surrogate(goal(), runs, runs[0]).jacobian(THREE.start)
        found = uncertainty(THREE, linearised_likelihood(goal(), runs[0], jacobian))
        unseen += found.intervals[2].verdict == "not_seen"
        assert found.intervals[0].verdict == "identified"
        plain = jacobian.copy()
        change = trials(1, noise=0.02, seed=100 + seed)[0].residual - runs[0].residual
        plain[:-3, 2] = change[:-3] / math.log(1.1)
        naive = uncertainty(THREE, linearised_likelihood(goal(), runs[0], plain))
        claimed += naive.intervals[2].verdict == "identified"
    assert unseen >= 9 and claimed >= 9


def test_coarse_runs_inform_through_their_common_offset() -> None:
    """Coarse curves that are all 8 % too strong teach the response without moving the fine curve."""
    runs = trials(1, noise=0.0)
    for t in trials(15, noise=0.0, seed=3)[1:]:
        runs.append(ScoredRun(t.z, t.evaluation, 1.08 * t.curve, t.residual, coarse=True))
    process = Surrogate(goal(), runs, runs[0])
    z = THREE.start + np.array([0.0, 0.25, 0.0])
    assert np.abs(process.each[0].predict(THREE.start)[0] - cut(THREE.start)).max() < 0.015 * PEAK
    assert np.abs(process.each[0].predict(z)[0] - cut(z)).max() < 0.03 * PEAK


def test_broken_runs_are_expected_to_break_again() -> None:
    """Where a run broke down at 40 % of the stroke the process expects that again; not at a good one."""
    runs = trials(8, noise=0.0)
    z = THREE.start + np.array([0.0, 0.0, 1.5])
    part = slice(0, 96)
    broken = Evaluation(0, THREE.to_dict(z), "failed", "inverted", 0.4, 0.04 * X[part], cut(z)[part])
    runs.append(goal().score(broken))
    process = Surrogate(goal(), runs, runs[0])
    assert process.each[0].predict(z)[2] < 0.8 and process.each[0].predict(THREE.start)[2] == 1.0
    assert process.expected(z, 0.0) > process.expected(THREE.start, 0.0) + 100.0


def test_a_failure_is_no_measurement() -> None:
    """The penalty of runs that broke down adds nothing to the information of the Jacobian."""
    runs = trials(8, noise=0.0)
    z = THREE.start + np.array([0.0, 0.0, 1.5])
    part = slice(0, 96)
    broken = Evaluation(0, THREE.to_dict(z), "failed", "inverted", 0.4, 0.04 * X[part], cut(z)[part])
    process = Surrogate(goal(), [*runs, goal().score(broken)], runs[0])
    assert process.residual(z)[goal().data_rows - 1] > 10.0
    assert np.all(process.jacobian(z)[goal().data_rows - 1] == 0.0)


def test_least_stays_within_bounds_and_radius() -> None:
    """The proposed point is better than the best run, within the radius and the hard bounds."""
    runs = trials(25, noise=0.0)[1:]
    best = min(runs, key=lambda t: t.misfit)
    process = Surrogate(goal(), runs, best)
    z = process.least(best.z, 1.0, 1.0)
    assert process.expected(z, 1.0) < process.expected(best.z, 1.0)
    close = process.least(best.z, 0.01, 1.0)
    assert np.abs(close - best.z).max() <= 0.01 + 1e-6
    assert np.all(z >= THREE.lower) and np.all(z <= THREE.upper)


def coarse_trials(count: int, slope: float) -> list[ScoredRun]:
    """Coarse runs about the values: 5 % too much, and ``slope`` more for each unit by which the depth grows."""
    random, objective = np.random.default_rng(5), goal()
    out = []
    for step in 0.5 * random.standard_normal((count, 3)):
        z = THREE.start + step
        evaluation = Evaluation(0, THREE.to_dict(z), "ok", "", 1.0, 0.04 * X, cut(z) * (1.05 + slope * step[1]))
        out.append(objective.score(evaluation, coarse=True))
    return out


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_coarse_runs_say_what_they_share_with_fine_ones(slope: float) -> None:
    """With ten fine runs, 40 coarse ones whose error changes with a parameter leave the slope of a fine curve where it
    is."""
    runs = trials(10, noise=0.003) + coarse_trials(40, slope)
    process = Surrogate(goal(), runs, runs[0]).each[0]
    up, down = (THREE.start + np.array([0.0, side * 0.2, 0.0]) for side in (1.0, -1.0))
    found, true = process.predict(up)[0] - process.predict(down)[0], cut(up) - cut(down)
    assert np.abs(found - true).max() < 0.02 * PEAK
