"""The rigid motion of a stone: the nodes that lie in it get the velocity that conserves their momentum.

The velocities of those nodes are projected on the six rigid motions, in the norm of the nodes' mass. So momentum and
moment of momentum are what they were, the stone is rigid whatever is in it, and flesh clings to it. Where the stone is
of one half of the food, the flesh of the other one only leans on it.
"""

import taichi as ti

from mpm.kernels.crack import node_half
from mpm.kernels.stone.blade_contact import stop_blade
from mpm.kernels.stone.pose import clings, from_stone, leans, move_on, row_near_stone, set_motion, stone_vector
from mpm.state.accessors import multiplicity_x, step_size, to_grid_axes, to_scene_axes
from mpm.state.loops import locate_active, node_row, repetitions
from mpm.state.state import CUTS, NODE_ROWS
from mpm.state.stencil import has_second_field, node_index, node_position
from mpm.state.tables import (
    N_STONE_SUMS,
    NODES_INERTIA,
    NODES_MASS,
    NODES_MOMENT,
    NODES_MOMENTUM,
    NODES_SPIN,
    SECOND_OFFSET,
    STONE_ALONE,
    STONE_SPIN,
    STONE_VELOCITY,
)


@ti.func
def move_stone(s: ti.template(), cut: ti.template()):
    """Give the nodes in the stone its rigid motion, after the blade has stopped at it, and move the stone on."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, CUTS)):
        c, _, mine = locate_active(s, cut, q, CUTS)
        if mine:
            for r in range(N_STONE_SUMS):
                s.stone_sums[c, r] = 0.0
    visit_nodes(s, cut, sum_node, False)
    if ti.static(s.cuts and not s.mirror_y):
        ti.loop_config(serialize=s.serial)
        for q in range(repetitions(s, cut, CUTS)):
            c, _, mine = locate_active(s, cut, q, CUTS)
            if mine:
                find_motion_alone(s, c)
        visit_nodes(s, cut, sum_node, True)
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, CUTS)):
        c, _, mine = locate_active(s, cut, q, CUTS)
        if mine:
            find_motion(s, c, step_size(s, c))
    visit_nodes(s, cut, hold_node, True)
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, CUTS)):
        c, _, mine = locate_active(s, cut, q, CUTS)
        if mine:
            move_on(s, c, step_size(s, c))


@ti.func
def visit_nodes(s: ti.template(), cut: ti.template(), do: ti.template(), other: ti.template()):
    """Do something with both fields of each node in the stone, as :func:`sum_node` and :func:`hold_node`.

    Args:
        do: What is done.
        other: Whether it is done where flesh of the other half leans on the stone; to sum that is a loop of its own.
    """
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, NODE_ROWS)):
        c, r, mine = locate_active(s, cut, q, NODE_ROWS)
        if mine:
            i, j, low, high = node_row(s, c, r, NODE_ROWS)
            if row_near_stone(s, c, i, j):
                for k in range(low, high):
                    at, there = from_stone(s, c, i, j, k)
                    if there:
                        do(s, c, i, j, k, at, other)


@ti.func
def sum_node(s: ti.template(), cut, i, j, k, at, other: ti.template()):
    """Add the fields of a node in the stone to the sums from which its motion follows.

    Args:
        at: Place of the node from the stone's middle in the scene's axes [m].
        other: Whether those that lean on the stone are added; else those that cling to it.
    """
    many = multiplicity_x(s, cut, i) * ti.static(2.0 if s.mirror_y else 1.0)
    for f in ti.static(range(2 if s.second_fields else 1)):
        index, own, held = field_of_stone(s, cut, at, i, j, k, f)
        if held > 0 and own == ti.static(0 if other else 1):
            add_field(s, cut, at, many, s.u[index])


@ti.func
def hold_node(s: ti.template(), cut, i, j, k, at, other: ti.template()):
    """Give the fields of a node in the stone the stone's velocity; arguments as those of :func:`sum_node`."""
    if s.stone_sums[cut, NODES_MASS] > 0:
        v = stone_vector(s, cut, STONE_VELOCITY) + stone_vector(s, cut, STONE_SPIN).cross(at)
        v = to_grid_axes(s, cut, v)
        for f in ti.static(range(2 if s.second_fields else 1)):
            index, _, held = field_of_stone(s, cut, at, i, j, k, f)
            if held > 0:
                for d in ti.static(range(3)):
                    s.u[index][d] = v[d]


