"""The tool: how it moves, where it is, and the impulses that it is booked."""

import taichi as ti

from mpm.state.accessors import step_size
from mpm.state.loops import locate_active, repetitions
from mpm.state.state import CUTS
from mpm.state.tables import (
    ARM_C,
    ARM_K,
    ARM_LIMIT,
    ARM_MASS,
    BOOKED_IMPULSE,
    BOW,
    COMMAND,
    EDGE,
    EDGE_S,
    EDGE_VS,
    EDGE_VZ,
    EDGE_Z,
    FACE,
    FOOD_MIDDLE,
    FOOD_REACH,
    HALF_LENGTH,
    INV_DX,
    MOMENT,
    SPEED_ALONG,
    SPEED_TILT,
    SPEED_UP,
    TILT,
    TILT_COS,
    TILT_RATE,
    TILT_SIN,
)


@ti.func
def board_height(s: ti.template(), cut, y):
    """Height of the board at a place across the blade [m]: what a food's bow leaves between the two."""
    bow = s.par[cut, BOW]
    off = ti.min(ti.abs(y - s.par[cut, FOOD_MIDDLE]) / s.par[cut, FOOD_REACH], 1.0)
    return ti.select(bow > 0, -bow * (1 - off * off), bow * off * off)


@ti.func
def set_tool_velocity(s: ti.template(), cut: ti.template()):
    """Velocity of the tool in this step: as commanded, or that of the arm behind its spring."""
    dt, vz = step_size(s, cut), ti.cast(s.order[cut, SPEED_UP], float)
    s.pose[cut, EDGE_VS], s.pose[cut, TILT_RATE] = s.order[cut, SPEED_ALONG], s.order[cut, SPEED_TILT]
    s.pose[cut, COMMAND] += vz * dt
    if s.par[cut, ARM_MASS] > 0:
        booked = s.sums[cut, EDGE + 2] + s.sums[cut, FACE + 2]
        limit = ti.cast(s.par[cut, ARM_LIMIT], ti.f64)
        spring = s.par[cut, ARM_K] * (s.pose[cut, COMMAND] - s.pose[cut, EDGE_Z])
        pull = ti.math.clamp(spring + s.par[cut, ARM_C] * (vz - s.pose[cut, EDGE_VZ]), -limit, limit)
        if ti.abs(spring) > 2 * limit:  # stalled: it pulls as hard as it can and only stops rattling
            pull = ti.math.clamp(spring, -limit, limit) - s.par[cut, ARM_C] * s.pose[cut, EDGE_VZ]
        s.pose[cut, EDGE_VZ] += (pull * dt + booked - s.pose[cut, BOOKED_IMPULSE]) / s.par[cut, ARM_MASS]
        s.pose[cut, BOOKED_IMPULSE] = booked
        down = s.pose[cut, EDGE_Z] - ti.cast(board_height(s, cut, 0.0), ti.f64)
        s.pose[cut, EDGE_VZ] = ti.max(s.pose[cut, EDGE_VZ], -down / dt)  # the board stops the edge
    else:
        s.pose[cut, EDGE_VZ] = vz


@ti.func
def move_tools(s: ti.template(), cut: ti.template()):
    """Move the tools on, after the grid has felt them."""
    ti.loop_config(serialize=s.serial)
    for q in range(repetitions(s, cut, CUTS)):
        c, _, mine = locate_active(s, cut, q, CUTS)
        if mine:
            move_tool(s, c)


@ti.func
def move_tool(s: ti.template(), cut):
    """Move the tool."""
    dt = step_size(s, cut)
    s.pose[cut, EDGE_Z] += s.pose[cut, EDGE_VZ] * dt
    s.pose[cut, EDGE_S] += s.pose[cut, EDGE_VS] * dt
    if s.order[cut, SPEED_TILT] != 0:
        s.pose[cut, TILT] += s.pose[cut, TILT_RATE] * dt
        tilt = ti.cast(s.pose[cut, TILT], float)
        s.pose[cut, TILT_COS], s.pose[cut, TILT_SIN] = ti.cos(tilt), ti.sin(tilt)


@ti.func
def edge_height(s: ti.template(), cut, place):
    """Height of the edge at a place along the cut [m]."""
    z = ti.cast(s.pose[cut, EDGE_Z], float)
    c, t = ti.cast(s.pose[cut, TILT_COS], float), ti.cast(s.pose[cut, TILT_SIN], float)
    return z + (place - ti.cast(s.pose[cut, EDGE_S], float)) * t / c


@ti.func
def blade_velocity(s: ti.template(), cut, place, z):
    """Velocity of the blade where it is at a place along the cut and a height [m/s], in the scene's axes."""
    turn = ti.cast(s.pose[cut, TILT_RATE], float)
    along = ti.cast(s.pose[cut, EDGE_VS], float) - turn * (z - ti.cast(s.pose[cut, EDGE_Z], float))
    up = ti.cast(s.pose[cut, EDGE_VZ], float) + turn * (place - ti.cast(s.pose[cut, EDGE_S], float))
    return ti.Vector([along, 0.0, up])


@ti.func
def under_blade(s: ti.template(), cut, place):
    """Whether a place along the cut lies within the length of the blade."""
    return ti.abs(place - ti.cast(s.pose[cut, EDGE_S], float)) < s.par[cut, HALF_LENGTH] * ti.cast(
        s.pose[cut, TILT_COS], float
    )


@ti.func
def covered_part(s: ti.template(), cut, place):
    """Part of a slice that is under the blade [-]."""
    reach = s.par[cut, HALF_LENGTH] * ti.cast(s.pose[cut, TILT_COS], float) - ti.abs(
        place - ti.cast(s.pose[cut, EDGE_S], float)
    )
    return ti.math.clamp(reach * s.par[cut, INV_DX] + 0.5, 0.0, 1.0)


@ti.func
def book_impulse(s: ti.template(), cut, row, impulse):
    """Book an impulse of the food on a tool, in the scene's axes; mirror images cancel across their plane."""
    if ti.static(not s.mirror_x):
        s.sums[cut, row] += impulse[0]
    if ti.static(not s.mirror_y):
        s.sums[cut, row + 1] += impulse[1]
    s.sums[cut, row + 2] += impulse[2]


@ti.func
def book_knife_impulse(s: ti.template(), cut, row, impulse, place, z):
    """Book an impulse of the food on the knife at a place along the cut and a height.

    Its moment is about the middle of the edge, and raises the end at +x.
    """
    book_impulse(s, cut, row, impulse)
    if ti.static(not s.mirror_x):
        wide, high = place - ti.cast(s.pose[cut, EDGE_S], float), z - ti.cast(s.pose[cut, EDGE_Z], float)
        s.sums[cut, MOMENT] += wide * impulse[2] - high * impulse[0]
