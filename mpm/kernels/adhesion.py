"""Faces that stick to the blade: the traction that holds them, and what it does to a particle."""

import taichi as ti

from mpm.kernels.signed_distance import blade_opening
from mpm.kernels.tool import edge_height
from mpm.state.state import FACE_POINTS
from mpm.state.tables import ADHESION, ADHESION_GAP, CONTACT, TILT_COS, TILT_SIN


@ti.func
def adhesive_traction(opening, gap):
    """Traction of a sticky face over its strength when it has opened by ``opening`` [-]; ``gap`` [m] ends it.

    Triangular law: full strength at a tenth of the gap, work of adhesion = strength times gap / 2.
    """
    r = opening / gap
    return ti.math.clamp(ti.min(10 * r, (1 - r) / 0.9), 0.0, 1.0)


@ti.func
def stick_face(s: ti.template(), cut, p, sign, high, pressed, at):
    """Pull of a sticky blade on the face of a particle.

    Each point of the face sticks from when it has been pressed until it is too far away, and is held by what its own
    opening says: the work to take a face off is that of adhesion whichever way it turns, and what comes near is not
    drawn in.

    Args:
        p: The particle.
        sign: 1 for the half at +y, else -1.
        high: Way along the face from its lower end to its upper [m].
        pressed: Which of its points are pressed, a bit each.
        at: Position of its centre [m].

    Returns:
        Over the contact's stiffness: size of the pull, summed over the points [m]; its size times the blade's outward
        normal [m], against which it acts; the moment of that along the face over the face's height [m]. Place of its
        middle along the face, from -1/2 to 1/2.
    """
    cos_t, sin_t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
    y, wide = sign * at[1] - s.tool_gap[cut, p], sign * high[1]
    above, rise = (at[2] - edge_height(s, cut, at[0])) * cos_t, high[2] * cos_t - high[0] * sin_t
    gap = s.par[cut, ADHESION_GAP]
    strength = s.par[cut, ADHESION] / (s.par[cut, CONTACT] * s.volume_ratio[cut, p])  # of a stiff rind no more is held
    pull, place, held = 0.0, 0.0, pressed
    pulled, twisted = ti.Vector.zero(float, 3), ti.Vector.zero(float, 3)
    for q in range(FACE_POINTS):
        part = (q + 0.5) / FACE_POINTS - 0.5
        if s.adhering[cut, p] & ~pressed & (1 << q):
            opening, n = blade_opening(s, cut, y + part * wide, above + part * rise)
            if opening < gap:
                held |= 1 << q
                n = ti.Vector([-sin_t * n[2], sign * n[1], cos_t * n[2]])
                force = strength * adhesive_traction(ti.max(opening, 0.0), gap) / FACE_POINTS
                pull += force
                place += part * force
                pulled += force * n
                twisted += part * force * n
    if pull > 0:
        place /= pull
    s.adhering[cut, p] = held
    return pull, pulled, twisted, place
