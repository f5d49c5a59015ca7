"""The time step as Taichi kernels. One Kernels object serves a class of scenes; sizes, material and tool are run-time data."""

import numpy as np
import taichi as ti

from mpm.kernels.fields import (
    ALONG,
    ARM_C,
    ARM_K,
    ARM_LIMIT,
    ARM_MASS,
    BOOKED,
    COMMAND,
    COUNT,
    CPU_BLOCK,
    EACH,
    EDGE,
    EVERY,
    FACE,
    FAR,
    LINE,
    N_ORDER,
    N_REPORT,
    PART,
    PLASTIC,
    ROLL,
    ROW,
    SECOND,
    SLICE,
    STATIONS,
    STEPS,
    TILT,
    TILT_COS,
    TILT_SIN,
    TURN,
    UP,
    VS,
    VZ,
    S,
    Z,
)
from mpm.kernels.host_transfer import ROWS, TABLES
from mpm.kernels.p2g_g2p import Transfer


@ti.data_oriented
class Kernels(Transfer):
    """The loops of a time step, and kernels of many steps."""

    @ti.func
    def drive(self, cut):
        """Velocity of the tool in this step: as commanded, or that of the arm behind its spring."""
        dt, vz = self.time_step(cut), ti.cast(self.order[cut, UP], float)
        self.pose[cut, VS], self.pose[cut, TURN] = self.order[cut, ALONG], self.order[cut, ROLL]
        self.pose[cut, COMMAND] += vz * dt
        if self.par[cut, ARM_MASS] > 0:
            booked = self.sums[cut, EDGE + 2] + self.sums[cut, FACE + 2]
            limit = ti.cast(self.par[cut, ARM_LIMIT], ti.f64)
            spring = self.par[cut, ARM_K] * (self.pose[cut, COMMAND] - self.pose[cut, Z])
            pull = ti.math.clamp(spring + self.par[cut, ARM_C] * (vz - self.pose[cut, VZ]), -limit, limit)
            if ti.abs(spring) > 2 * limit:  # stalled: it pulls as hard as it can and only stops rattling
                pull = ti.math.clamp(spring, -limit, limit) - self.par[cut, ARM_C] * self.pose[cut, VZ]
            self.pose[cut, VZ] += (pull * dt + booked - self.pose[cut, BOOKED]) / self.par[cut, ARM_MASS]
            self.pose[cut, BOOKED] = booked
            self.pose[cut, VZ] = ti.max(self.pose[cut, VZ], -self.pose[cut, Z] / dt)  # the board stops the edge
        else:
            self.pose[cut, VZ] = vz
        if ti.static(self.damage):
            for d in ti.static(range(3)):
                self.hot[cut, d], self.hot[cut, d + 3] = FAR, -FAR

    @ti.func
    def proceed(self, cut):
        """Move the tool."""
        dt = self.time_step(cut)
        self.pose[cut, Z] += self.pose[cut, VZ] * dt
        self.pose[cut, S] += self.pose[cut, VS] * dt
        if self.order[cut, ROLL] != 0:
            self.pose[cut, TILT] += self.pose[cut, TURN] * dt
            tilt = ti.cast(self.pose[cut, TILT], float)
            self.pose[cut, TILT_COS], self.pose[cut, TILT_SIN] = ti.cos(tilt), ti.sin(tilt)

    @ti.func
    def clear_row(self, cut, r):
        """Empty the grids of all threads at a row of nodes."""
        i, j, low, high = self.row(cut, r, ROW)
        for k in range(low, high):
            for s in ti.static(range(self.threads)):
                self.g[self.own(cut, s, i, j, k)] = ti.Vector.zero(float, 4)
        if ti.static(self.twins):
            if self.twin(cut, j):
                for k in range(low, high):
                    for s in ti.static(range(self.threads)):
                        self.g[self.own(cut, s, i, self.size[cut, SECOND] + j, k)] = ti.Vector.zero(float, 4)

    @ti.func
    def add_row(self, cut, r):
        """Sum the private grids of all threads at a row of nodes."""
        i, j, low, high = self.row(cut, r, ROW)
        for k in range(low, high):
            self.add_threads(cut, i, j, k)
        if ti.static(self.twins):
            if self.twin(cut, j):
                for k in range(low, high):
                    self.add_threads(cut, i, self.size[cut, SECOND] + j, k)

    @ti.func
    def look_beside(self, cut, i):
        """Count the neighbours of a slice in which the cut has started."""
        self.near[cut, i] = 0
        for d in ti.static((-1, 1)):
            if 0 <= i + d < self.size[cut, STATIONS]:
                self.near[cut, i] += ti.cast(self.start[cut, i + d] > 0, ti.i32)

    @ti.func
    def advance(self, cut):
        """One time step of a cut, on a GPU of all cuts that have steps left.

        On a CPU the short loops do not go to the threads: to wake them takes 0.1 ms, a tenth of a step of 8,000 particles.
        """
        ti.loop_config(serialize=self.alone)
        for q in range(self.loop(cut, EACH)):
            c, _, _ = self.whose(cut, q, EACH)
            if ti.static(self.atomic):
                self.left[c] -= 1
            if self.on(c):
                self.drive(c)
        if ti.static(self.cuts):
            ti.loop_config(serialize=self.alone)
            for q in range(self.loop(cut, SLICE)):
                c, i, mine = self.turn_of(cut, q, SLICE)
                if mine:
                    self.lead(c, i)
        for q in range(self.loop(cut, ROW)):
            c, r, mine = self.turn_of(cut, q, ROW)
            if mine:
                self.clear_row(c, r)
        for q in range(self.loop(cut, PART)):
            c, part, mine = self.turn_of(cut, q, PART)
            first, last, thread = self.share(c, part)
            if mine and first < last:
                dt, w = self.time_step(c), self.box(c, ROW)
                total = ti.Vector.zero(float, 5)
                for block in range(first, last):
                    total += self.scatter_block(c, block, thread, dt, w)
                for r in ti.static(range(5)):
                    self.sums[c, PLASTIC + r] += total[r]
        if ti.static(self.threads > 1 and self.mx):
            for q in range(self.loop(cut, ROW)):
                self.add_row(cut, q)
        if ti.static(self.mx):
            for q in range(self.loop(cut, LINE)):
                c, r, mine = self.turn_of(cut, q, LINE)
                if mine:
                    deep = self.window[c, 5] - self.window[c, 2]
                    j, k = self.window[c, 1] + r // deep, self.window[c, 2] + r % deep
                    self.fold_x(c, j, k)
                    if ti.static(self.twins):
                        if self.twin(c, j):
                            self.fold_x(c, self.size[c, SECOND] + j, k)
        for q in range(self.loop(cut, ROW)):
            c, r, mine = self.turn_of(cut, q, ROW)
            if mine:
                dt = self.time_step(c)
                i, j, low, high = self.row(c, r, ROW)
                for k in range(low, high):
                    self.update_node(c, i, j, k, dt)
        if ti.static(self.cuts):
            ti.loop_config(serialize=self.alone)
            for q in range(self.loop(cut, SLICE)):
                c, i, mine = self.turn_of(cut, q, SLICE)
                if mine:
                    self.look_beside(c, i)
            ti.loop_config(serialize=self.alone)
            for q in range(self.loop(cut, SLICE)):
                c, i, mine = self.turn_of(cut, q, SLICE)
                if mine and i >= self.i0:
                    self.feel(c, i, self.time_step(c))
            ti.loop_config(serialize=self.alone)
            for q in range(self.loop(cut, SLICE)):
                c, i, mine = self.turn_of(cut, q, SLICE)
                if mine and i >= self.i0:
                    self.react(c, i)
            ti.loop_config(serialize=self.alone)
            for q in range(self.loop(cut, SLICE)):
                c, i, mine = self.turn_of(cut, q, SLICE)
                if mine and i >= self.i0:
                    self.follow(c, i)
        ti.loop_config(serialize=self.alone)
        for q in range(self.loop(cut, EACH)):
            c, _, mine = self.turn_of(cut, q, EACH)
            if mine:
                self.proceed(c)
        for q in range(self.loop(cut, PART)):
            c, part, mine = self.turn_of(cut, q, PART)
            first, last, thread = self.share(c, part)
            if mine and first < last:
                dt, w = self.time_step(c), self.box(c, ROW)
                for p in range(first * self.lanes, ti.min(last * self.lanes, self.size[c, COUNT])):
                    self.gather(c, p, thread, dt, w)
        if ti.static(self.damage):
            self.smooth_strain(cut)

    @ti.func
    def add_threads(self, cut, i, j, k):
        """Sum the private grids of all threads at one node."""
        q = self.g[self.own(cut, 0, i, j, k)]
        for t in ti.static(range(1, self.threads)):
            q += self.g[self.own(cut, t, i, j, k)]
        self.g[self.own(cut, 0, i, j, k)] = q

    @ti.func
    def until_report(self, cut, row):
        """Steps of a cut before row ``row`` of its report."""
        every, steps = ti.cast(self.order[cut, EVERY], ti.i32), ti.cast(self.order[cut, STEPS], ti.i32)
        return ti.math.clamp(steps - row * every, 0, every)

    @ti.func
    def follow_orders(self, cut, out: ti.template()):
        """All time steps of a cut that are ordered."""
        ti.loop_config(serialize=True)
        for r in range(out.shape[1]):
            n = self.until_report(cut, r)
            if n > 0:
                self.look_around(cut)
                for _ in range(n):
                    self.advance(cut)
                self.report(cut, r, out)

    @ti.func
    def listen(self, orders: ti.template()):
        """Take orders."""
        for c, k in self.order:
            self.order[c, k] = orders[c, k]

    @ti.kernel
    def steps(self, orders: ROWS, out: TABLES):
        """All time steps that are ordered without leaving the kernel, one thread a cut, with a row of the report after every so many."""
        self.listen(orders)
        if ti.static(self.batch == 1):
            self.follow_orders(0, out)
        else:
            for part in range(self.batch * CPU_BLOCK):
                if part % CPU_BLOCK == 0:
                    self.follow_orders(part // CPU_BLOCK, out)

    @ti.kernel
    def step(self):
        """One time step, its loops in parallel."""
        self.advance(0)

    @ti.kernel
    def surround(self, orders: ROWS, row: int):
        """Renew the window, before the steps that lead to a row of the report."""
        self.listen(orders)
        self.look_around(0)
        if ti.static(self.atomic):
            for c in range(self.batch):
                self.left[c] = self.until_report(c, row)

    @ti.kernel
    def write(self, out: TABLES):
        """One row of the report."""
        self.report(0, 0, out)

    def go(self, orders):
        """Make the time steps that are ordered.

        Args:
            orders: Of each cut steps, after how many each a row of the report, time step [s], velocity upwards and along the blade [m/s]
                and rate of its turn [rad/s]; no steps for one that rests.

        Returns:
            Rows of the report of each cut, (cuts, most rows, N_REPORT); a cut with fewer has the first of them.
        """
        table = np.zeros((self.batch, N_ORDER))
        table[:, EVERY] = 1
        table[: len(orders)] = orders
        counts, every = table[:, STEPS].astype(int), table[:, EVERY].astype(int)
        rows = int((-(-counts // every)).max())
        out = np.zeros((self.batch, rows, N_REPORT))
        if self.threads == 1 and not self.atomic:
            self.steps(table, out)
            return out
        for r in range(rows):
            self.surround(table, r)
            for _ in range(np.clip(counts - r * every, 0, every).max()):
                self.step()
            line = np.zeros((self.batch, 1, N_REPORT))
            self.write(line)
            out[:, r] = line[:, 0]
        return out
