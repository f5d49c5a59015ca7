"""Stress of the particles: many elastic ones at once, the others one by one; the smoothed strain that damages them."""

import taichi as ti

from mpm.kernels.constitutive import (
    STRETCH_TOLERANCE,
    cofactor,
    cofactors,
    damage_of,
    degrade,
    deviator_stress,
    deviatoric_energy,
    double,
    exchange,
    full,
    halley,
    j2_return,
    j2_return_one,
    largest_eigenvalue,
    left_cauchy_green,
    left_stretch,
    mises_squared,
    norm_squared,
    product_with_transpose,
    stretch_of,
    trace,
    unit,
    upper,
)
from mpm.kernels.cutting_edge import Edge
from mpm.kernels.fields import AT_REST, COUNT, EPS0, EPSF, ETA_B, ETA_S, HOT, LAM, MU, PART, ROW, YIELD


class Stress(Edge):
    """Deformation gradient and Kirchhoff stress of the particles in a time step."""

    @ti.func
    def relaxed(self, cut, p, f, v, j, mu):
        """Prony series on the deviator in the unrotated frame (Simo 1987): stress to add, and loss per volume."""
        r = full(cofactor(v)) @ f / j
        s = r.transpose() @ f
        now = 2 * mu * (s @ s - s)
        now -= now.trace() / 3 * ti.Matrix.identity(float, 3)
        add, lost = ti.Matrix.zero(float, 3, 3), 0.0
        for b in ti.static(range(self.branches)):
            share, rate = self.share_of[cut, b], self.relax[cut, b]
            decay = ti.exp(-rate)
            h = decay * self.memory[cut, b, p] + share * (1 - decay) / rate * (now - self.before[cut, p])
            self.memory[cut, b, p] = h
            add += h - share * now
            lost += h.norm_sqr() * rate / (2 * mu * share)
        self.before[cut, p] = now
        return upper(r @ add @ r.transpose()), lost

    @ti.func
    def damaged(self, cut, p, v, j, mu, lam):
        """Damage of a particle from the smoothed strain of the last step; returns it and the energy that is lost.

        Also finds the box of the particles whose strain could damage something. No principal strain exceeds the norm
        of the strain, so the others never pay for an eigenvalue.
        """
        d, lost = 0.0, 0.0
        eps0, eps_f = self.par[cut, EPS0], self.par[cut, EPSF]
        if eps0 > 0:
            before = damage_of(self.kappa[cut, p], eps0, eps_f)
            self.kappa[cut, p] = ti.max(self.kappa[cut, p], self.strain[cut, p])
            self.strain[cut, p] = 0.0
            d = damage_of(self.kappa[cut, p], eps0, eps_f)
            if d > before:  # what is compressed keeps its pressure, and so its energy
                lost = (d - before) * (deviatoric_energy(v, mu) + (0.5 * lam * (j - 1) ** 2 if j > 1 else 0.0))
            e = v - unit()
            if double(e, e) > eps0 * eps0:
                if largest_eigenvalue(e) > eps0:
                    base, fx = self.local(cut, self.x[cut, p])
                    for axis in ti.static(range(3)):
                        ti.atomic_min(self.hot[cut, axis], base[axis])
                        ti.atomic_max(self.hot[cut, axis + 3], base[axis])
        return d, lost

    @ti.func
    def slope(self, cut, block, row, column):
        """One entry of the velocity gradient for all particles of a block [1/s]."""
        return ti.Vector([self.C[cut, block * self.lanes + lane, column][row] for lane in range(self.lanes)])

    @ti.func
    def elastic(self, cut, block, dt):
        """Advance F of a block of particles and find their Kirchhoff stress and viscous loss, all at once.

        Those that are damaged or inverted, or whose stretch has not converged, are left as they are and marked;
        :meth:`stress` does them one by one.
        """
        a0, a1, a2 = self.F[cut, block, 0], self.F[cut, block, 1], self.F[cut, block, 2]
        b0, b1, b2 = self.F[cut, block, 3], self.F[cut, block, 4], self.F[cut, block, 5]
        c0, c1, c2 = self.F[cut, block, 6], self.F[cut, block, 7], self.F[cut, block, 8]
        lxx, lxy, lxz = self.slope(cut, block, 0, 0), self.slope(cut, block, 0, 1), self.slope(cut, block, 0, 2)
        lyx, lyy, lyz = self.slope(cut, block, 1, 0), self.slope(cut, block, 1, 1), self.slope(cut, block, 1, 2)
        lzx, lzy, lzz = self.slope(cut, block, 2, 0), self.slope(cut, block, 2, 1), self.slope(cut, block, 2, 2)
        d0 = a0 + dt * (lxx * a0 + lxy * b0 + lxz * c0)
        d1 = a1 + dt * (lxx * a1 + lxy * b1 + lxz * c1)
        d2 = a2 + dt * (lxx * a2 + lxy * b2 + lxz * c2)
        e0 = b0 + dt * (lyx * a0 + lyy * b0 + lyz * c0)
        e1 = b1 + dt * (lyx * a1 + lyy * b1 + lyz * c1)
        e2 = b2 + dt * (lyx * a2 + lyy * b2 + lyz * c2)
        f0 = c0 + dt * (lzx * a0 + lzy * b0 + lzz * c0)
        f1 = c1 + dt * (lzx * a1 + lzy * b1 + lzz * c1)
        f2 = c2 + dt * (lzx * a2 + lzy * b2 + lzz * c2)
        j = d0 * (e1 * f2 - e2 * f1) + d1 * (e2 * f0 - e0 * f2) + d2 * (e0 * f1 - e1 * f0)
        xx, yy, zz, yz, xz, xy = product_with_transpose(d0, d1, d2, e0, e1, e2, f0, f1, f2)
        ca, cb, cc, _, _, _ = cofactors(xx, yy, zz, yz, xz, xy)
        first, second = xx + yy + zz, ca + cb + cc
        x = ti.abs(self.tau[cut, block, 8])  # of the last step: one iteration finds what has changed since
        change = halley(x, first, second, j)
        x -= change
        found = ti.abs(change) <= STRETCH_TOLERANCE * x
        if not found.all():
            x = ti.sqrt(3 * first)
            x -= halley(x, first, second, j)
            x -= halley(x, first, second, j)
            change = halley(x, first, second, j)
            x -= change
            found = ti.abs(change) <= STRETCH_TOLERANCE * x
        vxx, vyy, vzz, vyz, vxz, vxy = stretch_of(x, first, j, xx, yy, zz, yz, xz, xy)
        mu, lam = self.par[cut, MU], self.par[cut, LAM]
        mises2 = mises_squared(xx - vxx, yy - vyy, zz - vzz, yz - vyz, xz - vxz, xy - vxy) * (4 * mu * mu)
        plastic = 0.0 * j
        if mises2.max() > self.par[cut, YIELD] ** 2:
            rxx, ryy, rzz, ryz, rxz, rxy = j2_return(vxx, vyy, vzz, vyz, vxz, vxy, j, mises2, mu, self.par[cut, YIELD])
            plastic = norm_squared(vxx - 1, vyy - 1, vzz - 1, vyz, vxz, vxy)
            plastic = mu * (plastic - norm_squared(rxx - 1, ryy - 1, rzz - 1, ryz, rxz, rxy))
            flows = mises2 > self.par[cut, YIELD] ** 2
            h0, h1, h2 = exchange(vxx, vyy, vzz, vyz, vxz, vxy, j, rxx, ryy, rzz, ryz, rxz, rxy, d0, e0, f0)
            d0, e0, f0 = ti.select(flows, h0, d0), ti.select(flows, h1, e0), ti.select(flows, h2, f0)
            h0, h1, h2 = exchange(vxx, vyy, vzz, vyz, vxz, vxy, j, rxx, ryy, rzz, ryz, rxz, rxy, d1, e1, f1)
            d1, e1, f1 = ti.select(flows, h0, d1), ti.select(flows, h1, e1), ti.select(flows, h2, f1)
            h0, h1, h2 = exchange(vxx, vyy, vzz, vyz, vxz, vxy, j, rxx, ryy, rzz, ryz, rxz, rxy, d2, e2, f2)
            d2, e2, f2 = ti.select(flows, h0, d2), ti.select(flows, h1, e2), ti.select(flows, h2, f2)
            vxx, vyy, vzz, vyz, vxz, vxy = rxx, ryy, rzz, ryz, rxz, rxy
            x = rxx + ryy + rzz
        txx, tyy, tzz, tyz, txz, txy = deviator_stress(vxx, vyy, vzz, vyz, vxz, vxy, mu)
        strain2 = 0.0 * j
        if ti.static(self.damage):
            strain2 = norm_squared(vxx - 1, vyy - 1, vzz - 1, vyz, vxz, vxy)
        swell = lxx + lyy + lzz
        shear, bulk = 2 * self.par[cut, ETA_S] * j, self.par[cut, ETA_B] * j * swell
        syz, sxz, sxy = 0.5 * (lyz + lzy), 0.5 * (lxz + lzx), 0.5 * (lxy + lyx)
        dxx, dyy, dzz = lxx - swell / 3, lyy - swell / 3, lzz - swell / 3
        press = lam * j * (j - 1) + bulk
        heat = shear * (dxx * dxx + dyy * dyy + dzz * dzz + 2 * (syz * syz + sxz * sxz + sxy * sxy)) + bulk * swell
        eps0 = self.par[cut, EPS0]
        unfit = (j <= 0) | (found == 0)
        odd = unfit
        if ti.static(self.damage):
            odd |= (strain2 > eps0 * eps0) & (eps0 > 0)
            for lane in ti.static(range(self.lanes)):
                p = block * self.lanes + lane
                odd[lane] |= (ti.max(self.kappa[cut, p], self.strain[cut, p]) > eps0) & (eps0 > 0)
        self.tau[cut, block, 8] = ti.select(unfit, -AT_REST, ti.select(odd, -x, x))
        for r, new, old in ti.static(
            (
                (0, d0, a0),
                (1, d1, a1),
                (2, d2, a2),
                (3, e0, b0),
                (4, e1, b1),
                (5, e2, b2),
                (6, f0, c0),
                (7, f1, c1),
                (8, f2, c2),
            )
        ):
            self.F[cut, block, r] = ti.select(odd, old, new)
        for r, value in ti.static(
            (
                (0, txx + press + shear * dxx),
                (1, tyy + press + shear * dyy),
                (2, tzz + press + shear * dzz),
                (3, tyz + shear * syz),
                (4, txz + shear * sxz),
                (5, txy + shear * sxy),
                (6, heat * dt),
                (7, plastic),
            )
        ):
            self.tau[cut, block, r] = value

    @ti.func
    def stress(self, cut, p, block, lane, dt):
        """Advance F of one particle; returns its (plastic, damage, viscous loss, inverted) and Kirchhoff stress."""
        c, old = self.gradient_of(cut, p), self.deformation_of(cut, p)
        f = old + dt * (c @ old)
        j = f.determinant()
        tau = 0.0 * unit()
        plastic, lost, heat, bad = 0.0, 0.0, 0.0, 0.0
        if j > 0:
            mu, lam = self.par[cut, MU], self.par[cut, LAM]
            b = left_cauchy_green(f)
            v = left_stretch(b, j)
            tau = 2 * mu * (b - v)
            mises2 = mises_squared(tau[0], tau[1], tau[2], tau[3], tau[4], tau[5])
            if mises2 > self.par[cut, YIELD] ** 2:
                back = j2_return_one(v, j, mises2, mu, self.par[cut, YIELD])
                plastic = deviatoric_energy(v, mu) - deviatoric_energy(back, mu)
                if ti.static(self.damage):  # what is damaged flows under the part of the stress that is left
                    plastic *= 1.0 - damage_of(self.kappa[cut, p], self.par[cut, EPS0], self.par[cut, EPSF])
                f = full(back) @ (full(cofactor(v)) @ f) / j
                v = back
                txx, tyy, tzz, tyz, txz, txy = deviator_stress(v[0], v[1], v[2], v[3], v[4], v[5], mu)
                tau = ti.Vector([txx, tyy, tzz, tyz, txz, txy])
            tau += lam * j * (j - 1) * unit()
            if ti.static(self.branches > 0):
                add, loss = self.relaxed(cut, p, f, v, j, mu)
                tau += add
                heat += loss
            if ti.static(self.damage):
                d, loss = self.damaged(cut, p, v, j, mu, lam)
                lost += loss
                tau = degrade(tau, d)
            rate = upper(c)
            swell = trace(rate)
            drag = j * (2 * self.par[cut, ETA_S] * (rate - swell / 3 * unit()) + self.par[cut, ETA_B] * swell * unit())
            heat += double(drag, rate) * dt
            tau += drag
            for r, k in ti.static(ti.ndrange(3, 3)):
                self.F[cut, block, 3 * r + k][lane] = f[r, k]
        else:
            bad = 1.0
        return ti.Vector([plastic, lost, heat, bad]), tau

    @ti.func
    def near_hot(self, cut, base, cells):
        """Whether a particle is at most so many cells from the box of those whose strain could damage something."""
        out = True
        for d in ti.static(range(3)):
            if base[d] < self.hot[cut, d] - cells or base[d] > self.hot[cut, d + 3] + cells:
                out = False
        return out

    @ti.func
    def spread_strain(self, cut, p, thread, window):
        """Largest principal strain of a particle to the grid, times its weights."""
        base, fx = self.local(cut, self.x[cut, p])
        if self.near_hot(cut, base, 4) and self.inside(base, window) > 0:
            f = self.deformation_of(cut, p)
            strain = largest_eigenvalue(left_stretch(left_cauchy_green(f), f.determinant()) - unit())
            w, lowest = self.weights(fx), self.own(cut, thread, base[0], base[1], base[2])
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                wt = w[i][0] * w[j][1] * w[k][2]
                self.add(lowest + (i * self.stride_x + j * self.stride_y + k), ti.Vector([wt * strain, wt, 0.0, 0.0]))

    @ti.func
    def smooth_strain(self, cut):
        """Replace each particle's driving strain by its mean over the grid's weights (one pass).

        Only where it can matter: two particles meet at a node when they are at most two cells apart, so that those
        within two cells of a strain above the threshold may be damaged, and those within four contribute to that. It
        uses the grids of the threads, which are cleared at the start of a step.
        """
        # threads that would find nothing are not woken
        hot = 1 if ti.static(self.atomic) else ti.cast(self.hot[cut, 3] >= 0, ti.i32)
        for q in range(self.loop(cut, HOT)):
            c, r, mine = self.turn_of(cut, q, HOT)
            if mine:
                i, j, low, high = self.row(c, r, HOT)
                for k in range(low, high):
                    for s in ti.static(range(self.threads)):
                        self.g[self.own(c, s, i, j, k)] = ti.Vector.zero(float, 4)
        for q in range(self.loop(cut, PART) * hot):
            c, part, mine = self.turn_of(cut, q, PART)
            first, last, thread = self.share(c, part)
            if mine and first < last and self.hot[c, 3] >= 0:
                window = self.box(c, ROW)
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[c, COUNT])):
                    self.spread_strain(c, p, thread, window)
        for q in range(self.loop(cut, PART) * hot):
            c, part, mine = self.turn_of(cut, q, PART)
            first, last, _ = self.share(c, part)
            if mine and first < last and self.hot[c, 3] >= 0:
                window = self.box(c, ROW)
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[c, COUNT])):
                    self.collect_strain(c, p, window)

    @ti.func
    def collect_strain(self, cut, p, window):
        """Mean of the driving strain that the particles about one have spread over the grid."""
        base, fx = self.local(cut, self.x[cut, p])
        if self.near_hot(cut, base, 2) and self.inside(base, window) > 0:
            w = self.weights(fx)
            e = 0.0
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                total = ti.Vector.zero(float, 2)
                for s in ti.static(range(self.threads)):
                    q = self.g[self.own(cut, s, base[0] + i, base[1] + j, base[2] + k)]
                    total += ti.Vector([q[0], q[1]])
                e += w[i][0] * w[j][1] * w[k][2] * total[0] / ti.max(total[1], 1e-30)
            self.strain[cut, p] = e
