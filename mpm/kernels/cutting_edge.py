"""The cutting edge: a line that moves through the grid, slice by slice along the blade, and its reaction there."""

import math

import taichi as ti

from mpm.kernels.cohesive_law import count_started_beside, line_force
from mpm.kernels.tool import blade_velocity, book_knife_impulse, covered_part, edge_height
from mpm.state.accessors import multiplicity_x, step_size, to_grid_axes, to_scene_axes
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import SLICES
from mpm.state.stencil import bspline, has_second_field, node_index, node_position
from mpm.state.tables import (
    CUTTING_WORK,
    DENT_WIDTH,
    DX,
    EDGE,
    FIRST_STATION,
    INV_DX,
    LAYERED,
    MIRROR_SUM,
    NODES,
    ORIGIN_X,
    ORIGIN_Y,
    ORIGIN_Z,
    SECOND_OFFSET,
    SLIP,
    SPACING,
    TILT_COS,
    TILT_SIN,
    WIDTH_OF_FORCE,
    ZONE,
    ZONE_MASS,
    ZONE_MOST,
)

# Kernel mass of the process zone of an edge that touches a flat surface, over rho dx zone^2 (exact: the zone is centred
# half a zone below the edge).
SURFACE_FILL = 5 / 6
# What material sinks less over another width than over the zone that bears a line force, of what it sinks less per
# e-fold: logarithm of the root mean square distance between load and point. A zone has a variance of width^2 / 4 along
# both axes and is centred half its width below the edge.
LESS_OVER_TWICE = 0.5 * math.log((1 + 2**2) / 2 + (2 - 1) ** 2 / 4)
LESS_OVER_HALF = 0.5 * math.log((1 + 0.5**2) / 2 + (0.5 - 1) ** 2 / 4)
EMPTY_ZONE = 0.15  # filled less than this the zone carries no edge; at the board it is still filled to 0.2


@ti.func
def apply_edge_law(s: ti.template(), cut: ti.template()):
    """Find the edge's reaction on every slice, and give it to the grid."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SLICES)):
        c, i, mine = locate_active(s, cut, q, SLICES)
        if mine:
            count_started_beside(s, c, i)
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SLICES)):
        c, i, mine = locate_active(s, cut, q, SLICES)
        if mine and i >= s.plane_x:
            find_reaction(s, c, i, step_size(s, c))
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SLICES)):
        c, i, mine = locate_active(s, cut, q, SLICES)
        if mine and i >= s.plane_x:
            apply_reaction(s, c, i)


@ti.func
def follow_slices(s: ti.template(), cut: ti.template()):
    """See how the material moves about every slice, after the edge's reaction and what else acts on the grid."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SLICES)):
        c, i, mine = locate_active(s, cut, q, SLICES)
        if mine and i >= s.plane_x:
            follow_material(s, c, i)


@ti.func
def find_reaction(s: ti.template(), cut, i, dt):
    """Find the edge's reaction on slice i in this step, as a change of velocity."""
    s.reaction[cut, i], s.front_drift[cut, i] = ti.Vector.zero(float, 2), 0.0
    place = s.par[cut, FIRST_STATION] + i * s.par[cut, DX]
    tip = edge_height(s, cut, place)
    over = covered_part(s, cut, place)
    mass = zone_momentum(s, cut, i, s.zone[cut, i])[3] * ti.static(2.0 if s.mirror_y else 1.0)
    # the zone reaches below the edge and beside the food, so the width that is cut is that of the outline
    begun = ti.math.clamp((s.top_high[cut, i] - tip) / (s.top_high[cut, i] - s.top_low[cut, i]), 0.0, 1.0)
    ended = ti.math.clamp((s.floor_high[cut, i] - tip) / (s.floor_high[cut, i] - s.floor_low[cut, i]), 0.0, 1.0)
    part = begun - ended
    if s.par[cut, LAYERED] > 0:
        part = begun ** s.top_power[cut, i] - ended ** s.floor_power[cut, i]
    width = s.par[cut, DX] * s.width[cut, i] * part
    if ti.static(s.hollow):
        if s.start_force[cut, i] > 0:
            width = ti.cast(part > 0, float) * tied_width(s, cut, i)
    full = SURFACE_FILL * s.par[cut, ZONE_MASS] * (s.zone[cut, i] / s.par[cut, ZONE]) ** 2 * width * s.par[cut, INV_DX]
    if width > 0 and mass > EMPTY_ZONE * full:
        c, t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
        mean, blade = s.zone_velocity[cut, i], blade_velocity(s, cut, place, tip)
        if over > 0 and tip <= s.crack_front[cut, i] + s.par[cut, SLIP]:
            slide, fall = (blade[0] - mean[0]) * dt, (mean[2] - blade[2]) * dt
            line = line_force(s, cut, i, c * slide - t * fall, c * fall + t * slide, part)
            along, down = c * line[0] + t * line[1], c * line[1] - t * line[0]
            impulse = ti.Vector([along, -down]) * width / c * over * dt
            s.reaction[cut, i] = impulse / mass
            book_knife_impulse(
                s, cut, EDGE, -multiplicity_x(s, cut, i) * ti.Vector([impulse[0], 0.0, impulse[1]]), place, tip
            )
            s.sums[cut, CUTTING_WORK] += multiplicity_x(s, cut, i) * (impulse[0] * slide - impulse[1] * fall) / dt
        else:
            s.slip[cut, i], s.line[cut, i] = ti.Vector.zero(float, 2), 0.0
            if s.crack_front[cut, i] < 1e2:  # the blade has gone: the front stays in the material
                s.front_drift[cut, i] = mean[2] * dt
    else:
        s.slip[cut, i], s.line[cut, i] = ti.Vector.zero(float, 2), 0.0


