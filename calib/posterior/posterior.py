"""The posterior of a trace over all foods that are plausible: waves on coarse cells, judges on fine ones, a sample, and
its modes with the best simulated food of each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from calib.posterior.coordinates import Coordinates
from calib.posterior.correction import Correction
from calib.posterior.emulator import was_cut
from calib.posterior.likelihood import SIZE_SD, Likelihood
from calib.posterior.modes import Mode, climbed, modes
from calib.posterior.sampling import Sample, sample
from calib.posterior.waves import (
    GOOD_ERROR,
    SEEDS,
    Matched,
    Plan,
    match_history,
    on_lattice,
    prediction_errors,
    proposals,
    quantiles,
    simulated,
)
from calib.problem.objective import Objective
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluators
from mpm.arrays import FloatArray
from mpm.scene.errors import SimulationError

JUDGED = 3
"""Rounds of judges at most."""
TOPS = 2
"""Foods at the top of each mode that are simulated on fine cells."""
MOST_MODES = 3
"""Modes whose tops are simulated."""
DRAWS = 2000
"""Draws of equal weight that intervals, modes and bands are made of."""
CHECKED = 400
"""Draws whose curves are seen."""
BEYOND = 1e9
"""What the logarithm of the density loses beyond the hard bounds."""


@dataclass(frozen=True, eq=False)
class PosteriorMode:
    """A mode of the posterior, with the best food of it that was simulated.

    Attributes:
        mode: Its weight, its top and the draws that belong to it.
        best: The run on fine cells of least chi-square among those of the mode; None where none was cut.
    """

    mode: Mode
    best: ScoredRun | None


@dataclass(frozen=True, eq=False)
class SampledPosterior:
    """The posterior of a trace.

    Attributes:
        likelihood: By the emulator, corrected to fine cells.
        sample: Draws from prior to posterior.
        matched: The waves on coarse cells.
        fine: All runs on fine cells.
        judged: Median and 90 % point of the errors with which fine curves of the posterior were predicted, part of the
            peak [-]; None where fewer than two of them were cut.
        modes: The modes, the heaviest first.
    """

    likelihood: Likelihood
    sample: Sample
    matched: Matched
    fine: tuple[ScoredRun, ...]
    judged: tuple[float, float] | None
    modes: tuple[PosteriorMode, ...]

    @property
    def objective(self) -> Objective:
        """The trace."""
        return self.likelihood.objective

    @property
    def best(self) -> ScoredRun:
        """The run on fine cells of largest posterior density."""
        return min((run for run in self.fine if run.ok), key=lambda run: run.misfit)

    @property
    def converged(self) -> bool:
        """Whether the emulator was good where foods are plausible, on coarse cells and on fine ones, and settled."""
        return self.matched.converged and self.judged is not None and self.judged[1] <= GOOD_ERROR

    @cached_property
    def draws(self) -> FloatArray:
        """Places (DRAWS,) of draws of equal weight."""
        return self.sample.drawn(DRAWS, 0)

    @property
    def z(self) -> FloatArray:
        """Internal coordinates of draws of equal weight (DRAWS, p)."""
        out: FloatArray = self.sample.z[self.draws]
        return out

    @cached_property
    def curves(self) -> FloatArray:
        """Curves of some draws on fine cells [N] (CHECKED, n), each with the factor of width and gain that suits the
        trace best."""
        some = self.z[:: DRAWS // CHECKED]
        return np.array([factor(self.objective, m) * m for m in self._emulated(some)])

    def _emulated(self, z: FloatArray) -> FloatArray:
        return self.likelihood.correction.curves(z)

    @cached_property
    def explained(self) -> float:
        """Posterior predictive p-value [-] (:func:`predictive_p_value`)."""
        return predictive_p_value(self.likelihood, self.z[:: DRAWS // CHECKED])

    def interval(self, index: int, mode: Mode | None = None) -> tuple[float, float, float]:
        """Ends of the central 95 % interval and the median of a parameter, in its internal coordinate: low, median,
        high; of one mode alone where it is given."""
        z = self.z[:, index] if mode is None else self.z[mode.members, index]
        low, middle, high = np.quantile(z, (0.025, 0.5, 0.975))
        return float(low), float(middle), float(high)

    def alone(self, index: int) -> tuple[float, float]:
        """The same ends where the parameter's own prior is flat within the hard bounds: what the trace says."""
        p = self.objective.parameters
        own = 0.5 * ((self.sample.z[:, index] - p.prior_mean[index]) / p.prior_sd[index]) ** 2
        log = np.log(np.maximum(self.sample.weights(), 1e-300)) + own
        weights = np.exp(log - log.max())
        ends = quantiles(self.sample.z[:, [index]], weights / weights.sum(), (0.025, 0.975))[:, 0]
        return float(ends[0]), float(ends[1])

    def agree(self, index: int) -> bool:
        """Whether the median of a parameter in each mode lies within the interval of the heaviest one."""
        first = self.interval(index, self.modes[0].mode)
        return all(first[0] <= self.interval(index, m.mode)[1] <= first[2] for m in self.modes[1:])


