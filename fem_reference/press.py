"""A food pressed quasi-statically on its board by a plate or wedge: force over stroke."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference.contact import Contact, Obstacle, Plane, Wedge
from fem_reference.laws import Corotated, Graded, Law, Plastic
from fem_reference.meshes import MeshError, quarter, surface
from fem_reference.solid import EquilibriumError, Solid
from mpm.scene.layers import layer_stiffness
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

STIFF = 100.0  # penalty of a contact over the modulus of the food and the size of its elements
SHARP = 1e-4  # penetration that is small enough, over the size of the elements
STEP = 0.25  # way of the tool in a load step, over the size of the elements
HALVINGS = 4  # how often a load step that fails is halved


@dataclass(frozen=True)
class Elements:
    """Hexahedra of a quarter of a food.

    Attributes:
        cells: Elements along half the height.
        order: Order of the elements, 1 or 2.
        grade: Power by which they shrink towards the axis, 1 for none.
        mixed: Whether the change of volume is taken from its linear projection in each element, which needs order 2.
            Without it foods with a Poisson's ratio near 0.5, and foods that flow, are too stiff where they are bonded.
    """

    cells: int = 6
    order: int = 1
    grade: float = 1.0
    mixed: bool = False


@dataclass(frozen=True, eq=False)
class Curve:
    """Force over stroke.

    Attributes:
        stroke: Way of the tool below the food's top [m], shape (n,).
        force: Force of the food on the tool, upwards, of the whole food [N], shape (n,).
        board: Force on the board, downwards, of the whole food [N], shape (n,).
        penetration: Deepest penetration of tool or board [m], shape (n,).
        unknowns: Displacements of the model.
    """

    stroke: np.ndarray
    force: np.ndarray
    board: np.ndarray
    penetration: np.ndarray
    unknowns: int


DEFAULT = Elements()


def law_of(material: Material) -> Law:
    """The material's law: the particles' elasticity, with their yield stress where there is one."""
    if math.isinf(material.yield_stress):
        return Corotated(material.shear, material.lame)
    return Plastic(material.shear, material.lame, material.yield_stress)


def press(
    shape: Shape,
    material: Material,
    strokes: Sequence[float],
    *,
    half_angle: float = math.pi / 2,
    bonded: bool = False,
    elements: Elements = DEFAULT,
    law: Law | None = None,
) -> Curve:
    """Press a food down.

    Args:
        shape: Outline of the food.
        material: Its constants; layers of their own stiffness are looked up at the quadrature points.
        strokes: Ways of the tool below the food's top at which the force is wanted [m], rising, the first above 0.
        half_angle: Angle between the faces of the wedge and the vertical [rad]; a plate at pi / 2.
        bonded: Whether flat ends stick to plate and board; without that there is no friction.
        elements: Mesh and elements.
        law: Another law than the particles'.

    Returns:
        Force over stroke.

    Raises:
        MeshError: A shape without a mesh, or a bonded shape without flat ends.
        EquilibriumError: No equilibrium even in small steps; the message says where.
    """
    core = material.core_ratio if material.core_stiffness != 1 and shape.kind.endswith("cylinder") else 0.0
    mesh = quarter(shape, elements.cells, elements.grade, elements.order, core or None)
    flat = shape.kind in ("block", "upright_cylinder")
    if bonded and (not flat or half_angle < math.pi / 2):
        raise MeshError(f"press: a {shape.kind} under this tool has no flat ends to bond; leave out bonded")
    solid = Solid(mesh, law or law_of(material), elements.order, elements.mixed)
    if material.graded:
        places = np.moveaxis(solid.places, 0, -1)
        factor = layer_stiffness(shape, material, 0.0, places.reshape(-1, 3)).reshape(places.shape[:-1])
        solid.law = Graded(solid.law, factor)
    h, size = shape.height, shape.height / (2 * elements.cells)
    x, y, z = solid.nodes.T
    near = 1e-6 * h
    for axis, place in ((0, x), (1, y)):
        solid.hold(np.flatnonzero(np.abs(place) < near), [axis])
    ends = [np.flatnonzero(np.abs(z - level) < near) for level in (0.0, h)]
    penalty, tolerance = STIFF * material.E / size, SHARP * size
    plate, wedge = Plane((0, 0, h), (0, 0, -1)), Wedge(h, half_angle)
    tool: Obstacle = plate if half_angle == math.pi / 2 else wedge
    if bonded:
        solid.hold(ends[0], [0, 1, 2])
        solid.hold(ends[1], [0, 1])
    else:
        lowest = ends[0] if flat else np.flatnonzero((np.abs(x) < near) & (np.abs(z) < near))
        solid.hold(lowest, [2])
        upper = _skin(solid, lambda p: p[2] > h * (1 - near) if flat else p[2] > h / 2)
        solid.contacts.append(Contact(tool, *upper, penalty, tolerance))
        if not flat:
            nodes, areas = _skin(solid, lambda p: p[2] < h / 2)
            other = ~np.isin(nodes, lowest)
            solid.contacts.append(Contact(Plane((0, 0, 0), (0, 0, 1)), nodes[other], areas[other], penalty, tolerance))

    def to(way: float) -> None:
        if bonded:
            solid.hold(ends[1], [2], -way)
        plate.point, wedge.height = (0.0, 0.0, h - way), h - way
        solid.solve()

    rows: list[tuple[float, float, float, float]] = []
    for way in strokes:
        done = rows[-1][0] if rows else 0.0
        parts = math.ceil((way - done) / (STEP * size))
        for k in range(parts):
            advance(to, done + (way - done) * k / parts, done + (way - done) * (k + 1) / parts)
        at = solid.nodes + solid.u
        if bonded:
            force, board = -solid.reaction(ends[1])[2], solid.reaction(ends[0])[2]
        else:
            pushed = [float(c.force(at)[:, 2].sum()) for c in solid.contacts]
            force, board = -pushed[0], solid.reaction(lowest)[2] + sum(pushed[1:])
        rows.append((way, 4 * force, 4 * board, max((c.penetration(at) for c in solid.contacts), default=0.0)))
    stroke, forces, boards, deepest = np.array(rows).T
    return Curve(stroke, forces, boards, deepest, solid.u.size)


def advance(to: Callable[[float], None], done: float, way: float, halvings: int = HALVINGS) -> None:
    """Move a tool; a step that finds no equilibrium is done in two halves.

    Args:
        to: Moves the tool to a way and finds equilibrium.
        done: Way of the last equilibrium [m].
        way: Way to go to [m].
        halvings: How often a step may be halved.

    Raises:
        EquilibriumError: No equilibrium even in small steps; the message says where.
    """
    try:
        to(way)
    except EquilibriumError as e:
        if halvings == 0:
            raise EquilibriumError(f"{e} (tool at {way * 1e3:.3g} mm)") from e
        middle = 0.5 * (done + way)
        advance(to, done, middle, halvings - 1)
        advance(to, middle, way, halvings - 1)


def _skin(solid: Solid, where: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the food's outside that satisfy a condition, without the planes of symmetry, and their areas [m^2]."""
    near = 1e-6 * np.ptp(solid.mesh.p)
    facets = surface(solid.mesh, lambda p: where(p) & (p[0] > near) & (p[1] > near))
    return solid.areas(facets)