@ti.func
def tied_width(s: ti.template(), cut, i):
    """Width of flesh in slice i that the edge is cutting, by the ties within a spacing of it [m].

    Each of them stands for its part of the section, so a slice that lies half in a stone or a cavity has half of its
    width, and what is cut in all is the flesh's area, wherever that has moved.
    """
    many = 2.0 / multiplicity_x(s, cut, i) if ti.static(s.mirror_x) else 1.0  # half of the middle one is modelled
    return many * s.at_edge[cut, i][2] * s.par[cut, SPACING]


@ti.func
def apply_reaction(s: ti.template(), cut, i):
    """Give the grid the reaction of slice i."""
    if s.reaction[cut, i].norm_sqr() > 0:
        box = zone_nodes(s, cut, i, s.zone[cut, i])
        dv = to_grid_axes(s, cut, ti.Vector([s.reaction[cut, i][0], 0.0, s.reaction[cut, i][1]]))
        for a in range(box[0], box[3]):
            for j in range(box[1], box[4]):
                for k in range(box[2], box[5]):
                    w = zone_weight(s, cut, i, s.zone[cut, i], a, j, k)
                    if w > 0:
                        add_velocity(s, cut, a, j, k, w * dv)
                        if ti.static(s.mirror_x):
                            image = s.size[cut, MIRROR_SUM] - a
                            if a > image >= 0:
                                add_velocity(s, cut, image, j, k, w * ti.Vector([-dv[0], dv[1], dv[2]]))


@ti.func
def follow_material(s: ti.template(), cut, i):
    """Mean velocity of the process zone of slice i after the edge's reaction.

    The slip of the next step is counted against it. Counted against the velocity before the reaction, the slip would
    run ahead by force x dt / mass in every step, and the edge would do work on the food that nobody did on the edge.
    The zone has the width of the next step, for which the mean is.
    """
    s.zone[cut, i] = ti.math.clamp(s.line[cut, i] * s.par[cut, WIDTH_OF_FORCE], s.par[cut, ZONE], s.par[cut, ZONE_MOST])
    s.zone_velocity[cut, i] = mean_velocity(s, cut, zone_momentum(s, cut, i, s.zone[cut, i]))
    if s.start_force[cut, i] <= 0 and s.par[cut, ZONE] != s.par[cut, DENT_WIDTH]:
        follow_dent_over_width(s, cut, i)


@ti.func
def follow_dent_over_width(s: ti.template(), cut, i):
    """How much less the material at slice i goes with the edge per e-fold of the width of its process zone.

    A line force sinks the less the wider the strip that bears it, by the logarithm of the width. How much that is in
    this food, with its layers and its flow, is seen from a zone of twice the width, or of half where twice is too much
    for the food.
    """
    if s.line[cut, i] > 0:
        zone = s.zone[cut, i]
        other, less = 2.0 * zone, LESS_OVER_TWICE
        if other > s.par[cut, ZONE_MOST]:
            other, less = 0.5 * zone, LESS_OVER_HALF
        apart = s.zone_velocity[cut, i] - mean_velocity(s, cut, zone_momentum(s, cut, i, other))
        c, t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
        s.dent_over_width[cut, i] += (t * apart[0] - c * apart[2]) * step_size(s, cut) / less
    else:
        s.dent_over_width[cut, i] = 0.0


