"""A food that no tool touches: motions with closed forms, which verify the solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mpm.output.health import health
from mpm.run import Order
from mpm.runtime import Runtime
from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.scene.errors import SimulationError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from mpm.state.host_transfer import fill, of_particles, set_velocity_gradients, velocity_gradients
from mpm.state.tables import BOARD, ELASTIC, FRICTION_WORK, KINETIC, N_PARTICLE_SUMS, parts_of_report

OUT_OF_REACH = 1.0  # distance of what must not touch [m]

Places = Callable[[np.ndarray], np.ndarray]


class FreeBody:
    """Particles with velocities of their own, free or above the board.

    Another simulation of about this size takes over its fields: one is followed to its end before the next is made.

    Args:
        shape: Outline.
        material: Its constants.
        numerics: Grid. ``room`` is all the space beside the body, above it are three cells.
        place: Moves the particles before the start, (n, 3) to (n, 3) [m]; they keep to the grid around ``shape``.
        velocity: Velocities [m/s], shape (n, 3), of places (n, 3); at rest without it.
        slope: Velocity gradients [1/s], shape (n, 3, 3), of places; 0 without it.
        board: Friction on the board [-]; without it there is no board.
        lift: Height above the board [m], at most 1.5 cells.
        runtime: Device.

    Attributes:
        start: Places at the beginning [m], shape (n, 3).
        dt: Time step [s].
        time: Time since the beginning [s].
        mass: Mass of a particle [kg].
        impulse: Impulse on the board so far [N s], shape (3,).
        friction: Energy that friction has taken so far [J].
    """

    def __init__(
        self,
        shape: Shape,
        material: Material,
        numerics: Numerics,
        *,
        place: Places | None = None,
        velocity: Places | None = None,
        slope: Places | None = None,
        board: float | None = None,
        lift: float = 0.0,
        runtime: Runtime | None = None,
    ) -> None:
        scene = Scene(Food(shape, material), Press(), Motion(shape.height), Board(board or 0.0), numerics=numerics)
        self._simulation = Simulation(scene, runtime or Runtime(threads=1))
        self._state: Any = self._simulation.state
        self._simulation.load(material)
        self._simulation.set_pose(OUT_OF_REACH)
        if board is None:
            self._state.board_gap.fill(-OUT_OF_REACH)
        seeds = of_particles(self._state, self._state.x)
        self.start = (place(seeds) if place else seeds) + [0.0, 0.0, lift]
        fill(self._state, self._state.x, self.start)
        if velocity is not None:
            fill(self._state, self._state.v, velocity(self.start).astype(self.start.dtype))
        if slope is not None:
            set_velocity_gradients(self._state, slope(self.start))
        self.dt, self.time = self._simulation.setup.time_step(material), 0.0
        self.mass = material.rho * self._simulation.setup.seeds.volume
        self.impulse, self.friction = np.zeros(3), 0.0
        self._sums = np.zeros(N_PARTICLE_SUMS)

    @property
    def x(self) -> np.ndarray:
        """Places [m], shape (n, 3)."""
        return of_particles(self._state, self._state.x)

    @property
    def v(self) -> np.ndarray:
        """Velocities [m/s], shape (n, 3)."""
        return of_particles(self._state, self._state.v)

    @property
    def gradient(self) -> np.ndarray:
        """Velocity gradients [1/s], shape (n, 3, 3)."""
        return velocity_gradients(self._state)

    @property
    def kinetic(self) -> float:
        """Kinetic energy at the end of the last step [J]."""
        return float(self._sums[KINETIC])

    @property
    def elastic(self) -> float:
        """Elastic energy at the end of the last step [J]."""
        return float(self._sums[ELASTIC])

    def spin(self) -> np.ndarray:
        """Angular momentum about the origin, that of the affine velocities included [kg m^2/s], shape (3,)."""
        c, d2 = self.gradient, self._simulation.scene.numerics.dx**2 / 4
        inner = d2 * np.stack([c[:, 2, 1] - c[:, 1, 2], c[:, 0, 2] - c[:, 2, 0], c[:, 1, 0] - c[:, 0, 1]], axis=1)
        return self.mass * (np.cross(self.x, self.v) + inner).sum(axis=0)

    def kick(self, velocity: np.ndarray) -> None:
        """Add a velocity to all particles [m/s], shape (3,)."""
        fill(self._state, self._state.v, self.v + velocity)

    def step(
        self, count: int = 1, *, dt: float | None = None, pull: Callable[[float], np.ndarray] | None = None
    ) -> None:
        """Advance some time steps.

        Args:
            count: Number of steps.
            dt: Time step [s]; the largest sound one without it.
            pull: Acceleration of each particle by a body force [m/s^2], shape (n, 3), at a time [s].

        Raises:
            SimulationError: The body left the grid, was inverted, or is no longer finite.
        """
        span = dt or self.dt
        for _ in range(count if pull else 1):
            if pull:
                fill(self._state, self._state.v, self.v + span * pull(self.time))
            n = 1 if pull else count
            row = self._simulation.advance(Order(n, n, span, 0.0, 0.0))[0]
            sums, self._sums, _ = parts_of_report(row)
            self.time += n * span
            self.impulse += sums[BOARD : BOARD + 3]
            self.friction += float(sums[FRICTION_WORK])
            reason = health(sums, self._sums)
            if reason != "done":
                raise SimulationError(
                    f"the free body stopped at {self.time:.3g} s: {reason}", reason=reason, fraction=0.0
                )
