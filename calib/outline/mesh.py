"""The outline of a food from a closed surface mesh that stands on the board."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path

import meshio
import numpy as np
from scipy.optimize import nnls
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from calib.errors import ShapeError
from calib.outline.crossings import Crossings, check_once, crossings, lines
from calib.outline.silhouette import RESTS, Sized
from mpm.arrays import FloatArray
from mpm.scene.outline import ACROSS, ALONG, Sections, places

MERGED = 1e-7
"""Vertices nearer to each other than this part of the mesh's size are one: an STL names each anew for every face."""
ROUGH = 5e-3
"""Way outside, over the height, that a vertical line may have within the food: folds of a scan."""
FOOT = 5e-3
"""What lies lower than this part of the height touches the board."""
BOUNDARY = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])  # faces of a tetrahedron, seen from outside


def food_of(path: Path, unit: float, up: str, across: str) -> Sized:
    """The food of a mesh.

    Args:
        path: File of any format that meshio reads, of triangles, quadrilaterals or tetrahedra.
        unit: One unit of its coordinates [m].
        up: Axis of the mesh that points up, such as ``z`` or ``-x``.
        across: Another axis, which lies across the blade.

    Returns:
        The food.

    Raises:
        ShapeError: It is no mesh, has holes, faces inwards, crosses itself, does not stand, or hangs over.
    """
    points, faces = _read(path)
    points, faces = _merged(points * unit, faces)
    _check_closed(path, faces)
    corners = points[faces] @ _turn(up, across).T
    volumes = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    if volumes.sum() <= 0:
        raise ShapeError(
            f"{path}: the faces of the mesh look inwards (it encloses {volumes.sum() * 1e6:.3g} cm^3), as those of a "
            "mirrored mesh do; turn its normals"
        )
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    centre = (volumes[:, None] * corners.sum(axis=1) / 4).sum(axis=0) / volumes.sum()
    _check_standing(path, corners.reshape(-1, 3), centre, low, high)
    corners = corners - [*(low[:2] + high[:2]) / 2, low[2]]
    return _tabulated(path, corners, high - low)


def _read(path: Path) -> tuple[FloatArray, np.ndarray]:
    """Vertices (k, 3), and triangles (t, 3) of the surface seen from outside."""
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()), np.errstate(all="ignore"):
            mesh = meshio.read(path)
    except (OSError, meshio.ReadError, SystemExit, LookupError, ValueError, AssertionError, TypeError) as e:
        why = str(e).splitlines()[0][:80] if str(e) else type(e).__name__
        raise ShapeError(f"{path}: no mesh can be read from it ({why}); give an STL, OBJ, VTK or MSH file") from None
    cells = mesh.cells_dict
    if len(cells.get("tetra", ())):
        faces = _boundary(cells["tetra"])
    else:
        quads = np.asarray(cells.get("quad", np.zeros((0, 4), int)))
        halves = [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        faces = np.concatenate([np.asarray(cells.get("triangle", np.zeros((0, 3), int))), *halves])
    points = np.asarray(mesh.points, dtype=float)
    if len(faces) == 0 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ShapeError(f"{path}: holds no triangles of a surface in space; export the food's closed surface")
    return points, faces.astype(int)


def _boundary(tetra: np.ndarray) -> np.ndarray:
    """Faces (t, 3) that belong to one tetrahedron only."""
    faces = tetra[:, BOUNDARY].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[count == 1]])


def _merged(points: FloatArray, faces: np.ndarray) -> tuple[FloatArray, np.ndarray]:
    """The same with each vertex once, without faces that have no area."""
    step = max(MERGED * float(np.ptp(points, axis=0).max()), 1e-300)
    _, first, which = np.unique(np.round(points / step), axis=0, return_index=True, return_inverse=True)
    faces = which.ravel()[faces]
    apart = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return points[first], faces[apart]


