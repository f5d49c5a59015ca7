"""What is read out of a run: the nodes in reach of the particles, their momentum and energy, what the tools were booked."""

import taichi as ti

from mpm.constitutive import damage_of, deviatoric_energy, left_cauchy_green, left_stretch, unit
from mpm.fields import (
    BOOKED,
    COUNT,
    DX,
    EDGE,
    EPS0,
    EPSF,
    FACE,
    FAR,
    LAM,
    MASS,
    MU,
    N_POSE,
    N_STATE,
    N_SUMS,
    NODES,
    PLANE,
    VOL,
)
from mpm.stress import Stress

MARGIN = 3  # cells by which the window exceeds the particles; it is renewed at every output


@ti.data_oriented
class Survey(Stress):
    """Loops over all particles that change none."""

    @ti.func
    def measured(self, p):
        """Momentum (3), kinetic and elastic energy of a particle [N s, J].

        The kinetic energy is that of the motion, without what contact has just given, as the stress that will balance it has
        not acted yet: food at rest on a board would else have the energy of the fall that the board stops in every step.
        """
        m, u = self.par[MASS] * self.bulk[p], self.v[p]
        spin = self.gradient_of(p).norm_sqr()
        f = self.deformation_of(p)
        j = f.determinant()
        v = unit()
        if j > 0:
            v = left_stretch(left_cauchy_green(f), j)
        d = 0.0
        if ti.static(self.damage):
            d = damage_of(self.kappa[p], self.par[EPS0], self.par[EPSF])
        vol = 0.5 * self.par[LAM] * (j - 1) ** 2
        dev = deviatoric_energy(v, self.par[MU])
        if ti.static(self.branches > 0):
            held = 1.0
            stored = 0.0
            for b in ti.static(range(self.branches)):
                held -= self.share_of[b]
                stored += self.memory[b, p].norm_sqr() / (4 * self.par[MU] * self.share_of[b])
            dev = held * dev + stored
        keep = 1.0 - d
        kinetic = m * (0.5 * u.norm_sqr() - self.lever[p, 0][3] + 0.125 * self.par[DX] * self.par[DX] * spin)
        energy = self.par[VOL] * self.bulk[p] * (keep * dev + (keep if j > 1 else 1.0) * vol)
        return ti.Vector([m * u[0], m * u[1], m * u[2], kinetic, energy])

    @ti.func
    def report(self, out: ti.template(), row):
        """Write what was booked since the last report, the state of the particles and the pose; clear what was booked.

        Images of mirrors are not counted.
        """
        for r in range(N_STATE):
            self.state[r] = 0.0
        for part in range(self.shares()):
            first, last, _ = self.share(part)
            if first < last:
                total = ti.Vector.zero(ti.f64, N_STATE)
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[COUNT])):
                    total += self.measured(p)
                for r in ti.static(range(N_STATE)):
                    self.state[r] += total[r]
        for _ in range(1):
            for r in range(N_STATE):
                out[row, N_SUMS + r] = self.state[r]
            for r in range(N_POSE):
                out[row, N_SUMS + N_STATE + r] = self.pose[r]
            self.pose[BOOKED] -= self.sums[EDGE + 2] + self.sums[FACE + 2]  # the arm has felt that
            for r in range(N_SUMS):
                out[row, r] = self.sums[r]
                self.sums[r] = 0.0

    @ti.func
    def look_around(self):
        """Find the window: the nodes that any particle touches, some more, and those that mirrors fold back."""
        for _ in range(1):
            for d in ti.static(range(3)):
                self.window[d], self.window[d + 3] = FAR, -FAR
        for part in range(self.shares()):
            first, last, _ = self.share(part)
            if first < last:
                low, high = ti.Vector([FAR, FAR, FAR]), ti.Vector([-FAR, -FAR, -FAR])
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[COUNT])):
                    base, fx = self.local(self.x[p])
                    for d in ti.static(range(3)):
                        place = ti.min(ti.max(base[d], -FAR // 2), FAR // 2)
                        low[d], high[d] = ti.min(low[d], place), ti.max(high[d], place)
                for d in ti.static(range(3)):
                    ti.atomic_min(self.window[d], low[d])
                    ti.atomic_max(self.window[d + 3], high[d])
        for _ in range(1):
            for d in ti.static(range(3)):
                low, high = self.window[d] - MARGIN, self.window[d + 3] + MARGIN + 3
                if ti.static((self.mx, self.my, False)[d]):
                    plane = self.i0 if ti.static(d == 0) else self.size[PLANE]
                    low, high = ti.min(low, plane - 2), ti.max(high, plane + 3)
                self.window[d] = ti.max(low, 0)
                self.window[d + 3] = ti.min(high, self.size[NODES + d])
