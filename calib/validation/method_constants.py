"""The constants of the method: numbers that nobody measured on the food, and what halving or doubling each does."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

from mpm.scene import Scene


def _crack_is_sharp(scene: Scene) -> bool:
    """Whether the process zone of the food's crack spans less than twice the least number of ties."""
    return replace(scene, numerics=replace(scene.numerics, crack_ties=2 * scene.numerics.crack_ties)).weakened


@dataclass(frozen=True)
class MethodConstant:
    """A number of the method that could move a force.

    Attributes:
        name: What it is.
        part: Part of a scene that holds it: ``edge``, ``numerics``, ``board`` or ``material``.
        key: Its name in documents and options, and there unless ``field`` says another.
        factors: By how much it is varied; a factor that cannot be simulated is left out, and ``why`` says so.
        source: Where its value is from.
        why: Why not both half and twice; empty where it is both.
        field: Its name in that part of a scene; empty where it is the key.
        where: Says of a scene whether the number has a part in it; by default it has.
    """

    name: str
    part: str
    key: str
    factors: tuple[float, ...]
    source: str
    why: str = ""
    field: str = ""
    where: Callable[[Scene], bool] | None = None

    def value(self, scene: Scene) -> float:
        """Its value in a scene [SI]; 0 where it has no part in it."""
        if self.where is not None and not self.where(scene):
            return 0.0
        return float(getattr(self._holder(scene), self._field))

    def varied(self, scene: Scene, factor: float) -> Scene:
        """The scene with another value of it; the same scene where it is nothing.

        Args:
            scene: A scene.
            factor: Of its value.
        """
        return self.put(scene, factor * self.value(scene))

    def put(self, scene: Scene, value: float) -> Scene:
        """The scene with a value of it.

        Args:
            scene: A scene.
            value: The value [SI].
        """
        new = {self._field: round(value) if isinstance(getattr(self._holder(scene), self._field), int) else value}
        if self.part == "material":
            return scene.with_material(**new)
        return replace(scene, **{self.part: replace(getattr(scene, self.part), **new)})

    @property
    def _field(self) -> str:
        return self.field or self.key

    def _holder(self, scene: Scene) -> object:
        return scene.food.material if self.part == "material" else getattr(scene, self.part)


CONSTANTS = (
    MethodConstant(
        "process zone", "edge", "zone", (2.0,), "numerical: as wide as the cells allow",
        "half of it is narrower than a cell",
    ),
    MethodConstant(
        "bearing of the process zone", "edge", "bearing", (2.0,),
        "plastic collapse under a punch of the zone's width, and a quarter more",
        "half of it is less than R, and the food flows along with the edge",
    ),
    MethodConstant("slip of the edge", "edge", "slip", (0.5, 2.0), "numerical: elastic way of the edge's law"),
    MethodConstant(
        "contact stiffness", "numerics", "contact_stiffness", (2.0,),
        "numerical: above the bound of Nitsche's method, 1.5 layers of particles", "half of it is below that bound",
    ),
    MethodConstant(
        "band of the edge", "numerics", "edge_band", (0.5, 2.0),
        "numerical: a quarter of the particles' spacing, as far apart as the points of a face are",
    ),
    MethodConstant(
        "nodes that follow", "numerics", "extension", (0.5, 2.0),
        "numerical: part of the mass of the nodes inside, below which a node follows them",
    ),
    MethodConstant(
        "ties of a crack's process zone", "numerics", "crack_ties", (0.5, 2.0),
        "numerical: where the food's own zone is shorter it is made weaker, at the same R (Turon et al. 2007)",
        where=_crack_is_sharp,
    ),
    MethodConstant(
        "rows of a tie", "numerics", "layer_rows", (0.5, 2.0),
        "numerical: parts of a particle's spacing in which the toughness of a food of layers is looked up",
        where=lambda scene: scene.food.material.layered,
    ),
    MethodConstant(
        "least gap to a surface", "numerics", "least_gap", (0.5, 2.0),
        "numerical: keeps the centre of a particle that is squeezed flat inside the food",
    ),
    MethodConstant(
        "mass of the dampers", "numerics", "damper_mass", (0.5, 2.0),
        "numerical: halves which rub do not chatter, and from here on the work no longer depends on it",
    ),
    MethodConstant(
        "process zone of a food without strength", "material", "cohesive_zone", (0.5, 2.0),
        "assumed, where the food has no strength (materials.yaml has one for every food)",
        where=lambda scene: scene.food.material.strength is None,
    ),
    MethodConstant(
        "friction of the board", "board", "board_friction", (0.5, 2.0),
        "a food's (materials.yaml), where it is not fitted; the halves slide on it as a thick blade parts them",
        field="mu",
    ),
    MethodConstant(
        "suction of the board", "board", "board_suction", (0.5, 2.0),
        "a food's that stands on a flat face (materials.yaml), where it is not fitted; it keeps the halves down",
        field="suction",
        where=lambda scene: scene.suction > 0,
    ),
    MethodConstant(
        "time step", "numerics", "safety", (0.5,), "numerical: part of the stability limit",
        "twice of it is beyond that limit",
    ),
    MethodConstant(
        "loss factor", "material", "loss_factor", (0.5, 2.0),
        "of the food, where literature has it (materials.yaml); assumed elsewhere",
    ),
)  # fmt: skip
"""Those of a cut. Cell, particles and speed have checks of their own. The friction of a face is at most the yield
stress in shear (Orowan 1943), which is a law and no constant."""


def aside(scene: Scene) -> Scene:
    """The scene with the blade half-way between two planes of nodes."""
    x, y, z = scene.numerics.grid_shift
    return replace(scene, numerics=replace(scene.numerics, grid_shift=(x, y + 0.5, z)))


def varied(scene: Scene, fitted: Collection[str] = ()) -> Mapping[str, Scene]:
    """A scene with each constant of the method halved and doubled where that can be, by what was changed.

    Args:
        scene: A scene.
        fitted: Names of what the trace was asked for: whatever is fitted has an interval, and is no constant.

    Returns:
        Other scenes; what is nothing in the scene (a loss factor of 0) is not varied.
    """
    words = {0.5: "half", 2.0: "twice"}
    out = {
        f"{words[factor]} the {constant.name}": constant.varied(scene, factor)
        for constant in CONSTANTS
        if constant.key not in fitted and constant.value(scene) != 0
        for factor in constant.factors
    }
    return out | {"blade half a cell aside": aside(scene)}
