"""What is simulated: food, knife, board, motion and numerics as frozen, validated data in SI units.

Coordinates: x along the blade, y normal to the blade plane, z up; the board's top is z = 0, the food stands on it
centred on x = y = 0 and the blade plane is y = 0. The stroke is the way of the cutting edge below the food's top.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from mpm.errors import SceneError
from mpm.shapes import SHAPE_KINDS

CONTACTS = ("cohesive", "nodal")
PRECISIONS = ("f64", "f32")
MAX_POISSON = 0.49  # above it a single-field quadratic MPM locks volumetrically and dt falls as sqrt(1 - 2 nu)


def _number(where: str, name: str, value: float, low: float, high: float, unit: str) -> None:
    """Raise SceneError unless ``low < value < high`` (both open) and ``value`` is a finite number."""
    ok = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if not ok or not low < value < high:
        raise SceneError(f"{where}: {name} = {value!r} {unit} must be a number between {low:g} and {high:g} {unit}")


@dataclass(frozen=True)
class Material:
    """Constants of one food.

    Attributes:
        E: Young's modulus [Pa].
        nu: Poisson's ratio [-].
        rho: Density [kg/m^3].
        yield_stress: von Mises yield stress (Kirchhoff) [Pa]; ``inf`` keeps the food elastic.
        R: Cutting (propagation) resistance of the flesh [J/m^2 = N/m] (Atkins 2009, "The Science of Cutting").
        R_initiation: Force per width at which a cut starts in bare flesh [N/m]; at least R.
        R_skin: Force per width at which the edge goes through the skin [N/m].
        skin_thickness: Thickness of the skin [m]; 0 = no skin.
        initiation_depth: Indentation under the edge at which a cut starts [m]; soft solids go deep before a cut
            nucleates (Reyssat et al. 2012, Phys. Rev. Lett. 109:244301).
        mu: Coulomb friction of food on the blade's faces [-].
        tensile_strength: Stress at which bulk damage starts [Pa], or None.
        fracture_energy: Energy per crack area of bulk damage [J/m^2], or None. Both or none.
        loss_factor: Mechanical loss factor tan(delta) [-] at the first axial mode of the specimen, Kelvin-Voigt. Apple
            tissue loses 0.13-0.4 of the energy of a cycle (J. Texture Stud. 14:155, 1983), i.e. about 0.04-0.13.
    """

    E: float
    nu: float
    rho: float
    yield_stress: float = math.inf
    R: float = 0.0
    R_initiation: float | None = None
    R_skin: float | None = None
    skin_thickness: float = 0.0
    initiation_depth: float = 1e-3
    mu: float = 0.0
    tensile_strength: float | None = None
    fracture_energy: float | None = None
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        w = "material"
        _number(w, "E", self.E, 0.0, 1e12, "Pa")
        if not (isinstance(self.nu, (int, float)) and -1.0 < self.nu <= MAX_POISSON):
            raise SceneError(
                f"material: nu = {self.nu!r} must lie in (-1, {MAX_POISSON}]; an isotropic solid has nu < 0.5 and the "
                f"solver locks above {MAX_POISSON}"
            )
        _number(w, "rho", self.rho, 0.0, 1e5, "kg/m^3")
        if self.yield_stress != math.inf:
            _number(w, "yield_stress", self.yield_stress, 0.0, 1e12, "Pa")
        for name, unit in (("R", "J/m^2"), ("skin_thickness", "m"), ("mu", ""), ("loss_factor", "")):
            _number(w, name, getattr(self, name), -1e-300, 1e6, unit)
        _number(w, "initiation_depth", self.initiation_depth, 1e-5, 0.1, "m")
        for name in ("R_initiation", "R_skin"):
            if getattr(self, name) is not None:
                _number(w, name, getattr(self, name), -1e-300, 1e6, "N/m")
        if (self.tensile_strength is None) != (self.fracture_energy is None):
            raise SceneError(
                "material: tensile_strength and fracture_energy make bulk damage together; give both or none"
            )
        if self.tensile_strength is not None and self.fracture_energy is not None:
            _number(w, "tensile_strength", self.tensile_strength, 0.0, 1e12, "Pa")
            _number(w, "fracture_energy", self.fracture_energy, 0.0, 1e9, "J/m^2")
        if self.skin_thickness > 0 and self.R_skin is None:
            raise SceneError(
                "material: skin_thickness > 0 needs R_skin, the force per width that goes through the skin"
            )

    @property
    def shear(self) -> float:
        """Shear modulus mu = E / (2 (1 + nu)) [Pa]."""
        return self.E / (2 * (1 + self.nu))

    @property
    def lame(self) -> float:
        """First Lame constant [Pa]."""
        return self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))

    @property
    def start(self) -> float:
        """Force per width at which a cut starts: that of the skin where there is one, never below R [N/m]."""
        threshold = self.R_skin if self.skin_thickness > 0 else self.R_initiation
        return max(self.R, threshold or 0.0)

    @property
    def p_wave(self) -> float:
        """Speed of longitudinal waves sqrt((lambda + 2 mu) / rho) [m/s]."""
        return math.sqrt((self.lame + 2 * self.shear) / self.rho)

    @property
    def stability_speed(self) -> float:
        """Speed that bounds dt [m/s]: sqrt(max(3 K, lambda + 2 mu) / rho).

        A lone particle of quadratic MLS-MPM has the highest frequency (2/dx) sqrt(3 K / rho), above that of the bulk.
        """
        bulk3 = 3 * self.lame + 2 * self.shear
        return math.sqrt(max(bulk3, self.lame + 2 * self.shear) / self.rho)


@dataclass(frozen=True)
class Shape:
    """Outline of the food. Attributes: kind, length along y [m], width along x [m], height along z [m]."""

    kind: str
    length: float
    width: float
    height: float

    def __post_init__(self) -> None:
        if self.kind not in SHAPE_KINDS:
            raise SceneError(f"shape: unknown kind {self.kind!r}; one of {', '.join(SHAPE_KINDS)}")
        for name in ("length", "width", "height"):
            _number("shape", name, getattr(self, name), 1e-3, 1.0, "m")


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
        _number(w, "spine", self.spine, 1e-5, 0.1, "m")
        _number(w, "angle", self.angle, 1e-3, math.pi / 2, "rad")
        _number(w, "height", self.height, 1e-3, 1.0, "m")
        _number(w, "length", self.length, 1e-3, 1.0, "m")


@dataclass(frozen=True)
class Board:
    """The board under the food: Coulomb friction coefficient [-]."""

    mu: float = 0.5

    def __post_init__(self) -> None:
        _number("board", "mu", self.mu, -1e-300, 10.0, "")


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
        _number("motion", "stroke", self.stroke, 1e-4, 1.0, "m")
        _number("motion", "mach", self.mach, 1e-5, 0.1, "")


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
        _number("edge", "zone", self.zone, 1e-5, 0.05, "m")
        _number("edge", "slip", self.slip, 1e-5, 0.05, "m")


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
        _number(w, "dx", self.dx, 1e-5, 0.05, "m")
        _number(w, "ppc", self.ppc, 0.5, 8.5, "")
        _number(w, "safety", self.safety, 0.0, 0.9001, "of the stability limit")
        _number(w, "output", self.output, 0.0, 0.1, "m")
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
