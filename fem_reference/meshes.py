"""Hexahedral meshes of the solver's shapes, cut at their planes of symmetry, and meshes from and to files."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import skfem as sk
from skfem.io.meshio import from_meshio

from mpm.scene.errors import CutcalError
from mpm.scene.shapes import Shape

CORE = 0.55  # part of the radius that the middle block of a disc or ball reaches along the axes
BULGE = 0.5  # how round that block is: 0 a cube, 1 a ball
ON_OUTLINE = 1e-9  # a vertex this near to 1 in units of the outline lies on it
COARSEST = 4.0  # size of a graded row's largest elements over its smallest
MERGE = 1e-9  # nodes nearer than this part of the size are one

Map = Callable[[np.ndarray], np.ndarray]


class MeshError(CutcalError):
    """A mesh that cannot be made or read."""


def graded(length: float, size: float, growth: float) -> np.ndarray:
    """Nodes of a row of elements from 0 to a length, each wider than the one before, up to four times the first.

    Args:
        length: Of the row [m].
        size: Size of the first element [m], about: all are scaled to fill the row.
        growth: Size of each over that of the one before.

    Returns:
        Places of the nodes [m], shape (n,).
    """
    widths = [size]
    while sum(widths) < length * (1 - MERGE):
        widths.append(min(widths[-1] * growth, COARSEST * size))
    places = np.concatenate([[0.0], np.cumsum(widths)])
    return places * length / places[-1]


def box(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> sk.MeshHex:
    """Block of hexahedra.

    Args:
        x: Places of the nodes along the first axis [m], shape (n,).
        y: Along the second [m], shape (m,).
        z: Along the third [m], shape (k,).

    Returns:
        The mesh.
    """
    return sk.MeshHex.init_tensor(x, y, z)


def quarter(shape: Shape, cells: int, grade: float = 1.0, order: int = 1, core: float | None = None) -> sk.MeshHex:
    """The quarter x >= 0, y >= 0 of a food shape, standing on z = 0.

    Args:
        shape: block, cylinder, upright_cylinder, sphere or ellipsoid.
        cells: Elements along half the height; along a quarter of a round outline they are twice as many.
        grade: Power by which the elements shrink towards the axes, 1 for none.
        order: 1 for straight edges; 2 for elements whose outer faces follow a round outline.
        core: Radius of a core over that of the outline, which faces of elements follow, too, in a cylinder [-].

    Returns:
        The mesh.

    Raises:
        MeshError: A shape without such a mesh, one that is not cut in the middle, or a core in a shape that has none.
    """
    if shape.cut != 0:
        raise MeshError("mesh: the finite-element mesh is a quarter of a food that is cut in the middle")
    if core is not None and shape.kind not in ("cylinder", "upright_cylinder"):
        raise MeshError(f"mesh: no finite-element mesh of a {shape.kind} with a core; use a cylinder")
    radii = (1.0,) if core is None else (core, 1.0)
    mesh = _straight(shape, cells, grade, radii)
    return mesh if order == 1 or shape.kind == "block" else _rounded(mesh, shape, radii)


def _straight(shape: Shape, cells: int, grade: float, radii: Sequence[float]) -> sk.MeshHex:
    a, b, h = shape.width / 2, shape.length / 2, shape.height / 2
    if shape.kind == "block":
        count = [max(2, round(cells * size / h)) for size in (a, b)]
        return box(
            np.linspace(0, a, count[0] + 1), np.linspace(0, b, count[1] + 1), np.linspace(0, 2 * h, 2 * cells + 1)
        )
    if shape.kind == "upright_cylinder":
        layers = np.linspace(0, 2 * h, 2 * cells + 1)
        return _join(_disc(cells, grade, radii, lambda p: p * [a, b], lambda p, s: np.stack([p[0], p[1], s]), layers))
    if shape.kind == "cylinder":
        layers = np.linspace(0, b, max(2, round(cells * b / h)) + 1)
        top = _disc(cells, grade, radii, lambda p: p * [a, h], lambda p, s: np.stack([p[0], s, p[1] + h]), layers)
        return _join([*top, *(_mirrored(m, h) for m in top)])
    if shape.kind in ("sphere", "ellipsoid"):
        top = [_mapped(m, lambda p: p + [[0.0], [0.0], [h]]) for m in _ball(cells, grade, np.array([a, b, h]))]
        return _join([*top, *(_mirrored(m, h) for m in top)])
    raise MeshError(f"mesh: no finite-element mesh of a {shape.kind}; give a mesh file, or use a block or cylinder")


def bent(x: np.ndarray, y: np.ndarray, z: np.ndarray, to: Map) -> sk.MeshHex2:
    """A block of elements with curved edges: a straight one whose nodes, also those in the middle, are mapped.

    Args:
        x: Places of the straight block's nodes along the first axis [m], shape (n,).
        y: Along the second [m], shape (m,).
        z: Along the third [m], shape (k,).
        to: Map of places, (3, n) to (3, n).

    Returns:
        The mesh.
    """
    mesh = sk.MeshHex2.from_mesh(box(x, y, z))
    return replace(mesh, doflocs=to(mesh.doflocs))


def read(path: Path | str) -> sk.Mesh:
    """Mesh of hexahedra or tetrahedra from any file that meshio reads, lengths in metres.

    Raises:
        MeshError: No such file, no volume elements, or elements turned inside out.
    """
    try:
        mesh = from_meshio(meshio.read(path))
    except (OSError, meshio.ReadError, SystemExit, KeyError, ValueError) as e:
        raise MeshError(
            f"{path}: cannot read a mesh from it ({e}); give a file that meshio reads, e.g. .msh or .vtu"
        ) from e
    if not isinstance(mesh, (sk.MeshHex, sk.MeshTet)):
        raise MeshError(f"{path}: holds {type(mesh).__name__}, not hexahedra or tetrahedra; export the volume elements")
    return mesh


def write(mesh: sk.Mesh, path: Path | str, u: np.ndarray | None = None) -> None:
    """Write a mesh to a file.

    Args:
        mesh: The mesh.
        path: File; its suffix decides the format.
        u: Displacements of the nodes [m], shape (n, 3), or None; those of the vertices are written.
    """
    data = None if u is None else {"displacement": u[: mesh.p.shape[1]]}
    mesh.save(str(path), point_data=data)


def surface(mesh: sk.Mesh, where: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Facets on the boundary whose middle satisfies a condition on places (3, n)."""
    return mesh.facets_satisfying(where, boundaries_only=True)


