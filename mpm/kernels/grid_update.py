"""What happens at the grid's nodes: mirrors, the two halves, the plain nodal contact."""

import taichi as ti

from mpm.kernels.crack import Split
from mpm.kernels.fields import (
    BLADE,
    BOARD,
    BOARD_MU,
    COS,
    DX,
    FACE,
    FRICTION,
    GRAVITY,
    PAIR,
    PLANE,
    RADIUS,
    SECOND,
    SIN,
    SPINE,
)
from mpm.kernels.signed_distance import blade_distance, coulomb


class Nodes(Split):
    """Updates of the grid between the two transfers."""

    @ti.func
    def add_mirrored(self, cut, i, m, j, k):
        """Make node i and its image m across x carry the sum of both."""
        a, b = self.g[self.own(cut, 0, i, j, k)], self.g[self.own(cut, 0, m, j, k)]
        b[0] = -b[0]
        a += b
        self.g[self.own(cut, 0, i, j, k)] = a
        a[0] = -a[0]
        self.g[self.own(cut, 0, m, j, k)] = a

    @ti.func
    def fold_x(self, cut, j, k):
        """Add the mirror images across x = 0 to one line of nodes."""
        for m in ti.static(range(self.i0)):
            self.add_mirrored(cut, self.size[cut, PAIR] - m, m, j, k)
        if self.size[cut, PAIR] == 2 * self.i0:
            c = 2.0 * self.g[self.own(cut, 0, self.i0, j, k)]
            c[0] = 0.0
            self.g[self.own(cut, 0, self.i0, j, k)] = c

    @ti.func
    def nodal_contact(self, cut, i, j, k, q, u):
        """The plain rule: velocities at nodes inside a tool are projected, with Coulomb friction."""
        at = self.blade_axes(cut, self.node(cut, i, j, k))
        u = self.blade_axes(cut, u)
        mult = self.images(cut, i, j)
        for which in ti.static(range(2)):
            d, nrm, vel, mu = at[2], ti.Vector([0.0, 0.0, 1.0]), ti.Vector.zero(float, 3), self.par[cut, BOARD_MU]
            if ti.static(which == 1):
                above = at[2] - self.edge_height(cut, at[0])
                d, nrm = blade_distance(
                    ti.abs(at[1]),
                    above,
                    self.par[cut, SPINE],
                    self.par[cut, COS],
                    self.par[cut, SIN],
                    self.par[cut, RADIUS],
                )
                if (
                    ti.abs(at[1]) < 1e-6 * self.par[cut, DX]
                ):  # both faces are equally near: their mean normal is downwards
                    nrm = ti.Vector([0.0, 0.0, -1.0])
                elif at[1] < 0:
                    nrm[1] = -nrm[1]
                vel = self.blade_velocity(cut, at[0], at[2])
                mu = self.par[cut, FRICTION]
                if above < 0 or above > self.par[cut, BLADE] or not self.under_blade(cut, at[0]):
                    d = 1.0
            rel = u - vel
            vn = rel.dot(nrm)
            if d <= 0 and vn < 0:
                t = rel - vn * nrm
                new = vel + t + coulomb(-vn, t, mu)
                if ti.static(which == 1):
                    self.knife(cut, FACE, mult * q[3] * (u - new), at[0], at[2])
                else:
                    self.tool(cut, BOARD, mult * q[3] * (u - new))
                u = new
        return self.grid_axes(cut, u)

    @ti.func
    def scattered(self, cut, i, j, k):
        """Momentum and mass that all threads have scattered to a node; where x has a mirror they are added up before it."""
        q = self.g[self.own(cut, 0, i, j, k)]
        if ti.static(not self.mx):
            for s in ti.static(range(1, self.threads)):
                q += self.g[self.own(cut, s, i, j, k)]
        return q

    @ti.func
    def both(self, cut, i, j, k):
        """Momentum and mass of the first and the second field at a node, mirror images across y included, and the masses
        without them."""
        a, b = self.scattered(cut, i, j, k), ti.Vector.zero(float, 4)
        masses = ti.Vector([a[3], 0.0])
        if ti.static(self.twins):
            if self.twin(cut, j):
                second = self.size[cut, SECOND]
                b = self.scattered(cut, i, second + j, k)
                masses[1] = b[3]
                if ti.static(self.my):
                    m = 2 * self.size[cut, PLANE] - j
                    if self.twin(cut, m):
                        flip = ti.Vector([1.0, -1.0, 1.0, 1.0])
                        a += flip * self.scattered(cut, i, m, k)
                        if j != self.size[cut, PLANE]:
                            b += flip * self.scattered(cut, i, second + m, k)
        return a, b, masses

    @ti.func
    def update_node(self, cut, i, j, k, dt):
        """Momentum to velocity at a node, for the food on its own side and for the severed food of the other side."""
        a, b, masses = self.both(cut, i, j, k)
        fall = ti.Vector([0.0, 0.0, -self.par[cut, GRAVITY] * dt])
        va, vb = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if a[3] > 0:
            va = ti.Vector([a[0], a[1], a[2]]) / a[3] + fall
            if ti.static(self.nodal):
                va = self.nodal_contact(cut, i, j, k, a, va)
        if ti.static(self.twins):
            if b[3] > 0:
                vb = ti.Vector([b[0], b[1], b[2]]) / b[3] + fall
                va, vb = self.keep_apart(cut, i, j, k, a, b, va, vb)
            if self.twin(cut, j):
                # velocity of all that shares the field, mass of what was scattered here
                at = self.size[cut, SECOND] + j
                self.u[self.shared(cut, i, at, k)] = ti.Vector([vb[0], vb[1], vb[2], masses[1]])
        self.u[self.shared(cut, i, j, k)] = ti.Vector([va[0], va[1], va[2], masses[0]])

    @ti.func
    def keep_apart(self, cut, i, j, k, a, b, va, vb):
        """Where no blade is between them, the severed halves may close on each other but not pass through."""
        at = self.blade_axes(cut, self.node(cut, i, j, k))
        above = at[2] - self.edge_height(cut, at[0])
        if not (-0.5 * self.par[cut, DX] < above < self.par[cut, BLADE] and self.under_blade(cut, at[0])):
            n = self.grid_axes(cut, ti.Vector([0.0, 1.0, 0.0]))
            sign = 1.0 if self.half_of_node(cut, at[1]) == 1 else -1.0
            na, nb = va.dot(n), vb.dot(n)
            on_mirror = False
            if ti.static(self.my):
                on_mirror = j == self.size[cut, PLANE]
            if on_mirror:  # the other half is the image of the second field
                if nb > 0:
                    vb -= nb * n
            elif sign * (nb - na) > 0 and a[3] > 0:
                mean = (a[3] * na + b[3] * nb) / (a[3] + b[3])
                va += (mean - na) * n
                vb += (mean - nb) * n
        return va, vb
