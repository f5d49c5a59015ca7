"""Grid update: momentum to velocity at the nodes, mirror images, contact of the two halves, the plain nodal contact."""

import taichi as ti

from mpm.kernels.signed_distance import blade_distance, coulomb
from mpm.kernels.tool import (
    blade_velocity,
    board_height,
    book_impulse,
    book_knife_impulse,
    edge_height,
    under_blade,
)
from mpm.state.accessors import multiplicity, step_size, to_grid_axes, to_scene_axes
from mpm.state.loops import locate_active, node_row, repetitions
from mpm.state.state import NODE_LINES, NODE_ROWS
from mpm.state.stencil import has_second_field, node_index, node_position, thread_node_index
from mpm.state.tables import (
    BLADE_HEIGHT,
    BLADE_MU,
    BOARD,
    BOARD_MU,
    DX,
    FACE,
    GRAVITY,
    MIRROR_SUM,
    PLANE_Y,
    SECOND_OFFSET,
    SPINE,
    TIP_RADIUS,
    WEDGE_COS,
    WEDGE_SIN,
)


@ti.func
def clear_grid(s: ti.template(), cut: ti.template()):
    """Empty the grids of all threads."""
    for q in range(repetitions(s, cut, NODE_ROWS)):
        c, r, mine = locate_active(s, cut, q, NODE_ROWS)
        if mine:
            clear_row(s, c, r)


@ti.func
def clear_row(s: ti.template(), cut, r):
    """Empty the grids of all threads at a row of nodes."""
    i, j, low, high = node_row(s, cut, r, NODE_ROWS)
    for k in range(low, high):
        for thread in ti.static(range(s.threads)):
            s.g[thread_node_index(s, cut, thread, i, j, k)] = ti.Vector.zero(float, 4)
    if ti.static(s.second_fields):
        if has_second_field(s, cut, j):
            for k in range(low, high):
                for thread in ti.static(range(s.threads)):
                    s.g[thread_node_index(s, cut, thread, i, s.size[cut, SECOND_OFFSET] + j, k)] = ti.Vector.zero(
                        float, 4
                    )


@ti.func
def fold_mirror_images(s: ti.template(), cut: ti.template()):
    """Add the mirror images across x = 0 to the nodes."""
    if ti.static(s.threads > 1):
        for q in range(repetitions(s, cut, NODE_ROWS)):
            sum_row(s, cut, q)
    for q in range(repetitions(s, cut, NODE_LINES)):
        c, r, mine = locate_active(s, cut, q, NODE_LINES)
        if mine:
            deep = s.window[c, 5] - s.window[c, 2]
            j, k = s.window[c, 1] + r // deep, s.window[c, 2] + r % deep
            fold_mirror_x(s, c, j, k)
            if ti.static(s.second_fields):
                if has_second_field(s, c, j):
                    fold_mirror_x(s, c, s.size[c, SECOND_OFFSET] + j, k)


@ti.func
def fold_mirror_x(s: ti.template(), cut, j, k):
    """Add the mirror images across x = 0 to one line of nodes."""
    for m in ti.static(range(s.plane_x)):
        add_mirror_image(s, cut, s.size[cut, MIRROR_SUM] - m, m, j, k)
    if s.size[cut, MIRROR_SUM] == 2 * s.plane_x:
        c = 2.0 * s.g[thread_node_index(s, cut, 0, s.plane_x, j, k)]
        c[0] = 0.0
        s.g[thread_node_index(s, cut, 0, s.plane_x, j, k)] = c


@ti.func
def add_mirror_image(s: ti.template(), cut, i, m, j, k):
    """Make node i and its image m across x carry the sum of both."""
    a, b = s.g[thread_node_index(s, cut, 0, i, j, k)], s.g[thread_node_index(s, cut, 0, m, j, k)]
    b[0] = -b[0]
    a += b
    s.g[thread_node_index(s, cut, 0, i, j, k)] = a
    a[0] = -a[0]
    s.g[thread_node_index(s, cut, 0, m, j, k)] = a


@ti.func
def sum_row(s: ti.template(), cut, r):
    """Sum the private grids of all threads at a row of nodes."""
    i, j, low, high = node_row(s, cut, r, NODE_ROWS)
    for k in range(low, high):
        sum_threads(s, cut, i, j, k)
    if ti.static(s.second_fields):
        if has_second_field(s, cut, j):
            for k in range(low, high):
                sum_threads(s, cut, i, s.size[cut, SECOND_OFFSET] + j, k)


@ti.func
def sum_threads(s: ti.template(), cut, i, j, k):
    """Sum the private grids of all threads at one node."""
    q = s.g[thread_node_index(s, cut, 0, i, j, k)]
    for t in ti.static(range(1, s.threads)):
        q += s.g[thread_node_index(s, cut, t, i, j, k)]
    s.g[thread_node_index(s, cut, 0, i, j, k)] = q


