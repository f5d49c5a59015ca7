"""Finite-strain material laws at quadrature points: first Piola-Kirchhoff stress and its derivative, in NumPy.

Tensors are arrays [3, 3, ...] whose last axes are the quadrature points, so that one call does all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.optimize.elementwise import find_root

POLAR_STEPS = 30
POLAR_TOLERANCE = 1e-13
MARGIN = 1e-10  # part of the yield stress that a state may exceed it by: rounding
DIFFERENCE = 1e-6  # step of the central differences of a tangent [-]


class Law(Protocol):
    """What a solid needs of a material law. ``state`` is None for laws without memory."""

    @property
    def symmetric(self) -> bool:
        """Whether the tangent has the major symmetry."""
        ...

    @property
    def linear(self) -> bool:
        """Whether the tangent is a constant."""
        ...

    @property
    def elastic(self) -> Law:
        """The same law of a solid that does not yield."""
        ...

    def start(self, shape: tuple[int, ...]) -> np.ndarray | None:
        """State of undeformed points of this shape."""
        ...

    def energy(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Elastic energy per reference volume [J/m^3], of a state that is in equilibrium."""
        ...

    def stress(self, f: np.ndarray, state: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """First Piola-Kirchhoff stress [Pa] and the new state."""
        ...

    def tangent(self, f: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        """dP/dF [Pa], shape (3, 3, 3, 3, ...)."""
        ...


def cofactor(a: np.ndarray) -> np.ndarray:
    """Cofactors det(a) a^-T."""
    return np.stack([np.cross(a[(i + 1) % 3], a[(i + 2) % 3], axis=0) for i in range(3)])


def determinant(a: np.ndarray) -> np.ndarray:
    """Determinant."""
    return np.einsum("i...,i...->...", a[0], np.cross(a[1], a[2], axis=0))


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Matrix product."""
    return np.einsum("ij...,jk...->ik...", a, b)


def identity(shape: tuple[int, ...]) -> np.ndarray:
    """Unit tensors."""
    out = np.zeros((3, 3, *shape))
    out[0, 0] = out[1, 1] = out[2, 2] = 1.0
    return out


def rotation(f: np.ndarray) -> np.ndarray:
    """Rotation R of the polar decomposition F = R U by Newton's iteration (Higham 1986), for det F > 0."""
    r = f.copy()
    for _ in range(POLAR_STEPS):
        new = 0.5 * (r + cofactor(r) / determinant(r))
        change = np.abs(new - r).max()
        r = new
        if change < POLAR_TOLERANCE:
            break
    return r


def mises(tau: np.ndarray) -> np.ndarray:
    """von Mises equivalent of symmetric stresses [Pa]."""
    dev = tau - (tau[0, 0] + tau[1, 1] + tau[2, 2]) / 3 * identity(tau.shape[2:])
    return np.sqrt(1.5 * np.einsum("ij...,ij...->...", dev, dev))


@dataclass(frozen=True)
class Linear:
    """Hooke's law of small strains, eps = sym(F - 1): energy ``mu |eps|^2 + lambda/2 (tr eps)^2``.

    Attributes: mu [Pa]; lam, first Lame constant [Pa].
    """

    mu: float
    lam: float
    symmetric = True
    linear = True

    @property
    def elastic(self) -> Linear:
        """This law itself."""
        return self

    def start(self, shape: tuple[int, ...]) -> None:
        """No memory."""

    def energy(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Energy per volume [J/m^3]."""
        e = self._strain(f)
        trace = e[0, 0] + e[1, 1] + e[2, 2]
        return self.mu * np.einsum("ij...,ij...->...", e, e) + self.lam / 2 * trace**2

    def stress(self, f: np.ndarray, state: np.ndarray | None = None) -> tuple[np.ndarray, None]:
        """sigma = 2 mu eps + lambda tr eps 1 [Pa]."""
        e = self._strain(f)
        return 2 * self.mu * e + self.lam * (e[0, 0] + e[1, 1] + e[2, 2]) * identity(e.shape[2:]), None

    def tangent(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """dsigma/dF."""
        out = np.zeros((3, 3, *f.shape))
        for i in range(3):
            for k in range(3):
                out[i, i, k, k] += self.lam
                out[i, k, i, k] += self.mu
                out[i, k, k, i] += self.mu
        return out

    @staticmethod
    def _strain(f: np.ndarray) -> np.ndarray:
        return 0.5 * (f + np.swapaxes(f, 0, 1)) - identity(f.shape[2:])


@dataclass(frozen=True)
class Corotated:
    """Fixed-corotated energy ``mu |F - R|^2 + lambda/2 (J - 1)^2`` (Stomakhin et al. 2012), the particle solver's.

    Attributes: mu [Pa]; lam, first Lame constant [Pa].
    """

    mu: float
    lam: float
    symmetric = True
    linear = False

    @property
    def elastic(self) -> Corotated:
        """This law itself."""
        return self

    def start(self, shape: tuple[int, ...]) -> None:
        """No memory."""

    def energy(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Energy per reference volume [J/m^3]."""
        e = f - rotation(f)
        return self.mu * np.einsum("ij...,ij...->...", e, e) + self.lam / 2 * (determinant(f) - 1) ** 2

    def stress(self, f: np.ndarray, state: np.ndarray | None = None) -> tuple[np.ndarray, None]:
        """P = 2 mu (F - R) + lambda (J - 1) cof F [Pa]."""
        return 2 * self.mu * (f - rotation(f)) + self.lam * (determinant(f) - 1) * cofactor(f), None

    def tangent(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """dP/dF; the derivative of R is R W with the skew W that solves (tr S I - S) w = axial(R^T dF - dF^T R)."""
        r, c, j = rotation(f), cofactor(f), determinant(f)
        s = np.einsum("ki...,kj...->ij...", r, f)
        m = (s[0, 0] + s[1, 1] + s[2, 2]) * identity(s.shape[2:]) - s
        inverse = cofactor(m) / determinant(m)
        levi = np.zeros((3, 3, 3))
        for i in range(3):
            levi[i, (i + 1) % 3, (i + 2) % 3], levi[i, (i + 2) % 3, (i + 1) % 3] = 1.0, -1.0
        # dR_ij / dF_kl = R_io eps_ojp m^-1_pm eps_mnl R_kn (signs of both permutation symbols cancel)
        turn = np.einsum("mnl,kn...->mkl...", levi, r)
        axial = np.einsum("pm...,mkl...->pkl...", inverse, turn)
        out = -2 * self.mu * np.einsum("io...,ojp,pkl...->ijkl...", r, levi, axial, optimize=True)
        h = c / j
        out += self.lam * (2 * j - 1) * j * np.einsum("ij...,kl...->ijkl...", h, h)
        out -= self.lam * (j - 1) * j * np.einsum("il...,kj...->ijkl...", h, h)
        for i in range(3):
            for k in range(3):
                out[i, k, i, k] += 2 * self.mu
        return out


@dataclass(frozen=True)
class NeoHookean:
    """mu/2 (tr F^T F - 3 - 2 ln J) + lambda/2 (ln J)^2, tau = mu (B - 1) + lambda ln J 1.

    Attributes: mu [Pa]; lam, first Lame constant [Pa].
    """

    mu: float
    lam: float
    symmetric = True
    linear = False

    @property
    def elastic(self) -> NeoHookean:
        """This law itself."""
        return self

    def start(self, shape: tuple[int, ...]) -> None:
        """No memory."""

    def energy(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Energy per reference volume [J/m^3]."""
        log = np.log(determinant(f))
        return self.mu / 2 * (np.einsum("ij...,ij...->...", f, f) - 3 - 2 * log) + self.lam / 2 * log**2

    def stress(self, f: np.ndarray, state: np.ndarray | None = None) -> tuple[np.ndarray, None]:
        """P = mu (F - F^-T) + lambda ln J F^-T [Pa]."""
        j = determinant(f)
        h = cofactor(f) / j
        return self.mu * (f - h) + self.lam * np.log(j) * h, None

    def tangent(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """dP/dF."""
        j = determinant(f)
        h = cofactor(f) / j
        out = self.lam * np.einsum("ij...,kl...->ijkl...", h, h)
        out += (self.mu - self.lam * np.log(j)) * np.einsum("il...,kj...->ijkl...", h, h)
        for i in range(3):
            for k in range(3):
                out[i, k, i, k] += self.mu
        return out


@dataclass(frozen=True, eq=False)
class Graded:
    """A law whose stresses differ from point to point by a factor: layers of other stiffness that yield at one strain.

    Attributes: law, that of a factor of 1; factor [-], one for each quadrature point.
    """

    law: Law
    factor: np.ndarray

    @property
    def symmetric(self) -> bool:
        """As of the law."""
        return self.law.symmetric

    @property
    def linear(self) -> bool:
        """As of the law."""
        return self.law.linear

    @property
    def elastic(self) -> Graded:
        """As of the law."""
        return Graded(self.law.elastic, self.factor)

    def start(self, shape: tuple[int, ...]) -> np.ndarray | None:
        """As of the law."""
        return self.law.start(shape)

    def energy(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Energy per volume [J/m^3]."""
        return self.factor * self.law.energy(f, state)

    def stress(self, f: np.ndarray, state: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """First Piola-Kirchhoff stress [Pa] and the new state."""
        p, after = self.law.stress(f, state)
        return self.factor * p, after

    def tangent(self, f: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        """dP/dF [Pa]."""
        return self.factor * self.law.tangent(f, state)


@dataclass(frozen=True)
class Plastic:
    """Corotated elasticity with a von Mises yield stress, without hardening.

    The state is the inverse of the plastic part, F = F_e F_p. A trial state beyond the yield stress comes back along
    the deviator of its left stretch at constant volume until the corotated Kirchhoff stress itself yields. The root is
    bracketed (Chandrupatla 1997), so that this law shares neither code nor iteration with the particle solver's.

    Attributes: mu [Pa]; lam, first Lame constant [Pa]; yield_stress [Pa].
    """

    mu: float
    lam: float
    yield_stress: float
    symmetric = False
    linear = False

    @property
    def elastic(self) -> Plastic:
        """Without a yield stress; its state goes on."""
        return replace(self, yield_stress=np.inf)

    def start(self, shape: tuple[int, ...]) -> np.ndarray:
        """No plastic deformation."""
        return identity(shape)

    def energy(self, f: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Energy of the elastic part per reference volume [J/m^3], the state being that after the step."""
        return Corotated(self.mu, self.lam).energy(f if state is None else product(f, state))

    def stress(self, f: np.ndarray, state: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """First Piola-Kirchhoff stress [Pa], and the inverse of the plastic deformation after it."""
        if state is None:
            raise ValueError("Plastic.stress: the state of the points is missing; begin with start(shape)")
        trial = product(f, state)
        r = rotation(trial)
        v = np.einsum("ik...,jk...->ij...", trial, r)
        j = determinant(trial)
        back = self._returned(v, j)
        tau = 2 * self.mu * (product(back, back) - back) + self.lam * j * (j - 1) * identity(j.shape)
        h = cofactor(f) / determinant(f)
        elastic = product(back, r)
        return product(tau, h), np.einsum("ki...,kj...->ij...", h, elastic)

    def tangent(self, f: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        """dP/dF by central differences of the stress, the return included."""
        out = np.empty((3, 3, *f.shape))
        for k in range(3):
            for m in range(3):
                d = np.zeros_like(f)
                d[k, m] = DIFFERENCE
                out[:, :, k, m] = (self.stress(f + d, state)[0] - self.stress(f - d, state)[0]) / (2 * DIFFERENCE)
        return out

    def _returned(self, v: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Left stretch on or inside the yield surface."""
        out = v.copy()
        flows = mises(2 * self.mu * (product(v, v) - v)) > self.yield_stress * (1 + MARGIN)
        if not flows.any():
            return out
        v, j = v[:, :, flows], j[flows]
        mean = (v[0, 0] + v[1, 1] + v[2, 2]) / 3 * identity(j.shape)
        dev = v - mean

        def scaled(a: np.ndarray, at: np.ndarray) -> np.ndarray:
            new = mean[:, :, at] + a * dev[:, :, at]
            return new * np.cbrt(j[at] / determinant(new))

        def excess(a: np.ndarray, at: np.ndarray) -> np.ndarray:
            new = scaled(a, at)
            return mises(2 * self.mu * (product(new, new) - new)) / self.yield_stress - 1

        points = np.arange(len(j))
        # nearer to the root the excess is rounding alone, in which a bracket shrinks by halves
        near = {"xatol": 1e-15, "fatol": np.finfo(float).eps * max(2 * self.mu / self.yield_stress, 1.0)}
        root = find_root(excess, (np.zeros(len(j)), np.ones(len(j))), args=(points,), tolerances=near)
        out[:, :, flows] = scaled(root.x, points)
        return out
