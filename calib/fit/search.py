"""The search for the material: few, noisy, expensive simulations, run two or more at a time.

0. Screening, where there is a coarse evaluator: steps 1 to 3 with it alone, within a part of the budget.  Its
   curves stay in the process, with an offset of their own, and the fine search starts at its best points.
1. Design: the given values, the centre of the prior and a scrambled Sobol sample of its 95 % box.
   Quasi-static forces scale with the stress-like parameters, so every run of the design stands for a whole
   line of materials; the best points of the best lines are run next.
2. Differences: one wide step along each parameter from the best point.
3. Rounds: a Gaussian process through all smoothed curves so far (not through the misfit, which hides which
   part of a curve is wrong) proposes one batch: the point of least *expected* chi-square near the best one,
   the most promising point elsewhere if that is another one, and probes inside the present 95 % region.  Where
   there is a coarse evaluator, the latter two are run on it first, and only points near the best one on the fine
   one: 16 synthetic cuts took 14 fine and 54 coarse runs each, where 24 and 40 led to the same chi-square.
4. When neither the process nor the runs give a gain worth its noise: if the curve is still not explained (chi-square above its
   99 % quantile), the screening is begun anew from another design, with nothing of what is known, so that it ends in a valley of its
   own; its best points are run on fine cells, and rounds follow whose fine runs are made only where the coarse ones promise a
   gain; at most so many times, or until nothing was gained for long.  Without a coarse evaluator, differences about the best point, and
   again 3 if that brings or promises a gain; with one the profiles step along each parameter anyway (of ten cuts one had gone on
   after such differences, from a chi-square of 29.9 to 28.6).  The Jacobian there is that of the process, in which the noise of
   single runs is averaged out; plain differences of noisy curves would make every parameter look well identified.

Sources: composite objectives, Astudillo & Frazier (2019), Proc. ICML 97; regression models for noisy least
squares, Cartis et al. (2019), ACM TOMS 45:32, doi 10.1145/3338517.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar
from scipy.stats import chi2, qmc

from calib.fit.options import FitOptions
from calib.fit.surrogate import Surrogate, coordinate_unit
from calib.io.progress import Progress, at_most, onward
from calib.problem.joint_objective import JointObjective, residual
from calib.problem.objective import Objective, Trial
from calib.simulation.evaluation import Evaluation, Evaluator
from calib.uncertainty.intervals import EXPLAINED
from mpm.scene.errors import SimulationError

FloatArray = npt.NDArray[np.float64]

#: Points are rounded to this part of a coordinate unit (0.1 % of a log parameter): far below the noise of a
#: run, and a resumed fit asks for exactly the points that are in the store.
LATTICE = 1e-3
#: The process is trusted this far from the best point: a factor e of a log parameter.
RADIUS = 1.0
#: A promising point elsewhere must be this far from the one nearby [coordinate units].
ELSEWHERE = 0.2
#: Weight of not knowing the curve in the expected chi-square: 1 is the expectation; less elsewhere, for the sake of promising basins.
CAUTION_NEAR, CAUTION_FAR = 1.0, 0.3
#: The same with which a second fine run beside the most promising one is chosen: nearly the process's word.
CAUTION_BOLD = 0.1
#: Coarse runs of a round, for each worker. With one the stand-ins below ended at 38 in place of 37.
SCOUTS = 2
#: Part of the chi-square that the noise of one run makes which a round must bring: with a quarter one of 16 synthetic cuts
#: ended 11 above its truth, with a tenth none more than 4.4.
LUCK = 0.1
#: Gain worth a round, as ``FitOptions.tolerance``, while the best curve is not good enough: a quarter of what bounds a 95 % interval. A curve
#: that no food of the model follows is not followed better for polishing it, and another basin is found by looking elsewhere.
AFAR = 1.0
#: Random points from which, besides all runs, the most promising one is sought; how many are followed. With 16 and 3 the stand-ins below
#: ended at 40 in place of 37.
STARTS, FOLLOWED = 100, 5
#: Probes are drawn from the normal approximation of the posterior, this much wider (on 24 synthetic cuts this
#: left a quarter of the excess chi-square that isotropic probes left), and may cost this much more than the
#: best run: about a 90 % region of one parameter, where curvature matters for the intervals.
PROBE_SPREAD, PROBE_COST, PROBES = 1.5, 3.0, 200
#: Rounds without promise and gain after which the search has converged; rounds without gain: stalled.  Half of either after
#: a further screening: what it did not bring at once it has not brought.
CALM_ROUNDS, STALLED_ROUNDS = 2, 4
#: Designs at most, while every run breaks down.
DESIGNS = 3
#: Further screenings of a curve that is not explained, and what each adds to the seed. On stand-ins of four real cuts, made of all
#: runs of their calibrations, 80 searches ended at a chi-square of 37 (geometric mean) with two or three, at 40 with none, and at 43 with
#: strides along each parameter and two more designs, all in one process, and the former scouts and starts, in 0.8 of the time.
ANEW, ANOTHER = 3, 77
#: The best curve is off by more than twice its tolerance where chi-square exceeds so many times the number of independent data: no model's
#: error explains that, and what is left of the budget is spent on looking elsewhere.
FAR_OFF = 4.0
#: Spent without a gain worth a round [fine simulations], after which a search whose curve is not explained, but not far off, ends: what
#: one that explains its curve takes in all, nearly (27.5 in 16 synthetic cuts).  For a real potato all that followed 34 brought nothing.
IDLE = 25.0
#: Part of the budget that the coarse evaluator may spend on the screening: 60 runs of the default budget.  Real cuts took 32 to 50.
SCREENING = 0.15
#: Largest joint scaling of the design's materials, as a logarithm: a factor 20 either way.
LARGEST_SCALE = 3.0


class Search:
    """The rounds of one fit and all their runs; a best chi-square above ``enough``, or what the right material leaves in 99 of 100 cuts, is
    not the end."""

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
        self.parameters = objective.parameters
        self.fine, self.coarse = evaluator, coarse
        self.trials: list[Trial] = []
        self.random = np.random.default_rng(options.seed)
        self.unit = coordinate_unit(self.parameters)
        self.hyper: list[FloatArray] | None = None
        self.centre: FloatArray | None = None
        self.screening = False
        self.anew = 0
        self.luck = 0.0
        self.level, self.gained = math.inf, 0.0
        low, high = self.parameters.box
        sobol = qmc.Sobol(len(low), scramble=True, seed=options.seed)
        count = DESIGNS * options.design
        sample = low + (high - low) * (0.1 + 0.8 * sobol.random_base2(math.ceil(math.log2(count)))[:count])
        self.designs = np.split(sample, DESIGNS)

    @property
    def finished(self) -> list[Trial]:
        """Finished runs on the fine evaluator, while screening those on the coarse one; those that cut the food, if any."""
        runs = [t for t in self.trials if t.ok and t.coarse == self.screening]
        return [t for t in runs if t.cut] or runs

    @property
    def best(self) -> Trial:
        """Best of ``finished``; there is one after the design."""
        return min(self.finished, key=lambda t: t.misfit)

    @property
    def spent(self) -> float:
        """Budget spent [fine simulations]."""
        return self.options.cost(self.trials)

    @property
    def idle(self) -> bool:
        """Whether the curve is not explained, by no more than a model's error may, and nothing has been gained for long."""
        off = not self.screening and self.enough < self.best.misfit <= FAR_OFF * self.objective.effective_rows
        return off and self.spent - self.gained >= IDLE

    @property
    def worth(self) -> float:
        """Gain in chi-square that is worth a round [-]: not what the noise of a run gives by chance."""
        least = self.options.tolerance if self.best.misfit <= self.enough else max(self.options.tolerance, AFAR)
        return max(least * max(1.0, self.best.misfit / self.objective.effective_rows), LUCK * self.luck)

    def run(self) -> str:
        """Search until there is nothing to gain or to spend; return the status."""
        first = [self.parameters.start, self.parameters.prior_mean]
        if self.coarse is not None:
            points, first = self._screen(first), []
            begun = len(self.trials)
            self._evaluate(points, "screened", most=max(2, self.options.batch))
            self._follow_lines(begun)
        if not self.finished:
            self._design(first)
        while not self.finished and self.designs and self._room() > self.options.design + 2 * self.options.batch:
            self._design([])
        if not self.finished:
            raise self._nothing()
        if self.coarse is None:
            self._differences()
        patience = 1.0
        while True:
            status, best = self._rounds(patience), self.best
            patience = 0.5
            if status == "budget":
                return status
            if self.idle:
                return "stalled"
            if best.misfit > self.enough and self._screen_anew():
                continue
            if self.coarse is None and self._differences():
                process = self.process()
                unkept = status == "stalled" or _promise(process, _near(process)) < self.worth
                if self.best is best and unkept:
                    return status
            else:
                return status

    def _screen(self, given: list[FloatArray]) -> list[FloatArray]:
        """Search on the coarse evaluator; where its process expects the best point, and its runs, best first."""
        self.screening = True
        try:
            self._design(given)
            if not self.finished:
                return []
            self._differences()
            self._rounds()
            return [_near(self.process()), *(t.z for t in sorted(self.finished, key=lambda t: t.misfit))]
        finally:
            self.screening, self.centre, self.hyper = False, None, None

    def _screen_anew(self) -> bool:
        """Screen from another design, with nothing of what is known, and run what that finds; False where it cannot or need not be paid."""
        far_off = self.best.misfit > FAR_OFF * self.objective.effective_rows
        rest = self.options.budget - self.spent - 2 * self.options.batch
        unpaid = rest < self.options.coarse_cost * self.options.least(len(self.parameters))
        if self.coarse is None or unpaid or (self.anew >= ANEW and not far_off):
            return False
        self.anew += 1
        own = replace(
            self.options,
            budget=min(self.options.budget, rest / SCREENING),
            seed=self.options.seed + ANOTHER * self.anew,
        )
        told = onward(self.progress, self.trials, self.best, self.options)
        other = Search(self.objective, self.fine, self.coarse, own, told, self.enough)
        try:
            points = other._screen([])
        finally:
            self.trials += other.trials
        self._evaluate(points, "screened", most=self.options.batch)
        return True

    def _design(self, points: list[FloatArray]) -> None:
        """Run ``points`` and the next part of the sample, then the best of the lines they stand for."""
        first = len(self.trials)
        self._evaluate(points + list(self.designs.pop(0)), "design", coarse=self.coarse is not None)
        self._follow_lines(first)

    def _follow_lines(self, first: int) -> None:
        """Run the best points of the best lines through the trials from ``first`` on: on fine cells where there is no run yet."""
        lines = sorted((self._scaled(t) for t in self.trials[first:] if t.ok), key=lambda line: line[0])
        coarse = bool(self.finished) and any(t.coarse for t in self.trials[first:])
        self._evaluate([z for _, z in lines[: self.options.batch]], "scaled", coarse=coarse)

    def _nothing(self) -> SimulationError:
        """The error that no run reached the end of its stroke."""
        furthest = max((t.evaluation for t in self.trials), key=lambda e: e.fraction)
        return SimulationError(
            f"none of {len(self.trials)} simulations led to one that ends its stroke; the furthest got to "
            f"{furthest.fraction:.0%} ({furthest.reason}) at {furthest.parameters}; check the scene, or "
            "narrow the prior ranges.",
            reason=furthest.reason,
            fraction=furthest.fraction,
        )

    def _scaled(self, trial: Trial) -> tuple[float, FloatArray]:
        """Least chi-square that jointly scaled stress-like parameters would give, and the point of it."""
        along = self.parameters.stress_like()
        curves = [t.curve for t in trial.each]
        ones = [1.0] * len(curves)

        def cost(log_k: float) -> float:
            z = self.parameters.clip(trial.z + log_k * along)
            rows = residual(self.objective, [math.exp(log_k) * curve for curve in curves], ones, z)
            return float(rows @ rows)

        found = minimize_scalar(cost, bounds=(-LARGEST_SCALE, LARGEST_SCALE), method="bounded")
        return float(found.fun), trial.z + float(found.x) * along

    def _differences(self) -> bool:
        """Step along each parameter from the best point; False where that was done or cannot be paid."""
        z, steps = self.best.z, self.parameters.steps
        done = self.centre is not None and bool(np.all(np.abs(z - self.centre) < steps))
        if done or self._room() < len(steps):
            return False
        self.centre = z
        inwards = np.where(z > self.parameters.prior_mean, -1.0, 1.0)
        self._evaluate([z + d for d in np.diag(inwards * steps)], "difference", coarse=self.coarse is not None)
        return True

    def _rounds(self, patience: float = 1.0) -> str:
        """Rounds of one batch each, until they are calm or the budget is spent.

        ``patience`` shortens the wait for gain; where it is short, only what still promises a gain after the coarse runs of a
        round is run on fine cells, also far from the best point.
        """
        calm = stalled = 0
        while self._room() > 0 and not self.idle:
            before, worth, process = self.best.misfit, self.worth, self.process()
            near = _near(process)
            promise, far = _promise(process, near), self._far(process)
            elsewhere = [far] if np.abs((far - near) / self.unit).max() > ELSEWHERE else []
            if self.coarse is None or self.screening:
                points = [near, *elsewhere]
                points += self._probes(process, near, self.options.batch)
                self._evaluate(points, "round", most=self.options.batch)
            else:
                scouts = [*elsewhere, *self._probes(process, near, SCOUTS * self.options.batch - len(elsewhere))]
                self._evaluate(scouts, "scouting", coarse=True)
                process = self.process()
                near = _near(process)
                points = [near, *self._beside(process, near)]
                if patience < 1.0:
                    points = [z for z in (near, self._far(process)) if _promise(process, z) >= worth]
                    if not points:
                        return "converged"
                self._evaluate(points, "round", most=self.options.batch)
            gained = before - self.best.misfit >= worth
            stalled = 0 if gained else stalled + 1
            calm = 0 if gained or promise >= worth else calm + 1
            if calm >= patience * CALM_ROUNDS or stalled >= patience * STALLED_ROUNDS:
                return "converged" if calm >= patience * CALM_ROUNDS else "stalled"
        return "stalled" if self.idle else "budget"

    def _beside(self, process: Surrogate, near: FloatArray) -> list[FloatArray]:
        """Points for a second fine run: of least chi-square if the process is believed, and a probe where that is the same."""
        bold, probes = process.least(near, RADIUS, CAUTION_BOLD), self._probes(process, near, 1)
        return [bold, *probes] if np.abs((bold - near) / self.unit).max() > LATTICE else probes

    def _far(self, process: Surrogate) -> FloatArray:
        """The most promising point within the bounds, sought from random points and all runs."""
        low, high = self.parameters.box
        starts = np.array([*self.random.uniform(low, high, (STARTS, len(low))), *(t.z for t in self.trials)])
        order = np.argsort(process.expected_all(starts, CAUTION_FAR), kind="stable")
        found = [process.least(z, math.inf, CAUTION_FAR) for z in starts[order[:FOLLOWED]]]
        return min(found, key=lambda z: process.expected(z, CAUTION_FAR))

    def _probes(self, process: Surrogate, near: FloatArray, count: int) -> list[FloatArray]:
        """Of points drawn from the posterior about ``near`` the ``count`` least known good ones."""
        if count < 1:
            return []
        rows = process.jacobian(near)
        spread = PROBE_SPREAD * np.linalg.inv(np.linalg.cholesky(rows.T @ rows))
        points = self.parameters.clip(near + self.random.standard_normal((PROBES, len(near))) @ spread)
        cost = process.expected_all(points, 0.0)
        doubt = process.expected_all(points, 1.0) - cost
        good = cost < max(process.best.misfit, cost.min()) + PROBE_COST
        return [points[i] for i in np.argsort(np.where(good, -doubt, 0.0))[:count]]

    def process(self, best: Trial | None = None) -> Surrogate:
        """The process through all runs so far, about the best one or another."""
        trials = [t.as_fine() for t in self.trials] if self.screening else self.trials  # one evaluator: no offset
        process = Surrogate(self.objective, trials, best or self.best, self.hyper)
        self.hyper, self.luck = process.hyper, process.luck
        return process

    def _room(self) -> int:
        """Simulations that the budget, while screening its part of it, still holds."""
        if self.screening:
            return int((SCREENING * self.options.budget - self.spent) / self.options.coarse_cost + 1e-9)
        return int(self.options.budget - self.spent + 1e-9)

    def _evaluate(
        self, points: Sequence[FloatArray], stage: str, *, coarse: bool = False, most: int | None = None
    ) -> None:
        """Run those points that are new and can be paid, the first ``most``; the history keeps the order of the points."""
        coarse = coarse or self.screening
        cost = self.options.coarse_cost if coarse else 1.0
        grid = LATTICE * self.unit
        known = [t.z for t in self.trials if t.coarse == coarse]
        batch: list[FloatArray] = []
        for point in points:
            z = self.parameters.clip(np.round(point / grid) * grid)
            new = all(np.any(np.abs(z - other) > 0.5 * grid) for other in known + batch)
            if new and self.spent + (len(batch) + 1) * cost <= self.options.budget + 1e-9:
                batch.append(z)
        batch = batch[:most]
        first, order = len(self.trials), []
        for evaluation in self._simulate([self.parameters.to_dict(z) for z in batch], coarse):
            self.trials.append(self.objective.trial(evaluation, coarse=coarse, stage=stage))
            order.append(evaluation.index)
            self._report(stage)
        self.trials[first:] = [self.trials[first + i] for i in np.argsort(order)]
        if not self.screening and self.finished and self.level - self.best.misfit >= self.worth:
            self.level, self.gained = self.best.misfit, self.spent

    def _simulate(self, batch: list[dict[str, float]], coarse: bool) -> Iterator[Evaluation]:
        evaluator = self.coarse if coarse and self.coarse is not None else self.fine
        return evaluator.evaluate(batch) if batch else iter(())

    def _report(self, stage: str) -> None:
        """Call the progress callback."""
        if self.progress is None:
            return
        misfit = self.best.misfit if self.finished else math.inf
        self.progress(
            Progress(
                done=len(self.trials),
                spent=self.spent,
                budget=self.options.budget,
                failed=sum(not t.ok for t in self.trials),
                misfit=misfit,
                eta_s=at_most(self.trials, self.options.budget - self.spent, self.options),
                stage=f"{stage} on coarse cells" if self.trials[-1].coarse else stage,
            )
        )


def _near(process: Surrogate) -> FloatArray:
    """Point of least expected chi-square near the best one."""
    return process.least(process.best.z, RADIUS, CAUTION_NEAR)


def _promise(process: Surrogate, z: FloatArray) -> float:
    """Gain in chi-square that the process expects of z over the best point [-]."""
    return process.expected(process.best.z, CAUTION_NEAR) - process.expected(z, CAUTION_NEAR)
