"""The time step as Taichi kernels. One Kernels object belongs to one grid; material and tool are run-time data."""

import taichi as ti

from mpm.constitutive import (
    STRETCH_TOLERANCE,
    cofactor,
    cofactors,
    damage_of,
    degrade,
    deviatoric_energy,
    double,
    full,
    halley,
    j2_return,
    largest_eigenvalue,
    left_cauchy_green,
    left_stretch,
    mises_squared,
    product_with_transpose,
    square,
    stretch_of,
    trace,
    unit,
    upper,
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
    DX,
    EDGE,
    EPS0,
    EPSF,
    ETA_B,
    ETA_S,
    FACE,
    FRICTION,
    INV,
    LAM,
    MASS,
    MU,
    N_POSE,
    N_STATE,
    N_SUMS,
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

TABLE = ti.types.ndarray(dtype=ti.f64, ndim=2)
MARGIN = 3  # cells by which the window exceeds the particles; it is renewed at every output
FAR = 1 << 20


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
    def relaxed(self, p, f, v, j, mu):
        """Prony series on the deviator in the unrotated frame (Simo 1987): stress to add, and loss per volume."""
        r = full(cofactor(v)) @ f / j
        s = r.transpose() @ f
        now = 2 * mu * (s @ s - s)
        now -= now.trace() / 3 * ti.Matrix.identity(float, 3)
        add, lost = ti.Matrix.zero(float, 3, 3), 0.0
        for b in ti.static(range(self.branches)):
            share, rate = self.share_of[b], self.relax[b]
            decay = ti.exp(-rate)
            h = decay * self.memory[b, p] + share * (1 - decay) / rate * (now - self.before[p])
            self.memory[b, p] = h
            add += h - share * now
            lost += h.norm_sqr() * rate / (2 * mu * share)
        self.before[p] = now
        return upper(r @ add @ r.transpose()), lost

    @ti.func
    def damaged(self, p, v, j, mu, lam):
        """Damage of a particle from the smoothed strain of the last step; returns it and the energy that is lost.

        Also finds the box of the particles whose strain could damage something. No principal strain exceeds the norm
        of the strain, so the others never pay for an eigenvalue.
        """
        d, lost = 0.0, 0.0
        eps0, eps_f = self.par[EPS0], self.par[EPSF]
        if eps0 > 0:
            before = damage_of(self.kappa[p], eps0, eps_f)
            self.kappa[p] = ti.max(self.kappa[p], self.strain[p])
            self.strain[p] = 0.0
            d = damage_of(self.kappa[p], eps0, eps_f)
            if d > before and j > 1:
                lost = (d - before) * (deviatoric_energy(v, mu) + 0.5 * lam * (j - 1) ** 2)
            e = v - unit()
            if double(e, e) > eps0 * eps0:
                if largest_eigenvalue(e) > eps0:
                    base, fx = self.local(self.x[p])
                    for axis in ti.static(range(3)):
                        ti.atomic_min(self.hot[axis], base[axis])
                        ti.atomic_max(self.hot[axis + 3], base[axis])
        return d, lost

    @ti.func
    def entries(self, field, block, row):
        """One entry of a tensor for all particles of a block."""
        return field[block, row]

    @ti.func
    def slope(self, block, row, column):
        """One entry of the velocity gradient for all particles of a block [1/s]."""
        return ti.Vector([self.C[block * self.lanes + lane, column][row] for lane in range(self.lanes)])

    @ti.func
    def elastic(self, block, dt):
        """Advance F of a block of particles and find their Kirchhoff stress and viscous loss, all at once.

        Those that flow, are damaged or inverted, or whose stretch has not converged, are left as they are and marked;
        :meth:`stress` does them one by one.
        """
        a0, a1, a2 = (self.entries(self.F, block, 0), self.entries(self.F, block, 1), self.entries(self.F, block, 2))
        b0, b1, b2 = (self.entries(self.F, block, 3), self.entries(self.F, block, 4), self.entries(self.F, block, 5))
        c0, c1, c2 = (self.entries(self.F, block, 6), self.entries(self.F, block, 7), self.entries(self.F, block, 8))
        lxx, lxy, lxz = self.slope(block, 0, 0), self.slope(block, 0, 1), self.slope(block, 0, 2)
        lyx, lyy, lyz = self.slope(block, 1, 0), self.slope(block, 1, 1), self.slope(block, 1, 2)
        lzx, lzy, lzz = self.slope(block, 2, 0), self.slope(block, 2, 1), self.slope(block, 2, 2)
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
        x = ti.sqrt(3 * first)
        x -= halley(x, first, second, j)
        x -= halley(x, first, second, j)
        change = halley(x, first, second, j)
        x -= change
        vxx, vyy, vzz, vyz, vxz, vxy = stretch_of(x, first, j, xx, yy, zz, yz, xz, xy)
        mu, lam = self.par[MU], self.par[LAM]
        txx, tyy, tzz = 2 * mu * (xx - vxx), 2 * mu * (yy - vyy), 2 * mu * (zz - vzz)
        tyz, txz, txy = 2 * mu * (yz - vyz), 2 * mu * (xz - vxz), 2 * mu * (xy - vxy)
        mean = (txx + tyy + tzz) / 3
        mises2 = 1.5 * (txx * txx + tyy * tyy + tzz * tzz - 3 * mean * mean) + 3 * (tyz * tyz + txz * txz + txy * txy)
        strain2 = 0.0 * j
        if ti.static(self.damage):
            strain2 = (vxx - 1) ** 2 + (vyy - 1) ** 2 + (vzz - 1) ** 2 + 2 * (vyz * vyz + vxz * vxz + vxy * vxy)
        swell = lxx + lyy + lzz
        shear, bulk = 2 * self.par[ETA_S] * j, self.par[ETA_B] * j * swell
        syz, sxz, sxy = 0.5 * (lyz + lzy), 0.5 * (lxz + lzx), 0.5 * (lxy + lyx)
        dxx, dyy, dzz = lxx - swell / 3, lyy - swell / 3, lzz - swell / 3
        press = lam * j * (j - 1) + bulk
        heat = shear * (dxx * dxx + dyy * dyy + dzz * dzz + 2 * (syz * syz + sxz * sxz + sxy * sxy)) + bulk * swell
        flow2, eps0 = self.par[YIELD] ** 2, self.par[EPS0]
        odd = (j <= 0) | (change > STRETCH_TOLERANCE * x) | (mises2 > flow2)
        if ti.static(self.damage):
            odd |= (strain2 > eps0 * eps0) & (eps0 > 0)
            for lane in ti.static(range(self.lanes)):
                p = block * self.lanes + lane
                odd[lane] |= (ti.max(self.kappa[p], self.strain[p]) > eps0) & (eps0 > 0)
        self.tau[block, 7] = ti.cast(odd, float)
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
            self.F[block, r] = ti.select(odd, old, new)
        for r, value in ti.static(
            (
                (0, txx + press + shear * dxx),
                (1, tyy + press + shear * dyy),
                (2, tzz + press + shear * dzz),
                (3, tyz + shear * syz),
                (4, txz + shear * sxz),
                (5, txy + shear * sxy),
                (6, heat * dt),
            )
        ):
            self.tau[block, r] = value

    @ti.func
    def stress(self, p, block, lane, dt):
        """Advance F of one particle; returns its (plastic, damage, viscous loss, inverted) and Kirchhoff stress."""
        c, old = self.gradient_of(p), self.deformation_of(p)
        f = old + dt * (c @ old)
        j = f.determinant()
        tau = 0.0 * unit()
        plastic, lost, heat, bad = 0.0, 0.0, 0.0, 0.0
        if j > 0:
            mu, lam = self.par[MU], self.par[LAM]
            b = left_cauchy_green(f)
            v = left_stretch(b, j)
            if mises_squared(b, v, mu) > self.par[YIELD] ** 2:
                back = j2_return(b, v, j, mu, self.par[YIELD])
                plastic = deviatoric_energy(v, mu) - deviatoric_energy(back, mu)
                f = full(back) @ (full(cofactor(v)) @ f) / j
                v, b = back, square(back)
            tau = 2 * mu * (b - v) + lam * j * (j - 1) * unit()
            if ti.static(self.branches > 0):
                add, loss = self.relaxed(p, f, v, j, mu)
                tau += add
                heat += loss
            if ti.static(self.damage):
                d, loss = self.damaged(p, v, j, mu, lam)
                lost += loss
                tau = degrade(tau, d)
            rate = upper(c)
            swell = trace(rate)
            drag = j * (2 * self.par[ETA_S] * (rate - swell / 3 * unit()) + self.par[ETA_B] * swell * unit())
            heat += double(drag, rate) * dt
            tau += drag
            for r, k in ti.static(ti.ndrange(3, 3)):
                self.F[block, 3 * r + k][lane] = f[r, k]
        else:
            bad = 1.0
        return ti.Vector([plastic, lost, heat, bad]), tau

    @ti.func
    def columns(self, base, i, code):
        """Where the fields of the nodes of a particle are stored along y, (j, k): its own side's or the other one's."""
        at = ti.Matrix.zero(ti.i32, 3, 3)
        for j, k in ti.static(ti.ndrange(3, 3)):
            at[j, k] = base[1] + j
            if ti.static(not self.nodal):
                at[j, k] += 0 if k < self.layer(code, i, j) else self.second
        return at

    @ti.func
    def scatter_block(self, block, thread, dt, window):
        """Particles of a block to grid; returns (plastic, damage, viscous loss per volume, inverted, outside)."""
        total = ti.Vector.zero(float, 5)
        if ti.static(self.branches == 0):
            self.elastic(block, dt)
        for lane in range(self.lanes):
            p = block * self.lanes + lane
            if p < self.n:
                total += self.scatter(p, block, lane, thread, dt, window)
        return total

    @ti.func
    def scatter(self, p, block, lane, thread, dt, window):
        """One particle to grid; returns as :meth:`scatter_block`."""
        q = self.blade_axes(self.x[p])
        self.sever(p, q)
        loss, tau = ti.Vector.zero(float, 4), 0.0 * unit()
        one_by_one = True
        if ti.static(self.branches == 0):
            one_by_one = self.tau[block, 7][lane] > 0
        if one_by_one:
            loss, tau = self.stress(p, block, lane, dt)
        else:
            for r in ti.static(range(6)):
                tau[r] = self.tau[block, r][lane]
            loss[2] = self.tau[block, 6][lane]
        base, fx = self.local(self.x[p])
        outside = 1.0 - self.inside(base, window)
        if outside == 0.0:
            w = self.weights(fx)
            m = self.par[MASS]
            k, h = -dt * self.par[VOL] * 4 * self.par[INV], m * self.par[DX] * ti.Vector([1.0, 1.0, 1.0, 0.0])
            ax = k * ti.Vector([tau[0], tau[5], tau[4], 0.0]) + h * self.C[p, 0]
            ay = k * ti.Vector([tau[5], tau[1], tau[3], 0.0]) + h * self.C[p, 1]
            az = k * ti.Vector([tau[4], tau[3], tau[2], 0.0]) + h * self.C[p, 2]
            v = self.v[p]
            corner = m * ti.Vector([v[0], v[1], v[2], 1.0]) - fx[0] * ax - fx[1] * ay - fx[2] * az
            code = self.split(p, base, q, self.half(p, q[1]))
            self.layers[p] = code
            at = self.columns(base, 0, code)
            for i in ti.static(range(3)):
                if ti.static(self.turned):
                    at = self.columns(base, i, code)
                for j in ti.static(range(3)):
                    wij = w[i][0] * w[j][1]
                    low = wij * (corner + i * ax + j * ay)
                    rise = wij * az
                    for k in ti.static(range(3)):
                        self.add(thread, base[0] + i, at[j, k], base[2] + k, w[k][2] * (low + k * rise))
        return ti.Vector([loss[0], loss[1], loss[2], loss[3], outside])

    @ti.func
    def add(self, thread, i, j, k, value):
        """Add to a node of a thread's own grid; atomically where all threads share one."""
        if ti.static(self.atomic):
            self.g[thread, i, j, k] += value
        else:
            self.g[thread, i, j, k] = self.g[thread, i, j, k] + value

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
        code = self.layers[p]
        cols = self.columns(base, 0, code)
        zero = ti.Vector.zero(float, 4)
        whole, mx, my, mz = zero, zero, zero, zero  # of the nodes' velocities and of their first moments about the base
        for i in ti.static(range(3)):
            if ti.static(self.turned):
                cols = self.columns(base, i, code)
            plane, py, pz = zero, zero, zero
            for j in ti.static(range(3)):
                a = self.u[base[0] + i, cols[j, 0], base[2]]
                b = self.u[base[0] + i, cols[j, 1], base[2] + 1]
                c = self.u[base[0] + i, cols[j, 2], base[2] + 2]
                row = w[0][2] * a + w[1][2] * b + w[2][2] * c
                plane += w[j][1] * row
                pz += w[j][1] * (w[1][2] * b + 2 * w[2][2] * c)
                if ti.static(j > 0):
                    py += j * w[j][1] * row
            whole += w[i][0] * plane
            my += w[i][0] * py
            mz += w[i][0] * pz
            if ti.static(i > 0):
                mx += i * w[i][0] * plane
        u = ti.Vector([whole[0], whole[1], whole[2]])
        self.C[p, 0] = (4 * self.par[INV]) * (mx - fx[0] * whole)
        self.C[p, 1] = (4 * self.par[INV]) * (my - fx[1] * whole)
        self.C[p, 2] = (4 * self.par[INV]) * (mz - fx[2] * whole)
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
    def advance(self, dt, vz, vs):
        """One time step with the tool commanded at (vs, vz) [m/s]."""
        w = ti.Vector([self.window[d] for d in range(6)])
        for _ in range(1):
            self.drive(dt, vz, vs)
            if ti.static(self.damage):
                for d in ti.static(range(3)):
                    self.hot[d], self.hot[d + 3] = FAR, -FAR
        if ti.static(not self.nodal):
            for i in range(self.stations):
                self.lead(i)
        for c in range(self.rows(w)):
            i, j, low, high = self.row(c, w)
            for k in range(low, high):
                for s in ti.static(range(self.threads)):
                    self.g[s, i, j, k] = ti.Vector.zero(float, 4)
            if ti.static(self.b1 > self.b0):
                if self.b0 <= j < self.b1:
                    for k in range(low, high):
                        for s in ti.static(range(self.threads)):
                            self.g[s, i, self.second + j, k] = ti.Vector.zero(float, 4)
        for part in range(self.parts):
            first, last, thread = self.share(part)
            if first < last:
                total = ti.Vector.zero(float, 5)
                for block in range(first, last):
                    total += self.scatter_block(block, thread, dt, w)
                for r in ti.static(range(5)):
                    self.sums[PLASTIC + r] += total[r]
        if ti.static(self.threads > 1):
            for c in range(self.rows(w)):
                i, j, low, high = self.row(c, w)
                for k in range(low, high):
                    self.add_threads(i, j, k)
                if ti.static(self.b1 > self.b0):
                    if self.b0 <= j < self.b1:
                        for k in range(low, high):
                            self.add_threads(i, self.second + j, k)
        if ti.static(self.mx):
            for j, k in ti.ndrange((w[1], w[4]), (w[2], w[5])):
                self.fold_x(j, k)
                if ti.static(self.b1 > self.b0):
                    if self.b0 <= j < self.b1:
                        self.fold_x(self.second + j, k)
        for c in range(self.rows(w)):
            i, j, low, high = self.row(c, w)
            for k in range(low, high):
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
        if ti.static(self.damage):
            self.smooth_strain(w)

    @ti.func
    def rows(self, w):
        """Number of rows of nodes along z in the box ``w``; on a GPU each node is a row."""
        return (w[3] - w[0]) * (w[4] - w[1]) * ((w[5] - w[2]) if ti.static(self.atomic) else 1)

    @ti.func
    def row(self, c, w):
        """Place i, j of a row and its first and last node (excluded)."""
        low, high = w[2], w[5]
        r = c
        if ti.static(self.atomic):
            deep = w[5] - w[2]
            r = c // deep
            low += c - r * deep
            high = low + 1
        wide = w[4] - w[1]
        i = r // wide
        return w[0] + i, w[1] + r - i * wide, low, high

    @ti.func
    def add_threads(self, i, j, k):
        """Sum the private grids of all threads at one node."""
        q = self.g[0, i, j, k]
        for t in ti.static(range(1, self.threads)):
            q += self.g[t, i, j, k]
        self.g[0, i, j, k] = q

    @ti.kernel
    def step(self, dt: float, vz: float, vs: float):
        """One time step, its loops in parallel."""
        self.advance(dt, vz, vs)

    @ti.kernel
    def steps(self, rows: int, every: int, count: int, dt: float, vz: float, vs: float, out: TABLE):
        """``count`` time steps on one thread without leaving the kernel, with a row of the report after ``every``."""
        ti.loop_config(serialize=True)
        for r in range(rows):
            self.look_around()
            for _ in range(ti.min(every, count - r * every)):
                self.advance(dt, vz, vs)
            self.report(out, r)

    @ti.kernel
    def surround(self):
        """Renew the window."""
        self.look_around()

    @ti.kernel
    def write(self, out: TABLE):
        """One row of the report."""
        self.report(out, 0)

    @ti.func
    def near_hot(self, base, cells):
        """Whether a particle is at most so many cells from the box of those whose strain could damage something."""
        out = True
        for d in ti.static(range(3)):
            if base[d] < self.hot[d] - cells or base[d] > self.hot[d + 3] + cells:
                out = False
        return out

    @ti.func
    def spread_strain(self, p, thread, window):
        """Largest principal strain of a particle to the grid, times its weights."""
        base, fx = self.local(self.x[p])
        if self.near_hot(base, 4) and self.inside(base, window) > 0:
            f = self.deformation_of(p)
            strain = largest_eigenvalue(left_stretch(left_cauchy_green(f), f.determinant()) - unit())
            w = self.weights(fx)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                wt = w[i][0] * w[j][1] * w[k][2]
                self.add(thread, base[0] + i, base[1] + j, base[2] + k, ti.Vector([wt * strain, wt, 0.0, 0.0]))

    @ti.func
    def smooth_strain(self, window):
        """Replace each particle's driving strain by its mean over the grid's weights (one pass).

        Only where it can matter: two particles meet at a node when they are at most two cells apart, so that those
        within two cells of a strain above the threshold may be damaged, and those within four contribute to that. It
        uses the grids of the threads, which are cleared at the start of a step.
        """
        box = window
        for d in ti.static(range(3)):
            box[d] = ti.max(window[d], self.hot[d] - 4)
            box[d + 3] = ti.min(window[d + 3], self.hot[d + 3] + 7)
            box[d + 3] = ti.max(box[d + 3], box[d])
        on = 1 if self.hot[3] >= 0 else 0
        for c in range(self.rows(box)):
            i, j, low, high = self.row(c, box)
            for k in range(low, high):
                for s in ti.static(range(self.threads)):
                    self.g[s, i, j, k] = ti.Vector.zero(float, 4)
        for part in range(self.parts * on):
            first, last, thread = self.share(part)
            for p in range(first * self.lanes, ti.min(last * self.lanes, self.n)):
                self.spread_strain(p, thread, window)
        for p in range(self.n * on):
            base, fx = self.local(self.x[p])
            if self.near_hot(base, 2) and self.inside(base, window) > 0:
                w = self.weights(fx)
                e = 0.0
                for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                    total = ti.Vector.zero(float, 2)
                    for s in ti.static(range(self.threads)):
                        q = self.g[s, base[0] + i, base[1] + j, base[2] + k]
                        total += ti.Vector([q[0], q[1]])
                    e += w[i][0] * w[j][1] * w[k][2] * total[0] / ti.max(total[1], 1e-30)
                self.strain[p] = e

    @ti.func
    def measured(self, p):
        """Momentum (3), kinetic and elastic energy of a particle [N s, J]."""
        m, u = self.par[MASS], self.v[p]
        spin = self.C[p, 0].norm_sqr() + self.C[p, 1].norm_sqr() + self.C[p, 2].norm_sqr()
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
        kinetic = 0.5 * m * (u.norm_sqr() + 0.25 * self.par[DX] * self.par[DX] * spin)
        energy = self.par[VOL] * (keep * dev + (keep if j > 1 else 1.0) * vol)
        return ti.Vector([m * u[0], m * u[1], m * u[2], kinetic, energy])

    @ti.func
    def report(self, out: ti.template(), row):
        """Write what was booked since the last report, the state of the particles and the pose; clear what was booked.

        Images of mirrors are not counted.
        """
        for r in range(N_STATE):
            self.state[r] = 0.0
        for part in range(self.parts):
            first, last, _ = self.share(part)
            if first < last:
                total = ti.Vector.zero(ti.f64, N_STATE)
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.n)):
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
        for part in range(self.parts):
            first, last, _ = self.share(part)
            if first < last:
                low, high = ti.Vector([FAR, FAR, FAR]), ti.Vector([-FAR, -FAR, -FAR])
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.n)):
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
                plane = ti.static((self.i0, self.j0, -1)[d])
                if ti.static(plane >= 0):
                    low, high = ti.min(low, plane - 2), ti.max(high, plane + 3)
                self.window[d] = ti.max(low, 0)
                self.window[d + 3] = ti.min(high, self.nodes[d])
