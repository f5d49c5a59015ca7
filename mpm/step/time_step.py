"""A time step as its table of contents, and the kernels that make many of them."""

from collections.abc import Sequence

import numpy as np
import taichi as ti

from mpm.kernels.constitutive.damage import clear_damage_box, smooth_driving_strain
from mpm.kernels.crack import advance_crack_fronts
from mpm.kernels.cutting_edge import apply_edge_law, follow_slices
from mpm.kernels.g2p import grid_to_particles
from mpm.kernels.grid_update import clear_grid, fold_mirror_images, update_grid
from mpm.kernels.membrane import grid_to_skin, skin_to_grid
from mpm.kernels.outer_nodes import extend_interior
from mpm.kernels.p2g import particles_to_grid
from mpm.kernels.reductions import find_window, report
from mpm.kernels.stone.rigid_motion import move_stone
from mpm.kernels.ties import hold_together
from mpm.kernels.tool import move_tools, set_tool_velocity
from mpm.state.host_transfer import ROWS, TABLES
from mpm.state.loops import locate, repetitions, takes_part
from mpm.state.state import CPU_BLOCK, CUTS, State
from mpm.state.tables import N_ORDER, N_REPORT, STEPS, STEPS_PER_ROW


@ti.func
def time_step(s: ti.template(), cut):
    """One time step of a cut, on a GPU of all cuts that have steps left."""
    begin_step(s, cut)
    if ti.static(s.cuts):
        advance_crack_fronts(s, cut)
    clear_grid(s, cut)
    particles_to_grid(s, cut)  # with the constitutive update
    if ti.static(s.membrane):
        skin_to_grid(s, cut)
    if ti.static(s.mirror_x):
        fold_mirror_images(s, cut)
    update_grid(s, cut)
    if ti.static(s.cuts):
        apply_edge_law(s, cut)
    if ti.static(s.cuts and not s.nodal and not s.stone):
        extend_interior(s, cut)
    if ti.static(s.stone):
        move_stone(s, cut)
    if ti.static(s.cuts):
        follow_slices(s, cut)
    move_tools(s, cut)
    grid_to_particles(s, cut)  # with the contact of the particles
    if ti.static(s.membrane):
        grid_to_skin(s, cut)
    if ti.static(s.cuts):
        hold_together(s, cut)
    if ti.static(s.damage):
        smooth_driving_strain(s, cut)


@ti.func
def begin_step(s: ti.template(), cut: ti.template()):
    """Count the step, and find the velocities of the tools in it."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, CUTS)):
        c, _, _ = locate(s, cut, q, CUTS)
        if ti.static(s.atomic):
            s.steps_left[c] -= 1
        if takes_part(s, c):
            begin_step_of(s, c)


@ti.func
def begin_step_of(s: ti.template(), cut):
    """Begin the step of one cut."""
    set_tool_velocity(s, cut)
    if ti.static(s.damage):
        clear_damage_box(s, cut)


@ti.func
def steps_to_row(s: ti.template(), cut, row):
    """Steps of a cut before row ``row`` of its report."""
    every, steps = ti.cast(s.order[cut, STEPS_PER_ROW], ti.i32), ti.cast(s.order[cut, STEPS], ti.i32)
    return ti.math.clamp(steps - row * every, 0, every)


@ti.func
def follow_orders(s: ti.template(), cut, out: ti.template()):
    """All time steps of a cut that are ordered."""
    ti.loop_config(serialize=True)
    for r in range(out.shape[1]):
        n = steps_to_row(s, cut, r)
        if n > 0:
            find_window(s, cut)
            for _ in range(n):
                time_step(s, cut)
            report(s, cut, r, out)


@ti.func
def read_orders(s: ti.template(), orders: ti.template()):
    """Take orders."""
    for c, k in s.order:
        s.order[c, k] = orders[c, k]


@ti.kernel
def _steps(s: ti.template(), orders: ROWS, out: TABLES):
    """All time steps that are ordered without leaving the kernel, one thread a cut, with the rows of the report."""
    read_orders(s, orders)
    if ti.static(s.batch == 1):
        follow_orders(s, 0, out)
    else:
        for part in range(s.batch * CPU_BLOCK):
            if part % CPU_BLOCK == 0:
                follow_orders(s, part // CPU_BLOCK, out)


@ti.kernel
def _step(s: ti.template()):
    """One time step, its loops in parallel."""
    time_step(s, 0)


@ti.kernel
def _begin_row(s: ti.template(), orders: ROWS, row: int):
    """Renew the window, before the steps that lead to a row of the report."""
    read_orders(s, orders)
    find_window(s, 0)
    if ti.static(s.atomic):
        for c in range(s.batch):
            s.steps_left[c] = steps_to_row(s, c, row)


@ti.kernel
def _write_row(s: ti.template(), out: TABLES):
    """One row of the report."""
    report(s, 0, 0, out)


def advance(state: State, orders: Sequence[Sequence[float]]) -> np.ndarray:
    """Make the time steps that are ordered.

    Args:
        state: The cuts.
        orders: Of each cut steps, after how many each a row of the report, time step [s], velocity upwards and along
            the blade [m/s] and rate of its tilt [rad/s] (:class:`mpm.run.Order`); no steps for one that rests.

    Returns:
        Rows of the report of each cut, shape (cuts, most rows, N_REPORT); a cut with fewer has the first of them.
    """
    table = np.zeros((state.batch, N_ORDER))
    table[:, STEPS_PER_ROW] = 1
    table[: len(orders)] = orders
    counts, every = table[:, STEPS].astype(int), table[:, STEPS_PER_ROW].astype(int)
    rows = int((-(-counts // every)).max())
    out = np.zeros((state.batch, rows, N_REPORT))
    if state.threads == 1 and not state.atomic:
        _steps(state, table, out)
        return out
    for r in range(rows):
        _begin_row(state, table, r)
        for _ in range(np.clip(counts - r * every, 0, every).max()):
            _step(state)
        line = np.zeros((state.batch, 1, N_REPORT))
        _write_row(state, line)
        out[:, r] = line[:, 0]
    return out
