"""Contact of the food's surface with board, blade and plate, particle by particle."""

import taichi as ti

from mpm.kernels.adhesion import stick_face
from mpm.kernels.constitutive.laws import full
from mpm.kernels.crack import particle_half
from mpm.kernels.signed_distance import blade_distance, blade_opening, stick_slip
from mpm.kernels.tool import (
    blade_velocity,
    board_height,
    book_impulse,
    book_knife_impulse,
    edge_height,
    under_blade,
)
from mpm.state.accessors import to_grid_axes, to_scene_axes, velocity_gradient
from mpm.state.state import FACE_POINTS, IN_STONE
from mpm.state.tables import (
    ADHESION_GAP,
    ADHESION_WORK,
    BLADE_HEIGHT,
    BLADE_MU,
    BOARD,
    BOARD_MU,
    BOARD_SUCTION,
    CONTACT,
    COUNT,
    DX,
    EDGE_VS,
    EDGE_VZ,
    EDGE_Z,
    FACE,
    FRICTION_WORK,
    INV_DX,
    LEAST_GAP,
    MASS,
    SPACING,
    SPINE,
    SUCTION_WORK,
    TILT_COS,
    TILT_SIN,
    TIP_RADIUS,
    WEDGE_COS,
    WEDGE_SIN,
    YIELD,
)


@ti.func
def near_tool(s: ti.template(), cut, p, at):
    """Whether a particle is so near to the board or the blade that contact is worth a look."""
    out = True
    if ti.static(not s.press):
        there, near = to_scene_axes(s, cut, at), 2 * s.par[cut, DX]
        out = (0 < s.board_gap[cut, p] and there[2] < near) or ti.abs(there[1]) < 0.5 * s.par[cut, SPINE] + near
        out = out or s.surface_volume[cut, p][1] > 0 or s.adhering[cut, p] > 0
    return out


@ti.func
def surface_contact(s: ti.template(), cut, p, dt, u, at):
    """Contact of one particle with board and tool; returns its corrected velocity.

    What touches is the food's surface, not the particle's centre. Its distance from the centre stretches with the food,
    it moves with the food's velocity there, and the impulse has the moment that belongs to it, so that the work of the
    contact is that of the surface. At the centre a food of n cells would be 1 / n stiffer.

    The force is the food's own traction on the surface and, for what is missing, a stiff spring (Nitsche's method:
    Chouly and Hild 2013, SIAM J. Numer. Anal. 51:1295). The spring alone, as stiff as two layers of particles, would
    give way as much as a fifth of a cell of food does.

    Args:
        p: The particle.
        dt: Time step [s].
        u: Its velocity in the grid's axes [m/s].
        at: Its position in the grid's axes [m].
    """
    m = s.par[cut, MASS] * s.volume_ratio[cut, p] * ti.static((2 if s.mirror_x else 1) * (2 if s.mirror_y else 1))
    c = velocity_gradient(s, cut, p)
    # gradient of the velocity, upwards and across the blade
    up = to_scene_axes(s, cut, c @ ti.Vector([0.0, 0.0, 1.0]))
    across = to_scene_axes(s, cut, c @ to_grid_axes(s, cut, ti.Vector([0.0, 1.0, 0.0])))
    there, v = to_scene_axes(s, cut, at), to_scene_axes(s, cut, u)
    least, most = s.par[cut, LEAST_GAP], 0.5 * s.par[cut, DX]
    kick, high, wide = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    if 0 < s.board_gap[cut, p] and there[2] < 2 * s.par[cut, DX]:  # a free body has none
        s.board_gap[cut, p] = ti.math.clamp(s.board_gap[cut, p] * (1 + dt * up[2]), least, most)
        kick = board_contact(s, cut, p, m, dt, v - s.board_gap[cut, p] * up, there)
        high -= s.board_gap[cut, p] * kick
    push = ti.Vector.zero(float, 3)
    if ti.static(s.press):
        if there[2] > ti.cast(s.pose[cut, EDGE_Z], float) - 2 * s.par[cut, DX]:
            s.tool_gap[cut, p] = ti.math.clamp(s.tool_gap[cut, p] * (1 + dt * up[2]), least, most)
            arm = ti.Vector([0.0, 0.0, s.tool_gap[cut, p]])
            push = press_contact(s, cut, p, m, dt, v + kick + s.tool_gap[cut, p] * up, there + arm)
            high += arm[2] * push
    else:
        if ti.abs(there[1]) < 2 * s.par[cut, DX]:
            s.tool_gap[cut, p] = ti.math.clamp(s.tool_gap[cut, p] * (1 + dt * across[1]), least, most)
            rise = s.face_rise[cut, p]  # turns with the food; its part along the blade stays small
            rise += (dt * rise[2]) * up + (dt * rise[1]) * across
            s.face_rise[cut, p] = rise * ti.min(1.0, 1 / rise.norm())  # never taller than at rest
        push, lift, wide = blade_contact(s, cut, p, m, dt, v + kick, up, across, there)
        high += lift
    scale = 4 * s.par[cut, INV_DX] * s.par[cut, INV_DX]
    high, wide = to_grid_axes(s, cut, high), to_grid_axes(s, cut, wide)
    new = v + kick + push
    given = 0.5 * (new.norm_sqr() - v.norm_sqr())
    s.contact_moment[cut, p, 0] = ti.Vector([scale * high[0], scale * high[1], scale * high[2], given])
    s.contact_moment[cut, p, 1] = scale * ti.Vector([wide[0], wide[1], wide[2], 0.0])
    return to_grid_axes(s, cut, new)