@ti.func
def mean_velocity(s: ti.template(), cut, total):
    """Velocity of a momentum and mass, in the scene's axes [m/s]; 0 where there is no mass."""
    v = ti.Vector.zero(float, 3)
    if total[3] > 0:
        v = to_scene_axes(s, cut, ti.Vector([total[0], total[1], total[2]]) / total[3])
    return v


@ti.func
def zone_momentum(s: ti.template(), cut, i, zone):
    """Momentum and mass of the nodes that slice i feels through a process zone of this width."""
    box = zone_nodes(s, cut, i, zone)
    total = ti.Vector.zero(float, 4)
    for a in range(box[0], box[3]):
        for j in range(box[1], box[4]):
            for k in range(box[2], box[5]):
                total += zone_weight(s, cut, i, zone, a, j, k) * node_momentum(s, cut, a, j, k)
    return total


@ti.func
def zone_nodes(s: ti.template(), cut, i, zone):
    """Nodes that slice i feels through a process zone of this width, as the corners (low 3, high 3) of a box."""
    reach = 1.5 * zone
    place = s.par[cut, FIRST_STATION] + i * s.par[cut, DX]
    mid = to_grid_axes(s, cut, ti.Vector([place, 0.0, s.crack_front[cut, i] - 0.5 * zone]))
    wide, deep = 0.0, reach
    if ti.static(s.turned):
        e = ti.abs(to_grid_axes(s, cut, ti.Vector([s.par[cut, DX], 0.0, 0.0])))
        f = ti.abs(to_grid_axes(s, cut, ti.Vector([0.0, reach, 0.0])))
        wide, deep = e[0] + f[0], e[1] + f[1]
    r = (mid - ti.Vector([s.par[cut, ORIGIN_X], s.par[cut, ORIGIN_Y], s.par[cut, ORIGIN_Z]])) * s.par[cut, INV_DX]
    h = ti.Vector([wide + 1e-6 * s.par[cut, DX], deep, reach]) * s.par[cut, INV_DX]
    out = ti.Vector([0, 0, 0, 0, 0, 0])
    for d in ti.static(range(3)):
        out[d] = ti.max(0, ti.ceil(r[d] - h[d], ti.i32))
        out[d + 3] = ti.min(s.size[cut, NODES + d], ti.floor(r[d] + h[d], ti.i32) + 1)
    return out


@ti.func
def zone_weight(s: ti.template(), cut, i, zone, a, j, k):
    """Weight of node (a, j, k) in a process zone of slice i, which is centred half its width below the edge."""
    at = to_scene_axes(s, cut, node_position(s, cut, a, j, k))
    w = bspline(at[1] / zone) * bspline((at[2] - s.crack_front[cut, i]) / zone + 0.5)
    if ti.static(s.turned):
        w *= ti.max(0.0, 1.0 - ti.abs(at[0] - s.par[cut, FIRST_STATION] - i * s.par[cut, DX]) * s.par[cut, INV_DX])
    return w


@ti.func
def node_momentum(s: ti.template(), cut, a, j, k):
    """Momentum and mass of both fields of a node."""
    q = s.u[node_index(s, cut, a, j, k)]
    out = q[3] * ti.Vector([q[0], q[1], q[2], 1.0])
    if ti.static(s.second_fields):
        if has_second_field(s, cut, j):
            other = s.u[node_index(s, cut, a, s.size[cut, SECOND_OFFSET] + j, k)]
            out += other[3] * ti.Vector([other[0], other[1], other[2], 1.0])
    return out


@ti.func
def add_velocity(s: ti.template(), cut, a, j, k, dv):
    """Change the velocity of both fields of a node."""
    for d in ti.static(range(3)):
        s.u[node_index(s, cut, a, j, k)][d] += dv[d]
    if ti.static(s.second_fields):
        if has_second_field(s, cut, j):
            for d in ti.static(range(3)):
                s.u[node_index(s, cut, a, s.size[cut, SECOND_OFFSET] + j, k)][d] += dv[d]
