"""History matching: simulations in waves, each where those before leave a food plausible, until the emulator is as good
as it need be there.

The first wave fills the literature's prior, and knows nothing of the trace. Each further one is drawn from the
posterior at a falling temperature, in which the emulator's doubt is part of the variance, and spread out in the
coordinates of the emulator. Points chosen by doubt or distance alone would lie on the rim, where cuts fail. The error
of each wave's curves, predicted before they are simulated, is the measure of the emulator.

Sources: history matching, Vernon, Goldstein & Bower (2010), Bayesian Analysis 5:619; Craig et al. (1997), Case Studies
in Bayesian Statistics 3:36.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from calib.fit.acquisition import LATTICE
from calib.fit.surrogate import coordinate_unit
from calib.posterior.coordinates import Coordinates
from calib.posterior.correction import Correction
from calib.posterior.emulator import CurveEmulator, was_cut
from calib.posterior.likelihood import Likelihood
from calib.posterior.sampling import FINAL, SCOUTING, Effort, Sample, sample
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator, Evaluators
from mpm.arrays import FloatArray

TEMPERATURES = (2.0, 1.5, 1.2, 1.0)
"""Temperatures of the posteriors that further waves are drawn from; the last one holds for all after."""
GOOD_ERROR = 0.02
"""Hold-out error that 90 % of a wave's runs stay below, part of the peak, where no further one is needed [-]."""
MOVED = 0.2
"""Part of a 95 % interval by which a median may move between waves where no further one is needed [-]: the sample alone
moves it by 0.1."""
HOPELESS = 1000.0
"""Chi-square of a run's curve beyond which it is not learnt from where others are enough [-]."""
ENOUGH = 160
"""Runs learnt from at least, the nearest ones, where there are so many; three times as many are at most."""
SEEDS = 1000
"""Seeds of draws between one seed of a posterior and the next."""
REACH = 1.25
"""Standard deviation of the first wave over the prior's [-]."""
CANDIDATES = 8
"""Draws for each run of a wave, from which the most spread ones are chosen."""


@dataclass(frozen=True)
class Plan:
    """How much is simulated and sampled for a posterior.

    Attributes:
        first: Coarse runs of the first wave.
        later: Those of each further one.
        pairs: Points of each wave that are simulated on fine cells as well: those of the first wave that are nearest
            to the trace, of others the most spread ones.
        judges: Fine runs of the posterior after the last wave, spread out, whose curves are predicted before: as often
            until that is good enough.
        scouting: Sampling between waves, which only says where to simulate next.
        final: Sampling of the result.
        waves: Waves at most.
    """

    first: int = 256
    later: int = 96
    pairs: int = 6
    judges: int = 12
    scouting: Effort = SCOUTING
    final: Effort = FINAL
    waves: int = 8


@dataclass(frozen=True)
class Wave:
    """One wave of simulations.

    Attributes:
        runs: Its runs.
        cut: Those that cut the food, which are compared.
        temperature: That of the posterior it was drawn from; None for the prior.
        error: Median of the errors of their curves as predicted before, root mean square over the trace's peak [-];
            None for the first wave.
        error90: What 90 % of these errors stay below [-].
        moved: Largest move of a median since the wave before, part of its 95 % interval [-]; None where there was none.
    """

    runs: int
    cut: int
    temperature: float | None = None
    error: float | None = None
    error90: float | None = None
    moved: float | None = None


@dataclass(frozen=True, eq=False)
class Matched:
    """What the waves have left.

    Attributes:
        runs: All coarse runs.
        fine: All fine ones.
        emulator: The emulator through those that were learnt from.
        sample: Draws from prior to posterior by it.
        waves: What each wave was.
        converged: Whether the last one was as good as it need be.
    """

    runs: tuple[ScoredRun, ...]
    fine: tuple[ScoredRun, ...]
    emulator: CurveEmulator
    sample: Sample
    waves: tuple[Wave, ...]
    converged: bool


def on_lattice(parameters: ParameterSet, z: FloatArray) -> FloatArray:
    """The nearest points (q, p) of the lattice of simulated foods, within the hard bounds.

    What is left of the algebra's rounding on another processor then moves no point, but where it lies on an edge.
    """
    grid = LATTICE * coordinate_unit(parameters)
    return parameters.clip(np.round(z / grid) * grid)


