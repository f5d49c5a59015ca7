"""Withdrawal of the blade: the upward half of a cut as a second curve that the same simulation has to explain.

On its way down a blade parts the food, presses it aside and rubs on it: R, the pressure on the faces and friction add
up, and adhesion is not felt. On its way up nothing is parted. Friction has turned round, and what sticks is taken off.
The two ways are two terms of one objective, each with its own way, error model and correlation length; they share all
parameters, and one simulation brings both.

The withdrawal is compared as the pull on the knife, downwards positive, from where the edge has given back its elastic
slip, a number of the method, to where the edge is out of the food or the record ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.problem.joint_objective import JointObjective
from calib.problem.nuisance import Nuisance, nuisances_of_size
from calib.problem.objective import Objective
from calib.problem.parameters import Z95
from calib.problem.setup import COARSE, FINE, REPLICATED, Setup, replicated
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluation, Evaluator, Evaluators
from calib.simulation.evaluation_store import EvaluationStore
from calib.simulation.workers import Workers
from calib.trace.conditioning import Conditioned
from calib.trace.filters import FILTER_SD_M, N_STROKE, resample, smooth
from mpm.arrays import FloatArray
from mpm.scene import Scene

CUT, WITHDRAWAL = "cut", "withdrawal"
"""Names of the two terms."""
TOLD_APART = ("R", "mu", "adhesion_energy")
"""Properties that a way up tells apart, and of which a fit asks whether the trace needs them."""
RELEASE_SLIPS = 2.0
"""Way after the turn that is left out, over the slip of the edge's law [-]: within one slip the edge gives it back
(docs/theory.md, "Withdrawal of the blade")."""
PULL_DISCREPANCY = 0.1
"""How far the pull of a right model may be from the trace at least, part of the largest pull [-]. Other cells and other
particles move it by 3 to 10 % (docs/theory.md, "Friction, adhesion and R told apart"): it is a small difference of what
rubs and what is pushed out."""
LEAST_WAY = 0.2
"""Least part of the stroke that a withdrawal must have been recorded over [-]: less is little but the turn."""


@dataclass(frozen=True, eq=False)
class Withdrawal:
    """The upward half of a trace.

    Attributes:
        way: Uniform way up from the lowest point of the stroke [m], shape (n,), from the end of the release.
        pull: Filtered force that holds the knife back on it, downwards positive [N], shape (n,).
        noise_sd_N: Standard deviation of the noise of a point of it [N].
        level_sd_N: Standard uncertainty of its level: that of the baseline, and of the drift until then [N].
        speed: Mean speed on it [m/s].
    """

    way: FloatArray
    pull: FloatArray
    noise_sd_N: float
    level_sd_N: float
    speed: float


def withdrawal_of(curve: Conditioned, release: float) -> Withdrawal:
    """The upward half of a conditioned trace.

    Args:
        curve: The conditioned trace; its record must go on while the knife goes up.
        release: Way after the turn that is left out [m].

    Returns:
        The withdrawal, up to where the edge leaves the food or the record ends.

    Raises:
        TraceError: No position, too little of the way up, or nothing that holds the knife back.
    """
    source, position = curve.trace.source, curve.trace.position
    if position is None:
        raise TraceError(f"{source}: a withdrawal needs the knife's position; name its column with --position-col")
    onset = float(np.interp(curve.onset_s, curve.time, position))
    up = position - (onset - curve.stroke_length_m)
    late = curve.time >= curve.end_s
    turn = int(np.flatnonzero(late & (position == position[late].min()))[-1])
    way = np.maximum.accumulate(up[turn:])
    end = min(curve.stroke_length_m, float(way[-1]))
    if end - release < LEAST_WAY * curve.stroke_length_m:
        raise TraceError(
            f"{source}: the record ends {1e3 * max(end, 0.0):.1f} mm above the lowest point of a stroke of "
            f"{1e3 * curve.stroke_length_m:.1f} mm; a withdrawal needs {LEAST_WAY:.0%} of it beyond the first "
            f"{1e3 * release:.1f} mm: record until the edge is out of the food"
        )
    grid = np.linspace(release, end, N_STROKE)
    pull = smooth(grid, resample(way, -curve.force[turn:], grid), FILTER_SD_M)
    if not pull.max() > 0.0:
        raise TraceError(
            f"{source}: the food pushes the knife out over all of the withdrawal: nothing in it tells friction from "
            "adhesion; leave --withdrawal out"
        )
    inside = (way >= release) & (way <= end)
    seconds = float(np.ptp(curve.time[turn:][inside]))
    averaged = 2.0 * math.sqrt(math.pi) * FILTER_SD_M * np.count_nonzero(inside) / (end - release)
    later = float(curve.time[turn:][inside].mean()) - curve.onset_s
    return Withdrawal(
        way=grid,
        pull=pull,
        noise_sd_N=curve.noise_sd_N / math.sqrt(max(averaged, 1.0)),
        level_sd_N=math.hypot(curve.baseline_sd_N, curve.drift_sd_N_per_s * later),
        speed=(end - release) / max(seconds, 1e-9),
    )


def smooth_pull(grid: FloatArray, way: FloatArray, pull: FloatArray) -> FloatArray:
    """Put a simulated pull on the grid of a withdrawal, filtered as that.

    Args:
        grid: Way up of the withdrawal [m], shape (n,).
        way: Way up of the simulation [m], shape (k,).
        pull: Its pull [N], shape (k,).

    Returns:
        The pull on the grid [N], shape (n,).

    Raises:
        CurveError: The simulated way ends before the grid.
    """
    out: FloatArray = smooth(grid, resample(way, pull, grid), FILTER_SD_M)
    return out


def both_ways(evaluation: Evaluation) -> Evaluation:
    """A run of both ways as a joint evaluation: the cut, and the pull over the way up.

    Args:
        evaluation: A run whose blade is withdrawn (:func:`calib.simulation.workers.evaluation_of`).

    Returns:
        The same with two parts; that of a way that was not begun is empty.
    """
    e = evaluation
    turn = e.scalars.get("turn_m", math.inf)
    up = e.stroke > turn
    pull = replace(e, stroke=e.stroke[up] - turn, force=-e.force[up], scalars={})
    return replace(e, stroke=np.empty(0), force=np.empty(0), parts=(e.down, pull))


class BothWaysEvaluator:
    """Evaluates both ways of each candidate with one simulation.

    Args:
        inner: What simulates a cut whose blade is withdrawn.
    """

    def __init__(self, inner: Evaluator) -> None:
        self.inner = inner

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Run each candidate; yields in order of completion, ``index`` is the place in the batch."""
        for evaluation in self.inner.evaluate(batch):
            yield both_ways(evaluation)


