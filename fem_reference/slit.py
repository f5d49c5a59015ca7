"""A blade in a block whose halves part at a prescribed way ahead of its edge: bookkeeping of the faces' force.

The lead is an input. It is that of the particle solver's own edge law, so that this reference repeats the assumption
and can't judge it: it checks contact, elasticity and the energy that a given opening releases, no more. What a crack
does by itself, :mod:`fem_reference.cutting.wedge` says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fem_reference.contact import Contact, Plane, Wedge
from fem_reference.laws import Corotated
from fem_reference.meshes import box, surface
from fem_reference.press import SHARP, STIFF
from fem_reference.solid import EquilibriumError, Solid
from mpm.scene import Knife
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

LAYERS = 3  # elements over half the width
ACROSS = 12  # elements over half the length, smaller near the slit
GRADE = 2.0
RISES = 20  # renewals of the blade's place while the end of the slit rises
SETTLED = 1e-2  # change of that rise that is small enough, over the height of an element


@dataclass(frozen=True, eq=False)
class Opening:
    """Force and energy over stroke.

    Attributes:
        stroke: Way of the edge below the top [m], shape (n,).
        force: Force upwards on both faces of the blade [N], shape (n,).
        rise: How far the end of the slit has risen [m], shape (n,).
        stored: Elastic energy of the block [J], shape (n,).
        unknowns: Number of unknown displacements.
    """

    stroke: np.ndarray
    force: np.ndarray
    rise: np.ndarray
    stored: np.ndarray
    unknowns: int

    @property
    def released(self) -> np.ndarray:
        """Energy that the parting at the end of the slit has released so far [J], shape (n,): work less what is
        stored."""
        steps = np.diff(self.stroke, prepend=0.0)
        return np.cumsum(steps * (self.force + np.append(0.0, self.force[:-1])) / 2) - self.stored


def cleave(block: Shape, material: Material, knife: Knife, lead: float, stroke: float, *, cells: int = 2) -> Opening:
    """Push a blade into a block whose halves part at a fixed way ahead of the edge, without friction.

    The halves are held together below the slit and free above; nothing is spent on parting them, and the slit's end is
    where the caller puts it, not where a crack would stop. The block stands on a smooth floor. Its halves turn
    outwards, so the lower outer edges carry it and its middle rises from the floor; the way between the slit's end and
    the edge is that of the deformed block.

    Args:
        block: Outline, a block.
        material: Its elastic constants.
        knife: A sharp blade.
        lead: Way of the slit's end ahead of the edge [m].
        stroke: Way of the edge into the block [m]; the last that ends the slit at a node is less.
        cells: Elements over the lead; all elements are as high, and the slit ends at their nodes.

    Returns:
        Force and energy over stroke.

    Raises:
        EquilibriumError: No equilibrium.
    """
    size, h = lead / cells, block.height
    rows = round(h / size)
    across = block.length / 2 * np.linspace(0, 1, ACROSS + 1) ** GRADE
    mesh = box(np.linspace(0, block.width / 2, LAYERS + 1), across, np.linspace(0, h, rows + 1))
    law = Corotated(material.shear, material.lame)
    solid = Solid(mesh, law)
    x, y, z = solid.nodes.T
    near = 1e-6 * h
    solid.hold(np.flatnonzero(x < near), [0])
    solid.hold(np.flatnonzero((y > block.length / 2 - near) & (z < near)), [2])
    penalty, tolerance = STIFF * material.E / size, SHARP * size
    wedge = Wedge(h, knife.angle / 2, knife.spine)
    nodes, areas = solid.areas(surface(mesh, lambda p: p[1] < near))
    blade = Contact(wedge, nodes, areas, penalty, tolerance)
    floor, under = solid.areas(surface(mesh, lambda p: p[2] < near))
    solid.contacts += [blade, Contact(Plane((0, 0, 0), (0, 0, 1)), floor, under, penalty, tolerance)]
    middle = np.flatnonzero(y < near)
    whole = {3 * int(k) + 1: z[k] for k in middle}
    strokes, forces, rises, stored = [], [], [], []
    for end in h - lead - size * np.arange(1, math.floor(stroke / size + 1e-9) + 1):
        for unknown, height in whole.items():
            if height <= end + near:
                solid.fixed[unknown] = 0.0
            else:
                solid.fixed.pop(unknown, None)
        tip = middle[np.abs(z[middle] - end) < near]
        for _ in range(RISES):
            risen = float(solid.u[tip, 2].mean())
            wedge.height = end + risen + lead
            solid.solve()
            if abs(float(solid.u[tip, 2].mean()) - risen) < SETTLED * size:
                break
        else:
            raise EquilibriumError("finite elements: the end of the slit and the edge do not settle; use more cells")
        strokes.append(h - wedge.height)
        rises.append(risen)
        forces.append(-4 * float(blade.force(solid.nodes + solid.u)[:, 2].sum()))
        stored.append(4 * float((law.energy(solid.deformation(solid.u)) * solid.weights).sum()))
    return Opening(np.array(strokes), np.array(forces), np.array(rises), np.array(stored), solid.u.size)
