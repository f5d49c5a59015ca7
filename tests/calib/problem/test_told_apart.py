"""What a made-up cut of the solver tells of friction, adhesion and R, without and with its withdrawal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from calib.problem.joint_objective import JointObjective
from calib.problem.nuisance import nuisances_of_size
from calib.problem.objective import EXPLAINED, Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.scored_run import ScoredRun
from calib.problem.target import Target
from calib.problem.withdrawal import RELEASE_SLIPS, both_ways, smooth_pull, with_withdrawal, withdrawn
from calib.simulation.evaluation import Evaluation
from calib.simulation.workers import evaluation_of
from calib.trace.filters import N_STROKE, filter_simulated
from calib.uncertainty.intervals import Uncertainty, linearised_likelihood, uncertainty
from mpm.runtime import Runtime
from mpm.scene import Board, Motion
from mpm.solver import Simulation
from tests.mpm.scenes import PRISM, WEDGE

pytestmark = pytest.mark.long
STROKE, NOISE = 0.018, 0.02
MADE, ASSUMED = 2e-3, 3e-3
"""Cells of the truth, with other particles too, and of what explains it [m]."""
# ten times as heavy, as if it were held down: what is held by its weight alone is lifted with the blade
HELD = replace(
    PRISM,
    knife=WEDGE,
    board=Board(9.0),
    motion=Motion(STROKE, 0.01),
    numerics=replace(PRISM.numerics, gravity=98.1),
).with_material(loss_factor=0.1, adhesion=5e3, adhesion_energy=1.0, mu=0.3)
FIVE = ParameterSet(
    (
        Parameter("E", 1e6, 1e5, 1e7, "Pa", 3e5, 3e6),
        Parameter("yield_stress", 2e5, 1e4, 2e6, "Pa", 6e4, 6e5),
        Parameter("R", 300.0, 20.0, 5e3, "J/m^2", 60.0, 1500.0),
        Parameter("mu", 0.3, 0.0, 1.2, "-", 0.05, 0.6, "linear"),
        Parameter("adhesion_energy", 1.0, 0.02, 50.0, "J/m^2", 0.1, 10.0),
    )
)


def simulated(z: np.ndarray, *, cell: float = ASSUMED, seed: int = 0) -> Evaluation:
    """Both ways at internal coordinates (p,)."""
    values = FIVE.to_dict(z)
    scene = withdrawn(HELD, STROKE, STROKE).with_material(**values, R_initiation=values["R"])
    scene = replace(scene, numerics=replace(scene.numerics, dx=cell, seed=seed))
    return both_ways(replace(evaluation_of(Simulation(scene, Runtime(threads=1)).run()), parameters=values))


@pytest.fixture(scope="module")
def objectives() -> tuple[Objective, JointObjective]:
    """The made-up cut alone, and with its withdrawal."""
    down, up = simulated(FIVE.start, cell=MADE, seed=5).parts
    below = down.stroke >= 0.0
    stroke, way = np.linspace(0.0, STROKE, N_STROKE), np.linspace(RELEASE_SLIPS * HELD.edge.slip, STROKE, N_STROKE)
    curve = filter_simulated(stroke, down.stroke[below], down.force[below])
    pull = smooth_pull(way, up.stroke, up.force)
    sizes = {"tare": NOISE, "gain": 0.02}
    alone = Objective(
        Target(stroke, curve, NOISE, NOISE, filter_simulated), FIVE, nuisances=nuisances_of_size(stroke, curve, sizes)
    )
    target = Target(way, pull, NOISE, NOISE, smooth_pull)
    return alone, with_withdrawal(alone, target, nuisances_of_size(way, pull, sizes))


@pytest.fixture(scope="module")
def found(objectives) -> list[tuple[ScoredRun, Uncertainty]]:
    """Of each objective the run of the truth on other cells, and the linearised posterior there."""
    steps = np.diag(FIVE.steps)
    runs = [simulated(FIVE.start), *(simulated(FIVE.start + sign * h) for h in steps for sign in (1.0, -1.0))]
    out = []
    for goal in objectives:
        scored = [goal.score(run if isinstance(goal, JointObjective) else run.parts[0]) for run in runs]
        ahead, back = (np.array([run.residual for run in scored[first::2]]) for first in (1, 2))
        slopes = ((ahead - back) / (2 * FIVE.steps[:, None])).T
        out.append((scored[0], uncertainty(FIVE, linearised_likelihood(goal, scored[0], slopes))))
    return out


def test_other_cells_explain_both_ways(objectives, found):
    """The truth on coarser cells, with other particles, is within the error model on either way."""
    for goal, (run, _) in zip(objectives, found, strict=True):
        assert run.ok and run.misfit < chi2.ppf(EXPLAINED, goal.effective_rows)


def test_the_way_down_mixes_what_the_way_up_tells_apart(found):
    """Down alone R goes up where friction goes down, and adhesion is not seen. With the way up their correlation is
    small, the intervals of R and of friction are less than half as wide, and adhesion is identified."""
    (_, down), (_, both) = found
    at = {name: k for k, name in enumerate(FIVE.names)}
    assert down.correlation[at["R"], at["mu"]] < -0.7
    assert abs(both.correlation[at["R"], at["mu"]]) < 0.5
    widths = [np.sqrt(np.diag(one.covariance)) for one in (down, both)]
    for name in ("R", "mu"):
        assert widths[1][at[name]] < 0.5 * widths[0][at[name]]
    verdicts = [{i.parameter.name: i.verdict for i in one.intervals} for one in (down, both)]
    assert [v["adhesion_energy"] for v in verdicts] == ["not_seen", "identified"]
    for one in both.intervals:
        assert one.low95 < one.parameter.value < one.high95
