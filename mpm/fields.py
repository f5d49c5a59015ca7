"""Fields of one discretised scene, the tables that kernels read and write, and what every kernel needs of them."""

import numpy as np
import taichi as ti

from mpm.runtime import adds_doubles

# Rows of the parameter table that kernels read at run time.
MU, LAM, YIELD, MASS, VOL, FRICTION, BOARD_MU = range(7)
R_FLESH, R_START, DEPTH, SLIP, ZONE, FULL, EPS0, EPSF = range(7, 15)
SPINE, COS, SIN, HALF_LENGTH, BLADE, GRAVITY, RADIUS, ETA_S, ETA_B = range(15, 24)
YAW_COS, YAW_SIN, TACK, TACK_GAP = range(24, 28)
ARM_K, ARM_C, ARM_MASS, ARM_LIMIT = range(28, 32)
DX, INV, OX, OY, OZ, FIRST = range(32, 38)
N_PARAMETERS = 38
# Rows of the table of sizes: particles, blocks of them, nodes along x, y, z, slices along the edge, the mirror plane across y, the
# first and last + 1 node plane along y whose nodes have a second field, how far behind the first that is stored, and the sum of the
# indices of two nodes that are mirror images across x.
COUNT, BLOCKS, NODES, STATIONS, PLANE, TWIN, TWIN_END, SECOND, PAIR = 0, 1, 2, 5, 6, 7, 8, 9, 10
N_SIZES = 11
# Rows of the accumulator table, cleared by the host at each output interval.
EDGE, FACE, BOARD = 0, 3, 6
PLASTIC, DAMAGE, VISCOUS, INVERTED, OUTSIDE, RUBBED, PARTED, MOMENT = range(9, 17)
N_SUMS = 17
# Rows of the tool's pose: height of the edge in the middle of the blade, its middle along the blade, their velocities,
# the height that is commanded, the vertical impulse booked before this step; its angle to the board, how fast that grows, cosine and sine.
Z, S, VZ, VS, COMMAND, BOOKED, TILT, TURN, TILT_COS, TILT_SIN = range(10)
N_POSE = 10
# State at an output: momentum of the particles, kinetic and elastic energy.
N_STATE = 5
N_REPORT = N_SUMS + N_STATE + N_POSE

MIRROR = 2  # index of the first node plane that is no mirror image across x
FAR = 1 << 20  # a node that no grid has
BESIDE = 3  # cells on either side of the cut plane whose nodes may carry both halves
REGISTER = 32  # bytes of a register of a CPU: as many particles as fill it have their elastic stress found at once
CPU_BLOCK = 512  # Taichi runs CPU loops shorter than this on one thread, so one iteration in 512 works for a thread
# Capacities: the smallest one, the factor by which they grow, up to where, and the step by which they grow beyond.
PARTICLE_ROOM = (4096, 4, 65_536, 65_536)
NODE_ROOM = (24, 2, 96, 32)