@ti.func
def surface_traction(s: ti.template(), cut, p, shell, depth, n):
    """Force that the food's own stress asks of a board or tool, over the contact's stiffness [m].

    Args:
        p: The particle.
        shell: Reference volume between its centre and the surface [m^3], 0 behind the first layer.
        depth: Distance of centre and surface [m].
        n: Outward normal of the tool, in the scene's axes.
    """
    out = ti.Vector.zero(float, 3)
    if shell > 0:
        block = p // s.lanes
        lane = p - block * s.lanes
        t = ti.Vector([s.tau[cut, block, r][lane] for r in range(6)])
        out = to_scene_axes(s, cut, full(t) @ to_grid_axes(s, cut, n))
        out *= -shell / depth / (s.par[cut, CONTACT] * s.par[cut, MASS] * s.volume_ratio[cut, p])
    return out


@ti.func
def friction_limit(s: ti.template(), cut, p, press, own):
    """Largest friction on the tool at a normal force, over the contact's stiffness [m].

    It is Coulomb's, and on the food's face no more than its yield stress in shear (Orowan 1943; Zorev 1963): the
    coefficient is mu, or the yield stress over the pressure. The pressure is that of the food's own stress. The force
    of one particle's contact changes from particle to particle with what the grid can't follow of the blade's profile,
    and the stiffer the contact, the more; a limit on it would bind by chance.

    Beyond the limit the food shears in a band of no thickness along the face. A grid without it shears a whole layer of
    cells, drags it down with the blade and is pressed for it the more, the finer the cells.

    Args:
        p: The particle.
        press: Normal force over the contact's stiffness [m].
        own: What the food's own stress gives of it on the whole face, over the contact's stiffness [m].
    """
    mu, shell = s.par[cut, BLADE_MU], s.surface_volume[cut, p][1]
    if shell > 0 and own > 0:
        yields = s.par[cut, YIELD] / ti.sqrt(3.0) * shell / s.tool_gap[cut, p]
        mu = ti.min(mu, yields / (own * s.par[cut, CONTACT] * s.par[cut, MASS] * s.volume_ratio[cut, p]))
    return mu * press


@ti.func
def board_contact(s: ti.template(), cut, p, m, dt, u, at):
    """Contact of one particle with the board; returns the change of its velocity [m/s].

    A food that stands on a flat face is held down by up to the suction times the area of the face, as long as it is
    within two cells of the board, where contact is looked for.

    Friction is Coulomb's alone. The limit of :func:`friction_limit` would bind where the pressure exceeds the yield
    stress over sqrt(3) mu, which under a food that lies on a board is at the points of a round one. Its contact is
    narrower than a particle's face there, and the area to multiply is not known. Nor is food drawn along the board by a
    tool.

    Args:
        p: The particle.
        m: Its mass, mirror images included [kg].
        dt: Time step [s].
        u: Velocity of its surface [m/s].
        at: Position of its centre [m].
    """
    dv = ti.Vector.zero(float, 3)
    shell = s.surface_volume[cut, p][0]
    own = surface_traction(s, cut, p, shell, s.board_gap[cut, p], ti.Vector([0.0, 0.0, 1.0]))
    force = s.board_gap[cut, p] - (at[2] - board_height(s, cut, at[1])) + own[2]
    own[2] = 0.0
    if force > 0:
        slide = dt * ti.Vector([u[0], u[1], 0.0])
        hold = stick_slip(s.stick[cut, 0, p], slide, own, s.par[cut, BOARD_MU] * force)
        s.stick[cut, 0, p] = own - hold
        dv = s.par[cut, CONTACT] * dt * ti.Vector([hold[0], hold[1], force])
        book_impulse(s, cut, BOARD, -m * dv)
        s.sums[cut, FRICTION_WORK] -= m / dt * dv.dot(slide)
    else:
        s.stick[cut, 0, p] = ti.Vector.zero(float, 3)
        if s.par[cut, BOARD_SUCTION] > 0 and shell > 0:
            area = shell / s.board_gap[cut, p]
            most = s.par[cut, BOARD_SUCTION] * area
            most /= s.par[cut, CONTACT] * s.par[cut, MASS] * s.volume_ratio[cut, p]
            dv[2] = -s.par[cut, CONTACT] * dt * ti.min(-force, most)
            book_impulse(s, cut, BOARD, -m * dv)
            s.sums[cut, SUCTION_WORK] -= m * dv[2] * u[2]
    return dv


