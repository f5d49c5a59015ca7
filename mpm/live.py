"""A cut whose blade is moved from outside, a little at a time: the food's side of a robot simulator."""

from __future__ import annotations

import math
import time as clock

import numpy as np

from mpm.output.record import ForceRecord
from mpm.output.recorder import Recorder
from mpm.output.snapshot import Snapshot
from mpm.output.surface import Surface
from mpm.output.topology import Topology
from mpm.run import Order
from mpm.runtime import Runtime, running
from mpm.scene import STEEPEST, Scene
from mpm.scene.errors import SceneError, SimulationError
from mpm.setup.setup import CLEARANCE
from mpm.solver import Simulation
from mpm.state.host_transfer import of_particles

CLEAR = 2.0  # height of the edge above the uncut food at which nothing touches the blade any more [cells]


class LiveCut:
    """A food under a blade whose place is given at short intervals, in between which it moves evenly.

    Real time passes as much faster in it as the scene's blade is faster than the real one (``time_scale``), and a
    motion faster than the scene's takes more steps, so that the food never sees a higher Mach number. Until the edge
    comes near, and once it is clear of the food again, nothing is simulated.

    Another simulation of about this size takes over its fields: one is followed to its end before the next is made.

    Args:
        scene: The cut. Its motion says how fast the blade usually is (``speed`` [m/s]) and as what that is simulated
            (``mach``); a ``slice_ratio`` other than 0 that it may also be drawn along its edge and tilted. The stroke
            is not used. The arm is rigid: what holds the blade is outside.
        runtime: Device.

    Attributes:
        status: ``done`` as long as the food is sound, else why it is not.
        time: Real time that was simulated [s].
        impulse: Impulse of the food on the blade, in real time [N s], shape (3,).
        moment: Of the food on the blade about the middle of its edge, which raises the end at +x [N m]: the mean of the
            last move; 0 where the blade is neither drawn nor tilted.

    Raises:
        SceneError: A scene without a blade or a real speed, or with an arm of its own.
    """

    def __init__(self, scene: Scene, runtime: Runtime | None = None) -> None:
        if not scene.cuts:
            raise SceneError("live cut: the scene has a press; give a knife")
        if scene.motion.speed is None:
            raise SceneError("live cut: the motion has no real speed; give the one at which the blade usually moves")
        if not scene.arm.rigid:
            raise SceneError("live cut: the blade is held from outside; leave the scene's arm rigid")
        self._simulation = Simulation(scene, runtime or Runtime(threads=1))
        self.scene = scene = self._simulation.scene
        self._simulation.load(scene.food.material)
        self._dt = self._simulation.setup.time_step(scene.food.material)
        self._top = scene.food.shape.height + CLEARANCE * scene.numerics.dx
        self._z, self._s, self._tilt, self._first = math.inf, 0.0, 0.0, 0.0
        self._recorder, self._wall = Recorder(self._simulation.setup, scene.food.material), 0.0
        self._surface: Surface | None = None
        self.status, self.time, self.impulse, self.moment = "done", 0.0, np.zeros(3), 0.0

    @property
    def _held(self) -> Simulation:
        """The simulation, as long as its fields are this cut's."""
        simulation = self._simulation
        if simulation.serial != running() or simulation.state.owner is not simulation:
            raise RuntimeError(
                "another simulation has taken over the fields of this live cut: follow one to its end before the next "
                "is made"
            )
        return simulation

    @property
    def begun(self) -> bool:
        """Whether the edge has come near the food."""
        return bool(self._recorder.intervals)

    @property
    def weight(self) -> float:
        """Weight of the food [N]."""
        setup, gravity = self._simulation.setup, self.scene.numerics.gravity
        return self.scene.food.material.rho * setup.seeds.total * setup.grid.images * gravity

    @property
    def uncut(self) -> float:
        """Part of the section's flesh that the edge has not passed [-]."""
        seeds, state = self._simulation.setup.seeds, self._held.state
        beside = seeds.beside & ~self.scene.food.stony(seeds.x)
        return float((beside & (of_particles(state, state.side) == 0)).sum() / beside.sum())

    @property
    def height(self) -> float:
        """Height of the middle of the edge above the board [m], at most where the cut begins."""
        return min(self._z, self._top + self._lowered(self._s, self._tilt))

    def move(self, height: float, slide: float, span: float, tilt: float = 0.0) -> np.ndarray:
        """Move the edge.

        Args:
            height: Of its middle above the board at the end [m]; the board stops it where its lowest end over the food
                is at 0.
            slide: Way along the edge since the beginning, at the end [m].
            span: Real time that passes [s].
            tilt: Angle of the edge to the board at the end, positive when the end at +x is higher [rad].

        Returns:
            Mean force of the food on the blade: along the edge, across the blade, upwards [N], shape (3,).

        Raises:
            SceneError: A draw along the edge or a tilt in a scene that has none, a tilt beyond
                :data:`mpm.scene.STEEPEST`, or numbers that are not finite.
            SimulationError: The food broke down now or before.
        """
        if self.status != "done":
            raise SimulationError(f"the live cut has stopped: {self.status}", reason=self.status, fraction=0.0)
        if not (all(map(math.isfinite, (height, slide, tilt, span))) and span > 0):
            raise SceneError(
                f"live cut: a move to {height:g} m, {slide:g} m and {tilt:g} rad in {span:g} s; give finite numbers"
            )
        if abs(tilt) > STEEPEST:
            raise SceneError(f"live cut: a tilt of {tilt:g} rad; give one within {STEEPEST:g} rad of the board")
        self.moment = 0.0
        low = height - self._lowered(slide, tilt)
        if not self.begun:
            if low >= self._top:
                self._z, self._s, self._tilt = height, slide, tilt
                return np.zeros(3)
            self._first = self._s
            self._z = self._top + self._lowered(self._s, self._tilt)
            self._place()
        clear = self.scene.food.shape.height + CLEAR * self.scene.numerics.dx
        if low > clear and self._z - self._lowered(self._s, self._tilt) > clear:
            self._z, self._s, self._tilt = height, slide, tilt
            self._place()
            return np.zeros(3)
        return self._follow(height + max(-low, 0.0), slide, tilt, span)

    def _lowered(self, slide: float, tilt: float) -> float:
        """How much lower than its middle the edge gets over the food [m]."""
        return self.scene.lowered(tilt, slide - self._first if self.begun else 0.0)

    def _follow(self, height: float, slide: float, tilt: float, span: float) -> np.ndarray:
        """Move the edge near the food."""
        down, along, turn = height - self._z, slide - self._s, tilt - self._tilt
        if (along != 0 or tilt != 0 or turn != 0) and self.scene.mirrors[0]:
            raise SceneError(
                "live cut: the blade is drawn along its edge or tilted; give the motion a slice_ratio other than 0"
            )
        material, motion, shape = self.scene.food.material, self.scene.motion, self.scene.food.shape
        most = motion.mach * material.p_wave * self._dt  # way in a step
        far = math.hypot(shape.width / 2, shape.height)
        way = math.hypot(down, along) + abs(turn) * far  # of the blade's fastest point in the food
        steps = max(math.ceil(span / self.scene.time_scale / self._dt - 1e-9), math.ceil(way / most - 1e-9))
        sim = steps * self._dt
        began = clock.perf_counter()
        order = Order(steps, steps, self._dt, down / sim, along / sim, turn / sim)
        self._recorder.book(self._simulation.advance(order)[0], steps, self._dt)
        self._wall += clock.perf_counter() - began
        self._z, self._s, self._tilt, self.time = height, slide, tilt, self.time + span
        self.moment, self.status = self._recorder.moment, self._recorder.status
        if self.status != "done":
            raise SimulationError(
                f"the live cut stopped with the edge at {1e3 * height:.1f} mm: {self.status}",
                reason=self.status,
                fraction=0.0,
            )
        force = self._recorder.force
        self.impulse = self.impulse + span * force
        return force

    def _place(self) -> None:
        """Put the blade where it is, clear of the food."""
        self._simulation.set_pose(self._z, self._s - self._first, self._tilt)

    def pieces(self) -> Topology:
        """Connected pieces of the food now."""
        return self._held.topology()

    def snapshot(self) -> Snapshot:
        """The particles now, in the scene's axes."""
        return self._held.snapshot(self._recorder.time, self.scene.food.shape.height - self._z, self._s)

    def surface(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The food's surface now: vertices [m] (m, 3) in the scene's axes, triangles (t, 3), and whether each vertex is
        flesh (m,): of the face of the cut."""
        own = self._drawn
        return own.points(self.snapshot()), own.triangles, own.face

    @property
    def rest(self) -> np.ndarray:
        """Vertices of :meth:`surface` before the cut [m], shape (m, 3)."""
        return self._drawn.rest

    @property
    def _drawn(self) -> Surface:
        """What is drawn of the food; made when it is first asked for."""
        if self._surface is None:
            self._surface = Surface(self.scene.food.shape, self._simulation.setup.seeds, self.scene.mirrors)
        return self._surface

    def record(self) -> ForceRecord:
        """The cut so far, a row for each move that was simulated.

        Raises:
            SimulationError: The edge has not come near the food yet.
        """
        if not self.begun:
            raise SimulationError(
                "the live cut has not begun: the edge never came down", reason="no_contact", fraction=0.0
            )
        held = self._held  # the pieces are read from its fields
        fraction = min(
            max(interval.stroke for interval in self._recorder.intervals) / self.scene.food.shape.height, 1.0
        )
        pieces = held.topology() if self.status == "done" else None
        return self._recorder.record(pieces, dt=self._dt, fraction=max(fraction, 0.0), wall=self._wall)
