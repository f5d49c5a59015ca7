"""Dampers: a mass behind a dashpot that each particle carries, so that halves do not chatter against the blade.

A Lanchester damper (Den Hartog 1956, Mechanical Vibrations, section 3.3) is a mass that only a dashpot ties to what
vibrates. It follows slow motion without resistance, and takes energy from motion that comes and goes. A damper of m
times the particle's mass has its largest loss factor, m/(2 + m), at the angular frequency at which it follows in one
radian. In slow motion the particle has 1 + m times its mass, but weighs no more. The two exchange momentum. Nothing
outside takes part in that, so it is no drag.
"""

import taichi as ti

from mpm.state.tables import DAMPER_MASS, DAMPER_RATE, MASS, PLASTIC, VISCOUS, VOLUME


@ti.func
def drag_damper(s: ti.template(), cut, p, u, dt):
    """Let a particle and its damper exchange momentum over a step, by an implicit step of their relative velocity.

    Args:
        p: The particle.
        u: Its velocity [m/s].
        dt: Time step [s].

    Returns:
        Its velocity then [m/s], and the energy that the dashpot takes, over the mass of a particle beside the cut
        [J/kg].
    """
    share = s.par[cut, DAMPER_MASS] / (1.0 + s.par[cut, DAMPER_MASS])  # that the particle bears
    follows = (1.0 + s.par[cut, DAMPER_MASS]) * s.par[cut, DAMPER_RATE] * dt
    apart = u - s.damper_v[cut, p]
    lost = follows / (1.0 + follows) * apart
    s.damper_v[cut, p] += (1.0 - share) * lost
    return u - share * lost, 0.5 * s.volume_ratio[cut, p] * share * lost.dot(2.0 * apart - lost)


@ti.func
def book_dampers(s: ti.template(), cut, part, taken):
    """Book what the dampers of a part of the particles take [J/kg], beside what the loss factor takes [J/m^3]."""
    if s.par[cut, DAMPER_MASS] > 0:
        s.losses[cut, part % s.copies, VISCOUS - PLASTIC] += s.par[cut, MASS] / s.par[cut, VOLUME] * taken


@ti.func
def damper_momentum_and_energy(s: ti.template(), cut, p):
    """Momentum (3) and kinetic energy of the damper of a particle [N s, J]."""
    v = s.damper_v[cut, p]
    m = s.par[cut, DAMPER_MASS] * s.par[cut, MASS] * s.volume_ratio[cut, p]
    return ti.Vector([m * v[0], m * v[1], m * v[2], 0.5 * m * v.norm_sqr()])
