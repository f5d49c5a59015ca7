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
# Rows of the table of orders: how many steps, after how many each a row of the report, time step, velocity upwards and along the blade
# and rate of its turn that are commanded.
STEPS, EVERY, STEP, UP, ALONG, ROLL = range(6)
N_ORDER = 6
# What a loop goes over: each cut, rows of nodes in reach, lines of nodes across the mirror, parts of the particles, slices along the edge,
# rows of nodes about what could be damaged.
EACH, ROW, LINE, PART, SLICE, HOT = range(6)
N_LOOPS = 6
N_REPORT = N_SUMS + N_STATE + N_POSE

MIRROR = 2  # index of the first node plane that is no mirror image across x
FAR = 1 << 20  # a node that no grid has
BESIDE = 3  # cells on either side of the cut plane whose nodes may carry both halves
AT_REST = 3.0  # trace of the stretch of food that is not strained
REGISTER = 32  # bytes of a register of a CPU: as many particles as fill it have their elastic stress found at once
CPU_BLOCK = 512  # Taichi runs CPU loops shorter than this on one thread, so one iteration in 512 works for a thread


class Fields:
    """Particles, grid, edge and tables, with room for a class of scenes; :meth:`Exchange.begin <mpm.kernels.host_transfer.Exchange.begin>` fits them to
    some.

    They hold one cut or a batch of them side by side, each with scene, material, time step and blade of its own; the first index of every
    field says which. On a GPU one launch does a loop of all cuts, on CPUs a thread does all loops of a cut (:meth:`whose`).

    Deformation gradients are stored entry by entry for ``lanes`` particles, [block, 3 row + column, lane], so that the
    same operation on all of them is one instruction; velocity gradients column by column, each filled up to four.

    The grid stores two velocity fields: the first at ``[i, j, k]``, the second, which only nodes beside the cut plane
    have, at ``[i, second + j, k]`` of each cut.

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
        batch: Most cuts side by side; more than one on a GPU or with one thread a cut.
    """

    def __init__(
        self, room, nodes, mirrors, stations, threads, nodal, press, damage, turned=False, branches=0, batch=1
    ):
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
        self.batch, self.room, self.slices = batch, blocks * self.lanes, stations
        room, worn, aged = self.room, self.room if damage else 1, self.room if branches else 1
        # What is double on every device is laid out by itself: beside fields of four bytes Taichi's Vulkan puts it where it may
        # not begin at a multiple of eight, and then writes the end of its neighbour.
        self.pose, self.order = ti.field(ti.f64, (batch, N_POSE)), ti.field(ti.f64, (batch, N_ORDER))
        ti.sync()
        self.sums, self.state = ti.field(booked, (batch, N_SUMS)), ti.field(booked, (batch, N_STATE))
        self.x, self.v = (vec3.field(shape=(batch, room)) for _ in range(2))
        self.C, self.F = vec4.field(shape=(batch, room, 3)), ti.Vector.field(self.lanes, real, (batch, blocks, 9))
        # Kirchhoff stress (6), viscous and plastic loss, and the trace of the left stretch, negative where the particle must be
        # done by itself
        self.tau = ti.Vector.field(self.lanes, real, (batch, blocks, 9))
        self.side, self.gap = ti.field(ti.i32, (batch, room)), ti.field(real, (batch, room))
        self.foot = ti.field(real, (batch, room))
        self.bulk = ti.field(real, (batch, room))  # volume over that of a particle beside the cut
        # reference volume between a particle of the first layer and the board, and the tool; 0 behind the first layer
        self.shell = ti.Vector.field(2, real, (batch, room))
        # moment of the contact's last impulse as a gradient of the velocity: upwards, and across the blade; the fourth
        # entry upwards is the kinetic energy per mass that this impulse gave
        self.lever = vec4.field(shape=(batch, room, 2))
        self.kappa, self.strain = (ti.field(real, (batch, worn)) for _ in range(2))
        self.stick = vec3.field(shape=(batch, 2, room))  # board, blade
        # layers: Split.split of the last step, with split.PUSHED where `lever` is of this step; elsewhere it means nothing
        self.tacky, self.layers = (ti.field(ti.i32, (batch, room)) for _ in range(2))
        self.memory = mat3.field(shape=(batch, max(branches, 1), aged))
        self.before = mat3.field(shape=(batch, aged))
        self.share_of, self.relax = (ti.field(real, (batch, max(branches, 1))) for _ in range(2))
        self.stride_y, self.stride_x = nodes[2], deep * nodes[2]  # from a node to the next along y and along x
        self.grid = nodes[0] * self.stride_x
        self.all_bits = (1 << (batch * self.threads * self.grid).bit_length()) - 1
        self.g, self.u = vec4.field(shape=batch * self.threads * self.grid), vec4.field(shape=batch * self.grid)
        self.planes = vec4.field(shape=(batch, self.threads, 16))  # of the nodes of the particle that a thread moves
        self.hot = ti.field(
            ti.i32, (batch, 6)
        )  # box of the lowest nodes of particles whose strain could damage something
        self.slip, self.push = (ti.Vector.field(2, real, (batch, stations)) for _ in range(2))
        self.velocity = vec3.field(shape=(batch, stations))  # mean velocity of the material at the edge
        self.front, self.drift, self.parted = (ti.field(real, (batch, stations)) for _ in range(3))
        self.soften, self.start, self.touched = (ti.field(real, (batch, stations)) for _ in range(3))
        self.near = ti.field(ti.i32, (batch, stations))
        self.top, self.low, self.width = (ti.field(real, (batch, stations)) for _ in range(3))
        self.floor_top, self.floor_low = (ti.field(real, (batch, stations)) for _ in range(2))
        self.par = ti.field(real, (batch, N_PARAMETERS))
        self.size = ti.field(ti.i32, (batch, N_SIZES))
        self.window = ti.field(
            ti.i32, (batch, 6)
        )  # nodes that particles can reach before it is renewed: first, last + 1
        self.left = ti.field(
            ti.i32, batch
        )  # steps that a cut has yet to do before the next row of the report, on a GPU
        self.most = ti.field(ti.i32, N_LOOPS)  # most places that a loop goes over in any cut
        ti.sync()  # lays these fields out by themselves; Taichi does not manage those of eight scenes at once

    @ti.func
    def deformation_of(self, cut, p):
        """Deformation gradient of one particle."""
        b, lane = p // self.lanes, p % self.lanes
        f = ti.Matrix.zero(float, 3, 3)
        for r, c in ti.static(ti.ndrange(3, 3)):
            f[r, c] = self.F[cut, b, 3 * r + c][lane]
        return f

    @ti.func
    def gradient_of(self, cut, p):
        """Velocity gradient of one particle [1/s]."""
        x, y, z = self.C[cut, p, 0], self.C[cut, p, 1], self.C[cut, p, 2]
        return ti.Matrix([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])

    @ti.func
    def time_step(self, cut):
        """Time step of a cut [s]."""
        return ti.cast(self.order[cut, STEP], float)

    @ti.func
    def twin(self, cut, j):
        """Whether the nodes of plane j along y have a second field."""
        return self.size[cut, TWIN] <= j < self.size[cut, TWIN_END]

    @ti.func
    def shared(self, grid, i, j, k):
        """Index of a node in the velocities ``u`` of a cut.

        No index has the bits that are masked. But LLVM then knows that this one and a constant make no negative number,
        and reaches the 27 nodes of a particle by one register and 27 constants, for which it needs three instructions each
        otherwise.
        """
        return (grid * self.grid + i * self.stride_x + j * self.stride_y + k) & self.all_bits

    @ti.func
    def own(self, cut, thread, i, j, k):
        """Index of a node in the momenta and masses ``g`` of a thread's own grid."""
        return self.shared(cut * self.threads + thread, i, j, k)

    @ti.func
    def add(self, at, value):
        """Add to a node of a thread's own grid, given by its :meth:`own`; atomically where all threads share one."""
        if ti.static(self.atomic):
            self.g[at] += value
        else:
            self.g[at] = self.g[at] + value

    @ti.func
    def local(self, cut, q):
        """Lowest node of the 27 that a point reaches, and its offset in cells."""
        u = (q - ti.Vector([self.par[cut, OX], self.par[cut, OY], self.par[cut, OZ]])) * self.par[cut, INV]
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
    def node(self, cut, i, j, k):
        """Position of a node [m]."""
        return ti.Vector(
            [
                self.par[cut, OX] + i * self.par[cut, DX],
                self.par[cut, OY] + j * self.par[cut, DX],
                self.par[cut, OZ] + k * self.par[cut, DX],
            ]
        )

    @ti.func
    def blade_axes(self, cut, q):
        """A vector of the grid's axes in the scene's: along the blade, across it, up."""
        out = q
        if ti.static(self.turned):
            c, s = self.par[cut, YAW_COS], self.par[cut, YAW_SIN]
            out = ti.Vector([c * q[0] + s * q[1], c * q[1] - s * q[0], q[2]])
        return out

    @ti.func
    def grid_axes(self, cut, q):
        """A vector of the scene's axes in the grid's."""
        out = q
        if ti.static(self.turned):
            c, s = self.par[cut, YAW_COS], self.par[cut, YAW_SIN]
            out = ti.Vector([c * q[0] - s * q[1], s * q[0] + c * q[1], q[2]])
        return out

    @ti.func
    def edge_height(self, cut, s):
        """Height of the edge at a place along the blade [m]."""
        z = ti.cast(self.pose[cut, Z], float)
        c, t = ti.cast(self.pose[cut, TILT_COS], float), ti.cast(self.pose[cut, TILT_SIN], float)
        return z + (s - ti.cast(self.pose[cut, S], float)) * t / c

    @ti.func
    def blade_velocity(self, cut, s, z):
        """Velocity of the blade where it is at a place along the cut and a height [m/s], in the scene's axes."""
        turn = ti.cast(self.pose[cut, TURN], float)
        along = ti.cast(self.pose[cut, VS], float) - turn * (z - ti.cast(self.pose[cut, Z], float))
        up = ti.cast(self.pose[cut, VZ], float) + turn * (s - ti.cast(self.pose[cut, S], float))
        return ti.Vector([along, 0.0, up])

    @ti.func
    def under_blade(self, cut, s):
        """Whether a place along the cut lies within the length of the blade."""
        return ti.abs(s - ti.cast(self.pose[cut, S], float)) < self.par[cut, HALF_LENGTH] * ti.cast(
            self.pose[cut, TILT_COS], float
        )

    @ti.func
    def images_x(self, cut, i):
        """How many mirror images across x = 0 a node stands for: 0 for ghosts, 1 on the plane, else 2."""
        out = 1.0
        if ti.static(self.mx):
            image = self.size[cut, PAIR] - i
            out = 0.0 if i < image else (1.0 if i == image else 2.0)
        return out

    @ti.func
    def images(self, cut, i, j):
        """How many mirror images a node stands for."""
        out = self.images_x(cut, i)
        if ti.static(self.my):
            plane = self.size[cut, PLANE]
            out *= 0.0 if j > plane else (1.0 if j == plane else 2.0)
        return out

    @ti.func
    def tool(self, cut, row, impulse):
        """Book an impulse of the food on a tool, in the scene's axes; mirror images cancel across their plane."""
        if ti.static(not self.mx):
            self.sums[cut, row] += impulse[0]
        if ti.static(not self.my):
            self.sums[cut, row + 1] += impulse[1]
        self.sums[cut, row + 2] += impulse[2]

    @ti.func
    def knife(self, cut, row, impulse, s, z):
        """Book an impulse of the food on the knife at a place along the cut and a height, and its moment about the middle of the edge,
        which raises the end at +x."""
        self.tool(cut, row, impulse)
        if ti.static(not self.mx):
            wide, high = s - ti.cast(self.pose[cut, S], float), z - ti.cast(self.pose[cut, Z], float)
            self.sums[cut, MOMENT] += wide * impulse[2] - high * impulse[0]
