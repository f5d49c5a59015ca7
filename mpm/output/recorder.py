"""What a run has booked so far: an entry for each output interval, from which its record is made."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpm.output.health import health
from mpm.output.record import ForceRecord
from mpm.output.topology import Topology
from mpm.scene.layers import mean_toughness
from mpm.scene.material import Material
from mpm.setup.setup import Setup
from mpm.state import tables as row
from mpm.state.tables import Report, parts_of_report


@dataclass(frozen=True, eq=False)
class Interval:
    """What an output interval adds to the record; forces act on the tools.

    Attributes:
        stroke: Way of the edge below the food's top at its end [m].
        command: Stroke that was commanded [m].
        slide: Way of the blade along its edge [m].
        time: Simulated time at its end [s].
        momentum: Of the food at its end [N s], shape (3,).
        dampers: Momentum of its dampers at its end [N s], shape (3,).
        edge: Force of the food on the cutting edge [N], shape (3,).
        face: Force of the food on the blade's faces [N], shape (3,).
        board: Force of the food on the board [N], shape (3,).
        gravity: Weight [N], shape (3,).
        residual: Momentum balance that does not close [N], shape (3,).
        kinetic: Kinetic energy at its end [J].
        elastic: Elastic energy at its end [J].
        plastic: Energy that J2 flow has taken in it [J].
        damage: Energy that bulk damage has taken in it [J].
        viscous: Energy that the loss factor and the dampers have taken in it [J].
        friction: Energy that friction has taken in it [J].
        parting: Energy that the cutting edge has taken in it [J].
        cohesion: Energy that ties across the cut plane have taken in it [J].
        adhesion: Energy that sticky faces have taken in it [J].
        suction: Energy that the board's suction has taken in it [J].
        moment: Of the food on the knife about the middle of the edge [N m].
        tilt: Angle of the edge to the board at its end [rad].
    """

    stroke: float
    command: float
    slide: float
    time: float
    momentum: np.ndarray
    dampers: np.ndarray
    edge: np.ndarray
    face: np.ndarray
    board: np.ndarray
    gravity: np.ndarray
    residual: np.ndarray
    kinetic: float
    elastic: float
    plastic: float
    damage: float
    viscous: float
    friction: float
    parting: float
    cohesion: float
    adhesion: float
    suction: float
    moment: float
    tilt: float


class Recorder:
    """Books the output intervals of a cut.

    Args:
        setup: The cut.
        material: Its constants.

    Attributes:
        intervals: Those that are booked.
        steps: Time steps so far.
        time: Simulated time so far [s].
        status: ``done``, or why the run cannot go on.
    """

    def __init__(self, setup: Setup, material: Material) -> None:
        self._setup, self._material = setup, material
        self.intervals: list[Interval] = []
        self.steps, self.time, self.status = 0, 0.0, "done"
        self._counters = {"inverted": 0, "outside": 0}

    def book(self, report: np.ndarray, steps: int, dt: float) -> None:
        """Book an interval.

        Args:
            report: What the kernels say of it in SI units [-], shape (N_REPORT,).
            steps: Its time steps.
            dt: Length of one [s].
        """
        parts = parts_of_report(report)
        self.steps, self.time = self.steps + steps, self.time + steps * dt
        self._counters["inverted"] += int(parts.sums[row.INVERTED])
        self._counters["outside"] += int(parts.sums[row.OUTSIDE])
        self.intervals.append(self._interval(parts, steps * dt))
        self.status = health(parts.sums, parts.particles)

    @property
    def force(self) -> np.ndarray:
        """Force of the food on the knife in the last interval [N], shape (3,)."""
        return self.intervals[-1].edge + self.intervals[-1].face

    @property
    def moment(self) -> float:
        """Moment of the food on the knife about the middle of the edge in the last interval [N m]."""
        return self.intervals[-1].moment

    def _interval(self, parts: Report, span: float) -> Interval:
        """An interval of a length [s] from what the kernels say of it; mirror images are counted here."""
        setup, sums, pose = self._setup, parts.sums, parts.pose
        scene, images, height = setup.scene, setup.grid.images, setup.scene.food.shape.height
        mirror = np.array([0.0 if m else 1.0 for m in (*scene.mirrors, False)])
        momentum, dampers = (
            setup.to_scene_axes(parts.particles[None, r : r + 3])[0] * images * mirror
            for r in (row.MOMENTUM, row.DAMPER_MOMENTUM)
        )
        last = self.intervals[-1] if self.intervals else None
        before = last.momentum + last.dampers if last else np.zeros(3)
        edge, face, board = (sums[r : r + 3] / span for r in (row.EDGE, row.FACE, row.BOARD))
        weight = np.array([0.0, 0.0, -self._material.rho * setup.seeds.total * images * scene.numerics.gravity])
        volume = images * setup.seeds.volume
        return Interval(
            stroke=height - pose[row.EDGE_Z],
            command=height - pose[row.COMMAND],
            slide=pose[row.EDGE_S],
            time=self.time,
            momentum=momentum,
            dampers=dampers,
            edge=edge,
            face=face,
            board=board,
            gravity=weight,
            residual=(momentum + dampers - before) / span - weight + edge + face + board,
            kinetic=parts.particles[row.KINETIC] * images,
            elastic=parts.particles[row.ELASTIC] * images,
            plastic=volume * sums[row.PLASTIC],
            damage=volume * sums[row.DAMAGE],
            viscous=volume * sums[row.VISCOUS],
            friction=sums[row.FRICTION_WORK],
            parting=sums[row.CUTTING_WORK],
            cohesion=sums[row.TIE_WORK],
            adhesion=sums[row.ADHESION_WORK],
            suction=sums[row.SUCTION_WORK],
            moment=sums[row.MOMENT] / span,
            tilt=pose[row.TILT],
        )

    def _column(self, name: str) -> np.ndarray:
        """One quantity of all intervals."""
        return np.array([getattr(interval, name) for interval in self.intervals])

    def record(self, pieces: Topology | None, *, dt: float, fraction: float, wall: float) -> ForceRecord:
        """The intervals so far as a record.

        Args:
            pieces: What is left of the food, None where the run broke down.
            dt: Time step [s].
            fraction: Part of the motion that is done [-].
            wall: Run time [s].

        Returns:
            The record.
        """
        setup, material, scene = self._setup, self._material, self._setup.scene
        cohesive = scene.cuts and scene.numerics.contact != "nodal"
        food = scene.food
        section = food.section_area
        parted = section - pieces.uncut_area if pieces is not None else 0.0
        return ForceRecord(
            stroke=self._column("stroke"),
            command=self._column("command"),
            slide=self._column("slide"),
            time=self._column("time"),
            edge=self._column("edge"),
            face=self._column("face"),
            board=self._column("board"),
            gravity=self._column("gravity"),
            momentum=self._column("momentum"),
            dampers=self._column("dampers"),
            residual=self._column("residual"),
            kinetic=self._column("kinetic"),
            elastic=self._column("elastic"),
            plastic=np.cumsum(self._column("plastic")),
            damage=np.cumsum(self._column("damage")),
            viscous=np.cumsum(self._column("viscous")),
            friction=np.cumsum(self._column("friction")),
            parting=np.cumsum(self._column("parting")),
            moment=self._column("moment"),
            tilt=self._column("tilt"),
            mass=material.rho * setup.seeds.total * setup.grid.images * setup.heavier(material),
            lagging=scene.numerics.contact != "nodal",
            cell=scene.numerics.dx,
            speed=scene.motion.mach * material.p_wave,
            dt=dt,
            steps=self.steps,
            particles=len(setup.seeds.x),
            images=setup.grid.images,
            cells=int(np.prod(setup.grid.nodes)),
            severed_area=parted,
            pieces=pieces,
            counters=self._counters,
            wall=wall,
            status=self.status,
            fraction=fraction,
            resistance=mean_toughness(food.shape, material, parted / section, food.crossed) if cohesive else math.nan,
            cohesion=np.cumsum(self._column("cohesion")) if scene.tied else None,
            adhesion=np.cumsum(self._column("adhesion")) if material.adhesion > 0 else None,
            suction=np.cumsum(self._column("suction")) if scene.suction > 0 else None,
            slowed=scene.slows_down,
        )
