"""The suction of the board: a block drawn upwards stays up to its limit."""

from __future__ import annotations

import numpy as np
import pytest

from mpm.runtime import Runtime
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from mpm.state import tables as row
from mpm.state.host_transfer import of_particles

SIDE = 0.024
FLESH = Material(E=2e5, nu=0.3, rho=1000, yield_stress=1e5, R=60.0, R_initiation=60.0, loss_factor=0.3)
SUCTION = 500.0
BALANCE = SUCTION / (FLESH.rho * SIDE)  # acceleration at which it bears the weight, upside down [m/s^2]


def drawn_up(pull: float, steps: int, kind: str = "block", suction: float = SUCTION) -> tuple[float, float, float]:
    """A food under a gravity that points upwards, no tool near.

    Returns:
        Force of the board on it over the second half of the steps [N], how far its lowest layer has risen [m], and the
        energy that the suction has taken [J].
    """
    scene = Scene(
        Food(Shape(kind, SIDE, SIDE, SIDE), FLESH),
        Knife("away", 1e-3, np.deg2rad(10.0), 0.05, 0.2),
        Motion(2e-3, 1e-3),
        board=Board(0.5, suction),
        edge=EdgeLaw(zone=3e-3),
        numerics=Numerics(dx=3e-3, gravity=-pull),
    )
    sim = Simulation(scene, Runtime(threads=1))
    sim.load(FLESH)
    sim.set_pose(1.0)
    dt = sim.setup.time_step(FLESH)
    report = sim.advance((steps, 20, dt, 0.0, 0.0, 0.0))
    late = report[len(report) // 2 :, row.BOARD + 2]
    rise = of_particles(sim.state, sim.state.x)[:, 2] - sim.setup.seeds.x[:, 2]
    lowest = sim.setup.seeds.bottom
    return late.sum() / (20 * len(late) * dt), rise[lowest].mean(), report[:, row.SUCTION_WORK].sum()


def test_it_bears_what_it_can() -> None:
    """At half of its limit the board holds the block with what draws it up, within 2 %, and hardly lets it rise."""
    force, rise, _ = drawn_up(0.5 * BALANCE, 1200)
    assert force == pytest.approx(0.5 * SUCTION * SIDE**2, rel=0.02)
    assert 0 < rise < 1e-3 * SIDE


def test_beyond_it_the_food_leaves() -> None:
    """At twice its limit the block leaves, held by no more than the limit, and the work of that is booked."""
    force, rise, work = drawn_up(2.0 * BALANCE, 400)
    assert force == pytest.approx(SUCTION * SIDE**2, rel=0.02)
    assert rise > 0.02 * SIDE
    assert work == pytest.approx(SUCTION * SIDE**2 * rise, rel=0.05)


@pytest.mark.parametrize(("kind", "suction"), [("cylinder", SUCTION), ("block", 0.0)])
def test_nothing_holds_a_round_food_or_on_a_dry_board(kind: str, suction: float) -> None:
    """A lying cylinder has no face that the air could press on."""
    force, rise, work = drawn_up(0.5 * BALANCE, 400, kind, suction)
    assert force == pytest.approx(0.0, abs=1e-9) and rise > 0.01 * SIDE and work == 0.0
