"""The time loop: what is active, dt, the tool's motion, impulses to forces."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from mpm import fields as kn
from mpm.arm import arm_mass, pressed_home
from mpm.errors import SimulationError
from mpm.health import health
from mpm.kernels import Kernels
from mpm.layout import lay_out
from mpm.material import Material
from mpm.record import ForceRecord
from mpm.runtime import Runtime, start
from mpm.scene import BAND_CELLS, Press, Scene
from mpm.section import Looks
from mpm.seeding import seed
from mpm.shapes import section_area, skin_path, slices
from mpm.topology import topology
from mpm.touch import CONTACT
from mpm.watch import Watch, snapshot

# Particles for which another thread pays.  On two cores the second thread gains nothing for 8,000 particles, 10 to 25 % for
# 38,000 and 20 to 90 % for 128,000, by the machine; processes share the cores better, which is how a calibration uses them.
WORTH_A_THREAD = 20_000
PATIENCE = 0.1  # time after which a run comes back from the device to say how far it is and to be stopped [s]
APPROACH = 0.1  # way of the blade above the food before contact, in cells
EDGE_STEP = 0.5  # dt times the frequency of the edge's cohesive spring, 2 is unstable
# Least stiffness of the contact's spring over that of the layer of particles it holds, for which Nitsche's method is stable:
# at 1.4 a food of nu = 0 at rest keeps its energy, at 1.0 it gains. Only foods of nu < 0.2 ask for a shorter step than waves do.
COERCIVE = 1.5
TACK_STEP = 0.5  # the same for the rising part of the adhesive traction
ENDLESS = 1e3  # thickness of a wedge that never becomes a plate with parallel faces [m]
KEPT = 3  # kernels that a process keeps: of the default cells, of coarse ones and of one scene more
_kept: dict[tuple[int, tuple[Any, ...]], Kernels] = {}

Progress = Callable[[float, float], None]


class Simulation:
    """A scene made ready to run; candidates of its material run without recompiling.

    Args:
        scene: What to simulate.
        runtime: Device.

    Raises:
        SceneError: The device is missing or the scene does not fit into memory.
    """

    def __init__(self, scene: Scene, runtime: Runtime | None = None) -> None:
        self.scene = scene
        self.runtime = runtime or Runtime()
        self.seeds = seed(scene)
        grid = lay_out(scene)
        self.nodes, self.origin, self.images, self.stations = grid.nodes, grid.origin, grid.images, grid.stations
        self.serial = start(self.runtime, scene.numerics.precision)
        self.k: Any = self._kernels(self._threads())

    def _threads(self) -> int:
        """CPU threads that pay for a scene of this size, 0 on a GPU."""
        if self.runtime.arch != "cpu":
            return 0
        return min(self.runtime.cpu_threads, 1 + len(self.seeds.x) // WORTH_A_THREAD)

    def _kernels(self, threads: int) -> Kernels:
        """Fields and kernels of the scene for so many CPU threads, 0 for a GPU, in the runtime of ``serial``.

        Those that a scene of about this size has left are used again, so the fields are those of the simulation that ran last;
        every run loads them anew.
        """
        scene = self.scene
        key = (
            kn.particle_capacity(len(self.seeds.x)),
            tuple(kn.node_capacity(n) for n in self.nodes),
            scene.mirrors,
            kn.node_capacity(len(self.stations)),
            threads,
            scene.numerics.contact == "nodal",
            not scene.cuts,
            scene.food.material.tensile_strength is not None,
            scene.numerics.grid_turn != 0,
            len(scene.food.material.prony),
        )
        kept = _kept.pop((self.serial, key), None) or Kernels(*key)
        _kept[self.serial, key] = kept  # the latest is the last
        while len(_kept) > KEPT:
            del _kept[next(iter(_kept))]
        return kept

    def _turn(self, vectors: np.ndarray, sign: float = 1.0) -> np.ndarray:
        """Vectors (n, 3) of the scene's axes in the grid's, or back with ``sign`` -1."""
        angle = sign * self.scene.numerics.grid_turn
        c, s = math.cos(angle), math.sin(angle)
        return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def _retardation(self, material: Material) -> float:
        """Kelvin-Voigt retardation time that gives the loss factor at the first axial mode c/(4 height) [s]."""
        return material.loss_factor * 4 * self.scene.food.shape.height / (2 * math.pi * material.p_wave)

    def _time_step(self, material: Material) -> float:
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
        k, scene, num, edge = self.k, self.scene, self.scene.numerics, self.scene.edge
        k.user = self
        real = k.real
        middle = round(-self.origin[1] / num.dx)
        k.lay_out(len(self.seeds.x), self.nodes, middle, len(self.stations), scene.mirrored_between)
        k.fill(k.x, self._turn(self.seeds.x).astype(real))
        k.fill(k.foot, self.seeds.foot.astype(real))
        gap, outer = (self.seeds.gap, self.seeds.beside) if scene.cuts else (self.seeds.head, self.seeds.top)
        k.fill(k.gap, gap.astype(real))
        shell = np.stack([self.seeds.foot * self.seeds.bottom, gap * outer], axis=1) * self.seeds.areas[:, None]
        k.fill(k.bulk, self.seeds.bulk.astype(real))
        k.fill(k.shell, shell.astype(real))
        k.reset()
        sticky = self.seeds.beside & (material.adhesion > 0)
        k.fill(k.tacky, np.where(sticky, 0, -1).astype(np.int32))
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
        k.par.from_numpy(table.astype(real))
        for b, (share, time) in enumerate(material.prony):
            k.share_of[b], k.relax[b] = share, self._time_step(material) * scene.time_scale / time
        xs = self.stations
        path = skin_path(scene.food.shape, xs, material.skin_thickness) if material.skin_thickness > 0 else 0 * xs
        for field, values in zip(
            (k.top, k.low, k.width, k.floor_top, k.floor_low), slices(scene.food.shape, xs, num.dx), strict=True
        ):
            k.fill(field, values.astype(real))
        k.fill(k.soften, (edge.slip + path).astype(real))
        self._set_pose(scene.food.shape.height + self._gap(), 0.0, scene.motion.tilt)

    def _set_pose(self, z: float, s: float = 0.0, tilt: float = 0.0) -> None:
        """Put the middle of the edge at a height and a place along the cut [m], at an angle to the board [rad], at rest."""
        pose = np.zeros(kn.N_POSE)
        pose[kn.Z] = pose[kn.COMMAND] = z
        pose[kn.S], pose[kn.TILT] = s, tilt
        pose[kn.TILT_COS], pose[kn.TILT_SIN] = math.cos(tilt), math.sin(tilt)
        self.k.pose.from_numpy(pose)

    def _gap(self) -> float:
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
            self.k = self._kernels(self._threads())
        scene = self.scene.with_material(**vars(material)) if material is not None else self.scene
        material = scene.food.material
        self._load(material)
        k, num, motion = self.k, scene.numerics, scene.motion
        dt = self._time_step(material)
        speed = motion.mach * material.p_wave
        every = max(1, round(num.output / (speed * dt)))
        gap = self._gap()
        # steps, velocity down and along the blade of each phase; one step more lets the food see where the edge ends
        phases = [
            (math.ceil((motion.stroke + gap) / (speed * dt)) + 1, -speed, speed * motion.slice_ratio),
            (math.ceil(motion.dwell / scene.time_scale / dt), 0.0, 0.0),
            (math.ceil(motion.retract / (speed * dt)), speed, 0.0),
        ]
        total = sum(steps for steps, _, _ in phases)
        rows: list[list[float]] = []
        began = clock.perf_counter()
        status, done, last, batch = "done", 0, np.zeros(3), 1
        looks = Looks(self.seeds, scene.mirrors, sections)
        watches = [one for one in (looks, watch) if one is not None and one.times > 0]
        self.counters = {"inverted": 0, "outside": 0}
        for steps, down, along in phases:
            left = steps
            while left > 0 and status == "done" and not pressed_home(scene, rows):
                count = min(every * batch, left)
                for one in watches:
                    count = min(count, every * math.ceil(max(one.due(total) - done, 1) / every))
                asked = clock.perf_counter()
                for row in self._advance(count, every, dt, down, along):
                    sums, state, pose = np.split(row, (kn.N_SUMS, kn.N_SUMS + kn.N_STATE))
                    n = min(every, left)
                    left, done = left - n, done + n
                    self.counters["inverted"] += int(sums[kn.INVERTED])
                    self.counters["outside"] += int(sums[kn.OUTSIDE])
                    parts = self._row(sums, state, last, n * dt, material, num.gravity)
                    last = np.array(parts[0])
                    rows.append([*self._place(pose), dt * done, *(v for part in parts for v in part), pose[kn.TILT]])
                    status = health(sums, state)
                    if status != "done" or pressed_home(scene, rows):
                        break
                if clock.perf_counter() - asked < PATIENCE / 2:
                    batch *= 2
                if progress is not None and status == "done":
                    progress(done / total, parts[1][2] + parts[2][2])
                due = [one for one in watches if status == "done" and done >= one.due(total)]
                if due:
                    stroke, _, slide, at = rows[-1][:4]
                    now = snapshot(at, stroke, slide, k, self._turn(k.of_particles(k.x), -1.0))
                    for one in due:
                        one.take(now)
        wall = clock.perf_counter() - began
        fraction = 1.0 if pressed_home(scene, rows) and status == "done" else done / total
        record = self._record(rows, material, status, fraction, dt, done, speed, wall)
        return replace(record, section=looks.section())

    def _place(self, pose: np.ndarray) -> list[float]:
        """Stroke, commanded stroke and way along the blade [m]."""
        height = self.scene.food.shape.height
        return [height - pose[kn.Z], height - pose[kn.COMMAND], pose[kn.S]]

    def _advance(self, count: int, every: int, dt: float, down: float, along: float, turn: float = 0.0) -> np.ndarray:
        """Some time steps with the tool commanded at these velocities [m/s, rad/s]; one row of the report after ``every``."""
        k, rows = self.k, math.ceil(count / every)
        if k.user is not self:
            raise RuntimeError("another simulation has taken over these fields; load this one again before it goes on")
        out = np.zeros((rows, kn.N_REPORT))
        if k.threads == 1 and not k.atomic:
            k.steps(rows, every, count, dt, down, along, turn, out)
            return out
        for r in range(rows):
            k.surround()
            for _ in range(min(every, count - r * every)):
                k.step(dt, down, along, turn)
            k.write(out[r : r + 1])
        return out

    def _row(
        self, sums: np.ndarray, state: np.ndarray, last: np.ndarray, span: float, material: Material, gravity: float
    ) -> list[list[float]]:
        """Momentum, edge, face, board, gravity, residual, energies and moment of one interval."""
        mirror = np.array([0.0 if m else 1.0 for m in (*self.scene.mirrors, False)])
        momentum = self._turn(state[None, :3], -1.0)[0] * self.images * mirror
        edge, face, board = (sums[r : r + 3] / span for r in (kn.EDGE, kn.FACE, kn.BOARD))
        weight = np.array([0.0, 0.0, -material.rho * self.seeds.total * self.images * gravity])
        residual = (momentum - last) / span - weight + edge + face + board
        lost = [self.images * self.seeds.volume * sums[r] for r in (kn.PLASTIC, kn.DAMAGE, kn.VISCOUS)]
        energy = [state[3] * self.images, state[4] * self.images, *lost, sums[kn.RUBBED], sums[kn.PARTED]]
        moment = [sums[kn.MOMENT] / span]
        return [list(momentum), list(edge), list(face), list(board), list(weight), list(residual), energy, moment]

    def _topology(self) -> Any:
        """Pieces of the food now."""
        k, mirrors = self.k, self.scene.mirrors
        side, f = k.of_particles(k.side), k.deformation()
        across = self._turn(k.of_particles(k.x), -1.0)[:, 1]
        half = np.where(side > 0, side - 1, 0 if mirrors[1] else across >= 0)
        damage = np.zeros(len(side))
        if k.damage:
            table = k.par.to_numpy()
            kappa = np.maximum(k.of_particles(k.kappa), table[kn.EPS0])
            damage = 1 - table[kn.EPS0] / kappa * np.exp(-(kappa - table[kn.EPS0]) / (table[kn.EPSF] - table[kn.EPS0]))
        return topology(self.seeds, mirrors, half.astype(int), side > 0, np.linalg.det(f), damage)

    def _record(
        self,
        rows: list[list[float]],
        material: Material,
        status: str,
        fraction: float,
        dt: float,
        steps: int,
        speed: float,
        wall: float,
    ) -> ForceRecord:
        """Columns of the rows as a record."""
        a = np.array(rows)
        parts = {n: a[:, 4 + 3 * k : 7 + 3 * k] for k, n in enumerate(("p", "edge", "face", "board", "g", "res"))}
        kinetic, elastic = a[:, 22], a[:, 23]
        plastic, damage, viscous, friction, parting = np.cumsum(a[:, 24:29], axis=0).T
        pieces = self._topology() if status == "done" else None
        area = section_area(self.scene.food.shape)
        return ForceRecord(
            stroke=a[:, 0],
            command=a[:, 1],
            slide=a[:, 2],
            time=a[:, 3],
            edge=parts["edge"],
            face=parts["face"],
            board=parts["board"],
            gravity=parts["g"],
            momentum=parts["p"],
            residual=parts["res"],
            kinetic=kinetic,
            elastic=elastic,
            plastic=plastic,
            damage=damage,
            viscous=viscous,
            friction=friction,
            parting=parting,
            moment=a[:, 29],
            tilt=a[:, 30],
            mass=material.rho * self.seeds.total * self.images,
            lagging=self.scene.numerics.contact != "nodal",
            cell=self.scene.numerics.dx,
            speed=speed,
            dt=dt,
            steps=steps,
            particles=len(self.seeds.x),
            images=self.images,
            cells=int(np.prod(self.nodes)),
            severed_area=area - pieces.uncut_area if pieces is not None else 0.0,
            pieces=pieces,
            counters=self.counters,
            wall=wall,
            status=status,
            fraction=fraction,
            resistance=material.R if self.scene.cuts and self.scene.numerics.contact != "nodal" else math.nan,
        )


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
