"""What is simulated: food, knife, board, motion and numerics as frozen, validated data in SI units.

Coordinates: x along the blade, y normal to the blade plane, z up; the board's top is z = 0, the food stands on it
centred on x = y = 0 and the blade plane is y = 0. The stroke is the way of the cutting edge below the food's top.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from mpm.scene.errors import SceneError, check_number
from mpm.scene.inclusions import Food
from mpm.scene.material import REFERENCE_SPEED, Material
from mpm.scene.motion import Arm, Motion
from mpm.scene.tools import Board, Knife, Press

CONTACTS = ("cohesive", "nodal")
PRECISIONS = ("f64", "f32")
BAND_CELLS = 2.5  # width of a crack band of grid-smoothed damage [cells] (docs/theory.md, "Measured choices")


@dataclass(frozen=True)
class EdgeLaw:
    """Regularisation of the cutting edge, fixed in metres so that the force does not follow the grid.

    Attributes:
        zone: Width of the B-spline over which the edge's line force is spread [m]; at least one cell, and wider where
            the food asks for it (:meth:`Scene.process_zone`).
        bearing: Line force that a food that flows bears over that width, over the line force of the edge [-]. Below
            about 1 it flows along with the edge, and new surface is had for less than R.
        slip: Slip of the edge in the material at which the line force is fully developed [m].
        dent_width: Width of the strip under the edge of which the food's ``initiation_depth`` is told [m]; None: the
            zone's. It belongs to that property and does not change with the zone.
    """

    zone: float = 3e-3
    bearing: float = 1.25
    slip: float = 1e-3
    dent_width: float | None = None

    def __post_init__(self) -> None:
        check_number("edge", "zone", self.zone, 1e-5, 0.05, "m")
        check_number("edge", "bearing", self.bearing, -1e-300, 100.0, "of R")
        check_number("edge", "slip", self.slip, 1e-5, 0.05, "m")
        if self.dent_width is not None:
            check_number("edge", "dent_width", self.dent_width, 1e-5, 0.05, "m")


@dataclass(frozen=True)
class Numerics:
    """How the scene is discretised.

    Attributes:
        dx: Cell size [m].
        ppc: Particles per cell and direction, at least 2.
        far: Distance from the cut plane beyond which there is one particle a cell across the blade, and within the food
            one a cell altogether [m]; None: nowhere. Only the outline needs as many there as elsewhere.
        contact_stiffness: Stiffness of the contact's spring over that of a layer of particles [-]. Below 1.5 Nitsche's
            method is not stable in every food (docs/theory.md, "Measured choices"); stiffer asks for shorter steps.
        edge_band: Half height of what the edge is cutting, about the edge [cells].
        extension: Beside the cut plane a node above or below the food whose mass is less than this part of that of the
            next two inside follows them (:mod:`mpm.kernels.outer_nodes`) [-]; across the plane a tenth; 0 for none.
        crack_ties: Ties that the process zone of a crack spans at least
            (:meth:`mpm.scene.material.Material.tie_strength`).
        layer_rows: Rows of a tie across the cut plane, each with the toughness of the layer that it lies in.
        least_gap: Least distance of a particle's centre from the food's surface that squeezing leaves [cells].
        damper_mass: Mass of the Lanchester damper that each particle carries, over its own [-]
            (:mod:`mpm.kernels.dampers`). It takes motion that comes and goes; a slow cut does not feel it.
        contact: ``cohesive`` (edge law and particle contact) or ``nodal`` (the plain projection of grid velocities).
        grid_shift: Position of the grid against the scene along x, y, z [cells].
        grid_turn: Angle of food and blade against the grid [rad].
        mirror: Use the mirror planes x = 0 and y = 0 where they are mirrors of the grid.
        room: Empty grid on either side of the food, for it to widen in while it is pressed, part of half its size, and
            above it for the ends of halves that tip, part of half its length across the blade.
        seed: Seed of the particle positions.
        safety: dt over the stability limit of a lone particle [-].
        gravity: Acceleration of gravity [m/s^2].
        output: Stroke between two rows of the record [m].
        precision: ``f64`` or ``f32`` state.
    """

    dx: float = 2.5e-3
    ppc: int = 2
    far: float | None = None
    contact: str = "cohesive"
    contact_stiffness: float = 2.0
    edge_band: float = 0.125
    extension: float = 0.1
    crack_ties: float = 3.0
    layer_rows: int = 8
    least_gap: float = 0.02
    damper_mass: float = 0.0
    grid_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    grid_turn: float = 0.0
    mirror: bool = True
    room: float = 0.5
    seed: int = 0
    safety: float = 0.7
    gravity: float = 9.81
    output: float = 0.25e-3
    precision: str = "f64"

    def __post_init__(self) -> None:
        w = "numerics"
        check_number(w, "dx", self.dx, 1e-5, 0.05, "m")
        check_number(w, "ppc", self.ppc, 0.5, 8.5, "")
        if self.ppc < 2:
            raise SceneError(
                "numerics: ppc 1: one particle a cell does not integrate the grid's functions, and where a cut starts "
                "energy comes from nothing; use 2 (8 particles a cell) or 3"
            )
        if self.far is not None:
            check_number(w, "far", self.far, 0.0, 1.0, "m")
        check_number(w, "room", self.room, 0.0, 100.0, "of half the food's size")
        check_number(w, "contact_stiffness", self.contact_stiffness, 0.1, 100.0, "of a layer's")
        check_number(w, "crack_ties", self.crack_ties, 0.5 * (1 - 1e-9), 50.0, "ties")
        check_number(w, "extension", self.extension, -1e-300, 0.25, "of the mass inside")
        check_number(w, "edge_band", self.edge_band, 0.01, 5.0, "cells")
        check_number(w, "damper_mass", self.damper_mass, -1e-300, 2.0, "of a particle's")
        check_number(w, "least_gap", self.least_gap, 1e-6, 0.2, "cells")
        if not isinstance(self.layer_rows, int) or not 1 <= self.layer_rows <= 64:
            raise SceneError(f"numerics: layer_rows {self.layer_rows!r} must be a whole number from 1 to 64")
        check_number(w, "safety", self.safety, 0.0, 0.9001, "of the stability limit")
        check_number(w, "output", self.output, 0.0, 0.1, "m")
        if self.contact not in CONTACTS:
            raise SceneError(f"numerics: contact {self.contact!r} is not one of {', '.join(CONTACTS)}")
        if self.precision not in PRECISIONS:
            raise SceneError(f"numerics: precision {self.precision!r} is not one of {', '.join(PRECISIONS)}")


@dataclass(frozen=True)
class Scene:
    """Everything that determines one cut."""

    food: Food
    knife: Knife | Press
    motion: Motion
    board: Board = field(default_factory=Board)
    edge: EdgeLaw = field(default_factory=EdgeLaw)
    numerics: Numerics = field(default_factory=Numerics)
    arm: Arm = field(default_factory=Arm)

    def __post_init__(self) -> None:
        dx, shape = self.numerics.dx, self.food.shape
        if self.cuts and self.numerics.contact == "cohesive" and self.edge.zone < dx * (1 - 1e-9):
            raise SceneError(
                f"edge: process zone {self.edge.zone * 1e3:g} mm is narrower than the cell {dx * 1e3:g} mm, so the "
                f"edge would fall between nodes; use dx <= {self.edge.zone * 1e3:g} mm"
            )
        thin = min(shape.length, shape.width, shape.height)
        if thin < 4 * dx:
            raise SceneError(f"shape: {thin * 1e3:g} mm is under 4 cells of {dx * 1e3:g} mm; use a smaller dx")
        least = shape.length / 2 - abs(shape.cut)
        if shape.cut != 0 and least < 2 * dx:
            raise SceneError(
                f"shape: the blade at {shape.cut * 1e3:g} mm from the middle leaves a slice of {least * 1e3:.3g} mm, "
                f"under 2 cells of {dx * 1e3:g} mm; cut nearer to the middle or use a smaller dx"
            )
        self.food.check_cells(dx)
        self._check_motion()
        self._check_band()

    @property
    def cuts(self) -> bool:
        """Whether the tool is a knife."""
        return isinstance(self.knife, Knife)

    @property
    def tied(self) -> bool:
        """Whether ties hold the food together across the cut plane, which the edge and the opening cut."""
        return self.cuts and self.numerics.contact == "cohesive"

    @property
    def suction(self) -> float:
        """Largest tension between board and food [Pa]: the board's, where the food stands on a flat face."""
        held = self.numerics.contact == "cohesive" and self.food.shape.stands
        return self.board.suction if held else 0.0

    @property
    def floor(self) -> float:
        """Height of the board under the edge [m]: 0, and less under a food that rests on its ends."""
        return self.board.height(self.food.shape)

    @property
    def tie_strength(self) -> float:
        """Strength of the ties on this grid [Pa] (Material.tie_strength)."""
        return self.food.material.tie_strength(self.numerics.dx / self.numerics.ppc, self.numerics.crack_ties)

    @property
    def weakened(self) -> bool:
        """Whether the ties are weaker than the food, as the grid resolves no more (Material.tie_strength)."""
        return self.tied and self.tie_strength < self.food.material.cohesion

    @property
    def flows_at_its_crack(self) -> bool:
        """Whether the ties are stronger than the food's yield stress, so that it flows at the tip of its crack."""
        return self.tied and self.tie_strength > self.food.material.yield_stress

    def process_zone(self, material: Material) -> float:
        """Width over which the edge's line force is spread while it cuts [m].

        It is ``edge.zone``, and wider where the food would flow under R in place of parting (:meth:`width_of_force`).
        It is no more than half the food's height: a food that bears less is squashed, whatever cuts it. Where the force
        is larger than R, as it is before a cut starts in a skin, the kernels widen it by the same rule.

        Args:
            material: Constants of the food.
        """
        return max(self.edge.zone, self._width_of_cut(material))

    def dent_width(self, material: Material) -> float:
        """Width of the strip of which the indentation is told at which a cut starts [m].

        It is ``edge.dent_width``, and wider where the food would flow under R on that (:meth:`process_zone`).

        Args:
            material: Constants of the food.
        """
        return max(self.edge.dent_width or self.edge.zone, self._width_of_cut(material))

    def _width_of_cut(self, material: Material) -> float:
        return min(material.R * self.width_of_force(material), self.widest_zone)

    def width_of_force(self, material: Material) -> float:
        """Width of food that bears a line force without flowing, over that force [m^2/N].

        A flat punch of that width bears ``edge.bearing`` times the force (:attr:`Material.punch_width`). A skin that is
        pressed in hands the line force of the edge to the flesh over that width.

        Args:
            material: Constants of the food.
        """
        return self.edge.bearing * material.punch_width

    @property
    def widest_zone(self) -> float:
        """Width over which the edge's line force is spread at most [m]."""
        return max(self.edge.zone, self.food.shape.height / 2)

    @property
    def drop(self) -> float:
        """How much lower than its middle the tilted edge gets over the food [m]."""
        return self.lowered(self.motion.tilt)

    def lowered(self, tilt: float, aside: float = 0.0) -> float:
        """How much lower than its middle an edge gets over the food [m].

        Args:
            tilt: Its angle to the board [rad].
            aside: Distance of its middle from the food's along the blade [m].
        """
        if not isinstance(self.knife, Knife):
            return 0.0
        reach = min(self.food.shape.width / 2 + abs(aside), self.knife.length / 2 * math.cos(tilt))
        return reach * math.tan(abs(tilt))

    @property
    def slows_down(self) -> bool:
        """Whether the blade slows down towards the end of its stroke."""
        return self.motion.end_speed < 1 and not self.food.material.relaxes

    @property
    def time_scale(self) -> float:
        """Simulated over real speed of the knife [-]; 1 when the real speed does not matter."""
        speed = self.motion.speed
        return 1.0 if speed is None else self.motion.mach * self.food.material.p_wave / speed

    def _check_motion(self) -> None:
        m, height = self.motion, self.food.shape.height
        if not self.cuts and (m.tilt != 0 or self.numerics.contact != "cohesive"):
            raise SceneError(
                "knife: a press is level and touches particles; leave out motion.tilt and numerics.contact"
            )
        if m.stroke + self.drop > (height - self.floor) * (1 + 1e-9) and (self.arm.rigid or m.tilt != 0):
            raise SceneError(
                f"motion: stroke {m.stroke * 1e3:g} mm goes below the board; the food is {height * 1e3:g} mm high"
                + (f" and the tilted edge reaches {self.drop * 1e3:.1f} mm lower than its middle" if m.tilt else "")
            )
        if self.food.material.rate_dependent and m.speed is None:
            relaxes = self.food.material.relaxes
            raise SceneError(
                f"material: {'relaxation' if relaxes else 'rate_exponent'} makes the force depend on the real speed of "
                "the knife, which is not that of the simulation; give motion.speed [m/s] (--speed)"
                + ("" if relaxes else f", or rate_exponent 0 for a cut at {1e3 * REFERENCE_SPEED:g} mm/s")
            )

    def _check_band(self) -> None:
        m = self.food.material
        if m.strength is None or m.fracture_energy is None:
            return
        band = BAND_CELLS * self.numerics.dx
        limit = 2 * m.E * m.fracture_energy / m.strength**2
        if band >= limit:
            raise SceneError(
                f"bulk damage would snap back (Bazant and Oh 1983): the crack band of {band * 1e3:g} mm must stay "
                f"below 2 E Gf / sigma_t^2 = {limit * 1e3:.3g} mm; use dx < {limit / BAND_CELLS * 1e3:.3g} mm"
            )

    @property
    def mirrors(self) -> tuple[bool, bool]:
        """Whether x = 0 and y = 0 are used as mirrors: only where motion and outline allow and they mirror the grid.

        They do with nodes on them, and x = 0 also half-way between nodes.
        """
        sx, sy, _ = self.numerics.grid_shift
        cohesive = self.numerics.contact == "cohesive"
        on = self.numerics.mirror and self.numerics.grid_turn == 0
        straight = self.motion.slice_ratio == 0 and self.motion.tilt == 0
        along, across = self.food.mirrors
        both = on and straight and along and float(2 * sx).is_integer()
        return both, on and cohesive and across and float(sy).is_integer()

    @property
    def mirrored_between(self) -> bool:
        """Whether x = 0 is a mirror that lies half-way between nodes."""
        return self.mirrors[0] and not float(self.numerics.grid_shift[0]).is_integer()

    @property
    def at_its_speed(self) -> Scene:
        """The same cut of a food whose resistances are those at the real speed of the knife: what the solver takes."""
        if self.food.material.rate_exponent == 0:
            return self
        return replace(self, food=replace(self.food, material=self.food.material.at_speed(self.motion.speed)))

    def with_material(self, **values: Any) -> Scene:
        """The same scene with other material constants."""
        return replace(self, food=replace(self.food, material=replace(self.food.material, **values)))

    def as_dict(self) -> dict[str, Any]:
        """All numbers of the scene as plain data, for provenance and for the key of a stored run."""
        out, outline = asdict(self), self.food.shape.outline
        del out["food"]["shape"]["outline"]
        if outline is not None:
            out["food"]["shape"]["outline"] = outline.as_dict()
        if out["food"]["shape"]["roundness"] is None:
            del out["food"]["shape"]["roundness"]
        if out["board"]["bow"] == 0:
            del out["board"]["bow"]
        for name in ("stone", "cavity", "parted"):
            if not out["food"][name]:  # what a food has not is no part of it
                del out["food"][name]
        if self.motion.end_speed == 1:
            del out["motion"]["end_speed"]
        if not self.food.material.layered:  # nothing else has a use for them
            del out["numerics"]["layer_rows"]
        for name in ("skin_stiffness", "strength_ratio", "rate_exponent"):
            if not out["food"]["material"][name]:
                del out["food"]["material"][name]
        for name in ("rind_stiffness", "core_stiffness"):
            if out["food"]["material"][name] == 1.0:
                del out["food"]["material"][name]
        if not out["food"]["material"]["relaxing_share"]:
            del out["food"]["material"]["relaxing_share"], out["food"]["material"]["relaxation_time"]
        if not out["food"]["material"]["relaxing_bulk"]:
            del out["food"]["material"]["relaxing_bulk"]
        return out
