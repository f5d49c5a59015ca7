"""Points on the surface of a solid, and a wedge that slides along them: contact by a penalty, with Coulomb friction."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
import skfem as sk

from fem_reference.contact import Obstacle
from fem_reference.solid import Solid

ZERO = 1e-12  # shape function that is none


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points that move with a solid's surface.

    Attributes:
        matrix: Shape functions of the solid's nodes at the points [-], shape (n, nodes).
        areas: Reference area that each point stands for [m^2], shape (n,); in plane strain per metre of width.
    """

    matrix: sp.csr_matrix
    areas: np.ndarray
    _vectors: sp.csr_matrix = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_vectors", sp.kron(self.matrix, sp.identity(3)).tocsr())

    @property
    def unknowns(self) -> np.ndarray:
        """Unknowns (3 node + axis) of the nodes that the points hang on, shape (m,)."""
        return (3 * np.unique(self.matrix.indices)[:, None] + np.arange(3)).ravel()

    def at(self, x: np.ndarray) -> np.ndarray:
        """Places of the points [m], shape (n, 3), the solid's nodes being at ``x``."""
        return self.matrix @ x

    def spread(self, forces: np.ndarray) -> np.ndarray:
        """Forces on the nodes [N], shape (nodes, 3), that forces on the points, shape (n, 3), amount to."""
        return self.matrix.T @ forces

    def stiffness(self, blocks: np.ndarray) -> sp.csr_matrix:
        """Stiffness between the nodes [N/m] of springs at the points, shape (n, 3, 3)."""
        n = len(blocks)
        return self.between(sp.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)))

    def between(self, stiffness: sp.spmatrix) -> sp.csr_matrix:
        """Stiffness between the nodes [N/m], shape (3 nodes, 3 nodes), from one between the points, (3 n, 3 n)."""
        return (self._vectors.T @ stiffness @ self._vectors).tocsr()


def nodal(solid: Solid, facets: np.ndarray) -> SurfacePoints:
    """The nodes of some facets, with the areas of :meth:`Solid.areas`: integration by Lobatto's rule on lines.

    Stiff ties want it: with points inside the facets their tractions oscillate (Schellekens and de Borst 1993).
    """
    nodes, areas = solid.areas(facets)
    rows = np.arange(len(nodes))
    shape = (len(nodes), len(solid.nodes))
    return SurfacePoints(sp.csr_matrix((np.ones(len(nodes)), (rows, nodes)), shape=shape), areas)


