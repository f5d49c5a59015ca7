"""Rows of the tables that host and kernels share, by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Rows of the table of parameters, which kernels read at run time.
MU, LAM, YIELD, MASS, VOLUME, BLADE_MU, BOARD_MU = range(7)
R_START, INITIATION_DEPTH, SLIP, ZONE, ZONE_MASS, EPS0, EPSF = range(7, 14)
SPINE, WEDGE_COS, WEDGE_SIN, HALF_LENGTH, BLADE_HEIGHT, GRAVITY, TIP_RADIUS, ETA_S, ETA_B = range(14, 23)
YAW_COS, YAW_SIN, ADHESION, ADHESION_GAP = range(23, 27)
ARM_K, ARM_C, ARM_MASS, ARM_LIMIT = range(27, 31)
DX, INV_DX, ORIGIN_X, ORIGIN_Y, ORIGIN_Z, FIRST_STATION = range(31, 37)
SPACING, TIE_OPENING, CONTACT, LAYERED = range(37, 41)
EDGE_BAND, LEAST_GAP = range(41, 43)
SKIN_STIFFNESS, SKIN_POISSON, WIDTH_OF_FORCE, ZONE_MOST, LEAST_WIDTH, LOCAL_DENT = range(43, 49)
EXTENSION, DENT_WIDTH, RELAXING_BULK, BOARD_SUCTION = range(49, 53)
BOW, FOOD_MIDDLE, FOOD_REACH, DAMPER_MASS, DAMPER_RATE = range(53, 58)
N_PARAMETERS = 58

# Rows of the table of sizes: particles, blocks of them, nodes along x, y, z, slices along the edge, the node plane
# along y that is nearest to y = 0, the first and last + 1 node plane along y whose nodes have a second field, how far
# behind the first that is stored, the sum of the indices of two nodes that are mirror images across x, ties across
# the cut plane, and points of the skin.
COUNT, BLOCKS, NODES, STATIONS, PLANE_Y, SECOND_BEGIN, SECOND_END, SECOND_OFFSET, MIRROR_SUM, TIE_COUNT, SKIN_COUNT = (
    0,
    1,
    2,
    5,
    6,
    7,
    8,
    9,
    10,
    11,
    12,
)
N_SIZES = 13

# Rows of the table of sums over an output interval: impulses on edge, faces and board (three each), losses of the
# particles, how many were inverted or left the grid, work of friction and of the edge, moment on the knife, work of
# ties, of sticky faces and of the board's suction.
EDGE, FACE, BOARD = 0, 3, 6
PLASTIC, DAMAGE, VISCOUS, INVERTED, OUTSIDE, FRICTION_WORK, CUTTING_WORK, MOMENT, TIE_WORK, ADHESION_WORK = range(9, 19)
SUCTION_WORK = 19
N_SUMS = 20
N_LOSSES = 5  # rows from PLASTIC to OUTSIDE, which are sums over particles

# Rows of the sums over all particles at an output: momentum (three), kinetic and elastic energy, momentum of their
# dampers (three).
MOMENTUM, KINETIC, ELASTIC, DAMPER_MOMENTUM = 0, 3, 4, 5
N_PARTICLE_SUMS = 8

# Rows of the tool's pose: height of the edge in the middle of the blade, its middle along the blade, their velocities,
# the height that is commanded, the vertical impulse booked before this step; the edge's angle to the board, how fast
# that grows, its cosine and sine.
EDGE_Z, EDGE_S, EDGE_VZ, EDGE_VS, COMMAND, BOOKED_IMPULSE, TILT, TILT_RATE, TILT_COS, TILT_SIN = range(10)
N_POSE = 10

# Rows of the table of orders: how many steps, after how many each a row of the report, time step, velocity upwards and
# along the blade and rate of its tilt that are commanded.
STEPS, STEPS_PER_ROW, DT, SPEED_UP, SPEED_ALONG, SPEED_TILT = range(6)
N_ORDER = 6

# Rows of the table of a stone: its middle, rotation (row by row) and half axes along x, y, z; its velocity and angular
# velocity; by how much the nodes that move with it exceed it [m]; the half of the food that it belongs to, -1 for both;
# impulse of the edge on it so far; height of the edge when it met the stone first, -1 before; the velocity and angular
# velocity that it would have without the flesh of the other half.
STONE_MIDDLE, STONE_TURN, STONE_AXES, STONE_VELOCITY, STONE_SPIN = 0, 3, 12, 15, 18
STONE_REACH, STONE_HALF, STONE_IMPULSE, STONE_MET = range(21, 25)
STONE_ALONE, SPIN_ALONE = 25, 28
N_STONE = 31

# Rows of the sums over the nodes that move with a stone: mass, momentum, moment of mass and moment of momentum about
# its middle, second moments of mass (xx, yy, zz, yz, xz, xy).
NODES_MASS, NODES_MOMENTUM, NODES_MOMENT, NODES_SPIN, NODES_INERTIA = 0, 1, 4, 7, 10
N_STONE_SUMS = 16

# Entries of a particle's stress: Kirchhoff stress (xx, yy, zz, yz, xz, xy), viscous and plastic loss per volume, and
# the trace of the left stretch, negative where the particle must be done by itself.
VISCOUS_LOSS, PLASTIC_LOSS, STRETCH = 6, 7, 8
N_STRESS = 9
STRETCH_AT_REST = 3.0  # trace of the stretch of food that is not strained

N_REPORT = N_SUMS + N_PARTICLE_SUMS + N_POSE


class Report(NamedTuple):
    """What the kernels say of an output interval.

    Attributes:
        sums: Sums over the interval, shape (N_SUMS,).
        particles: Sums over all particles at its end, shape (N_PARTICLE_SUMS,).
        pose: Of the tool at its end, shape (N_POSE,).
    """

    sums: np.ndarray
    particles: np.ndarray
    pose: np.ndarray


def parts_of_report(row: np.ndarray) -> Report:
    """Parts of a row of the report, shape (N_REPORT,)."""
    return Report(*np.split(row, (N_SUMS, N_SUMS + N_PARTICLE_SUMS)))
