"""The crack as the transfers see it: on which side of it a particle is, and which nodes it sees across it.

The crack lies in the cut plane. Its front is a height in each slice along the edge. Where ties hold the food together
(:mod:`mpm.kernels.ties`) the plane is parted from the beginning, and only the edge's law asks for the front.
"""

import taichi as ti

from mpm.kernels.tool import covered_part, edge_height, under_blade
from mpm.state.accessors import to_scene_axes
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import SLICES
from mpm.state.stencil import node_position
from mpm.state.tables import DX, FIRST_STATION, INV_DX, ORIGIN_Z, SECOND_OFFSET, STATIONS, ZONE

ALL_VISIBLE = 0x3FFFF  # of visible_layers where a particle sees all of its nodes
# The bit above it in State.visibility: the particle has a moment of contact, from one transfer back to the next.
IN_CONTACT = ALL_VISIBLE + 1
# The front that hides nodes from particles, over that of the edge: lower by a part of the process zone (Irwin's crack),
# and higher by a part of a cell, as the nodes part early (docs/theory.md, "Measured choices").
LEAD_ZONES, LAG_CELLS = 0.5, 0.5


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
def front_height(s: ti.template(), cut, place):
    """Height of the crack front at a place along the cut [m], between the slices; far up where nothing is cut."""
    r = (place - s.par[cut, FIRST_STATION]) * s.par[cut, INV_DX]
    i = ti.math.clamp(ti.floor(r, ti.i32), s.first_slice, s.size[cut, STATIONS] - 2)
    t = ti.math.clamp(r - i, 0.0, 1.0)
    out = 1e3
    if ti.max(s.crack_front[cut, i], s.crack_front[cut, i + 1]) < 1e2:
        out = (1 - t) * s.crack_front[cut, i] + t * s.crack_front[cut, i + 1]
    elif t < 0.5:
        out = s.crack_front[cut, i]
    else:
        out = s.crack_front[cut, i + 1]
    return out


@ti.func
def visible_layers(s: ti.template(), cut, p, base, q, mine):
    """Visibility of a particle's nodes: from which of the three layers on they are hidden, in each of the nine columns.

    Node and particle see each other across the cut plane when the line between them passes it below the crack front, as
    in the crack algorithm of Nairn (2003, CMES 4:649). A hidden node has the field of the other half. That front is not
    the edge:

    - The crack leads the edge by half a process zone, the equivalent elastic crack of Irwin: food opens ahead of the
      edge, as far on any grid. Held at the edge itself, the force of a wedge grows without end as the cells shrink.
    - The nodes part early, so the front is held half a cell higher: then a crack that is loaded far away is as long as
      it should be (tests/mpm/kernels/test_crack.py), and a wedge in a slit needs the force that finite elements need
      (studies/verification/cutting.py).

    All particles have the same front, so the nodes part row by row. That is a ripple with the period of a cell, which
    the moving mean over one cell takes out (ForceRecord.resolved_face). Spreading the fronts of the particles over a
    cell would hide it and cost more: those that are held longest carry the force.

    Args:
        p: The particle.
        base: Its lowest node.
        q: Position in the scene's axes [m].
        mine: Half that the particle belongs to.

    Returns:
        Layers, two bits a column, read by :func:`hidden_from`; 3 where a column is seen as a whole.
    """
    code = ALL_VISIBLE
    if ti.static(s.tied):
        code = visible_columns(s, cut, base, q, mine)
    elif ti.static(s.cuts):
        reach = ti.static(2.2 if s.turned else 1.6) * s.par[cut, DX]
        if ti.abs(q[1]) < reach:
            front = front_height(s, cut, q[0]) - LEAD_ZONES * s.par[cut, ZONE]
            front += LAG_CELLS * s.par[cut, DX]
            if front < 1e2:
                code = 0
                for column in range(ti.static(9 if s.turned else 3)):
                    n = to_scene_axes(
                        s, cut, node_position(s, cut, base[0] + column // 3, base[1] + column % 3, base[2])
                    )[1]
                    layer = 3
                    if node_half(s, cut, n) != mine:
                        t = q[1] / (q[1] - n) if ti.abs(q[1] - n) > 1e-9 * s.par[cut, DX] else 1.0
                        t = ti.math.clamp(t, 1e-6, 1.0)
                        # the line passes the plane at z_p + t (z_node - z_p); above the front it is cut
                        level = (q[2] + (front - q[2]) / t - s.par[cut, ORIGIN_Z]) * s.par[cut, INV_DX]
                        layer = ti.math.clamp(ti.floor(level - base[2], ti.i32) + 1, 0, 3)
                    code |= layer << (2 * column)
    return code


@ti.func
def visible_columns(s: ti.template(), cut, base, q, mine):
    """As :func:`visible_layers` where the plane is parted from the beginning: all nodes of the other half are hidden.

    Args:
        base: Lowest node of the particle.
        q: Its position in the scene's axes [m].
        mine: Half that it belongs to.
    """
    code = ALL_VISIBLE
    reach = ti.static(2.2 if s.turned else 1.6) * s.par[cut, DX]
    if ti.abs(q[1]) < reach:
        code = 0
        for column in range(ti.static(9 if s.turned else 3)):
            n = to_scene_axes(s, cut, node_position(s, cut, base[0] + column // 3, base[1] + column % 3, base[2]))[1]
            code |= (3 if node_half(s, cut, n) == mine else 0) << (2 * column)
    return code


@ti.func
def hidden_from(s: ti.template(), code, i, j):
    """Layer from which node column (i, j) of a particle is hidden; the same for all i where the grid is not turned."""
    return (code >> (2 * (3 * i + j if ti.static(s.turned) else j))) & 3


@ti.func
def particle_half(s: ti.template(), cut, p, n):
    """Half of the food that a particle belongs to, 0 left, 1 right: fixed when it is severed, by its side before.

    With ties across the cut plane it is fixed from the beginning.
    """
    out = 0  # the modelled half of a mirror is the left
    if ti.static(s.tied and not s.mirror_y):
        out = s.half[cut, p]
    elif ti.static(not s.mirror_y):
        out = s.side[cut, p] - 1 if s.side[cut, p] > 0 else ti.cast(n >= 0, ti.i32)
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
        if s.side[cut, p] == 0 and (q[2] > tip or tip <= 0) and under_blade(s, cut, q[0]):
            s.side[cut, p] = 1 + particle_half(s, cut, p, q[1])


@ti.func
def field_offsets(s: ti.template(), cut, i, code):
    """Where the fields of the nodes (j, k) of a particle are stored, in nodes along y from the lowest one on.

    Those that it sees have their first field, the hidden ones the second.
    """
    at, second = ti.Matrix.zero(ti.i32, 3, 3), s.size[cut, SECOND_OFFSET]
    for j, k in ti.static(ti.ndrange(3, 3)):
        at[j, k] = j
        if ti.static(s.cuts):
            at[j, k] += 0 if k < hidden_from(s, code, i, j) else second
    return at
