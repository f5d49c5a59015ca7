"""The blade on a stone: it can't enter, and slides along where its plane misses the stone's middle.

A straight edge touches an ellipsoid at one point, and so does a plane face. There the stone gives way as much as it
must in a step, by an impulse on the body that its nodes make, with Coulomb's friction. Nothing yields locally: neither
stone nor blade.
"""

import taichi as ti

from mpm.kernels.stone.pose import stone_turn, stone_vector
from mpm.kernels.tool import blade_velocity, book_knife_impulse
from mpm.state.tables import (
    ARM_MASS,
    BLADE_HEIGHT,
    BLADE_MU,
    EDGE,
    EDGE_S,
    EDGE_Z,
    FACE,
    FRICTION_WORK,
    HALF_LENGTH,
    SPINE,
    STONE_AXES,
    STONE_IMPULSE,
    STONE_MET,
    STONE_MIDDLE,
    TILT_COS,
    TILT_SIN,
    WEDGE_COS,
    WEDGE_SIN,
)

TINY = 1e-9  # of the stone's size, below which the edge is at its middle and has no nearest point


@ti.func
def edge_to_stone(s: ti.template(), cut):
    """The point of the edge that is nearest to the stone.

    The distance is that of the level sets of the ellipsoid, exact where the edge touches it.

    Returns:
        Distance of edge and stone, negative where they overlap [m], the stone's outward normal there, and the point
        from the stone's middle [m].
    """
    middle, axes, turn = stone_vector(s, cut, STONE_MIDDLE), stone_vector(s, cut, STONE_AXES), stone_turn(s, cut)
    cos_t, sin_t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
    along = ti.Vector([cos_t, 0.0, sin_t])
    start = ti.Vector([ti.cast(s.pose[cut, EDGE_S], float), 0.0, ti.cast(s.pose[cut, EDGE_Z], float)]) - middle
    q0, q1 = turn.transpose() @ start / axes, turn.transpose() @ along / axes
    way = ti.math.clamp(-q0.dot(q1) / q1.norm_sqr(), -s.par[cut, HALF_LENGTH], s.par[cut, HALF_LENGTH])
    q = q0 + way * q1
    size = ti.max(q.norm(), TINY)
    slope = q / axes
    steep = ti.max(slope.norm(), TINY / axes.max())
    return (size - 1) * size / steep, turn @ (slope / steep), start + way * along


@ti.func
def face_to_stone(s: ti.template(), cut, side):
    """The point of the stone that is nearest to a face of the blade, where that is nearer than the edge.

    The blade lies within its wedge and within its spine's thickness, so the stone is as far from it as from the further
    of the two planes, at least.

    Args:
        side: 1 for the face at +y, else -1.

    Returns:
        Distance of face and stone, negative where they overlap [m], the stone's outward normal there, and the point
        from the stone's middle [m].
    """
    middle, axes, turn = stone_vector(s, cut, STONE_MIDDLE), stone_vector(s, cut, STONE_AXES), stone_turn(s, cut)
    cos_t, sin_t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
    edge = ti.Vector([ti.cast(s.pose[cut, EDGE_S], float), 0.0, ti.cast(s.pose[cut, EDGE_Z], float)]) - middle
    up, aside = ti.Vector([-sin_t, 0.0, cos_t]), ti.Vector([0.0, side, 0.0])
    wedge = s.par[cut, WEDGE_COS] * aside - s.par[cut, WEDGE_SIN] * up
    point, n, gap = ti.Vector.zero(float, 3), wedge, -1e9
    for flat in ti.static(range(2)):
        outward = aside if ti.static(flat) else wedge
        far = axes * (turn.transpose() @ outward)
        nearest = -(turn @ (axes * far)) / far.norm()
        off = outward.dot(nearest - edge) - (0.5 * s.par[cut, SPINE] if ti.static(flat) else 0.0)
        if off > gap:
            gap, n, point = off, outward, nearest
    if up.dot(point - edge) > s.par[cut, BLADE_HEIGHT]:  # the blade has passed
        gap = 1e9
    return gap, -n, point


@ti.func
def blade_to_stone(s: ti.template(), cut):
    """The point at which blade and stone are nearest.

    Returns:
        As :func:`edge_to_stone`, and the row of sums that the blade is booked in: its edge, or its faces.
    """
    gap, n, point = edge_to_stone(s, cut)
    row = EDGE
    cos_t, sin_t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
    side = 1.0 if s.stone_pose[cut, STONE_MIDDLE + 1] >= 0 else -1.0
    along_face = ti.Vector(
        [-sin_t * s.par[cut, WEDGE_COS], side * s.par[cut, WEDGE_SIN], cos_t * s.par[cut, WEDGE_COS]]
    )
    if n.dot(along_face) < 0:  # the stone is nearer to the face above the edge
        gap, n, point = face_to_stone(s, cut, side)
        row = FACE
    return gap, n, point, row


@ti.func
def resistance_to(s: ti.template(), cut, mass, inverse, arm, n):
    """Change of velocity that an impulse along n makes there between edge and stone [1/kg].

    Args:
        mass: Of the nodes in the stone [kg].
        inverse: Of their moments of inertia [1/(kg m^2)].
        arm: The point from their centre of mass [m].
        n: Direction.
    """
    yields = 1 / mass + (inverse @ arm.cross(n)).cross(arm).dot(n)
    if s.par[cut, ARM_MASS] > 0:
        yields += n[2] * n[2] / s.par[cut, ARM_MASS]
    return yields


@ti.func
def stop_blade(s: ti.template(), cut, mass, inverse, at, velocity, spin, dt):
    """Let the blade stop at the stone, or slide along it.

    Args:
        mass: Of the nodes in the stone [kg].
        inverse: Of their moments of inertia about their centre of mass [1/(kg m^2)].
        at: Centre of mass from the stone's middle [m].
        velocity: Its velocity [m/s].
        spin: Angular velocity of the nodes [1/s].
        dt: Time step [s].

    Returns:
        Velocity and angular velocity with what the blade does to them.
    """
    gap, n, point, row = blade_to_stone(s, cut)
    where = point + stone_vector(s, cut, STONE_MIDDLE)
    arm, blade = point - at, blade_velocity(s, cut, where[0], where[2])
    slide = blade - velocity - spin.cross(arm)
    apart = slide.dot(n)
    # an overlap is parted no faster than the edge comes, so that it makes no energy
    need = -apart - ti.max(gap / dt, -ti.abs(apart))
    if need > 0 and gap > -axes_least(s, cut):
        press = need / resistance_to(s, cut, mass, inverse, arm, n)
        slide -= apart * n
        fast = slide.norm()
        push, t, rub = press * n, slide / ti.max(fast, 1e-30), 0.0
        if fast > 0:
            rub = ti.min(s.par[cut, BLADE_MU] * press, fast / resistance_to(s, cut, mass, inverse, arm, t))
            push -= rub * t
        velocity -= push / mass
        spin -= inverse @ arm.cross(push)
        # the nodes move as they are after the impulse, so that is the way on which friction takes energy
        s.sums[cut, FRICTION_WORK] += rub * t.dot(blade - velocity - spin.cross(arm))
        book_knife_impulse(s, cut, row, push, where[0], where[2])
        s.stone_pose[cut, STONE_IMPULSE] += press
        if s.stone_pose[cut, STONE_MET] < 0:
            s.stone_pose[cut, STONE_MET] = s.pose[cut, EDGE_Z]
    return velocity, spin


@ti.func
def axes_least(s: ti.template(), cut):
    """Least half axis of the stone [m]."""
    return stone_vector(s, cut, STONE_AXES).min()
