"""What is simulated: food, knife, board, motion and numerics as frozen, validated data in SI units.

Coordinates: x along the blade, y normal to the blade plane, z up; the board's top is z = 0, the food stands on it
centred on x = y = 0 and the blade plane is y = 0. The stroke is the way of the cutting edge below the food's top.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from mpm.errors import SceneError, check_number
from mpm.material import Material
from mpm.shapes import Shape

CONTACTS = ("cohesive", "nodal")
PRECISIONS = ("f64", "f32")


@dataclass(frozen=True)
class Food:
    """A shape filled with a material."""

    shape: Shape
    material: Material


@dataclass(frozen=True)
class Knife:
    """A straight blade: a wedge of the included angle up to the spine's thickness, parallel above it.

    Attributes: name; spine thickness [m]; included angle of the wedge [rad]; blade height [m]; length along x [m].
    """

    name: str
    spine: float
    angle: float
    height: float
    length: float

    def __post_init__(self) -> None:
        w = f"knife {self.name}"
        check_number(w, "spine", self.spine, 1e-5, 0.1, "m")
        check_number(w, "angle", self.angle, 1e-3, math.pi / 2, "rad")
        check_number(w, "height", self.height, 1e-3, 1.0, "m")
        check_number(w, "length", self.length, 1e-3, 1.0, "m")


@dataclass(frozen=True)
class Board:
    """The board under the food: Coulomb friction coefficient [-]."""

    mu: float = 0.5

    def __post_init__(self) -> None:
        check_number("board", "mu", self.mu, -1e-300, 10.0, "")


@dataclass(frozen=True)
class Motion:
    """A vertical press at constant speed.

    Attributes:
        stroke: Way of the edge below the food's top [m].
        mach: Blade speed over the P-wave speed [-]. All laws here are rate-independent, so the real speed is replaced
            by this one; the force changes by less than 1 % up to 0.01 and by 9 % at 0.035.
    """

    stroke: float
    mach: float = 0.01

    def __post_init__(self) -> None:
        check_number("motion", "stroke", self.stroke, 1e-4, 1.0, "m")
        check_number("motion", "mach", self.mach, 1e-5, 0.1, "")


@dataclass(frozen=True)
class EdgeLaw:
    """Regularisation of the cutting edge, fixed in metres so that the force does not follow the grid.

    Attributes:
        zone: Width of the B-spline over which the edge's line force is spread [m]; at least one cell.
        slip: Slip of the edge in the material at which the line force is fully developed [m].
    """

    zone: float = 3e-3
    slip: float = 1e-3

    def __post_init__(self) -> None:
        check_number("edge", "zone", self.zone, 1e-5, 0.05, "m")
        check_number("edge", "slip", self.slip, 1e-5, 0.05, "m")


@dataclass(frozen=True)
class Numerics:
    """How the scene is discretised.

    Attributes:
        dx: Cell size [m].
        ppc: Particles per cell and direction.
        contact: ``cohesive`` (edge law and particle contact) or ``nodal`` (the plain projection of grid velocities).
        grid_shift: Position of the grid against the scene along x, y, z [cells].
        mirror: Use the mirror planes x = 0 and y = 0 where the grid lies on them.
        seed: Seed of the particle positions.
        safety: dt over the stability limit of a lone particle [-].
        gravity: Acceleration of gravity [m/s^2].
        output: Stroke between two rows of the record [m].
        precision: ``f64`` or ``f32`` state.
    """

    dx: float = 2.5e-3
    ppc: int = 2
    contact: str = "cohesive"
    grid_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mirror: bool = True
    seed: int = 0
    safety: float = 0.5
    gravity: float = 9.81
    output: float = 0.25e-3
    precision: str = "f64"

    def __post_init__(self) -> None:
        w = "numerics"
        check_number(w, "dx", self.dx, 1e-5, 0.05, "m")
        check_number(w, "ppc", self.ppc, 0.5, 8.5, "")
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
    knife: Knife
    motion: Motion
    board: Board = field(default_factory=Board)
    edge: EdgeLaw = field(default_factory=EdgeLaw)
    numerics: Numerics = field(default_factory=Numerics)

    def __post_init__(self) -> None:
        dx, shape = self.numerics.dx, self.food.shape
        if self.numerics.contact == "cohesive" and self.edge.zone < dx * (1 - 1e-9):
            raise SceneError(
                f"edge: process zone {self.edge.zone * 1e3:g} mm is narrower than the cell {dx * 1e3:g} mm, so the edge "
                f"would fall between nodes; use dx <= {self.edge.zone * 1e3:g} mm"
            )
        thin = min(shape.length, shape.width, shape.height)
        if thin < 4 * dx:
            raise SceneError(f"shape: {thin * 1e3:g} mm is under 4 cells of {dx * 1e3:g} mm; use a smaller dx")
        if self.motion.stroke > shape.height * (1 + 1e-9):
            raise SceneError(
                f"motion: stroke {self.motion.stroke * 1e3:g} mm goes below the board; the food is "
                f"{shape.height * 1e3:g} mm high"
            )
        self._check_band()

    def _check_band(self) -> None:
        m = self.food.material
        if m.tensile_strength is None or m.fracture_energy is None:
            return
        band = BAND_CELLS * self.numerics.dx
        limit = 2 * m.E * m.fracture_energy / m.tensile_strength**2
        if band >= limit:
            raise SceneError(
                f"bulk damage would snap back (Bazant and Oh 1983): the crack band of {band * 1e3:g} mm must stay below "
                f"2 E Gf / sigma_t^2 = {limit * 1e3:.3g} mm; use dx < {limit / BAND_CELLS * 1e3:.3g} mm"
            )

    @property
    def mirrors(self) -> tuple[bool, bool]:
        """Whether the planes x = 0 and y = 0 are used as mirrors: only when nodes lie on them."""
        sx, sy, _ = self.numerics.grid_shift
        cohesive = self.numerics.contact == "cohesive"
        on = self.numerics.mirror
        return on and float(sx).is_integer(), on and cohesive and float(sy).is_integer()

    def with_material(self, **values: float) -> Scene:
        """The same scene with other material constants."""
        return replace(self, food=replace(self.food, material=replace(self.food.material, **values)))

    def as_dict(self) -> dict[str, Any]:
        """All numbers of the scene as plain data, for provenance and for the key of a stored run."""
        return asdict(self)


BAND_CELLS = (
    2.5  # width of a crack band of grid-smoothed damage, in cells (measured: dissipation within 15 % over dx x 4)
)
