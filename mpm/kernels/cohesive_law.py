"""Cohesive law of the cutting edge: the force that a slice of it needs to part the food."""

import taichi as ti

from mpm.state.tables import (
    DENT_WIDTH,
    INITIATION_DEPTH,
    LAYERED,
    LEAST_WIDTH,
    LOCAL_DENT,
    R_START,
    SLIP,
    STATIONS,
    ZONE,
)

LEAST_DEPTH = 0.1  # of the indentation at which a cut starts, where the zone is narrower than the strip it is that of
AT_ONCE = 1e-9  # length of a fall in bare flesh [m], of no way that a step takes


@ti.func
def line_force(s: ti.template(), cut, i, tangential, forward, part):
    """Force per length of the edge in one slice after it moved against the material [N/m]: along the edge, forward.

    The slip is elastic up to a limit and points where the edge goes. A cut starts where the force reaches the
    threshold, at the indentation that belongs to it and what a wide zone hides of the food's own. From there it runs
    along the blade to every slice that already carries the propagation resistance there: growing a crack takes less
    than starting one. Then the force falls to that resistance, or is it at once where a layer below is tougher than the
    threshold. Until the start the slip is the mean over the part of the slice that the edge has reached: on a round top
    more of it comes into contact, unslipped, as the edge goes down. The force acts against the motion and only the way
    forward makes new surface, so that with a slice/push ratio xi the forward force is R / (1 + xi^2) (Atkins, Xu and
    Jeronimidis 2004).

    Args:
        i: The slice.
        tangential: Way of the edge against the material along itself in this step [m].
        forward: The same forward [m].
        part: Part of the slice that the edge is in [-].
    """
    limit, flesh = s.par[cut, SLIP], resistance_left(s, cut, i)
    held = 1.0
    if s.start_force[cut, i] <= 0:  # what has come into contact since has not slipped yet
        held = ti.min(1.0, s.contact_part[cut, i] / part)
    s.contact_part[cut, i] = part
    e = held * s.slip[cut, i] + ti.Vector([tangential, forward])
    e[1] = ti.max(e[1], 0.0)
    size = e.norm()
    steep = e[1] / size if size > 0 else 0.0
    level = 0.0
    if s.start_force[cut, i] <= 0:
        least = LEAST_DEPTH * s.par[cut, INITIATION_DEPTH]
        level = s.par[cut, R_START] * size / ti.max(s.par[cut, INITIATION_DEPTH] + hidden_dent(s, cut, i), least)
        if level >= s.par[cut, R_START] or (s.started_beside[cut, i] > 0 and level >= flesh):
            s.start_force[cut, i] = ti.max(level, 1e-9)
            s.start_excess[cut, i] = ti.max(level - s.passed_mean[cut, i][1], 0.0)
            e *= limit / ti.max(size, 1e-30)  # without resistance a cut starts before the edge has slipped
    else:
        if size > limit:
            s.cut_depth[cut, i] += (size - limit) * steep
            e *= limit / size
            size = limit
        start = flesh + s.start_excess[cut, i]
        level = softening_law(s.cut_depth[cut, i], s.softening[cut, i], start, flesh) * size / limit
    s.slip[cut, i], s.line[cut, i] = e, level
    return level * steep * e / ti.max(e.norm(), 1e-30)


@ti.func
def hidden_dent(s: ti.template(), cut, i):
    """The part of the food's dent under the starting force that the process zone hides before the start [m].

    A line force F on a width w sinks by 2 (1 - nu^2) / (pi E) F ln(l / w), where l is a length far away (Johnson 1985,
    Contact Mechanics, section 2.4). The zone grows with the force beyond its width while it cuts, and to more than just
    bears the force. What the greater width hides of the dent the edge sinks into its zone, so that the stroke at which
    a cut starts does not hang on the width. A zone that is narrower than the food asks for hides nothing: there the
    food flows. Where the zone while it cuts is not as wide as the strip under which the food's indentation is told, the
    dent between the two is as measured in the food (:func:`mpm.kernels.cutting_edge.follow_dent_over_width`).
    """
    bears = s.line[cut, i] * s.par[cut, LEAST_WIDTH]
    cuts, strip = ti.max(s.par[cut, ZONE], bears), ti.max(s.par[cut, DENT_WIDTH], bears)
    grown = s.par[cut, LOCAL_DENT] * ti.log(ti.max(s.zone[cut, i] / cuts, 1.0))
    return grown + s.dent_over_width[cut, i] * ti.log(cuts / strip)


@ti.func
def resistance_left(s: ti.template(), cut, i):
    """Line force in a slice that the opening of the food ahead of the edge leaves to it [N/m].

    It is the mean over the ties that the edge passes; where it passes none it stays what it was. In a food of layers it
    is the part that these have left of the toughness at the edge; where only the last of them are passed, which are
    mostly cut, that part says nothing of the food.
    """
    if s.par[cut, LAYERED] > 0:
        s.most_passed[cut, i] = ti.max(s.most_passed[cut, i], s.passing[cut, i][2])
        if s.passing[cut, i][2] > 0.5 * s.most_passed[cut, i]:
            s.part_left[cut, i] = s.passing[cut, i][0] / s.passing[cut, i][1]
        if s.at_edge[cut, i][1] > 0:
            s.passed_mean[cut, i][1] = s.at_edge[cut, i][0] / s.at_edge[cut, i][1]
        s.passed_mean[cut, i][0] = s.part_left[cut, i] * s.passed_mean[cut, i][1]
    elif s.passing[cut, i][2] > 0:
        s.passed_mean[cut, i] = ti.Vector([s.passing[cut, i][0], s.passing[cut, i][1]]) / s.passing[cut, i][2]
    return s.passed_mean[cut, i][0]


@ti.func
def softening_law(depth, softening, start, resistance):
    """Line force that the edge can carry [N/m].

    It falls from the force at which the cut started to the propagation resistance, over the way through the skin. Bare
    flesh has none: what the start took beyond the resistance is spent at once.

    Args:
        depth: Way that has been cut since the start [m].
        softening: Length over which the force falls [m], 0 for at once.
        start: Force at which the cut started [N/m].
        resistance: Propagation resistance [N/m].
    """
    return resistance + (start - resistance) * ti.exp(-depth / ti.max(softening, AT_ONCE))


@ti.func
def count_started_beside(s: ti.template(), cut, i):
    """Count the neighbours of a slice in which the cut has started."""
    s.started_beside[cut, i] = 0
    for d in ti.static((-1, 1)):
        if 0 <= i + d < s.size[cut, STATIONS]:
            s.started_beside[cut, i] += ti.cast(s.start_force[cut, i + d] > 0, ti.i32)