def sample_posterior(
    objective: Objective,
    coordinates: Coordinates,
    evaluators: Evaluators,
    plan: Plan | None = None,
    seed: int = 0,
    say: Callable[[str], None] = lambda text: None,
) -> SampledPosterior:
    """The posterior of a trace.

    Args:
        objective: The trace.
        coordinates: Where the emulator lives.
        evaluators: Coarse and fine simulations.
        plan: How much is simulated and sampled.
        seed: Seed of what is drawn.
        say: Called with a sentence for each stage.

    Returns:
        The posterior.

    Raises:
        SimulationError: Too few foods of the literature's ranges are cut to learn from.
    """
    plan = plan or Plan()
    with threadpool_limits(1, "blas"):  # sums in another order would ask for other points
        try:
            matched = match_history(objective, coordinates, evaluators, plan, seed, say)
        except ValueError as e:
            raise SimulationError(
                f"the posterior cannot be sampled: {e}; narrow the ranges, or fit fewer properties",
                reason="too_few_cut",
                fraction=0.0,
            ) from None
        judged = _Judged(objective, matched, evaluators, plan, seed)
        judged.say = say
        return judged.posterior()


class _Judged:
    """The part after the waves."""

    def __init__(self, objective: Objective, matched: Matched, evaluators: Evaluators, plan: Plan, seed: int) -> None:
        self.objective, self.matched, self.evaluators, self.plan, self.seed = objective, matched, evaluators, plan, seed
        self.say: Callable[[str], None] = lambda text: None
        self.fine = list(matched.fine)
        self.correction = self._corrected()
        self.judged: tuple[float, float] | None = None

    def posterior(self) -> SampledPosterior:
        """Fine runs, the sample, its modes and their tops."""
        drawn, plan = self.matched.sample, self.plan
        for stage in range(JUDGED):
            good = self._judge(drawn, plan.judges) or stage == JUDGED - 1
            likelihood = Likelihood(self.objective, self.matched.emulator, self.correction)
            drawn = sample(likelihood, plan.final if good else plan.scouting, SEEDS * (self.seed + 1) - 1 - stage)
            if good:
                break
        found = modes(self._points(drawn), self._density(likelihood))
        self.say(f"posterior: {len(found)} mode{'s' if len(found) > 1 else ''} in {drawn.calls} likelihoods")
        bests = [self._top(likelihood, drawn, m) for m in found[:MOST_MODES]]
        if not any(run.ok for run in self.fine):
            raise SimulationError(
                "no food of the posterior is cut on fine cells; another --dx may be", reason="not_cut", fraction=0.0
            )
        bests += [None] * (len(found) - len(bests))
        both = tuple(PosteriorMode(m, best) for m, best in zip(found, bests, strict=True))
        return SampledPosterior(likelihood, drawn, self.matched, tuple(self.fine), self.judged, both)

    def _judge(self, drawn: Sample, count: int) -> bool:
        """Fine runs of the posterior, predicted before, and the correction through all; whether it was good."""
        points = proposals(drawn, self.matched.emulator, self.fine, count, SEEDS * self.seed + len(self.fine), 1.0)
        new = [run for run in self._run(points) if was_cut(run)]
        if new:
            errors = prediction_errors(self.objective, self.correction.curves(np.array([run.z for run in new])), new)
            self.judged = float(np.median(errors)), float(np.quantile(errors, 0.9))
            self.say(f"fine cells: predicted to {self.judged[0]:.1%} of the peak (90 %: {self.judged[1]:.1%})")
        self.correction = self._corrected()
        return self.judged is not None and self.judged[1] <= GOOD_ERROR

    def _corrected(self) -> Correction:
        return Correction(self.matched.emulator, [run for run in self.fine if was_cut(run)], finer=True)

    def _run(self, points: FloatArray) -> list[ScoredRun]:
        self.say(f"{len(points)} foods of the posterior on fine cells")
        new = simulated(self.objective, self.evaluators.fine, points, "judge", coarse=False)
        self.fine += new
        return new

    def _points(self, drawn: Sample) -> FloatArray:
        places = drawn.drawn(DRAWS, 0)
        out: FloatArray = np.column_stack([drawn.z[places], drawn.log_size[places]])
        return out

    def _density(self, likelihood: Likelihood) -> Callable[[FloatArray], FloatArray]:
        """Logarithm of the posterior density (q,) at internal coordinates with the logarithm of the size last."""
        p = self.objective.parameters

        def density(points: FloatArray) -> FloatArray:
            z, log_size = points[:, :-1], points[:, -1]
            outside = (log_size < 0.0) | np.any((z < p.lower) | (z > p.upper), axis=1)
            own = np.sum(p.prior_residual(z) ** 2, axis=1) + (log_size / SIZE_SD) ** 2
            out: FloatArray = likelihood.log(z, log_size) - 0.5 * own - BEYOND * outside
            return out

        return density

    def _top(self, likelihood: Likelihood, drawn: Sample, mode: Mode) -> ScoredRun | None:
        """The best fine run of the mode, after some at its top where width and gain are the likely ones."""
        p = self.objective.parameters
        places = drawn.drawn(DRAWS, 0)[mode.members]
        z = np.unique(drawn.z[places], axis=0)
        z = z[:: max(len(z) // 200, 1)]
        curves = likelihood.correction.curves(z)
        along = p.stress_like()
        scaled = p.clip(z + np.log([factor(self.objective, m) for m in curves])[:, None] * along)
        spread = np.maximum(drawn.z[places].std(axis=0), 1e-6)
        strict = Likelihood(self.objective, likelihood.emulator, likelihood.correction, searched=True)
        density = self._density(strict)

        def log(x: FloatArray) -> FloatArray:
            return density(np.column_stack([x * spread, np.zeros(len(x))]))

        heights = log(scaled / spread)
        start = scaled[np.argsort(-heights, kind="stable")[: 2 * TOPS]] / spread
        tops, height = climbed(start, log)
        order = np.argsort(-height, kind="stable")[:TOPS]
        self._run(np.unique(on_lattice(p, tops[order] * spread), axis=0))
        near = [run for run in self.fine if was_cut(run) and self._belongs(run, drawn, mode)]
        return min(near, key=lambda run: run.misfit, default=None)

    def _belongs(self, run: ScoredRun, drawn: Sample, mode: Mode) -> bool:
        """Whether the draw nearest to a run is one of the mode."""
        z = drawn.z[drawn.drawn(DRAWS, 0)]
        gap = np.sum(((z - run.z) / np.maximum(z.std(axis=0), 1e-9)) ** 2, axis=1)
        return bool(np.isin(int(np.argmin(gap)), mode.members))


def predictive_p_value(likelihood: Likelihood, z: FloatArray) -> float:
    """How probably the right food, with errors of the stated size, would leave a larger chi-square than some foods do.

    Source: Gelman, Meng & Stern (1996), Statistica Sinica 6:733.

    Args:
        likelihood: The likelihood of the trace.
        z: Internal coordinates of draws from the posterior [-] (q, p).

    Returns:
        The probability, the mean over the draws [-].
    """
    seen = likelihood.chi2(likelihood.correction.curves(z), np.zeros(len(z)))
    return float(np.mean(chi2.sf(seen, likelihood.rows)))


def factor(objective: Objective, curve: FloatArray) -> float:
    """The factor of width and gain that suits a trace best, by least squares with its prior [-].

    Args:
        objective: The trace.
        curve: A simulated curve [N] (n,).

    Returns:
        The factor.
    """
    sd = np.sqrt(sum(n.sd**2 for n in objective.nuisances if n.name in ("gain", "width")))
    if not sd > 0.0:
        return 1.0
    weight = objective.effective_points / objective.target.stroke.size / objective.sigmas**2
    pull = 1.0 / sd**2
    size, cross = float(np.sum(weight * curve**2)), float(np.sum(weight * curve * objective.target.curve))
    return (cross + pull) / (size + pull)


def runs_near(posterior: SampledPosterior, count: int) -> Sequence[ScoredRun]:
    """Coarse runs of least chi-square, and all on fine cells: what is known about the best food."""
    coarse = sorted((run for run in posterior.matched.runs if was_cut(run)), key=lambda run: run.misfit)[:count]
    return [*coarse, *posterior.fine]
