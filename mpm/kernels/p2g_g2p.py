"""Transfers between particles and grid."""

import taichi as ti

from mpm.kernels.constitutive import unit
from mpm.kernels.crack import PUSHED, WHOLE
from mpm.kernels.fields import (
    COUNT,
    DX,
    INV,
    MASS,
    SECOND,
    VOL,
)
from mpm.kernels.surface_contact import Touch


class Transfer(Touch):
    """Particles to the grid, and the grid to particles."""

    @ti.func
    def sever(self, cut, p, q):
        """Material that the edge has passed belongs to the left (1) or right (2) half for good.

        At the board that is all of it, also what is pressed a little into the board.
        """
        if ti.static(self.cuts):
            tip = self.edge_height(cut, q[0])
            if self.side[cut, p] == 0 and (q[2] > tip or tip <= 0) and self.under_blade(cut, q[0]):
                self.side[cut, p] = 1 + self.half(cut, p, q[1])

    @ti.func
    def columns(self, cut, i, code):
        """Where the fields of the nodes of a particle are stored along y from the lowest on, (j, k): its own side's or the other one's."""
        at, second = ti.Matrix.zero(ti.i32, 3, 3), self.size[cut, SECOND]
        for j, k in ti.static(ti.ndrange(3, 3)):
            at[j, k] = j
            if ti.static(self.cuts):
                at[j, k] += 0 if k < self.layer(code, i, j) else second
        return at

    @ti.func
    def scatter_block(self, cut, block, thread, dt, window):
        """Particles of a block to grid; returns (plastic, damage, viscous loss over ``VOL``, inverted, outside)."""
        total = ti.Vector.zero(float, 5)
        if ti.static(self.branches == 0):
            self.elastic(cut, block, dt)
        for lane in range(self.lanes):
            p = block * self.lanes + lane
            if p < self.size[cut, COUNT]:
                total += self.scatter(cut, p, block, lane, thread, dt, window)
        return total

    @ti.func
    def scatter(self, cut, p, block, lane, thread, dt, window):
        """One particle to grid; returns as :meth:`scatter_block`."""
        q = self.blade_axes(cut, self.x[cut, p])
        self.sever(cut, p, q)
        bulk, loss, tau = self.bulk[cut, p], ti.Vector.zero(float, 4), 0.0 * unit()
        one_by_one = True
        if ti.static(self.branches == 0):
            one_by_one = self.tau[cut, block, 8][lane] < 0
        if one_by_one:
            loss, tau = self.stress(cut, p, block, lane, dt)
            for r in ti.static(range(6)):
                self.tau[cut, block, r][lane] = tau[r]
        else:
            for r in ti.static(range(6)):
                tau[r] = self.tau[cut, block, r][lane]
            loss[2], loss[0] = self.tau[cut, block, 6][lane], self.tau[cut, block, 7][lane]
        base, fx = self.local(cut, self.x[cut, p])
        outside = 1.0 - self.inside(base, window)
        if outside == 0.0:
            w = self.weights(fx)
            m = self.par[cut, MASS] * bulk
            pull = -dt * self.par[cut, VOL] * bulk * 4 * self.par[cut, INV]
            carry = m * self.par[cut, DX] * ti.Vector([1.0, 1.0, 1.0, 0.0])
            ax = pull * ti.Vector([tau[0], tau[5], tau[4], 0.0]) + carry * self.C[cut, p, 0]
            ay = pull * ti.Vector([tau[5], tau[1], tau[3], 0.0]) + carry * self.C[cut, p, 1]
            az = pull * ti.Vector([tau[4], tau[3], tau[2], 0.0]) + carry * self.C[cut, p, 2]
            if ti.static(not self.nodal):
                if self.layers[cut, p] & PUSHED:
                    az += carry * self.lever[cut, p, 0]
                    if ti.static(self.turned):
                        across = self.grid_axes(cut, ti.Vector([0.0, 1.0, 0.0]))
                        ax += across[0] * carry * self.lever[cut, p, 1]
                        ay += across[1] * carry * self.lever[cut, p, 1]
                    else:
                        ay += carry * self.lever[cut, p, 1]
            v = self.v[cut, p]
            corner = m * ti.Vector([v[0], v[1], v[2], 1.0]) - fx[0] * ax - fx[1] * ay - fx[2] * az
            code = self.split(cut, p, base, q, self.half(cut, p, q[1]))
            self.layers[cut, p] = code
            lowest = self.own(cut, thread, base[0], base[1], base[2])
            if ti.static(self.atomic):
                self.add_split(cut, lowest, code, w, corner, ax, ay, az)
            elif code == WHOLE:
                self.add_whole(lowest, w, corner, ax, ay, az)
            else:
                self.add_split(cut, lowest, code, w, corner, ax, ay, az)
        return ti.Vector([bulk * loss[0], bulk * loss[1], bulk * loss[2], loss[3], outside])

    @ti.func
    def add_whole(self, lowest, w, corner, ax, ay, az):
        """Add a particle that sees no cut to its 27 nodes: of three above each other all are read before the first is written, so that
        none waits for another."""
        for i, j in ti.static(ti.ndrange(3, 3)):
            wij, at = w[i][0] * w[j][1], lowest + (i * self.stride_x + j * self.stride_y)
            low, rise = wij * (corner + i * ax + j * ay), wij * az
            a, b, c = w[0][2] * low + self.g[at], w[1][2] * (low + rise), w[2][2] * (low + 2 * rise)
            b += self.g[at + 1]
            c += self.g[at + 2]
            self.g[at], self.g[at + 1], self.g[at + 2] = a, b, c

    @ti.func
    def add_split(self, cut, lowest, code, w, corner, ax, ay, az):
        """The same at the cut, where some nodes have the field of the other side.

        Node by node: in the order of :meth:`add_whole` LLVM makes one path of the two, with an address for each node.
        """
        at = self.columns(cut, 0, code)
        for i in ti.static(range(3)):
            if ti.static(self.turned):
                at = self.columns(cut, i, code)
            for j in ti.static(range(3)):
                wij = w[i][0] * w[j][1]
                low, rise = wij * (corner + i * ax + j * ay), wij * az
                for k in ti.static(range(3)):
                    node = lowest + (i * self.stride_x + k) + at[j, k] * self.stride_y
                    self.add(node, w[k][2] * (low + k * rise))

    @ti.func
    def gather(self, cut, p, thread, dt, window):
        """Grid to particle, then contact."""
        base, fx = self.local(cut, self.x[cut, p])
        if (
            self.inside(base, window) > 0
        ):  # one that has left the grid stays where it is; the run ends at the next output
            self.move(cut, p, thread, base, fx, dt)

    @ti.func
    def plane(self, at, w):
        """Velocity of the nine nodes of a particle in one plane across x times their weights, and its moments about the
        lowest node along y and z in cells.

        Args:
            at: Their indices (j, k).
            w: Weights of the nodes.
        """
        whole, py, pz = ti.Vector.zero(float, 4), ti.Vector.zero(float, 4), ti.Vector.zero(float, 4)
        for j in ti.static(range(3)):
            b, c = w[1][2] * self.u[at[j, 1]], w[2][2] * self.u[at[j, 2]]
            row = w[j][1] * (w[0][2] * self.u[at[j, 0]] + b + c)
            whole += row
            py += j * row
            pz += w[j][1] * (b + 2 * c)
        return whole, py, pz

    @ti.func
    def whole_plane(self, lowest):
        """Indices of the nine nodes above the lowest one in a plane across x; masked as in :meth:`shared`."""
        at = ti.Matrix.zero(ti.i32, 3, 3)
        for j, k in ti.static(ti.ndrange(3, 3)):
            at[j, k] = (lowest & self.all_bits) + (j * self.stride_y + k)
        return at

    @ti.func
    def split_plane(self, cut, lowest, i, code):
        """The same where some have the field of the other side."""
        at = self.columns(cut, i, code)
        for j, k in ti.static(ti.ndrange(3, 3)):
            at[j, k] = lowest + at[j, k] * self.stride_y + k
        return at

    @ti.func
    def keep_plane(self, cut, thread, i, plane):
        """Keep what :meth:`plane` gave for plane ``i``."""
        for r in ti.static(range(3)):
            self.planes[cut, thread, 3 * r + i] = plane[r]

    @ti.func
    def move(self, cut, p, thread, base, fx, dt):
        """Velocity, gradient and position of a particle from the 27 nodes above ``base``.

        Contact corrects the velocity that the next transfer hands on, not the position: moving the particle as well
        would let the surface slip through the material without straining it.
        """
        w = self.weights(fx)
        code, lowest = self.layers[cut, p], self.shared(cut, base[0], base[1], base[2])
        zero = ti.Vector.zero(float, 4)
        u4, cx, cy, cz = zero, zero, zero, zero
        if ti.static(self.atomic):
            for i in ti.static(range(3)):
                whole, py, pz = self.plane(self.split_plane(cut, lowest + i * self.stride_x, i, code), w)
                u4, cx = u4 + w[i][0] * whole, cx + i * w[i][0] * whole
                cy, cz = cy + w[i][0] * py, cz + w[i][0] * pz
        else:
            # Where the loops are unrolled LLVM does not find the vectors of four, and the whole step takes 8 % longer. So their end
            # is one that LLVM cannot know, and what they find goes through memory.
            end = ti.min(self.size[cut, COUNT], 3)
            if code == WHOLE:
                for i in range(end):
                    self.keep_plane(cut, thread, i, self.plane(self.whole_plane(lowest + i * self.stride_x), w))
            else:
                for i in range(end):
                    at = self.split_plane(cut, lowest + i * self.stride_x, i, code)
                    self.keep_plane(cut, thread, i, self.plane(at, w))
            for i in ti.static(range(3)):
                whole = w[i][0] * self.planes[cut, thread, i]
                u4, cx = u4 + whole, cx + i * whole
                cy += w[i][0] * self.planes[cut, thread, 3 + i]
                cz += w[i][0] * self.planes[cut, thread, 6 + i]
        u = ti.Vector([u4[0], u4[1], u4[2]])
        slope = 4 * self.par[cut, INV]
        cx, cy, cz = slope * (cx - fx[0] * u4), slope * (cy - fx[1] * u4), slope * (cz - fx[2] * u4)
        self.C[cut, p, 0], self.C[cut, p, 1], self.C[cut, p, 2] = cx, cy, cz
        at = self.x[cut, p] + dt * u
        if ti.static(not self.nodal):
            if self.may_touch(cut, p, at):
                u = self.touch(cut, p, dt, u, at)
                self.layers[cut, p] = code | PUSHED
        self.v[cut, p] = u
        self.x[cut, p] = at
