"""Grid to particles (G2P): velocity and gradient are gathered from the nodes; particles move and touch the tools."""

import taichi as ti

from mpm.kernels.crack import ALL_VISIBLE, IN_CONTACT, field_offsets
from mpm.kernels.dampers import book_dampers, drag_damper
from mpm.kernels.surface_contact import near_tool, surface_contact
from mpm.state.accessors import step_size
from mpm.state.loops import block_range, locate_active, node_box, repetitions
from mpm.state.state import NODE_ROWS, PARTS
from mpm.state.stencil import base_node, bspline_weights, in_window, node_index
from mpm.state.tables import COUNT, DAMPER_MASS, INV_DX


@ti.func
def grid_to_particles(s: ti.template(), cut: ti.template()):
    """Gather velocity and gradient of every particle, move it, and let it touch the tools."""
    for q in range(repetitions(s, cut, PARTS)):
        c, part, mine = locate_active(s, cut, q, PARTS)
        first, last, thread = block_range(s, c, part)
        if mine and first < last:
            dt, w = step_size(s, c), node_box(s, c, NODE_ROWS)
            taken = ti.cast(0.0, float)
            for p in range(first * s.lanes, ti.min(last * s.lanes, s.size[c, COUNT])):
                taken += g2p_particle(s, c, p, thread, dt, w)
            book_dampers(s, c, part, taken)


@ti.func
def g2p_particle(s: ti.template(), cut, p, thread, dt, window):
    """One particle from the grid; one that has left it stays where it is, and the run ends at the next output.

    Returns:
        Energy that its damper takes, as :func:`mpm.kernels.dampers.drag_damper` has it.
    """
    taken = ti.cast(0.0, float)
    base, fx = base_node(s, cut, s.x[cut, p])
    if in_window(base, window) > 0:
        taken = update_particle(s, cut, p, thread, base, fx, dt)
    return taken


@ti.func
def update_particle(s: ti.template(), cut, p, thread, base, fx, dt):
    """Velocity, gradient and position of a particle from the 27 nodes above ``base``.

    Contact corrects the velocity that the next transfer hands on, not the position: moving the particle as well would
    let the surface slip through the material without straining it.

    Returns:
        Energy that its damper takes, as :func:`mpm.kernels.dampers.drag_damper` has it.
    """
    w = bspline_weights(fx)
    code, lowest = s.visibility[cut, p], node_index(s, cut, base[0], base[1], base[2])
    zero = ti.Vector.zero(float, 4)
    u4, cx, cy, cz = zero, zero, zero, zero
    if ti.static(s.atomic):
        u4, cx, cy, cz = gather(s, cut, lowest, code, w)
    else:
        # Where the loops are unrolled LLVM does not find the vectors of four, which costs time (docs/theory.md,
        # "Measured choices"). So their end is one that LLVM cannot know, and what they find goes through memory.
        end = ti.min(s.size[cut, COUNT], 3)
        if code == ALL_VISIBLE:
            for i in range(end):
                store_plane(s, cut, thread, i, gather_plane(s, whole_plane(s, lowest + i * s.stride_x), w))
        else:
            for i in range(end):
                at = split_plane(s, cut, lowest + i * s.stride_x, i, code)
                store_plane(s, cut, thread, i, gather_plane(s, at, w))
        for i in ti.static(range(3)):
            whole = w[i][0] * s.planes[cut, thread, i]
            u4, cx = u4 + whole, cx + i * whole
            cy += w[i][0] * s.planes[cut, thread, 3 + i]
            cz += w[i][0] * s.planes[cut, thread, 6 + i]
    u = ti.Vector([u4[0], u4[1], u4[2]])
    slope = 4 * s.par[cut, INV_DX]
    cx, cy, cz = slope * (cx - fx[0] * u4), slope * (cy - fx[1] * u4), slope * (cz - fx[2] * u4)
    s.C[cut, p, 0], s.C[cut, p, 1], s.C[cut, p, 2] = cx, cy, cz
    at = s.x[cut, p] + dt * u
    taken = ti.cast(0.0, float)
    if s.par[cut, DAMPER_MASS] > 0:
        u, taken = drag_damper(s, cut, p, u, dt)
    if ti.static(not s.nodal):
        if near_tool(s, cut, p, at):
            u = surface_contact(s, cut, p, dt, u, at)
            s.visibility[cut, p] = code | IN_CONTACT
    s.v[cut, p] = u
    s.x[cut, p] = at
    return taken


@ti.func
def gather(s: ti.template(), cut, lowest, code, w):
    """Sum of the velocities of the 27 nodes of a point, and its moments, plane by plane.

    Args:
        lowest: Index of the lowest node.
        code: Which columns of nodes the point sees.
        w: Weights of the nodes.

    Returns:
        Sum of weight times velocity [m/s], and its moments about the lowest node along x, y and z in cells.
    """
    zero = ti.Vector.zero(float, 4)
    u, cx, cy, cz = zero, zero, zero, zero
    for i in ti.static(range(3)):
        whole, py, pz = gather_plane(s, split_plane(s, cut, lowest + i * s.stride_x, i, code), w)
        u, cx = u + w[i][0] * whole, cx + i * w[i][0] * whole
        cy, cz = cy + w[i][0] * py, cz + w[i][0] * pz
    return u, cx, cy, cz


@ti.func
def gather_plane(s: ti.template(), at, w):
    """Sum of the velocities of the nine nodes of a particle in one plane across x, and its moments.

    Args:
        at: Indices (j, k) of the nodes.
        w: Weights of the nodes.

    Returns:
        Sum of weight times velocity [m/s], and its moments about the lowest node along y and z in cells.
    """
    whole, py, pz = ti.Vector.zero(float, 4), ti.Vector.zero(float, 4), ti.Vector.zero(float, 4)
    for j in ti.static(range(3)):
        b, c = w[1][2] * s.u[at[j, 1]], w[2][2] * s.u[at[j, 2]]
        row = w[j][1] * (w[0][2] * s.u[at[j, 0]] + b + c)
        whole += row
        py += j * row
        pz += w[j][1] * (b + 2 * c)
    return whole, py, pz


@ti.func
def whole_plane(s: ti.template(), lowest):
    """Indices of the nine nodes above the lowest one in a plane across x; masked as in
    :func:`mpm.state.stencil.node_index`."""
    at = ti.Matrix.zero(ti.i32, 3, 3)
    for j, k in ti.static(ti.ndrange(3, 3)):
        at[j, k] = (lowest & s.index_mask) + (j * s.stride_y + k)
    return at


@ti.func
def split_plane(s: ti.template(), cut, lowest, i, code):
    """As :func:`whole_plane` where some have the field of the other half."""
    offsets, at = field_offsets(s, cut, i, code), ti.Matrix.zero(ti.i32, 3, 3)
    for j, k in ti.static(ti.ndrange(3, 3)):
        at[j, k] = lowest + offsets[j] * s.stride_y + k
    return at


@ti.func
def store_plane(s: ti.template(), cut, thread, i, plane):
    """Keep what :func:`gather_plane` gave for plane ``i``."""
    for r in ti.static(range(3)):
        s.planes[cut, thread, 3 * r + i] = plane[r]
