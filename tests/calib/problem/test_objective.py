"""The residual vector: its size and weights, and that broken-down runs give finite, graded ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.errors import TraceError
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.target import ErrorModel, Target
from calib.simulation.evaluation import Evaluation
from calib.trace.filters import filter_simulated

LENGTH = 0.04
GRID = np.linspace(0.0, LENGTH, 240)
FINE = np.linspace(0.0, LENGTH, 2001)
PARAMETERS = ParameterSet(
    (
        Parameter("E", 1e5, 1e3, 1e7, "Pa", 5e4, 2e5),
        Parameter("mu", 0.3, 0.0, 1.0, "-", 0.1, 0.5, "linear"),
    )
)
CENTRE = PARAMETERS.to_dict(PARAMETERS.prior_mean)


def interpolate(grid: np.ndarray, stroke: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The plainest smoother: none."""
    return np.interp(grid, stroke, force)


def wave(s: np.ndarray) -> np.ndarray:
    """A force of 10 N at most, 0 at both ends of the stroke [N]."""
    return 10.0 * np.sin(math.pi * s / LENGTH)


def objective(**errors: float) -> Objective:
    """The objective of the wave with negligible noise."""
    return Objective(Target(GRID, wave(GRID), 0.0, 0.0, interpolate), PARAMETERS, ErrorModel(**errors))


def run(force: np.ndarray, stroke: np.ndarray = FINE, *, fraction: float = 1.0, **values: float) -> Evaluation:
    """An evaluation at the prior centre, failed when its fraction is below 1."""
    status = "ok" if fraction == 1.0 else "failed"
    return Evaluation(0, CENTRE | values, status, "" if status == "ok" else "inverted", fraction, stroke, force)


def cut_off(fraction: float, factor: float = 1.1) -> Evaluation:
    """The wave times a factor, broken down at a fraction of the stroke."""
    stroke = np.append(FINE[FINE < fraction * LENGTH], fraction * LENGTH)
    return run(factor * wave(stroke), stroke, fraction=fraction)


def test_the_real_curve_has_no_residual() -> None:
    """A simulation equal to the trace at the centre of the prior has chi-square zero."""
    trial = objective().score(run(wave(FINE)))
    assert trial.residual.shape == (240 + 2 + 2,)
    assert trial.misfit < 1e-6


def test_chi_square_of_a_wrong_scale_in_closed_form() -> None:
    """10 % too strong: sum of 20 independent points at 3 % of the peak, plus the peak at 2 %.

    Mean of (0.1 sin)^2 over 240 points is 0.005 * 239/240, so chi-square = 20 * that / 0.03^2 + (0.1 /
    0.02)^2.
    """
    expected = 20.0 * 0.005 * 239.0 / 240.0 / 0.03**2 + 25.0
    assert objective().score(run(1.1 * wave(FINE))).misfit == pytest.approx(expected, rel=1e-3)


def test_noise_and_discrepancy_add_in_squares() -> None:
    """The stated error model: sigma^2 = noise^2 + (discrepancy * peak)^2, likewise for the peak."""
    target = Target(GRID, wave(GRID), 0.4, 0.15, interpolate)
    goal = Objective(target, PARAMETERS, ErrorModel(discrepancy=0.03, peak=0.02))
    assert goal.sigma == pytest.approx(0.5, rel=1e-4) and goal.sigma_peak == pytest.approx(0.25, rel=1e-4)


def test_chi_square_does_not_count_correlated_points_twice() -> None:
    """Twice as fine a grid leaves chi-square alone; half the correlation length doubles the curve's part."""
    fine = np.linspace(0.0, LENGTH, 480)
    strong = run(1.1 * wave(FINE))
    coarse = objective(peak=1e6).score(strong).misfit
    finer = Objective(Target(fine, wave(fine), 0.0, 0.0, interpolate), PARAMETERS, ErrorModel(peak=1e6))
    assert finer.score(strong).misfit == pytest.approx(coarse, rel=0.01)
    assert objective(peak=1e6, correlation=0.025).score(strong).misfit == pytest.approx(2.0 * coarse, rel=1e-6)


