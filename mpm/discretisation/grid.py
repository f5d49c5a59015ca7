"""Where the grid lies: around the food, with room for it to widen, in step with the mirror planes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpm.scene import Scene

MIRROR = 2  # index of the first node plane that is no mirror image across x
PAD = 3  # empty cells around the food: a quadratic kernel reaches 1.5 cells, the rest is room to move


@dataclass(frozen=True, eq=False)
class Grid:
    """The grid of a scene.

    Attributes:
        nodes: Nodes along x, y, z.
        origin: Place of the first node [m], shape (3,).
        images: Mirror images that each particle stands for (1, 2 or 4).
        stations: Places of the slices along the edge [m], shape (n,).
    """

    nodes: tuple[int, ...]
    origin: np.ndarray
    images: int
    stations: np.ndarray


def lay_out(scene: Scene) -> Grid:
    """Place the grid: around the food with room to widen, mirror planes on nodes or half-way between them."""
    shape, num = scene.food.shape, scene.numerics
    dx, mirror = num.dx, (*scene.mirrors, False)
    c, s = abs(math.cos(num.grid_turn)), abs(math.sin(num.grid_turn))
    wide, deep = c * shape.width + s * shape.length, s * shape.width + c * shape.length
    low, high, zero = [], [], []
    for axis, size in enumerate((wide, deep, shape.height)):
        shift = num.grid_shift[axis] % 1.0
        room = PAD + math.ceil(num.room * size / 2 / dx)
        before = after = size / 2
        if axis == 1:
            off = abs(shape.cut) if num.grid_turn else shape.cut
            before, after = before + off, after + (off if num.grid_turn else -off)
        under = PAD + max(math.ceil(abs(scene.board.bow) / dx) - 1, 0)  # a bowed food sags below z = 0
        bottom = -under if axis == 2 else -math.ceil(before / dx) - room
        top = math.ceil(after / dx) + room
        if axis == 2:  # the blade tips the halves, and their far ends rise
            top = math.ceil(size / dx) + PAD + math.ceil(num.room * deep / 2 / dx)
        if mirror[axis] and axis == 0:
            bottom, shift = -MIRROR, -shift  # by nothing or half a cell, so that there are as many images
        if mirror[axis] and axis == 1:
            top = 2
        low.append(bottom)
        high.append(top + 1)
        zero.append(shift)
    nodes = tuple(h - b + 1 for b, h in zip(low, high, strict=True))
    origin = np.array([(b - z) * dx for b, z in zip(low, zero, strict=True)])
    stations = origin[0] + dx * np.arange(nodes[0])
    if num.grid_turn:
        half = math.ceil(shape.width / 2 / dx) + PAD
        stations = dx * np.arange(-half, half + 1)
    images = (2 if mirror[0] else 1) * (2 if mirror[1] else 1)
    return Grid(nodes, origin, images, stations)
