"""Nodes with little mass beside the cut plane: they follow the nodes inside (extended B-splines).

A node outside the food that only the rim of a few particles reaches has a mass m and a stiffness that falls with m^2.
So it comes to rest the more slowly, the less mass it has, over thousands of steps and with no end. Until then the first
layer of particles creeps under what presses it. That takes energy, also from a blade that stands still, and the more,
the stiffer the contact is. An extended B-spline has no such node: its velocity is carried on in a line from the next
two nodes inside (Hoellig, Reif and Wipper 2001, SIAM J. Numer. Anal. 39:442; in the material point method Yamaguchi,
Moriguchi and Terada 2021, Int. J. Numer. Methods Eng. 122).

Here the three velocities are projected on that condition, weighted by mass. The projection keeps momentum and its
moment, and every velocity that is linear in space. It makes no energy, whatever the masses are.
"""

import taichi as ti

from mpm.kernels.crack import node_half
from mpm.state.accessors import to_scene_axes
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import NODE_ACROSS, NODE_LINES, NODE_ROWS
from mpm.state.stencil import has_second_field, node_index, node_position
from mpm.state.tables import EXTENSION, SECOND_BEGIN, SECOND_END, SECOND_OFFSET

BESIDE = 2  # node planes to either side of those with a second field whose columns are followed up and down
# Across the cut plane a node has to be so much lighter yet: blade and ties act on the nodes outside as well, and one
# that comes to rest in good time is better left to bear its part.
ACROSS = 0.1


@ti.func
def extend_interior(s: ti.template(), cut: ti.template()):
    """Let nodes with little mass beside the cut plane follow those inside, line by line: across the plane and upright,
    in a turned grid along its third axis as well. From inside to outside, so that a node follows what is done already.
    """
    for q in range(repetitions(s, cut, NODE_ACROSS)):
        c, r, mine = locate_active(s, cut, q, NODE_ACROSS)
        if mine:
            deep = s.window[c, 5] - s.window[c, 2]
            extend_across(s, c, s.window[c, 0] + r // deep, s.window[c, 2] + r % deep)
    if ti.static(s.turned):
        for q in range(repetitions(s, cut, NODE_LINES)):
            c, r, mine = locate_active(s, cut, q, NODE_LINES)
            if mine:
                deep = s.window[c, 5] - s.window[c, 2]
                extend_along(s, c, s.window[c, 1] + r // deep, s.window[c, 2] + r % deep)
    for q in range(repetitions(s, cut, NODE_ROWS)):
        c, r, mine = locate_active(s, cut, q, NODE_ROWS)
        if mine:
            extend_upright(s, c, r)


@ti.func
def extend_across(s: ti.template(), cut, i, k):
    """Nodes of a line along the grid's y: those of each half that lie towards the other, or at either end."""
    first, last = s.window[cut, 1], s.window[cut, 4]
    low, high = ti.max(first, s.size[cut, SECOND_BEGIN]), ti.min(last, s.size[cut, SECOND_END])
    for half in ti.static(range(1 if s.mirror_y else 2)):
        if ti.static(half == 0 or s.turned):
            for j in range(ti.max(low, first + 2), high):
                follow(
                    s,
                    field_node(s, cut, half, i, j, k),
                    field_node(s, cut, half, i, j - 1, k),
                    field_node(s, cut, half, i, j - 2, k),
                    ACROSS * s.par[cut, EXTENSION],
                )
        if ti.static(half == 1 or s.turned):
            for n in range(ti.max(0, ti.min(high, last - 2) - low)):
                j = ti.min(high, last - 2) - 1 - n
                follow(
                    s,
                    field_node(s, cut, half, i, j, k),
                    field_node(s, cut, half, i, j + 1, k),
                    field_node(s, cut, half, i, j + 2, k),
                    ACROSS * s.par[cut, EXTENSION],
                )


@ti.func
def extend_along(s: ti.template(), cut, j, k):
    """Nodes of a line along the grid's x, at either end of each half."""
    first, last = s.window[cut, 0], s.window[cut, 3]
    for half in ti.static(range(2)):
        for i in range(first + 2, last):
            follow(
                s,
                field_node(s, cut, half, i, j, k),
                field_node(s, cut, half, i - 1, j, k),
                field_node(s, cut, half, i - 2, j, k),
                ACROSS * s.par[cut, EXTENSION],
            )
        for n in range(ti.max(0, last - 2 - first)):
            i = last - 3 - n
            follow(
                s,
                field_node(s, cut, half, i, j, k),
                field_node(s, cut, half, i + 1, j, k),
                field_node(s, cut, half, i + 2, j, k),
                ACROSS * s.par[cut, EXTENSION],
            )


@ti.func
def extend_upright(s: ti.template(), cut, r):
    """Nodes of a column near the cut plane, at top and bottom of each half.

    Args:
        r: Place of the column in a loop over rows of nodes; on a GPU those of the other nodes of the column do nothing.
    """
    low, high = s.window[cut, 2], s.window[cut, 5]
    mine = True
    if ti.static(s.atomic):
        mine = r % (high - low) == 0
        r //= high - low
    wide = s.window[cut, 4] - s.window[cut, 1]
    i = s.window[cut, 0] + r // wide
    j = s.window[cut, 1] + r % wide
    if mine and s.size[cut, SECOND_BEGIN] - BESIDE <= j < s.size[cut, SECOND_END] + BESIDE:
        for half in ti.static(range(1 if s.mirror_y else 2)):
            base = field_node(s, cut, half, i, j, 0)
            if base >= 0:
                for k in range(low + 2, high):
                    follow(s, base + k, base + k - 1, base + k - 2, s.par[cut, EXTENSION])
                for n in range(ti.max(0, high - 2 - low)):
                    k = high - 3 - n
                    follow(s, base + k, base + k + 1, base + k + 2, s.par[cut, EXTENSION])


@ti.func
def field_node(s: ti.template(), cut, half, i, j, k):
    """Index of the velocity of a half at a node, -1 where the node has none of that half."""
    at, there = j, True
    if node_half(s, cut, to_scene_axes(s, cut, node_position(s, cut, i, j, k))[1]) != half:
        there = has_second_field(s, cut, j)
        at += s.size[cut, SECOND_OFFSET]
    return node_index(s, cut, i, at, k) if there else -1


@ti.func
def follow(s: ti.template(), at, near, far, part):
    """Carry the velocity of a node on from the next two inside, if its mass is small against theirs.

    The three are projected on the condition that they lie on a line, weighted by mass. Seen from the far node the near
    one counts twice, as a node of half its mass carries as much there.

    Args:
        at: Index of the node in the velocities.
        near: That of the next one inside, or -1.
        far: That of the one behind, or -1.
        part: Of their mass, below which its own is small [-].
    """
    if at >= 0 and near >= 0 and far >= 0:
        u, a, b = s.u[at], s.u[near], s.u[far]
        if 0 < u[3] < part * ti.min(a[3], 2 * b[3]):
            jump = (u - 2 * a + b) / (1 / u[3] + 4 / a[3] + 1 / b[3])
            jump[3] = 0.0
            s.u[at] = u - jump / u[3]
            s.u[near] = a + 2 * jump / a[3]
            s.u[far] = b - jump / b[3]
