"""The particle solver's laws at one point, called from Python.

Taichi reads the annotations of kernels, so they are no strings here.
"""

import numpy as np
import taichi as ti

from mpm.kernels.constitutive import laws as law


@ti.data_oriented
class Point:
    """One material point in double precision, of the runtime that is started.

    Args:
        mu: Shear modulus [Pa].
        lam: First Lame constant [Pa].
        yield_stress: von Mises yield stress [Pa].
    """

    def __init__(self, mu, lam, yield_stress=1e300):
        self.mu, self.lam, self.flow = mu, lam, yield_stress
        self.f = ti.Matrix.field(3, 3, ti.f64, ())
        self.tau = ti.Matrix.field(3, 3, ti.f64, ())
        self.numbers = ti.field(ti.f64, 4)

    def stress(self, f):
        """Elastic deformation gradient and Kirchhoff stress [Pa] after the return of a trial state, both (3, 3)."""
        self.f[None] = f
        self._respond()
        return self.f.to_numpy(), self.tau.to_numpy()

    def damage(self, kappa, eps0, eps_f):
        """Damage at a largest strain [-].

        Args:
            kappa: Largest strain so far [-].
            eps0: Strain at which damage begins [-].
            eps_f: Strain that sets how fast it grows [-].

        Returns:
            The damage [-], from 0 to 1.
        """
        self.numbers.from_numpy(np.array([kappa, eps0, eps_f, 0.0]))
        self._soften()
        return self.numbers[3]

    @ti.kernel
    def _respond(self):
        for _ in range(1):
            f = self.f[None]
            j = f.determinant()
            v = law.left_stretch(law.left_cauchy_green(f), j)
            xx, yy, zz, yz, xz, xy = law.deviator_stress(v[0], v[1], v[2], v[3], v[4], v[5], self.mu)
            mises2 = law.mises_squared(xx, yy, zz, yz, xz, xy)
            if mises2 > self.flow * self.flow:
                back = law.j2_return_one(v, j, mises2, self.mu, self.flow)
                self.f[None] = law.full(back) @ (law.full(law.cofactor(v)) @ f) / j
                xx, yy, zz, yz, xz, xy = law.deviator_stress(
                    back[0], back[1], back[2], back[3], back[4], back[5], self.mu
                )
            tau = ti.Vector([xx, yy, zz, yz, xz, xy]) + self.lam * j * (j - 1) * law.unit()
            self.tau[None] = law.full(tau)

    @ti.kernel
    def _soften(self):
        self.numbers[3] = law.damage_of(self.numbers[0], self.numbers[1], self.numbers[2])