def _check_closed(path: Path, faces: np.ndarray) -> None:
    """Refuse a surface with holes, with faces that are turned differently, or of several bodies."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, which, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    if (count != 2).any():
        open_, more = int((count == 1).sum()), int((count > 2).sum())
        what = f"has holes: {open_} edges" if open_ else f"is no surface: {more} edges"
        raise ShapeError(
            f"{path}: the mesh {what} belong to {'one face' if open_ else 'more than two faces'}; close it: a food is "
            "a watertight surface"
        )
    turns = np.bincount(which.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1))
    if turns.any():
        raise ShapeError(
            f"{path}: some faces of the mesh look inwards and others outwards, at {int((turns != 0).sum())} edges; "
            "make its normals consistent"
        )
    n = int(faces.max()) + 1
    bodies, of = connected_components(coo_matrix((np.ones(len(edges)), edges.T), shape=(n, n)), directed=False)
    if bodies > 1:
        sizes = ", ".join(str(k) for k in np.sort(np.bincount(of[faces[:, 0]], minlength=bodies))[::-1][:5])
        raise ShapeError(
            f"{path}: {bodies} bodies in the mesh, of {sizes} faces; leave one, without what lies inside it"
        )


def _turn(up: str, across: str) -> FloatArray:
    """Rotation (3, 3) from the axes of the mesh to those of the scene."""
    z, y = (np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0) for axis in (up, across))
    return np.stack([np.cross(y, z), y, z])


def _check_standing(path: Path, points: FloatArray, centre: FloatArray, low: FloatArray, high: FloatArray) -> None:
    """Refuse a mesh whose centre of mass does not lie above what touches the board."""
    foot = np.unique(points[points[:, 2] <= low[2] + FOOT * (high - low)[2]][:, :2], axis=0)
    with suppress(QhullError, ValueError):  # a point or a line has no hull
        foot = foot[ConvexHull(foot).vertices]
    # nearest point of the hull: weights that are not negative and add up to one, which the last row sees to
    size = float((high - low)[:2].max())
    rows = np.vstack([(foot - centre[:2]).T / size, np.full(len(foot), 1e3)])
    weights, _ = nnls(rows, np.array([0.0, 0.0, 1e3]))
    beside = float(np.hypot(*(weights @ (foot - centre[:2]))))
    if beside > RESTS * size:
        raise ShapeError(
            f"{path}: the mesh is tilted: its centre of mass lies {beside * 1e3:.1f} mm beside what touches the board, "
            "so that it would tip over; turn it until it stands, or say which of its axes points up (--outline-as)"
        )


def _tabulated(path: Path, corners: FloatArray, size: FloatArray) -> Sized:
    """The table of a mesh that stands at the middle of the board."""
    width, length, height = (float(x) for x in size)
    left, right = np.empty(ALONG), np.empty(ALONG)
    bottom, top = np.empty((ALONG, ACROSS)), np.empty((ALONG, ACROSS))
    for j, y in enumerate(lines(-length / 2, length / 2, places(ALONG))):
        segments, entering = _section(corners, float(y))
        x = segments[:, :, 0]
        left[j], right[j] = x.min(), x.max()
        along = lines(left[j], right[j], places(ACROSS))
        found = crossings(segments, along, entering)
        where = f"{path}, {(y + length / 2) * 1e3:.1f} mm from its end"
        _check_whole(where, found, along)
        check_once(where, found, along - left[j], ROUGH * height, "vertical line")
        rim = segments[x.argmin() // 2, x.argmin() % 2, 1], segments[x.argmax() // 2, x.argmax() % 2, 1]
        for name, side in ((bottom, found.low), (top, found.high)):
            name[j] = side / height
            for end in (0, -1):
                if np.isnan(side[end]):
                    name[j, end] = rim[end] / height
    return Sized(Sections(2 * left / width, 2 * right / width, bottom, top), length, width, height)


def _check_whole(where: str, found: Crossings, x: FloatArray) -> None:
    """Refuse a section that crosses itself, or is in two pieces side by side."""
    if np.nanmax(np.nan_to_num(found.within)) > 1:
        k = int(np.nanargmax(np.nan_to_num(found.within)))
        raise ShapeError(f"{where}: the mesh crosses itself at {(x[k] - x[0]) * 1e3:.1f} mm; repair it")
    if np.isnan(found.low[1:-1]).any():
        raise ShapeError(f"{where}: the section is in two pieces side by side; lay the food so that each is in one")


def _section(corners: FloatArray, y: float) -> tuple[FloatArray, FloatArray]:
    """The section of triangles (t, 3, 3) by a plane across: segments (k, 2, 2) in x and z, and whether a line upwards
    enters (1) or leaves (-1) the food through each."""
    beyond = corners[:, :, 1] > y
    cut = corners[beyond.any(axis=1) & ~beyond.all(axis=1)]
    beyond = cut[:, :, 1] > y
    pieces = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        # always from the near vertex to the far one, so that two faces meet in the very same point
        turned = beyond[:, a][:, None]
        near, far = np.where(turned, cut[:, b], cut[:, a]), np.where(turned, cut[:, a], cut[:, b])
        crossed = beyond[:, a] != beyond[:, b]
        part = (y - near[:, 1]) / np.where(crossed, far[:, 1] - near[:, 1], 1.0)
        there = near + part[:, None] * (far - near)
        pieces.append(np.where(crossed[:, None], there[:, [0, 2]], np.nan))
    each = np.stack(pieces, axis=1)
    segments = each[np.isfinite(each[:, :, 0])].reshape(-1, 2, 2)  # two of the three edges of each
    normal = np.cross(cut[:, 1] - cut[:, 0], cut[:, 2] - cut[:, 0])[:, 2]
    return segments, np.where(normal < 0, 1.0, -1.0)
