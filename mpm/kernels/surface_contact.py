"""Contact of the food's surface with board, blade and plate, particle by particle."""

import taichi as ti

from mpm.kernels.constitutive import full
from mpm.kernels.fields import (
    BLADE,
    BOARD,
    BOARD_MU,
    COS,
    DX,
    FACE,
    FRICTION,
    INV,
    MASS,
    RADIUS,
    RUBBED,
    SIN,
    SPINE,
    TACK,
    TACK_GAP,
    TILT_COS,
    TILT_SIN,
    VS,
    VZ,
    YIELD,
    Z,
)
from mpm.kernels.reductions import Survey
from mpm.kernels.signed_distance import blade_distance, stick_slip, tack

# Stiffness of the contact over mass / dt^2 of a particle. The stiffest sound one is 4 for a lone particle on a hard surface,
# over 1 + 4 arm^2 / dx^2 when the impulse has an arm, which is half a cell at most.
CONTACT = 2.0
FLAT = 0.02  # least distance between a particle's centre and the surface that squeezing leaves, over the cell


class Touch(Survey):
    """What a particle of the surface feels of the tools, and they of it."""

    @ti.func
    def may_touch(self, cut, p, at):
        """Whether a particle is so near to the board or the blade that contact is worth a look."""
        out = True
        if ti.static(not self.press):
            there, near = self.blade_axes(cut, at), 2 * self.par[cut, DX]
            out = (0 < self.foot[cut, p] and there[2] < near) or ti.abs(there[1]) < 0.5 * self.par[cut, SPINE] + near
            out = out or self.shell[cut, p][1] > 0 or self.tacky[cut, p] > 0
        return out

    @ti.func
    def touch(self, cut, p, dt, u, at):
        """Contact of one particle with board and tool; returns its corrected velocity.

        What touches is the food's surface, not the particle's centre. Its distance from the centre stretches with the
        food, it moves with the food's velocity there, and the impulse has the moment that belongs to it, so that the work
        of the contact is that of the surface. At the centre a food of n cells would be 1 / n stiffer.

        The force is the food's own traction on the surface and, for what is missing, a stiff spring (Nitsche's method:
        Chouly and Hild 2013, SIAM J. Numer. Anal. 51:1295). The spring alone, as stiff as the time step allows, would
        give way as much as a fifth of a cell of food does.
        """
        m = self.par[cut, MASS] * self.bulk[cut, p] * ti.static((2 if self.mx else 1) * (2 if self.my else 1))
        c = self.gradient_of(cut, p)
        up = self.blade_axes(
            cut, c @ ti.Vector([0.0, 0.0, 1.0])
        )  # gradient of the velocity, upwards and across the blade
        across = self.blade_axes(cut, c @ self.grid_axes(cut, ti.Vector([0.0, 1.0, 0.0])))
        there, v = self.blade_axes(cut, at), self.blade_axes(cut, u)
        least, most = FLAT * self.par[cut, DX], 0.5 * self.par[cut, DX]
        kick, high, wide = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if 0 < self.foot[cut, p] and there[2] < 2 * self.par[cut, DX]:  # a free body has none
            self.foot[cut, p] = ti.math.clamp(self.foot[cut, p] * (1 + dt * up[2]), least, most)
            kick = self.touch_board(cut, p, m, dt, v - self.foot[cut, p] * up, there)
            high -= self.foot[cut, p] * kick
        arm, push = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if ti.static(self.press):
            if there[2] > ti.cast(self.pose[cut, Z], float) - 2 * self.par[cut, DX]:
                self.gap[cut, p] = ti.math.clamp(self.gap[cut, p] * (1 + dt * up[2]), least, most)
                arm = ti.Vector([0.0, 0.0, self.gap[cut, p]])
                push = self.touch_press(cut, p, m, dt, v + kick + self.gap[cut, p] * up, there + arm)
        else:
            if ti.abs(there[1]) < 2 * self.par[cut, DX]:
                self.gap[cut, p] = ti.math.clamp(self.gap[cut, p] * (1 + dt * across[1]), least, most)
            push, arm = self.touch_blade(cut, p, m, dt, v + kick, up, across, there)
        high += arm[2] * push
        wide += arm[1] * push
        scale = 4 * self.par[cut, INV] * self.par[cut, INV]
        high, wide = self.grid_axes(cut, high), self.grid_axes(cut, wide)
        new = v + kick + push
        gift = 0.5 * (new.norm_sqr() - v.norm_sqr())
        self.lever[cut, p, 0] = ti.Vector([scale * high[0], scale * high[1], scale * high[2], gift])
        self.lever[cut, p, 1] = scale * ti.Vector([wide[0], wide[1], wide[2], 0.0])
        return self.grid_axes(cut, new)

    @ti.func
    def traction(self, cut, p, shell, depth, n, dt):
        """Force that the food's own stress asks of a board or tool with outward normal n, over the contact's stiffness [m].

        Of the first layer only: ``shell`` is the reference volume between centre and surface, ``depth`` their distance.
        """
        out = ti.Vector.zero(float, 3)
        if shell > 0:
            block = p // self.lanes
            lane = p - block * self.lanes
            t = ti.Vector([self.tau[cut, block, r][lane] for r in range(6)])
            out = self.blade_axes(cut, full(t) @ self.grid_axes(cut, n))
            out *= -shell / depth * dt * dt / (CONTACT * self.par[cut, MASS] * self.bulk[cut, p])
        return out

    @ti.func
    def friction(self, cut, p, press, dt):
        """Largest friction on the tool at a normal force, both over the contact's stiffness [m]: Coulomb's, and on the food's face no
        more than its yield stress in shear (Orowan 1943; Zorev 1963).

        Beyond that the food shears in a band of no thickness along the face. A grid without this limit shears a whole layer
        of cells, drags it down with the blade and is pressed for it the more, the finer the cells.
        """
        most, shell = self.par[cut, FRICTION] * press, self.shell[cut, p][1]
        if shell > 0:
            yields = self.par[cut, YIELD] / ti.sqrt(3.0) * shell / self.gap[cut, p]
            most = ti.min(most, yields * dt * dt / (CONTACT * self.par[cut, MASS] * self.bulk[cut, p]))
        return most

    @ti.func
    def touch_board(self, cut, p, m, dt, u, at):
        """Contact of one particle with the board; returns the change of its velocity. ``u`` is that of its surface.

        Friction is Coulomb's alone. The limit of :meth:`friction` would bind where the pressure exceeds the yield stress over
        sqrt(3) mu, which under a food that lies on a board is at the points of a round one, whose contact is narrower than a
        particle's face: the area to multiply is not known there. Nor is food drawn along the board by a tool.
        """
        dv = ti.Vector.zero(float, 3)
        own = self.traction(cut, p, self.shell[cut, p][0], self.foot[cut, p], ti.Vector([0.0, 0.0, 1.0]), dt)
        force = self.foot[cut, p] - at[2] + own[2]
        own[2] = 0.0
        if force > 0:
            slide = dt * ti.Vector([u[0], u[1], 0.0])
            hold = stick_slip(self.stick[cut, 0, p], slide, own, self.par[cut, BOARD_MU] * force)
            self.stick[cut, 0, p] = own - hold
            dv = CONTACT / dt * ti.Vector([hold[0], hold[1], force])
            self.tool(cut, BOARD, -m * dv)
            self.sums[cut, RUBBED] -= m / dt * dv.dot(slide)
        else:
            self.stick[cut, 0, p] = ti.Vector.zero(float, 3)
        return dv

    @ti.func
    def touch_blade(self, cut, p, m, dt, u, up, across, at):
        """Contact of one severed particle with the blade's faces; returns the change of its velocity, and its lever arm.

        A particle meets the blade as far from its centre as it was from the cut plane when the food was whole, so
        that the faces displace the food by the true half thickness of the blade.
        """
        cos_t, sin_t = ti.cast(self.pose[cut, TILT_COS], float), ti.cast(self.pose[cut, TILT_SIN], float)
        above = (at[2] - self.edge_height(cut, at[0])) * cos_t
        touching = False
        dv, arm = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if self.side[cut, p] != 0 and 0 < above < self.par[cut, BLADE] and self.under_blade(cut, at[0]):
            sign = 1.0 if self.side[cut, p] == 2 else -1.0
            d, n = blade_distance(
                sign * at[1], above, self.par[cut, SPINE], self.par[cut, COS], self.par[cut, SIN], self.par[cut, RADIUS]
            )
            n = ti.Vector([-sin_t * n[2], sign * n[1], cos_t * n[2]])
            own = self.traction(cut, p, self.shell[cut, p][1], self.gap[cut, p], n, dt)
            opening = d - self.gap[cut, p]
            force = own.dot(n) - opening
            press = ti.max(force, 0.0)
            own -= own.dot(n) * n
            if force > 0 and self.tacky[cut, p] == 0:
                self.tacky[cut, p] = 1
            if force <= 0 and self.tacky[cut, p] == 1:
                if opening < self.par[cut, TACK_GAP]:
                    opening = ti.max(opening, 0.0)
                    force = -self.par[cut, TACK] * tack(opening, self.par[cut, TACK_GAP]) * dt * dt / CONTACT
                    press = -force
                else:
                    self.tacky[cut, p] = 0
            if press > 0:
                touching = True
                arm = -self.gap[cut, p] * n
                rel = u + arm[2] * up + arm[1] * across - self.blade_velocity(cut, at[0] + arm[0], at[2] + arm[2])
                slide = rel - rel.dot(n) * n
                stick = self.stick[cut, 1, p] - self.stick[cut, 1, p].dot(n) * n
                hold = stick_slip(stick, dt * slide, own, self.friction(cut, p, press, dt))
                self.stick[cut, 1, p] = own - hold
                dv = CONTACT / dt * (force * n + hold)
                self.knife(cut, FACE, -m * dv, at[0] + arm[0], at[2] + arm[2])
                self.sums[cut, RUBBED] -= m * dv.dot(slide if force > 0 else rel)
        if not touching:
            self.stick[cut, 1, p] = ti.Vector.zero(float, 3)
        return dv, arm

    @ti.func
    def touch_press(self, cut, p, m, dt, u, at):
        """Contact of one particle with a plate or wedge that presses from above; returns the change of its velocity.

        ``at`` and ``u`` are place and velocity of the food's surface above the particle.
        """
        sign = 1.0 if at[1] >= 0 else -1.0
        above = at[2] - ti.cast(self.pose[cut, Z], float)
        d, n = blade_distance(
            sign * at[1], above, self.par[cut, SPINE], self.par[cut, COS], self.par[cut, SIN], self.par[cut, RADIUS]
        )
        n = ti.Vector([0.0, sign * n[1], n[2]])
        own = self.traction(cut, p, self.shell[cut, p][1], self.gap[cut, p], n, dt)
        force = own.dot(n) - d
        own -= own.dot(n) * n
        dv = ti.Vector.zero(float, 3)
        if force > 0:
            tool = ti.Vector([ti.cast(self.pose[cut, VS], float), 0.0, ti.cast(self.pose[cut, VZ], float)])
            stick = self.stick[cut, 1, p] - self.stick[cut, 1, p].dot(n) * n
            slide = u - tool
            slide -= slide.dot(n) * n
            hold = stick_slip(stick, dt * slide, own, self.friction(cut, p, force, dt))
            self.stick[cut, 1, p] = own - hold
            dv = CONTACT / dt * (force * n + hold)
            self.tool(cut, FACE, -m * dv)
            self.sums[cut, RUBBED] -= m * dv.dot(slide)
        else:
            self.stick[cut, 1, p] = ti.Vector.zero(float, 3)
        return dv