def capacity(size, room):
    """The size of fields that hold ``size`` entries: few sizes, so that scenes of many sizes share what is compiled once."""
    out, factor, most, step = room
    while out < min(size, most):
        out *= factor
    return out if size <= out else out + -(-(size - out) // step) * step


def particle_capacity(n):
    """Particles that fields for n of them have room for."""
    return capacity(n, PARTICLE_ROOM)


def node_capacity(nodes):
    """Nodes along an axis that a grid of so many has room for; odd, or neighbours along it would share the cache's sets."""
    return capacity(nodes, NODE_ROOM) + 1


@ti.data_oriented
class Fields:
    """Particles, grid, edge and tables, with room for a class of scenes; :meth:`lay_out` fits them to one.

    Deformation gradients are stored entry by entry for ``lanes`` particles, [block, 3 row + column, lane], so that the
    same operation on all of them is one instruction; velocity gradients column by column, each filled up to four.

    The grid stores two velocity fields: the first at ``[i, j, k]``, the second, which only nodes beside the cut plane
    have, at ``[i, second + j, k]``.

    Args:
        room: Most particles.
        nodes: Most grid nodes along x, y, z.
        mirrors: Whether there are mirror planes (x, y).
        stations: Most slices along the edge.
        threads: CPU threads, 0 on a GPU.
        nodal: Plain nodal projection instead of the cohesive edge and particle contact.
        press: The tool presses on the food's surface instead of cutting.
        damage: Bulk damage on.
        turned: The grid is turned against the blade.
        branches: Number of Prony branches.
    """

    def __init__(self, room, nodes, mirrors, stations, threads, nodal, press, damage, turned=False, branches=0):
        self.mx, self.my = mirrors
        self.i0 = MIRROR if self.mx else -1
        self.first = max(self.i0, 0)  # slice that is no mirror image
        self.threads, self.nodal, self.damage, self.turned = max(threads, 1), nodal, damage, turned
        self.press, self.cuts = press, not (nodal or press)
        self.atomic = threads == 0
        self.alone = not self.atomic  # short loops run where the kernel was launched
        self.parts = 1 if self.threads == 1 else self.threads * CPU_BLOCK
        self.branches, self.twins = branches, not nodal
        self.user = None  # whose state the fields hold
        deep = nodes[1] + (0 if nodal else nodes[1] if turned else 2 * BESIDE + 1)
        real = ti.lang.impl.get_runtime().default_fp
        self.real = np.float64 if real == ti.f64 else np.float32  # of the entries of fields, to fill them from the host
        booked = ti.f64 if adds_doubles() else ti.f32
        vec3, vec4 = ti.types.vector(3, real), ti.types.vector(4, real)
        mat3 = ti.types.matrix(3, 3, real)
        self.lanes = 1 if self.atomic else REGISTER // (8 if real == ti.f64 else 4)
        blocks = -(-room // self.lanes)
        room = blocks * self.lanes
        self.x, self.v = vec3.field(shape=room), vec3.field(shape=room)
        self.C, self.F = vec4.field(shape=(room, 3)), ti.Vector.field(self.lanes, real, (blocks, 9))
        # Kirchhoff stress (6), viscous and plastic loss, and whether the particle must be done by itself
        self.tau = ti.Vector.field(self.lanes, real, (blocks, 9))
        self.side, self.gap = ti.field(ti.i32, room), ti.field(real, room)
        self.foot = ti.field(real, room)
        self.bulk = ti.field(real, room)  # volume over that of a particle beside the cut
        # reference volume between a particle of the first layer and the board, and the tool; 0 behind the first layer
        self.shell = ti.Vector.field(2, real, room)
        # moment of the contact's last impulse as a gradient of the velocity: upwards, and across the blade; the fourth
        # entry upwards is the kinetic energy per mass that this impulse gave
        self.lever = vec4.field(shape=(room, 2))
        self.kappa, self.strain = (ti.field(real, room if damage else 1) for _ in range(2))
        self.stick = vec3.field(shape=(2, room))  # board, blade
        self.tacky, self.layers = ti.field(ti.i32, room), ti.field(ti.i32, room)
        self.memory = mat3.field(shape=(max(branches, 1), room if branches else 1))
        self.before = mat3.field(shape=room if branches else 1)
        self.share_of, self.relax = ti.field(real, max(branches, 1)), ti.field(real, max(branches, 1))
        self.g = vec4.field(shape=(self.threads, nodes[0], deep, nodes[2]))
        self.u = vec4.field(shape=(nodes[0], deep, nodes[2]))
        self.planes = vec4.field(shape=(self.threads, 16))  # of the nodes of the particle that a thread moves
        self.hot = ti.field(ti.i32, 6)  # box of the lowest nodes of particles whose strain could damage something
        self.slip, self.push = ti.Vector.field(2, real, stations), ti.Vector.field(2, real, stations)
        self.velocity = vec3.field(shape=stations)  # mean velocity of the material at the edge
        self.front, self.drift, self.cut = (ti.field(real, stations) for _ in range(3))
        self.soften, self.start = ti.field(real, stations), ti.field(real, stations)
        self.touched = ti.field(real, stations)
        self.near = ti.field(ti.i32, stations)
        self.top, self.low, self.width = (ti.field(real, stations) for _ in range(3))
        self.floor_top, self.floor_low = ti.field(real, stations), ti.field(real, stations)
        self.par = ti.field(real, N_PARAMETERS)
        self.size = ti.field(ti.i32, N_SIZES)
        self.pose = ti.field(ti.f64, N_POSE)
        self.sums = ti.field(booked, N_SUMS)
        self.state = ti.field(booked, N_STATE)
        self.window = ti.field(ti.i32, 6)  # nodes that particles can reach before it is renewed: first, last + 1
        ti.sync()  # lays these fields out by themselves; Taichi does not manage those of eight scenes at once

    def lay_out(self, n, nodes, middle, stations, between=False):
        """Fit the fields to a scene.

        Args:
            n: Number of particles.
            nodes: Grid nodes along x, y, z.
            middle: Index of the node plane along y that is nearest to y = 0: the mirror plane across y where there is one.
            stations: Number of slices along the edge.
            between: The mirror plane across x lies half-way between the first nodes and their images, not on the first nodes.
        """
        self.n, self.nodes = n, nodes
        first = 0 if self.turned else max(middle - BESIDE, 0)
        end = nodes[1] if self.turned else min(middle + BESIDE + 1, nodes[1])
        sizes = [n, -(-n // self.lanes), *nodes, stations, middle, first, end, nodes[1] - first]
        sizes.append(2 * self.i0 - between)
        self.size.from_numpy(np.array(sizes, np.int32))

    def fill(self, field, values):
        """Set the first entries of a field of particles or slices, the others to zero."""
        out = np.zeros((*field.shape, *values.shape[1:]), values.dtype)
        out[: len(values)] = values
        field.from_numpy(out)

    def of_particles(self, field):
        """A field's entries of the scene's particles as NumPy (n, ...)."""
        return field.to_numpy()[: self.n]

    @ti.kernel
    def reset(self):
        """Particles at rest and unstrained, nothing cut, nothing booked."""
        for p in self.x:
            self.v[p] = ti.Vector.zero(float, 3)
            self.side[p] = 0
            self.tacky[p] = 0
            for b in ti.static(range(2)):
                self.stick[b, p] = ti.Vector.zero(float, 3)
            if ti.static(self.branches > 0):
                self.before[p] = ti.Matrix.zero(float, 3, 3)
                for b in ti.static(range(self.branches)):
                    self.memory[b, p] = ti.Matrix.zero(float, 3, 3)
        for p, d in self.C:
            self.C[p, d] = ti.Vector.zero(float, 4)
        for p, d in self.lever:
            self.lever[p, d] = ti.Vector.zero(float, 4)
        for b, r in self.F:
            for lane in ti.static(range(self.lanes)):
                self.F[b, r][lane] = 1.0 if r % 4 == 0 else 0.0
        for i, j, k in self.u:  # the edge also looks at nodes that no particle has reached yet
            self.u[i, j, k] = ti.Vector.zero(float, 4)
        for p in self.kappa:
            self.kappa[p] = 0.0
            self.strain[p] = 0.0
        for i in self.cut:
            self.slip[i] = ti.Vector.zero(float, 2)
            self.push[i] = ti.Vector.zero(float, 2)
            self.velocity[i] = ti.Vector.zero(float, 3)
            self.cut[i] = 0.0
            self.drift[i] = 0.0
            self.start[i] = 0.0
            self.touched[i] = 0.0
            self.front[i] = 1e3
        for k in self.sums:
            self.sums[k] = 0.0

    def deformation(self):
        """Deformation gradients (n, 3, 3) as NumPy."""
        return self.F.to_numpy().transpose(0, 2, 1).reshape(-1, 3, 3)[: self.n]

    def stresses(self):
        """Kirchhoff stresses (n, 6) [Pa] of the last step as NumPy: xx, yy, zz, yz, xz, xy."""
        return self.tau.to_numpy()[:, :6].transpose(0, 2, 1).reshape(-1, 6)[: self.n]

    def gradient(self):
        """Velocity gradients (n, 3, 3) [1/s] as NumPy."""
        return self.C.to_numpy()[: self.n, :, :3].transpose(0, 2, 1)

    def set_gradient(self, values):
        """Set the velocity gradients from (n, 3, 3) [1/s]."""
        c = self.C.to_numpy()
        c[: self.n, :, :3] = np.transpose(values, (0, 2, 1))
        self.C.from_numpy(c)

    @ti.func
    def deformation_of(self, p):
        """Deformation gradient of one particle."""
        b, lane = p // self.lanes, p % self.lanes
        f = ti.Matrix.zero(float, 3, 3)
        for r, c in ti.static(ti.ndrange(3, 3)):
            f[r, c] = self.F[b, 3 * r + c][lane]
        return f

    @ti.func
    def gradient_of(self, p):
        """Velocity gradient of one particle [1/s]."""
        x, y, z = self.C[p, 0], self.C[p, 1], self.C[p, 2]
        return ti.Matrix([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])

    @ti.func
    def share(self, part):
        """Blocks of particles, first and last + 1, of one part of a parallel loop over ``parts``, and its thread."""
        thread, first, last = 0, 0, 0
        if ti.static(self.atomic):
            first, last = part, part + 1
        elif ti.static(self.threads == 1):
            last = self.size[BLOCKS]
        elif part % CPU_BLOCK == 0:
            thread, blocks = part // CPU_BLOCK, self.size[BLOCKS]
            first, last = blocks * thread // self.threads, blocks * (thread + 1) // self.threads
        return first, last, thread

    @ti.func
    def shares(self):
        """Number of iterations of a parallel loop over blocks of particles."""
        return self.size[BLOCKS] if ti.static(self.atomic) else self.parts

    @ti.func
    def twin(self, j):
        """Whether the nodes of plane j along y have a second field."""
        return self.size[TWIN] <= j < self.size[TWIN_END]

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
    def add(self, thread, i, j, k, value):
        """Add to a node of a thread's own grid; atomically where all threads share one."""
        if ti.static(self.atomic):
            self.g[thread, i, j, k] += value
        else:
            self.g[thread, i, j, k] = self.g[thread, i, j, k] + value

    @ti.func
    def local(self, q):
        """Lowest node of the 27 that a point reaches, and its offset in cells."""
        u = (q - ti.Vector([self.par[OX], self.par[OY], self.par[OZ]])) * self.par[INV]
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
        return ti.Vector(
            [self.par[OX] + i * self.par[DX], self.par[OY] + j * self.par[DX], self.par[OZ] + k * self.par[DX]]
        )

    @ti.func
    def blade_axes(self, q):
        """A vector of the grid's axes in the scene's: along the blade, across it, up."""
        out = q
        if ti.static(self.turned):
            c, s = self.par[YAW_COS], self.par[YAW_SIN]
            out = ti.Vector([c * q[0] + s * q[1], c * q[1] - s * q[0], q[2]])
        return out

    @ti.func
    def grid_axes(self, q):
        """A vector of the scene's axes in the grid's."""
        out = q
        if ti.static(self.turned):
            c, s = self.par[YAW_COS], self.par[YAW_SIN]
            out = ti.Vector([c * q[0] - s * q[1], s * q[0] + c * q[1], q[2]])
        return out

    @ti.func
    def edge_height(self, s):
        """Height of the edge at a place along the blade [m]."""
        z = ti.cast(self.pose[Z], float)
        c, t = ti.cast(self.pose[TILT_COS], float), ti.cast(self.pose[TILT_SIN], float)
        return z + (s - ti.cast(self.pose[S], float)) * t / c

    @ti.func
    def blade_velocity(self, s, z):
        """Velocity of the blade where it is at a place along the cut and a height [m/s], in the scene's axes."""
        turn = ti.cast(self.pose[TURN], float)
        along = ti.cast(self.pose[VS], float) - turn * (z - ti.cast(self.pose[Z], float))
        up = ti.cast(self.pose[VZ], float) + turn * (s - ti.cast(self.pose[S], float))
        return ti.Vector([along, 0.0, up])

    @ti.func
    def under_blade(self, s):
        """Whether a place along the cut lies within the length of the blade."""
        return ti.abs(s - ti.cast(self.pose[S], float)) < self.par[HALF_LENGTH] * ti.cast(self.pose[TILT_COS], float)

    @ti.func
    def images_x(self, i):
        """How many mirror images across x = 0 a node stands for: 0 for ghosts, 1 on the plane, else 2."""
        out = 1.0
        if ti.static(self.mx):
            image = self.size[PAIR] - i
            out = 0.0 if i < image else (1.0 if i == image else 2.0)
        return out

    @ti.func
    def images(self, i, j):
        """How many mirror images a node stands for."""
        out = self.images_x(i)
        if ti.static(self.my):
            plane = self.size[PLANE]
            out *= 0.0 if j > plane else (1.0 if j == plane else 2.0)
        return out

    @ti.func
    def tool(self, row, impulse):
        """Book an impulse of the food on a tool, in the scene's axes; mirror images cancel across their plane."""
        if ti.static(not self.mx):
            self.sums[row] += impulse[0]
        if ti.static(not self.my):
            self.sums[row + 1] += impulse[1]
        self.sums[row + 2] += impulse[2]

    @ti.func
    def knife(self, row, impulse, s, z):
        """Book an impulse of the food on the knife at a place along the cut and a height, and its moment about the middle of the edge,
        which raises the end at +x."""
        self.tool(row, impulse)
        if ti.static(not self.mx):
            wide, high = s - ti.cast(self.pose[S], float), z - ti.cast(self.pose[Z], float)
            self.sums[MOMENT] += wide * impulse[2] - high * impulse[0]
