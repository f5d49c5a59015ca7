"""The blade as a signed distance field, and the laws of friction of what touches it."""

import taichi as ti

from mpm.state.tables import BLADE_HEIGHT, SPINE, TIP_RADIUS, WEDGE_COS, WEDGE_SIN


@ti.func
def blade_distance(y, above, spine, cos_h, sin_h, radius):
    """Signed distance to the right half of the blade and its outward normal, in the plane across the edge.

    The blade is a wedge with a rounded tip up to the spine's thickness and parallel above it.

    Args:
        y: Distance from the blade plane towards the particle's own side [m]; negative beyond the plane.
        above: Height above the lowest point of the edge [m], positive.
        spine: Thickness of the spine [m].
        cos_h: Cosine of half the included angle.
        sin_h: Sine of half the included angle.
        radius: Radius of the tip [m].

    Returns:
        Distance [m], negative inside, and the unit normal (0, n_y, n_z).
    """
    d = y * cos_h - (above - radius) * sin_h - radius
    n = ti.Vector([0.0, cos_h, -sin_h])
    if y * sin_h + (above - radius) * cos_h < 0:
        size = ti.sqrt(y * y + (above - radius) ** 2)
        d = size - radius
        n = ti.Vector([0.0, y, above - radius]) / ti.max(size, 1e-12)
    if y - 0.5 * spine > d:
        d = y - 0.5 * spine
        n = ti.Vector([0.0, 1.0, 0.0])
    return d, n


@ti.func
def rounded_blade_distance(y, above, spine, cos_h, sin_h, radius, height):
    """As :func:`blade_distance`, with a shoulder and a back that are rounded with half the spine's thickness.

    The arc of the shoulder touches both faces. The back is half round and stands on top of ``height``, so the blade is
    nowhere thinner than with sharp corners but at the shoulder.

    Args:
        y: Distance from the blade plane towards the particle's own side [m]; negative beyond the plane.
        above: Height above the lowest point of the edge [m].
        spine: Thickness of the spine [m].
        cos_h: Cosine of half the included angle.
        sin_h: Sine of half the included angle.
        radius: Radius of the tip [m].
        height: Height of the blade [m].

    Returns:
        Distance [m], negative inside, and the unit normal (0, n_y, n_z).
    """
    d, n = blade_distance(y, above, spine, cos_h, sin_h, radius)
    arc = 0.5 * spine
    up = above - radius - (arc - radius) / sin_h
    if up < 0 and y * sin_h + up * cos_h > 0:
        size = ti.sqrt(y * y + up * up)
        d, n = size - arc, ti.Vector([0.0, y, up]) / size
    up = above - height
    if up > 0:
        size = ti.sqrt(y * y + up * up)
        d, n = size - half_thickness(spine, cos_h, sin_h, radius, height), ti.Vector([0.0, y, up]) / size
    return d, n


@ti.func
def half_thickness(spine, cos_h, sin_h, radius, height):
    """Half thickness of a blade at its back [m]; its arguments are those of :func:`rounded_blade_distance`."""
    return ti.min(0.5 * spine, (height - radius) * sin_h / cos_h + radius / cos_h)


@ti.func
def passed_part(q):
    """Part of a hat of half width 1 that lies below q [-]."""
    x = ti.math.clamp(q, -1.0, 1.0)
    return 0.5 + x - 0.5 * x * ti.abs(x)


@ti.func
def blade_opening(s: ti.template(), cut, y, above):
    """Opening between a point of a particle's face and the blade, and the blade's outward normal there.

    In the plane across the edge. Beside the tip a point that is pressed beyond the blade's plane counts as on it.

    Args:
        y: Distance of the point from the blade's plane towards its own half [m].
        above: Its height above the edge [m].

    Returns:
        Opening [m], negative where they press, and the unit normal (0, n_y, n_z).
    """
    cos_h, sin_h, radius = s.par[cut, WEDGE_COS], s.par[cut, WEDGE_SIN], s.par[cut, TIP_RADIUS]
    if y * sin_h + (above - radius) * cos_h < 0:
        y = ti.max(y, 0.0)
    return rounded_blade_distance(y, above, s.par[cut, SPINE], cos_h, sin_h, radius, s.par[cut, BLADE_HEIGHT])


@ti.func
def coulomb(jn, tangent, mu):
    """Friction impulse per mass of a projected velocity: mu jn, but never more than stops the sliding."""
    speed = tangent.norm()
    return -ti.min(mu * jn, speed) * tangent / ti.max(speed, 1e-12)


@ti.func
def stick_slip(stick, slide, own, most):
    """Elastic-sticking friction: a tangential spring as stiff as the normal one, which slips at the largest friction.

    Capping each step's impulse at the one that stops the particle would make friction viscous, because the grid takes
    most of that impulse away again; the spring remembers.

    Args:
        stick: Tangential stretch of the spring so far [m], 3-vector.
        slide: Sliding of the particle along the tool in this step [m], 3-vector, tangential.
        own: Tangential part of the food's own traction over the spring's stiffness [m], which needs no stretch.
        most: Largest friction over the spring's stiffness [m].

    Returns:
        Friction force over the spring's stiffness [m]; ``own`` less it is the new stretch.
    """
    out = own - stick - slide
    size = out.norm()
    if size > most:
        out *= most / size
    return out
