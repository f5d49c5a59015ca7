"""Ties across the cut plane: what holds the two halves of the food together, and what of it the edge has to pay.

The law of a cohesive crack. The cut plane is parted from the beginning. Each pair of particles that face each other
across it is held by a tie, as stiff as the contact of surfaces, whose tension is capped by a softening envelope: the
food's own law of fracture, whoever loads it (docs/theory.md, "A crack with a law").

A tie joins the two faces of its particles at :data:`mpm.state.state.FACE_POINTS` points, one above another. Each opens
by itself and is cut by itself. So the edge can cut a quarter of a row of particles at a time: what is held above it is
opened by the blade, and a thin blade rubs many times as hard for it.
"""

import taichi as ti

from mpm.kernels.constitutive.laws import damage_of, degrade, full, left_cauchy_green, left_stretch, unit
from mpm.kernels.crack import IN_CONTACT
from mpm.kernels.signed_distance import passed_part
from mpm.kernels.tool import edge_height, under_blade
from mpm.state.accessors import deformation_gradient, step_size, to_grid_axes, to_scene_axes, velocity_gradient
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import FACE_POINTS, SLICES, TIES
from mpm.state.tables import (
    BLADE_HEIGHT,
    CONTACT,
    COUNT,
    DX,
    EDGE_BAND,
    EPS0,
    EPSF,
    FIRST_STATION,
    INV_DX,
    LAM,
    LAYERED,
    MASS,
    MIRROR_SUM,
    MU,
    SPACING,
    STATIONS,
    TIE_OPENING,
    TIE_WORK,
)


@ti.func
def softened_tension(opening, end):
    """Tension of a tie over its strength [-]: it falls in a line to nothing.

    Args:
        opening: Largest half opening so far [m].
        end: Half opening at which nothing holds any more [m].
    """
    return ti.max(0.0, 1.0 - opening / end)


@ti.func
def work_spent(opening, end):
    """Part of its toughness that a tie has taken [-]: the area under :func:`softened_tension`.

    Args:
        opening: Largest half opening so far [m].
        end: Half opening at which nothing holds any more [m].
    """
    r = ti.min(opening / end, 1.0)
    return r * (2.0 - r)


@ti.func
def passing_weight(height):
    """Weight with which the edge pays for a tie [-], a hat; ``height``: of the tie over the hat's middle [hats]."""
    return ti.max(0.0, 1.0 - ti.abs(height))


