"""What the host writes into the fields before a run, and what it reads from them.

Each by one kernel for all fields: to make a cached kernel ready takes some 25 ms however small it is, and one for each
field would be a third of what a process needs before its first step.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import taichi as ti

from mpm.kernels.fields import (
    AT_REST,
    BESIDE,
    BLOCKS,
    COUNT,
    EACH,
    N_LOOPS,
    N_PARAMETERS,
    N_POSE,
    N_SIZES,
    PART,
    SLICE,
    STATIONS,
    Fields,
)
from mpm.output.snapshot import Particles

# Columns of the tables of particles and of slices that a run begins with.
PLACE, FOOT, GAP, BULK, SHELL, TACKY = 0, 3, 4, 5, 6, 8
N_PARTICLE = 9
TOP, LOW, WIDTH, FLOOR_TOP, FLOOR_LOW, SOFTEN = range(6)
N_SLICE = 6
# Columns of the table of particles that is read after some steps: also deformation gradient and Kirchhoff stress.
HALF, DEFORMATION, STRESS, STRAIN = 3, 4, 13, 19
N_SEEN = 20

WHOLE_NUMBERS = ti.types.ndarray(dtype=ti.i32, ndim=2)
ROWS = ti.types.ndarray(dtype=ti.f64, ndim=2)
TABLES = ti.types.ndarray(dtype=ti.f64, ndim=3)


class Contents(NamedTuple):
    """What the fields of one cut begin with.

    Attributes:
        nodes: Grid nodes along x, y, z.
        plane: Index of the node plane along y that is nearest to y = 0: the mirror plane across y where there is one.
        between: Whether the mirror plane across x lies half-way between the first nodes and their images and not on the first nodes.
        particles: Table (n, N_PARTICLE): place in the grid's axes, height of the foot and half gap [m], volume over that of a particle
            beside the cut [-], areas before the board and before the tool [m^2], 0 for a surface that can stick and -1 for others.
        slices: Table (m, N_SLICE): outline of the food in each slice, and the slip over which the edge's resistance falls [m].
        parameters: As :mod:`mpm.kernels.fields` orders them.
        pose: Of the tool, as :mod:`mpm.kernels.fields` orders it.
        relaxation: Share of each Prony branch, and time step over its time, shape (2, branches).
    """

    nodes: Sequence[int]
    plane: int
    between: bool
    particles: np.ndarray
    slices: np.ndarray
    parameters: np.ndarray
    pose: np.ndarray
    relaxation: np.ndarray


class Exchange(Fields):
    """Between host and fields."""

    def begin(self, cuts: Sequence[Contents]) -> None:
        """Put cuts side by side, their particles at rest and unstrained, nothing cut and nothing booked."""
        sizes = np.zeros((self.batch, N_SIZES), np.int32)
        for row, cut in zip(sizes, cuts, strict=False):
            n, nodes = len(cut.particles), cut.nodes
            first = 0 if self.turned else max(cut.plane - BESIDE, 0)
            end = nodes[1] if self.turned else min(cut.plane + BESIDE + 1, nodes[1])
            row[:] = [
                n,
                -(-n // self.lanes),
                *nodes,
                len(cut.slices),
                cut.plane,
                first,
                end,
                nodes[1] - first,
                2 * self.i0 - cut.between,
            ]
        self.n = sizes[:, COUNT]
        most = np.zeros((1, N_LOOPS), np.int32)
        most[0, [EACH, PART, SLICE]] = 1, sizes[:, BLOCKS].max(), sizes[:, STATIONS].max()
        self._begin(
            sizes,
            most,
            self._table((self.n.max(), N_PARTICLE), [cut.particles for cut in cuts]),
            self._table((sizes[:, STATIONS].max(), N_SLICE), [cut.slices for cut in cuts]),
            self._table((N_PARAMETERS,), [cut.parameters for cut in cuts]),
            self._table((N_POSE,), [cut.pose for cut in cuts]),
            self._table((2, max(self.branches, 1)), [cut.relaxation for cut in cuts]),
        )

    def _table(self, shape, parts):
        """Tables of cuts in one, filled up with zeros."""
        out = np.zeros((self.batch, *shape))
        for one, given in zip(out, parts, strict=False):
            one[tuple(slice(n) for n in given.shape)] = given
        return out

    @ti.kernel
    def _begin(
        self,
        sizes: WHOLE_NUMBERS,
        most: WHOLE_NUMBERS,
        particles: TABLES,
        slices: TABLES,
        parameters: ROWS,
        pose: ROWS,
        relaxation: TABLES,
    ):
        for c, k in self.size:
            self.size[c, k] = sizes[c, k]
        for k in self.most:
            self.most[k] = most[0, k]
        for c, k in self.par:
            self.par[c, k] = ti.cast(parameters[c, k], float)
        for c, k in self.pose:
            self.pose[c, k] = pose[c, k]
        for c, b in self.relax:
            self.share_of[c, b] = ti.cast(relaxation[c, 0, b], float)
            self.relax[c, b] = ti.cast(relaxation[c, 1, b], float)
        for c, p in self.x:
            row = ti.Vector.zero(float, N_PARTICLE)
            if p < sizes[c, COUNT]:
                for k in ti.static(range(N_PARTICLE)):
                    row[k] = ti.cast(particles[c, p, k], float)
            self.x[c, p] = ti.Vector([row[PLACE], row[PLACE + 1], row[PLACE + 2]])
            self.foot[c, p], self.gap[c, p], self.bulk[c, p] = row[FOOT], row[GAP], row[BULK]
            self.shell[c, p] = ti.Vector([row[SHELL], row[SHELL + 1]])
            self.tacky[c, p] = ti.cast(row[TACKY], ti.i32)
            self.v[c, p] = ti.Vector.zero(float, 3)
            self.side[c, p] = 0
            self.layers[c, p] = 0
            for b in ti.static(range(2)):
                self.stick[c, b, p] = ti.Vector.zero(float, 3)
            if ti.static(self.branches > 0):
                self.before[c, p] = ti.Matrix.zero(float, 3, 3)
                for b in ti.static(range(self.branches)):
                    self.memory[c, b, p] = ti.Matrix.zero(float, 3, 3)
        for c, p, d in self.C:
            self.C[c, p, d] = ti.Vector.zero(float, 4)
        for c, b, r in self.F:
            for lane in ti.static(range(self.lanes)):
                self.F[c, b, r][lane] = 1.0 if r % 4 == 0 else 0.0
                self.tau[c, b, r][lane] = AT_REST if r == 8 else 0.0
        for q in self.u:  # the edge also looks at nodes that no particle has reached yet
            self.u[q] = ti.Vector.zero(float, 4)
        for c, p in self.kappa:
            self.kappa[c, p] = 0.0
            self.strain[c, p] = 0.0
        for c, i in self.parted:
            row = ti.Vector.zero(float, N_SLICE)
            if i < sizes[c, STATIONS]:
                for k in ti.static(range(N_SLICE)):
                    row[k] = ti.cast(slices[c, i, k], float)
            self.top[c, i], self.low[c, i], self.width[c, i] = row[TOP], row[LOW], row[WIDTH]
            self.floor_top[c, i], self.floor_low[c, i] = row[FLOOR_TOP], row[FLOOR_LOW]
            self.soften[c, i] = row[SOFTEN]
            self.slip[c, i] = ti.Vector.zero(float, 2)
            self.push[c, i] = ti.Vector.zero(float, 2)
            self.velocity[c, i] = ti.Vector.zero(float, 3)
            self.parted[c, i] = 0.0
            self.drift[c, i] = 0.0
            self.start[c, i] = 0.0
            self.touched[c, i] = 0.0
            self.front[c, i] = 1e3
        for c, k in self.sums:
            self.sums[c, k] = 0.0

    def particles(self, cut: int = 0) -> Particles:
        """The particles of a cut now."""
        out = np.zeros((self.n[cut], N_SEEN))
        self._see(cut, out)
        x, side, f, tau, kappa = np.split(out, (HALF, DEFORMATION, STRESS, STRAIN), axis=1)
        return Particles(x, side[:, 0].astype(int), f.reshape(-1, 3, 3), tau, kappa[:, 0])

    @ti.kernel
    def _see(self, cut: int, out: ROWS):
        for p in range(self.size[cut, COUNT]):
            block, lane = p // self.lanes, p % self.lanes
            for d in ti.static(range(3)):
                out[p, d] = self.x[cut, p][d]
            out[p, HALF] = self.side[cut, p]
            for r in ti.static(range(9)):
                out[p, DEFORMATION + r] = self.F[cut, block, r][lane]
            for r in ti.static(range(6)):
                out[p, STRESS + r] = self.tau[cut, block, r][lane]
            if ti.static(self.damage):
                out[p, STRAIN] = self.kappa[cut, p]

    def of_particles(self, field, cut=0):
        """A field's entries of the particles of a cut as NumPy (n, ...)."""
        return field.to_numpy()[cut, : self.n[cut]]

    def fill(self, field, values):
        """Set the entries of a field of the particles of the first cut."""
        out = field.to_numpy()
        out[0, : self.n[0]] = values
        field.from_numpy(out)

    def gradient(self, cut=0):
        """Velocity gradients of a cut (n, 3, 3) [1/s] as NumPy."""
        return self.C.to_numpy()[cut, : self.n[cut], :, :3].transpose(0, 2, 1)

    def set_gradient(self, values):
        """Set the velocity gradients of the first cut from (n, 3, 3) [1/s]."""
        c = self.C.to_numpy()
        c[0, : self.n[0], :, :3] = np.transpose(values, (0, 2, 1))
        self.C.from_numpy(c)

    def set_pose(self, values):
        """Set the tool's pose of the first cut, shape (N_POSE,)."""
        out = self.pose.to_numpy()
        out[0] = values
        self.pose.from_numpy(out)
