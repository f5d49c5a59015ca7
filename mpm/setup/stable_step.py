"""The largest sound time step."""

from __future__ import annotations

import math

from mpm.scene import Scene
from mpm.scene.material import Material

EDGE_STABILITY = 0.5  # dt times the frequency of the edge's cohesive spring, 2 is unstable
ADHESION_STABILITY = 0.5  # the same for the rising part of the adhesive traction
# Largest stiffness of the contact over mass / dt^2 of a particle: 4 for a lone particle on a hard surface, over
# 1 + 4 arm^2 / dx^2 when the impulse has an arm, which is half a cell at most.
CONTACT_LIMIT = 2.0


def retardation_time(scene: Scene, material: Material) -> float:
    """Kelvin-Voigt retardation time that gives the loss factor at the first axial mode c/(4 height) [s]."""
    return material.loss_factor * 4 * scene.food.shape.height / (2 * math.pi * material.p_wave)


def damper_rate(scene: Scene, material: Material) -> float:
    """Angular frequency of the first shear mode c_s/(4 height) [1/s], at which the dampers take most."""
    return 2 * math.pi * math.sqrt(material.shear / material.rho) / (4 * scene.food.shape.height)


def contact_stiffness(scene: Scene, material: Material, spacing: float) -> float:
    """Stiffness of the contact over the mass of a particle [1/s^2]: ``numerics.contact_stiffness`` layers of particles.

    Args:
        scene: What is simulated.
        material: Its constants.
        spacing: Lattice spacing of the particles [m].

    Returns:
        Stiffness of the contact of board, blade and halves, over mass.
    """
    layer = min(spacing, scene.numerics.dx / 2)
    return scene.numerics.contact_stiffness * (material.p_wave / layer) ** 2


def stable_step(scene: Scene, material: Material, spacing: float) -> float:
    """Largest sound step: elastic limit of a lone particle, of contact, of the edge's spring and of adhesion.

    Args:
        scene: What is simulated.
        material: Its constants.
        spacing: Lattice spacing of the particles [m].

    Returns:
        Time step [s].
    """
    num, edge = scene.numerics, scene.edge
    speed = scene.motion.mach * material.p_wave
    sound = math.sqrt(material.stability_speed**2 + material.skin_stiffness / (spacing * material.rho))
    omega = 2 * (sound + speed) / num.dx  # highest frequency of a lone particle
    zeta = retardation_time(scene, material) * omega / 2
    dt = num.safety * 2 / omega * (math.sqrt(1 + zeta * zeta) - zeta)
    if num.contact == "cohesive":
        dt = min(dt, math.sqrt(CONTACT_LIMIT / contact_stiffness(scene, material, spacing)))
    if num.contact == "cohesive" and scene.cuts:
        toughest = max(material.start, material.toughest_for_mass, 1e-12)
        spring = math.sqrt(toughest / (edge.slip * material.rho * scene.process_zone(material) ** 2))
        dt = min(dt, EDGE_STABILITY / spring)
        strength = material.sticking_strength(spacing)
        if strength > 0:
            pull = strength / (material.rho * spacing)  # acceleration at full strength
            dt = min(dt, ADHESION_STABILITY * math.sqrt(0.1 * 2 * material.adhesion_energy / strength / pull))
    return dt
