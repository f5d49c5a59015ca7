"""Bulk damage of the particles, and the smoothed strain that drives it."""

import taichi as ti

from mpm.kernels.constitutive.laws import (
    damage_of,
    deviatoric_energy,
    double,
    largest_eigenvalue,
    left_cauchy_green,
    left_stretch,
    unit,
)
from mpm.state.accessors import deformation_gradient
from mpm.state.loops import block_range, locate_active, node_box, node_row, repetitions
from mpm.state.state import BEYOND_GRID, DAMAGE_ROWS, NODE_ROWS, PARTS
from mpm.state.stencil import add_to_node, base_node, bspline_weights, in_window, thread_node_index
from mpm.state.tables import COUNT, EPS0, EPSF


@ti.func
def update_damage(s: ti.template(), cut, p, v, j, mu, lam):
    """Damage of a particle from the smoothed strain of the last step.

    Also finds the box of the particles whose strain could damage something. No principal strain exceeds the norm of the
    strain, so the others never pay for an eigenvalue.

    Args:
        p: The particle.
        v: Its left stretch.
        j: Its determinant.
        mu: Shear modulus [Pa].
        lam: First Lame constant [Pa].

    Returns:
        Its damage, and the energy per volume that this step has taken [J/m^3].
    """
    d, lost = 0.0, 0.0
    eps0, eps_f = s.par[cut, EPS0], s.par[cut, EPSF]
    if eps0 > 0:
        before = damage_of(s.kappa[cut, p], eps0, eps_f)
        s.kappa[cut, p] = ti.max(s.kappa[cut, p], s.driving_strain[cut, p])
        s.driving_strain[cut, p] = 0.0
        d = damage_of(s.kappa[cut, p], eps0, eps_f)
        if d > before:  # what is compressed keeps its pressure, and so its energy
            lost = (d - before) * (deviatoric_energy(v, mu) + (0.5 * lam * (j - 1) ** 2 if j > 1 else 0.0))
        e = v - unit()
        if double(e, e) > eps0 * eps0:
            if largest_eigenvalue(e) > eps0:
                base, fx = base_node(s, cut, s.x[cut, p])
                for axis in ti.static(range(3)):
                    ti.atomic_min(s.damage_box[cut, axis], base[axis])
                    ti.atomic_max(s.damage_box[cut, axis + 3], base[axis])
    return d, lost


@ti.func
def smooth_driving_strain(s: ti.template(), cut):
    """Replace each particle's driving strain by its mean over the grid's weights (one pass).

    Only where it can matter: two particles meet at a node when they are at most two cells apart, so that those within
    two cells of a strain above the threshold may be damaged, and those within four contribute to that. It uses the
    grids of the threads, which are cleared at the start of a step.
    """
    # threads that would find nothing are not woken
    some = 1 if ti.static(s.atomic) else ti.cast(s.damage_box[cut, 3] >= 0, ti.i32)
    for q in range(repetitions(s, cut, DAMAGE_ROWS)):
        c, r, mine = locate_active(s, cut, q, DAMAGE_ROWS)
        if mine:
            i, j, low, high = node_row(s, c, r, DAMAGE_ROWS)
            for k in range(low, high):
                for thread in ti.static(range(s.threads)):
                    s.g[thread_node_index(s, c, thread, i, j, k)] = ti.Vector.zero(float, 4)
    for q in range(repetitions(s, cut, PARTS) * some):
        c, part, mine = locate_active(s, cut, q, PARTS)
        first, last, thread = block_range(s, c, part)
        if mine and first < last and s.damage_box[c, 3] >= 0:
            window = node_box(s, c, NODE_ROWS)
            for p in range(first * s.lanes, ti.min(last * s.lanes, s.size[c, COUNT])):
                strain_to_grid(s, c, p, thread, window)
    for q in range(repetitions(s, cut, PARTS) * some):
        c, part, mine = locate_active(s, cut, q, PARTS)
        first, last, _ = block_range(s, c, part)
        if mine and first < last and s.damage_box[c, 3] >= 0:
            window = node_box(s, c, NODE_ROWS)
            for p in range(first * s.lanes, ti.min(last * s.lanes, s.size[c, COUNT])):
                strain_from_grid(s, c, p, window)


@ti.func
def strain_to_grid(s: ti.template(), cut, p, thread, window):
    """Largest principal strain of a particle to the grid, times its weights."""
    base, fx = base_node(s, cut, s.x[cut, p])
    if near_damage(s, cut, base, 4) and in_window(base, window) > 0:
        f = deformation_gradient(s, cut, p)
        strain = largest_eigenvalue(left_stretch(left_cauchy_green(f), f.determinant()) - unit())
        w, lowest = bspline_weights(fx), thread_node_index(s, cut, thread, base[0], base[1], base[2])
        for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
            wt = w[i][0] * w[j][1] * w[k][2]
            add_to_node(s, lowest + (i * s.stride_x + j * s.stride_y + k), ti.Vector([wt * strain, wt, 0.0, 0.0]))


@ti.func
def strain_from_grid(s: ti.template(), cut, p, window):
    """Mean of the driving strain that the particles about one have spread over the grid."""
    base, fx = base_node(s, cut, s.x[cut, p])
    if near_damage(s, cut, base, 2) and in_window(base, window) > 0:
        w = bspline_weights(fx)
        e = 0.0
        for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
            total = ti.Vector.zero(float, 2)
            for thread in ti.static(range(s.threads)):
                q = s.g[thread_node_index(s, cut, thread, base[0] + i, base[1] + j, base[2] + k)]
                total += ti.Vector([q[0], q[1]])
            e += w[i][0] * w[j][1] * w[k][2] * total[0] / ti.max(total[1], 1e-30)
        s.driving_strain[cut, p] = e


@ti.func
def near_damage(s: ti.template(), cut, base, cells):
    """Whether a particle is at most so many cells from the box of those whose strain could damage something."""
    out = True
    for d in ti.static(range(3)):
        if base[d] < s.damage_box[cut, d] - cells or base[d] > s.damage_box[cut, d + 3] + cells:
            out = False
    return out


@ti.func
def clear_damage_box(s: ti.template(), cut: ti.template()):
    """Begin to look for the particles whose strain could damage something."""
    for d in ti.static(range(3)):
        s.damage_box[cut, d], s.damage_box[cut, d + 3] = BEYOND_GRID, -BEYOND_GRID
