"""Which points are worth a simulation: acquisition on the surrogate of a search.

What is minimised is the *expected* chi-square of a point: that of the expected curves, and what not knowing the curves
adds to it, times a weight. A weight of 1 is the expectation. Less of it gives a promising point that is little known a
chance (composite objectives: Astudillo & Frazier 2019, Proc. ICML 97).
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy.optimize import minimize_scalar

from calib.fit.surrogate import Surrogate
from calib.problem.joint_objective import JointObjective, residual
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.problem.scored_run import ScoredRun
from mpm.arrays import FloatArray

#: Points of two basins are at least this far apart [coordinate units].
BASIN_DISTANCE = 0.2
#: Points are rounded to this part of a coordinate unit (0.1 % of a log parameter) [-]: far below the noise of a run,
#: and a resumed fit asks for exactly the points that are in the store.
LATTICE = 1e-3
#: The surrogate is trusted this far from the best point [coordinate units]: a factor e of a log parameter.
TRUST_RADIUS = 1.0
#: Weight of not knowing the curves in the expected chi-square [-]: near the best point, where it is the expectation;
#: far from it, for the sake of promising basins; and for a second fine run beside the most promising one, nearly the
#: surrogate's word.
LOCAL_WEIGHT, GLOBAL_WEIGHT, GREEDY_WEIGHT = 1.0, 0.3, 0.1
#: Random points from which, besides all runs, the most promising one is sought, and how many of them all are followed
#: (docs/theory.md, "Measured choices").
GLOBAL_STARTS, GLOBAL_DESCENTS = 100, 5
#: Probes are drawn from the normal approximation of the posterior, this much wider, and may cost this much more in
#: chi-square than the best run: about a 90 % region of one parameter, where curvature matters for the intervals. The
#: last number is how many are drawn (docs/theory.md, "Measured choices").
PROBE_SPREAD, PROBE_COST, PROBES = 1.5, 3.0, 200
#: Largest joint scaling of a run's material, as a logarithm: a factor 20 either way.
LARGEST_SCALE = 3.0


def on_lattice(parameters: ParameterSet, unit: FloatArray, z: FloatArray) -> FloatArray:
    """The point of the lattice that is nearest.

    Args:
        parameters: Their bounds are kept.
        unit: Coordinate units [-] (p,).
        z: Internal coordinates of a point [-] (p,).

    Returns:
        Internal coordinates (p,).
    """
    grid = LATTICE * unit
    return parameters.clip(np.round(z / grid) * grid)


def same_point(unit: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Whether two points are one of the lattice.

    Args:
        unit: Coordinate units [-] (p,).
        one: Internal coordinates of a point [-] (p,).
        other: Those of the other [-] (p,).

    Returns:
        Whether they are no further apart than half a step of the lattice along any axis.
    """
    return bool(np.all(np.abs(one - other) <= 0.5 * (LATTICE * unit)))


def apart(runs: Iterable[ScoredRun], unit: FloatArray, most: int) -> list[ScoredRun]:
    """The best runs, each in a basin of its own.

    Args:
        runs: The runs.
        unit: Coordinate units [-] (p,).
        most: How many at most.

    Returns:
        They, the best first.
    """
    found: list[ScoredRun] = []
    for run in sorted(runs, key=lambda run: run.misfit):
        if len(found) < most and all(np.abs((run.z - other.z) / unit).max() > BASIN_DISTANCE for other in found):
            found.append(run)
    return found


def best_scaled(objective: Objective | JointObjective, run: ScoredRun) -> tuple[float, FloatArray]:
    """Where a run's line is best: the materials whose stress-like parameters are jointly scaled have its curve, scaled.

    Args:
        objective: Target, parameters and error model.
        run: A finished run.

    Returns:
        Chi-square there [-], and internal coordinates (p,).
    """
    parameters = objective.parameters
    along = parameters.stress_like()
    curves = [part.curve for part in run.each]
    ones = [1.0] * len(curves)

    def cost(log_k: float) -> float:
        z = parameters.clip(run.z + log_k * along)
        rows = residual(objective, [math.exp(log_k) * curve for curve in curves], ones, z)
        return float(rows @ rows)

    found = minimize_scalar(cost, bounds=(-LARGEST_SCALE, LARGEST_SCALE), method="bounded")
    return float(found.fun), run.z + float(found.x) * along


def local_optimum(surrogate: Surrogate) -> FloatArray:
    """Point (p,) of least expected chi-square near the best run."""
    return surrogate.least(surrogate.best.z, TRUST_RADIUS, LOCAL_WEIGHT)


def expected_gain(surrogate: Surrogate, z: FloatArray) -> float:
    """Gain in chi-square that is expected of a point (p,) over the best run [-]."""
    return surrogate.expected(surrogate.best.z, LOCAL_WEIGHT) - surrogate.expected(z, LOCAL_WEIGHT)


def global_optimum(surrogate: Surrogate, runs: Iterable[ScoredRun], random: np.random.Generator) -> FloatArray:
    """The most promising point within the bounds.

    Args:
        surrogate: The surrogate.
        runs: Runs whose points are starts of the search for it.
        random: Source of the other starts.

    Returns:
        Its internal coordinates (p,).
    """
    parameters = surrogate.objective.parameters
    starts = np.array([*parameters.in_box(random.random((GLOBAL_STARTS, len(parameters)))), *(run.z for run in runs)])
    order = np.argsort(surrogate.expected_all(starts, GLOBAL_WEIGHT), kind="stable")
    found = [surrogate.least(z, math.inf, GLOBAL_WEIGHT) for z in starts[order[:GLOBAL_DESCENTS]]]
    return min(found, key=lambda z: surrogate.expected(z, GLOBAL_WEIGHT))


def probes(surrogate: Surrogate, near: FloatArray, count: int, random: np.random.Generator) -> list[FloatArray]:
    """Of points drawn from the posterior those that are good and least known.

    Args:
        surrogate: The surrogate.
        near: Internal coordinates of the point about which they are drawn [-] (p,).
        count: How many.
        random: Source of randomness.

    Returns:
        Their internal coordinates, (p,) each.
    """
    if count < 1:
        return []
    rows = surrogate.jacobian(near)
    spread = PROBE_SPREAD * np.linalg.inv(np.linalg.cholesky(rows.T @ rows))
    points = surrogate.objective.parameters.clip(near + random.standard_normal((PROBES, len(near))) @ spread)
    cost = surrogate.expected_all(points, 0.0)
    unknown = surrogate.expected_all(points, 1.0) - cost
    good = cost < max(surrogate.best.misfit, cost.min()) + PROBE_COST
    return [points[i] for i in np.argsort(np.where(good, -unknown, 0.0))[:count]]


def beside(surrogate: Surrogate, near: FloatArray, random: np.random.Generator) -> list[FloatArray]:
    """Points for a second run beside that of the local optimum.

    Args:
        surrogate: The surrogate.
        near: Internal coordinates of the local optimum [-] (p,).
        random: Source of randomness.

    Returns:
        The point of least chi-square if the surrogate is believed, where that is another one, and a probe; (p,) each.
    """
    greedy, others = surrogate.least(near, TRUST_RADIUS, GREEDY_WEIGHT), probes(surrogate, near, 1, random)
    return [greedy, *others] if np.abs((greedy - near) / surrogate.unit).max() > LATTICE else others
