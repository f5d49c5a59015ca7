"""Fields of one discretised scene, the tables that kernels read and write, and what every kernel needs of them."""

import taichi as ti

# Rows of the parameter table that kernels read at run time.
MU, LAM, YIELD, MASS, VOL, FRICTION, BOARD_MU = range(7)
R_FLESH, R_START, DEPTH, SLIP, ZONE, FULL, EPS0, EPSF = range(7, 15)
SPINE, COS, SIN, HALF_LENGTH, BLADE, GRAVITY, REACH, ETA_S, ETA_B = range(15, 24)
N_PARAMETERS = 24
# Rows of the accumulator table, cleared by the host at each output interval.
EDGE, FACE, BOARD = 0, 3, 6
PLASTIC, DAMAGE, VISCOUS, INVERTED, OUTSIDE = 9, 10, 11, 12, 13
N_SUMS = 14


@ti.data_oriented
class Fields:
    """Particles, grid, edge and tables.

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
        self.top, self.low, self.width = (ti.field(real, nodes[0]) for _ in range(3))
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
    def inside(self, base, window):
        """1 when the 27 nodes above ``base`` are in the ``window`` of active nodes, else 0."""
        out = 1.0
        for d in ti.static(range(3)):
            if base[d] < window[d] or base[d] + 2 >= window[d + 3]:
                out = 0.0
        return out

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
