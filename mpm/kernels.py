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
from mpm.contact import blade_distance, stick_slip, tack
from mpm.edge import Edge
from mpm.fields import (
    ARM_C,
    ARM_K,
    ARM_LIMIT,
    ARM_MASS,
    BLADE,
    BOARD,
    BOARD_MU,
    BOOKED,
    COMMAND,
    COS,
    EDGE,
    EPS0,
    EPSF,
    ETA_B,
    ETA_S,
    FACE,
    FRICTION,
    LAM,
    MASS,
    MU,
    PLASTIC,
    RADIUS,
    SIN,
    SPINE,
    TACK,
    TACK_GAP,
    TILT_COS,
    TILT_SIN,
    VOL,
    VS,
    VZ,
    YIELD,
    S,
    Z,
)

IVEC6 = ti.types.vector(6, ti.i32)
CPU_BLOCK = 512  # Taichi runs CPU loops shorter than this on one thread, so one iteration in 512 works for a thread


@ti.data_oriented
class Kernels(Edge):
    """Transfers, contact of particles, and the loops of a time step."""

    @ti.func
    def sever(self, p, q):
        """Material that the edge has passed belongs to the left (1) or right (2) half for good.

        At the board that is all of it, also what is pressed a little into the board.
        """
        if ti.static(not self.nodal):
            tip = self.edge_height(q[0])
            if self.side[p] == 0 and (q[2] > tip or tip <= 0) and self.under_blade(q[0]):
                self.side[p] = 1 + self.half(p, q[1])

    @ti.func
    def relaxed(self, p, r, s, mu):
        """Prony series on the deviator in the unrotated frame (Simo 1987): stress to add, and loss per volume."""
        eye = ti.Matrix.identity(float, 3)
        now = 2 * mu * (s @ s - s)
        now -= now.trace() / 3 * eye
        add, lost = ti.Matrix.zero(float, 3, 3), 0.0
        for b in ti.static(range(self.branches)):
            share, rate = self.share[b], self.relax[b]
            decay = ti.exp(-rate)
            h = decay * self.memory[b, p] + share * (1 - decay) / rate * (now - self.before[p])
            self.memory[b, p] = h
            add += h - share * now
            lost += h.norm_sqr() * rate / (2 * mu * share)
        self.before[p] = now
        return r @ add @ r.transpose(), lost

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
                s = back
            tau = 2 * mu * (f - r) @ f.transpose()
            tau += lam * j * (j - 1) * ti.Matrix.identity(float, 3)
            if ti.static(self.branches > 0):
                add, loss = self.relaxed(p, r, s, mu)
                tau += add
                heat += loss
            if ti.static(self.damage):
                if self.par[EPS0] > 0:
                    before = damage_of(self.kappa[p], self.par[EPS0], self.par[EPSF])
                    self.kappa[p] = ti.max(self.kappa[p], self.strain[p])
                    d = damage_of(self.kappa[p], self.par[EPS0], self.par[EPSF])
                    if d > before and j > 1:
                        lost = (d - before) * (deviatoric_energy(s, mu) + 0.5 * lam * (j - 1) ** 2)
                    tau = degrade(tau, d)
                    self.strain[p] = largest_eigenvalue(s - ti.Matrix.identity(float, 3))
            rate = 0.5 * (self.C[p] + self.C[p].transpose())
            swell = rate.trace()
            eye = ti.Matrix.identity(float, 3)
            drag = j * (2 * self.par[ETA_S] * (rate - swell / 3 * eye) + self.par[ETA_B] * swell * eye)
            heat += (drag * rate).sum() * dt
            tau += drag
        else:
            bad = 1.0
            f = self.F[p]
        self.F[p] = f
        return ti.Vector([plastic, lost, heat, bad]), tau

    @ti.func
    def column(self, base, i, j, k, code):
        """Where the field of one of a particle's 27 nodes is stored along y: its own side's or the other one's."""
        at = base[1] + j
        if ti.static(not self.nodal):
            at += 0 if k < self.layer(code, i, j) else self.second
        return at

    @ti.func
    def scatter(self, p, thread, dt, window):
        """Particle to grid; returns (plastic, damage, viscous loss per volume, inverted, outside)."""
        q = self.blade_axes(self.x[p])
        self.sever(p, q)
        loss, tau = self.stress(p, dt)
        base, fx = self.local(self.x[p])
        outside = 1.0 - self.inside(base, window)
        if outside == 0.0:
            w = self.weights(fx)
            m = self.par[MASS]
            a = (-dt * self.par[VOL] * 4 * self.inv) * tau + (m * self.dx) * self.C[p]
            start = m * self.v[p] - a @ fx
            code = self.split(p, base, q, self.half(p, q[1]))
            self.layers[p] = code
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                wt = w[i][0] * w[j][1] * w[k][2]
                mom = start
                for d in ti.static(range(3)):
                    mom[d] += a[d, 0] * i + a[d, 1] * j + a[d, 2] * k
                val = ti.Vector([wt * mom[0], wt * mom[1], wt * mom[2], wt * m])
                at = ti.Vector([base[0] + i, self.column(base, i, j, k, code), base[2] + k])
                if ti.static(self.atomic):
                    self.g[thread, at[0], at[1], at[2]] += val
                else:
                    self.g[thread, at[0], at[1], at[2]] = self.g[thread, at[0], at[1], at[2]] + val
        return ti.Vector([loss[0], loss[1], loss[2], loss[3], outside])

    @ti.func
    def touch_board(self, p, m, dt, u, at):
        """Contact of one particle with the board; returns its corrected velocity."""
        depth = self.foot[p] - at[2]
        if depth > 0:
            stretch = stick_slip(self.stick[0, p], dt * ti.Vector([u[0], u[1], 0.0]), depth, self.par[BOARD_MU])
            self.stick[0, p] = stretch
            dv = (ti.Vector([0.0, 0.0, depth]) - stretch) / dt
            u += dv
            self.tool(BOARD, -m * dv)
        else:
            self.stick[0, p] = ti.Vector.zero(float, 3)
        return u

    @ti.func
    def touch_blade(self, p, m, dt, u, at):
        """Contact of one severed particle with the blade's faces; returns its corrected velocity.

        A particle meets the blade as far from its centre as it was from the cut plane when the food was whole, so
        that the faces displace the food by the true half thickness of the blade.
        """
        cos_t, sin_t = self.par[TILT_COS], self.par[TILT_SIN]
        above = (at[2] - self.edge_height(at[0])) * cos_t
        touching = False
        if self.side[p] != 0 and 0 < above < self.par[BLADE] and self.under_blade(at[0]):
            sign = 1.0 if self.side[p] == 2 else -1.0
            d, n = blade_distance(sign * at[1], above, self.par[SPINE], self.par[COS], self.par[SIN], self.par[RADIUS])
            n = ti.Vector([-sin_t * n[2], sign * n[1], cos_t * n[2]])
            depth = self.gap[p] - d
            press = ti.max(depth, 0.0)
            if depth > 0 and self.tacky[p] == 0:
                self.tacky[p] = 1
            if depth <= 0 and self.tacky[p] == 1:
                if -depth < self.par[TACK_GAP]:
                    depth = -self.par[TACK] * tack(-depth, self.par[TACK_GAP]) * dt * dt
                    press = -depth
                else:
                    self.tacky[p] = 0
            if press > 0:
                touching = True
                tool = ti.Vector([ti.cast(self.pose[VS], float), 0.0, ti.cast(self.pose[VZ], float)])
                rel = u - tool
                stretch = self.stick[1, p] - self.stick[1, p].dot(n) * n
                stretch = stick_slip(stretch, dt * (rel - rel.dot(n) * n), press, self.par[FRICTION])
                self.stick[1, p] = stretch
                dv = (depth * n - stretch) / dt
                u += dv
                self.tool(FACE, -m * dv)
        if not touching:
            self.stick[1, p] = ti.Vector.zero(float, 3)
        return u

    @ti.func
    def gather(self, p, dt, window):
        """Grid to particle, then contact."""
        base, fx = self.local(self.x[p])
        if (
            self.inside(base, window) > 0
        ):  # one that has left the grid stays where it is; the run ends at the next output
            self.move(p, base, fx, dt)

    @ti.func
    def move(self, p, base, fx, dt):
        """Velocity, gradient and position of a particle from the 27 nodes above ``base``.

        Contact corrects the velocity that the next transfer hands on, not the position: moving the particle as well
        would let the surface slip through the material without straining it.
        """
        w = self.weights(fx)
        u, b = ti.Vector.zero(float, 3), ti.Matrix.zero(float, 3, 3)
        code = self.layers[p]
        for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
            node = self.u[base[0] + i, self.column(base, i, j, k, code), base[2] + k]
            gu = w[i][0] * w[j][1] * w[k][2] * ti.Vector([node[0], node[1], node[2]])
            u += gu
            b += gu.outer_product(ti.Vector([i - fx[0], j - fx[1], k - fx[2]]))
        self.C[p] = (4 * self.inv) * b
        at = self.x[p] + dt * u
        if ti.static(not self.nodal):
            m = self.par[MASS] * ti.static((2 if self.mx else 1) * (2 if self.my else 1))
            there, v = self.blade_axes(at), self.blade_axes(u)
            v = self.touch_board(p, m, dt, v, there)
            u = self.grid_axes(self.touch_blade(p, m, dt, v, there))
        self.v[p] = u
        self.x[p] = at

    @ti.func
    def drive(self, dt, vz, vs):
        """Velocity of the tool in this step: as commanded, or that of the arm behind its spring."""
        self.pose[VS] = vs
        self.pose[COMMAND] += vz * dt
        if self.par[ARM_MASS] > 0:
            booked = self.sums[EDGE + 2] + self.sums[FACE + 2]
            limit = ti.cast(self.par[ARM_LIMIT], ti.f64)
            spring = self.par[ARM_K] * (self.pose[COMMAND] - self.pose[Z])
            pull = ti.math.clamp(spring + self.par[ARM_C] * (vz - self.pose[VZ]), -limit, limit)
            if ti.abs(spring) > 2 * limit:  # stalled: it pulls as hard as it can and only stops rattling
                pull = ti.math.clamp(spring, -limit, limit) - self.par[ARM_C] * self.pose[VZ]
            self.pose[VZ] += (pull * dt + booked - self.pose[BOOKED]) / self.par[ARM_MASS]
            self.pose[BOOKED] = booked
        else:
            self.pose[VZ] = vz

    @ti.func
    def advance(self, dt, vz, vs, w):
        """One time step with the tool commanded at (vs, vz) [m/s]; ``w`` bounds the nodes that particles can reach."""
        for _ in range(1):
            self.drive(dt, vz, vs)
        if ti.static(not self.nodal):
            for i in range(self.stations):
                self.lead(i)
        for i, j, k in ti.ndrange((w[0], w[3]), (w[1], w[4]), (w[2], w[5])):
            for s in ti.static(range(self.threads)):
                self.g[s, i, j, k] = ti.Vector.zero(float, 4)
                if ti.static(self.b1 > self.b0):
                    if self.b0 <= j < self.b1:
                        self.g[s, i, self.second + j, k] = ti.Vector.zero(float, 4)
        if ti.static(self.atomic):
            for p in self.x:
                row = self.scatter(p, 0, dt, w)
                for r in ti.static(range(5)):
                    self.sums[PLASTIC + r] += row[r]
        elif ti.static(self.threads == 1):
            total = ti.Vector.zero(float, 5)
            for p in range(self.n):
                total += self.scatter(p, 0, dt, w)
            for r in ti.static(range(5)):
                self.sums[PLASTIC + r] += total[r]
        else:
            for block in range(self.threads * CPU_BLOCK):
                if block % CPU_BLOCK == 0:
                    t = block // CPU_BLOCK
                    total = ti.Vector.zero(float, 5)
                    for p in range(self.n * t // self.threads, self.n * (t + 1) // self.threads):
                        total += self.scatter(p, t, dt, w)
                    for r in ti.static(range(5)):
                        self.sums[PLASTIC + r] += total[r]
        if ti.static(self.threads > 1):
            for i, j, k in ti.ndrange((w[0], w[3]), (w[1], w[4]), (w[2], w[5])):
                self.add_threads(i, j, k)
                if ti.static(self.b1 > self.b0):
                    if self.b0 <= j < self.b1:
                        self.add_threads(i, self.second + j, k)
        if ti.static(self.mx):
            for j, k in ti.ndrange((w[1], w[4]), (w[2], w[5])):
                self.fold_x(j, k)
                if ti.static(self.b1 > self.b0):
                    if self.b0 <= j < self.b1:
                        self.fold_x(self.second + j, k)
        for i, j, k in ti.ndrange((w[0], w[3]), (w[1], w[4]), (w[2], w[5])):
            self.update_node(i, j, k, dt)
        if ti.static(not self.nodal):
            for i in range(self.stations):
                self.near[i] = 0
                for d in ti.static((-1, 1)):
                    if 0 <= i + d < self.stations:
                        self.near[i] += ti.cast(self.start[i + d] > 0, ti.i32)
            for i in range(self.stations):
                if i >= self.i0:
                    self.feel(i, dt)
            for i in range(self.stations):
                if i >= self.i0:
                    self.react(i)
        for _ in range(1):
            self.pose[Z] += self.pose[VZ] * dt
            self.pose[S] += self.pose[VS] * dt
        for p in range(self.n):
            self.gather(p, dt, w)

    @ti.func
    def add_threads(self, i, j, k):
        """Sum the private grids of all threads at one node."""
        q = self.g[0, i, j, k]
        for t in ti.static(range(1, self.threads)):
            q += self.g[t, i, j, k]
        self.g[0, i, j, k] = q

    @ti.kernel
    def step(self, dt: float, vz: float, vs: float, w: IVEC6):
        """One time step, its loops in parallel."""
        self.advance(dt, vz, vs, w)
        if ti.static(self.damage):
            self.smooth_strain(w)

    @ti.kernel
    def steps(self, count: int, dt: float, vz: float, vs: float, w: IVEC6):
        """Several time steps on one thread without leaving the kernel."""
        ti.loop_config(serialize=True)
        for _ in range(count):
            self.advance(dt, vz, vs, w)
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
            if ti.static(self.branches > 0):
                held = 1.0
                stored = 0.0
                for b in ti.static(range(self.branches)):
                    held -= self.share[b]
                    stored += self.memory[b, p].norm_sqr() / (4 * self.par[MU] * self.share[b])
                dev = held * dev + stored
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
