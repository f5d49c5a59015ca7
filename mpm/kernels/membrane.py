"""The skin as a membrane: in-plane tension of the particles that have skin, no bending, slack where it is shortened.

Each of them keeps two vectors that lie in its skin and move with the food. Their strain gives a line force, which is
part of the particle's stress. What is stretched in one direction and shortened in the other wrinkles: it bears tension
along the first only (tension field: Pipkin 1986, IMA J. Appl. Math. 36:85).
"""

import taichi as ti

from mpm.state.accessors import velocity_gradient
from mpm.state.tables import SKIN_POISSON, SKIN_STIFFNESS


@ti.func
def membrane_stress(s: ti.template(), cut, p, dt):
    """Move the skin of a particle with it, and find what the skin adds to its Kirchhoff stress.

    Returns:
        Stress [Pa], xx, yy, zz, yz, xz, xy, in the grid's axes.
    """
    c = velocity_gradient(s, cut, p)
    a, b = s.skin[cut, p, 0], s.skin[cut, p, 1]
    a += dt * (c @ a)
    b += dt * (c @ b)
    s.skin[cut, p, 0], s.skin[cut, p, 1] = a, b
    n = line_forces(s, cut, a, b) * s.skin_share[cut, p]
    t = n[0] * a.outer_product(a) + n[1] * b.outer_product(b) + n[2] * (a.outer_product(b) + b.outer_product(a))
    return ti.Vector([t[0, 0], t[1, 1], t[2, 2], t[1, 2], t[0, 2], t[0, 1]])


@ti.func
def principal_strains(a, b):
    """Green strain of a skin with the vectors a and b, of unit length and at right angles at first.

    Returns:
        Largest and least principal strain [-], and cosine and sine of twice the angle from a to the first.
    """
    x, y, xy = 0.5 * (a.norm_sqr() - 1.0), 0.5 * (b.norm_sqr() - 1.0), 0.5 * a.dot(b)
    middle, half = 0.5 * (x + y), 0.5 * (x - y)
    radius = ti.sqrt(half * half + xy * xy)
    cos, sin = 1.0, 0.0
    if radius > 0:
        cos, sin = half / radius, xy / radius
    return middle + radius, middle - radius, cos, sin


@ti.func
def line_forces(s: ti.template(), cut, a, b):
    """Line forces of the skin (second Piola-Kirchhoff) on the axes a and b: aa, bb, ab [N/m]."""
    first, second, cos, sin = principal_strains(a, b)
    nu, stiff = s.par[cut, SKIN_POISSON], s.par[cut, SKIN_STIFFNESS]
    one, two = 0.0, 0.0
    if first > 0:
        if second <= -nu * first:
            one = stiff * first
        else:
            plane = stiff / (1.0 - nu * nu)
            one, two = plane * (first + nu * second), plane * (second + nu * first)
    middle, radius = 0.5 * (one + two), 0.5 * (one - two)
    return ti.Vector([middle + radius * cos, middle - radius * cos, radius * sin])


@ti.func
def membrane_energy(s: ti.template(), cut, p):
    """Elastic energy of the skin of a particle over its volume [J/m^3]."""
    first, second, _, _ = principal_strains(s.skin[cut, p, 0], s.skin[cut, p, 1])
    nu, stiff = s.par[cut, SKIN_POISSON], s.par[cut, SKIN_STIFFNESS]
    energy = 0.0
    if first > 0:
        if second <= -nu * first:
            energy = 0.5 * stiff * first * first
        else:
            energy = 0.5 * stiff / (1.0 - nu * nu) * (first * first + second * second + 2.0 * nu * first * second)
    return energy * s.skin_share[cut, p]
