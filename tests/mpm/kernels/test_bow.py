"""A bowed food rests on its ends or on its middle, and sags as the beam that it then is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.discretisation.grid import lay_out
from mpm.runtime import Runtime
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from mpm.state import tables as row
from mpm.state.host_transfer import of_particles

LENGTH, SIDE, DX, BOW = 0.12, 0.024, 4e-3, 3e-3
FLESH = Material(E=2e5, nu=0.0, rho=1000, yield_stress=1e5, R=60.0, R_initiation=60.0, loss_factor=0.3)
GRAVITY = 1.0
PERIODS = 3


def beam(bow: float, contact: str = "cohesive") -> Scene:
    """A bar on the board, no tool near."""
    return Scene(
        Food(Shape("block", LENGTH, SIDE, SIDE), FLESH),
        Knife("away", 1e-3, np.deg2rad(10.0), 0.05, 0.2),
        Motion(2e-3, 1e-3),
        board=Board(0.0, 0.0, bow),
        edge=EdgeLaw(zone=DX),
        numerics=Numerics(dx=DX, gravity=GRAVITY, contact=contact),
    )


def sag(bow: float, first: float, contact: str = "cohesive") -> float:
    """How much further the middle has sunk than the ends, on average over the bar's slowest oscillation [m].

    Args:
        bow: Of its underside [m].
        first: Root of the bar's characteristic equation for its lowest mode, over the length that sags [1/m].
        contact: Of particles' surfaces, or of nodes.
    """
    scene = beam(bow, contact)
    sim = Simulation(scene, Runtime(threads=1))
    sim.load(FLESH)
    sim.set_pose(1.0)
    dt = sim.setup.time_step(FLESH)
    omega = first**2 * SIDE * np.sqrt(FLESH.E / (12 * FLESH.rho))
    steps = round(2 * np.pi / omega / dt)
    start = sim.setup.seeds.x
    middle, end = (np.isclose(np.abs(start[:, 1]), y, atol=DX / 2) for y in (0.0, LENGTH / 2))
    sunk = []
    for k in range(20 * PERIODS):  # gravity comes slowly, and is whole in the last period
        sim.state.par[0, row.GRAVITY] = GRAVITY * min((k + 1) / (20 * (PERIODS - 1)), 1.0)
        sim.advance((steps // 20, steps // 20, dt, 0.0, 0.0, 0.0))
        fall = (start - of_particles(sim.state, sim.state.x))[:, 2]
        sunk.append(fall[middle].mean() - fall[end].mean())
    return float(np.mean(sunk[-20:]))


WEIGHT = 12 * FLESH.rho * GRAVITY / (FLESH.E * SIDE**2)  # of a bar per length, over its bending stiffness [1/m^3]
SHEAR = FLESH.rho * GRAVITY / (5 / 6 * FLESH.shear)  # the same over its stiffness in shear [1/m]
ON_ENDS = 5 * WEIGHT * LENGTH**4 / 384 + SHEAR * LENGTH**2 / 8  # sag of a beam on two supports [m]


def test_it_rests_on_its_ends() -> None:
    """A bar whose middle is off the board sags there as a beam on two supports (Timoshenko 1921), within 8 %."""
    assert sag(BOW, np.pi / LENGTH) == pytest.approx(ON_ENDS, rel=0.08)


def test_the_contact_of_nodes_sees_a_bow_of_cells() -> None:
    """With four cells under its middle the bar sags so within 15 %; nodes hold it up where there is less than one."""
    assert sag(4 * DX, np.pi / LENGTH, "nodal") == pytest.approx(ON_ENDS, rel=0.15)
    assert sag(BOW, np.pi / LENGTH, "nodal") < 0.2 * ON_ENDS


def test_it_rests_on_its_middle() -> None:
    """Where its ends are up they sag as cantilevers, within 5 %."""
    half = LENGTH / 2
    assert -sag(-BOW, 1.8751 / half) == pytest.approx(WEIGHT * half**4 / 8 + SHEAR * half**2 / 2, rel=0.05)


def test_a_straight_bar_does_not_sag() -> None:
    """Between the two the board bears it all along."""
    assert abs(sag(0.0, np.pi / LENGTH)) < 1e-5


@pytest.mark.parametrize(("bow", "middle", "end"), [(BOW, -BOW, 0.0), (-BOW, 0.0, -BOW), (0.0, 0.0, 0.0)])
def test_where_the_board_is(bow: float, middle: float, end: float) -> None:
    """The highest places of the board are at 0, and the edge may go down to the board."""
    scene = beam(bow)
    board, shape = scene.board, scene.food.shape
    assert scene.floor == board.height(shape) == pytest.approx(middle)
    assert board.height(shape, LENGTH / 2) == board.height(shape, -LENGTH / 2) == pytest.approx(end)
    assert board.height(replace(shape, cut=LENGTH / 4), LENGTH / 4) == pytest.approx(end)
    assert replace(scene, motion=Motion(SIDE - middle, 1e-3)).motion.stroke == SIDE - middle
    with pytest.raises(SceneError, match="goes below the board"):
        replace(scene, motion=Motion(SIDE - middle + 1e-4, 1e-3))


@pytest.mark.parametrize(("bow", "cells"), [(0.0, 0), (DX, 0), (-DX, 0), (2.5 * DX, 2), (-2.5 * DX, 2)])
def test_the_grid_reaches_down_to_the_board(bow: float, cells: int) -> None:
    """One cell of bow has room anyway; a grid for more is that much deeper."""
    assert lay_out(beam(bow)).nodes[2] == lay_out(beam(0.0)).nodes[2] + cells


@pytest.mark.parametrize("bow", [np.nan, 0.2])
def test_a_bow_is_a_length(bow: float) -> None:
    """Anything that no food has is refused."""
    with pytest.raises(SceneError, match="board: bow"):
        beam(bow)


def test_a_straight_food_has_no_bow_in_its_document() -> None:
    """So that documents and keys of straight foods are those of before."""
    assert "bow" not in beam(0.0).as_dict()["board"] and beam(BOW).as_dict()["board"]["bow"] == BOW
