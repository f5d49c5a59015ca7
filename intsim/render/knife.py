"""The knife in the hand: blade, tip, handle and the block between the fingers."""

from __future__ import annotations

import numpy as np

from intsim.render.mesh import Drawn, Paint, box
from mpm.scene import Knife

STEEL = Paint((0.82, 0.83, 0.85), gloss=1.2)
WOOD = Paint((0.20, 0.12, 0.08), gloss=0.3)
CLAMP = Paint((0.15, 0.15, 0.16), gloss=0.3)
TIP = 0.3  # part of the length over which the spine falls to the tip [-]
HANDLE_LENGTH, HANDLE_HEIGHT, HANDLE_WIDTH = 0.115, 0.024, 0.017  # of a kitchen knife's handle [m]
CLAMP_SIZE = (0.04, 0.014, 0.022)  # of the block that the fingers hold, along the blade, across it, along the hand [m]
AROUND = 12  # vertices around the handle


def knife_mesh(blade: Knife, offset: float) -> Drawn:
    """The knife in the frame of the hand: the blade along x, its edge at the largest z.

    The edge is straight over its whole length, as the solver's is, and the spine falls to the tip. The handle is on the
    side of -x, away from the camera of the hand. It is for the eye alone.

    Args:
        blade: The knife.
        offset: From the hand to the back of the blade along z [m].
    """
    half, spine = blade.length / 2, blade.spine / 2
    x = np.array([-half, half * (1 - 2 * TIP), *half * (1 - 2 * TIP * np.array([0.66, 0.33, 0.1])), half])
    fall = np.clip((x / half - (1 - 2 * TIP)) / (2 * TIP), 0.0, 1.0) ** 2 * 0.97 * blade.height
    sides = []
    for side in (-1.0, 1.0):
        back = np.column_stack([x, np.full_like(x, side * spine), offset + fall])
        edge = np.column_stack([x, np.full_like(x, side * 5e-5), np.full_like(x, offset + blade.height)])
        k = np.arange(len(x) - 1)
        n = len(x)
        quads = np.concatenate([np.stack([k, k + n, k + n + 1], 1), np.stack([k, k + n + 1, k + 1], 1)])
        sides.append(Drawn.of(np.concatenate([back, edge]), quads if side < 0 else quads[:, ::-1], STEEL))
    k = np.arange(len(x) - 1)
    n = len(x)
    left, right = (np.column_stack([x, np.full_like(x, s * spine), offset + fall]) for s in (-1.0, 1.0))
    top = np.concatenate([np.stack([k, k + 1, k + n + 1], 1), np.stack([k, k + n + 1, k + n], 1)])
    sides.append(Drawn.of(np.concatenate([left, right]), top, STEEL))
    long, wide, deep = CLAMP_SIZE
    clamp = box((-long / 2, -wide / 2, offset - deep), (long / 2, wide / 2, offset + 0.004), CLAMP)
    return Drawn.all([*sides, _handle(-half, offset, blade.height), clamp])


def _handle(heel: float, offset: float, height: float) -> Drawn:
    """The handle, from the heel of the blade towards -x: rounded, thicker at its end."""
    along = np.array([0.0, 0.0, 0.1, 0.35, 0.65, 0.9, 1.0, 1.0])
    size = np.array([0.0, 0.8, 1.0, 0.9, 0.95, 1.15, 0.95, 0.0])
    tall = min(HANDLE_HEIGHT, height)
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = [
        np.column_stack(
            [
                np.full(AROUND, heel + 0.004 - HANDLE_LENGTH * a),
                s * HANDLE_WIDTH / 2 * np.cos(angle),
                offset + tall * 0.55 + s * tall / 2 * np.sin(angle),
            ]
        )
        for a, s in zip(along, size, strict=True)
    ]
    k = np.arange(AROUND)
    after = np.roll(k, -1)
    rows = []
    for ring in range(len(rings) - 1):
        low, high = ring * AROUND, (ring + 1) * AROUND
        rows += [np.stack([low + k, high + after, low + after], 1), np.stack([low + k, high + k, high + after], 1)]
    return Drawn.of(np.concatenate(rings), np.concatenate(rows), WOOD)
