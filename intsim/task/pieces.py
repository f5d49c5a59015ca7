"""The outline of a piece of a food: the part between two cuts, lying on the board.

A piece of a food with parallel sides and flat ends is a shorter one. Any other is a table of its own sections. It has
come down to the board without turning: what it does when it tips is not followed.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np

from intsim.task.targets import Item
from mpm.scene.outline import ACROSS, ALONG, Outline, Sections, places
from mpm.scene.shapes import OUTLINE, Shape, span, surface

SHORTENED = ("block", "cylinder", "half_cylinder")  # kinds whose pieces are of the same kind
RIM = 1 - 1e-9  # part of a section's half width up to which it has a height
WHOLE_END = 1e-9  # distance from the food's own end within which a piece has that end [m]


def cut_ends(item: Item, which: int) -> tuple[bool, bool]:
    """Whether a piece was cut at its lower and its upper end along the food's axis.

    Args:
        item: The food.
        which: Number of the piece.

    Returns:
        Of either end, whether it is the face of a cut, which has no skin.
    """
    piece, half = item.pieces[which], item.shape.length / 2
    return piece.low > -half + WHOLE_END, piece.high < half - WHOLE_END


def piece_shape(item: Item, which: int, place: float | None = None) -> Shape:
    """The outline of a piece.

    Args:
        item: The food.
        which: Number of the piece.
        place: Where the blade is, along the axis of the uncut food [m]; the middle of the piece without it.

    Returns:
        Its shape, the blade at ``place``.
    """
    piece = item.pieces[which]
    middle = (piece.low + piece.high) / 2
    off = 0.0 if place is None else place - middle
    if item.shape.kind in SHORTENED or cut_ends(item, which) == (False, False):
        return replace(item.shape, length=piece.length, cut=off)
    table, width, height = _tabulated(item, which)
    about = f"{item.name} from {1e3 * piece.low:.4g} to {1e3 * piece.high:.4g} mm of its middle"
    sha = hashlib.sha256(
        repr((about, item.shape.kind, item.shape.length, item.shape.width, item.shape.height)).encode()
    )
    return Shape(OUTLINE, piece.length, width, height, off, Outline(about, sha.hexdigest(), "piece", table))


def _tabulated(item: Item, which: int) -> tuple[Sections, float, float]:
    """Table of a piece, its width and its height [m]."""
    piece, whole = item.pieces[which], replace(item.shape, cut=0.0)
    y = piece.low + (places(ALONG) + 1) / 2 * piece.length
    y = np.clip(y, -whole.length / 2, whole.length / 2)
    flanks = np.array([span(whole, float(at)) for at in y])
    middle, half = flanks.mean(axis=1), np.ptp(flanks, axis=1) / 2
    x = middle[:, None] + half[:, None] * RIM * places(ACROSS)
    low, high = surface(whole, x, np.broadcast_to(y[:, None], x.shape))
    rim = whole.height / 2
    low, high = (np.nan_to_num(face, nan=rim) for face in (low, high))
    wide = half > 0
    foot = float(low[wide].min())
    height, width = float(high[wide].max()) - foot, 2 * float(np.abs(flanks).max())
    low, high = (np.clip((face - foot) / height, 0.0, 1.0) for face in (low, high))
    left, right = (flanks / (width / 2)).T
    return Sections(left, right, low, np.maximum(low, high), cut_ends(item, which)), width, height
