"""The time loop: what is active, dt, the tool's motion, impulses to forces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mpm.arm import arm_mass
from mpm.discretisation.capacity import batch_capacity, node_capacity, particle_capacity
from mpm.discretisation.grid import lay_out
from mpm.discretisation.particles import seed
from mpm.errors import SimulationError
from mpm.kernels import fields as kn
from mpm.kernels.host_transfer import BULK, FOOT, GAP, N_PARTICLE, N_SLICE, PLACE, SHELL, SOFTEN, TACKY, Contents
from mpm.kernels.kernels import Kernels
from mpm.kernels.surface_contact import CONTACT
from mpm.material import Material
from mpm.motion import Course, Order, Progress
from mpm.output.record import ForceRecord
from mpm.output.snapshot import Snapshot, Watch, snapshot
from mpm.output.topology import Topology, topology
from mpm.runtime import Runtime, start
from mpm.scene import BAND_CELLS, Press, Scene
from mpm.shapes import skin_path
from mpm.shapes import slices as outline

# Particles for which another thread pays.  On two cores the second thread gains nothing for 8,000 particles, 10 to 25 % for
# 38,000 and 20 to 90 % for 128,000, by the machine; processes share the cores better, which is how a calibration uses them.
WORTH_A_THREAD = 20_000
APPROACH = 0.1  # way of the blade above the food before contact, in cells
EDGE_STEP = 0.5  # dt times the frequency of the edge's cohesive spring, 2 is unstable
# Least stiffness of the contact's spring over that of the layer of particles it holds, for which Nitsche's method is stable:
# at 1.4 a food of nu = 0 at rest keeps its energy, at 1.0 it gains. Only foods of nu < 0.2 ask for a shorter step than waves do.
COERCIVE = 1.5
TACK_STEP = 0.5  # the same for the rising part of the adhesive traction
ENDLESS = 1e3  # thickness of a wedge that never becomes a plate with parallel faces [m]
KEPT = 3  # kernels that a process keeps: of the default cells, of coarse ones and of one scene more
_kept: dict[tuple[int, tuple[Any, ...]], Kernels] = {}


class Simulation:
    """A scene made ready to run; candidates of its material run without recompiling.

    Args:
        scene: What to simulate.
        runtime: Device.
        alone: Have fields of its own; without them it runs in a batch (:mod:`mpm.batch`).

    Raises:
        SceneError: The device is missing or the scene does not fit into memory.
    """

    def __init__(self, scene: Scene, runtime: Runtime | None = None, *, alone: bool = True) -> None:
        self.scene = scene
        self.runtime = runtime or Runtime()
        self.seeds = seed(scene)
        grid = lay_out(scene)
        self.nodes, self.origin, self.images, self.stations = grid.nodes, grid.origin, grid.images, grid.stations
        self.serial = start(self.runtime, scene.numerics.precision)
        self.k: Any = kernels(self.kind(self.threads()), self.serial) if alone else None
        self.place = 0  # among the cuts of the fields

    def threads(self) -> int:
        """CPU threads that pay for a scene of this size, 0 on a GPU."""
        if self.runtime.arch != "cpu":
            return 0
        return min(self.runtime.cpu_threads, 1 + len(self.seeds.x) // WORTH_A_THREAD)

    def kind(self, threads: int, batch: int = 1) -> tuple[Any, ...]:
        """What :class:`Kernels` must be for so many CPU threads, 0 for a GPU, and cuts side by side: alike for scenes of about this size."""
        scene = self.scene
        return (
            particle_capacity(len(self.seeds.x)),
            tuple(node_capacity(n) for n in self.nodes),
            scene.mirrors,
            node_capacity(len(self.stations)),
            threads,
            scene.numerics.contact == "nodal",
            not scene.cuts,
            scene.food.material.tensile_strength is not None,
            scene.numerics.grid_turn != 0,
            len(scene.food.material.prony),
            batch_capacity(batch),
        )

    def turned(self, vectors: np.ndarray, sign: float = 1.0) -> np.ndarray:
        """Vectors (n, 3) of the scene's axes in the grid's, or back with ``sign`` -1."""
        angle = sign * self.scene.numerics.grid_turn
        c, s = math.cos(angle), math.sin(angle)
        return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def _retardation(self, material: Material) -> float:
        """Kelvin-Voigt retardation time that gives the loss factor at the first axial mode c/(4 height) [s]."""
        return material.loss_factor * 4 * self.scene.food.shape.height / (2 * math.pi * material.p_wave)

    def time_step(self, material: Material) -> float:
        """Largest sound step: elastic limit of a lone particle, and of the edge's spring [s]."""
        num, edge = self.scene.numerics, self.scene.edge
        speed = self.scene.motion.mach * material.p_wave
        omega = 2 * (material.stability_speed + speed) / num.dx  # highest frequency of a lone particle
        zeta = self._retardation(material) * omega / 2
        dt = num.safety * 2 / omega * (math.sqrt(1 + zeta * zeta) - zeta)
        if num.contact == "cohesive":
            layer = min(self.seeds.spacing, num.dx / 2)
            dt = min(dt, math.sqrt(CONTACT / COERCIVE) * layer / material.p_wave)
        if num.contact == "cohesive" and self.scene.cuts:
            spring = math.sqrt(max(material.start, 1e-12) / (edge.slip * material.rho * edge.zone**2))
            dt = min(dt, EDGE_STEP / spring)
            if material.adhesion > 0:
                pull = material.adhesion / (material.rho * self.seeds.spacing)  # acceleration at full strength
                dt = min(dt, TACK_STEP * math.sqrt(0.1 * 2 * material.adhesion_energy / material.adhesion / pull))
        return dt

    def _load(self, material: Material) -> None:
        """Write seeds and constants into the fields."""
        self.k.user = self
        self.k.begin([self.contents(material)])

    def contents(self, material: Material) -> Contents:
        """What the fields begin with."""
        scene, seeds, xs = self.scene, self.seeds, self.stations
        gap, outer = (seeds.gap, seeds.beside) if scene.cuts else (seeds.head, seeds.top)
        path = skin_path(scene.food.shape, xs, material.skin_thickness) if material.skin_thickness > 0 else 0 * xs
        particles, slices = np.empty((len(seeds.x), N_PARTICLE)), np.empty((len(xs), N_SLICE))
        particles[:, PLACE:FOOT] = self.turned(seeds.x)
        particles[:, FOOT], particles[:, GAP], particles[:, BULK] = seeds.foot, gap, seeds.bulk
        particles[:, SHELL], particles[:, SHELL + 1] = (
            seeds.areas * seeds.foot * seeds.bottom,
            seeds.areas * gap * outer,
        )
        particles[:, TACKY] = np.where(seeds.beside & (material.adhesion > 0), 0, -1)
        slices[:, :SOFTEN] = np.transpose(outline(scene.food.shape, xs, scene.numerics.dx))
        slices[:, SOFTEN] = scene.edge.slip + path
        return Contents(
            nodes=self.nodes,
            plane=round(-self.origin[1] / scene.numerics.dx),
            between=scene.mirrored_between,
            particles=particles,
            slices=slices,
            parameters=self.constants(material),
            pose=pose(scene.food.shape.height + self.gap, 0.0, scene.motion.tilt),
            relaxation=self.relaxation(material),
        )

    def constants(self, material: Material) -> np.ndarray:
        """The table of parameters, shape (N_PARAMETERS,)."""
        scene, num, edge = self.scene, self.scene.numerics, self.scene.edge
        table = np.zeros(kn.N_PARAMETERS)
        table[kn.DX], table[kn.INV], table[kn.FIRST] = num.dx, 1 / num.dx, self.stations[0]
        table[kn.OX], table[kn.OY], table[kn.OZ] = self.origin
        table[kn.MU], table[kn.LAM] = material.shear, material.lame
        table[kn.YIELD] = min(material.yield_stress, 1e30)
        table[kn.MASS], table[kn.VOL] = material.rho * self.seeds.volume, self.seeds.volume
        table[kn.FRICTION], table[kn.BOARD_MU] = material.mu, scene.board.mu
        table[kn.R_FLESH], table[kn.R_START], table[kn.DEPTH] = material.R, material.start, material.initiation_depth
        table[kn.SLIP], table[kn.ZONE] = edge.slip, edge.zone
        table[kn.FULL] = material.rho * num.dx * edge.zone**2
        if material.tensile_strength is not None and material.fracture_energy is not None:
            eps0 = material.tensile_strength / material.E
            band = BAND_CELLS * num.dx
            table[kn.EPS0] = eps0
            table[kn.EPSF] = eps0 / 2 + material.fracture_energy / (material.tensile_strength * band)
        tool = scene.knife
        if isinstance(tool, Press):
            half, table[kn.FRICTION], table[kn.SPINE] = tool.half_angle, tool.mu, ENDLESS
        else:
            half, table[kn.SPINE], table[kn.RADIUS] = tool.angle / 2, tool.spine, tool.radius
            table[kn.BLADE], table[kn.HALF_LENGTH] = tool.height, tool.length / 2
        table[kn.COS], table[kn.SIN] = math.cos(half), math.sin(half)
        table[kn.YAW_COS], table[kn.YAW_SIN] = math.cos(num.grid_turn), math.sin(num.grid_turn)
        table[kn.GRAVITY] = num.gravity
        beta = self._retardation(material)
        table[kn.ETA_S], table[kn.ETA_B] = beta * material.shear, beta * (material.lame + 2 / 3 * material.shear)
        table[kn.TACK], table[kn.TACK_GAP] = material.adhesion / (material.rho * self.seeds.spacing), 1.0
        if material.adhesion > 0:
            table[kn.TACK_GAP] = 2 * material.adhesion_energy / material.adhesion
        if scene.arm.stiffness is not None:
            table[kn.ARM_K], table[kn.ARM_LIMIT] = scene.arm.stiffness, scene.arm.force_limit or 1e30
            table[kn.ARM_MASS] = arm_mass(scene, material, scene.arm.stiffness)
            table[kn.ARM_C] = 2 * math.sqrt(scene.arm.stiffness * table[kn.ARM_MASS])
        return table

    def relaxation(self, material: Material) -> np.ndarray:
        """Share of each Prony branch, and time step over its time, shape (2, branches)."""
        step = self.time_step(material) * self.scene.time_scale
        return np.array([[share, step / time] for share, time in material.prony]).reshape(-1, 2).T

    def _set_pose(self, z: float, s: float = 0.0, tilt: float = 0.0) -> None:
        """Put the middle of the edge at a height and a place along the cut [m], at an angle to the board [rad], at rest."""
        self.k.set_pose(pose(z, s, tilt))

    @property
    def gap(self) -> float:
        """Way of the edge's middle above the food before contact [m]."""
        return APPROACH * self.scene.numerics.dx + self.scene.drop

    def run(
        self,
        material: Material | None = None,
        progress: Progress | None = None,
        *,
        sections: int = 0,
        watch: Watch | None = None,
    ) -> ForceRecord:
        """Simulate the cut.

        Args:
            material: Other constants than the scene's; the kernels are not recompiled.
            progress: Called after each output interval with (part of the stroke done, knife force [N]).
            sections: How often to keep the food across the blade's middle, at even parts of the run and at its end.
            watch: Who else looks at it.

        Returns:
            The record. A run that breaks down returns what it had, with its reason in ``status``.
        """
        serial = start(self.runtime, self.scene.numerics.precision)
        if serial != self.serial:  # another simulation has started Taichi anew: the fields are gone
            self.serial = serial
            self.k = kernels(self.kind(self.threads()), serial)
        scene = self.scene if material is None else self.scene.with_material(**vars(material))
        self._load(scene.food.material)
        course = Course(self, scene, progress, sections, watch)
        while (order := course.order()) is not None:
            course.take(self.advance(order))
        return course.record()

    def advance(self, order: Order) -> np.ndarray:
        """Some time steps; rows of the report (n, N_REPORT)."""
        if self.k.user is not self:
            raise RuntimeError("another simulation has taken over these fields; load this one again before it goes on")
        return self.k.go([order])[0]

    def look(self, time: float, stroke: float, slide: float) -> Snapshot:
        """The particles now, in the scene's axes, at a simulated time [s], a stroke and a way along the blade [m]."""
        now = self.k.particles(self.place)
        return snapshot(time, stroke, slide, now, self.turned(now.x, -1.0))

    def topology(self) -> Topology:
        """Pieces of the food now."""
        mirrors, now = self.scene.mirrors, self.k.particles(self.place)
        half = np.where(now.side > 0, now.side - 1, 0 if mirrors[1] else self.turned(now.x, -1.0)[:, 1] >= 0)
        damage = np.zeros(len(now.side))
        if self.k.damage:
            table = self.k.par.to_numpy()[self.place]
            kappa = np.maximum(now.kappa, table[kn.EPS0])
            damage = 1 - table[kn.EPS0] / kappa * np.exp(-(kappa - table[kn.EPS0]) / (table[kn.EPSF] - table[kn.EPS0]))
        return topology(self.seeds, mirrors, half.astype(int), now.side > 0, np.linalg.det(now.F), damage)


def pose(z: float, s: float = 0.0, tilt: float = 0.0) -> np.ndarray:
    """The table of the tool's pose with the middle of the edge at a height and a place along the cut [m], at an angle to the board [rad]."""
    out = np.zeros(kn.N_POSE)
    out[kn.Z] = out[kn.COMMAND] = z
    out[kn.S], out[kn.TILT] = s, tilt
    out[kn.TILT_COS], out[kn.TILT_SIN] = math.cos(tilt), math.sin(tilt)
    return out


def kernels(kind: tuple[Any, ...], serial: int) -> Kernels:
    """Fields and kernels of a kind in a runtime.

    Those that are kept from before are used again, so the fields are those of the simulation that ran last; every run loads them anew.
    """
    kept = _kept.pop((serial, kind), None) or Kernels(*kind)
    _kept[serial, kind] = kept  # the latest is the last
    while len(_kept) > KEPT:
        del _kept[next(iter(_kept))]
    return kept


def simulate(scene: Scene, *, runtime: Runtime | None = None, progress: Progress | None = None) -> ForceRecord:
    """Run one cut and insist on its end.

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
