"""The result of one cut: forces over stroke, momentum and energy, and what went wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpm.output.section import Section
from mpm.output.topology import Topology

ENERGIES = ("kinetic", "elastic", "plastic", "damage", "viscous", "friction", "parting", "unbooked")
"""Where the work of knife and gravity has gone, each a column of a record; together they are that work.

A cut with a cohesive crack has one more, :data:`COHESION`, and one of a food that sticks :data:`ADHESION`."""
COHESION = "cohesion"
"""What the food has taken where it opened across the cut plane by itself, ahead of the edge."""
ADHESION = "adhesion"
"""What it has taken to take the food off the blade's faces."""
SUCTION = "suction"
"""What it has taken to lift the food off the board, where that holds it down."""
STROKE, BOARD, LIMIT = "stroke", "board", "force_limit"
ENDINGS = (STROKE, BOARD, LIMIT)
"""Why a motion ends: as commanded, with the edge pressed on the board by an arm that yields, or where the force on the
knife reached the most that a rigid arm bears."""
LEAST_CUT = 5
"""Stroke [cells] from which the cost of parting is asked for: the new area is known to a row of cells, its fifth."""


@dataclass(frozen=True)
class ForceRecord:
    """Forces, momenta and energies of one cut, one row per output interval; forces act on the tool.

    Every force is an impulse accumulated over the interval and divided by its length.

    Attributes:
        stroke: Way of the edge below the food's top at the end of each interval [m], shape (n,).
        command: Stroke that was commanded; differs from ``stroke`` when the arm is not rigid [m], shape (n,).
        slide: Way of the blade along its edge [m], shape (n,).
        time: Simulated time at the end of each interval [s], shape (n,).
        edge: Force of the food on the cutting edge [N], shape (n, 3).
        face: Force of the food on the blade's faces [N], shape (n, 3).
        board: Force of the food on the board [N], shape (n, 3).
        gravity: Weight [N], shape (n, 3).
        momentum: Momentum of the food at the end of each interval [N s], shape (n, 3).
        dampers: Momentum of its dampers at the end of each interval [N s], shape (n, 3).
        residual: Momentum balance that does not close [N], shape (n, 3).
        kinetic: Kinetic energy of the motion, dampers included, without what contact gave in the last step [J], shape
            (n,).
        elastic: Elastic energy [J], shape (n,).
        plastic: Energy dissipated by J2 flow so far [J], shape (n,).
        damage: Energy dissipated by bulk damage so far [J], shape (n,).
        viscous: Energy dissipated by the loss factor and the dampers so far [J], shape (n,).
        friction: Energy that friction has taken so far [J], shape (n,); of particles that touch, so that of the
            ``nodal`` contact is not in it.
        parting: Energy that the cutting edge has taken so far [J], shape (n,): new surface, and the start of the cut.
        moment: Moment of the food on the knife about the middle of the edge, which raises the end at +x [N m], shape
            (n,); 0 where x = 0 is a mirror.
        tilt: Angle of the edge to the board at the end of each interval [rad], shape (n,).
        mass: Mass of the simulated food, mirror images included [kg]: that of the real one, and more where a rind is
            stiffer than the flesh, for it is simulated as so much more of it.
        lagging: Whether contact acts on particles after they were moved: all but ``nodal`` contact.
        cell: Cell size [m].
        speed: Simulated blade speed [m/s].
        dt: Time step [s].
        steps: Number of time steps.
        particles: Number of particles simulated (mirror images not counted).
        images: Mirror images that each particle stands for (1, 2 or 4).
        cells: Number of grid nodes.
        severed_area: Area of the section that the edge has passed [m^2].
        pieces: Connected pieces that are left, None when the run broke down.
        counters: How often each exceptional branch was taken, e.g. ``inverted``; all zero in a sound run.
        wall: Run time of the time loop [s].
        status: ``done``, or the reason why the run stopped early.
        fraction: Part of the stroke completed [-].
        section: The food across the blade's middle, where it was asked for.
        resistance: Cutting resistance R of the food that is parted [J/m^2], the mean over its layers; NaN where no edge
            parts it.
        cohesion: Energy that the ties of a cohesive crack have taken so far, where the food opened ahead of the edge
            [J], shape (n,); None without one.
        adhesion: Energy that it has taken so far to take the food off the blade's faces [J], shape (n,); None where it
            does not stick. A part of it is stored in faces that are being taken off.
        suction: Energy that it has taken so far to lift the food off the board against its suction [J], shape (n,);
            None where the board does not hold it.
        slowed: Whether the blade slowed down on its way.
        ended: Why the motion ended, one of :data:`ENDINGS`; a run that broke down has its reason in ``status``.
        rows_down: Rows before the blade is withdrawn, all of its way down and of its pause; None where it is not.
    """

    stroke: np.ndarray
    command: np.ndarray
    slide: np.ndarray
    time: np.ndarray
    edge: np.ndarray
    face: np.ndarray
    board: np.ndarray
    gravity: np.ndarray
    momentum: np.ndarray
    dampers: np.ndarray
    residual: np.ndarray
    kinetic: np.ndarray
    elastic: np.ndarray
    plastic: np.ndarray
    damage: np.ndarray
    viscous: np.ndarray
    friction: np.ndarray
    parting: np.ndarray
    moment: np.ndarray
    tilt: np.ndarray
    mass: float
    lagging: bool
    cell: float
    speed: float
    dt: float
    steps: int
    particles: int
    images: int
    cells: int
    severed_area: float
    pieces: Topology | None
    counters: dict[str, int]
    wall: float
    status: str = "done"
    fraction: float = 1.0
    section: Section | None = None
    resistance: float = math.nan
    cohesion: np.ndarray | None = None
    adhesion: np.ndarray | None = None
    suction: np.ndarray | None = None
    slowed: bool = False
    ended: str = STROKE
    rows_down: int | None = None

    @property
    def knife(self) -> np.ndarray:
        """Force of the food on the knife, edge and faces [N], shape (n, 3)."""
        return self.edge + self.face

    @property
    def resolved_face(self) -> np.ndarray:
        """Upward force on the blade's faces, averaged over one cell of stroke [N], shape (n,).

        The crack front behind the edge advances by whole node layers, so the force on the faces carries a ripple with
        the period of one cell. A moving mean over exactly one cell removes it and nothing longer; on the last half
        cell, which has no such window, the curve is carried on along the last two whole ones. Way down and
        withdrawal are apart, for the force jumps where the blade turns.
        """
        way = self.time * self.speed
        if self.slowed:
            step = np.diff(way, prepend=0.0)
            told = np.abs(np.diff(self.command, prepend=self.command[:1] - step[:1]))
            way = np.cumsum(np.where(told > 0.0, np.minimum(told, step), step))  # a pause counts by its time
        n, face = self.cut_rows, self.face[:, 2]
        down, begin = _moving_mean(way[:n], face[:n], self.cell), way[n - 1] if n else 0.0
        return np.concatenate([down, _moving_mean(way[n:] - begin, face[n:], self.cell)]) if n < len(way) else down

    @property
    def resolved(self) -> np.ndarray:
        """Upward force on the knife without the ripple of the grid [N], shape (n,): what is compared with a trace."""
        return self.edge[:, 2] + self.resolved_face

    @property
    def ripple(self) -> float:
        """Standard deviation of what :attr:`resolved_face` takes away [N]."""
        return float(np.std(self.face[:, 2] - self.resolved_face)) if len(self.stroke) else 0.0

    @property
    def peak(self) -> float:
        """Largest resolved upward force on the knife on its way down [N]."""
        return float(self.resolved[: self.cut_rows].max()) if self.cut_rows else 0.0

    @property
    def cut_rows(self) -> int:
        """Rows of the cut: those before the blade is withdrawn."""
        return len(self.stroke) if self.rows_down is None else self.rows_down

    @property
    def withdrawal(self) -> dict[str, float] | None:
        """The way back up: its largest downward force on the knife, resolved (``pull_N``), and its work on the food
        (``work_J``), which is negative where the food pushes the blade out; None where it is not withdrawn."""
        up = self.resolved[self.cut_rows :]
        if not len(up):
            return None
        return {"pull_N": max(0.0, -float(up.min())), "work_J": float(self.work_done[-1]) - self.work}

    @property
    def severed(self) -> bool:
        """Whether the food is in two or more pieces."""
        return self.pieces is not None and self.pieces.complete

    @property
    def severed_part(self) -> float | None:
        """Part of the flesh's section that the edge has passed [-], None when the run broke down."""
        if self.pieces is None:
            return None
        whole = self.severed_area + self.pieces.uncut_area
        return self.severed_area / whole if whole > 0 else 1.0

    @property
    def work(self) -> float:
        """Work of the knife on the food until it is withdrawn [J]: down, along the blade, and as it turns."""
        return float(self.work_done[self.cut_rows - 1]) if self.cut_rows else 0.0

    @property
    def work_done(self) -> np.ndarray:
        """Work of the knife on the food so far [J], shape (n,)."""
        down = self.knife[:, 2] * np.diff(self.stroke, prepend=0.0)
        along = self.knife[:, 0] * np.diff(self.slide, prepend=0.0)
        turning = self.moment * np.diff(self.tilt, prepend=self.tilt[:1])  # the first interval begins above the food
        return np.cumsum(down - along - turning)

    @property
    def unbooked(self) -> np.ndarray:
        """Energy that no law has taken [J], shape (n,): work of the knife and of gravity less all that is booked.

        It is lost by the discretisation: the transfers smooth the velocities, and the contact stops what approaches it.
        Without ties across the cut plane (the ``nodal`` contact) it holds all that new surface costs as well.
        """
        booked = self.kinetic + self.elastic + self.plastic + self.damage + self.viscous + self.friction + self.parting
        for more in (self.cohesion, self.adhesion, self.suction):
            booked = booked if more is None else booked + more
        return self.work_done + self.weighing - booked

    @property
    def lost(self) -> float:
        """Part of the work that no law has taken [-]; NaN where no work was done."""
        return float(self.unbooked[-1]) / self.work if len(self.stroke) and self.work > 0 else math.nan

    @property
    def surface(self) -> np.ndarray:
        """Energy of new surface so far, taken by the edge and by ties that open ahead of it [J], shape (n,)."""
        return self.parting if self.cohesion is None else self.parting + self.cohesion

    @property
    def energies(self) -> tuple[str, ...]:
        """Names of the energies of this record: :data:`ENERGIES`, and :data:`COHESION`, :data:`ADHESION` and
        :data:`SUCTION` where there are ties, sticky faces and a board that holds the food."""
        more = [name for name in (COHESION, ADHESION, SUCTION) if getattr(self, name) is not None]
        return (*ENERGIES[:-1], *more, ENERGIES[-1])

    @property
    def budget(self) -> dict[str, float]:
        """Where the work has gone by the end [J], by the names of :attr:`energies`."""
        return {name: float(getattr(self, name)[-1]) if len(self.stroke) else 0.0 for name in self.energies}

    @property
    def fracture(self) -> dict[str, float] | None:
        """Energy of new surface over its area [J/m^2]; None where there is none.

        ``edge_J_m2`` is that of the edge's law, ``opening_J_m2`` that of the ties that open ahead of the edge. They add
        up to R. ``released_J_m2`` is :attr:`unbooked`: what no law has taken.
        """
        if not self.severed_area > 0:
            return None
        opening = {} if self.cohesion is None else {"opening_J_m2": float(self.cohesion[-1]) / self.severed_area}
        return {
            "edge_J_m2": float(self.parting[-1]) / self.severed_area,
            **opening,
            "released_J_m2": float(self.unbooked[-1]) / self.severed_area,
        }

    @property
    def parted(self) -> float:
        """Energy of new surface over R times the new area [-]; NaN where nothing or too little is parted.

        One, and more with a skin, where the food is cut. Where the edge presses it away, as one that flows, the force
        is that of the flow within the process zone, which is a width of the method, and R only bounds it.
        """
        sound = self.status == "done" and self.resistance > 0 and len(self.stroke) > 0
        if not sound or self.stroke.max() < LEAST_CUT * self.cell:
            return math.nan
        return float(self.surface[-1]) / (self.resistance * self.severed_area) if self.severed_area > 0 else 0.0

    @property
    def weighing(self) -> np.ndarray:
        """Work of gravity so far [J], shape (n,).

        The momentum of a record is that which the next transfer gets; with contact of particles it is ahead of the
        motion by the impulse of one step.
        """
        span = np.diff(self.time, prepend=0.0)
        p = self.momentum[:, 2]
        moved = np.cumsum((p + np.concatenate([[0.0], p[:-1]])) / 2 * span)
        if self.lagging:
            moved += self.dt * np.cumsum((self.face + self.board)[:, 2] * span)
        return self.gravity[:, 2] / self.mass * moved

    @property
    def momentum_residual(self) -> float:
        """Largest part of the momentum balance that does not close, over the peak force [-]."""
        return float(np.abs(self.residual).max() / self.peak) if self.peak > 0 else 0.0

    @property
    def ke_over_ie(self) -> float:
        """Kinetic energy over the work done on the food so far less that energy [-], the worst once a quarter of the
        work is done; an explicit run counts as quasi-static below 0.05 to 0.1.
        """
        done = self.work_done - self.kinetic
        ok = done > 0.25 * done[-1] if len(done) and done[-1] > 0 else np.zeros(0, bool)
        return float((self.kinetic[ok] / done[ok]).max()) if ok.any() else 0.0

    def columns(self) -> dict[str, np.ndarray]:
        """The record as named columns with units, ready for a CSV file."""
        out = {"stroke_m": self.stroke, "time_s": self.time, "command_m": self.command, "slide_m": self.slide}
        for name in ("knife", "edge", "face", "board"):
            values = getattr(self, name)
            out |= {f"{name}_f{axis}_N": values[:, k] for k, axis in enumerate("xyz")}
        out |= {"moment_Nm": self.moment, "tilt_rad": self.tilt}
        out |= {f"balance_{axis}_N": self.residual[:, k] for k, axis in enumerate("xyz")}
        for name in self.energies:
            out[f"{name}_J"] = getattr(self, name)
        return out

    def summary(self) -> dict[str, Any]:
        """The scalars that a report quotes."""
        area = self.severed_area
        return {
            "peak_N": self.peak,
            "ripple_N": self.ripple,
            "work_J": self.work,
            "work_per_area_J_m2": self.work / area if area > 0 else None,
            "parted": None if math.isnan(self.parted) else self.parted,
            "particles": self.particles,
            "mirror_images": self.images,
            "grid_nodes": self.cells,
            "steps": self.steps,
            "dt_s": self.dt,
            "speed_m_s": self.speed,
            "wall_s": self.wall,
            "energy_J": self.budget,
            "severed": self.severed,
            "components": len(self.pieces.volumes) if self.pieces is not None else None,
            "volumes_m3": list(self.pieces.volumes) if self.pieces is not None else None,
            "cut": self.pieces.words() if self.pieces is not None else None,
            "severed_part": self.severed_part,
            "ended": self.ended,
            "stone_m": list(self.pieces.stone) if self.pieces is not None and self.pieces.stone is not None else None,
            "stone_met_m": self.pieces.stone_met if self.pieces is not None else None,
            "momentum_residual": self.momentum_residual,
            "ke_over_ie": self.ke_over_ie,
            "counters": dict(self.counters),
            "status": self.status,
            "fraction": self.fraction,
        } | ({} if self.withdrawal is None else {"withdrawal": self.withdrawal})


def _moving_mean(way: np.ndarray, values: np.ndarray, width: float) -> np.ndarray:
    """Mean of interval values over a centred window of the way, exact for piecewise constant values.

    Where the window would reach beyond the end, the means over the last two whole windows are carried on along their
    line: a window that shrinks would let through what it is there to remove. At the beginning it shrinks, where there
    is nothing to remove yet.
    """
    if len(way) == 0:
        return values
    edges = np.concatenate([[0.0], way])
    integral = np.concatenate([[0.0], np.cumsum(values * np.diff(edges))])
    centre = (edges[1:] + edges[:-1]) / 2
    half = np.minimum(width / 2, np.minimum(centre - edges[0], edges[-1] - centre))
    upper, lower = np.interp(centre + half, edges, integral), np.interp(centre - half, edges, integral)
    out = (upper - lower) / (2 * half)
    if way[-1] >= 2 * width:
        end = edges[-1] - width / 2
        late = centre > end
        below, under, top = np.interp(edges[-1] - width * np.array([2.0, 1.0, 0.0]), edges, integral)
        last, before = (top - under) / width, (under - below) / width
        out[late] = last + (last - before) / width * (centre[late] - end)
    return out
