"""What a run has booked so far: a row for each output interval, from which its record is made."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mpm.kernels import fields as kn
from mpm.material import Material
from mpm.output.health import health
from mpm.output.record import ForceRecord
from mpm.shapes import section_area

if TYPE_CHECKING:
    from mpm.solver import Simulation


class Ledger:
    """Rows of a cut.

    Args:
        simulation: The cut.
        material: Its constants.

    Attributes:
        rows: One for each output interval.
        steps: Time steps so far.
        time: Simulated time so far [s].
        status: ``done``, or why the run cannot go on.
    """

    def __init__(self, simulation: Simulation, material: Material) -> None:
        self._simulation, self._material = simulation, material
        self.rows: list[list[float]] = []
        self.steps, self.time, self.status = 0, 0.0, "done"
        self._momentum = np.zeros(3)
        self._counters = {"inverted": 0, "outside": 0}

    def book(self, report: np.ndarray, steps: int, dt: float) -> None:
        """Book an interval.

        Args:
            report: What the kernels say of it, shape (N_REPORT,).
            steps: Its time steps.
            dt: Length of one [s].
        """
        sums, state, pose = np.split(report, (kn.N_SUMS, kn.N_SUMS + kn.N_STATE))
        self.steps, self.time = self.steps + steps, self.time + steps * dt
        self._counters["inverted"] += int(sums[kn.INVERTED])
        self._counters["outside"] += int(sums[kn.OUTSIDE])
        parts = self._parts(sums, state, steps * dt)
        self._momentum = np.array(parts[0])
        height = self._simulation.scene.food.shape.height
        place = [height - pose[kn.Z], height - pose[kn.COMMAND], pose[kn.S]]
        self.rows.append([*place, self.time, *(v for part in parts for v in part), pose[kn.TILT]])
        self.status = health(sums, state)

    @property
    def force(self) -> np.ndarray:
        """Force of the food on the knife in the last interval [N], shape (3,)."""
        return np.array(self.rows[-1][7:10]) + np.array(self.rows[-1][10:13])

    @property
    def moment(self) -> float:
        """Moment of the food on the knife about the middle of the edge in the last interval [N m]."""
        return self.rows[-1][-2]

    def _parts(self, sums: np.ndarray, state: np.ndarray, span: float) -> list[list[float]]:
        """Momentum, edge, face, board, gravity, residual, energies and moment of an interval."""
        s, material = self._simulation, self._material
        mirror = np.array([0.0 if m else 1.0 for m in (*s.scene.mirrors, False)])
        momentum = s.turned(state[None, :3], -1.0)[0] * s.images * mirror
        edge, face, board = (sums[r : r + 3] / span for r in (kn.EDGE, kn.FACE, kn.BOARD))
        weight = np.array([0.0, 0.0, -material.rho * s.seeds.total * s.images * s.scene.numerics.gravity])
        residual = (momentum - self._momentum) / span - weight + edge + face + board
        lost = [s.images * s.seeds.volume * sums[r] for r in (kn.PLASTIC, kn.DAMAGE, kn.VISCOUS)]
        energy = [state[3] * s.images, state[4] * s.images, *lost, sums[kn.RUBBED], sums[kn.PARTED]]
        moment = [sums[kn.MOMENT] / span]
        return [list(momentum), list(edge), list(face), list(board), list(weight), list(residual), energy, moment]

    def record(self, *, dt: float, fraction: float, wall: float) -> ForceRecord:
        """Columns of the rows as a record.

        Args:
            dt: Time step [s].
            fraction: Part of the motion that is done [-].
            wall: Run time [s].
        """
        s, material, a = self._simulation, self._material, np.array(self.rows)
        scene = s.scene
        parts = {n: a[:, 4 + 3 * k : 7 + 3 * k] for k, n in enumerate(("p", "edge", "face", "board", "g", "res"))}
        kinetic, elastic = a[:, 22], a[:, 23]
        plastic, damage, viscous, friction, parting = np.cumsum(a[:, 24:29], axis=0).T
        pieces = s.topology() if self.status == "done" else None
        cohesive = scene.cuts and scene.numerics.contact != "nodal"
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
            mass=material.rho * s.seeds.total * s.images,
            lagging=scene.numerics.contact != "nodal",
            cell=scene.numerics.dx,
            speed=scene.motion.mach * material.p_wave,
            dt=dt,
            steps=self.steps,
            particles=len(s.seeds.x),
            images=s.images,
            cells=int(np.prod(s.nodes)),
            severed_area=section_area(scene.food.shape) - pieces.uncut_area if pieces is not None else 0.0,
            pieces=pieces,
            counters=self._counters,
            wall=wall,
            status=self.status,
            fraction=fraction,
            resistance=material.R if cohesive else math.nan,
        )