@ti.func
def field_of_stone(s: ti.template(), cut, at, i, j, k, which: ti.template()):
    """One field of a node in the stone, the first or the second.

    Returns:
        Its index, 1 where its flesh clings to the stone, else 0, and 1 where it clings or leans.
    """
    index, own, held = node_index(s, cut, i, j, k), 1, 1
    if ti.static(which == 1):
        held = ti.cast(has_second_field(s, cut, j), ti.i32)
        if held > 0:
            index = node_index(s, cut, i, s.size[cut, SECOND_OFFSET] + j, k)
    if ti.static(s.cuts and not s.mirror_y):
        half = node_half(s, cut, to_scene_axes(s, cut, node_position(s, cut, i, j, k))[1])
        own = clings(s, cut, 1 - half if ti.static(which == 1) else half)
        if held > 0 and own == 0:
            q = s.u[index]
            held = leans(s, cut, at, to_scene_axes(s, cut, ti.Vector([q[0], q[1], q[2]])))
    return index, own, held


@ti.func
def add_field(s: ti.template(), cut, at, many, q):
    """Add one of the fields of a node.

    Args:
        at: Its place from the stone's middle [m].
        many: Mirror images that it stands for.
        q: Its velocity in the grid's axes [m/s], and its mass [kg].
    """
    m = many * q[3]
    if m > 0:
        p = m * to_scene_axes(s, cut, ti.Vector([q[0], q[1], q[2]]))
        spin, far = at.cross(p), at.norm_sqr()
        s.stone_sums[cut, NODES_MASS] += m
        for d in ti.static(range(3)):
            s.stone_sums[cut, NODES_MOMENTUM + d] += p[d]
            s.stone_sums[cut, NODES_MOMENT + d] += m * at[d]
            s.stone_sums[cut, NODES_SPIN + d] += spin[d]
            s.stone_sums[cut, NODES_INERTIA + d] += m * (far - at[d] * at[d])
        for r, a, b in ti.static(((3, 1, 2), (4, 0, 2), (5, 0, 1))):
            s.stone_sums[cut, NODES_INERTIA + r] -= m * at[a] * at[b]


@ti.func
def body_of_nodes(s: ti.template(), cut):
    """The nodes in the stone as one body, from the sums over them; what mirror images cancel is left out.

    Returns:
        Mass [kg], centre of mass from the stone's middle [m], its velocity [m/s], angular velocity [1/s], and inverse
        of the moments of inertia about it [1/(kg m^2)].
    """
    mass = ti.cast(s.stone_sums[cut, NODES_MASS], float)
    keep, free = ti.Vector([1.0, 1.0, 1.0]), ti.Vector([1.0, 1.0, 1.0])
    if ti.static(s.mirror_x):
        keep[0], free[1], free[2] = 0.0, 0.0, 0.0
    if ti.static(s.mirror_y):
        keep[1], free[0], free[2] = 0.0, 0.0, 0.0
    p, at, spin = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    inertia = ti.Matrix.zero(float, 3, 3)
    for a in ti.static(range(3)):
        p[a] = keep[a] * ti.cast(s.stone_sums[cut, NODES_MOMENTUM + a], float)
        at[a] = keep[a] * ti.cast(s.stone_sums[cut, NODES_MOMENT + a], float) / mass
        spin[a] = free[a] * ti.cast(s.stone_sums[cut, NODES_SPIN + a], float)
        inertia[a, a] = ti.cast(s.stone_sums[cut, NODES_INERTIA + a], float)
    for r, a, b in ti.static(((3, 1, 2), (4, 0, 2), (5, 0, 1))):
        value = keep[a] * keep[b] * ti.cast(s.stone_sums[cut, NODES_INERTIA + r], float)
        inertia[a, b], inertia[b, a] = value, value
    inertia -= mass * (at.norm_sqr() * ti.Matrix.identity(float, 3) - at.outer_product(at))
    inverse = inertia.inverse()
    for a, b in ti.static(ti.ndrange(3, 3)):
        inverse[a, b] *= free[a] * free[b]
    return mass, at, p / mass, inverse @ (spin - at.cross(p)), inverse


@ti.func
def find_motion_alone(s: ti.template(), cut):
    """Motion that the stone would have without the flesh of the other half."""
    velocity, spin = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    if s.stone_sums[cut, NODES_MASS] > 0:
        _mass, at, velocity, spin, _inverse = body_of_nodes(s, cut)
        velocity -= spin.cross(at)
    set_motion(s, cut, STONE_ALONE, velocity, spin)


@ti.func
def find_motion(s: ti.template(), cut, dt):
    """Velocity and angular velocity of the stone in this step."""
    velocity, spin = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    if s.stone_sums[cut, NODES_MASS] > 0:
        mass, at, velocity, spin, inverse = body_of_nodes(s, cut)
        if ti.static(s.cuts):
            velocity, spin = stop_blade(s, cut, mass, inverse, at, velocity, spin, dt)
        velocity -= spin.cross(at)
    set_motion(s, cut, STONE_VELOCITY, velocity, spin)
