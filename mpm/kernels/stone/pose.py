"""Where a stone is, and which nodes move with it."""

import taichi as ti

from mpm.kernels.tool import edge_height, under_blade
from mpm.state.accessors import to_scene_axes
from mpm.state.stencil import node_position
from mpm.state.tables import (
    SPIN_ALONE,
    STONE_ALONE,
    STONE_AXES,
    STONE_HALF,
    STONE_MIDDLE,
    STONE_REACH,
    STONE_SPIN,
    STONE_TURN,
    STONE_VELOCITY,
)


@ti.func
def stone_vector(s: ti.template(), cut, row):
    """Three rows of the table of the stone from one on."""
    return ti.Vector([ti.cast(s.stone_pose[cut, row + d], float) for d in range(3)])


@ti.func
def stone_turn(s: ti.template(), cut):
    """Rotation of the stone since the beginning."""
    return ti.Matrix([[ti.cast(s.stone_pose[cut, STONE_TURN + 3 * r + k], float) for k in range(3)] for r in range(3)])


@ti.func
def row_near_stone(s: ti.template(), cut, i, j):
    """Whether a row of nodes comes near the stone."""
    at = to_scene_axes(s, cut, node_position(s, cut, i, j, 0)) - stone_vector(s, cut, STONE_MIDDLE)
    far = stone_vector(s, cut, STONE_AXES).max() + ti.cast(s.stone_pose[cut, STONE_REACH], float)
    return at[0] * at[0] + at[1] * at[1] < far * far


@ti.func
def from_stone(s: ti.template(), cut, i, j, k):
    """Place of a node from the stone's middle in the scene's axes [m], and whether it moves with the stone."""
    at = to_scene_axes(s, cut, node_position(s, cut, i, j, k)) - stone_vector(s, cut, STONE_MIDDLE)
    inward = stone_turn(s, cut).transpose() @ at
    axes, reach = stone_vector(s, cut, STONE_AXES), ti.cast(s.stone_pose[cut, STONE_REACH], float)
    part = 0.0
    for d in ti.static(range(3)):
        part += (inward[d] / (axes[d] + reach)) ** 2
    return at, part <= 1


@ti.func
def clings(s: ti.template(), cut, half):
    """Whether flesh of a half, 0 left, 1 right, clings to the stone: that of the stone's own half, or of both."""
    own = s.stone_pose[cut, STONE_HALF]
    return ti.cast(own < 0 or own == half, ti.i32)


@ti.func
def leans(s: ti.template(), cut, at, velocity):
    """Whether flesh of the other half leans on the stone at a node: below the edge, where it comes nearer.

    Above the edge the blade stands between them.

    Args:
        at: Place of the node from the stone's middle in the scene's axes [m].
        velocity: Of that flesh there [m/s], in the scene's axes.
    """
    where, turn = at + stone_vector(s, cut, STONE_MIDDLE), stone_turn(s, cut)
    below = where[2] < edge_height(s, cut, where[0]) or not under_blade(s, cut, where[0])
    axes = stone_vector(s, cut, STONE_AXES)
    outward = turn @ (turn.transpose() @ at / (axes * axes))
    stone = stone_vector(s, cut, STONE_ALONE) + stone_vector(s, cut, SPIN_ALONE).cross(at)
    return ti.cast(below and (velocity - stone).dot(outward) < 0, ti.i32)


@ti.func
def set_motion(s: ti.template(), cut, row, velocity, spin):
    """Note the velocity of the stone's middle [m/s] and its angular velocity [1/s], from a row on."""
    for d in ti.static(range(3)):
        s.stone_pose[cut, row + d] = velocity[d]
        s.stone_pose[cut, row + 3 + d] = spin[d]


@ti.func
def move_on(s: ti.template(), cut, dt):
    """Move the stone by its velocities; its rotation stays one (Gram and Schmidt)."""
    spin, q = stone_vector(s, cut, STONE_SPIN), stone_turn(s, cut)
    for d in ti.static(range(3)):
        s.stone_pose[cut, STONE_MIDDLE + d] += dt * s.stone_pose[cut, STONE_VELOCITY + d]
    if spin.norm_sqr() > 0:
        a = ti.Vector([q[0, 0], q[1, 0], q[2, 0]])
        b = ti.Vector([q[0, 1], q[1, 1], q[2, 1]])
        a += dt * spin.cross(a)
        b += dt * spin.cross(b)
        a = a.normalized()
        b = (b - a.dot(b) * a).normalized()
        c = a.cross(b)
        for d in ti.static(range(3)):
            s.stone_pose[cut, STONE_TURN + 3 * d] = a[d]
            s.stone_pose[cut, STONE_TURN + 3 * d + 1] = b[d]
            s.stone_pose[cut, STONE_TURN + 3 * d + 2] = c[d]