@ti.func
def hold_together(s: ti.template(), cut: ti.template()):
    """Let all ties across the cut plane pull, and see what they leave to the edge in the next step."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SLICES)):
        c, i, mine = locate_active(s, cut, q, SLICES)
        if mine:
            s.passing[c, i] = ti.Vector.zero(float, 3)
            s.at_edge[c, i] = ti.Vector.zero(float, 3)
    for q in range(repetitions(s, cut, TIES)):
        c, n, mine = locate_active(s, cut, q, TIES)
        if mine:
            pull_tie(s, c, n, step_size(s, c))


@ti.func
def pull_tie(s: ti.template(), cut, n, dt):
    """One tie after the particles have moved: what the edge has cut of it, its pull, and what is left of it to cut.

    The pull is the food's own traction and, for what is missing, a stiff spring on the half opening, as of the contact
    (Nitsche). Its moments along the faces are given to the particles, as those of the blade's contact are.
    """
    p, other = s.tie_ends[cut, n][0], s.tie_ends[cut, n][1]
    at = to_scene_axes(s, cut, s.x[cut, p])
    own = plane_traction(s, cut, p)
    skin = ti.Vector.zero(float, 3)
    if ti.static(s.membrane):
        skin = s.skin_pull[cut, n]
        s.skin_pull[cut, n] = ti.Vector.zero(float, 3)
    jump = ti.Vector([0.0, -at[1] - s.tool_gap[cut, p], 0.0])  # half of it, between the middles of the faces
    high = s.par[cut, SPACING] * s.face_rise[cut, p]  # way along the face from its lower end to its upper
    far, tilt = high, ti.Vector([0.0, -high[1], 0.0])  # what the jump at the upper end is more than at the lower
    if ti.static(s.mirror_y):
        own[0], own[2], skin[0], skin[2] = 0.0, 0.0, 0.0, 0.0
    else:
        there, far = to_scene_axes(s, cut, s.x[cut, other]), s.par[cut, SPACING] * s.face_rise[cut, other]
        own = 0.5 * (own + plane_traction(s, cut, other))
        y = to_grid_axes(s, cut, ti.Vector([0.0, 1.0, 0.0]))
        shear = s.tool_gap[cut, p] * to_scene_axes(s, cut, velocity_gradient(s, cut, p) @ y)
        shear += s.tool_gap[cut, other] * to_scene_axes(s, cut, velocity_gradient(s, cut, other) @ y)
        s.face_shear[cut, n] -= 0.5 * dt * ti.Vector([shear[0], shear[2]])
        jump = 0.5 * (there - at)
        jump[1] -= 0.5 * (s.tool_gap[cut, p] + s.tool_gap[cut, other])
        jump[0] += s.face_shear[cut, n][0]
        jump[2] += s.face_shear[cut, n][1]
        at = 0.5 * (at + there)
        tilt = 0.5 * (far - high)
    whole, turned = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    # an end that LLVM can't know keeps the points one by one, so that every kernel adds them in the same order
    for q in range(ti.min(FACE_POINTS, s.size[cut, COUNT])):
        part = (q + 0.5) / FACE_POINTS - 0.5
        dv = pull_point(s, cut, n, q, at + 0.5 * part * (high + far), own + skin, jump + part * tilt, dt) / FACE_POINTS
        whole += dv
        turned += part * dv
    if whole.norm_sqr() + turned.norm_sqr() > 0:
        push_face(s, cut, p, s.tool_gap[cut, p], whole, high, turned)
        if ti.static(not s.mirror_y):
            push_face(s, cut, other, -s.tool_gap[cut, other], -whole, far, -turned)
    tip = edge_height(s, cut, at[0])
    if ti.static(s.hollow):
        weight = passing_weight((at[2] - tip) / s.par[cut, SPACING])
        s.at_edge[cut, slice_of(s, cut, at[0])][2] += s.tie_share[cut, n] * weight
    if s.par[cut, LAYERED] > 0:
        count_rows(s, cut, n, at, tip)


@ti.func
def pull_point(s: ti.template(), cut, n, q, at, own, jump, dt):
    """One point of a tie: what the edge cuts of it, and what it pulls.

    It does not hold through the blade. Where the cut has not started yet, an edge that is withdrawn leaves it whole;
    else it is cut. A point that held there would press the faces together on the blade, with forces that depend on how
    stiff contact and ties are.

    The tension, and the shear where there are two halves, is capped together by the envelope of the largest half
    opening so far. It is unloaded along the tie's own stiffness; pressed it is a contact.

    Args:
        n: The tie.
        q: Its point.
        at: Where the point is [m].
        own: Force of the food's own traction and of the skin on the whole face [N].
        jump: Half of what the faces have moved apart there [m].
        dt: Time step [s].

    Returns:
        Change of velocity of the left particle if the whole face were pulled so [m/s].
    """
    p, end, band = s.tie_ends[cut, n][0], s.par[cut, TIE_OPENING], s.par[cut, EDGE_BAND]
    above = (at[2] - edge_height(s, cut, at[0])) * s.par[cut, INV_DX]
    between, passed = False, 0.0  # the blade
    if under_blade(s, cut, at[0]) and above * s.par[cut, DX] < s.par[cut, BLADE_HEIGHT]:
        passed = passed_part(above / band)
        if cut_has_started(s, cut, at[0]):
            s.cut_part[cut, n, q] = ti.max(s.cut_part[cut, n, q], passed)
        between = above > 0
    left = 1.0 - ti.max(s.cut_part[cut, n, q], passed)
    m, tough = s.par[cut, MASS] * s.volume_ratio[cut, p], s.tie_toughness[cut, n]
    stiff = s.par[cut, CONTACT] * m
    force = own + stiff * jump
    pressed = ti.min(force[1], 0.0)
    dv = ti.Vector.zero(float, 3)
    if left > 0 or (pressed < 0 and not between):
        opening = ti.sqrt(ti.max(jump[1], 0.0) ** 2 + jump[0] ** 2 + jump[2] ** 2)
        largest = s.largest_opening[cut, n, q]
        area = s.par[cut, SPACING] ** 2
        most = tough / end * area * softened_tension(largest, end) - 0.5 * stiff * ti.max(0.0, largest - opening)
        force[1] -= pressed
        size = force.norm()
        if size > ti.max(most, 0.0):
            force *= ti.max(most, 0.0) / size
            if opening > largest:
                s.largest_opening[cut, n, q] = opening
                work = left * area / FACE_POINTS * tough * (work_spent(opening, end) - work_spent(largest, end))
                s.sums[cut, TIE_WORK] += ti.static(2.0 if s.mirror_x else 1.0) * work
        dv = left * dt / m * force
        if not between:
            dv[1] += dt / m * pressed
    weight = passing_weight(above / band) / FACE_POINTS
    if weight > 0:
        rest = tough * (1.0 - work_spent(s.largest_opening[cut, n, q], end)) if left > 0 else 0.0
        charge_edge(s, cut, at[0], weight * ti.Vector([rest, tough, 1.0]))
    return dv


@ti.func
def plane_traction(s: ti.template(), cut, p):
    """Force of the food's own stress on the face of a particle beside the cut plane, whose normal is +y, in the scene's
    axes [N]."""
    t = elastic_stress(s, cut, p)
    out = to_scene_axes(s, cut, full(t) @ to_grid_axes(s, cut, ti.Vector([0.0, 1.0, 0.0])))
    return out * (s.surface_volume[cut, p][1] / s.tool_gap[cut, p])


@ti.func
def elastic_stress(s: ti.template(), cut, p):
    """Kirchhoff stress of a particle without its viscous part [Pa], xx, yy, zz, yz, xz, xy.

    A tie that answered the viscous stress of the last step would drive the faces, once the loss factor is large and the
    cells are small, and make energy.
    """
    block = p // s.lanes
    lane = p - block * s.lanes
    t = ti.Vector([s.tau[cut, block, r][lane] for r in range(6)])
    if ti.static(s.branches == 0):
        f = deformation_gradient(s, cut, p)
        j, b = f.determinant(), left_cauchy_green(f)
        if j > 0:
            t = 2 * s.par[cut, MU] * (b - left_stretch(b, j)) + s.par[cut, LAM] * j * (j - 1) * unit()
            if ti.static(s.damage):
                t = degrade(t, damage_of(s.kappa[cut, p], s.par[cut, EPS0], s.par[cut, EPSF]))
    return t


@ti.func
def push_face(s: ti.template(), cut, p, arm, dv, high, turned):
    """Change the velocity of a particle by impulses that act on its face.

    Args:
        p: The particle.
        arm: Place of the face across the blade from its centre [m].
        dv: Change of its velocity, in the scene's axes [m/s].
        high: Way along the face from its lower end to its upper [m].
        turned: Sum of the impulses' parts of ``dv``, each times its place along the face from -1/2 to 1/2 [m/s].
    """
    kick, twist, before = to_grid_axes(s, cut, dv), to_grid_axes(s, cut, turned), s.v[cut, p]
    if not s.visibility[cut, p] & IN_CONTACT:
        s.visibility[cut, p] |= IN_CONTACT
        s.contact_moment[cut, p, 0] = ti.Vector.zero(float, 4)
        s.contact_moment[cut, p, 1] = ti.Vector.zero(float, 4)
    scale = 4 * s.par[cut, INV_DX] * s.par[cut, INV_DX]
    lift, wide = scale * high[2] * twist, scale * (arm * kick + high[1] * twist)
    given = 0.5 * ((before + kick).norm_sqr() - before.norm_sqr())
    s.contact_moment[cut, p, 0] += ti.Vector([lift[0], lift[1], lift[2], given])
    s.contact_moment[cut, p, 1] += ti.Vector([wide[0], wide[1], wide[2], 0.0])
    s.v[cut, p] = before + kick


@ti.func
def cut_has_started(s: ti.template(), cut, place):
    """Whether the cut has started at a place along the edge: before that the edge only dents the food."""
    return s.start_force[cut, slice_of(s, cut, place)] > 0


@ti.func
def slice_of(s: ti.template(), cut, place):
    """The slice that a place along the edge lies in, or its mirror image."""
    i = ti.floor((place - s.par[cut, FIRST_STATION]) * s.par[cut, INV_DX] + 0.5, ti.i32)
    return ti.math.clamp(i, s.first_slice, s.size[cut, STATIONS] - 1)


@ti.func
def charge_edge(s: ti.template(), cut, place, sums):
    """Share what the edge passes at a place along the cut among the two slices beside it, or their mirror images."""
    r = (place - s.par[cut, FIRST_STATION]) * s.par[cut, INV_DX]
    low = ti.math.clamp(ti.floor(r, ti.i32), 0, s.size[cut, STATIONS] - 2)
    t = ti.math.clamp(r - low, 0.0, 1.0)
    for d in ti.static(range(2)):
        i = low + d
        if ti.static(s.mirror_x):
            i = ti.max(i, s.size[cut, MIRROR_SUM] - i)
        s.passing[cut, i] += (t if ti.static(d == 1) else 1.0 - t) * sums


@ti.func
def count_rows(s: ti.template(), cut, n, at, tip):
    """Count the toughness of the rows of a tie that the edge is in, for the slice it lies in or its mirror image.

    A row as high as a part of the tie's spacing has a toughness of its own, so that a layer thinner than a cell is
    there at its place and not in a mean over the ties about the edge. Between the middles of two rows the edge pays
    for both, in proportion. A row on the outline counts by its share; neighbouring slices have no part of it, as on
    the flank of a round food they may be of another layer.

    Args:
        n: The tie.
        at: Where it is [m].
        tip: Height of the edge there [m].
    """
    above = (tip - at[2]) / s.par[cut, SPACING] * s.rows + 0.5 * s.rows  # the tie's lower end [rows]
    if -1.0 < above < s.rows + 1.0:
        i = slice_of(s, cut, at[0])
        for k in range(s.rows):
            weight = s.row_share[cut, n, k] * passing_weight(above - k - 0.5)
            s.at_edge[cut, i] += weight * ti.Vector([s.row_toughness[cut, n, k], 1.0, 0.0])
