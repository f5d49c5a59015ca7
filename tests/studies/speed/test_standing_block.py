"""The block that other codes are compared on: its force in closed form, and the solver's."""

from __future__ import annotations

import numpy as np
import pytest

from mpm.runtime import Runtime
from mpm.scene import Numerics
from mpm.scene.shapes import Shape
from studies.speed.standing_block import GRAVITY, WINDOW, StandingBlock, stand

BLOCK = StandingBlock((0.01, 0.01, 0.04), 2e-3, 2, 4 * 0.04 / 1e3**0.5 / (20.001 * WINDOW))
"""With twenty windows in a period."""


def swings(block: StandingBlock, terms: int = 4000) -> list[float]:
    """Mean velocities at the ends of the windows, as a sum over the modes of a bar that is held at one end [m/s]."""
    wave = np.sqrt(1e6 / 1000.0)
    n = np.arange(terms) + 0.5
    at = WINDOW * block.dt * (1 + np.arange(block.windows))
    k = n * np.pi / block.size[2]
    part = 2 / (k * block.size[2]) ** 2  # of a uniform load in a mode, squared
    return list(-GRAVITY * (part / (k * wave) * np.sin(np.outer(at, k * wave))).sum(axis=1))


def test_a_bar_that_its_weight_is_put_on_has_no_error() -> None:
    """The closed form is that of the sum over its modes; one that stands on a floor a cell lower, and falls first,
    is wrong by as much as it comes late.
    """
    velocity = swings(BLOCK)
    assert BLOCK.force_error(velocity) < 1e-4
    late = [-GRAVITY * WINDOW * BLOCK.dt, *(v - GRAVITY * WINDOW * BLOCK.dt for v in velocity[:-1])]
    assert 0.02 < BLOCK.force_error(late) < 0.2


def test_no_floor_and_no_weight_are_errors() -> None:
    """A block that falls, and one that stays where it is from the beginning."""
    fallen = [-GRAVITY * WINDOW * BLOCK.dt * (n + 1) for n in range(BLOCK.windows)]
    assert BLOCK.force_error(fallen) == pytest.approx(3**-0.5, rel=0.01)
    assert BLOCK.force_error([0.0] * BLOCK.windows) == pytest.approx(12**-0.5, rel=0.01)


def test_the_solver_stands_on_the_board() -> None:
    """A thin block of 20 cells is within a few per cent, in either precision, and half the cell halves the error."""
    shape, runtime = Shape("block", 8e-3, 8e-3, 0.04), Runtime(threads=1)
    error = {}
    for dx, precision in ((2e-3, "f64"), (2e-3, "f32"), (1e-3, "f64")):
        numerics = Numerics(dx=dx, mirror=False, gravity=GRAVITY, precision=precision)
        block, found = stand(shape, numerics, runtime)
        assert found.particles == np.prod(block.task("cpu")["counts"]) and found.rate > 0
        error[dx, precision] = found.force_error
    assert error[2e-3, "f64"] < 0.02 and error[2e-3, "f32"] == pytest.approx(error[2e-3, "f64"], rel=0.05)
    assert error[1e-3, "f64"] < 0.6 * error[2e-3, "f64"]