def _ball(cells: int, grade: float, radii: np.ndarray) -> list[sk.MeshHex]:
    """An octant of a ball: a block in the middle and one behind each of its three faces."""
    line = np.linspace(0, 1, cells + 1) ** grade
    core = sk.MeshHex.init_tensor(line, line, line)
    blocks = [_mapped(core, lambda p: _core(p) * radii[:, None])]
    shell = sk.MeshHex.init_tensor(np.linspace(0, 1, cells + 1), line, line)
    for axis in range(3):

        def outward(p: np.ndarray, axis: int = axis) -> np.ndarray:
            face = np.roll(np.stack([np.ones_like(p[0]), p[1], p[2]]), axis, axis=0)
            return _between(face, p[0]) * radii[:, None]

        blocks.append(_mapped(shell, outward))
    return blocks


def _disc(
    cells: int,
    grade: float,
    radii: Sequence[float],
    scale: Callable[[np.ndarray], np.ndarray],
    place: Callable[[np.ndarray, np.ndarray], np.ndarray],
    layers: np.ndarray,
) -> list[sk.MeshHex]:
    """A quarter of a disc drawn out over ``layers``: a block in the middle and two around it, for each circle.

    Args:
        cells: Elements along each side of a block.
        grade: Power by which they shrink towards the axes.
        radii: Circles that faces of elements follow, rising; the last is the unit disc's outline [-].
        scale: From the unit disc, (n, 2), to the real one.
        place: From the plane (2, n) and the height of a layer (n,) to space (3, n).
        layers: Heights [m].
    """
    line = np.linspace(0, 1, cells + 1) ** grade

    def build(first: np.ndarray, inward: Map) -> sk.MeshHex:
        mesh = sk.MeshHex.init_tensor(first, line, layers)
        return _mapped(mesh, lambda p: place(scale(inward(p[:2]).T).T, p[2]))

    blocks = [build(line, lambda p: radii[0] * _core(p))]
    for k, axis in itertools.product(range(len(radii)), range(2)):

        def outward(p: np.ndarray, k: int = k, axis: int = axis) -> np.ndarray:
            one = np.ones_like(p[0])
            face = np.stack([one, p[1]] if axis == 0 else [p[1], one])
            if k == 0:
                return radii[0] * _between(face, p[0])
            return (radii[k - 1] + p[0] * (radii[k] - radii[k - 1])) * _between(face, one)

        blocks.append(build(np.linspace(0, 1, cells + 1), outward))
    return blocks


