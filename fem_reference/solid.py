"""A solid of finite elements: residual, consistent tangent and equilibrium by Newton's method with a line search."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pyamg
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import skfem as sk

from fem_reference.condensation import Condensation
from fem_reference.contact import Contact
from fem_reference.dilatation import Dilatation
from fem_reference.laws import Law, determinant, identity
from mpm.scene.errors import CutcalError

ELEMENTS = {
    ("quad", 1): (sk.ElementQuad1, 2),
    ("quad", 2): (sk.ElementQuad2, 4),
    ("hex", 1): (sk.ElementHex1, 2),
    ("hex", 2): (sk.ElementHex2, 4),
    ("tet", 1): (sk.ElementTetP1, 1),
    ("tet", 2): (sk.ElementTetP2, 2),
}
"""Scalar element and order of quadrature by kind of mesh and order."""
DIRECT = 4_000  # unknowns up to which a sparse factorisation is faster than multigrid
NEWTON_STEPS = 40
TOLERANCE = 1e-7  # of the residual over the forces in the solid
SLOPPY = 1e-6  # residual of a linear solution over that at its start
CUTS = 10  # halvings of the line search
ENOUGH = 0.9  # work of the forces out of balance after a step over that before it
EAGER = 8  # renewals of the contact pressures after which only half is added: a row of nodes may jump to and fro
LEAST = 0.1  # part of a step that is taken even so, as where contacts come and go


class EquilibriumError(CutcalError):
    """Newton's method found no equilibrium."""


class Surface(Protocol):
    """Forces on the surface of a solid that depend on where its nodes are, with a memory of their own."""

    @property
    def symmetric(self) -> bool:
        """Whether the stiffness is symmetric."""
        ...

    @property
    def unknowns(self) -> np.ndarray:
        """Unknowns (3 node + axis) on which and by which it acts, shape (m,)."""
        ...

    def force(self, x: np.ndarray) -> np.ndarray:
        """Force on every node of the solid [N], shape (n, 3), the nodes being at ``x`` [m], shape (n, 3)."""
        ...

    def stiffness(self, x: np.ndarray) -> sp.csr_matrix:
        """What the forces add to the tangent, less their derivative [N/m], shape (3 n, 3 n)."""
        ...

    def commit(self, x: np.ndarray) -> None:
        """Take the places of the nodes [m], shape (n, 3), into the memory: they are in equilibrium."""
        ...


