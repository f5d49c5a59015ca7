"""The cutting edge as a line that moves through the grid with a cohesive law, slice by slice along the blade."""

import taichi as ti

from mpm.kernels.fields import (
    DEPTH,
    DX,
    EDGE,
    FIRST,
    FULL,
    HALF_LENGTH,
    INV,
    NODES,
    OX,
    OY,
    OZ,
    PAIR,
    PARTED,
    R_FLESH,
    R_START,
    SECOND,
    SLIP,
    TILT_COS,
    TILT_SIN,
    ZONE,
    S,
)
from mpm.kernels.grid_update import Nodes
from mpm.kernels.signed_distance import bspline, edge_level

# Kernel mass of the process zone of an edge that touches a flat surface, over rho dx zone^2 (exact: the zone is centred
# half a zone below the edge).
SURFACE_FILL = 5 / 6
EMPTY_ZONE = 0.15  # filled less than this the zone carries no edge; at the board it is still filled to 0.2


class Edge(Nodes):
    """The edge's law and its reaction on the grid."""

    @ti.func
    def slice_nodes(self, cut, i):
        """Nodes whose velocity slice i feels, as the corners (low 3, high 3) of a box."""
        reach = 1.5 * self.par[cut, ZONE]
        s = self.par[cut, FIRST] + i * self.par[cut, DX]
        mid = self.grid_axes(cut, ti.Vector([s, 0.0, self.front[cut, i] - 0.5 * self.par[cut, ZONE]]))
        wide, deep = 0.0, reach
        if ti.static(self.turned):
            e = ti.abs(self.grid_axes(cut, ti.Vector([self.par[cut, DX], 0.0, 0.0])))
            f = ti.abs(self.grid_axes(cut, ti.Vector([0.0, reach, 0.0])))
            wide, deep = e[0] + f[0], e[1] + f[1]
        r = (mid - ti.Vector([self.par[cut, OX], self.par[cut, OY], self.par[cut, OZ]])) * self.par[cut, INV]
        h = ti.Vector([wide + 1e-6 * self.par[cut, DX], deep, reach]) * self.par[cut, INV]
        out = ti.Vector([0, 0, 0, 0, 0, 0])
        for d in ti.static(range(3)):
            out[d] = ti.max(0, ti.ceil(r[d] - h[d], ti.i32))
            out[d + 3] = ti.min(self.size[cut, NODES + d], ti.floor(r[d] + h[d], ti.i32) + 1)
        return out

    @ti.func
    def zone_weight(self, cut, i, a, j, k):
        """Weight of node (a, j, k) in the process zone of slice i, which is centred half a zone below the edge."""
        z = self.par[cut, ZONE]
        at = self.blade_axes(cut, self.node(cut, a, j, k))
        w = bspline(at[1] / z) * bspline((at[2] - self.front[cut, i]) / z + 0.5)
        if ti.static(self.turned):
            w *= ti.max(0.0, 1.0 - ti.abs(at[0] - self.par[cut, FIRST] - i * self.par[cut, DX]) * self.par[cut, INV])
        return w

    @ti.func
    def line_force(self, cut, i, tangential, forward, part):
        """Force per length of the edge in one slice after it moved against the material [N/m]: along the edge, forward.

        The slip is elastic up to a limit and points where the edge goes. A cut starts where the force reaches the
        threshold, at the indentation that belongs to it, and from there runs along the blade to every slice that
        already carries the propagation resistance: growing a crack takes less than starting one. Then the force falls
        to that resistance. Until the start the slip is the mean over the part of the slice that the edge has reached: on
        a round top more of it comes into contact, unslipped, as the edge goes down. The force acts against the motion
        and only the way forward makes new surface, so that with a slice/push ratio xi the forward force is
        R / (1 + xi^2) (Atkins, Xu and Jeronimidis 2004).
        """
        limit, flesh = self.par[cut, SLIP], self.par[cut, R_FLESH]
        held = 1.0
        if self.start[cut, i] <= 0:  # what has come into contact since has not slipped yet
            held = ti.min(1.0, self.touched[cut, i] / part)
        self.touched[cut, i] = part
        e = held * self.slip[cut, i] + ti.Vector([tangential, forward])
        e[1] = ti.max(e[1], 0.0)
        size = e.norm()
        steep = e[1] / size if size > 0 else 0.0
        level = 0.0
        if self.start[cut, i] <= 0:
            level = self.par[cut, R_START] * size / self.par[cut, DEPTH]
            if level >= self.par[cut, R_START] or (self.near[cut, i] > 0 and level >= flesh):
                self.start[cut, i] = ti.max(level, 1e-9)
                e *= limit / ti.max(size, 1e-30)  # without resistance a cut starts before the edge has slipped
        else:
            if size > limit:
                self.parted[cut, i] += (size - limit) * steep
                e *= limit / size
                size = limit
            level = edge_level(self.parted[cut, i], self.soften[cut, i], self.start[cut, i], flesh) * size / limit
        self.slip[cut, i] = e
        return level * steep * e / ti.max(e.norm(), 1e-30)

    @ti.func
    def over(self, cut, s):
        """Part of a slice that is under the blade [-]."""
        reach = self.par[cut, HALF_LENGTH] * ti.cast(self.pose[cut, TILT_COS], float) - ti.abs(
            s - ti.cast(self.pose[cut, S], float)
        )
        return ti.math.clamp(reach * self.par[cut, INV] + 0.5, 0.0, 1.0)

    @ti.func
    def lead(self, cut, i):
        """Move the crack front of slice i: down with the edge, and with the food where the blade has gone."""
        s = self.par[cut, FIRST] + i * self.par[cut, DX]
        tip = self.edge_height(cut, s)
        self.front[cut, i] += self.drift[cut, i]
        if self.over(cut, s) > 0 and tip < self.front[cut, i]:
            self.front[cut, i] = tip

    @ti.func
    def feel(self, cut, i, dt):
        """Find the edge's reaction on slice i in this step, as a change of velocity."""
        self.push[cut, i], self.drift[cut, i] = ti.Vector.zero(float, 2), 0.0
        s = self.par[cut, FIRST] + i * self.par[cut, DX]
        tip = self.edge_height(cut, s)
        over = self.over(cut, s)
        box = self.slice_nodes(cut, i)
        mass = 0.0
        for a in range(box[0], box[3]):
            for j in range(box[1], box[4]):
                for k in range(box[2], box[5]):
                    mass += self.zone_weight(cut, i, a, j, k) * self.moving(cut, a, j, k)[3]
        mass *= ti.static(2.0 if self.my else 1.0)
        # the zone reaches below the edge and beside the food, so the width that is cut is that of the outline
        begun = ti.math.clamp((self.top[cut, i] - tip) / (self.top[cut, i] - self.low[cut, i]), 0.0, 1.0)
        ended = ti.math.clamp(
            (self.floor_top[cut, i] - tip) / (self.floor_top[cut, i] - self.floor_low[cut, i]), 0.0, 1.0
        )
        width = self.par[cut, DX] * self.width[cut, i] * (begun - ended)
        full = SURFACE_FILL * self.par[cut, FULL] * width * self.par[cut, INV]
        if width > 0 and mass > EMPTY_ZONE * full:
            c, t = ti.cast(self.pose[cut, TILT_COS], float), ti.cast(self.pose[cut, TILT_SIN], float)
            mean, blade = self.velocity[cut, i], self.blade_velocity(cut, s, tip)
            if over > 0 and tip <= self.front[cut, i] + self.par[cut, SLIP]:
                slide, fall = (blade[0] - mean[0]) * dt, (mean[2] - blade[2]) * dt
                line = self.line_force(cut, i, c * slide - t * fall, c * fall + t * slide, begun - ended)
                along, down = c * line[0] + t * line[1], c * line[1] - t * line[0]
                impulse = ti.Vector([along, -down]) * width / c * over * dt
                self.push[cut, i] = impulse / mass
                self.knife(cut, EDGE, -self.images_x(cut, i) * ti.Vector([impulse[0], 0.0, impulse[1]]), s, tip)
                self.sums[cut, PARTED] += self.images_x(cut, i) * (impulse[0] * slide - impulse[1] * fall) / dt
            else:
                self.slip[cut, i] = ti.Vector.zero(float, 2)
                if self.front[cut, i] < 1e2:  # the blade has gone: the front stays in the material
                    self.drift[cut, i] = mean[2] * dt
        else:
            self.slip[cut, i] = ti.Vector.zero(float, 2)

    @ti.func
    def follow(self, cut, i):
        """Mean velocity of the process zone of slice i after the edge's reaction.

        The slip of the next step is counted against it. Counted against the velocity before the reaction, the slip would
        run ahead by force x dt / mass in every step, and the edge would do work on the food that nobody did on the edge.
        """
        box = self.slice_nodes(cut, i)
        total = ti.Vector.zero(float, 4)
        for a in range(box[0], box[3]):
            for j in range(box[1], box[4]):
                for k in range(box[2], box[5]):
                    total += self.zone_weight(cut, i, a, j, k) * self.moving(cut, a, j, k)
        self.velocity[cut, i] = ti.Vector.zero(float, 3)
        if total[3] > 0:
            self.velocity[cut, i] = self.blade_axes(cut, ti.Vector([total[0], total[1], total[2]]) / total[3])

    @ti.func
    def moving(self, cut, a, j, k):
        """Momentum and mass of both fields of a node."""
        q = self.u[self.shared(cut, a, j, k)]
        out = q[3] * ti.Vector([q[0], q[1], q[2], 1.0])
        if ti.static(self.twins):
            if self.twin(cut, j):
                other = self.u[self.shared(cut, a, self.size[cut, SECOND] + j, k)]
                out += other[3] * ti.Vector([other[0], other[1], other[2], 1.0])
        return out

    @ti.func
    def react(self, cut, i):
        """Give the grid the reaction of slice i."""
        if self.push[cut, i].norm_sqr() > 0:
            box = self.slice_nodes(cut, i)
            dv = self.grid_axes(cut, ti.Vector([self.push[cut, i][0], 0.0, self.push[cut, i][1]]))
            for a in range(box[0], box[3]):
                for j in range(box[1], box[4]):
                    for k in range(box[2], box[5]):
                        w = self.zone_weight(cut, i, a, j, k)
                        if w > 0:
                            self.give(cut, a, j, k, w * dv)
                            if ti.static(self.mx):
                                image = self.size[cut, PAIR] - a
                                if a > image >= 0:
                                    self.give(cut, image, j, k, w * ti.Vector([-dv[0], dv[1], dv[2]]))

    @ti.func
    def give(self, cut, a, j, k, dv):
        """Change the velocity of both fields of a node."""
        for d in ti.static(range(3)):
            self.u[self.shared(cut, a, j, k)][d] += dv[d]
        if ti.static(self.twins):
            if self.twin(cut, j):
                for d in ti.static(range(3)):
                    self.u[self.shared(cut, a, self.size[cut, SECOND] + j, k)][d] += dv[d]
