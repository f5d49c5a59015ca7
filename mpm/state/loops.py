"""What the loops of a time step go over, for one cut or for a batch of them.

On CPUs a loop goes over the places of one cut, on a GPU over those of all cuts in one launch. The kinds of loops are
:data:`mpm.state.state.CUTS` and those beside it.

A function that has such loops takes ``cut`` by reference (``ti.template()``): a copy outside the loops would be a
launch of its own. Short loops are run where the kernel was launched (``serialize``): to wake the threads costs more
(docs/theory.md, "Measured choices").
"""

import taichi as ti

from mpm.state.state import CPU_BLOCK, DAMAGE_ROWS, NODE_ACROSS, NODE_LINES, NODE_ROWS, PARTS, SKIN, SLICES, TIES
from mpm.state.tables import BLOCKS, SKIN_COUNT, STATIONS, TIE_COUNT


@ti.func
def extent(s: ti.template(), cut, what: ti.template()):
    """How many places of a cut a loop goes over."""
    n = 1
    if ti.static(what == PARTS):
        n = s.size[cut, BLOCKS] if ti.static(s.atomic) else s.parts
    elif ti.static(what == SLICES):
        n = s.size[cut, STATIONS]
    elif ti.static(what == TIES):
        n = s.size[cut, TIE_COUNT]
    elif ti.static(what == SKIN):
        n = s.size[cut, SKIN_COUNT]
    elif ti.static(what == NODE_LINES):
        n = (s.window[cut, 4] - s.window[cut, 1]) * (s.window[cut, 5] - s.window[cut, 2])
    elif ti.static(what == NODE_ACROSS):
        n = (s.window[cut, 3] - s.window[cut, 0]) * (s.window[cut, 5] - s.window[cut, 2])
    elif ti.static(what == NODE_ROWS or what == DAMAGE_ROWS):
        w = node_box(s, cut, what)
        n = (w[3] - w[0]) * (w[4] - w[1]) * ((w[5] - w[2]) if ti.static(s.atomic) else 1)
    return n


@ti.func
def repetitions(s: ti.template(), cut, what: ti.template()):
    """How often a loop over the places of a cut repeats; on a GPU it goes over those of all cuts."""
    return ti.static(s.batch * s.extents[what]) if ti.static(s.atomic) else extent(s, cut, what)


@ti.func
def locate(s: ti.template(), cut, q, what: ti.template()):
    """Cut and place that repetition ``q`` of such a loop is for, and whether there is one."""
    c, r, there = cut, q, True
    if ti.static(s.atomic):
        c = q // ti.static(s.extents[what])
        r = q - c * ti.static(s.extents[what])
        there = r < extent(s, c, what)
    return c, r, there


@ti.func
def takes_part(s: ti.template(), cut):
    """Whether a cut takes part in this step of a launch; its steps that are left are already those after the step."""
    return s.steps_left[cut] >= 0 if ti.static(s.atomic) else True


@ti.func
def locate_active(s: ti.template(), cut, q, what: ti.template()):
    """As :func:`locate` in a time step, which is only for cuts that have steps left."""
    c, r, there = locate(s, cut, q, what)
    return c, r, there and takes_part(s, c)


@ti.func
def node_box(s: ti.template(), cut, what: ti.template()):
    """Nodes that the particles of a cut can reach, or those of them near what could be damaged: first, last + 1."""
    w = ti.Vector([s.window[cut, d] for d in range(6)])
    if ti.static(what == DAMAGE_ROWS):
        for d in ti.static(range(3)):
            w[d] = ti.max(w[d], s.damage_box[cut, d] - 4)
            w[d + 3] = ti.max(ti.min(w[d + 3], s.damage_box[cut, d + 3] + 7), w[d])
    return w


@ti.func
def block_range(s: ti.template(), cut, part):
    """Blocks of particles, first and last + 1, of one part of a loop over :data:`PARTS`, and its thread."""
    thread, first, last = 0, 0, 0
    if ti.static(s.atomic):
        first, last = part, part + 1
    elif ti.static(s.threads == 1):
        last = s.size[cut, BLOCKS]
    elif part % CPU_BLOCK == 0:
        thread, blocks = part // CPU_BLOCK, s.size[cut, BLOCKS]
        first, last = blocks * thread // s.threads, blocks * (thread + 1) // s.threads
    return first, last, thread


@ti.func
def node_row(s: ti.template(), cut, r, what: ti.template()):
    """Place i, j of a row of nodes of a box, and its first and last node (excluded); on a GPU each node is a row."""
    w = node_box(s, cut, what)
    low, high = w[2], w[5]
    if ti.static(s.atomic):
        deep = w[5] - w[2]
        low += r % deep
        r //= deep
        high = low + 1
    wide = w[4] - w[1]
    i = r // wide
    return w[0] + i, w[1] + r - i * wide, low, high