@ti.func
def blade_contact(s: ti.template(), cut, p, m, dt, u, up, across, at):
    """Contact of one particle with the blade's faces; returns the change of velocity [m/s] and its moments.

    What lies above the edge of a particle's face touches the blade, also before the edge has come to its centre: a face
    that met the blade all at once would meet it with a depth, and energy would come from nothing.

    The two moments are those of the impulses with the lever's height and with its part across the blade [m^2/s].

    Args:
        p: The particle.
        m: Its mass, mirror images included [kg].
        dt: Time step [s].
        u: Velocity of its centre [m/s].
        up: Gradient of the velocity upwards [1/s].
        across: Gradient of the velocity across the blade [1/s].
        at: Position of its centre [m].
    """
    above = (at[2] - edge_height(s, cut, at[0])) * ti.cast(s.pose[cut, TILT_COS], float)
    touching = False
    dv, lift, wide = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    tall = s.par[cut, BLADE_HEIGHT] + 0.5 * s.par[cut, SPINE] + s.par[cut, SPACING]
    below = s.par[cut, SPACING]
    if s.adhering[cut, p] > 0:
        below = ti.max(below, s.par[cut, ADHESION_GAP])
    meets = -below < above < tall and under_blade(s, cut, at[0])
    if ti.static(s.stone):  # a stone meets the blade as a whole (mpm.kernels.stone)
        meets = meets and s.adhering[cut, p] != IN_STONE
    if meets:
        sign = 1.0 if particle_half(s, cut, p) == 1 else -1.0
        gap, high = s.tool_gap[cut, p], s.par[cut, SPACING] * s.face_rise[cut, p]
        press, normal, turned, middle, pressed = press_face(s, cut, p, sign, high, at)
        size, facing = press, normal
        pulled, twisted = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        if s.adhering[cut, p] >= 0:
            pull, place = 0.0, 0.0
            pull, pulled, twisted, place = stick_face(s, cut, p, sign, high, pressed, at)
            if pull > 0:
                size = press + pull
                middle = (press * middle + pull * place) / size
                facing = normal + pulled
                normal -= pulled
                turned -= twisted
        if size > 0:
            touching = press > 0  # what is held only by its pull does not rub
            n = (1 / size) * facing
            n *= 1 / n.norm()
            own = surface_traction(s, cut, p, s.surface_volume[cut, p][1], gap, n)
            most = friction_limit(s, cut, p, press, own.dot(n))
            own -= own.dot(n) * n
            arm = middle * high - gap * n
            blade = blade_velocity(s, cut, at[0] + arm[0], at[2] + arm[2])
            slide = u + arm[2] * up + arm[1] * across - blade
            slide -= slide.dot(n) * n
            stick = s.stick[cut, 1, p] - s.stick[cut, 1, p].dot(n) * n
            hold = stick_slip(stick, dt * slide, own, most)
            s.stick[cut, 1, p] = own - hold
            scale = s.par[cut, CONTACT] * dt
            normal *= scale
            turned *= scale
            hold *= scale
            dv = normal + hold
            lift = high[2] * turned + arm[2] * hold
            wide = high[1] * turned + arm[1] * hold
            wide[1] -= gap * sign * normal[1]  # the opening is taken from the face, which stretches with the particle
            book_knife_impulse(s, cut, FACE, -m * dv, at[0] + arm[0], at[2] + arm[2])
            s.sums[cut, FRICTION_WORK] -= m * hold.dot(slide)
            if s.adhering[cut, p] > 0:
                opens = pulled.dot(u - blade) - gap * sign * pulled[1] * across[1]
                opens += twisted.dot(high[2] * up + high[1] * across)
                s.sums[cut, ADHESION_WORK] += m * scale * opens
    if not touching:
        s.stick[cut, 1, p] = ti.Vector.zero(float, 3)
    return dv, lift, wide


