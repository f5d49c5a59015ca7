"""The skin as a membrane: points at the food's surface that bear tension in its plane, without bending or mass.

They move with the grid as the particles do. Each keeps two vectors that lie in the skin; their strain gives a line
force, which the point scatters to the nodes about it as a particle does its stress. What is stretched in one direction
and shortened in the other wrinkles: it bears tension along the first only (tension field: Pipkin 1986, IMA J. Appl.
Math. 36:85).
"""

import taichi as ti

from mpm.kernels.crack import visible_columns
from mpm.kernels.g2p import gather
from mpm.kernels.p2g import scatter_split
from mpm.state.accessors import step_size, to_grid_axes, to_scene_axes
from mpm.state.loops import locate_active, node_box, repetitions
from mpm.state.state import NODE_ROWS, SKIN
from mpm.state.stencil import base_node, bspline_weights, in_window, node_index, thread_node_index
from mpm.state.tables import INV_DX, SKIN_POISSON, SKIN_STIFFNESS


@ti.func
def skin_to_grid(s: ti.template(), cut: ti.template()):
    """Add the momentum that the skin gives to the nodes in this step."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SKIN)):
        c, n, mine = locate_active(s, cut, q, SKIN)
        if mine:
            scatter_tension(s, c, n, step_size(s, c))


@ti.func
def scatter_tension(s: ti.template(), cut, n, dt):
    """Give the nodes about point n its tension."""
    base, fx = base_node(s, cut, s.skin_x[cut, n])
    if in_window(base, node_box(s, cut, NODE_ROWS)) > 0:
        code = visible_columns(s, cut, base, to_scene_axes(s, cut, s.skin_x[cut, n]), s.skin_half[cut, n])
        s.skin_visibility[cut, n] = code
        a, b = s.skin_sides[cut, n, 0], s.skin_sides[cut, n, 1]
        f = line_forces(s, cut, a, b)
        t = f[0] * a.outer_product(a) + f[1] * b.outer_product(b)
        t += f[2] * (a.outer_product(b) + b.outer_product(a))
        if ti.static(s.cuts):
            if s.skin_tie[cut, n] >= 0:
                pull = s.skin_length[cut, n] * (t @ to_grid_axes(s, cut, ti.Vector([0.0, 1.0, 0.0])))
                s.skin_pull[cut, s.skin_tie[cut, n]] += to_scene_axes(s, cut, pull)
        t *= -dt * s.skin_area[cut, n] * 4 * s.par[cut, INV_DX]
        ax = ti.Vector([t[0, 0], t[1, 0], t[2, 0], 0.0])
        ay = ti.Vector([t[0, 1], t[1, 1], t[2, 1], 0.0])
        az = ti.Vector([t[0, 2], t[1, 2], t[2, 2], 0.0])
        corner = -fx[0] * ax - fx[1] * ay - fx[2] * az
        lowest = thread_node_index(s, cut, 0, base[0], base[1], base[2])
        scatter_split(s, cut, lowest, code, bspline_weights(fx), corner, ax, ay, az)


@ti.func
def grid_to_skin(s: ti.template(), cut: ti.template()):
    """Move the skin with the grid."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SKIN)):
        c, n, mine = locate_active(s, cut, q, SKIN)
        if mine:
            move_point(s, c, n, step_size(s, c))


@ti.func
def move_point(s: ti.template(), cut, n, dt):
    """Move point n of the skin, and stretch and turn its two vectors."""
    base, fx = base_node(s, cut, s.skin_x[cut, n])
    if in_window(base, node_box(s, cut, NODE_ROWS)) > 0:
        code, lowest = s.skin_visibility[cut, n], node_index(s, cut, base[0], base[1], base[2])
        u, cx, cy, cz = gather(s, cut, lowest, code, bspline_weights(fx))
        slope = 4 * s.par[cut, INV_DX]
        cx, cy, cz = slope * (cx - fx[0] * u), slope * (cy - fx[1] * u), slope * (cz - fx[2] * u)
        for k in ti.static(range(2)):
            side = s.skin_sides[cut, n, k]
            rate = side[0] * cx + side[1] * cy + side[2] * cz
            s.skin_sides[cut, n, k] = side + dt * ti.Vector([rate[0], rate[1], rate[2]])
        s.skin_x[cut, n] += dt * ti.Vector([u[0], u[1], u[2]])


@ti.func
def principal_strains(a, b):
    """Green strain of a skin with the vectors a and b, of unit length and at right angles at first.

    Returns:
        Largest and least principal strain [-], and cosine and sine of twice the angle from a to the first.
    """
    x, y, xy = 0.5 * (a.norm_sqr() - 1.0), 0.5 * (b.norm_sqr() - 1.0), 0.5 * a.dot(b)
    middle, half = 0.5 * (x + y), 0.5 * (x - y)
    radius = ti.sqrt(half * half + xy * xy)
    cos, sin = 1.0, 0.0
    if radius > 0:
        cos, sin = half / radius, xy / radius
    return middle + radius, middle - radius, cos, sin


@ti.func
def line_forces(s: ti.template(), cut, a, b):
    """Line forces of the skin (second Piola-Kirchhoff) on the axes a and b: aa, bb, ab [N/m]."""
    first, second, cos, sin = principal_strains(a, b)
    nu, stiff = s.par[cut, SKIN_POISSON], s.par[cut, SKIN_STIFFNESS]
    one, two = 0.0, 0.0
    if first > 0:
        if second <= -nu * first:
            one = stiff * first
        else:
            plane = stiff / (1.0 - nu * nu)
            one, two = plane * (first + nu * second), plane * (second + nu * first)
    middle, radius = 0.5 * (one + two), 0.5 * (one - two)
    return ti.Vector([middle + radius * cos, middle - radius * cos, radius * sin])


@ti.func
def membrane_energy(s: ti.template(), cut, n):
    """Elastic energy of the skin that point n stands for [J]."""
    first, second, _, _ = principal_strains(s.skin_sides[cut, n, 0], s.skin_sides[cut, n, 1])
    nu, stiff = s.par[cut, SKIN_POISSON], s.par[cut, SKIN_STIFFNESS]
    energy = 0.0
    if first > 0:
        if second <= -nu * first:
            energy = 0.5 * stiff * first * first
        else:
            energy = 0.5 * stiff / (1.0 - nu * nu) * (first * first + second * second + 2.0 * nu * first * second)
    return energy * s.skin_area[cut, n]
