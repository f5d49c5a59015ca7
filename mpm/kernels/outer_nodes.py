"""Nodes with little mass beside the cut plane: they follow the nodes inside (extended B-splines).

A node outside the food that only the rim of a few particles reaches has a mass m and a stiffness that falls with m^2.
So it comes to rest the more slowly, the less mass it has, over thousands of steps and with no end. Until then the first
layer of particles creeps under what presses it. That takes energy, also from a blade that stands still, and the more,
the stiffer the contact is. An extended B-spline has no such node: its velocity is carried on in a line from the next
two nodes inside (Hoellig, Reif and Wipper 2001, SIAM J. Numer. Anal. 39:442; in the material point method Yamaguchi,
Moriguchi and Terada 2021, Int. J. Numer. Methods Eng. 122).

Here the three velocities are projected on that condition, weighted by mass. The projection keeps momentum and its
moment, and every velocity that is linear in space. It makes no energy, whatever the masses are.

Not beside a stone: its nodes are projected on a rigid motion afterwards, and the two in turn would not be symmetric.
"""

import taichi as ti

from mpm.kernels.crack import node_half
from mpm.state.accessors import to_scene_axes
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import NODE_ACROSS, NODE_LINES, NODE_ROWS
from mpm.state.stencil import has_second_field, node_index, node_position
from mpm.state.tables import EXTENSION, SECOND_BEGIN, SECOND_END, SECOND_OFFSET

DEEP = 3  # nodes at the end of a line, from the outermost one with mass, that may follow
BESIDE = 2  # node planes to either side of those with a second field whose columns are followed up and down
# Across the cut plane a node has to be so much lighter yet: blade and ties act on the nodes outside as well, and one
# that comes to rest in good time is better left to bear its part.
ACROSS = 0.1
ACROSS_PLANE, ALONG_PLANE, UPRIGHT = range(3)  # axes of the lines


@ti.func
def extend_interior(s: ti.template(), cut: ti.template()):
    """Let nodes with little mass beside the cut plane follow those inside, line by line: across the plane and upright,
    in a turned grid along its third axis as well; and then once more, all in reverse.

    One projection after another is no projection any more. It would turn forces that have a potential into such as have
    none, and those make energy. There and back it is symmetric, and they do not.
    """
    extend_lines(s, cut, ACROSS_PLANE, False)
    if ti.static(s.turned):
        extend_lines(s, cut, ALONG_PLANE, False)
    extend_lines(s, cut, UPRIGHT, False)
    extend_lines(s, cut, UPRIGHT, True)
    if ti.static(s.turned):
        extend_lines(s, cut, ALONG_PLANE, True)
    extend_lines(s, cut, ACROSS_PLANE, True)


@ti.func
def extend_lines(s: ti.template(), cut: ti.template(), axis: ti.template(), back: ti.template()):
    """Nodes of all lines along an axis; ``back`` in the reverse order."""
    kind = ti.static({ACROSS_PLANE: NODE_ACROSS, ALONG_PLANE: NODE_LINES, UPRIGHT: NODE_ROWS}[axis])
    for q in range(repetitions(s, cut, kind)):
        c, r, mine = locate_active(s, cut, q, kind)
        if mine:
            if ti.static(axis == UPRIGHT):
                extend_column(s, c, r, back)
            else:
                deep = s.window[c, 5] - s.window[c, 2]
                other, k = r // deep, s.window[c, 2] + r % deep
                if ti.static(axis == ACROSS_PLANE):
                    extend_line(s, c, axis, s.window[c, 0] + other, k, back)
                else:
                    extend_line(s, c, axis, s.window[c, 1] + other, k, back)


