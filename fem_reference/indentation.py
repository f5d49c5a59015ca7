"""A wedge pressed into a block by elements that are small where it touches: the reference for J2 flow under a tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import skfem as sk

from fem_reference.contact import Wedge
from fem_reference.meshes import MeshError, box, graded, surface
from fem_reference.press import Curve, advance, law_of
from fem_reference.solid import Solid
from fem_reference.surface import SlidingContact, sampled
from mpm.material import Material
from mpm.shapes import Shape

PENALTY = 10.0  # stiffness of contact over the P-wave modulus and the elements' size
SAMPLES = 4  # points of contact along each edge of an element
STEP = 0.25  # way of the wedge in a step over the elements' size
BALANCE = 1e-6  # forces out of balance that are small enough, over those in the solid


@dataclass(frozen=True)
class Mesh:
    """Elements of a quarter of the block; of order 2 and mixed, so that they do not lock.

    Attributes:
        size: Their size under the wedge's edge [m].
        growth: Size of each over that of its neighbour nearer to the edge.
        layers: Elements along half the wedge; 0 for a section in plane strain, whose forces are per metre of width.
    """

    size: float
    growth: float = 1.3
    layers: int = 3


def indent(block: Shape, material: Material, half_angle: float, strokes: Sequence[float], mesh: Mesh) -> Curve:
    """Press a wedge without friction into the top of a block that stands on a smooth board.

    Unlike :func:`fem_reference.press.press`, which touches nodes, the wedge touches points within the elements, so that
    the force does not jump as it reaches the next row of nodes.

    Args:
        block: Outline, a block.
        material: Its constants; it may flow.
        half_angle: Angle between the wedge's faces and the vertical [rad].
        strokes: Ways of the edge below the top at which the force is wanted [m], rising, the first above 0.
        mesh: Elements.

    Returns:
        Force over stroke, of the whole block, or of a section per metre of width [N/m].

    Raises:
        MeshError: The shape is no block.
        EquilibriumError: No equilibrium even in small steps; the message says where.
    """
    if block.kind != "block" or block.cut != 0:
        raise MeshError(f"indent: a wedge indents a block, not a {block.kind}; use press")
    h = block.height
    up = h - graded(h, mesh.size, mesh.growth)[::-1]
    across = graded(block.length / 2, mesh.size, mesh.growth)
    cells: sk.Mesh = sk.MeshQuad.init_tensor(across, up)
    if mesh.layers:
        cells = box(np.linspace(0, block.width / 2, mesh.layers + 1), across, up)
    solid = Solid(cells, law_of(material), 2, True, BALANCE)
    x, y, z = solid.nodes.T
    parts = 4 if mesh.layers else 2
    near = 1e-6 * h
    solid.hold(np.flatnonzero(x < near), [0])
    solid.hold(np.flatnonzero(y < near), [1])
    base = np.flatnonzero(z < near)
    solid.hold(base, [2])
    wedge = Wedge(h, half_angle, single=True)
    top = sampled(solid, surface(cells, lambda p: p[-1] > h - near), SAMPLES)
    contact = SlidingContact(top, wedge, PENALTY * (material.lame + 2 * material.shear) / mesh.size)
    solid.surfaces.append(contact)

    def to(way: float) -> None:
        wedge.height = h - way
        solid.solve()

    rows, done = [], 0.0
    for way in strokes:
        for part in np.linspace(done, way, 1 + int(np.ceil((way - done) / (STEP * mesh.size))))[1:]:
            advance(to, done, part)
            done = float(part)
        at = solid.nodes + solid.u
        force = -parts * float(contact.tractions(at)[:, 2].sum())
        rows.append((way, force, parts * float(solid.reaction(base)[2]), contact.penetration(at)))
    stroke, forces, boards, deepest = np.array(rows).T
    return Curve(stroke, forces, boards, deepest, solid.u.size)
