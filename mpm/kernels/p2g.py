"""Particles to grid (P2G): stress and momentum of the particles are scattered to the nodes about them."""

import taichi as ti

from mpm.kernels.constitutive.laws import unit
from mpm.kernels.constitutive.stress import constitutive_update, elastic_block
from mpm.kernels.crack import ALL_VISIBLE, IN_CONTACT, field_offsets, particle_half, sever, visible_columns
from mpm.state.accessors import step_size, to_grid_axes, to_scene_axes
from mpm.state.loops import block_range, locate_active, node_box, repetitions
from mpm.state.state import NODE_ROWS, PARTS
from mpm.state.stencil import add_to_node, base_node, bspline_weights, in_window, thread_node_index
from mpm.state.tables import COUNT, DX, INV_DX, MASS, N_LOSSES, VOLUME


@ti.func
def particles_to_grid(s: ti.template(), cut: ti.template()):
    """Find the stress of every particle, and scatter its momentum and mass."""
    for q in range(repetitions(s, cut, PARTS)):
        c, part, mine = locate_active(s, cut, q, PARTS)
        first, last, thread = block_range(s, c, part)
        if mine and first < last:
            dt, w = step_size(s, c), node_box(s, c, NODE_ROWS)
            total = ti.Vector.zero(float, N_LOSSES)
            for block in range(first, last):
                total += p2g_block(s, c, block, thread, dt, w)
            for r in ti.static(range(N_LOSSES)):
                if total[r] != 0:  # most particles lose nothing
                    s.losses[c, part % s.copies, r] += total[r]


@ti.func
def p2g_block(s: ti.template(), cut, block, thread, dt, window):
    """Particles of a block to grid.

    Returns:
        Plastic, damage and viscous loss over the volume of a particle beside the cut [J/m^3], and how many particles
        are inverted and outside.
    """
    total = ti.Vector.zero(float, N_LOSSES)
    if ti.static(s.branches == 0):
        elastic_block(s, cut, block, dt)
    for lane in range(s.lanes):
        p = block * s.lanes + lane
        if p < s.size[cut, COUNT]:
            total += p2g_particle(s, cut, p, block, lane, thread, dt, window)
    return total


@ti.func
def p2g_particle(s: ti.template(), cut, p, block, lane, thread, dt, window):
    """One particle to grid; returns as :func:`p2g_block`.

    What it scatters is its momentum and mass, the momentum of its affine velocity (APIC: Jiang et al. 2015), that of
    its stress (MLS-MPM: Hu et al. 2018), and the moment of its last contact.
    """
    q = to_scene_axes(s, cut, s.x[cut, p])
    sever(s, cut, p, q)
    ratio, loss, tau = s.volume_ratio[cut, p], ti.Vector.zero(float, 4), 0.0 * unit()
    constitutive_update(s, cut, p, block, lane, dt, loss, tau)
    base, fx = base_node(s, cut, s.x[cut, p])
    outside = 1.0 - in_window(base, window)
    if outside == 0.0:
        w = bspline_weights(fx)
        m = s.par[cut, MASS] * ratio
        # change of the scattered momentum from node to node along x, y and z
        pull = -dt * s.par[cut, VOLUME] * ratio * 4 * s.par[cut, INV_DX]
        carry = m * s.par[cut, DX] * ti.Vector([1.0, 1.0, 1.0, 0.0])
        ax = pull * ti.Vector([tau[0], tau[5], tau[4], 0.0]) + carry * s.C[cut, p, 0]
        ay = pull * ti.Vector([tau[5], tau[1], tau[3], 0.0]) + carry * s.C[cut, p, 1]
        az = pull * ti.Vector([tau[4], tau[3], tau[2], 0.0]) + carry * s.C[cut, p, 2]
        if ti.static(not s.nodal):
            add_contact_moment(s, cut, p, carry, ax, ay, az)
        v = s.v[cut, p]
        corner = m * ti.Vector([v[0], v[1], v[2], 1.0]) - fx[0] * ax - fx[1] * ay - fx[2] * az
        code = visible_columns(s, cut, base, q, particle_half(s, cut, p))
        s.visibility[cut, p] = code
        lowest = thread_node_index(s, cut, thread, base[0], base[1], base[2])
        if ti.static(s.atomic):
            scatter_split(s, cut, lowest, code, w, corner, ax, ay, az)
        elif code == ALL_VISIBLE:
            scatter_whole(s, lowest, w, corner, ax, ay, az)
        else:
            scatter_split(s, cut, lowest, code, w, corner, ax, ay, az)
    return ti.Vector([ratio * loss[0], ratio * loss[1], ratio * loss[2], loss[3], outside])


@ti.func
def add_contact_moment(
    s: ti.template(),
    cut: ti.template(),
    p: ti.template(),
    carry: ti.template(),
    ax: ti.template(),
    ay: ti.template(),
    az: ti.template(),
):
    """Add the moment of the last contact to the change of the scattered momentum along x, y and z (by reference)."""
    if s.visibility[cut, p] & IN_CONTACT:
        az += carry * s.contact_moment[cut, p, 0]
        if ti.static(s.turned):
            across = to_grid_axes(s, cut, ti.Vector([0.0, 1.0, 0.0]))
            ax += across[0] * carry * s.contact_moment[cut, p, 1]
            ay += across[1] * carry * s.contact_moment[cut, p, 1]
        else:
            ay += carry * s.contact_moment[cut, p, 1]


@ti.func
def scatter_whole(s: ti.template(), lowest, w, corner, ax, ay, az):
    """Add a particle that sees no cut to its 27 nodes.

    Of three above each other all are read before the first is written, so that none waits for another.

    Args:
        lowest: Index of the lowest node.
        w: Weights of the nodes.
        corner: Momentum (3) and mass that the lowest node would get with the weight 1.
        ax, ay, az: How that changes from node to node.
    """
    for i, j in ti.static(ti.ndrange(3, 3)):
        wij, at = w[i][0] * w[j][1], lowest + (i * s.stride_x + j * s.stride_y)
        low, rise = wij * (corner + i * ax + j * ay), wij * az
        a, b, c = w[0][2] * low + s.g[at], w[1][2] * (low + rise), w[2][2] * (low + 2 * rise)
        b += s.g[at + 1]
        c += s.g[at + 2]
        s.g[at], s.g[at + 1], s.g[at + 2] = a, b, c


@ti.func
def scatter_split(s: ti.template(), cut, lowest, code, w, corner, ax, ay, az):
    """As :func:`scatter_whole` at the cut, where some nodes have the field of the other side.

    Node by node: in the order of :func:`scatter_whole` LLVM makes one path of the two, with an address for each node.
    """
    at = field_offsets(s, cut, 0, code)
    for i in ti.static(range(3)):
        if ti.static(s.turned):
            at = field_offsets(s, cut, i, code)
        for j in ti.static(range(3)):
            wij = w[i][0] * w[j][1]
            low, rise = wij * (corner + i * ax + j * ay), wij * az
            for k in ti.static(range(3)):
                node = lowest + (i * s.stride_x + k) + at[j] * s.stride_y
                add_to_node(s, node, w[k][2] * (low + k * rise))