def test_chi_square_of_a_right_model_is_its_number_of_data() -> None:
    """Errors drawn from the stated model, correlated over a twentieth of the stroke, give 20 on average."""
    goal = objective(peak=1e6)
    x = np.linspace(0.0, 1.0, 240)
    sd = 0.05 / (2.0 * math.sqrt(math.pi))  # of the kernel whose correlation integrates to 0.05
    kernel = np.exp(-0.5 * ((x[:, None] - np.linspace(-0.2, 1.2, 700)) / sd) ** 2)
    kernel /= np.linalg.norm(kernel, axis=1)[:, None]
    noise = np.random.default_rng(1).standard_normal((400, 700)) @ kernel.T * goal.sigma
    mean = np.mean([np.sum(goal.data_residual(wave(GRID) + n) ** 2) for n in noise])
    assert mean == pytest.approx(goal.effective_points, rel=0.05)


def test_prior_rows_come_last() -> None:
    """A parameter at the end of its literature range costs 1.96 squared, in the last rows."""
    trial = objective().score(run(wave(FINE), E=2e5))
    assert trial.residual[-2:] == pytest.approx([1.95996, 0.0], abs=1e-4)


def test_penalty_grows_as_less_is_computed() -> None:
    """The earlier a run breaks down the worse it is; a whole run with the same error is best."""
    goal = objective()
    misfits = [goal.score(run(1.1 * wave(FINE))).misfit]
    misfits += [goal.score(cut_off(f)).misfit for f in (0.99, 0.9, 0.7, 0.4, 0.1)]
    assert np.all(np.diff(misfits) > 0.0)


def test_residual_is_continuous_in_the_fraction() -> None:
    """A run that breaks down 1e-4 of the stroke later has nearly the same vector.

    The bound is ten times what a vector that changes evenly from nothing to everything would need.
    """
    goal = objective()
    fractions = np.arange(0.3, 0.32, 1e-4)
    vectors = [goal.score(cut_off(f)).residual for f in fractions]
    largest = max(float(np.linalg.norm(b - a)) for a, b in zip(vectors, vectors[1:], strict=False))
    assert largest < 10.0 * 1e-4 * goal.failure_weight


def test_broken_run_passes_into_a_whole_one() -> None:
    """At the very end of the stroke a broken-down run has the vector of a finished one.

    Only the last of the 240 points has the mean difference of the last twentieth instead of its own.
    """
    goal = objective()
    almost = goal.score(cut_off(1.0 - 1e-6)).residual - goal.score(run(1.1 * wave(FINE))).residual
    assert np.abs(np.delete(almost, 239)).max() < 1e-2 and abs(almost[239]) < 0.1


def test_computing_nothing_is_as_bad_as_predicting_nothing() -> None:
    """A run that fails at once costs what a model without any force costs, whatever it says."""
    goal = objective()
    nothing = goal.score(run(np.empty(0), np.empty(0), fraction=0.0))
    no_force = goal.score(run(np.zeros_like(FINE)))
    assert nothing.misfit == pytest.approx(no_force.misfit, rel=1e-9)
    assert not nothing.ok and no_force.ok


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
def test_a_spike_or_nan_stays_finite(bad: float) -> None:
    """A run that blows up gives a finite vector: from the first bad sample on it counts as broken down."""
    force = wave(FINE)
    force[1000:] = bad
    trial = objective().score(run(force))
    assert np.isfinite(trial.residual).all()
    assert trial.misfit > objective().score(run(wave(FINE))).misfit + 100.0


def test_a_spike_at_the_end_is_not_held() -> None:
    """The last sample's spike of a broken-down run must not stand for the rest of the stroke."""
    clean = cut_off(0.5, 1.0)
    force = clean.force.copy()
    force[-1] = 1e6
    spiked = Evaluation(0, CENTRE, "failed", "not_finite", 0.5, clean.stroke, force)
    goal = objective()
    assert goal.curve(spiked)[0][-1] < goal.target.curve[-1] + 0.3 * goal.target.peak