@dataclass
class Solid:
    """A meshed body with a material law.

    A mesh of quadrilaterals is a section of the plane x = 0 in plane strain: its two coordinates are y and z, every
    node is held along x, and forces, energies and weights are per metre of width along x.

    Args:
        mesh: Hexahedra, tetrahedra, or quadrilaterals in plane strain [m].
        law: Material law.
        order: Order of the elements, 1 or 2.
        mixed: Whether the change of volume is taken from its linear projection in each element, which needs order 2:
            for nearly incompressible solids and for plastic flow (:mod:`fem_reference.dilatation`).
        tolerance: Forces out of balance that are small enough, over those in the solid.

    Attributes:
        nodes: Places of the element's nodes, of second order also those in the middle of edges [m], shape (n, 3).
        places: Those of the quadrature points in the undeformed body [m], shape (3, elements, points).
        u: Displacements in equilibrium [m], shape (n, 3).
        state: Memory of the law at the quadrature points, or None.
        body: Force per reference volume at the quadrature points [N/m^3], shape (3, elements, points), or None.
        load: Forces on the nodes [N], shape (n, 3).
        contacts: Pairs of nodes and obstacle.
        surfaces: Further forces on the surface that depend on the displacements.
    """

    mesh: sk.Mesh
    law: Law
    order: int = 1
    mixed: bool = False
    tolerance: float = TOLERANCE
    nodes: np.ndarray = field(init=False)
    places: np.ndarray = field(init=False)
    u: np.ndarray = field(init=False)
    state: np.ndarray | None = field(init=False)
    body: np.ndarray | None = field(init=False, default=None)
    load: np.ndarray = field(init=False)
    contacts: list[Contact] = field(init=False, default_factory=list)
    surfaces: list[Surface] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.plane = isinstance(self.mesh, sk.MeshQuad)
        kind = "quad" if self.plane else "hex" if isinstance(self.mesh, sk.MeshHex) else "tet"
        element, points = ELEMENTS[kind, self.order]
        self.element = element()
        self.basis = sk.CellBasis(self.mesh, self.element, intorder=points)
        self.nodes = self._spatial(self.basis.doflocs).T.copy()
        self.cells = self.basis.element_dofs
        self.gradients = np.stack([self._spatial(b[0].grad) for b in self.basis.basis])  # [function, 3, element, point]
        self.values = np.stack([b[0] + np.zeros_like(self.basis.dx) for b in self.basis.basis])
        self.weights = self.basis.dx
        self.u, self.load = np.zeros_like(self.nodes), np.zeros_like(self.nodes)
        self.state = self.law.start(self.weights.shape)
        self.fixed: dict[int, float] = {}  # unknown (3 node + axis): displacement [m]
        if self.plane:
            self.hold(np.arange(len(self.nodes)), [0])
        self._condensed: Condensation | None = None
        self._constant: sp.csr_matrix | None = None  # tangent of a linear law
        self.places = self._spatial(np.asarray(self.basis.global_coordinates()))
        self._dilatation = Dilatation(self.places, self.weights)
        count = 3 * len(self.cells)
        unknowns = (3 * self.cells[:, None] + np.arange(3)[:, None]).reshape(count, -1)  # [3 function + axis, element]
        self._scatter = unknowns
        self._rows = np.broadcast_to(unknowns[:, None], (count, count, unknowns.shape[1])).ravel()
        self._columns = np.broadcast_to(unknowns[None], (count, count, unknowns.shape[1])).ravel()

    def hold(self, nodes: np.ndarray, axes: Sequence[int], value: float = 0.0) -> None:
        """Prescribe a displacement.

        Args:
            nodes: Indices of the nodes [-], shape (n,).
            axes: Axes, 0 to 2.
            value: Displacement along them [m].
        """
        for axis in axes:
            self.fixed |= dict.fromkeys((3 * np.asarray(nodes) + axis).tolist(), value)

    def areas(self, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of some facets and the reference area that each stands for [m^2].

        The areas are the integrals of the shape functions; of quadratic tetrahedra only nodes in the middle of edges
        have one, and with those the sum over the nodes is exact to second order.
        """
        basis = sk.FacetBasis(self.mesh, self.element, facets=facets, intorder=2 * self.order)
        area = np.zeros(len(self.nodes))
        for b, dofs in zip(basis.basis, basis.element_dofs, strict=True):
            np.add.at(area, dofs, (b[0] * basis.dx).sum(axis=1))
        nodes = np.flatnonzero(area > 1e-9 * area.max())
        return nodes, area[nodes]

    def press(self, facets: np.ndarray, pressure: float) -> None:
        """Add a pressure on the undeformed facets to the load [Pa]."""
        basis = sk.FacetBasis(self.mesh, self.element, facets=facets, intorder=2 * self.order)
        for b, dofs in zip(basis.basis, basis.element_dofs, strict=True):
            share = -pressure * (b[0] * self._spatial(np.asarray(basis.normals)) * basis.dx).sum(axis=2)
            np.add.at(self.load, dofs, share.T)

    def project(self, values: np.ndarray) -> np.ndarray:
        """Values at the nodes, shape (n,), nearest in the mean square to those at the quadrature points."""
        return self.basis.project(values)

    def deformation(self, u: np.ndarray) -> np.ndarray:
        """Deformation gradients [3, 3, element, point]."""
        local = u[self.cells]  # [function, element, 3]
        return np.einsum("aei,ajeq->ijeq", local, self.gradients, optimize=True) + identity(self.weights.shape)

    def energy(self, u: np.ndarray) -> float:
        """Elastic energy [J], of a law with a memory that of the state in equilibrium."""
        f = self.deformation(u)
        f = self._dilatation.deformation(f) if self.mixed else f
        return float((self.law.energy(f, self.state) * self.weights).sum())

    def forces(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Internal forces less body forces on the nodes [N], shape (n, 3), and the state after the step."""
        f = self.deformation(u)
        if self.mixed:
            p, state = self._dilatation.stress(self.law, f, self.state)
        else:
            p, state = self.law.stress(f, self.state)
        local = np.einsum("ijeq,ajeq->aie", p * self.weights, self.gradients, optimize=True)
        if self.body is not None:
            local -= np.einsum("aeq,ieq->aie", self.values, self.body * self.weights, optimize=True)
        flat = np.bincount(self._scatter.ravel(), local.reshape(self._scatter.shape).ravel(), 3 * len(self.nodes))
        return flat.reshape(-1, 3), state

    def stiffness(self, u: np.ndarray, flow: bool = True) -> sp.csr_matrix:
        """Consistent tangent, without ``flow`` that of a solid that does not yield [N/m]."""
        law = self.law if flow else self.law.elastic
        if self._constant is not None:
            return self._constant
        f = self.deformation(u)
        if self.mixed:
            local = self._dilatation.tangent(law, f, self.state, self.gradients)
        else:
            a = law.tangent(f, self.state) * self.weights
            half = np.einsum("ijkleq,bleq->ijkbeq", a, self.gradients, optimize=True)
            local = np.einsum("ajeq,ijkbeq->aibke", self.gradients, half, optimize=True)
        size = 3 * len(self.nodes)
        out = sp.coo_matrix((local.ravel(), (self._rows, self._columns)), shape=(size, size)).tocsr()
        self._constant = out if law.linear and not self.mixed else None
        return out

    def residual(self, u: np.ndarray) -> tuple[np.ndarray, float]:
        """Forces out of balance [N], shape (3 n,), and the size of those in the solid [N]."""
        inner, _ = self.forces(u)
        out = inner - self.load
        for contact in self.contacts:
            np.add.at(out, contact.nodes, -contact.force(self.nodes + u))
        for surface in self.surfaces:
            out -= surface.force(self.nodes + u)
        return out.ravel(), float(np.linalg.norm(inner)) + float(np.linalg.norm(self.load))

    def solve(self) -> None:
        """Bring ``u`` and ``state`` to equilibrium with what is held, loaded and touched.

        Contact pressures are multipliers that are renewed until the obstacles are penetrated by less than their
        tolerance (augmented Lagrangian, Simo and Laursen 1992).

        Raises:
            EquilibriumError: No equilibrium in reach; ``u`` and ``state`` are those before the call.
        """
        before = self.u.copy(), [c.pressure.copy() for c in self.contacts]
        try:
            u = self._newton(self._held(self.u))
            for k in range(NEWTON_STEPS):
                if not [c for c in self.contacts if not c.settle(self.nodes + u, 1.0 if k < EAGER else 0.5)]:
                    break
                u = self._newton(u)
            else:
                raise EquilibriumError("finite elements: the contact pressures do not settle; use a larger penalty")
        except EquilibriumError:
            self.u = before[0]
            for contact, pressure in zip(self.contacts, before[1], strict=True):
                contact.pressure = pressure
            raise
        self.u, (_, self.state) = u, self.forces(u)
        for surface in self.surfaces:
            surface.commit(self.nodes + u)

    def reaction(self, nodes: np.ndarray) -> np.ndarray:
        """Force of what holds or touches some nodes [N], shape (3,)."""
        inner, _ = self.forces(self.u)
        return (inner - self.load)[nodes].sum(axis=0)

    def _held(self, u: np.ndarray) -> np.ndarray:
        """Displacements with the prescribed ones put in; the others follow as an elastic solid would."""
        index = np.fromiter(self.fixed, int, len(self.fixed))
        change = np.fromiter(self.fixed.values(), float, len(self.fixed)) - u.ravel()[index]
        if not np.abs(change).max(initial=0.0) > 0:
            return u.copy()
        k = self._surface_stiffness(self.stiffness(u, flow=False), u)  # one that flows resists hardly at all
        free = np.setdiff1d(np.arange(u.size), index)
        residual, _ = self.residual(u)
        step = np.zeros(u.size)
        step[index] = change
        step[free] = self._linear(k[free][:, free], -(residual[free] + k[free][:, index] @ change), free)
        for _ in range(CUTS):
            new = u + step.reshape(-1, 3)
            if self._upright(new):
                return new
            step[free] *= 0.5
        raise EquilibriumError(
            "finite elements: the prescribed displacement turns elements inside out; use smaller steps"
        )

    def _newton(self, u: np.ndarray) -> np.ndarray:
        index = np.fromiter(self.fixed, int, len(self.fixed))
        free = np.setdiff1d(np.arange(u.size), index)
        residual, scale = self.residual(u)
        for _ in range(NEWTON_STEPS):
            size = float(np.linalg.norm(residual[free]))
            if size <= self.tolerance * scale:
                return u
            step = np.zeros(u.size)
            step[free] = self._direction(u, residual[free], free)
            u = self._search(u, step, free, residual)
            residual, scale = self.residual(u)
        raise EquilibriumError(
            f"finite elements: forces out of balance by {size / max(scale, 1e-300):.1e} of those in the solid after "
            f"{NEWTON_STEPS} steps; use smaller load steps or a finer mesh"
        )

    def _direction(self, u: np.ndarray, residual: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Newton's step of the free unknowns [m]; a linear solid with forces on its surface is condensed to that."""
        k = self.stiffness(u)
        if not self.surfaces or self.contacts or self._constant is None:
            return self._linear(self._surface_stiffness(k, u)[free][:, free], -residual, free)
        on = np.unique(np.concatenate([s.unknowns for s in self.surfaces]))
        kept = np.flatnonzero(np.isin(free, on))
        if self._condensed is None or not np.array_equal(self._condensed.kept, kept):
            self._condensed = Condensation(k[free][:, free], kept)
        added = self._surface_stiffness(sp.csr_matrix(k.shape), u)[free[kept]][:, free[kept]]
        rest = residual[self._condensed.rest]
        pulled = residual[kept] + self._condensed.pull(rest)
        step = np.linalg.solve(self._condensed.reduced + added.toarray(), -pulled)
        return self._condensed.follow(step, rest)

    def _search(self, u: np.ndarray, step: np.ndarray, free: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """The longest of the halved steps that turns no element inside out and along which the forces out of balance
        do less work than at its start (Matthies and Strang 1979)."""
        work, part = abs(float(residual[free] @ step[free])), 1.0
        for _ in range(CUTS):
            new = u + part * step.reshape(-1, 3)
            if self._upright(new):
                after, _ = self.residual(new)
                if abs(float(after[free] @ step[free])) <= ENOUGH * work or part < LEAST:
                    return new
            part *= 0.5
        raise EquilibriumError("finite elements: Newton's direction turns elements inside out; use smaller load steps")

    def _spatial(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors along the first axis in space, of a plane solid with a component of zero along x."""
        return np.concatenate([np.zeros_like(vectors[:1]), vectors]) if self.plane else vectors

    def _upright(self, u: np.ndarray) -> bool:
        """Whether no element is turned inside out."""
        j = determinant(self.deformation(u))
        return bool((j > 0).all() and (not self.mixed or (self._dilatation.project(j) > 0).all()))

    def _surface_stiffness(self, k: sp.csr_matrix, u: np.ndarray) -> sp.csr_matrix:
        for contact in self.contacts:
            nodes, blocks = contact.stiffness(self.nodes + u)
            rows = 3 * nodes[:, None, None] + np.arange(3)[:, None] + np.zeros((1, 3), int)
            columns = np.swapaxes(rows, 1, 2)
            k = k + sp.coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=k.shape).tocsr()
        for surface in self.surfaces:
            k = k + surface.stiffness(self.nodes + u)
        return k

    def _linear(self, k: sp.csr_matrix, b: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Solution of K x = b: factorised when small, else by multigrid with the rigid-body modes."""
        symmetric = self.law.symmetric and all(s.symmetric for s in self.surfaces)
        if len(b) <= DIRECT or self.plane or self.surfaces:
            return _factorised(k, b, symmetric)
        x, y, z = (self.nodes + self.u).T
        modes = np.zeros((len(self.nodes), 3, 6))
        modes[:, [0, 1, 2], [0, 1, 2]] = 1.0
        modes[:, 0, 3], modes[:, 1, 3] = -y, x
        modes[:, 1, 4], modes[:, 2, 4] = -z, y
        modes[:, 2, 5], modes[:, 0, 5] = -x, z
        method = "symmetric" if symmetric else "nonsymmetric"
        history: list[float] = []
        accelerate = "cg" if symmetric else "gmres"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a matrix that is not positive definite: solved directly
            solver = pyamg.smoothed_aggregation_solver(k.tocsr(), B=modes.reshape(-1, 6)[free], symmetry=method)
            out = solver.solve(b, tol=SLOPPY, maxiter=200, accel=accelerate, residuals=history)
        if not history[-1] <= 10 * SLOPPY * history[0]:
            return _factorised(k, b, symmetric)
        return out


def _factorised(k: sp.csr_matrix, b: np.ndarray, symmetric: bool) -> np.ndarray:
    """Solution of K x = b by a factorisation, of a symmetric K on the diagonal."""
    options: dict[str, Any] = {}
    if symmetric:
        options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
    try:
        return spl.splu(k.tocsc(), **options).solve(b)
    except RuntimeError as e:  # exactly singular
        raise EquilibriumError("finite elements: the solid can move freely; hold some of its nodes") from e
