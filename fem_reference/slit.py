"""A blade that is pushed into a block along a slit which opens ahead of its edge: the force on its faces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fem_reference.contact import Contact, Plane, Wedge
from fem_reference.meshes import box, surface
from fem_reference.press import SHARP, STIFF, law_of
from fem_reference.solid import Solid
from mpm.material import Material
from mpm.scene import Knife
from mpm.shapes import Shape

LAYERS = 3  # elements over half the width
ACROSS = 12  # elements over half the length, smaller near the slit
GRADE = 2.0


@dataclass(frozen=True, eq=False)
class Opening:
    """Force over stroke. Attributes: stroke [m], force upwards on both faces of the blade [N], shape (n,); unknowns."""

    stroke: np.ndarray
    force: np.ndarray
    unknowns: int


def cleave(block: Shape, material: Material, knife: Knife, lead: float, stroke: float, *, cells: int = 2) -> Opening:
    """Push a blade into a block whose halves part at a fixed way ahead of the edge, without friction.

    The halves are held together below the slit and free above; nothing is spent on parting them.

    Args:
        block: Outline, a block.
        material: Its constants.
        knife: A sharp blade.
        lead: Way of the slit's end ahead of the edge [m].
        stroke: Way of the edge into the block [m]; rounded to whole elements.
        cells: Elements over the lead; all elements are as high, and the slit ends at their nodes.

    Raises:
        EquilibriumError: No equilibrium.
    """
    size, h = lead / cells, block.height
    rows = round(h / size)
    across = block.length / 2 * np.linspace(0, 1, ACROSS + 1) ** GRADE
    mesh = box(np.linspace(0, block.width / 2, LAYERS + 1), across, np.linspace(0, h, rows + 1))
    solid = Solid(mesh, law_of(material))
    x, y, z = solid.nodes.T
    near = 1e-6 * h
    solid.hold(np.flatnonzero(x < near), [0])
    solid.hold(np.flatnonzero((y < near) & (z < near)), [2])
    penalty, tolerance = STIFF * material.E / size, SHARP * size
    wedge = Wedge(h, knife.angle / 2, knife.spine)
    nodes, areas = solid.areas(surface(mesh, lambda p: p[1] < near))
    blade = Contact(wedge, nodes, areas, penalty, tolerance)
    floor, under = solid.areas(surface(mesh, lambda p: p[2] < near))
    solid.contacts += [blade, Contact(Plane((0, 0, 0), (0, 0, 1)), floor, under, penalty, tolerance)]
    middle = np.flatnonzero(y < near)
    whole = {3 * int(k) + 1: z[k] for k in middle}
    strokes, forces = [], []
    for k in range(1, math.floor(stroke / size + 1e-9) + 1):
        way = k * size
        wedge.height = h - way
        end = max(h - way - lead, 0.0)
        for unknown, height in whole.items():
            if height <= end + near:
                solid.fixed[unknown] = 0.0
            else:
                solid.fixed.pop(unknown, None)
        solid.solve()
        strokes.append(way)
        forces.append(-4 * float(blade.force(solid.nodes + solid.u)[:, 2].sum()))
    return Opening(np.array(strokes), np.array(forces), solid.u.size)