def _core(p: np.ndarray) -> np.ndarray:
    """A unit cube's points in the rounded middle block of a unit ball; the same angles between nodes on its outside."""
    q = np.tan(np.pi / 4 * p)
    size = np.linalg.norm(q, axis=0)
    round_ = np.divide(q.max(axis=0), size, out=np.ones_like(size), where=size > 0)
    return CORE * q * (1 - BULGE + BULGE * round_)


def _between(face: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points between the middle block, at t = 0, and the sphere, at t = 1, behind points of the cube's face."""
    q = np.tan(np.pi / 4 * face)
    return (1 - t) * _core(face) + t * q / np.linalg.norm(q, axis=0)


def _rounded(mesh: sk.MeshHex, shape: Shape, circles: Sequence[float]) -> sk.MeshHex2:
    """Quadratic elements whose nodes on round faces lie on the outline, and on what lies in proportion within it."""
    out = sk.MeshHex2.from_mesh(mesh)
    radii = np.array([shape.width, shape.length, shape.height])[:, None] / 2
    round_axes = np.array({"upright_cylinder": [0, 1], "cylinder": [0, 2]}.get(shape.kind, [0, 1, 2]))
    at = out.doflocs.copy()
    at[2] -= shape.height / 2

    level = np.sqrt(((at[round_axes] / radii[round_axes]) ** 2).sum(axis=0))
    basis = sk.CellBasis(out, sk.ElementHex2(), intorder=1)
    for circle in circles:
        facets = np.flatnonzero((np.abs(level[mesh.facets] - circle) < ON_OUTLINE).all(axis=0))
        nodes = np.unique(basis.get_dofs(facets).flatten())
        at[np.ix_(round_axes, nodes)] *= circle / level[nodes]
    at[2] += shape.height / 2
    return replace(out, doflocs=at)


def _mapped(mesh: sk.MeshHex, to: Map) -> sk.MeshHex:
    return sk.MeshHex(to(mesh.p), mesh.t)


def _mirrored(mesh: sk.MeshHex, height: float) -> sk.MeshHex:
    """Image of a mesh below the plane z = height."""
    p = mesh.p.copy()
    p[2] = 2 * height - p[2]
    return sk.MeshHex(p, mesh.t)


def _join(meshes: Sequence[sk.MeshHex]) -> sk.MeshHex:
    """One mesh of blocks whose faces meet; elements that a mirror turned inside out are numbered anew."""
    points = np.concatenate([m.p for m in meshes], axis=1)
    first = np.cumsum([0, *(m.p.shape[1] for m in meshes)])
    cells = np.concatenate([m.t + k for m, k in zip(meshes, first, strict=False)], axis=1)
    size = np.ptp(points, axis=1).max()
    _, keep, same = np.unique(
        np.round(points / (MERGE * size)).astype(np.int64), axis=1, return_index=True, return_inverse=True
    )
    cells, points = np.ravel(same)[cells], points[:, keep]
    a, b, c, d = (points[:, cells[k]] for k in (0, 1, 2, 3))
    wrong = np.einsum("ij,ij->j", np.cross(c - a, b - a, axis=0), d - a) < 0
    cells[:, wrong] = cells[:, wrong][[0, 2, 1, 3, 4, 6, 5, 7]]  # a mirrored element, with two axes exchanged
    return sk.MeshHex(np.ascontiguousarray(points), np.ascontiguousarray(cells))