@ti.func
def press_face(s: ti.template(), cut, p, sign, high, at):
    """Normal force of the blade on the face of a particle.

    A particle meets the blade with a face. The face lies as far from its centre as the centre was from the cut plane
    when the food was whole, so that the blade displaces the food by its true half thickness. It is as high as the
    particle is in the food, but never higher than at rest, and turns with it. Each of its points
    (:data:`mpm.state.state.FACE_POINTS`) feels the blade's profile, so a face passes a shoulder point by point. With
    one point a whole row of particles would let go at once of all that the wedge had given it.

    The force of a point is the gradient of its opening, in the particle's place and in its stretch: what passes the
    shoulder gives back what it was pressed with.

    Args:
        p: The particle.
        sign: 1 for the half at +y, else -1.
        high: Way along the face from its lower end to its upper [m].
        at: Position of its centre [m].

    Returns:
        Over the contact's stiffness: size of the force, summed over the points [m]; the force [m]; its moment along the
        face over the face's height [m]. Place of its middle along the face, from -1/2 to 1/2. Which points are pressed,
        a bit each.
    """
    cos_t, sin_t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
    gap, shell = s.tool_gap[cut, p], s.surface_volume[cut, p][1]
    y, wide = sign * at[1] - gap, sign * high[1]
    above, rise = (at[2] - edge_height(s, cut, at[0])) * cos_t, high[2] * cos_t - high[0] * sin_t
    press, middle, pressed = 0.0, 0.0, 0
    normal, turned = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    # an end that LLVM can't know keeps the points one by one, so that every kernel adds them in the same order
    for q in range(ti.min(FACE_POINTS, s.size[cut, COUNT])):
        part = (q + 0.5) / FACE_POINTS - 0.5
        opening, n = blade_opening(s, cut, y + part * wide, above + part * rise)
        n = ti.Vector([-sin_t * n[2], sign * n[1], cos_t * n[2]])
        force = (surface_traction(s, cut, p, shell, gap, n).dot(n) - opening) / FACE_POINTS
        if force > 0:
            press += force
            middle += part * force
            normal += force * n
            turned += part * force * n
            pressed |= 1 << q
    if press > 0:
        middle /= press
    return press, normal, turned, middle, pressed


@ti.func
def press_contact(s: ti.template(), cut, p, m, dt, u, at):
    """Contact of one particle with a plate or wedge that presses from above; returns the change of its velocity [m/s].

    Args:
        p: The particle.
        m: Its mass, mirror images included [kg].
        dt: Time step [s].
        u: Velocity of the food's surface above it [m/s].
        at: Position of that surface [m].
    """
    sign = 1.0 if at[1] >= 0 else -1.0
    above = at[2] - ti.cast(s.pose[cut, EDGE_Z], float)
    d, n = blade_distance(
        sign * at[1], above, s.par[cut, SPINE], s.par[cut, WEDGE_COS], s.par[cut, WEDGE_SIN], s.par[cut, TIP_RADIUS]
    )
    n = ti.Vector([0.0, sign * n[1], n[2]])
    own = surface_traction(s, cut, p, s.surface_volume[cut, p][1], s.tool_gap[cut, p], n)
    force = own.dot(n) - d
    normal = own.dot(n)
    own -= normal * n
    dv = ti.Vector.zero(float, 3)
    if force > 0:
        tool = ti.Vector([ti.cast(s.pose[cut, EDGE_VS], float), 0.0, ti.cast(s.pose[cut, EDGE_VZ], float)])
        stick = s.stick[cut, 1, p] - s.stick[cut, 1, p].dot(n) * n
        slide = u - tool
        slide -= slide.dot(n) * n
        hold = stick_slip(stick, dt * slide, own, friction_limit(s, cut, p, force, normal))
        s.stick[cut, 1, p] = own - hold
        dv = s.par[cut, CONTACT] * dt * (force * n + hold)
        book_impulse(s, cut, FACE, -m * dv)
        s.sums[cut, FRICTION_WORK] -= m * dv.dot(slide)
    else:
        s.stick[cut, 1, p] = ti.Vector.zero(float, 3)
    return dv
