"""Nodes about a point: which ones, their weights, positions and places in memory."""

import taichi as ti

from mpm.state.tables import DX, INV_DX, ORIGIN_X, ORIGIN_Y, ORIGIN_Z, SECOND_BEGIN, SECOND_END


@ti.func
def bspline(r):
    """Quadratic B-spline of unit width [-]."""
    q = ti.abs(r)
    out = 0.0
    if q < 0.5:
        out = 0.75 - q * q
    elif q < 1.5:
        out = 0.5 * (1.5 - q) ** 2
    return out


@ti.func
def bspline_weights(fx):
    """Quadratic B-spline weights of three nodes along each axis."""
    return [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]


@ti.func
def base_node(s: ti.template(), cut, q):
    """Lowest node of the 27 that a point reaches, and its offset in cells."""
    u = (q - ti.Vector([s.par[cut, ORIGIN_X], s.par[cut, ORIGIN_Y], s.par[cut, ORIGIN_Z]])) * s.par[cut, INV_DX]
    base = ti.floor(u - 0.5).cast(ti.i32)
    return base, u - base.cast(float)


@ti.func
def in_window(base, window):
    """1 when the 27 nodes above ``base`` are in the ``window`` of active nodes, else 0."""
    out = 1.0
    for d in ti.static(range(3)):
        if base[d] < window[d] or base[d] + 2 >= window[d + 3]:
            out = 0.0
    return out


@ti.func
def node_position(s: ti.template(), cut, i, j, k):
    """Position of a node [m]."""
    return ti.Vector(
        [
            s.par[cut, ORIGIN_X] + i * s.par[cut, DX],
            s.par[cut, ORIGIN_Y] + j * s.par[cut, DX],
            s.par[cut, ORIGIN_Z] + k * s.par[cut, DX],
        ]
    )


@ti.func
def has_second_field(s: ti.template(), cut, j):
    """Whether the nodes of plane j along y have a second field."""
    return s.size[cut, SECOND_BEGIN] <= j < s.size[cut, SECOND_END]


@ti.func
def node_index(s: ti.template(), grid, i, j, k):
    """Index of a node in the velocities ``u`` of a cut.

    No index has the bits that are masked. But LLVM then knows that this one and a constant make no negative number,
    and reaches the 27 nodes of a particle by one register and 27 constants, for which it needs three instructions each
    otherwise.
    """
    return (grid * s.nodes_per_grid + i * s.stride_x + j * s.stride_y + k) & s.index_mask


@ti.func
def thread_node_index(s: ti.template(), cut, thread, i, j, k):
    """Index of a node in the momenta and masses ``g`` of a thread's own grid."""
    return node_index(s, cut * s.threads + thread, i, j, k)


@ti.func
def add_to_node(s: ti.template(), at, value):
    """Add to a node of a thread's grid, by its :func:`thread_node_index`; atomically where all threads share one."""
    if ti.static(s.atomic):
        s.g[at] += value
    else:
        s.g[at] = s.g[at] + value
