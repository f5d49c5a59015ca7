"""The search for the material: few, noisy, expensive simulations, run two or more at a time.

0. Screening, where there is a coarse evaluator: steps 1 to 3 with it alone, within a part of the budget. Its curves
   stay in the surrogate, with an offset of their own, and the fine search starts at its best points. Where the
   objective has guesses, descents from them (:mod:`calib.fit.descent`) take the place of 2.
1. Design: the given values, the centre of the prior and a scrambled Sobol sample of its 95 % box. Quasi-static forces
   scale with the stress-like parameters, so every run of the design stands for a whole line of materials; the best
   points of the best lines are run next.
2. Differences: one wide step along each parameter from the best point.
3. Rounds of one batch each. A Gaussian process through all smoothed curves so far (not through the misfit, which hides
   which part of a curve is wrong) proposes the point of least *expected* chi-square near the best one, the most
   promising point elsewhere if that is another one, and probes inside the present 95 % region
   (:mod:`calib.fit.acquisition`). Where there is a coarse evaluator, the latter two are run on it first, and only
   points near the best one on the fine one.
4. The end, when neither the surrogate nor the runs give a gain worth its noise. If the curve is still not explained
   (chi-square above its 99 % quantile), another design is begun, with nothing of what is known, and from its best
   points descents and rounds on coarse cells. What they find is run on fine cells, and rounds follow whose fine runs
   are made only where the coarse ones promise a gain; at most so many times, or until nothing was gained for long.
   Without a coarse evaluator, differences about the best point, and again 3 if they bring or promise a gain. The
   Jacobian is that of the surrogate, in which the noise of single runs is averaged out: plain differences make every
   parameter look identified.

What these choices save on real and made-up cuts is in docs/theory.md, "Measured choices".

Sources: composite objectives, Astudillo & Frazier (2019), Proc. ICML 97; regression models for noisy least squares,
Cartis et al. (2019), ACM TOMS 45:32, doi 10.1145/3338517.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, qmc

from calib.fit.acquisition import (
    BASIN_DISTANCE,
    apart,
    beside,
    best_scaled,
    expected_gain,
    global_optimum,
    local_optimum,
    on_lattice,
    probes,
    same_point,
)
from calib.fit.budget import longest_time_left, progress_of_all
from calib.fit.descent import Descent, race
from calib.fit.options import FitOptions
from calib.fit.surrogate import Surrogate, coordinate_unit
from calib.io.progress import Progress
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import EXPLAINED, Objective
from calib.problem.scored_run import ScoredRun, none_ended
from calib.simulation.evaluation import Evaluation, Evaluator
from mpm.arrays import FloatArray

#: Coarse runs of a round, for each worker.
COARSE_PER_WORKER = 2
#: Part of the chi-square that the noise of one run makes which a round must bring [-].
NOISE_TOLERANCE = 0.1
#: Gain worth a round, as ``FitOptions.tolerance``, while the best curve is not explained: a quarter of what bounds a
#: 95 % interval. A curve that no food of the model follows is not followed better for polishing it, and another basin
#: is found by looking elsewhere.
UNEXPLAINED_TOLERANCE = 1.0
#: Rounds without promise and gain after which the search has converged; rounds without gain after which it has stalled.
#: Half of either after a further screening: what that did not bring at once it has not brought.
CONVERGED_ROUNDS, STALLED_ROUNDS = 2, 4
#: Designs at most, while every run breaks down.
MAX_DESIGNS = 3
#: Further screenings of a curve that is not explained, and what each adds to the seed.
MAX_RESCREENINGS, RESCREENING_SEED = 3, 77
#: Quantile of the chi-square of the right material beyond which the best curve is far off, and what is left of the
#: budget is spent on looking elsewhere: one right material in a thousand leaves as much.
FAR_OFF = 0.999
#: Spent without a gain worth a round [fine simulations], after which a search whose curve is not explained, but not
#: far off, ends: nearly what one that explains its curve takes in all.
IDLE_BUDGET = 25.0
#: Part of the budget that the coarse evaluator may spend on the screening [-]: 60 runs of the default budget.
SCREENING_BUDGET = 0.15
#: The same where it goes down from guesses: it ends before, where that gains no more.
DESCENT_BUDGET = 0.7
#: Coarse runs for each parameter that a further screening may take.
DESCENT_RUNS = 12
#: Best runs of such a design, each in a place of its own, from which it goes down.
REDESIGN_STARTS = 2
#: Ends of valleys are run on fine cells up to so many times the least chi-square of them [-].
ALIKE_ON_COARSE = 1.25


class Search:
    """The rounds of one fit and all their runs.

    Args:
        objective: Target, parameters and error model.
        evaluator: Runs simulations at the resolution that counts.
        coarse: Runs cheaper ones, or None.
        options: Budget and the like.
        progress: Called after each simulation, or None.
        enough: Chi-square above which the search does not end [-]; None for what the right material leaves in 99 of 100
            cuts.
    """

    def __init__(
        self,
        objective: Objective | JointObjective,
        evaluator: Evaluator,
        coarse: Evaluator | None,
        options: FitOptions,
        progress: Callable[[Progress], None] | None,
        enough: float | None = None,
    ) -> None:
        self.objective, self.options, self.progress = objective, options, progress
        self.enough = chi2.ppf(EXPLAINED, objective.effective_rows) if enough is None else enough
        self.far_off = float(chi2.ppf(FAR_OFF, objective.effective_rows))
        self.parameters = objective.parameters
        self.fine, self.coarse = evaluator, coarse
        self.runs: list[ScoredRun] = []
        self.random = np.random.default_rng(options.seed)
        self.unit = coordinate_unit(self.parameters)
        self.hyper: list[FloatArray] | None = None
        self.centre: FloatArray | None = None
        self.screening = False
        self.screening_budget = (DESCENT_BUDGET if objective.guesses else SCREENING_BUDGET) * options.budget
        self.rescreenings = 0
        self.noise_misfit = 0.0
        self.gained_misfit, self.gained_at = math.inf, 0.0
        sobol = qmc.Sobol(len(self.parameters), scramble=True, seed=options.seed)
        count = MAX_DESIGNS * options.design
        sample = self.parameters.in_box(0.1 + 0.8 * sobol.random_base2(math.ceil(math.log2(count)))[:count])
        self.designs = np.split(sample, MAX_DESIGNS)

    @property
    def finished(self) -> list[ScoredRun]:
        """Finished runs that cut the food, else all finished ones; while screening of the coarse evaluator."""
        runs = [run for run in self.runs if run.ok and run.coarse == self.screening]
        return [run for run in runs if run.cut] or runs

    @property
    def best(self) -> ScoredRun:
        """Best of ``finished``; there is one after the design."""
        return min(self.finished, key=lambda run: run.misfit)

    @property
    def spent(self) -> float:
        """Budget spent [fine simulations]."""
        return self.options.cost(self.runs)

    @property
    def idle(self) -> bool:
        """Whether nothing has been gained for long, and the curve is off by no more than a model's error may be."""
        off = not self.screening and self.enough < self.best.misfit <= self.far_off
        return off and self.spent - self.gained_at >= IDLE_BUDGET

    @property
    def least_gain(self) -> float:
        """Gain in chi-square that is worth a round [-]: not what the noise of a run gives by chance."""
        explained = self.best.misfit <= self.enough
        tolerance = self.options.tolerance if explained else max(self.options.tolerance, UNEXPLAINED_TOLERANCE)
        reduced = max(1.0, self.best.misfit / self.objective.effective_rows)
        return max(tolerance * reduced, NOISE_TOLERANCE * self.noise_misfit)

    def run(self) -> str:
        """Search until there is nothing to gain or to spend.

        Returns:
            How it ended: ``converged``, ``stalled`` or ``budget``.

        Raises:
            SimulationError: No run reached the end of its stroke.
        """
        self._begin()
        patience = 1.0
        while True:
            status, best = self._rounds(patience), self.best
            patience = 0.5
            if status == "budget":
                return status
            if self.idle:
                return "stalled"
            if best.misfit > self.enough and self._rescreen():
                continue
            if self.coarse is not None or not self._differences():
                return status
            surrogate = self.surrogate()
            unkept = status == "stalled" or expected_gain(surrogate, local_optimum(surrogate)) < self.least_gain
            if self.best is best and unkept:
                return status

    def _begin(self) -> None:
        """Screen, or run the design; then further designs while every run breaks down."""
        first = [self.parameters.start, self.parameters.prior_mean, *self.objective.guesses]
        if self.coarse is not None:
            points, count = self._screen(first, downhill=bool(self.objective.guesses))
            begun, first = len(self.runs), []
            self._evaluate(points, "screened", most=max(2, count))
            self._follow_lines(begun)
        if not self.finished:
            self._design(first)
        while not self.finished and self.designs and self._affordable() > self.options.design + 2 * self.options.batch:
            self._design([])
        if not self.finished:
            raise none_ended(self.runs)
        if self.coarse is None:
            self._differences()

    def _screen(self, given: list[FloatArray], *, downhill: bool = False) -> tuple[list[FloatArray], int]:
        """Search on the coarse evaluator, before the rounds by differences or ``downhill``; where it expects the best
        point, the best run, the ends of the valleys and all other runs, and how many of the first to go on from."""
        self.screening = True
        ends: list[ScoredRun] = []
        try:
            self._design(given)
            if not self.finished:
                return [], 0
            if downhill:
                starts = self._guessed() if given else apart(self.finished, self.unit, REDESIGN_STARTS)
                ends = race([Descent(self._descended, self.parameters, start) for start in starts])
            else:
                self._differences()
            self._rounds()
            lowest = apart([self.best, *(run for run in ends if run.ok)], self.unit, len(ends) + 1)
            alike = [run for run in lowest if run.misfit <= ALIKE_ON_COARSE * self.best.misfit]
            best_first = sorted(self.finished, key=lambda run: run.misfit)
            points = [local_optimum(self.surrogate()), *(run.z for run in (*alike, *best_first))]
            return points, max(self.options.batch, len(alike) + 1)
        finally:
            self.screening, self.centre, self.hyper = False, None, None

    def _guessed(self) -> list[ScoredRun]:
        """The objective's guesses as runs, each where its line is best, and the best run; the best first."""
        runs = self._descended(self.objective.guesses)
        lines = [(run, best_scaled(self.objective, run)[1]) for run in runs if run.ok]
        self._descended([z for _, z in lines])
        tried = [(run, *(one for one in self._descended([z]) if one.ok)) for run, z in lines]
        starts = [min(each, key=lambda run: run.misfit) for each in tried]
        if all(self.best is not start for start in starts):
            starts.append(self.best)
        return sorted(starts, key=lambda run: run.misfit)

    def _rescreen(self) -> bool:
        """Go down from another design and run what that finds; False where it cannot or need not be paid."""
        far_off = self.best.misfit > self.far_off
        rest = self.options.budget - self.spent - 2 * self.options.batch
        unpaid = rest < self.options.coarse_cost * self.options.least(len(self.parameters))
        if self.coarse is None or unpaid or (self.rescreenings >= MAX_RESCREENINGS and not far_off):
            return False
        self.rescreenings += 1
        wanted = DESCENT_RUNS * len(self.parameters) * self.options.coarse_cost
        options = replace(
            self.options,
            budget=min(max(SCREENING_BUDGET * self.options.budget, wanted), rest),
            seed=self.options.seed + RESCREENING_SEED * self.rescreenings,
        )
        told = progress_of_all(self.progress, self.runs, self.best, self.options)
        other = Search(self.objective, self.fine, self.coarse, options, told, self.enough)
        other.screening_budget = options.budget
        try:
            points, count = other._screen([], downhill=True)
        finally:
            self.runs += other.runs
        self._evaluate(points, "screened", most=count)
        return True

    def _design(self, points: list[FloatArray]) -> None:
        """Run ``points`` and the next part of the sample, then the best of the lines they stand for."""
        first = len(self.runs)
        self._evaluate(points + list(self.designs.pop(0)), "design", coarse=self.coarse is not None)
        self._follow_lines(first)

    def _follow_lines(self, first: int) -> None:
        """Run the best points of the best lines through the runs from ``first`` on.

        That is on coarse cells where some of these runs are coarse and any run has finished, else on fine ones.
        """
        lines = [best_scaled(self.objective, run) for run in self.runs[first:] if run.ok]
        lines.sort(key=lambda line: line[0])
        coarse = bool(self.finished) and any(run.coarse for run in self.runs[first:])
        self._evaluate([z for _, z in lines[: self.options.batch]], "scaled", coarse=coarse)

    def _differences(self) -> bool:
        """Step along each parameter from the best point; False where that was done or cannot be paid."""
        z, steps = self.best.z, self.parameters.steps
        done = self.centre is not None and bool(np.all(np.abs(z - self.centre) < steps))
        if done or self._affordable() < len(steps):
            return False
        self.centre = z
        inwards = np.where(z > self.parameters.prior_mean, -1.0, 1.0)
        self._evaluate([z + d for d in np.diag(inwards * steps)], "difference", coarse=self.coarse is not None)
        return True

    def _rounds(self, patience: float = 1.0) -> str:
        """Rounds of one batch each, until they are calm or the budget is spent.

        ``patience`` shortens the wait for gain; where it is short, only what still promises a gain after the coarse
        runs of a round is run on fine cells, also far from the best point.
        """
        calm = stalled = 0
        while self._affordable() > 0 and not self.idle:
            before, least_gain, surrogate = self.best.misfit, self.least_gain, self.surrogate()
            near = local_optimum(surrogate)
            promised = expected_gain(surrogate, near)
            points = self._proposed(surrogate, near, least_gain, patience)
            if not points:
                return "converged"
            self._evaluate(points, "round", most=self.options.batch)
            gained = before - self.best.misfit >= least_gain
            stalled = 0 if gained else stalled + 1
            calm = 0 if gained or promised >= least_gain else calm + 1
            if calm >= patience * CONVERGED_ROUNDS or stalled >= patience * STALLED_ROUNDS:
                return "converged" if calm >= patience * CONVERGED_ROUNDS else "stalled"
        return "stalled" if self.idle else "budget"

    def _proposed(self, surrogate: Surrogate, near: FloatArray, least_gain: float, patience: float) -> list[FloatArray]:
        """The points of a round, after its coarse runs where it has them; none where nothing is promised."""
        batch = self.options.batch
        far = global_optimum(surrogate, self.runs, self.random)
        elsewhere = [far] if np.abs((far - near) / self.unit).max() > BASIN_DISTANCE else []
        if self.coarse is None or self.screening:
            return [near, *elsewhere, *probes(surrogate, near, batch, self.random)]
        count = COARSE_PER_WORKER * batch - len(elsewhere)
        self._evaluate([*elsewhere, *probes(surrogate, near, count, self.random)], "scouting", coarse=True)
        surrogate = self.surrogate()
        near = local_optimum(surrogate)
        points = [near, *beside(surrogate, near, self.random)]
        if patience < 1.0:
            far = global_optimum(surrogate, self.runs, self.random)
            points = [z for z in (near, far) if expected_gain(surrogate, z) >= least_gain]
        return points

    def surrogate(self, best: ScoredRun | None = None) -> Surrogate:
        """The surrogate through all runs so far, about the best one or another."""
        runs = [run.as_fine() for run in self.runs] if self.screening else self.runs  # one evaluator: no offset
        found = Surrogate(self.objective, runs, best or self.best, self.hyper)
        self.hyper, self.noise_misfit = found.hyper, found.noise_misfit
        return found

    def _affordable(self) -> int:
        """Simulations that the budget, while screening its part of it, still holds."""
        if self.screening:
            return int((self.screening_budget - self.spent) / self.options.coarse_cost + 1e-9)
        return int(self.options.budget - self.spent + 1e-9)

    def _evaluate(
        self, points: Sequence[FloatArray], stage: str, *, coarse: bool = False, most: int | None = None
    ) -> None:
        """Run those points that are new and can be paid, the first ``most``; the runs keep the order of the points."""
        coarse = coarse or self.screening
        batch = self._new(points, coarse)[:most]
        first, order = len(self.runs), []
        for evaluation in self._simulate([self.parameters.to_dict(z) for z in batch], coarse):
            self.runs.append(self.objective.score(evaluation, coarse=coarse, stage=stage))
            order.append(evaluation.index)
            self._report(stage)
        self.runs[first:] = [self.runs[first + i] for i in np.argsort(order)]
        if not self.screening and self.finished and self.gained_misfit - self.best.misfit >= self.least_gain:
            self.gained_misfit, self.gained_at = self.best.misfit, self.spent

    def _new(self, points: Sequence[FloatArray], coarse: bool) -> list[FloatArray]:
        """The points, on the lattice, that were not run at this resolution and can be paid."""
        cost = self.options.coarse_cost if coarse else 1.0
        known = [run.z for run in self.runs if run.coarse == coarse]
        batch: list[FloatArray] = []
        for point in points:
            z = on_lattice(self.parameters, self.unit, point)
            new = not any(same_point(self.unit, z, other) for other in known + batch)
            if new and self.spent + (len(batch) + 1) * cost <= self.options.budget + 1e-9:
                batch.append(z)
        return batch

    def _descended(self, points: Sequence[FloatArray]) -> list[ScoredRun]:
        """Run points of a descent on coarse cells; the runs of them that there are."""
        self._evaluate(points, "descent", coarse=True, most=max(self._affordable(), 0))
        wanted = [on_lattice(self.parameters, self.unit, point) for point in points]
        return [run for run in self.runs if run.coarse and any(same_point(self.unit, run.z, z) for z in wanted)]

    def _simulate(self, batch: list[dict[str, float]], coarse: bool) -> Iterator[Evaluation]:
        evaluator = self.coarse if coarse and self.coarse is not None else self.fine
        return evaluator.evaluate(batch) if batch else iter(())

    def _report(self, stage: str) -> None:
        """Call the progress callback."""
        if self.progress is None:
            return
        self.progress(
            Progress(
                done=len(self.runs),
                spent=self.spent,
                budget=self.options.budget,
                failed=sum(not run.ok for run in self.runs),
                misfit=self.best.misfit if self.finished else math.inf,
                eta_s=longest_time_left(self.runs, self.options.budget - self.spent, self.options),
                stage=f"{stage} on coarse cells" if self.runs[-1].coarse else stage,
            )
        )
