"""What happens at the grid's nodes: mirrors, the two halves, the plain nodal contact, the cutting edge."""

import taichi as ti

from mpm.contact import blade_distance, bspline, coulomb, edge_level
from mpm.fields import (
    BLADE,
    BOARD,
    BOARD_MU,
    COS,
    DEPTH,
    EDGE,
    FACE,
    FRICTION,
    FULL,
    GRAVITY,
    HALF_LENGTH,
    R_FLESH,
    R_START,
    SIN,
    SLIP,
    SPINE,
    ZONE,
    Fields,
)

# Kernel mass of the process zone of an edge that touches a flat surface, over rho dx zone^2 (exact: the zone is centred
# half a zone below the edge). With less food than that around it, as before the board, the edge's force fades.
SURFACE_FILL = 5 / 6
EMPTY_ZONE = 0.05  # a process zone filled less than this carries no edge


@ti.data_oriented
class Nodes(Fields):
    """Updates of the grid between the two transfers."""

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
        # the zone reaches below the edge and beside the food, so the width that is cut is that of the outline
        width = self.dx * self.width[i] * ti.math.clamp((self.top[i] - tip) / (self.top[i] - self.low[i]), 0.0, 1.0)
        full = SURFACE_FILL * self.par[FULL] * width * self.inv
        if width > 0 and mass > EMPTY_ZONE * full:
            force = self.edge_force(i, (speed + mom / mass) * dt)
            impulse = force * ti.min(1.0, mass / full) * width * self.cover[i] * dt
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
