"""Change of volume from its linear projection in each element: elements of order 2 that do not lock."""

from __future__ import annotations

import numpy as np

from fem_reference.laws import Law, cofactor, determinant, identity, product

CHUNK = 64  # elements whose tangents are computed at a time: bounds the memory


class Dilatation:
    """Mixed elements with linear discontinuous pressure and volume (Simo, Taylor and Pister 1985).

    Displacement, pressure p and volume ratio J' are independent fields. p and J' are linear in each element and may
    jump between elements, so that both are eliminated element by element: J' is the projection of J = det F, and the
    law sees ``F' = (J' / J)^(1/3) F``. With quadratic displacements the pair satisfies the inf-sup condition (Q2/P1:
    Boffi, Brezzi and Fortin 2013, section 8.6), so that neither nearly incompressible solids nor plastic flow, which
    keeps the volume, lock. Any law can be used, since the law itself does not change.

    Args:
        points: Places of the quadrature points [m], shape (3, elements, points).
        weights: Reference volume that each stands for [m^3], shape (elements, points).
    """

    def __init__(self, points: np.ndarray, weights: np.ndarray) -> None:
        centre = points.mean(axis=2, keepdims=True)
        size = np.abs(points - centre).max(axis=(1, 2))
        axes = np.flatnonzero(size > 0)  # a plane solid has no extent along x
        local = (points - centre)[axes] / size[axes, None, None]
        self._monomials = np.concatenate([np.ones((1, *weights.shape)), local])
        self._inverse = np.linalg.inv(np.einsum("keq,meq,eq->ekm", self._monomials, self._monomials, weights))
        self._weights = weights

    def project(self, values: np.ndarray) -> np.ndarray:
        """Linear function of each element that is nearest to values [...], shape (..., elements, points)."""
        moments = np.einsum("keq,...eq->...ek", self._monomials * self._weights, values)
        return np.einsum("keq,ekm,...em->...eq", self._monomials, self._inverse, moments, optimize=True)

    def deformation(self, f: np.ndarray) -> np.ndarray:
        """Deformation gradients that the law sees [-], shape (3, 3, elements, points), from those of the
        displacements."""
        j = determinant(f)
        return np.cbrt(self.project(j) / j) * f

    def stress(self, law: Law, f: np.ndarray, state: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """First Piola-Kirchhoff stress that works on the gradient of the displacements, and the law's new state.

        Args:
            law: Material law.
            f: Deformation gradients of the displacements [-], shape (3, 3, elements, points).
            state: The law's memory [-], shape (3, 3, elements, points), or None.

        Returns:
            ``P = (dev tau + J pi 1) F^-T`` [Pa], shape (3, 3, elements, points), tau the law's Kirchhoff stress and pi
            the projection of its mean over J'; and the state.
        """
        j = determinant(f)
        mean = self.project(j)
        seen = np.cbrt(mean / j) * f
        p, after = law.stress(seen, state)
        tau = product(p, np.swapaxes(seen, 0, 1))
        third = (tau[0, 0] + tau[1, 1] + tau[2, 2]) / 3
        tau = tau + (j * self.project(third / mean) - third) * identity(j.shape)
        return product(tau, cofactor(f) / j), after

    def tangent(self, law: Law, f: np.ndarray, state: np.ndarray | None, gradients: np.ndarray) -> np.ndarray:
        """Consistent tangents of the elements: the second variation of the energy of F'.

        Args:
            law: Material law.
            f: Deformation gradients of the displacements [-], shape (3, 3, elements, points).
            state: The law's memory [-], shape (3, 3, elements, points), or None.
            gradients: Gradients of the shape functions [1/m], shape (functions, 3, elements, points).

        Returns:
            Stiffness between the unknowns (3 function + axis) [N/m], shape (unknowns, unknowns, elements).
        """
        j = determinant(f)
        mean = self.project(j)
        seen = np.cbrt(mean / j) * f
        p, _ = law.stress(seen, state)
        a = law.tangent(seen, state)
        tau = product(p, np.swapaxes(seen, 0, 1))
        third = (tau[0, 0] + tau[1, 1] + tau[2, 2]) / 3
        pressure = self.project(third / mean)
        spatial = np.einsum("ajeq,jieq->aieq", gradients, np.swapaxes(cofactor(f) / j, 0, 1))
        functions, elements = len(gradients), j.shape[0]
        out = np.empty((3 * functions, 3 * functions, elements))
        for start in range(0, elements, CHUNK):
            at = slice(start, start + CHUNK)
            w, g = self._weights[at], spatial[:, :, at]
            volume = self._part(at, j[at] * g) / mean[at]  # change of J' over J' by each unknown
            shift = (volume - g) / 3
            strain = np.zeros((functions, 3, 3, 3, *w.shape))  # variation of F' by each unknown
            for axis in range(3):
                strain[:, axis, axis] = np.cbrt(mean / j)[at] * gradients[:, :, at]
            strain += shift[:, :, None, None] * seen[:, :, at]
            strain = strain.reshape(3 * functions, 9, -1, w.shape[1])
            work = np.einsum("mneq,bneq,eq->bmeq", a[:, :, :, :, at].reshape(9, 9, -1, w.shape[1]), strain, w)
            k = np.einsum("ameq,bmeq->abe", strain, work, optimize=True)
            flat, vol, s = (v.reshape(3 * functions, -1, w.shape[1]) for v in (g, volume, shift))
            load = np.einsum("ijeq,ajeq->aieq", tau[:, :, at], g).reshape(flat.shape)
            t, pr = third[at], pressure[at] * j[at]
            k += np.einsum("aeq,beq,eq->abe", load, s, w, optimize=True)
            k += np.einsum("aeq,beq,eq->abe", s, load, w, optimize=True)
            k += np.einsum("aeq,beq,eq->abe", s, s, 3 * w * t, optimize=True)
            k += np.einsum("aeq,beq,eq->abe", flat, flat, w * pr, optimize=True)
            k -= np.einsum("aeq,beq,eq->abe", vol, vol, w * t, optimize=True)
            crossed = np.einsum("akeq,bieq,eq->aibke", g, g, w * (t - pr), optimize=True)
            out[:, :, at] = k + crossed.reshape(k.shape)
        return out

    def _part(self, at: slice, values: np.ndarray) -> np.ndarray:
        """Projection for some of the elements."""
        m = self._monomials[:, at]
        moments = np.einsum("keq,...eq->...ek", m * self._weights[at], values)
        return np.einsum("keq,ekm,...em->...eq", m, self._inverse[at], moments, optimize=True)
