"""Scenes of the cases of fracture: blocks parted by a tall wedge on a smooth board, without gravity."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from calib.material.cut_speed import quasi_static_mach
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from studies.verification.case import SuiteOptions

TUBER_E, NU, TUBER_R, TUBER_STRENGTH = 9.5e6, 0.3, 87.0, 0.3e6
"""Young's modulus [Pa], Poisson's ratio [-], work of new surface [J/m^2] and strength [Pa] of a stiff tuber."""
DENT = 0.2e-3  # indentation at which the cut starts [m]: little, because the finite elements have no start to overcome
ZONE = 4e-3  # process zone of the edge [m]
LEAST_MACH = 3e-3  # least speed of the blade over that of the P-wave, which decides how long the cases take


def brittle(modulus: float, toughness: float, strength: float) -> Material:
    """An elastic food that parts by a cohesive crack.

    Args:
        modulus: Young's modulus [Pa].
        toughness: Work of new surface R [J/m^2].
        strength: Cohesive strength [Pa].

    Returns:
        Its constants; the loss factor of 0.02 damps waves.
    """
    return Material(
        E=modulus,
        nu=NU,
        rho=1000.0,
        R=toughness,
        tensile_strength=strength,
        initiation_depth=DENT,
        loss_factor=0.02,
    )


TUBER = brittle(TUBER_E, TUBER_R, TUBER_STRENGTH)


@dataclass(frozen=True)
class Wedge:
    """A blade that is taller than what it cuts, as that of the finite elements is.

    Attributes:
        degrees: Angle between its faces [degrees].
        thickness: Where the wedge ends [m].
    """

    degrees: float
    thickness: float = 2e-3

    @property
    def angle(self) -> float:
        """Angle between its faces [rad]."""
        return math.radians(self.degrees)

    @property
    def shoulder(self) -> float:
        """Height of its shoulder above the edge [m]."""
        return self.thickness / 2 / math.tan(self.angle / 2)


def scene(block: Shape, food: Material, wedge: Wedge, stroke: float, dx: float) -> Scene:
    """A block under a wedge.

    Args:
        block: The block; its width lies along the edge.
        food: Its constants.
        wedge: The blade.
        stroke: Way of the edge [m].
        dx: Cell size [m].

    Returns:
        The scene, with a cohesive crack.
    """
    knife = Knife("wedge", wedge.thickness, wedge.angle, 2 * block.height, 0.4)
    return Scene(
        Food(block, food),
        knife,
        Motion(stroke, max(LEAST_MACH, quasi_static_mach(knife, block))),
        Board(0.0),
        EdgeLaw(zone=max(ZONE, dx)),
        Numerics(dx=dx, gravity=0.0, room=1.0),
    )


def simulation(options: SuiteOptions, of: Scene) -> Simulation:
    """A scene made ready with the seed and on the device of the options."""
    return Simulation(replace(of, numerics=replace(of.numerics, seed=options.seed)), options.runtime)
