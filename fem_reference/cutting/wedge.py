"""A blade driven into a block along a plane that parts by a cohesive law: no prescribed lead of the crack.

Quasi-static, in plane strain or, for a block of a given width, in space; force over stroke. The independent reference
of the particles' crack.
"""

from __future__ import annotations

from fem_reference.cutting.case import Blade, Block, Cut, Grid, Interface
from fem_reference.cutting.model import CutModel

__all__ = ["Blade", "Block", "Cut", "Grid", "Interface", "cut", "split"]


def cut(block: Block, blade: Blade, interface: Interface, depth: float, grid: Grid) -> Cut:
    """Cut a block in its middle: the edge pays what the opening has not.

    The plane of the cut is a cohesive tie from the beginning (:class:`fem_reference.cutting.cohesive.CutPlane`). Each
    point of it costs R in all: the tie takes what the opening ahead of the edge takes, and the edge the rest as it
    passes. Where the crack's tip is, is a result. Newton's method with halved steps; where the crack runs by itself,
    proximal steps find the next equilibrium at rest.

    Args:
        block: The food.
        blade: The blade; its faces touch the food above the edge.
        interface: What holds the halves together.
        depth: Stroke at the end [m].
        grid: Elements.

    Returns:
        Forces, energies and the crack over the stroke.

    Raises:
        EquilibriumError: No equilibrium; the message says at which stroke.
    """
    return CutModel(block, blade, interface, grid).run(depth)


def split(
    beam: Block, blade: Blade, interface: Interface, depth: float, grid: Grid, *, notch: float | None = None
) -> Cut:
    """Drive a wedge into a beam that is split already: the edge stays in the crack and cuts nothing.

    Args:
        beam: A standing block, usually held at its base; each half of its length is an arm.
        blade: The wedge.
        interface: What holds the arms together.
        depth: Stroke of the edge at the end [m].
        grid: Elements.
        notch: Depth of the split at the beginning [m]; None: half a shoulder's height more than the shoulder.

    Returns:
        Forces, energies and the crack over the stroke.

    Raises:
        EquilibriumError: No equilibrium, or the edge has reached the end of the split.
    """
    return CutModel(beam, blade, interface, grid, 1.5 * blade.shoulder if notch is None else notch).run(depth)