def first_wave(parameters: ParameterSet, count: int) -> FloatArray:
    """Points (count, p) that fill the prior: the same for each trace, so that a store serves the next one."""
    cube = qmc.Sobol(len(parameters), scramble=True, seed=0).random(count)
    return on_lattice(parameters, parameters.from_steps(REACH * ndtri(0.005 + 0.99 * cube)))


def match_history(
    objective: Objective,
    coordinates: Coordinates,
    evaluators: Evaluators,
    plan: Plan,
    seed: int = 0,
    say: Callable[[str], None] = lambda text: None,
) -> Matched:
    """Simulate in waves until the emulator is good where foods are plausible.

    Args:
        objective: The trace.
        coordinates: Where the emulator lives.
        evaluators: Coarse and fine simulations.
        plan: How many, and how they are sampled between.
        seed: Seed of what is drawn.
        say: Called with a sentence for each wave.

    Returns:
        What they have left.

    Raises:
        ValueError: Too few foods of the first wave are cut.
    """
    parameters = objective.parameters
    say(f"wave 1: {plan.first} foods of the literature's ranges on coarse cells")
    runs = simulated(objective, evaluators.coarse, first_wave(parameters, plan.first), "wave")
    near = sorted(filter(was_cut, runs), key=_distance)[: plan.pairs]
    fine = (
        simulated(objective, evaluators.fine, np.array([run.z for run in near]), "pair", coarse=False) if near else []
    )
    waves = [Wave(len(runs), sum(map(was_cut, runs)))]
    emulator: CurveEmulator | None = None
    last: tuple[FloatArray, FloatArray] | None = None
    while True:
        emulator = learnt(coordinates, runs, emulator)
        corrected = Correction(emulator, [run for run in fine if was_cut(run)], finer=True)
        drawn = sample(Likelihood(objective, emulator, corrected), plan.scouting, SEEDS * seed + len(waves))
        spread = summary(drawn)
        moved = None if last is None else float(np.max(np.abs(spread[0] - last[0]) / last[1]))
        last = spread
        waves[-1] = _with(waves[-1], moved)
        say(_words(len(waves), waves[-1]))
        good = _good(waves[-1])
        if good or len(waves) == plan.waves:
            return Matched(tuple(runs), tuple(fine), emulator, drawn, tuple(waves), good)
        temperature = TEMPERATURES[min(len(waves), len(TEMPERATURES)) - 1]
        points = proposals(drawn, emulator, runs, plan.later, SEEDS * seed + len(waves), temperature)
        new = simulated(objective, evaluators.coarse, points, "wave")
        fine += simulated(objective, evaluators.fine, points[: plan.pairs], "pair", coarse=False)
        cut = [run for run in new if was_cut(run)]
        errors = prediction_errors(objective, emulator.curves(np.array([run.z for run in cut])), cut) if cut else None
        waves.append(_wave(len(new), temperature, errors))
        runs += new


def learnt(coordinates: Coordinates, runs: Sequence[ScoredRun], earlier: CurveEmulator | None = None) -> CurveEmulator:
    """The emulator of the runs that are near enough to the trace.

    Args:
        coordinates: Where it lives.
        runs: All runs.
        earlier: One of fewer runs, whose hyperparameters this one starts from.

    Returns:
        The emulator.

    Raises:
        ValueError: Too few of them were cut.
    """
    far = np.array([_distance(run) if was_cut(run) else np.inf for run in runs])
    near = np.sort(far[np.isfinite(far)])
    limit = max(HOPELESS, float(near[min(ENOUGH, len(near)) - 1])) if len(near) else HOPELESS
    limit = min(limit, float(near[min(3 * ENOUGH, len(near)) - 1])) if len(near) else limit
    return CurveEmulator(coordinates, runs, far <= limit, earlier)


def simulated(
    objective: Objective, evaluator: Evaluator, points: FloatArray, stage: str, *, coarse: bool = True
) -> list[ScoredRun]:
    """The runs at some points.

    Args:
        objective: The trace.
        evaluator: Runs them.
        points: Internal coordinates [-] (q, p).
        stage: What they are run for.
        coarse: Whether they are on coarse cells.

    Returns:
        The runs in the order of the points.
    """
    found = sorted(evaluator.evaluate([objective.parameters.to_dict(z) for z in points]), key=lambda e: e.index)
    return [objective.score(e, coarse=coarse, stage=stage) for e in found]


