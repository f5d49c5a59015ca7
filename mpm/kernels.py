"""The time step as Taichi kernels. One Kernels object serves a class of scenes; sizes, material and tool are run-time data."""

import taichi as ti

from mpm.constitutive import unit
from mpm.fields import (
    ARM_C,
    ARM_K,
    ARM_LIMIT,
    ARM_MASS,
    BOOKED,
    COMMAND,
    COUNT,
    DX,
    EDGE,
    FACE,
    FAR,
    INV,
    MASS,
    PLASTIC,
    SECOND,
    STATIONS,
    TILT,
    TILT_COS,
    TILT_SIN,
    TURN,
    VOL,
    VS,
    VZ,
    S,
    Z,
)
from mpm.touch import Touch

TABLE = ti.types.ndarray(dtype=ti.f64, ndim=2)


@ti.data_oriented
class Kernels(Touch):
    """Transfers, and the loops of a time step."""

    @ti.func
    def sever(self, p, q):
        """Material that the edge has passed belongs to the left (1) or right (2) half for good.

        At the board that is all of it, also what is pressed a little into the board.
        """
        if ti.static(self.cuts):
            tip = self.edge_height(q[0])
            if self.side[p] == 0 and (q[2] > tip or tip <= 0) and self.under_blade(q[0]):
                self.side[p] = 1 + self.half(p, q[1])

    @ti.func
    def columns(self, base, i, code):
        """Where the fields of the nodes of a particle are stored along y, (j, k): its own side's or the other one's."""
        at, second = ti.Matrix.zero(ti.i32, 3, 3), self.size[SECOND]
        for j, k in ti.static(ti.ndrange(3, 3)):
            at[j, k] = base[1] + j
            if ti.static(self.cuts):
                at[j, k] += 0 if k < self.layer(code, i, j) else second
        return at

    @ti.func
    def scatter_block(self, block, thread, dt, window):
        """Particles of a block to grid; returns (plastic, damage, viscous loss over ``VOL``, inverted, outside)."""
        total = ti.Vector.zero(float, 5)
        if ti.static(self.branches == 0):
            self.elastic(block, dt)
        for lane in range(self.lanes):
            p = block * self.lanes + lane
            if p < self.size[COUNT]:
                total += self.scatter(p, block, lane, thread, dt, window)
        return total

    @ti.func
    def scatter(self, p, block, lane, thread, dt, window):
        """One particle to grid; returns as :meth:`scatter_block`."""
        q = self.blade_axes(self.x[p])
        self.sever(p, q)
        bulk, loss, tau = self.bulk[p], ti.Vector.zero(float, 4), 0.0 * unit()
        one_by_one = True
        if ti.static(self.branches == 0):
            one_by_one = self.tau[block, 8][lane] > 0
        if one_by_one:
            loss, tau = self.stress(p, block, lane, dt)
            for r in ti.static(range(6)):
                self.tau[block, r][lane] = tau[r]
        else:
            for r in ti.static(range(6)):
                tau[r] = self.tau[block, r][lane]
            loss[2], loss[0] = self.tau[block, 6][lane], self.tau[block, 7][lane]
        base, fx = self.local(self.x[p])
        outside = 1.0 - self.inside(base, window)
        if outside == 0.0:
            w = self.weights(fx)
            m = self.par[MASS] * bulk
            pull = -dt * self.par[VOL] * bulk * 4 * self.par[INV]
            carry = m * self.par[DX] * ti.Vector([1.0, 1.0, 1.0, 0.0])
            ax = pull * ti.Vector([tau[0], tau[5], tau[4], 0.0]) + carry * self.C[p, 0]
            ay = pull * ti.Vector([tau[5], tau[1], tau[3], 0.0]) + carry * self.C[p, 1]
            az = pull * ti.Vector([tau[4], tau[3], tau[2], 0.0]) + carry * self.C[p, 2]
            if ti.static(not self.nodal):
                az += carry * self.lever[p, 0]
                if ti.static(self.turned):
                    across = self.grid_axes(ti.Vector([0.0, 1.0, 0.0]))
                    ax += across[0] * carry * self.lever[p, 1]
                    ay += across[1] * carry * self.lever[p, 1]
                else:
                    ay += carry * self.lever[p, 1]
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
        return ti.Vector([bulk * loss[0], bulk * loss[1], bulk * loss[2], loss[3], outside])

    @ti.func
    def gather(self, p, thread, dt, window):
        """Grid to particle, then contact."""
        base, fx = self.local(self.x[p])
        if (
            self.inside(base, window) > 0
        ):  # one that has left the grid stays where it is; the run ends at the next output
            self.move(p, thread, base, fx, dt)

    @ti.func
    def plane(self, i, base, cols, w, d):
        """Velocity of plane ``i`` of a particle's nodes times their weights across it, and its slopes along y and z."""
        whole, py, pz = ti.Vector.zero(float, 4), ti.Vector.zero(float, 4), ti.Vector.zero(float, 4)
        for j in ti.static(range(3)):
            a = self.u[base[0] + i, cols[j, 0], base[2]]
            b = self.u[base[0] + i, cols[j, 1], base[2] + 1]
            c = self.u[base[0] + i, cols[j, 2], base[2] + 2]
            row = w[0][2] * a + w[1][2] * b + w[2][2] * c
            whole += w[j][1] * row
            py += d[j][1] * row
            pz += w[j][1] * (d[0][2] * a + d[1][2] * b + d[2][2] * c)
        return whole, py, pz

    @ti.func
    def move(self, p, thread, base, fx, dt):
        """Velocity, gradient and position of a particle from the 27 nodes above ``base``.

        Contact corrects the velocity that the next transfer hands on, not the position: moving the particle as well
        would let the surface slip through the material without straining it.
        """
        w = self.weights(fx)
        d = [4 * self.par[INV] * (i - fx) * w[i] for i in ti.static(range(3))]  # weights of the velocity gradient
        code = self.layers[p]
        cols = self.columns(base, 0, code)
        zero = ti.Vector.zero(float, 4)
        u4, cx, cy, cz = zero, zero, zero, zero
        if ti.static(self.atomic):
            for i in ti.static(range(3)):
                if ti.static(self.turned):
                    cols = self.columns(base, i, code)
                whole, py, pz = self.plane(i, base, cols, w, d)
                u4, cx = u4 + w[i][0] * whole, cx + d[i][0] * whole
                cy, cz = cy + w[i][0] * py, cz + w[i][0] * pz
        else:
            # Where the loop is unrolled LLVM does not find the vectors of four, and the whole step takes 8 % longer. So its end
            # is one that LLVM cannot know, and what it finds goes through memory.
            for i in range(ti.min(self.size[COUNT], 3)):
                if ti.static(self.turned):
                    cols = self.columns(base, i, code)
                whole, py, pz = self.plane(i, base, cols, w, d)
                self.planes[thread, i], self.planes[thread, 3 + i], self.planes[thread, 6 + i] = whole, py, pz
            for i in ti.static(range(3)):
                whole = self.planes[thread, i]
                u4, cx = u4 + w[i][0] * whole, cx + d[i][0] * whole
                cy += w[i][0] * self.planes[thread, 3 + i]
                cz += w[i][0] * self.planes[thread, 6 + i]
        u = ti.Vector([u4[0], u4[1], u4[2]])
        self.C[p, 0], self.C[p, 1], self.C[p, 2] = cx, cy, cz
        at = self.x[p] + dt * u
        if ti.static(not self.nodal):
            if self.may_touch(p, at):
                u = self.touch(p, dt, u, at)
            else:
                self.lever[p, 0], self.lever[p, 1] = zero, zero
        self.v[p] = u
        self.x[p] = at

    @ti.func
    def drive(self, dt, vz, vs, turn):
        """Velocity of the tool in this step: as commanded, or that of the arm behind its spring."""
        self.pose[VS], self.pose[TURN] = vs, turn
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
            self.pose[VZ] = ti.max(self.pose[VZ], -self.pose[Z] / dt)  # the board stops the edge
        else:
            self.pose[VZ] = vz

    @ti.func
    def advance(self, dt, vz, vs, turn):
        """One time step with the tool commanded at (vs, vz) [m/s] and turning [rad/s].

        On a CPU the short loops do not go to the threads: to wake them takes 0.1 ms, a tenth of a step of 8,000 particles.
        """
        w = ti.Vector([self.window[d] for d in range(6)])
        ti.loop_config(serialize=self.alone)
        for _ in range(1):
            self.drive(dt, vz, vs, turn)
            if ti.static(self.damage):
                for d in ti.static(range(3)):
                    self.hot[d], self.hot[d + 3] = FAR, -FAR
        if ti.static(self.cuts):
            ti.loop_config(serialize=self.alone)
            for i in range(self.size[STATIONS]):
                self.lead(i)
        for c in range(self.rows(w)):
            i, j, low, high = self.row(c, w)
            for k in range(low, high):
                for s in ti.static(range(self.threads)):
                    self.g[s, i, j, k] = ti.Vector.zero(float, 4)
            if ti.static(self.twins):
                if self.twin(j):
                    for k in range(low, high):
                        for s in ti.static(range(self.threads)):
                            self.g[s, i, self.size[SECOND] + j, k] = ti.Vector.zero(float, 4)
        for part in range(self.shares()):
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
                if ti.static(self.twins):
                    if self.twin(j):
                        for k in range(low, high):
                            self.add_threads(i, self.size[SECOND] + j, k)
        if ti.static(self.mx):
            for j, k in ti.ndrange((w[1], w[4]), (w[2], w[5])):
                self.fold_x(j, k)
                if ti.static(self.twins):
                    if self.twin(j):
                        self.fold_x(self.size[SECOND] + j, k)
        for c in range(self.rows(w)):
            i, j, low, high = self.row(c, w)
            for k in range(low, high):
                self.update_node(i, j, k, dt)
        if ti.static(self.cuts):
            ti.loop_config(serialize=self.alone)
            for i in range(self.size[STATIONS]):
                self.near[i] = 0
                for d in ti.static((-1, 1)):
                    if 0 <= i + d < self.size[STATIONS]:
                        self.near[i] += ti.cast(self.start[i + d] > 0, ti.i32)
            ti.loop_config(serialize=self.alone)
            for i in range(self.size[STATIONS]):
                if i >= self.i0:
                    self.feel(i, dt)
            ti.loop_config(serialize=self.alone)
            for i in range(self.size[STATIONS]):
                if i >= self.i0:
                    self.react(i)
            ti.loop_config(serialize=self.alone)
            for i in range(self.size[STATIONS]):
                if i >= self.i0:
                    self.follow(i)
        ti.loop_config(serialize=self.alone)
        for _ in range(1):
            self.pose[Z] += self.pose[VZ] * dt
            self.pose[S] += self.pose[VS] * dt
            if turn != 0:
                self.pose[TILT] += self.pose[TURN] * dt
                tilt = ti.cast(self.pose[TILT], float)
                self.pose[TILT_COS], self.pose[TILT_SIN] = ti.cos(tilt), ti.sin(tilt)
        for part in range(self.shares()):
            first, last, thread = self.share(part)
            for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[COUNT])):
                self.gather(p, thread, dt, w)
        if ti.static(self.damage):
            self.smooth_strain(w)

    @ti.func
    def add_threads(self, i, j, k):
        """Sum the private grids of all threads at one node."""
        q = self.g[0, i, j, k]
        for t in ti.static(range(1, self.threads)):
            q += self.g[t, i, j, k]
        self.g[0, i, j, k] = q

    @ti.kernel
    def step(self, dt: float, vz: float, vs: float, turn: float):
        """One time step, its loops in parallel."""
        self.advance(dt, vz, vs, turn)

    @ti.kernel
    def steps(self, rows: int, every: int, count: int, dt: float, vz: float, vs: float, turn: float, out: TABLE):
        """``count`` time steps on one thread without leaving the kernel, with a row of the report after ``every``."""
        ti.loop_config(serialize=True)
        for r in range(rows):
            self.look_around()
            for _ in range(ti.min(every, count - r * every)):
                self.advance(dt, vz, vs, turn)
            self.report(out, r)

    @ti.kernel
    def surround(self):
        """Renew the window."""
        self.look_around()

    @ti.kernel
    def write(self, out: TABLE):
        """One row of the report."""
        self.report(out, 0)
