"""Layers of a food in the section that a cut severs: a rind all round, flesh, and a core, each with its own toughness.

The rind lies between the outline and the outline shrunk by its thickness on all sides, the lower one too; the flat face
of a half fruit has none, for there it was halved. The core is the outline shrunk in proportion about its middle, or
about that of the flat face; in a food with parallel sides it runs along all of its length.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from mpm.scene.inclusions import Inclusion
from mpm.scene.material import Material
from mpm.scene.shapes import FLAT_DOWN, FLAT_TOP, Shape, depth, half_width, inside, radius2, span, surface

SUBSAMPLES = 8  # points along each side of a particle's square of the section
STIFF_SAMPLES = 3  # points along each edge of a particle's cube
STATIONS = 100  # along the food, between which the middle of a tabulated section is interpolated
SECTION_SAMPLES = 400  # points along the width and along the height of a whole section


def toughness(shape: Shape, material: Material, points: np.ndarray) -> np.ndarray:
    """Cutting resistance of the food at some points.

    Args:
        shape: The outline.
        material: Its constants.
        points: Places in the food before it is cut [m], shape (n, 3).

    Returns:
        R of the layer that each lies in [J/m^2], shape (n,).
    """
    out = np.full(len(points), float(material.R))
    if material.core_ratio > 0 and material.R_core is not None:
        out[_in_core(shape, points, material.core_ratio)] = material.R_core
    if material.rind_thickness > 0 and material.R_rind is not None:
        out[~_within(shape, points, material.rind_thickness)] = material.R_rind
    return out


def layer_ties(
    shape: Shape,
    material: Material,
    spacing: float,
    places: np.ndarray,
    rows: int = 1,
    without: Sequence[Inclusion] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Ties across the cut plane in the layers: each stands for the part of the section that is nearest to it, in rows.

    The section is sampled on a lattice finer than the ties', so a rind thinner than their spacing counts by its share,
    and a tie beside a stone or a cavity for what of it is flesh.

    Args:
        shape: The outline.
        material: Its constants.
        spacing: Distance of the ties [m].
        places: Where they are in the uncut food, along the blade and upwards [m], shape (k, 2); only those at x > 0
            where x = 0 is a mirror.
        rows: Rows of each, one above the other.
        without: Stone and cavity that the blade's plane meets.

    Returns:
        Toughness of each row from below, the mean of R over its part [J/m^2], and its part over that of a whole row
        [-], (k, rows).
    """
    from scipy.spatial import cKDTree  # takes long to import

    if not (material.layered or without) or len(places) == 0:
        return np.full((len(places), rows), float(material.R)), np.ones((len(places), rows))
    step, mirrored = spacing / SUBSAMPLES, places[:, 0].min() > 0
    rise = spacing / (rows * max(round(SUBSAMPLES / rows), 1))
    x = np.arange(0.0 if mirrored else -shape.width / 2, shape.width / 2, step) + step / 2
    points = _section(shape, x, np.arange(0.0, shape.height, rise) + rise / 2, without)
    _, owner = cKDTree(places).query(points[:, [0, 2]])
    row = np.floor((points[:, 2] - places[owner, 1]) / spacing * rows + rows / 2).astype(int)
    owner = owner * rows + np.clip(row, 0, rows - 1)
    count = np.bincount(owner, minlength=len(places) * rows)
    total = np.bincount(owner, toughness(shape, material, points), len(places) * rows)
    own = np.repeat(toughness(shape, material, np.insert(places, 1, 0.0, axis=1)), rows)
    found = np.where(count > 0, total / np.maximum(count, 1), own), count * rows * step * rise / spacing**2
    return found[0].reshape(-1, rows), found[1].reshape(-1, rows)


