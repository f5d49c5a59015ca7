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
from mpm.contact import blade_distance, bspline, coulomb, edge_level, stick_slip

# Rows of the parameter table that kernels read at run time.
MU, LAM, YIELD, MASS, VOL, FRICTION, BOARD_MU = range(7)
R_FLESH, R_START, DEPTH, SLIP, ZONE, FULL, EPS0, EPSF = range(7, 15)
SPINE, COS, SIN, HALF_LENGTH, BLADE, GRAVITY, REACH, ETA_S, ETA_B = range(15, 24)
N_PARAMETERS = 24
# Rows of the accumulator table, cleared by the host at each output interval.
EDGE, FACE, BOARD = 0, 3, 6
PLASTIC, DAMAGE, VISCOUS, INVERTED, OUTSIDE = 9, 10, 11, 12, 13
N_SUMS = 14
EMPTY_ZONE = 0.05  # a process zone filled less than this carries no edge
CPU_BLOCK = 512  # Taichi runs CPU loops shorter than this on one thread, so one iteration in 512 works for a thread


IVEC6 = ti.types.vector(6, ti.i32)


@ti.data_oriented
class Kernels:
    """Fields and kernels of one discretised scene.

    Args:
        n: Number of particles.
        nodes: Grid nodes along x, y, z.
        dx: Cell size [m].
        origin: Position of node (0, 0, 0) [m].
        planes: Node index of the mirror planes (x, y), -1 where there is none.
        threads: CPU threads, 0 on a GPU.
        nodal: Plain nodal projection instead of the cohesive edge and particle contact.
        damage: Bulk damage on.
    """

    def __init__(self, n, nodes, dx, origin, planes, threads, nodal, damage):
        self.n, self.nodes, self.dx, self.inv = n, nodes, float(dx), 1.0 / float(dx)
        self.ox, self.oy, self.oz = (float(o) for o in origin)
        self.i0, self.j0 = planes
        self.mx, self.my = self.i0 >= 0, self.j0 >= 0
        self.threads, self.nodal, self.damage = max(threads, 1), nodal, damage
        self.atomic = threads == 0
        self.sides = 1 if nodal or self.my else 2
        real = ti.lang.impl.get_runtime().default_fp
        vec3, vec4 = ti.types.vector(3, real), ti.types.vector(4, real)
        mat3 = ti.types.matrix(3, 3, real)
        self.x, self.v = vec3.field(shape=n), vec3.field(shape=n)
        self.C, self.F = mat3.field(shape=n), mat3.field(shape=n)
        self.side, self.gap = ti.field(ti.i32, n), ti.field(real, n)
        self.foot, self.kappa = ti.field(real, n), ti.field(real, n)
        self.strain = ti.field(real, n if damage else 1)
        self.stick = vec3.field(shape=(2, n))  # board, blade
        self.g = vec4.field(shape=(self.threads * self.sides, *nodes))
        self.u = vec4.field(shape=(self.sides, *nodes))
        self.smooth = ti.Vector.field(2, real, nodes if damage else (1, 1, 1))
        self.elastic_slip, self.cut = ti.field(real, nodes[0]), ti.field(real, nodes[0])
        self.soften, self.cover = ti.field(real, nodes[0]), ti.field(real, nodes[0])
        self.start, self.near = ti.field(real, nodes[0]), ti.field(ti.i32, nodes[0])
        self.par = ti.field(real, N_PARAMETERS)
        self.sums = ti.field(ti.f64, N_SUMS)
        self.state = ti.field(ti.f64, 8)

    @ti.kernel
    def reset(self):
        """Particles at rest and unstrained, nothing cut, nothing booked."""
        for p in self.x:
            self.v[p] = ti.Vector.zero(float, 3)
            self.C[p] = ti.Matrix.zero(float, 3, 3)
            self.F[p] = ti.Matrix.identity(float, 3)
            self.side[p] = 0
            self.gap[p] = 0.0
            self.kappa[p] = 0.0
            for b in ti.static(range(2)):
                self.stick[b, p] = ti.Vector.zero(float, 3)
        for i in self.cut:
            self.elastic_slip[i] = 0.0
            self.cut[i] = 0.0
            self.start[i] = 0.0
        for k in self.sums:
            self.sums[k] = 0.0

    @ti.func
    def local(self, q):
        """Lowest node of the 27 that a point reaches, and its offset in cells."""
        u = (q - ti.Vector([self.ox, self.oy, self.oz])) * self.inv
        base = ti.floor(u - 0.5).cast(ti.i32)
        return base, u - base.cast(float)

    @ti.func
    def weights(self, fx):
        """Quadratic B-spline weights of three nodes along each axis."""
        return [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]

    @ti.func
    def node(self, i, j, k):
        """Position of a node [m]."""
        return ti.Vector([self.ox + i * self.dx, self.oy + j * self.dx, self.oz + k * self.dx])

    @ti.func
    def half(self, p):
        """Velocity field of a particle: 0 left of the blade plane, 1 right of it."""
        out = 0
        if ti.static(self.sides > 1):
            out = self.side[p] - 1 if self.side[p] > 0 else ti.cast(self.x[p][1] >= 0, ti.i32)
        return out

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
    def scatter(self, p, thread, dt, tip):
        """Particle to grid; returns (plastic, damage, viscous loss per volume, inverted, outside)."""
        self.sever(p, tip)
        loss, tau = self.stress(p, dt)
        base, fx = self.local(self.x[p])
        outside = 0.0
        for d in ti.static(range(3)):
            if base[d] < 0 or base[d] + 2 >= self.nodes[d]:
                outside = 1.0
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
    def fold_x(self, slot, j, k):
        """Add the mirror image across the node plane i0 to one line of nodes."""
        for h in ti.static(range(1, 3)):
            if ti.static(self.i0 - h >= 0):
                a, b = self.g[slot, self.i0 + h, j, k], self.g[slot, self.i0 - h, j, k]
                b[0] = -b[0]
                a += b
                self.g[slot, self.i0 + h, j, k] = a
                a[0] = -a[0]
                self.g[slot, self.i0 - h, j, k] = a
        c = 2.0 * self.g[slot, self.i0, j, k]
        c[0] = 0.0
        self.g[slot, self.i0, j, k] = c

    @ti.func
    def other(self, i, j, k):
        """Momentum and mass of the right half at a node; with the mirror it is the image of the left half."""
        q = ti.Vector.zero(float, 4)
        if ti.static(self.my):
            jm = 2 * self.j0 - j
            if 0 <= jm < self.nodes[1]:
                q = self.g[0, i, jm, k]
                q[1] = -q[1]
        elif ti.static(self.sides > 1):
            q = self.g[1, i, j, k]
        return q

    @ti.func
    def images_x(self, i):
        """How many mirror images across x = 0 a node stands for: 0 for ghosts, 1 on the plane, else 2."""
        out = 1.0
        if ti.static(self.mx):
            out = 0.0 if i < self.i0 else (1.0 if i == self.i0 else 2.0)
        return out

    @ti.func
    def images(self, i, j):
        """How many mirror images a node stands for."""
        out = self.images_x(i)
        if ti.static(self.my):
            out *= 0.0 if j > self.j0 else (1.0 if j == self.j0 else 2.0)
        return out

    @ti.func
    def tool(self, row, jx, jy, jz):
        """Book an impulse of the food on a tool; mirror images cancel across their plane."""
        if ti.static(not self.mx):
            self.sums[row] += jx
        if ti.static(not self.my):
            self.sums[row + 1] += jy
        self.sums[row + 2] += jz

    @ti.func
    def nodal_contact(self, i, j, k, q, u, tip, speed):
        """The plain rule: velocities at nodes inside a tool are projected, with Coulomb friction."""
        at = self.node(i, j, k)
        mult = self.images(i, j)
        for which in ti.static(range(2)):
            d, nrm, vel, mu = at[2], ti.Vector([0.0, 0.0, 1.0]), ti.Vector.zero(float, 3), self.par[BOARD_MU]
            if ti.static(which == 1):
                d, nrm = blade_distance(ti.abs(at[1]), at[2] - tip, self.par[SPINE], self.par[COS], self.par[SIN])
                if ti.abs(at[1]) < 1e-6 * self.dx:  # both faces are equally near: their mean normal is downwards
                    nrm = ti.Vector([0.0, 0.0, -1.0])
                elif at[1] < 0:
                    nrm[1] = -nrm[1]
                vel, mu = ti.Vector([0.0, 0.0, -speed]), self.par[FRICTION]
                if at[2] < tip or at[2] - tip > self.par[BLADE] or ti.abs(at[0]) > self.par[HALF_LENGTH]:
                    d = 1.0
            rel = u - vel
            vn = rel.dot(nrm)
            if d <= 0 and vn < 0:
                t = rel - vn * nrm
                new = vel + t + coulomb(-vn, t, mu)
                dj = mult * q[3] * (u - new)
                self.tool(FACE if ti.static(which == 1) else BOARD, dj[0], dj[1], dj[2])
                u = new
        return u

    @ti.func
    def update_node(self, i, j, k, dt, tip, speed):
        """Momentum to velocity at a node: below the edge one body, above it two halves with a velocity each."""
        a, b = self.g[0, i, j, k], self.other(i, j, k)
        q = a + b
        left, right = ti.Vector.zero(float, 4), ti.Vector.zero(float, 4)
        if q[3] > 0:
            fall = ti.Vector([0.0, 0.0, -self.par[GRAVITY] * dt])
            u = ti.Vector([q[0], q[1], q[2]]) / q[3] + fall
            if ti.static(self.nodal):
                u = self.nodal_contact(i, j, k, q, u, tip, speed)
            va, vb = u, u
            if ti.static(not self.nodal):
                at = self.node(i, j, k)
                if a[3] > 0 and b[3] > 0 and at[2] > tip - 0.5 * self.dx and ti.abs(at[0]) < self.par[HALF_LENGTH]:
                    va = ti.Vector([a[0], a[1], a[2]]) / a[3] + fall
                    vb = ti.Vector([b[0], b[1], b[2]]) / b[3] + fall
                    # behind the blade the halves may close on each other, but not pass through
                    if at[2] > tip + self.par[BLADE] and va[1] > vb[1]:
                        va[1] = u[1]
                        vb[1] = u[1]
            left = ti.Vector([va[0], va[1], va[2], a[3]])
            right = ti.Vector([vb[0], vb[1], vb[2], b[3]])
        self.u[0, i, j, k] = left
        if ti.static(self.sides > 1):
            self.u[1, i, j, k] = right

    @ti.func
    def zone_weight(self, j, k, tip):
        """Weight of a node in the process zone of the edge, centred half a zone below it."""
        z = self.par[ZONE]
        wy = bspline((self.oy + j * self.dx) / z)
        wz = bspline((self.oz + k * self.dx - tip) / z + 0.5)
        return wy * wz

    @ti.func
    def edge_force(self, i, advance):
        """Line force of the edge in one slice after it advanced against the material [N/m].

        A cut starts where the force reaches the threshold, at the indentation that belongs to it, and from there runs
        along the blade to every slice that already carries the propagation resistance: growing a crack takes less
        than starting one. Then the force falls to that resistance.
        """
        slip, flesh = self.par[SLIP], self.par[R_FLESH]
        e = ti.max(self.elastic_slip[i] + advance, 0.0)
        force = 0.0
        if self.start[i] <= 0:
            force = self.par[R_START] * e / self.par[DEPTH]
            if force >= self.par[R_START] or (self.near[i] > 0 and force >= flesh):
                self.start[i] = ti.max(force, 1e-9)
                e = slip
        else:
            self.cut[i] += ti.max(e - slip, 0.0)
            e = ti.min(e, slip)
            force = edge_level(self.cut[i], self.soften[i], self.start[i], flesh) * e / slip
        self.elastic_slip[i] = e
        return force

    @ti.func
    def cut_slice(self, i, dt, tip, speed):
        """The cutting edge in one slice along the blade: slip, line force, reaction on the grid."""
        reach = 1.5 * self.par[ZONE]
        j_low = ti.max(0, ti.floor((-reach - self.oy) * self.inv, ti.i32))
        j_high = ti.min(self.nodes[1], ti.ceil((reach - self.oy) * self.inv, ti.i32) + 1)
        k_low = ti.max(0, ti.floor((tip - self.par[ZONE] / 2 - reach - self.oz) * self.inv, ti.i32))
        k_high = ti.min(self.nodes[2], ti.ceil((tip - self.par[ZONE] / 2 + reach - self.oz) * self.inv, ti.i32) + 1)
        mass, mom = 0.0, 0.0
        for j in range(j_low, j_high):
            for k in range(k_low, k_high):
                for s in ti.static(range(self.sides)):
                    q = self.u[s, i, j, k]
                    wt = ti.static(2.0 if self.my else 1.0) * self.zone_weight(j, k, tip) * q[3]
                    mass += wt
                    mom += wt * q[2]
        if mass > EMPTY_ZONE * self.par[FULL]:
            force = self.edge_force(i, (speed + mom / mass) * dt)
            fill = ti.min(1.0, mass / self.par[FULL])
            impulse = force * fill * self.cover[i] * self.dx * dt
            dv = impulse / mass
            for j in range(j_low, j_high):
                for k in range(k_low, k_high):
                    push = dv * self.zone_weight(j, k, tip)
                    for s in ti.static(range(self.sides)):
                        self.u[s, i, j, k][2] = self.u[s, i, j, k][2] - push
                        if ti.static(self.mx):
                            image = 2 * self.i0 - i
                            if i > self.i0 and image >= 0:
                                self.u[s, image, j, k][2] = self.u[s, image, j, k][2] - push
            self.tool(EDGE, 0.0, 0.0, impulse * self.images_x(i))
        else:
            self.elastic_slip[i] = 0.0

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
    def gather(self, p, dt, tip, speed):
        """Grid to particle, then contact."""
        base, fx = self.local(self.x[p])
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
                row = self.scatter(p, 0, dt, tip)
                for r in ti.static(range(5)):
                    self.sums[PLASTIC + r] += row[r]
        elif ti.static(self.threads == 1):
            total = ti.Vector.zero(float, 5)
            for p in range(self.n):
                total += self.scatter(p, 0, dt, tip)
            for r in ti.static(range(5)):
                self.sums[PLASTIC + r] += total[r]
        else:
            for block in range(self.threads * CPU_BLOCK):
                if block % CPU_BLOCK == 0:
                    t = block // CPU_BLOCK
                    total = ti.Vector.zero(float, 5)
                    for p in range(self.n * t // self.threads, self.n * (t + 1) // self.threads):
                        total += self.scatter(p, t, dt, tip)
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
            self.gather(p, dt, tip - speed * dt, speed)

    @ti.kernel
    def step(self, dt: float, tip: float, speed: float, w: IVEC6):
        """One time step, its loops in parallel."""
        self.advance(dt, tip, speed, w)
        if ti.static(self.damage):
            self.smooth_strain()

    @ti.kernel
    def steps(self, count: int, dt: float, tip: float, speed: float, w: IVEC6):
        """Several time steps on one thread without leaving the kernel."""
        ti.loop_config(serialize=True)
        for n in range(count):
            self.advance(dt, tip - speed * dt * n, speed, w)
            if ti.static(self.damage):
                self.smooth_strain()

    @ti.func
    def smooth_strain(self):
        """Replace each particle's driving strain by its mean over the grid's weights (one pass)."""
        for i, j, k in self.smooth:
            self.smooth[i, j, k] = ti.Vector.zero(float, 2)
        for p in self.x:
            base, fx = self.local(self.x[p])
            w = self.weights(fx)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                wt = w[i][0] * w[j][1] * w[k][2]
                self.smooth[base[0] + i, base[1] + j, base[2] + k] += ti.Vector([wt * self.strain[p], wt])
        for p in self.x:
            base, fx = self.local(self.x[p])
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
