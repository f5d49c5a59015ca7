"""The crack as the transfers see it: which half of the food a particle belongs to, and which nodes it sees.

The crack lies in the cut plane. The plane is parted from the beginning, and ties hold the halves together
(:mod:`mpm.kernels.ties`), so a particle sees the nodes of its own half only. The front is a height in each slice along
the edge, down to which the edge has cut; the edge's law asks for it.
"""

import taichi as ti

from mpm.kernels.tool import board_height, covered_part, edge_height, under_blade
from mpm.state.accessors import to_scene_axes
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import SLICES
from mpm.state.stencil import node_position
from mpm.state.tables import DX, FIRST_STATION, SECOND_OFFSET

ALL_VISIBLE = 0x1FF  # of visible_columns where a particle sees all of its nodes
# The bit above it in State.visibility: the particle has a moment of contact, from one transfer back to the next.
IN_CONTACT = ALL_VISIBLE + 1


@ti.func
def advance_crack_fronts(s: ti.template(), cut: ti.template()):
    """Move the crack front of every slice."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, SLICES)):
        c, i, mine = locate_active(s, cut, q, SLICES)
        if mine:
            advance_front(s, c, i)


@ti.func
def advance_front(s: ti.template(), cut, i):
    """Move the crack front of slice i: down with the edge, and with the food where the blade has gone."""
    place = s.par[cut, FIRST_STATION] + i * s.par[cut, DX]
    tip = edge_height(s, cut, place)
    s.crack_front[cut, i] += s.front_drift[cut, i]
    if covered_part(s, cut, place) > 0 and tip < s.crack_front[cut, i]:
        s.crack_front[cut, i] = tip


@ti.func
def visible_columns(s: ti.template(), cut, base, q, mine):
    """Which columns of its nodes a particle sees: those of its own half.

    A hidden node has the field of the other half, as in the crack algorithm of Nairn (2003, CMES 4:649).

    Args:
        base: Lowest node of the particle.
        q: Its position in the scene's axes [m].
        mine: Half that it belongs to.

    Returns:
        A bit for each of the nine columns, or three where the grid is not turned, read by :func:`hidden`.
    """
    code = ALL_VISIBLE
    if ti.static(s.cuts):
        reach = ti.static(2.2 if s.turned else 1.6) * s.par[cut, DX]
        if ti.abs(q[1]) < reach:
            code = 0
            for column in range(ti.static(9 if s.turned else 3)):
                node = node_position(s, cut, base[0] + column // 3, base[1] + column % 3, base[2])
                code |= ti.cast(node_half(s, cut, to_scene_axes(s, cut, node)[1]) == mine, ti.i32) << column
    return code


@ti.func
def hidden(s: ti.template(), code, i, j):
    """1 where a particle does not see node column (i, j), else 0; the same for all i where the grid is not turned."""
    return 1 - ((code >> (3 * i + j if ti.static(s.turned) else j)) & 1)


@ti.func
def particle_half(s: ti.template(), cut, p):
    """Half of the food that a particle belongs to, 0 left, 1 right."""
    out = 0  # the modelled half of a mirror is the left
    if ti.static(s.cuts and not s.mirror_y):
        out = s.half[cut, p]
    return out


@ti.func
def node_half(s: ti.template(), cut, n):
    """Half that a node belongs to; a node on the plane belongs to the right."""
    return ti.cast(n > -1e-6 * s.par[cut, DX], ti.i32)


@ti.func
def sever(s: ti.template(), cut, p, q):
    """Material that the edge has passed belongs to the left (1) or right (2) half for good.

    At the board that is all of it, also what is pressed a little into the board.
    """
    if ti.static(s.cuts):
        tip = edge_height(s, cut, q[0])
        if s.side[cut, p] == 0 and (q[2] > tip or tip <= board_height(s, cut, 0.0)) and under_blade(s, cut, q[0]):
            s.side[cut, p] = 1 + particle_half(s, cut, p)


@ti.func
def field_offsets(s: ti.template(), cut, i, code):
    """Where the fields of the node columns j of a particle are stored, in nodes along y from the lowest one on.

    Those that it sees have their first field, the hidden ones the second.
    """
    at = ti.Vector([0, 1, 2])
    if ti.static(s.cuts):
        for j in ti.static(range(3)):
            at[j] += hidden(s, code, i, j) * s.size[cut, SECOND_OFFSET]
    return at