def in_whole(toughness: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ties whose rows are one.

    Args:
        toughness: Of the rows of each [J/m^2], shape (k, rows).
        share: Part of the section over that of a whole row [-], shape (k, rows).

    Returns:
        Toughness of each tie [J/m^2], and its part of the section over a square of the spacing [-], (k,).
    """
    total = share.sum(axis=1)
    mean = (toughness * share).sum(axis=1) / np.where(total > 0, total, 1.0)
    return np.where(total > 0, mean, toughness.mean(axis=1)), total / share.shape[1]


def mean_toughness(shape: Shape, material: Material, part: float = 1.0, without: Sequence[Inclusion] = ()) -> float:
    """Mean of R over the section of a cut, or over the upper part of it: what new surface costs an area.

    Args:
        shape: The outline.
        material: Its constants.
        part: Part of the section's area that is cut, from above [-].
        without: Stone and cavity that the blade's plane meets.

    Returns:
        The mean [J/m^2].
    """
    if not material.layered:
        return material.R
    even = (np.arange(SECTION_SAMPLES) + 0.5) / SECTION_SAMPLES
    points = _section(shape, (2 * even - 1) * half_width(shape, 0.0), even * shape.height, without)
    upper = points[np.argsort(-points[:, 2], kind="stable")][: max(round(part * len(points)), 1)]
    return float(toughness(shape, material, upper).mean())


def layer_stiffness(shape: Shape, material: Material, spacing: float, places: np.ndarray) -> np.ndarray:
    """E and yield stress of particles over those of the flesh: the mean over the cube that each stands for.

    Args:
        shape: The outline.
        material: Its constants.
        spacing: Edge of the cubes [m].
        places: Where the particles are in the uncut food [m], shape (n, 3).

    Returns:
        The factors [-], shape (n,).
    """
    if not material.graded:
        return np.ones(len(places))
    offsets = (np.arange(STIFF_SAMPLES) + 0.5) / STIFF_SAMPLES - 0.5
    total, count = np.zeros(len(places)), np.zeros(len(places))
    for off in itertools.product(offsets, repeat=3):
        points = places + spacing * np.array(off)
        there = inside(shape, points)
        total += np.where(there, _stiffness(shape, material, points), 0.0)
        count += there
    return np.where(count > 0, total / np.maximum(count, 1), _stiffness(shape, material, places))


def _stiffness(shape: Shape, material: Material, points: np.ndarray) -> np.ndarray:
    """E and yield stress at some points (n, 3) over those of the flesh, shape (n,)."""
    out = np.ones(len(points))
    if material.core_ratio > 0:
        out[_in_core(shape, points, material.core_ratio)] = material.core_stiffness
    if material.rind_thickness > 0:
        out[~_within(shape, points, material.rind_thickness)] = material.rind_stiffness
    return out


def _section(shape: Shape, x: np.ndarray, z: np.ndarray, without: Sequence[Inclusion]) -> np.ndarray:
    """Points (n, 3) of a lattice in the plane of the cut that lie in the flesh of the food."""
    along, up = (axis.ravel() for axis in np.meshgrid(x, z, indexing="ij"))
    points = np.column_stack([along, np.zeros_like(along), up])
    there = inside(shape, points)
    for one in without:
        there &= ~one.holds(shape, points)
    return points[there]


def _within(shape: Shape, points: np.ndarray, thickness: float) -> np.ndarray:
    """Which points (n, 3) lie in the outline shrunk by a thickness [m] on all sides that have a rind, shape (n,)."""
    if shape.table is not None:
        return depth(shape, points, thickness) >= thickness
    x, y, z = points.T
    floor = 0.0 if shape.kind in FLAT_DOWN else thickness
    if shape.kind == "block":
        beside = (np.abs(x) <= shape.width / 2 - thickness) & (np.abs(y + shape.cut) <= shape.length / 2 - thickness)
        return beside & (z >= floor) & (z <= shape.height - thickness)
    r2 = radius2(shape, x, y, thickness)
    if shape.kind in FLAT_TOP:
        return (r2 <= 1) & (z >= floor) & (z <= shape.height - thickness)
    middle = floor if shape.kind in FLAT_DOWN else shape.height / 2
    half = max(shape.height - middle - thickness, 1e-9)
    return r2 + ((z - middle) / half) ** 2 <= 1


def _in_core(shape: Shape, points: np.ndarray, ratio: float) -> np.ndarray:
    """Which points (n, 3) lie in the core, whose radius is a part of the outline's, shape (n,)."""
    x, y, z = points.T
    if shape.table is not None:
        return _in_tabulated_core(shape, points, ratio)
    middle = 0.0 if shape.kind in FLAT_DOWN else shape.height / 2
    along = y if shape.prism else (y + shape.cut) / ratio - shape.cut
    up = z if shape.kind == "upright_cylinder" else (z - middle) / ratio + middle
    return inside(shape, np.column_stack([x / ratio, along, up]))


def _in_tabulated_core(shape: Shape, points: np.ndarray, ratio: float) -> np.ndarray:
    """The same about the line through the middles of the sections, which may be bent."""
    assert shape.table is not None
    x, y, z = points.T
    along = y if shape.prism else (y + shape.cut) / ratio - shape.cut
    stations = np.linspace(along.min(), along.max(), STATIONS) if np.ptp(along) > 0 else along[:1]
    middle = np.interp(along, stations, [sum(span(shape, float(v))) / 2 for v in stations])
    floor, roof = surface(shape, middle, along)
    level = 0.0 if shape.table.halved else (floor + roof) / 2
    return inside(shape, np.column_stack([middle + (x - middle) / ratio, along, level + (z - level) / ratio]))
