"""Transfers between particles and grid."""

import taichi as ti

from mpm.constitutive import unit
from mpm.fields import (
    COUNT,
    DX,
    INV,
    MASS,
    SECOND,
    VOL,
)
from mpm.touch import Touch


@ti.data_oriented
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
    def columns(self, cut, base, i, code):
        """Where the fields of the nodes of a particle are stored along y, (j, k): its own side's or the other one's."""
        at, second = ti.Matrix.zero(ti.i32, 3, 3), self.size[cut, SECOND]
        for j, k in ti.static(ti.ndrange(3, 3)):
            at[j, k] = base[1] + j
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
            one_by_one = self.tau[cut, block, 8][lane] > 0
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
            at = self.columns(cut, base, 0, code)
            for i in ti.static(range(3)):
                if ti.static(self.turned):
                    at = self.columns(cut, base, i, code)
                for j in ti.static(range(3)):
                    wij = w[i][0] * w[j][1]
                    low = wij * (corner + i * ax + j * ay)
                    rise = wij * az
                    for k in ti.static(range(3)):
                        self.add(cut, thread, base[0] + i, at[j, k], base[2] + k, w[k][2] * (low + k * rise))
        return ti.Vector([bulk * loss[0], bulk * loss[1], bulk * loss[2], loss[3], outside])

    @ti.func
    def gather(self, cut, p, thread, dt, window):
        """Grid to particle, then contact."""
        base, fx = self.local(cut, self.x[cut, p])
        if (
            self.inside(base, window) > 0
        ):  # one that has left the grid stays where it is; the run ends at the next output
            self.move(cut, p, thread, base, fx, dt)

    @ti.func
    def plane(self, cut, i, base, cols, w, d):
        """Velocity of plane ``i`` of a particle's nodes times their weights across it, and its slopes along y and z."""
        whole, py, pz = ti.Vector.zero(float, 4), ti.Vector.zero(float, 4), ti.Vector.zero(float, 4)
        for j in ti.static(range(3)):
            a = self.u[cut, base[0] + i, cols[j, 0], base[2]]
            b = self.u[cut, base[0] + i, cols[j, 1], base[2] + 1]
            c = self.u[cut, base[0] + i, cols[j, 2], base[2] + 2]
            row = w[0][2] * a + w[1][2] * b + w[2][2] * c
            whole += w[j][1] * row
            py += d[j][1] * row
            pz += w[j][1] * (d[0][2] * a + d[1][2] * b + d[2][2] * c)
        return whole, py, pz

    @ti.func
    def move(self, cut, p, thread, base, fx, dt):
        """Velocity, gradient and position of a particle from the 27 nodes above ``base``.

        Contact corrects the velocity that the next transfer hands on, not the position: moving the particle as well
        would let the surface slip through the material without straining it.
        """
        w = self.weights(fx)
        d = [4 * self.par[cut, INV] * (i - fx) * w[i] for i in ti.static(range(3))]  # weights of the velocity gradient
        code = self.layers[cut, p]
        cols = self.columns(cut, base, 0, code)
        zero = ti.Vector.zero(float, 4)
        u4, cx, cy, cz = zero, zero, zero, zero
        if ti.static(self.atomic):
            for i in ti.static(range(3)):
                if ti.static(self.turned):
                    cols = self.columns(cut, base, i, code)
                whole, py, pz = self.plane(cut, i, base, cols, w, d)
                u4, cx = u4 + w[i][0] * whole, cx + d[i][0] * whole
                cy, cz = cy + w[i][0] * py, cz + w[i][0] * pz
        else:
            # Where the loop is unrolled LLVM does not find the vectors of four, and the whole step takes 8 % longer. So its end
            # is one that LLVM cannot know, and what it finds goes through memory.
            for i in range(ti.min(self.size[cut, COUNT], 3)):
                if ti.static(self.turned):
                    cols = self.columns(cut, base, i, code)
                whole, py, pz = self.plane(cut, i, base, cols, w, d)
                self.planes[cut, thread, i], self.planes[cut, thread, 3 + i], self.planes[cut, thread, 6 + i] = (
                    whole,
                    py,
                    pz,
                )
            for i in ti.static(range(3)):
                whole = self.planes[cut, thread, i]
                u4, cx = u4 + w[i][0] * whole, cx + d[i][0] * whole
                cy += w[i][0] * self.planes[cut, thread, 3 + i]
                cz += w[i][0] * self.planes[cut, thread, 6 + i]
        u = ti.Vector([u4[0], u4[1], u4[2]])
        self.C[cut, p, 0], self.C[cut, p, 1], self.C[cut, p, 2] = cx, cy, cz
        at = self.x[cut, p] + dt * u
        if ti.static(not self.nodal):
            if self.may_touch(cut, p, at):
                u = self.touch(cut, p, dt, u, at)
            else:
                self.lever[cut, p, 0], self.lever[cut, p, 1] = zero, zero
        self.v[cut, p] = u
        self.x[cut, p] = at