def proposals(
    drawn: Sample,
    emulator: CurveEmulator,
    runs: Sequence[ScoredRun],
    count: int,
    seed: int,
    temperature: float,
) -> FloatArray:
    """Points (count, p) of the tempered posterior, spread out among themselves and from what was run.

    Each is the farthest of what is left from all before (farthest-first traversal: Gonzalez 1985).

    Args:
        drawn: The draws from prior to posterior.
        emulator: The emulator, whose lengths are the measure.
        runs: What was run.
        count: How many.
        seed: Seed of the draw.
        temperature: That of the posterior.

    Returns:
        The points, on the lattice; fewer where the draws have no more.
    """
    parameters = emulator.coordinates.parameters
    places = np.unique(drawn.drawn(CANDIDATES * count, seed, temperature))
    z = np.unique(on_lattice(parameters, drawn.z[places]), axis=0)
    axes, known = emulator.axes(z), emulator.axes(np.array([run.z for run in runs]).reshape(-1, z.shape[1]))
    gap = np.min(np.sum((axes[:, None] - known[None]) ** 2, axis=2), axis=1, initial=np.inf)
    chosen: list[int] = []
    for _ in range(min(count, len(z))):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.sum((axes - axes[chosen[-1]]) ** 2, axis=1))
    return z[chosen]


def prediction_errors(objective: Objective, curves: FloatArray, runs: Sequence[ScoredRun]) -> FloatArray:
    """Errors of expected curves.

    Args:
        objective: The trace.
        curves: Expected curves [N] (q, n).
        runs: The runs that they were expected of.

    Returns:
        Root mean square of expected less simulated curve over the trace's peak [-] (q,).
    """
    simulated_ = np.array([run.curve for run in runs])
    out: FloatArray = np.sqrt(np.mean((curves - simulated_) ** 2, axis=1)) / objective.target.peak
    return out


def summary(drawn: Sample) -> tuple[FloatArray, FloatArray]:
    """Medians and lengths of the 95 % intervals (p,) of the internal coordinates."""
    low, middle, high = quantiles(drawn.z, drawn.weights(), (0.025, 0.5, 0.975))
    return middle, high - low


def quantiles(values: FloatArray, weights: FloatArray, parts: Sequence[float]) -> FloatArray:
    """Quantiles of weighted values.

    Args:
        values: The values [any unit] (k, p).
        weights: Their weights, of sum one [-] (k,).
        parts: Parts of the weight below a quantile [-].

    Returns:
        The quantiles (len(parts), p).
    """
    out = []
    for column in values.T:
        order = np.argsort(column)
        reached = np.cumsum(weights[order]) - 0.5 * weights[order]
        out.append(np.interp(parts, reached, column[order]))
    return np.array(out).T


def _distance(run: ScoredRun) -> float:
    """Chi-square of a run's data alone [-]."""
    return float(np.sum(run.residual[: -len(run.z)] ** 2))


def _good(wave: Wave) -> bool:
    known = wave.error90 is not None and wave.moved is not None
    return known and wave.error90 <= GOOD_ERROR and wave.moved <= MOVED  # type: ignore[operator]


def _wave(runs: int, temperature: float, errors: FloatArray | None) -> Wave:
    if errors is None:
        return Wave(runs, 0, temperature)
    return Wave(runs, len(errors), temperature, float(np.median(errors)), float(np.quantile(errors, 0.9)))


def _with(wave: Wave, moved: float | None) -> Wave:
    return Wave(wave.runs, wave.cut, wave.temperature, wave.error, wave.error90, moved)


def _words(number: int, wave: Wave) -> str:
    said = f"wave {number}: {wave.cut} of {wave.runs} foods were cut"
    if wave.error is not None and wave.error90 is not None:
        said += f", predicted to {wave.error:.1%} of the peak (90 %: {wave.error90:.1%})"
    return said if wave.moved is None else f"{said}; medians moved by {wave.moved:.0%} of their intervals"
