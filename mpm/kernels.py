"""The time step as Taichi kernels. One Kernels object belongs to one grid; material and tool are run-time data."""

import taichi as ti

from mpm.constitutive import (
    damage_of,
    degrade,
    deviatoric_energy,
    j2_return,
    largest_eigenvalue,
    mises,
    polar_rotation,
)
from mpm.contact import blade_distance, stick_slip
from mpm.fields import (
    BLADE,
    BOARD,
    BOARD_MU,
    COS,
    EPS0,
    EPSF,
    ETA_B,
    ETA_S,
    FACE,
    FRICTION,
    HALF_LENGTH,
    LAM,
    MASS,
    MU,
    PLASTIC,
    REACH,
    SIN,
    SPINE,
    VOL,
    YIELD,
)
from mpm.nodes import Nodes

IVEC6 = ti.types.vector(6, ti.i32)
CPU_BLOCK = 512  # Taichi runs CPU loops shorter than this on one thread, so one iteration in 512 works for a thread


@ti.data_oriented
class Kernels(Nodes):
    """Transfers, contact of particles, and the loops of a time step."""

    @ti.func
    def sever(self, p, tip):
        """Material that the edge has passed belongs to the left (1) or right (2) half for good."""
        if ti.static(not self.nodal):
            q = self.x[p]
            if self.side[p] == 0 and q[2] > tip and ti.abs(q[0]) < self.par[HALF_LENGTH]:
                self.side[p] = 1 + self.half(p)
                self.gap[p] = ti.min(ti.abs(q[1]), self.par[REACH])

    @ti.func
    def stress(self, p, dt):
        """Advance F of a particle; returns its (plastic, damage, viscous loss, inverted) and Kirchhoff stress."""
        f = self.F[p] + dt * (self.C[p] @ self.F[p])
        j = f.determinant()
        tau = ti.Matrix.zero(float, 3, 3)
        plastic, lost, heat, bad = 0.0, 0.0, 0.0, 0.0
        if j > 0:
            mu, lam = self.par[MU], self.par[LAM]
            r = polar_rotation(f)
            s = r.transpose() @ f
            # |2 mu (S - I) S| bounds the deviator, so most particles never pay for the return
            if mises(s, mu) > self.par[YIELD]:
                back = j2_return(s, j, mu, self.par[YIELD])
                plastic = deviatoric_energy(s, mu) - deviatoric_energy(back, mu)
                f = r @ back
            tau = 2 * mu * (f - r) @ f.transpose()
            tau += lam * j * (j - 1) * ti.Matrix.identity(float, 3)
            if ti.static(self.damage):
                if self.par[EPS0] > 0:
                    before = damage_of(self.kappa[p], self.par[EPS0], self.par[EPSF])
                    self.kappa[p] = ti.max(self.kappa[p], self.strain[p])
                    d = damage_of(self.kappa[p], self.par[EPS0], self.par[EPSF])
                    s = r.transpose() @ f
                    if d > before and j > 1:
                        lost = (d - before) * (deviatoric_energy(s, mu) + 0.5 * lam * (j - 1) ** 2)
                    tau = degrade(tau, d)
                    self.strain[p] = largest_eigenvalue(s - ti.Matrix.identity(float, 3))
            rate = 0.5 * (self.C[p] + self.C[p].transpose())
            swell = rate.trace()
            eye = ti.Matrix.identity(float, 3)
            drag = j * (2 * self.par[ETA_S] * (rate - swell / 3 * eye) + self.par[ETA_B] * swell * eye)
            heat = (drag * rate).sum() * dt
            tau += drag
        else:
            bad = 1.0
            f = self.F[p]
        self.F[p] = f
        return ti.Vector([plastic, lost, heat, bad]), tau

    @ti.func
    def scatter(self, p, thread, dt, tip, window):
        """Particle to grid; returns (plastic, damage, viscous loss per volume, inverted, outside)."""
        self.sever(p, tip)
        loss, tau = self.stress(p, dt)
        base, fx = self.local(self.x[p])
        outside = 1.0 - self.inside(base, window)
        if outside == 0.0:
            w = self.weights(fx)
            m = self.par[MASS]
            a = (-dt * self.par[VOL] * 4 * self.inv) * tau + (m * self.dx) * self.C[p]
            start = m * self.v[p] - a @ fx
            slot = thread * self.sides + self.half(p)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                wt = w[i][0] * w[j][1] * w[k][2]
                mom = start
                for d in ti.static(range(3)):
                    mom[d] += a[d, 0] * i + a[d, 1] * j + a[d, 2] * k
                val = ti.Vector([wt * mom[0], wt * mom[1], wt * mom[2], wt * m])
                if ti.static(self.atomic):
                    self.g[slot, base[0] + i, base[1] + j, base[2] + k] += val
                else:
                    at = ti.Vector([base[0] + i, base[1] + j, base[2] + k])
                    self.g[slot, at[0], at[1], at[2]] = self.g[slot, at[0], at[1], at[2]] + val
        return ti.Vector([loss[0], loss[1], loss[2], loss[3], outside])

    @ti.func
    def touch(self, p, tip, speed, dt, u, at):
        """Contact of one particle with board and blade; returns its corrected velocity and books the impulses.

        The particle keeps moving with the grid: only its velocity is corrected and handed on by the next transfer.
        Moving it as well would let the surface slip through the material without straining it.
        """
        m = self.par[MASS] * ti.static((2 if self.mx else 1) * (2 if self.my else 1))
        depth = self.foot[p] - at[2]
        if depth > 0:
            stretch = stick_slip(self.stick[0, p], dt * ti.Vector([u[0], u[1], 0.0]), depth, self.par[BOARD_MU])
            self.stick[0, p] = stretch
            dv = (ti.Vector([0.0, 0.0, depth]) - stretch) / dt
            u += dv
            self.tool(BOARD, -m * dv[0], -m * dv[1], -m * dv[2])
        else:
            self.stick[0, p] = ti.Vector.zero(float, 3)
        above = at[2] - tip
        depth = 0.0
        if self.side[p] != 0 and 0 < above < self.par[BLADE] and ti.abs(at[0]) < self.par[HALF_LENGTH]:
            y = ti.abs(at[1]) if (at[1] > 0) == (self.side[p] == 2) else -ti.abs(at[1])
            d, n = blade_distance(y, above, self.par[SPINE], self.par[COS], self.par[SIN])
            depth = self.gap[p] - d
            if depth > 0:
                if self.side[p] == 1:
                    n[1] = -n[1]
                rel = u + ti.Vector([0.0, 0.0, speed])
                stretch = self.stick[1, p] - self.stick[1, p].dot(n) * n
                stretch = stick_slip(stretch, dt * (rel - rel.dot(n) * n), depth, self.par[FRICTION])
                self.stick[1, p] = stretch
                dv = (depth * n - stretch) / dt
                u += dv
                self.tool(FACE, -m * dv[0], -m * dv[1], -m * dv[2])
        if depth <= 0:
            self.stick[1, p] = ti.Vector.zero(float, 3)
        return u

    @ti.func
    def gather(self, p, dt, tip, speed, window):
        """Grid to particle, then contact."""
        base, fx = self.local(self.x[p])
        if (
            self.inside(base, window) > 0
        ):  # one that has left the grid stays where it is; the run ends at the next output
            self.move(p, base, fx, dt, tip, speed)

    @ti.func
    def move(self, p, base, fx, dt, tip, speed):
        """Velocity, gradient and position of a particle from the 27 nodes above ``base``."""
        w = self.weights(fx)
        u, b = ti.Vector.zero(float, 3), ti.Matrix.zero(float, 3, 3)
        s = self.half(p)
        for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
            q = self.u[s, base[0] + i, base[1] + j, base[2] + k]
            gu = w[i][0] * w[j][1] * w[k][2] * ti.Vector([q[0], q[1], q[2]])
            u += gu
            b += gu.outer_product(ti.Vector([i - fx[0], j - fx[1], k - fx[2]]))
        self.C[p] = (4 * self.inv) * b
        at = self.x[p] + dt * u
        if ti.static(not self.nodal):
            u = self.touch(p, tip, speed, dt, u, at)
        self.v[p] = u
        self.x[p] = at

    @ti.func
    def advance(self, dt, tip, speed, w):
        """One time step with the edge at height ``tip``; ``w`` bounds the nodes that particles can reach."""
        for i, j, k in ti.ndrange((w[0], w[3]), (w[1], w[4]), (w[2], w[5])):
            for s in ti.static(range(self.threads * self.sides)):
                self.g[s, i, j, k] = ti.Vector.zero(float, 4)
        if ti.static(self.atomic):
            for p in self.x:
                row = self.scatter(p, 0, dt, tip, w)
                for r in ti.static(range(5)):
                    self.sums[PLASTIC + r] += row[r]
        elif ti.static(self.threads == 1):
            total = ti.Vector.zero(float, 5)
            for p in range(self.n):
                total += self.scatter(p, 0, dt, tip, w)
            for r in ti.static(range(5)):
                self.sums[PLASTIC + r] += total[r]
        else:
            for block in range(self.threads * CPU_BLOCK):
                if block % CPU_BLOCK == 0:
                    t = block // CPU_BLOCK
                    total = ti.Vector.zero(float, 5)
                    for p in range(self.n * t // self.threads, self.n * (t + 1) // self.threads):
                        total += self.scatter(p, t, dt, tip, w)
                    for r in ti.static(range(5)):
                        self.sums[PLASTIC + r] += total[r]
        if ti.static(self.threads > 1):
            for i, j, k in ti.ndrange((w[0], w[3]), (w[1], w[4]), (w[2], w[5])):
                for s in ti.static(range(self.sides)):
                    q = self.g[s, i, j, k]
                    for t in ti.static(range(1, self.threads)):
                        q += self.g[t * self.sides + s, i, j, k]
                    self.g[s, i, j, k] = q
        if ti.static(self.mx):
            for j, k in ti.ndrange((w[1], w[4]), (w[2], w[5])):
                for s in ti.static(range(self.sides)):
                    self.fold_x(s, j, k)
        for i, j, k in ti.ndrange((w[0], w[3]), (w[1], w[4]), (w[2], w[5])):
            self.update_node(i, j, k, dt, tip, speed)
        if ti.static(not self.nodal):
            for i in range(self.nodes[0]):
                self.near[i] = 0
                for d in ti.static((-1, 1)):
                    if 0 <= i + d < self.nodes[0]:
                        self.near[i] += ti.cast(self.start[i + d] > 0, ti.i32)
            for i in range(self.nodes[0]):
                if self.cover[i] > 0 and i >= self.i0:
                    self.cut_slice(i, dt, tip, speed)
        for p in range(self.n):
            self.gather(p, dt, tip - speed * dt, speed, w)

    @ti.kernel
    def step(self, dt: float, tip: float, speed: float, w: IVEC6):
        """One time step, its loops in parallel."""
        self.advance(dt, tip, speed, w)
        if ti.static(self.damage):
            self.smooth_strain(w)

    @ti.kernel
    def steps(self, count: int, dt: float, tip: float, speed: float, w: IVEC6):
        """Several time steps on one thread without leaving the kernel."""
        ti.loop_config(serialize=True)
        for n in range(count):
            self.advance(dt, tip - speed * dt * n, speed, w)
            if ti.static(self.damage):
                self.smooth_strain(w)

    @ti.func
    def smooth_strain(self, window):
        """Replace each particle's driving strain by its mean over the grid's weights (one pass)."""
        for i, j, k in ti.ndrange(*self.nodes):
            self.smooth[i, j, k] = ti.Vector.zero(float, 2)
        for p in range(self.n):
            base, fx = self.local(self.x[p])
            if self.inside(base, window) > 0:
                w = self.weights(fx)
                for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                    wt = w[i][0] * w[j][1] * w[k][2]
                    self.smooth[base[0] + i, base[1] + j, base[2] + k] += ti.Vector([wt * self.strain[p], wt])
        for p in range(self.n):
            base, fx = self.local(self.x[p])
            if self.inside(base, window) > 0:
                w = self.weights(fx)
                e = 0.0
                for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                    q = self.smooth[base[0] + i, base[1] + j, base[2] + k]
                    e += w[i][0] * w[j][1] * w[k][2] * q[0] / ti.max(q[1], 1e-30)
                self.strain[p] = e

    @ti.kernel
    def measure(self):
        """Momentum (3), kinetic and elastic energy of the particles [N s, J] into ``state``, images not counted."""
        for k in self.state:
            self.state[k] = 0.0
        for p in self.x:
            m, v = self.par[MASS], self.v[p]
            for d in ti.static(range(3)):
                self.state[d] += m * v[d]
            self.state[3] += 0.5 * m * (v.norm_sqr() + 0.25 * self.dx * self.dx * self.C[p].norm_sqr())
            f = self.F[p]
            r = polar_rotation(f)
            d = 0.0
            if ti.static(self.damage):
                d = damage_of(self.kappa[p], self.par[EPS0], self.par[EPSF])
            j = f.determinant()
            vol = 0.5 * self.par[LAM] * (j - 1) ** 2
            dev = deviatoric_energy(r.transpose() @ f, self.par[MU])
            keep = 1.0 - d
            self.state[4] += self.par[VOL] * (keep * dev + (keep if j > 1 else 1.0) * vol)

    @ti.kernel
    def extent(self) -> IVEC6:
        """Lowest and highest node that any particle touches now."""
        low, high = ti.Vector([1 << 20] * 3), ti.Vector([-1] * 3)
        for p in self.x:
            base, _ = self.local(self.x[p])
            for d in ti.static(range(3)):
                ti.atomic_min(low[d], base[d])
                ti.atomic_max(high[d], base[d] + 2)
        return IVEC6([low[0], low[1], low[2], high[0], high[1], high[2]])