def with_withdrawal(cut: Objective, target: Target, nuisances: tuple[Nuisance, ...] = ()) -> JointObjective:
    """The objective of a cut and its withdrawal.

    Args:
        cut: That of the way down.
        target: The pull over the way up; its smoother is :func:`smooth_pull`.
        nuisances: What the measurement leaves open of the withdrawal.

    Returns:
        The joint objective, over the parameters of the cut.
    """
    errors = replace(cut.errors, discrepancy=max(cut.errors.discrepancy, PULL_DISCREPANCY))
    up = Objective(target, cut.parameters, errors, nuisances, guesses=cut.guesses)
    return JointObjective.of({CUT: cut, WITHDRAWAL: up}, cut.parameters.names)


def withdrawn(scene: Scene, stroke: float, way: float, doubt: float = 0.0) -> Scene:
    """A scene whose blade turns where that of the trace did.

    What is left uncut is at least as high as a tie of the crack, and holds the halves together. So a stroke that may as
    well have been a whole one is one.

    Args:
        scene: The cut.
        stroke: Stroke at which the knife turned [m].
        way: Way up that is compared [m].
        doubt: How far the stroke may be off [m].

    Returns:
        The scene, with half a cell more of the way up, for the mean over a cell.
    """
    height = scene.food.shape.height
    stroke = height if stroke >= height - doubt else stroke
    up = way + 0.5 * scene.numerics.dx + scene.numerics.output
    return replace(scene, motion=replace(scene.motion, stroke=stroke, retract=up))


@dataclass(frozen=True, eq=False)
class BothWays:
    """A calibration's set-up with the withdrawal of its trace.

    Attributes:
        setup: That of the way down.
        withdrawal: The way up.
        objective: That of both.
    """

    setup: Setup
    withdrawal: Withdrawal
    objective: JointObjective

    @classmethod
    def of(cls, setup: Setup) -> BothWays:
        """Add the withdrawal to a set-up.

        Raises:
            TraceError: No usable withdrawal in the trace, or a sensor with a low-pass, which would need its history.
        """
        if math.isfinite(setup.bandwidth):
            raise TraceError(
                f"{setup.curve.trace.source}: its force went through a low-pass of {setup.bandwidth:g} Hz, through "
                "which a withdrawal is not compared; leave --withdrawal out"
            )
        found = withdrawal_of(setup.curve, RELEASE_SLIPS * setup.fine.edge.slip)
        target = Target(found.way, found.pull, found.noise_sd_N, found.noise_sd_N, smooth_pull)
        sds = {n.name: n.sd for n in setup.objective.nuisances}
        sizes = {"tare": found.level_sd_N} | {name: sds[name] for name in ("gain", "width") if name in sds}
        open_ended = nuisances_of_size(found.way, found.pull, sizes)
        return cls(setup, found, with_withdrawal(setup.objective, target, open_ended))

    def scene(self, scene: Scene) -> Scene:
        """A cut of the set-up with its blade withdrawn."""
        lag = max((n.sd for n in self.setup.objective.nuisances if n.name == "lag"), default=0.0)
        return withdrawn(scene, self.setup.curve.stroke_length_m, float(self.withdrawal.way[-1]), Z95 * lag)

    def evaluators(self, pool: Workers, store: EvaluationStore) -> Evaluators:
        """What runs the simulations of a search.

        Args:
            pool: Where they run.
            store: Where they are kept.

        Returns:
            An evaluator for each fidelity.
        """
        fine, coarse = self.scene(self.setup.fine), self.scene(self.setup.coarse)
        asked = {FINE: fine, COARSE: coarse, REPLICATED: replicated(fine)}
        return Evaluators(
            *(BothWaysEvaluator(self.setup.evaluator(one, pool, store, name)) for name, one in asked.items())
        )
