"""The time step as Taichi kernels. One Kernels object serves a class of scenes; sizes, material and tool are run-time data."""

import taichi as ti

from mpm.constitutive import full, unit
from mpm.contact import blade_distance, stick_slip, tack
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
    COUNT,
    DX,
    EDGE,
    FACE,
    FAR,
    FRICTION,
    INV,
    MASS,
    PLASTIC,
    RADIUS,
    RUBBED,
    SECOND,
    SIN,
    SPINE,
    STATIONS,
    TACK,
    TACK_GAP,
    TILT_COS,
    TILT_SIN,
    VOL,
    VS,
    VZ,
    S,
    Z,
)
from mpm.survey import Survey

# Stiffness of the contact over mass / dt^2 of a particle. The stiffest sound one is 4 for a lone particle on a hard surface,
# over 1 + 4 arm^2 / dx^2 when the impulse has an arm, which is half a cell at most.
CONTACT = 2.0
FLAT = 0.02  # least distance between a particle's centre and the surface that squeezing leaves, over the cell

TABLE = ti.types.ndarray(dtype=ti.f64, ndim=2)


@ti.data_oriented
class Kernels(Survey):
    """Transfers, contact of particles, and the loops of a time step."""

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
        """Particles of a block to grid; returns (plastic, damage, viscous loss per volume, inverted, outside)."""
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
        loss, tau = ti.Vector.zero(float, 4), 0.0 * unit()
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
            m = self.par[MASS]
            pull = -dt * self.par[VOL] * 4 * self.par[INV]
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
        return ti.Vector([loss[0], loss[1], loss[2], loss[3], outside])

    @ti.func
    def touch(self, p, dt, u, at):
        """Contact of one particle with board and tool; returns its corrected velocity.

        What touches is the food's surface, not the particle's centre. Its distance from the centre stretches with the
        food, it moves with the food's velocity there, and the impulse has the moment that belongs to it, so that the work
        of the contact is that of the surface. At the centre a food of n cells would be 1 / n stiffer.

        The force is the food's own traction on the surface and, for what is missing, a stiff spring (Nitsche's method:
        Chouly and Hild 2013, SIAM J. Numer. Anal. 51:1295). The spring alone, as stiff as the time step allows, would
        give way as much as a fifth of a cell of food does.
        """
        m = self.par[MASS] * ti.static((2 if self.mx else 1) * (2 if self.my else 1))
        c = self.gradient_of(p)
        up = self.blade_axes(c @ ti.Vector([0.0, 0.0, 1.0]))  # gradient of the velocity, upwards and across the blade
        across = self.blade_axes(c @ self.grid_axes(ti.Vector([0.0, 1.0, 0.0])))
        there, v = self.blade_axes(at), self.blade_axes(u)
        least, most = FLAT * self.par[DX], 0.5 * self.par[DX]
        kick, high, wide = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if 0 < self.foot[p] and there[2] < 2 * self.par[DX]:  # a free body has none
            self.foot[p] = ti.math.clamp(self.foot[p] * (1 + dt * up[2]), least, most)
            kick = self.touch_board(p, m, dt, v - self.foot[p] * up, there)
            high -= self.foot[p] * kick
        arm, push = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if ti.static(self.press):
            if there[2] > ti.cast(self.pose[Z], float) - 2 * self.par[DX]:
                self.gap[p] = ti.math.clamp(self.gap[p] * (1 + dt * up[2]), least, most)
                arm = ti.Vector([0.0, 0.0, self.gap[p]])
                push = self.touch_press(p, m, dt, v + kick + self.gap[p] * up, there + arm)
        else:
            if ti.abs(there[1]) < 2 * self.par[DX]:
                self.gap[p] = ti.math.clamp(self.gap[p] * (1 + dt * across[1]), least, most)
            push, arm = self.touch_blade(p, m, dt, v + kick, up, across, there)
        high += arm[2] * push
        wide += arm[1] * push
        scale = 4 * self.par[INV] * self.par[INV]
        high, wide = self.grid_axes(high), self.grid_axes(wide)
        new = v + kick + push
        gift = 0.5 * (new.norm_sqr() - v.norm_sqr())
        self.lever[p, 0] = ti.Vector([scale * high[0], scale * high[1], scale * high[2], gift])
        self.lever[p, 1] = scale * ti.Vector([wide[0], wide[1], wide[2], 0.0])
        return self.grid_axes(new)

    @ti.func
    def traction(self, p, shell, depth, n, dt):
        """Force that the food's own stress asks of a board or tool with outward normal n, over the contact's stiffness [m].

        Of the first layer only: ``shell`` is the reference volume between centre and surface, ``depth`` their distance.
        """
        out = ti.Vector.zero(float, 3)
        if shell > 0:
            block = p // self.lanes
            lane = p - block * self.lanes
            t = ti.Vector([self.tau[block, r][lane] for r in range(6)])
            out = self.blade_axes(full(t) @ self.grid_axes(n))
            out *= -shell / depth * dt * dt / (CONTACT * self.par[MASS])
        return out

    @ti.func
    def touch_board(self, p, m, dt, u, at):
        """Contact of one particle with the board; returns the change of its velocity. ``u`` is that of its surface."""
        dv = ti.Vector.zero(float, 3)
        own = self.traction(p, self.shell[p][0], self.foot[p], ti.Vector([0.0, 0.0, 1.0]), dt)
        force = self.foot[p] - at[2] + own[2]
        own[2] = 0.0
        if force > 0:
            slide = dt * ti.Vector([u[0], u[1], 0.0])
            hold = stick_slip(self.stick[0, p], slide, own, force, self.par[BOARD_MU])
            self.stick[0, p] = own - hold
            dv = CONTACT / dt * ti.Vector([hold[0], hold[1], force])
            self.tool(BOARD, -m * dv)
            self.sums[RUBBED] -= m / dt * dv.dot(slide)
        else:
            self.stick[0, p] = ti.Vector.zero(float, 3)
        return dv

    @ti.func
    def touch_blade(self, p, m, dt, u, up, across, at):
        """Contact of one severed particle with the blade's faces; returns the change of its velocity, and its lever arm.

        A particle meets the blade as far from its centre as it was from the cut plane when the food was whole, so
        that the faces displace the food by the true half thickness of the blade.
        """
        cos_t, sin_t = self.par[TILT_COS], self.par[TILT_SIN]
        above = (at[2] - self.edge_height(at[0])) * cos_t
        touching = False
        dv, arm = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if self.side[p] != 0 and 0 < above < self.par[BLADE] and self.under_blade(at[0]):
            sign = 1.0 if self.side[p] == 2 else -1.0
            d, n = blade_distance(sign * at[1], above, self.par[SPINE], self.par[COS], self.par[SIN], self.par[RADIUS])
            n = ti.Vector([-sin_t * n[2], sign * n[1], cos_t * n[2]])
            own = self.traction(p, self.shell[p][1], self.gap[p], n, dt)
            opening = d - self.gap[p]
            force = own.dot(n) - opening
            press = ti.max(force, 0.0)
            own -= own.dot(n) * n
            if force > 0 and self.tacky[p] == 0:
                self.tacky[p] = 1
            if force <= 0 and self.tacky[p] == 1:
                if opening < self.par[TACK_GAP]:
                    opening = ti.max(opening, 0.0)
                    force = -self.par[TACK] * tack(opening, self.par[TACK_GAP]) * dt * dt / CONTACT
                    press = -force
                else:
                    self.tacky[p] = 0
            if press > 0:
                touching = True
                arm = -self.gap[p] * n
                tool = ti.Vector([ti.cast(self.pose[VS], float), 0.0, ti.cast(self.pose[VZ], float)])
                rel = u + arm[2] * up + arm[1] * across - tool
                slide = rel - rel.dot(n) * n
                stick = self.stick[1, p] - self.stick[1, p].dot(n) * n
                hold = stick_slip(stick, dt * slide, own, press, self.par[FRICTION])
                self.stick[1, p] = own - hold
                dv = CONTACT / dt * (force * n + hold)
                self.tool(FACE, -m * dv)
                self.sums[RUBBED] -= m * dv.dot(slide if force > 0 else rel)
        if not touching:
            self.stick[1, p] = ti.Vector.zero(float, 3)
        return dv, arm

    @ti.func
    def touch_press(self, p, m, dt, u, at):
        """Contact of one particle with a plate or wedge that presses from above; returns the change of its velocity.

        ``at`` and ``u`` are place and velocity of the food's surface above the particle.
        """
        sign = 1.0 if at[1] >= 0 else -1.0
        above = at[2] - ti.cast(self.pose[Z], float)
        d, n = blade_distance(sign * at[1], above, self.par[SPINE], self.par[COS], self.par[SIN], self.par[RADIUS])
        n = ti.Vector([0.0, sign * n[1], n[2]])
        own = self.traction(p, self.shell[p][1], self.gap[p], n, dt)
        force = own.dot(n) - d
        own -= own.dot(n) * n
        dv = ti.Vector.zero(float, 3)
        if force > 0:
            tool = ti.Vector([ti.cast(self.pose[VS], float), 0.0, ti.cast(self.pose[VZ], float)])
            stick = self.stick[1, p] - self.stick[1, p].dot(n) * n
            slide = u - tool
            slide -= slide.dot(n) * n
            hold = stick_slip(stick, dt * slide, own, force, self.par[FRICTION])
            self.stick[1, p] = own - hold
            dv = CONTACT / dt * (force * n + hold)
            self.tool(FACE, -m * dv)
            self.sums[RUBBED] -= m * dv.dot(slide)
        else:
            self.stick[1, p] = ti.Vector.zero(float, 3)
        return dv

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
            u = self.touch(p, dt, u, at)
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
        """One time step with the tool commanded at (vs, vz) [m/s].

        On a CPU the short loops do not go to the threads: to wake them takes 0.1 ms, a tenth of a step of 8,000 particles.
        """
        w = ti.Vector([self.window[d] for d in range(6)])
        ti.loop_config(serialize=self.alone)
        for _ in range(1):
            self.drive(dt, vz, vs)
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
        for p in range(self.size[COUNT]):
            self.gather(p, dt, w)
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
