"""Reductions: the nodes in reach of the particles, their momentum and energy, and what the tools were booked."""

import taichi as ti

from mpm.kernels.constitutive.laws import (
    branch_energy,
    damage_of,
    deviatoric_energy,
    left_cauchy_green,
    left_stretch,
    rotation,
    trace,
    unit,
)
from mpm.kernels.crack import IN_CONTACT
from mpm.kernels.dampers import damper_momentum_and_energy
from mpm.kernels.membrane import membrane_energy
from mpm.state.accessors import deformation_gradient, velocity_gradient
from mpm.state.loops import block_range, locate, repetitions
from mpm.state.state import BEYOND_GRID, CUTS, PARTS, SKIN
from mpm.state.stencil import base_node
from mpm.state.tables import (
    BOOKED_IMPULSE,
    COUNT,
    DX,
    EDGE,
    ELASTIC,
    EPS0,
    EPSF,
    FACE,
    LAM,
    MASS,
    MU,
    N_LOSSES,
    N_PARTICLE_SUMS,
    N_POSE,
    N_SUMS,
    NODES,
    PLANE_Y,
    PLASTIC,
    RELAXING_BULK,
    SKIN_COUNT,
    VOLUME,
)

MARGIN = 3  # cells by which the window exceeds the particles; it is renewed at every output


