"""The silhouette of one food in a photograph, as a polygon: what stands out of an even background.

The difference of each pixel from the background's colour is divided in two by Otsu's threshold (1979, IEEE Trans. Syst.
Man Cybern. 9:62), and the outline is the contour at that level, finer than a pixel. Highlights within are filled.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from contourpy import contour_generator
from PIL import Image, ImageOps
from scipy import ndimage
from scipy.spatial import ConvexHull

from calib.errors import ShapeError
from mpm.arrays import FloatArray

LARGEST = 2400
"""Longest side of a picture that is looked at [pixels]; a larger one is made smaller by a whole number."""
CONTRAST = 0.08
"""Least difference of food and background, over that of black and white."""
SECOND = 0.02
"""A second thing counts from this part of the largest one's area on; less is dust."""
SOLID = 0.35
"""Least part of its convex hull that a closed outline fills: a line drawing with a gap fills less."""
BLUR = 1.0
"""Standard deviation by which a picture is smoothed against noise [pixels]; straight edges stay where they are."""
LEVELS = 256  # of the threshold
VARIED, SHARP, EDGE = 0.25, 0.03, 2.0
"""An outline is sharp where the threshold, a quarter lower and higher, changes its area by no more than this part, or
moves it by no more than so many pixels."""


@dataclass(frozen=True, eq=False)
class Silhouette:
    """The outline of the food in a picture.

    Attributes:
        points: Corners of a closed polygon, to the right and upwards in the picture [m], shape (k, 2).
        pixel: Size of a pixel that was looked at [m].
        said: What must be known of it, one sentence each.
    """

    points: FloatArray
    pixel: float
    said: tuple[str, ...] = ()


def silhouette(path: Path, content: bytes, scale: float) -> Silhouette:
    """The outline of the food in a photograph.

    Args:
        path: The file, for errors.
        content: Its bytes: PNG or JPEG.
        scale: Size of a pixel [m].

    Returns:
        The outline.

    Raises:
        ShapeError: It is no picture, or has not one food with a closed outline in it.
    """
    picture, smaller = _read(path, content)
    field = _field(path, picture)
    level = _threshold(field)
    food = _one_food(path, field, level)
    shown = np.where(food, np.maximum(field - level, 0.0), np.minimum(field - level, 0.0))
    shown[food & (shown == 0.0)] = shown.max()
    padded = np.pad(shown, 1, constant_values=-level)
    found = contour_generator(z=padded).lines(0.0)
    points: FloatArray = max((np.asarray(line) for line in found), key=len)
    hull = ConvexHull(points)
    x, y = points[:, 0], points[:, 1]
    area = abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2
    if area < SOLID * hull.volume:
        raise ShapeError(
            f"{path}: the outline in the picture is not closed: what stands out fills {area / hull.volume:.0%} of its "
            "own hull; fill the silhouette, or photograph the whole food before an even background"
        )
    pixel = smaller * scale
    return Silhouette(np.column_stack([x, -y])[:-1] * pixel, pixel, _doubts(path, field, level, food, points))


def _doubts(path: Path, field: FloatArray, level: float, food: np.ndarray, points: FloatArray) -> tuple[str, ...]:
    """What is said of an edge that is not sharp, as beside a shadow: other levels give other outlines."""
    low, high = (int(ndimage.binary_fill_holes(field > part * level).sum()) for part in (1 - VARIED, 1 + VARIED))
    vague = (low - high) / int(food.sum())
    around = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if vague <= SHARP or low - high <= EDGE * around:
        return ()
    return (
        f"{path.name}: the outline is not sharp, {vague:.0%} of the food's area may as well be background, perhaps a "
        "shadow; light it evenly, or cut the background away",
    )


def _read(path: Path, content: bytes) -> tuple[Image.Image, int]:
    """The picture as it is to be looked at, and how many of its pixels are one now, along a side."""
    try:
        opened = Image.open(io.BytesIO(content), formats=("PNG", "JPEG"))
        opened.load()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as e:
        raise ShapeError(f"{path}: is no picture that can be read; give a PNG or JPEG ({type(e).__name__})") from None
    picture = ImageOps.exif_transpose(opened)
    smaller = max(1, -(-max(picture.size) // LARGEST))
    picture = picture.convert("RGBA" if "A" in picture.getbands() or "transparency" in picture.info else "RGB")
    return (picture.reduce(smaller) if smaller > 1 else picture), smaller


def _field(path: Path, picture: Image.Image) -> FloatArray:
    """How much each pixel differs from the background, 0 to 1, shape (rows, columns)."""
    pixels = np.asarray(picture, dtype=float) / 255.0
    if pixels.shape[2] == 4 and pixels[..., 3].min() < 0.5:
        field = pixels[..., 3]
    else:
        rim = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])[:, :3]
        field = np.linalg.norm(pixels[..., :3] - np.median(rim, axis=0), axis=2) / np.sqrt(3.0)
    field = ndimage.gaussian_filter(field, BLUR)
    if np.ptp(field) < CONTRAST:
        raise ShapeError(f"{path}: nothing stands out of the background; photograph the food before another colour")
    return np.asarray(field)


def _threshold(field: FloatArray) -> float:
    """Level between two classes of largest variance between them; in the middle of those that are as good."""
    counts, edges = np.histogram(field, LEVELS)
    middle = (edges[:-1] + edges[1:]) / 2
    below, above = np.cumsum(counts)[:-1], np.cumsum(counts[::-1])[::-1][1:]
    mean_below = np.cumsum(counts * middle)[:-1] / np.maximum(below, 1)
    mean_above = np.cumsum((counts * middle)[::-1])[::-1][1:] / np.maximum(above, 1)
    between = below * above * (mean_above - mean_below) ** 2.0
    return float(edges[1:-1][between > 0.99 * between.max()].mean())


def _one_food(path: Path, field: FloatArray, level: float) -> np.ndarray:
    """Which pixels are of the food, shape (rows, columns)."""
    filled = ndimage.binary_fill_holes(field > level)
    named, _ = ndimage.label(filled, structure=np.ones((3, 3)))
    sizes = np.bincount(named.ravel())
    sizes[0] = 0
    order = np.argsort(sizes)[::-1]
    food = named == order[0]
    if food[0].any() or food[-1].any() or food[:, 0].any() or food[:, -1].any():
        raise ShapeError(
            f"{path}: the outline is not closed: the food reaches the edge of the picture; leave background all round"
        )
    if sizes[order[1]] > SECOND * sizes[order[0]]:
        raise ShapeError(
            f"{path}: two objects in the picture, of {sizes[order[0]]} and {sizes[order[1]]} pixels; "
            "crop it to the food"
        )
    return np.asarray(food)