def test_samples_that_do_not_advance_are_left_out() -> None:
    """Repeated strokes and a way back do not disturb the curve."""
    stroke = np.concatenate([FINE[:500], FINE[400:500], FINE[500:]])
    force = np.concatenate([wave(FINE[:500]), np.full(100, 99.0), wave(FINE[500:])])
    assert objective().score(run(force, stroke)).misfit < 1e-6


def test_record_that_ends_a_little_early_is_whole() -> None:
    """The last millimetre missing from a finished run is not a failure."""
    kept = FINE <= 0.039
    trial = objective().score(run(wave(FINE[kept]), FINE[kept]))
    assert trial.residual[241] == 0.0 and trial.misfit < 0.1


def test_works_with_the_filter_of_real_curves() -> None:
    """With the filter that conditions traces, the same cut smoothed the same way has no residual."""
    real = filter_simulated(GRID, FINE, wave(FINE))
    goal = Objective(Target(GRID, real, 0.0, 0.0, filter_simulated), PARAMETERS)
    assert goal.score(run(wave(FINE))).misfit < 1e-12
    broken = goal.score(cut_off(0.4))
    assert np.isfinite(broken.residual).all() and broken.misfit > 100.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"curve": wave(GRID)[:-1]}, "239"),
        ({"curve": wave(GRID) * math.nan}, "not finite"),
        ({"stroke": GRID[::-1]}, "do not rise"),
        ({"curve": -wave(GRID) - 1.0}, "positive"),
        ({"noise_sd": -1.0}, "noise_sd -1 N"),
    ],
)
def test_impossible_targets_are_refused(change: dict[str, object], words: str) -> None:
    """A target that cannot be compared with is refused on creation, saying what is wrong."""
    given: dict[str, object] = {
        "stroke": GRID,
        "curve": wave(GRID),
        "noise_sd": 0.0,
        "peak_sd": 0.0,
        "smooth": interpolate,
    }
    with pytest.raises(TraceError, match=words):
        Target(**(given | change))  # type: ignore[arg-type]


def test_impossible_error_models_and_evaluations_are_refused() -> None:
    """Errors of zero would divide by zero; a fraction of NaN or a torn curve would spread."""
    with pytest.raises(TraceError, match="discrepancy > 0"):
        ErrorModel(discrepancy=0.0)
    with pytest.raises(ValueError, match="fraction nan"):
        run(wave(FINE), fraction=math.nan)
    with pytest.raises(ValueError, match="equal length"):
        run(wave(FINE), FINE[:-1])


def test_the_factors_uncertainty_is_the_curvature_of_its_misfit() -> None:
    """Value and standard deviation of the factor's logarithm against a parabola through the misfit by brute force; with
    a trace that says nothing it is the prior, and without a factor there is no estimate."""
    bare = objective(discrepancy=0.05)
    curve = 1.3 * wave(GRID)
    one = Objective(bare.target, PARAMETERS, bare.errors, scale_sd=0.15)
    (found,) = one.factor_estimate(curve)

    def misfit(log: float) -> float:
        rows = bare.data_residual(math.exp(log) * curve, 1.0)
        return float(rows @ rows) + (log / 0.15) ** 2

    step = 1e-3
    low, best, high = (misfit(found.value + k * step) for k in (-1, 0, 1))
    assert found.name == "scale" and math.exp(found.value) == pytest.approx(one.factor(curve))
    assert abs(high - low) < 0.01 * (high + low - 2.0 * best)  # the least value
    assert found.sd == pytest.approx(math.sqrt(2.0 / ((high + low - 2.0 * best) / step**2)), rel=0.01)
    assert found.sd < found.prior_sd == 0.15 and not found.outside
    (blind,) = Objective(bare.target, PARAMETERS, ErrorModel(discrepancy=1e3, peak=1e3), scale_sd=0.15).factor_estimate(
        curve
    )
    assert blind.sd == pytest.approx(0.15, rel=0.01) and bare.factor_estimate(curve) == ()