def sampled(solid: Solid, facets: np.ndarray, count: int) -> SurfacePoints:
    """Points within some facets, at equal distances, so that a rigid corner finds one everywhere.

    Args:
        solid: The solid.
        facets: Indices of the facets [-], shape (n,).
        count: Points along each edge of a facet.

    Returns:
        The points.
    """
    line = (np.arange(count) + 0.5) / count
    grid = line[None] if solid.plane else np.stack(np.meshgrid(line, line, indexing="ij")).reshape(2, -1)
    weights = np.full(grid.shape[1], 1.0 / grid.shape[1])
    basis = sk.FacetBasis(solid.mesh, solid.element, facets=facets, quadrature=(grid, weights))
    points = np.arange(basis.dx.size).reshape(basis.dx.shape)
    rows, columns, values = [], [], []
    for b, dofs in zip(basis.basis, basis.element_dofs, strict=True):
        value = np.asarray(b[0]) + np.zeros_like(basis.dx)
        rows.append(points.ravel())
        columns.append(np.broadcast_to(dofs[:, None], points.shape).ravel())
        values.append(value.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    matrix = sp.csr_matrix(entries, shape=(points.size, len(solid.nodes)))
    matrix.data[np.abs(matrix.data) < ZERO] = 0.0  # of functions of nodes that are not on the facets
    matrix.eliminate_zeros()
    return SurfacePoints(matrix, basis.dx.ravel())


@dataclass
class SlidingContact:
    """Points in contact with a rigid obstacle by a penalty, on which they always slide upwards.

    The traction on the food is ``penalty depth (n + mu t)``: n the obstacle's outward normal and t the direction along
    its face, in the plane across the blade, that points down: the blade goes down and drags the food with it.

    Attributes:
        points: Points that may touch.
        obstacle: The rigid body.
        penalty: Pressure per depth of penetration [Pa/m].
        friction: Coulomb's coefficient mu [-].
    """

    points: SurfacePoints
    obstacle: Obstacle
    penalty: float
    friction: float = 0.0

    @property
    def symmetric(self) -> bool:
        """Only without friction."""
        return self.friction == 0

    @property
    def unknowns(self) -> np.ndarray:
        """See :class:`fem_reference.solid.Surface`."""
        return self.points.unknowns

    def _pressed(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Normal forces [N], normals, and directions down the faces, of each point."""
        d, n = self.obstacle.distance(self.points.at(x))
        down = np.stack([np.zeros_like(d), n[:, 2], -n[:, 1]], axis=1)
        down *= np.where(down[:, 2] > 0, -1.0, 1.0)[:, None]
        return self.penalty * self.points.areas * np.maximum(-d, 0.0), n, down

    def tractions(self, x: np.ndarray) -> np.ndarray:
        """Force of the obstacle on each point [N], shape (n, 3)."""
        size, n, down = self._pressed(x)
        return size[:, None] * (n + self.friction * down)

    def rubbing(self, x: np.ndarray) -> np.ndarray:
        """The part of it that is friction [N], shape (n, 3)."""
        size, _, down = self._pressed(x)
        return self.friction * size[:, None] * down

    def force(self, x: np.ndarray) -> np.ndarray:
        """See :class:`fem_reference.solid.Surface`."""
        return self.points.spread(self.tractions(x))

    def stiffness(self, x: np.ndarray) -> sp.csr_matrix:
        """See :class:`fem_reference.solid.Surface`; the normals' own change is left out: the faces are plane."""
        d, _ = self.obstacle.distance(self.points.at(x))
        _, n, down = self._pressed(x)
        way = n + self.friction * down
        size = np.where(d <= 0, self.penalty * self.points.areas, 0.0)  # 0 counts: what stands on a board starts there
        return self.points.stiffness(size[:, None, None] * way[:, :, None] * n[:, None, :])

    def commit(self, x: np.ndarray) -> None:
        """No memory."""

    def energy(self, x: np.ndarray) -> float:
        """Energy in the springs of the penalty [J]."""
        d, _ = self.obstacle.distance(self.points.at(x))
        return float(0.5 * self.penalty * (self.points.areas * np.minimum(d, 0.0) ** 2).sum())

    def penetration(self, x: np.ndarray) -> float:
        """Deepest penetration [m]."""
        return float(max(-self.obstacle.distance(self.points.at(x))[0].min(), 0.0))


@dataclass
class Tie:
    """Springs that hold points to the plane y = 0.

    Attributes:
        points: The points.
        stiffness_per_area: Traction per displacement [Pa/m].
        on: Which of them hold, shape (n,).
    """

    points: SurfacePoints
    stiffness_per_area: float
    on: np.ndarray = field(init=False)
    symmetric = True

    def __post_init__(self) -> None:
        self.on = np.ones(len(self.points.areas), bool)

    @property
    def unknowns(self) -> np.ndarray:
        """See :class:`fem_reference.solid.Surface`."""
        return self.points.unknowns

    def _springs(self) -> np.ndarray:
        return self.stiffness_per_area * self.points.areas * self.on

    def force(self, x: np.ndarray) -> np.ndarray:
        """See :class:`fem_reference.solid.Surface`."""
        out = np.zeros((len(self.on), 3))
        out[:, 1] = -self._springs() * self.points.at(x)[:, 1]
        return self.points.spread(out)

    def stiffness(self, x: np.ndarray) -> sp.csr_matrix:
        """See :class:`fem_reference.solid.Surface`."""
        blocks = np.zeros((len(self.on), 3, 3))
        blocks[:, 1, 1] = self._springs()
        return self.points.stiffness(blocks)

    def commit(self, x: np.ndarray) -> None:
        """No memory."""

    def energy(self, x: np.ndarray) -> float:
        """Energy of the springs [J]."""
        return float(0.5 * (self._springs() * self.points.at(x)[:, 1] ** 2).sum())
