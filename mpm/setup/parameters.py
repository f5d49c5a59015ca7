"""The table of parameters that kernels read at run time, and the pose that the tool begins with."""

from __future__ import annotations

import math

import numpy as np

from mpm.discretisation.grid import Grid
from mpm.discretisation.particles import Seeds
from mpm.scene import BAND_CELLS, Press, Scene
from mpm.scene.material import SKIN_POISSON, Material
from mpm.scene.shapes import section_area
from mpm.setup.stable_step import contact_stiffness, damper_rate, retardation_time
from mpm.state import tables as row

ENDLESS = 1e3  # thickness of a wedge that never becomes a plate with parallel faces [m]
UNBOUNDED = 1e30  # yield stress or force that is never reached


def parameters(scene: Scene, material: Material, seeds: Seeds, grid: Grid) -> np.ndarray:
    """The table of parameters.

    Args:
        scene: What is simulated.
        material: Its constants.
        seeds: Its particles.
        grid: Its grid.

    Returns:
        Shape (N_PARAMETERS,), rows as in :mod:`mpm.state.tables`, in SI units.
    """
    table = np.zeros(row.N_PARAMETERS)
    _put_grid(table, scene, grid)
    _put_material(table, scene, material, seeds)
    _put_tool(table, scene, material)
    _put_arm(table, scene, material)
    return table


def _put_grid(table: np.ndarray, scene: Scene, grid: Grid) -> None:
    """Cell, origin, slices and turn of the grid."""
    num = scene.numerics
    table[row.DX], table[row.INV_DX], table[row.FIRST_STATION] = num.dx, 1 / num.dx, grid.stations[0]
    table[row.ORIGIN_X], table[row.ORIGIN_Y], table[row.ORIGIN_Z] = grid.origin
    table[row.YAW_COS], table[row.YAW_SIN] = math.cos(num.grid_turn), math.sin(num.grid_turn)
    table[row.GRAVITY], table[row.EXTENSION] = num.gravity, num.extension


def _put_material(table: np.ndarray, scene: Scene, material: Material, seeds: Seeds) -> None:
    """Constants of the bulk, its damage, its ties across the cut plane and its sticky faces."""
    table[row.MU], table[row.LAM] = material.shear, material.lame
    table[row.YIELD] = min(material.yield_stress, UNBOUNDED)
    table[row.RELAXING_BULK] = material.relaxing_bulk
    table[row.DAMPER_MASS], table[row.DAMPER_RATE] = scene.numerics.damper_mass, damper_rate(scene, material)
    table[row.MASS], table[row.VOLUME] = material.rho * seeds.volume, seeds.volume
    if material.strength is not None and material.fracture_energy is not None:
        eps0 = material.strength / material.E
        band = BAND_CELLS * scene.numerics.dx
        table[row.EPS0] = eps0
        table[row.EPSF] = eps0 / 2 + material.fracture_energy / (material.strength * band)
    beta = retardation_time(scene, material)
    table[row.ETA_S], table[row.ETA_B] = beta * material.shear, beta * (material.lame + 2 / 3 * material.shear)
    table[row.CONTACT] = contact_stiffness(scene, material, seeds.spacing)
    if scene.tied:
        table[row.TIE_OPENING] = material.tie_opening(seeds.spacing, scene.numerics.crack_ties)
        table[row.EDGE_BAND] = scene.numerics.edge_band
        table[row.LAYERED] = material.layered
    table[row.SPACING] = seeds.spacing
    table[row.SKIN_STIFFNESS], table[row.SKIN_POISSON] = material.skin_stiffness, SKIN_POISSON
    table[row.LEAST_GAP] = scene.numerics.least_gap * scene.numerics.dx
    strength = material.sticking_strength(seeds.spacing)
    table[row.ADHESION], table[row.ADHESION_GAP] = strength / (material.rho * seeds.spacing), 1.0
    if strength > 0:
        table[row.ADHESION_GAP] = 2 * material.adhesion_energy / strength


def _put_tool(table: np.ndarray, scene: Scene, material: Material) -> None:
    """Shape and friction of the tools, and the edge's law."""
    edge, tool = scene.edge, scene.knife
    table[row.BLADE_MU], table[row.BOARD_MU] = material.mu, scene.board.mu
    table[row.BOARD_SUCTION], table[row.BOW] = scene.suction, scene.board.bow
    table[row.FOOD_MIDDLE], table[row.FOOD_REACH] = -scene.food.shape.cut, scene.food.shape.length / 2
    table[row.R_START] = material.start
    table[row.INITIATION_DEPTH] = material.initiation_depth
    table[row.SLIP], table[row.ZONE] = edge.slip, scene.process_zone(material)
    table[row.ZONE_MASS] = material.rho * scene.numerics.dx * table[row.ZONE] ** 2
    table[row.WIDTH_OF_FORCE], table[row.ZONE_MOST] = scene.width_of_force(material), scene.widest_zone
    table[row.LEAST_WIDTH] = material.punch_width
    table[row.LOCAL_DENT] = 2 * (1 - material.nu**2) / (math.pi * material.E) * material.start
    table[row.DENT_WIDTH] = scene.dent_width(material)
    if isinstance(tool, Press):
        half, table[row.BLADE_MU], table[row.SPINE] = tool.half_angle, tool.mu, ENDLESS
    else:
        half, table[row.SPINE], table[row.TIP_RADIUS] = tool.angle / 2, tool.spine, tool.radius
        table[row.BLADE_HEIGHT], table[row.HALF_LENGTH] = tool.height, tool.length / 2
    table[row.WEDGE_COS], table[row.WEDGE_SIN] = math.cos(half), math.sin(half)


def _put_arm(table: np.ndarray, scene: Scene, material: Material) -> None:
    """Spring, damper and mass of an arm that yields, damped critically."""
    stiffness = scene.arm.stiffness
    if stiffness is not None:
        table[row.ARM_K], table[row.ARM_LIMIT] = stiffness, scene.arm.force_limit or UNBOUNDED
        table[row.ARM_MASS] = arm_mass(scene, material, stiffness)
        table[row.ARM_C] = 2 * math.sqrt(stiffness * table[row.ARM_MASS])


def arm_mass(scene: Scene, material: Material, stiffness: float) -> float:
    """Mass of the arm: as slow as the food's first axial mode, not lighter than the food beside the blade.

    The real mass is immaterial: in a quasi-static cut the arm's inertia has no part in the force.

    Args:
        scene: What is simulated.
        material: Its constants.
        stiffness: Of the arm's spring [N/m].

    Returns:
        Mass [kg].
    """
    shape = scene.food.shape
    period = 4 * shape.height / material.p_wave
    layer = material.rho * 2 * scene.numerics.dx * section_area(shape)
    return max(stiffness * (period / (2 * math.pi)) ** 2, layer)


def pose(z: float, along: float = 0.0, tilt: float = 0.0) -> np.ndarray:
    """The table of the pose of a tool at rest.

    Args:
        z: Height of the middle of the edge above the board [m].
        along: Place of the middle of the edge along the cut [m].
        tilt: Angle of the edge to the board [rad].

    Returns:
        Shape (N_POSE,), rows as in :mod:`mpm.state.tables`.
    """
    out = np.zeros(row.N_POSE)
    out[row.EDGE_Z] = out[row.COMMAND] = z
    out[row.EDGE_S], out[row.TILT] = along, tilt
    out[row.TILT_COS], out[row.TILT_SIN] = math.cos(tilt), math.sin(tilt)
    return out
