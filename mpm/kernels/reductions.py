"""What is read out of a run: the nodes in reach of the particles, their momentum and energy, what the tools were booked."""

import taichi as ti

from mpm.kernels.constitutive import damage_of, deviatoric_energy, left_cauchy_green, left_stretch, unit
from mpm.kernels.crack import PUSHED
from mpm.kernels.fields import (
    BOOKED,
    COUNT,
    DX,
    EACH,
    EDGE,
    EPS0,
    EPSF,
    FACE,
    FAR,
    HOT,
    LAM,
    LINE,
    MASS,
    MU,
    N_POSE,
    N_STATE,
    N_SUMS,
    NODES,
    PART,
    PLANE,
    ROW,
    VOL,
)
from mpm.kernels.stress import Stress

MARGIN = 3  # cells by which the window exceeds the particles; it is renewed at every output


class Survey(Stress):
    """Loops over all particles that change none."""

    @ti.func
    def measured(self, cut, p):
        """Momentum (3), kinetic and elastic energy of a particle [N s, J].

        The kinetic energy is that of the motion, without what contact has just given, as the stress that will balance it has
        not acted yet: food at rest on a board would else have the energy of the fall that the board stops in every step.
        """
        m, u = self.par[cut, MASS] * self.bulk[cut, p], self.v[cut, p]
        spin = self.gradient_of(cut, p).norm_sqr()
        f = self.deformation_of(cut, p)
        j = f.determinant()
        v = unit()
        if j > 0:
            v = left_stretch(left_cauchy_green(f), j)
        d = 0.0
        if ti.static(self.damage):
            d = damage_of(self.kappa[cut, p], self.par[cut, EPS0], self.par[cut, EPSF])
        vol = 0.5 * self.par[cut, LAM] * (j - 1) ** 2
        dev = deviatoric_energy(v, self.par[cut, MU])
        if ti.static(self.branches > 0):
            held = 1.0
            stored = 0.0
            for b in ti.static(range(self.branches)):
                held -= self.share_of[cut, b]
                stored += self.memory[cut, b, p].norm_sqr() / (4 * self.par[cut, MU] * self.share_of[cut, b])
            dev = held * dev + stored
        keep = 1.0 - d
        gift = self.lever[cut, p, 0][3] if self.layers[cut, p] & PUSHED else 0.0
        kinetic = m * (0.5 * u.norm_sqr() - gift + 0.125 * self.par[cut, DX] * self.par[cut, DX] * spin)
        energy = self.par[cut, VOL] * self.bulk[cut, p] * (keep * dev + (keep if j > 1 else 1.0) * vol)
        return ti.Vector([m * u[0], m * u[1], m * u[2], kinetic, energy])

    @ti.func
    def report(self, cut, row, out: ti.template()):
        """Write what was booked since the last report, the state of the particles and the pose; clear what was booked.

        Images of mirrors are not counted.
        """
        for q in range(self.loop(cut, EACH)):
            c, _, _ = self.whose(cut, q, EACH)
            for r in range(N_STATE):
                self.state[c, r] = 0.0
        for q in range(self.loop(cut, PART)):
            c, part, there = self.whose(cut, q, PART)
            first, last, _ = self.share(c, part)
            if there and first < last:
                total = ti.Vector.zero(ti.f64, N_STATE)
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[c, COUNT])):
                    total += self.measured(c, p)
                for r in ti.static(range(N_STATE)):
                    self.state[c, r] += total[r]
        for q in range(self.loop(cut, EACH)):
            c, _, _ = self.whose(cut, q, EACH)
            for r in range(N_STATE):
                out[c, row, N_SUMS + r] = self.state[c, r]
            for r in range(N_POSE):
                out[c, row, N_SUMS + N_STATE + r] = self.pose[c, r]
            self.pose[c, BOOKED] -= self.sums[c, EDGE + 2] + self.sums[c, FACE + 2]  # the arm has felt that
            for r in range(N_SUMS):
                out[c, row, r] = self.sums[c, r]
                self.sums[c, r] = 0.0

    @ti.func
    def look_around(self, cut):
        """Find the window: the nodes that any particle touches, some more, and those that mirrors fold back."""
        for q in range(self.loop(cut, EACH)):
            c, _, _ = self.whose(cut, q, EACH)
            for d in ti.static(range(3)):
                self.window[c, d], self.window[c, d + 3] = FAR, -FAR
            if ti.static(self.atomic):
                for what in ti.static((ROW, LINE, HOT)):
                    self.most[what] = 0
        for q in range(self.loop(cut, PART)):
            c, part, there = self.whose(cut, q, PART)
            first, last, _ = self.share(c, part)
            if there and first < last:
                low, high = ti.Vector([FAR, FAR, FAR]), ti.Vector([-FAR, -FAR, -FAR])
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[c, COUNT])):
                    base, fx = self.local(c, self.x[c, p])
                    for d in ti.static(range(3)):
                        place = ti.min(ti.max(base[d], -FAR // 2), FAR // 2)
                        low[d], high[d] = ti.min(low[d], place), ti.max(high[d], place)
                for d in ti.static(range(3)):
                    ti.atomic_min(self.window[c, d], low[d])
                    ti.atomic_max(self.window[c, d + 3], high[d])
        for q in range(self.loop(cut, EACH)):
            c, _, _ = self.whose(cut, q, EACH)
            for d in ti.static(range(3)):
                low, high = self.window[c, d] - MARGIN, self.window[c, d + 3] + MARGIN + 3
                if ti.static((self.mx, self.my, False)[d]):
                    plane = self.i0 if ti.static(d == 0) else self.size[c, PLANE]
                    low, high = ti.min(low, plane - 2), ti.max(high, plane + 3)
                self.window[c, d] = ti.max(low, 0)
                self.window[c, d + 3] = ti.max(ti.min(high, self.size[c, NODES + d]), self.window[c, d])
            if ti.static(self.atomic):
                for what in ti.static((ROW, LINE)):
                    ti.atomic_max(self.most[what], self.places(c, what))
                ti.atomic_max(self.most[HOT], self.places(c, ROW))