@ti.func
def update_grid(s: ti.template(), cut: ti.template()):
    """Momentum to velocity at every node in reach."""
    for q in range(repetitions(s, cut, NODE_ROWS)):
        c, r, mine = locate_active(s, cut, q, NODE_ROWS)
        if mine:
            dt = step_size(s, c)
            i, j, low, high = node_row(s, c, r, NODE_ROWS)
            for k in range(low, high):
                update_node(s, c, i, j, k, dt)


@ti.func
def update_node(s: ti.template(), cut, i, j, k, dt):
    """Momentum to velocity at a node, for the food on its own side and for the severed food of the other side."""
    a, b, masses = both_fields(s, cut, i, j, k)
    fall = ti.Vector([0.0, 0.0, -s.par[cut, GRAVITY] * dt])
    va, vb = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    if a[3] > 0:
        va = ti.Vector([a[0], a[1], a[2]]) / a[3] + fall
        if ti.static(s.nodal):
            va = nodal_contact(s, cut, i, j, k, a, va)
    if ti.static(s.second_fields):
        if b[3] > 0:
            vb = ti.Vector([b[0], b[1], b[2]]) / b[3] + fall
        if has_second_field(s, cut, j):
            # velocity of all that shares the field, mass of what was scattered here
            at = s.size[cut, SECOND_OFFSET] + j
            s.u[node_index(s, cut, i, at, k)] = ti.Vector([vb[0], vb[1], vb[2], masses[1]])
    s.u[node_index(s, cut, i, j, k)] = ti.Vector([va[0], va[1], va[2], masses[0]])


@ti.func
def both_fields(s: ti.template(), cut, i, j, k):
    """Momentum and mass of both fields at a node, with mirror images across y, and their masses without."""
    a, b = scattered(s, cut, i, j, k), ti.Vector.zero(float, 4)
    masses = ti.Vector([a[3], 0.0])
    if ti.static(s.second_fields):
        if has_second_field(s, cut, j):
            second = s.size[cut, SECOND_OFFSET]
            b = scattered(s, cut, i, second + j, k)
            masses[1] = b[3]
            if ti.static(s.mirror_y):
                m = 2 * s.size[cut, PLANE_Y] - j
                if has_second_field(s, cut, m):
                    flip = ti.Vector([1.0, -1.0, 1.0, 1.0])
                    a += flip * scattered(s, cut, i, m, k)
                    if j != s.size[cut, PLANE_Y]:
                        b += flip * scattered(s, cut, i, second + m, k)
    return a, b, masses


@ti.func
def scattered(s: ti.template(), cut, i, j, k):
    """Momentum and mass that all threads have scattered to a node; beside a mirror across x they are summed before."""
    q = s.g[thread_node_index(s, cut, 0, i, j, k)]
    if ti.static(not s.mirror_x):
        for thread in ti.static(range(1, s.threads)):
            q += s.g[thread_node_index(s, cut, thread, i, j, k)]
    return q


@ti.func
def nodal_contact(s: ti.template(), cut, i, j, k, q, u):
    """The plain rule: velocities at nodes inside a tool are projected, with Coulomb friction.

    Args:
        i, j, k: The node.
        q: Its momentum and mass.
        u: Its velocity [m/s].

    Returns:
        Its velocity outside of blade and board [m/s].
    """
    at = to_scene_axes(s, cut, node_position(s, cut, i, j, k))
    u = to_scene_axes(s, cut, u)
    mult = multiplicity(s, cut, i, j)
    for which in ti.static(range(2)):
        d, mu = at[2] - board_height(s, cut, at[1]), s.par[cut, BOARD_MU]
        nrm, vel = ti.Vector([0.0, 0.0, 1.0]), ti.Vector.zero(float, 3)
        if ti.static(which == 1):
            above = at[2] - edge_height(s, cut, at[0])
            d, nrm = blade_distance(
                ti.abs(at[1]),
                above,
                s.par[cut, SPINE],
                s.par[cut, WEDGE_COS],
                s.par[cut, WEDGE_SIN],
                s.par[cut, TIP_RADIUS],
            )
            if ti.abs(at[1]) < 1e-6 * s.par[cut, DX]:  # both faces are equally near: their mean normal is downwards
                nrm = ti.Vector([0.0, 0.0, -1.0])
            elif at[1] < 0:
                nrm[1] = -nrm[1]
            vel = blade_velocity(s, cut, at[0], at[2])
            mu = s.par[cut, BLADE_MU]
            if above < 0 or above > s.par[cut, BLADE_HEIGHT] or not under_blade(s, cut, at[0]):
                d = 1.0
        rel = u - vel
        vn = rel.dot(nrm)
        if d <= 0 and vn < 0:
            t = rel - vn * nrm
            new = vel + t + coulomb(-vn, t, mu)
            if ti.static(which == 1):
                book_knife_impulse(s, cut, FACE, mult * q[3] * (u - new), at[0], at[2])
            else:
                book_impulse(s, cut, BOARD, mult * q[3] * (u - new))
            u = new
    return to_grid_axes(s, cut, u)
