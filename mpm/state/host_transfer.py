"""What the host writes into the fields before a run, and what it reads from them.

Each by one kernel for all fields: to make a cached kernel ready takes time however small it is (docs/theory.md,
"Measured choices").
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpm.discretisation.particles import Particles
from mpm.state.contents import (
    ADHERING,
    BOARD_GAP,
    CUT_BEFORE,
    FLOOR_HIGH,
    FLOOR_LOW,
    FLOOR_POWER,
    LEFT,
    N_PARTICLE,
    N_SKIN,
    N_SLICE,
    N_TIE,
    POSITION,
    RIGHT,
    SHARE,
    SKIN_AREA,
    SKIN_HALF,
    SKIN_LENGTH,
    SKIN_POSITION,
    SKIN_SIDES,
    SKIN_TIE,
    SOFTENING,
    STARTED,
    SURFACE_VOLUME,
    TOOL_GAP,
    TOP_HIGH,
    TOP_LOW,
    TOP_POWER,
    TOP_TOUGHNESS,
    TOUGHNESS,
    VOLUME_RATIO,
    WIDTH,
    Contents,
)
from mpm.state.state import FACE_POINTS, SECOND_FIELD_CELLS, State
from mpm.state.tables import (
    COUNT,
    N_PARAMETERS,
    N_POSE,
    N_SIZES,
    N_STONE,
    SKIN_COUNT,
    STATIONS,
    STRETCH,
    STRETCH_AT_REST,
    TIE_COUNT,
    ZONE,
)

# Columns of the table of particles that is read after some steps: position, half, deformation gradient, Kirchhoff
# stress and the largest strain of bulk damage.
HALF, DEFORMATION, STRESS, STRAIN = 3, 4, 13, 19
N_PARTICLE_NOW = 20

INTEGERS = ti.types.ndarray(dtype=ti.i32, ndim=2)
ROWS = ti.types.ndarray(dtype=ti.f64, ndim=2)
TABLES = ti.types.ndarray(dtype=ti.f64, ndim=3)


def begin(state: State, cuts: Sequence[Contents]) -> None:
    """Put cuts side by side, their particles at rest and unstrained, nothing cut and nothing booked.

    Args:
        state: Fields with room for them.
        cuts: What each begins with.
    """
    sizes = np.zeros((state.batch, N_SIZES), np.int32)
    sizes[: len(cuts)] = [_sizes(state, cut) for cut in cuts]
    state.n = sizes[:, COUNT]
    _write(
        state,
        sizes,
        _table(state, (state.n.max(), N_PARTICLE), [cut.particles for cut in cuts]),
        _table(state, (sizes[:, STATIONS].max(), N_SLICE), [cut.slices for cut in cuts]),
        _table(state, (N_PARAMETERS,), [cut.parameters for cut in cuts]),
        _table(state, (N_POSE,), [cut.pose for cut in cuts]),
        _table(state, (2, max(state.branches, 1)), [cut.relaxation for cut in cuts]),
    )
    if state.cuts:
        _write_ties(
            state,
            _table(state, (max(sizes[:, TIE_COUNT].max(), 1), N_TIE), [cut.ties for cut in cuts]),
            _table(state, (max(sizes[:, TIE_COUNT].max(), 1), 2 * state.rows), [cut.tie_rows for cut in cuts]),
            _table(state, (state.n.max(),), [cut.half for cut in cuts]),
        )
    if state.membrane:
        _write_skin(state, _table(state, (sizes[:, SKIN_COUNT].max(), N_SKIN), [cut.skin for cut in cuts]))
    if state.stone:
        state.stone_pose.from_numpy(_table(state, (N_STONE,), [cut.stone for cut in cuts]))


def _sizes(state: State, cut: Contents) -> list[int]:
    """Row of the table of sizes."""
    n, nodes = len(cut.particles), cut.nodes
    first = 0 if state.turned else max(cut.plane - SECOND_FIELD_CELLS, 0)
    end = nodes[1] if state.turned else min(cut.plane + SECOND_FIELD_CELLS + 1, nodes[1])
    blocks, mirror_sum = -(-n // state.lanes), 2 * state.plane_x - cut.between
    second = [first, end, nodes[1] - first]
    return [n, blocks, *nodes, len(cut.slices), cut.plane, *second, mirror_sum, len(cut.ties), len(cut.skin)]


def _table(state: State, shape: tuple[int, ...], parts: Sequence[np.ndarray]) -> np.ndarray:
    """Tables of cuts in one, filled up with zeros."""
    out = np.zeros((state.batch, *shape))
    for one, given in zip(out, parts, strict=False):
        one[tuple(slice(n) for n in given.shape)] = given
    return out


@ti.kernel
def _write(
    s: ti.template(),
    sizes: INTEGERS,
    particles: TABLES,
    slices: TABLES,
    parameters: ROWS,
    pose: ROWS,
    relaxation: TABLES,
):
    """Write the tables into the fields, and empty those that a run begins with empty."""
    for c, k in s.size:
        s.size[c, k] = sizes[c, k]
    for c, k in s.par:
        s.par[c, k] = ti.cast(parameters[c, k], float)
    for c, k in s.pose:
        s.pose[c, k] = pose[c, k]
    for c, b in s.prony_rate:
        s.prony_share[c, b] = ti.cast(relaxation[c, 0, b], float)
        s.prony_rate[c, b] = ti.cast(relaxation[c, 1, b], float)
    for c, p in s.x:
        row = ti.Vector.zero(float, N_PARTICLE)
        if p < sizes[c, COUNT]:
            for k in ti.static(range(N_PARTICLE)):
                row[k] = ti.cast(particles[c, p, k], float)
        s.x[c, p] = ti.Vector([row[POSITION], row[POSITION + 1], row[POSITION + 2]])
        s.face_rise[c, p] = ti.Vector([0.0, 0.0, 1.0])
        s.board_gap[c, p], s.tool_gap[c, p], s.volume_ratio[c, p] = row[BOARD_GAP], row[TOOL_GAP], row[VOLUME_RATIO]
        s.surface_volume[c, p] = ti.Vector([row[SURFACE_VOLUME], row[SURFACE_VOLUME + 1]])
        s.adhering[c, p] = ti.cast(row[ADHERING], ti.i32)
        s.v[c, p], s.damper_v[c, p] = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
        s.side[c, p] = 0
        s.visibility[c, p] = 0
        for b in ti.static(range(2)):
            s.stick[c, b, p] = ti.Vector.zero(float, 3)
        if ti.static(s.branches > 0):
            s.prony_before[c, p] = ti.Matrix.zero(float, 3, 3)
            for b in ti.static(range(s.branches)):
                s.prony_stress[c, b, p] = ti.Matrix.zero(float, 3, 3)
    for c, p, d in s.C:
        s.C[c, p, d] = ti.Vector.zero(float, 4)
    for c, b, r in s.F:
        for lane in ti.static(range(s.lanes)):
            s.F[c, b, r][lane] = 1.0 if r % 4 == 0 else 0.0
            s.tau[c, b, r][lane] = STRETCH_AT_REST if r == STRETCH else 0.0
    for q in s.u:  # the edge also looks at nodes that no particle has reached yet
        s.u[q] = ti.Vector.zero(float, 4)
    for c, p in s.kappa:
        s.kappa[c, p] = 0.0
        s.driving_strain[c, p] = 0.0
    for c, i in s.cut_depth:
        row = ti.Vector.zero(float, N_SLICE)
        if i < sizes[c, STATIONS]:
            for k in ti.static(range(N_SLICE)):
                row[k] = ti.cast(slices[c, i, k], float)
        s.top_high[c, i], s.top_low[c, i], s.width[c, i] = row[TOP_HIGH], row[TOP_LOW], row[WIDTH]
        s.floor_high[c, i], s.floor_low[c, i] = row[FLOOR_HIGH], row[FLOOR_LOW]
        s.top_power[c, i], s.floor_power[c, i] = row[TOP_POWER], row[FLOOR_POWER]
        s.softening[c, i], s.top_toughness[c, i] = row[SOFTENING], row[TOP_TOUGHNESS]
        s.slip[c, i] = ti.Vector.zero(float, 2)
        s.reaction[c, i] = ti.Vector.zero(float, 2)
        s.line[c, i], s.zone[c, i] = 0.0, s.par[c, ZONE]
        s.zone_velocity[c, i] = ti.Vector.zero(float, 3)
        s.cut_depth[c, i] = 0.0
        s.front_drift[c, i], s.dent_over_width[c, i] = 0.0, 0.0
        s.start_force[c, i] = row[STARTED]
        s.contact_part[c, i] = 0.0
        s.crack_front[c, i] = 1e3
    for c, k in s.sums:
        s.sums[c, k] = 0.0
    for c, k, r in s.losses:
        s.losses[c, k, r] = 0.0
    for c, k, r in s.particle_sums:
        s.particle_sums[c, k, r] = 0.0


@ti.kernel
def _write_ties(s: ti.template(), ties: TABLES, rows: TABLES, half: ROWS):
    """Write the ties across the cut plane, whole, and what they leave to the edge."""
    for c, p in s.half:
        s.half[c, p] = ti.cast(half[c, p], ti.i32) if p < s.size[c, COUNT] else 0
    for c, n in s.tie_toughness:
        row = ti.Vector.zero(float, N_TIE)
        if n < s.size[c, TIE_COUNT]:
            for k in ti.static(range(N_TIE)):
                row[k] = ti.cast(ties[c, n, k], float)
        s.tie_ends[c, n] = ti.Vector([ti.cast(row[LEFT], ti.i32), ti.cast(row[RIGHT], ti.i32)])
        s.tie_toughness[c, n], s.tie_share[c, n] = row[TOUGHNESS], row[SHARE]
        for q in range(FACE_POINTS):
            s.largest_opening[c, n, q], s.cut_part[c, n, q] = 0.0, row[CUT_BEFORE]
        for k in range(s.rows):
            there = n < s.size[c, TIE_COUNT]
            s.row_toughness[c, n, k] = ti.cast(rows[c, n, k], float) if there else 0.0
            s.row_share[c, n, k] = ti.cast(rows[c, n, s.rows + k], float) if there else 0.0
        s.face_shear[c, n] = ti.Vector.zero(float, 2)
    for c, i in s.passing:
        s.passing[c, i] = ti.Vector.zero(float, 3)
        s.at_edge[c, i] = ti.Vector.zero(float, 3)
        s.part_left[c, i], s.most_passed[c, i] = 1.0, 0.0
        s.passed_mean[c, i] = ti.Vector([s.top_toughness[c, i], s.top_toughness[c, i]])
        s.start_excess[c, i] = 0.0


@ti.kernel
def _write_skin(s: ti.template(), skin: TABLES):
    """Write the points of the skin, unstretched."""
    for c, n in s.skin_area:
        row = ti.Vector.zero(float, N_SKIN)
        if n < s.size[c, SKIN_COUNT]:
            for k in ti.static(range(N_SKIN)):
                row[k] = ti.cast(skin[c, n, k], float)
        s.skin_x[c, n] = ti.Vector([row[SKIN_POSITION + d] for d in range(3)])
        for side in ti.static(range(2)):
            s.skin_sides[c, n, side] = ti.Vector([row[SKIN_SIDES + 3 * side + d] for d in range(3)])
        s.skin_area[c, n], s.skin_half[c, n] = row[SKIN_AREA], ti.cast(row[SKIN_HALF], ti.i32)
        s.skin_tie[c, n], s.skin_length[c, n] = ti.cast(row[SKIN_TIE], ti.i32), row[SKIN_LENGTH]
        s.skin_visibility[c, n] = 0
    if ti.static(s.cuts):
        for c, n in s.skin_pull:
            s.skin_pull[c, n] = ti.Vector.zero(float, 3)


def particles(state: State, cut: int = 0) -> Particles:
    """The particles of a cut now."""
    out = np.zeros((state.n[cut], N_PARTICLE_NOW))
    _read(state, cut, out)
    x, side, f, tau, kappa = np.split(out, (HALF, DEFORMATION, STRESS, STRAIN), axis=1)
    return Particles(x, side[:, 0].astype(int), f.reshape(-1, 3, 3), tau, kappa[:, 0])


@ti.kernel
def _read(s: ti.template(), cut: int, out: ROWS):
    """Write a row for each particle."""
    for p in range(s.size[cut, COUNT]):
        block, lane = p // s.lanes, p % s.lanes
        for d in ti.static(range(3)):
            out[p, d] = s.x[cut, p][d]
        out[p, HALF] = s.side[cut, p]
        for r in ti.static(range(9)):
            out[p, DEFORMATION + r] = s.F[cut, block, r][lane]
        for r in ti.static(range(6)):
            out[p, STRESS + r] = s.tau[cut, block, r][lane]
        if ti.static(s.damage):
            out[p, STRAIN] = s.kappa[cut, p]


def of_particles(state: State, field: Any, cut: int = 0) -> np.ndarray:
    """A field's entries of the particles of a cut.

    Args:
        state: The fields.
        field: One of them.
        cut: Which of the cuts side by side.

    Returns:
        Its entries, shape (n, ...).
    """
    out: np.ndarray = field.to_numpy()[cut, : state.n[cut]]
    return out


def fill(state: State, field: Any, values: np.ndarray) -> None:
    """Set the entries of a field of the particles of the first cut.

    Args:
        state: The fields.
        field: One of them.
        values: In the field's unit [-], shape (n, ...).
    """
    out = field.to_numpy()
    out[0, : state.n[0]] = values
    field.from_numpy(out)


def velocity_gradients(state: State, cut: int = 0) -> np.ndarray:
    """Velocity gradients of the particles of a cut [1/s], shape (n, 3, 3)."""
    out: np.ndarray = state.C.to_numpy()[cut, : state.n[cut], :, :3].transpose(0, 2, 1)
    return out


def set_velocity_gradients(state: State, values: np.ndarray) -> None:
    """Set the velocity gradients of the particles of the first cut [1/s], shape (n, 3, 3)."""
    c = state.C.to_numpy()
    c[0, : state.n[0], :, :3] = np.transpose(values, (0, 2, 1))
    state.C.from_numpy(c)


def set_pose(state: State, values: np.ndarray) -> None:
    """Set the tool's pose of the first cut, shape (N_POSE,)."""
    out = state.pose.to_numpy()
    out[0] = values
    state.pose.from_numpy(out)
