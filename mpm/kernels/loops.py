"""What the loops of a time step go over, for one cut or for a batch of them."""

import taichi as ti

from mpm.kernels.fields import BLOCKS, CPU_BLOCK, HOT, LINE, PART, ROW, SLICE, STATIONS
from mpm.kernels.host_transfer import Exchange


class Loops(Exchange):
    """Places of the loops: on CPUs those of one cut, on a GPU those of all cuts in one launch."""

    @ti.func
    def places(self, cut, what: ti.template()):
        """How many places of a cut a loop goes over."""
        n = 1
        if ti.static(what == PART):
            n = self.size[cut, BLOCKS] if ti.static(self.atomic) else self.parts
        elif ti.static(what == SLICE):
            n = self.size[cut, STATIONS]
        elif ti.static(what == LINE):
            n = (self.window[cut, 4] - self.window[cut, 1]) * (self.window[cut, 5] - self.window[cut, 2])
        elif ti.static(what == ROW or what == HOT):
            w = self.box(cut, what)
            n = (w[3] - w[0]) * (w[4] - w[1]) * ((w[5] - w[2]) if ti.static(self.atomic) else 1)
        return n

    @ti.func
    def loop(self, cut, what: ti.template()):
        """How often a loop over the places of a cut repeats; on a GPU it goes over those of all cuts."""
        return self.batch * self.most[what] if ti.static(self.atomic) else self.places(cut, what)

    @ti.func
    def whose(self, cut, q, what: ti.template()):
        """Cut and place that repetition ``q`` of such a loop is for, and whether there is one."""
        c, r, there = cut, q, True
        if ti.static(self.atomic):
            c = q // self.most[what]
            r = q - c * self.most[what]
            there = r < self.places(c, what)
        return c, r, there

    @ti.func
    def on(self, cut):
        """Whether a cut takes part in this step of a launch; its count of steps that are left is already that after the step."""
        return self.left[cut] >= 0 if ti.static(self.atomic) else True

    @ti.func
    def turn_of(self, cut, q, what: ti.template()):
        """The same in a time step, which is only for cuts that have steps left."""
        c, r, there = self.whose(cut, q, what)
        return c, r, there and self.on(c)

    @ti.func
    def box(self, cut, what: ti.template()):
        """Nodes that the particles of a cut can reach, or those of them near what could be damaged: first, last + 1."""
        w = ti.Vector([self.window[cut, d] for d in range(6)])
        if ti.static(what == HOT):
            for d in ti.static(range(3)):
                w[d] = ti.max(w[d], self.hot[cut, d] - 4)
                w[d + 3] = ti.max(ti.min(w[d + 3], self.hot[cut, d + 3] + 7), w[d])
        return w

    @ti.func
    def share(self, cut, part):
        """Blocks of particles, first and last + 1, of one part of a loop over :data:`PART`, and its thread."""
        thread, first, last = 0, 0, 0
        if ti.static(self.atomic):
            first, last = part, part + 1
        elif ti.static(self.threads == 1):
            last = self.size[cut, BLOCKS]
        elif part % CPU_BLOCK == 0:
            thread, blocks = part // CPU_BLOCK, self.size[cut, BLOCKS]
            first, last = blocks * thread // self.threads, blocks * (thread + 1) // self.threads
        return first, last, thread

    @ti.func
    def row(self, cut, r, what: ti.template()):
        """Place i, j of a row of nodes of a box, and its first and last node (excluded); on a GPU each node is a row."""
        w = self.box(cut, what)
        low, high = w[2], w[5]
        if ti.static(self.atomic):
            deep = w[5] - w[2]
            low += r % deep
            r //= deep
            high = low + 1
        wide = w[4] - w[1]
        i = r // wide
        return w[0] + i, w[1] + r - i * wide, low, high
