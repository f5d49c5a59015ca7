"""A scene is simulated: its state is begun, advanced by the orders of its motion, and read out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mpm.output.record import ForceRecord
from mpm.output.snapshot import Snapshot, SnapshotRecorder, snapshot
from mpm.output.topology import Topology, topology
from mpm.run import CutRun, Progress
from mpm.runtime import Runtime, start
from mpm.scene import Scene
from mpm.scene.errors import SimulationError
from mpm.scene.material import Material
from mpm.setup.parameters import pose
from mpm.setup.setup import Setup
from mpm.setup.stone import half_of_stone
from mpm.state import host_transfer
from mpm.state.state import Configuration, State
from mpm.state.tables import EPS0, EPSF, STONE_MET, STONE_MIDDLE, STONE_TURN
from mpm.step.time_step import advance

KEPT = 3  # states that a process keeps: of the default cells, of coarse ones and of one scene more
_kept: dict[tuple[int, Configuration], State] = {}


class Simulation:
    """A scene made ready to run; candidates of its material run without recompiling.

    Args:
        scene: What to simulate; what is kept of it has the resistances of its real speed.
        runtime: Device.
        alone: Have fields of its own; without them it runs in a batch (:mod:`mpm.batch`).

    Attributes:
        setup: Particles, grid and tables of the scene.
        state: The fields.
        place: Which of the cuts side by side in the fields it is.

    Raises:
        SceneError: The device is missing or the scene does not fit into memory.
    """

    def __init__(self, scene: Scene, runtime: Runtime | None = None, *, alone: bool = True) -> None:
        scene = scene.at_its_speed
        self.setup = Setup(scene, runtime or Runtime())
        self.serial = start(self.setup.runtime, scene.numerics.precision)
        configuration = self.setup.configuration(self.setup.threads())
        self.state: Any = state_of(configuration, self.serial) if alone else None
        self.place, self._loaded = 0, scene.food.material

    @property
    def scene(self) -> Scene:
        """What is simulated."""
        return self.setup.scene

    def load(self, material: Material) -> None:
        """Write seeds and constants into the fields; what depends on the real speed is that of the scene's."""
        material = material.at_speed(self.scene.motion.speed) if material.rate_exponent != 0 else material
        self.state.owner, self._loaded = self, material
        host_transfer.begin(self.state, [self.setup.contents(material)])

    def set_pose(self, z: float, along: float = 0.0, tilt: float = 0.0) -> None:
        """Put the tool somewhere, at rest.

        Args:
            z: Height of the middle of the edge above the board [m].
            along: Place of the middle of the edge along the cut [m].
            tilt: Angle of the edge to the board [rad].
        """
        host_transfer.set_pose(self.state, pose(z, along, tilt))

    def run(
        self,
        material: Material | None = None,
        progress: Progress | None = None,
        *,
        sections: int = 0,
        snapshots: SnapshotRecorder | None = None,
    ) -> ForceRecord:
        """Simulate the cut.

        Args:
            material: Other constants than the scene's; the kernels are not recompiled.
            progress: Called after each output interval with (part of the stroke done, knife force [N]).
            sections: How often to keep the food across the blade's middle, at even parts of the run and at its end.
            snapshots: Keeps the particles at even parts of the run.

        Returns:
            The record. A run that breaks down returns what it had, with its reason in ``status``.
        """
        serial = start(self.setup.runtime, self.scene.numerics.precision)
        if serial != self.serial:  # another simulation has started Taichi anew: the fields are gone
            self.serial = serial
            self.state = state_of(self.setup.configuration(self.setup.threads()), serial)
        scene = self.scene if material is None else self.scene.with_material(**vars(material)).at_its_speed
        self.load(scene.food.material)
        run = CutRun(self.setup, scene, progress, sections, snapshots)
        while (order := run.order()) is not None:
            run.take(self.advance(order), self.snapshot)
        return run.record(self.topology)

    def advance(self, order: Sequence[float]) -> np.ndarray:
        """Some time steps, as an :class:`mpm.run.Order` says; rows of the report, shape (n, N_REPORT)."""
        if self.state.owner is not self:
            raise RuntimeError("another simulation has taken over these fields; load this one again before it goes on")
        out: np.ndarray = advance(self.state, [order])[0]
        return out

    def snapshot(self, time: float, stroke: float, slide: float) -> Snapshot:
        """The particles now, in the scene's axes.

        Args:
            time: Simulated time [s].
            stroke: Way of the edge below the food's top [m].
            slide: Way of the blade along its edge [m].

        Returns:
            What there is to see.
        """
        now = host_transfer.particles(self.state, self.place)
        if self._loaded.graded:  # what is kept is the stress of so much of the flesh
            now = replace(now, tau=now.tau * self.setup.layer_weights(self._loaded)[:, None])
        return snapshot(time, stroke, slide, now, self.setup.to_scene_axes(now.x))

    def topology(self) -> Topology:
        """Pieces of the food now."""
        mirrors, now = self.scene.mirrors, host_transfer.particles(self.state, self.place)
        half = np.where(now.side > 0, now.side - 1, 0 if mirrors[1] else self.setup.to_scene_axes(now.x)[:, 1] >= 0)
        damage = np.zeros(len(now.side))
        if self.state.damage:
            table = self.state.par.to_numpy()[self.place]
            kappa = np.maximum(now.kappa, table[EPS0])
            damage = 1 - table[EPS0] / kappa * np.exp(-(kappa - table[EPS0]) / (table[EPSF] - table[EPS0]))
        stony = self.scene.food.stony(self.setup.seeds.x)
        if stony.any():
            half[stony] = max(half_of_stone(self.scene.food), 0)
        swell = np.linalg.det(now.F)
        found = topology(self.setup.seeds, mirrors, half.astype(int), now.side > 0, swell, damage, stony)
        return found if self.scene.food.stone is None else replace(found, **self._stone())

    def _stone(self) -> dict[str, Any]:
        """Where the stone is now, and where the edge met it."""
        table = self.state.stone_pose.to_numpy()[self.place]
        met = float(table[STONE_MET])
        return {
            "stone": tuple(float(x) for x in table[STONE_MIDDLE:STONE_TURN]),
            "stone_met": met if met >= 0 else None,
        }


def state_of(configuration: Configuration, serial: int) -> State:
    """Fields of a configuration in a runtime.

    Those that are kept from before are used again, so the fields are those of the simulation that ran last; every run
    loads them anew.
    """
    kept = _kept.pop((serial, configuration), None) or State(configuration)
    _kept[serial, configuration] = kept  # the latest is the last
    while len(_kept) > KEPT:
        del _kept[next(iter(_kept))]
    return kept


def simulate(scene: Scene, *, runtime: Runtime | None = None, progress: Progress | None = None) -> ForceRecord:
    """Run one cut and insist on its end.

    Args:
        scene: What to simulate.
        runtime: Device.
        progress: Called after each output interval with (part of the stroke done, knife force [N]).

    Returns:
        The record of the whole cut.

    Raises:
        SimulationError: The run broke down; the message names reason and stroke.
    """
    record = Simulation(scene, runtime).run(progress=progress)
    if record.status != "done":
        raise SimulationError(
            f"the simulation stopped at {record.fraction:.0%} of the stroke: {record.status}",
            reason=record.status,
            fraction=record.fraction,
        )
    return record