@ti.func
def find_window(s: ti.template(), cut):
    """Find the window: the nodes that any particle touches, some more, and those that mirrors fold back."""
    for q in range(repetitions(s, cut, CUTS)):
        c, _, _ = locate(s, cut, q, CUTS)
        for d in ti.static(range(3)):
            s.window[c, d], s.window[c, d + 3] = BEYOND_GRID, -BEYOND_GRID
    for q in range(repetitions(s, cut, PARTS)):
        c, part, there = locate(s, cut, q, PARTS)
        first, last, _ = block_range(s, c, part)
        if there and first < last:
            low, high = ti.Vector([BEYOND_GRID] * 3), ti.Vector([-BEYOND_GRID] * 3)
            for p in range(first * s.lanes, ti.min(last * s.lanes, s.size[c, COUNT])):
                base, fx = base_node(s, c, s.x[c, p])
                for d in ti.static(range(3)):
                    node = ti.min(ti.max(base[d], -BEYOND_GRID // 2), BEYOND_GRID // 2)
                    low[d], high[d] = ti.min(low[d], node), ti.max(high[d], node)
            for d in ti.static(range(3)):
                if low[d] < s.window[c, d]:  # most change nothing, and on a GPU would wait for each other
                    ti.atomic_min(s.window[c, d], low[d])
                if high[d] > s.window[c, d + 3]:
                    ti.atomic_max(s.window[c, d + 3], high[d])
    for q in range(repetitions(s, cut, CUTS)):
        c, _, _ = locate(s, cut, q, CUTS)
        for d in ti.static(range(3)):
            low, high = s.window[c, d] - MARGIN, s.window[c, d + 3] + MARGIN + 3
            if ti.static((s.mirror_x, s.mirror_y, False)[d]):
                plane = s.plane_x if ti.static(d == 0) else s.size[c, PLANE_Y]
                low, high = ti.min(low, plane - 2), ti.max(high, plane + 3)
            s.window[c, d] = ti.max(low, 0)
            s.window[c, d + 3] = ti.max(ti.min(high, s.size[c, NODES + d]), s.window[c, d])


@ti.func
def report(s: ti.template(), cut, row, out: ti.template()):
    """Write what was booked since the last report, the state of the particles and the pose; clear what was booked.

    Images of mirrors are not counted.
    """
    for q in range(repetitions(s, cut, PARTS)):
        c, part, there = locate(s, cut, q, PARTS)
        first, last, _ = block_range(s, c, part)
        if there and first < last:
            total = ti.Vector.zero(ti.f64, N_PARTICLE_SUMS)
            for p in range(first * s.lanes, ti.min(last * s.lanes, s.size[c, COUNT])):
                total += momentum_and_energy(s, c, p)
            for r in ti.static(range(N_PARTICLE_SUMS)):
                s.particle_sums[c, part % s.copies, r] += total[r]
    if ti.static(s.membrane):
        ti.loop_config(serialize=s.serial)
        for q in range(repetitions(s, cut, SKIN)):
            c, n, there = locate(s, cut, q, SKIN)
            if there:
                s.particle_sums[c, n % s.copies, ELASTIC] += membrane_energy(s, c, n)
    for q in range(repetitions(s, cut, CUTS)):
        c, _, _ = locate(s, cut, q, CUTS)
        for r in range(N_PARTICLE_SUMS):
            out[c, row, N_SUMS + r] = take_sum(s, s.particle_sums, c, r)
        for r in range(N_POSE):
            out[c, row, N_SUMS + N_PARTICLE_SUMS + r] = s.pose[c, r]
        s.pose[c, BOOKED_IMPULSE] -= s.sums[c, EDGE + 2] + s.sums[c, FACE + 2]  # the arm has felt that
        for r in range(s.booked_sums):
            out[c, row, r] = s.sums[c, r]
            s.sums[c, r] = 0.0
        for r in range(N_LOSSES):
            out[c, row, PLASTIC + r] = take_sum(s, s.losses, c, r)


@ti.func
def take_sum(s: ti.template(), field: ti.template(), cut, row):
    """Sum of the copies of a sum over particles or points of the skin, which are cleared."""
    total = ti.cast(0.0, ti.f64)
    if ti.static(s.copies > 1):
        # As many as were added to. A compiler that knew how many would write them out one by one: most of the time
        # before the first step.
        for k in range(ti.min(s.copies, ti.max(s.size[cut, COUNT], s.size[cut, SKIN_COUNT]))):
            total += field[cut, k, row]
            field[cut, k, row] = 0.0
    else:
        for k in range(s.copies):
            total += field[cut, k, row]
            field[cut, k, row] = 0.0
    return total


@ti.func
def momentum_and_energy(s: ti.template(), cut, p):
    """Momentum (3), kinetic and elastic energy of a particle, momentum (3) of its damper [N s, J].

    The kinetic energy is that of the motion, without what contact has just given: the stress that will balance it has
    not acted yet. Food at rest on a board would else have the energy of the fall that the board stops in every step.
    """
    m, u = s.par[cut, MASS] * s.volume_ratio[cut, p], s.v[cut, p]
    spin = velocity_gradient(s, cut, p).norm_sqr()
    f = deformation_gradient(s, cut, p)
    j = f.determinant()
    v = unit()
    if j > 0:
        v = left_stretch(left_cauchy_green(f), j)
    d = 0.0
    if ti.static(s.damage):
        d = damage_of(s.kappa[cut, p], s.par[cut, EPS0], s.par[cut, EPSF])
    vol = 0.5 * s.par[cut, LAM] * (j - 1) ** 2
    dev = deviatoric_energy(v, s.par[cut, MU])
    if ti.static(s.branches > 0):
        if j > 0:  # an inverted one ends the run
            dev, vol = relaxed_energy(s, cut, p, f, v, j, dev, vol)
    keep = 1.0 - d
    given = s.contact_moment[cut, p, 0][3] if s.visibility[cut, p] & IN_CONTACT else 0.0
    kinetic = m * (0.5 * u.norm_sqr() - given + 0.125 * s.par[cut, DX] * s.par[cut, DX] * spin)
    energy = s.par[cut, VOLUME] * s.volume_ratio[cut, p] * (keep * dev + (keep if j > 1 else 1.0) * vol)
    damper = damper_momentum_and_energy(s, cut, p)
    kinetic += damper[3]
    return ti.Vector([m * u[0], m * u[1], m * u[2], kinetic, energy, damper[0], damper[1], damper[2]])


@ti.func
def relaxed_energy(s: ti.template(), cut, p, f, v, j, dev, vol):
    """Elastic energy of a particle that relaxes, with that of its branches.

    Args:
        f: Deformation gradient.
        v: Its left stretch V.
        j: Its determinant.
        dev: Energy of its stretch without relaxation, mu |V - 1|^2 [J/m^3].
        vol: That of its change of volume [J/m^3].

    Returns:
        Energy of shape and of volume [J/m^3].
    """
    mu, volume = s.par[cut, MU], s.par[cut, RELAXING_BULK]
    bulk = s.par[cut, LAM] + 2 * mu / 3
    back = (rotation(f, v, j).transpose() @ f).inverse()
    swell = mu / 3 * (trace(v) - 3) ** 2  # the part of the first one that belongs to the volume, too
    shape, whole = dev - swell, vol + swell
    shape_now, whole_now = shape, whole  # of both, without what the branches have lost
    for b in ti.static(range(s.branches)):
        share, h = s.prony_share[cut, b], s.prony_stress[cut, b, p]
        own_shape, own_whole = branch_energy(h, back, j, mu, bulk)
        shape_now += own_shape / share - share * shape
        if volume > 0:
            whole_now += own_whole / (volume * share) - volume * share * bulk / 2 * (j - 1) ** 2
    return shape_now, whole_now