@ti.func
def extend_line(s: ti.template(), cut, axis: ti.template(), other, k, back: ti.template()):
    """Nodes of a level line: those of each half that lie towards the other, in a turned grid those at either end.

    Args:
        axis: Along the grid's y, or along its x.
        other: Index of the line along the other one.
        k: Its index along z.
        back: Whether from outside to inside, and the other half first.
    """
    for turn in ti.static(range(4)):
        extend_half(s, cut, axis, other, k, back, (3 - turn) // 2 if back else turn // 2, (turn + back) % 2)


@ti.func
def extend_half(
    s: ti.template(),
    cut,
    axis: ti.template(),
    other,
    k,
    back: ti.template(),
    half: ti.template(),
    down: ti.template(),
):
    """As :func:`extend_line`, nodes of one half at the upper (``down`` 0) or the lower end (1) of the line."""
    # the left half lies below the right one
    if ti.static(half < (1 if s.mirror_y else 2) and (s.turned or down == half)):
        first, last = s.window[cut, 1], s.window[cut, 4]
        low, high = ti.max(first, s.size[cut, SECOND_BEGIN]), ti.min(last, s.size[cut, SECOND_END])
        if ti.static(axis == ALONG_PLANE):
            first, last = s.window[cut, 0], s.window[cut, 3]
            low, high = first, last
        inwards = ti.static(1 if down else -1)
        outermost = low if ti.static(bool(down)) else high - 1
        while low <= outermost < high and massless(s, line_node(s, cut, half, axis, other, outermost, k)):
            outermost += inwards
        for m in range(DEEP):
            n = outermost + (m if ti.static(bool(back)) else DEEP - 1 - m) * inwards
            if low <= n < high and first <= n + 2 * inwards < last:
                follow(
                    s,
                    line_node(s, cut, half, axis, other, n, k),
                    line_node(s, cut, half, axis, other, n + inwards, k),
                    line_node(s, cut, half, axis, other, n + 2 * inwards, k),
                    ACROSS * s.par[cut, EXTENSION],
                )


@ti.func
def extend_column(s: ti.template(), cut, r, back: ti.template()):
    """Nodes of a column near the cut plane, at top and bottom of each half.

    Args:
        r: Place of the column in a loop over rows of nodes; on a GPU those of the other nodes of the column do nothing.
        back: Whether from outside to inside, and the bottom first.
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
                for turn in ti.static(range(2)):
                    extend_end(s, cut, base, back, (turn + back) % 2)


@ti.func
def extend_end(s: ti.template(), cut, base, back: ti.template(), down: ti.template()):
    """Nodes of a column at its top (``down`` 0) or its bottom (1).

    Args:
        base: Index of the column's node at k = 0.
        back: Whether from outside to inside.
    """
    low, high = s.window[cut, 2], s.window[cut, 5]
    inwards = ti.static(1 if down else -1)
    outermost = low if ti.static(bool(down)) else high - 1
    while low <= outermost < high and massless(s, base + outermost):
        outermost += inwards
    for m in range(DEEP):
        n = outermost + (m if ti.static(bool(back)) else DEEP - 1 - m) * inwards
        if low <= n < high and low <= n + 2 * inwards < high:
            at = base + n
            follow(s, at, at + inwards, at + 2 * inwards, s.par[cut, EXTENSION])


@ti.func
def massless(s: ti.template(), at):
    """Whether a node, by its index in the velocities or -1, has no mass."""
    out = True
    if at >= 0:
        out = s.u[at][3] <= 0
    return out


@ti.func
def line_node(s: ti.template(), cut, half, axis: ti.template(), other, n, k):
    """Index as :func:`field_node`, of a node of a level line."""
    i, j = other, n
    if ti.static(axis == ALONG_PLANE):
        i, j = n, other
    return field_node(s, cut, half, i, j, k)


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
        m, m_near, m_far = s.u[at][3], s.u[near][3], s.u[far][3]
        if 0 < m < part * ti.min(m_near, 2 * m_far):
            u, a, b = s.u[at], s.u[near], s.u[far]
            jump = (u - 2 * a + b) / (1 / m + 4 / m_near + 1 / m_far)
            jump[3] = 0.0
            s.u[at] = u - jump / m
            s.u[near] = a + 2 * jump / m_near
            s.u[far] = b - jump / m_far
