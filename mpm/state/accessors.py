"""What every kernel reads of the state: time step, gradients of a particle, axes of scene and grid, mirror images.

All functions of the kernels take the state first, as ``s``, then the index of the cut among those side by side.
"""

import taichi as ti

from mpm.state.tables import DT, MIRROR_SUM, PLANE_Y, YAW_COS, YAW_SIN


@ti.func
def step_size(s: ti.template(), cut):
    """Time step of a cut [s]."""
    return ti.cast(s.order[cut, DT], float)


@ti.func
def deformation_gradient(s: ti.template(), cut, p):
    """Deformation gradient of one particle."""
    b, lane = p // s.lanes, p % s.lanes
    f = ti.Matrix.zero(float, 3, 3)
    for r, c in ti.static(ti.ndrange(3, 3)):
        f[r, c] = s.F[cut, b, 3 * r + c][lane]
    return f


@ti.func
def velocity_gradient(s: ti.template(), cut, p):
    """Velocity gradient of one particle [1/s]."""
    x, y, z = s.C[cut, p, 0], s.C[cut, p, 1], s.C[cut, p, 2]
    return ti.Matrix([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])


@ti.func
def to_scene_axes(s: ti.template(), cut, q):
    """A vector of the grid's axes in the scene's: along the blade, across it, up."""
    out = q
    if ti.static(s.turned):
        c, n = s.par[cut, YAW_COS], s.par[cut, YAW_SIN]
        out = ti.Vector([c * q[0] + n * q[1], c * q[1] - n * q[0], q[2]])
    return out


@ti.func
def to_grid_axes(s: ti.template(), cut, q):
    """A vector of the scene's axes in the grid's."""
    out = q
    if ti.static(s.turned):
        c, n = s.par[cut, YAW_COS], s.par[cut, YAW_SIN]
        out = ti.Vector([c * q[0] - n * q[1], n * q[0] + c * q[1], q[2]])
    return out


@ti.func
def multiplicity_x(s: ti.template(), cut, i):
    """How many mirror images across x = 0 a node stands for: 0 for ghosts, 1 on the plane, else 2."""
    out = 1.0
    if ti.static(s.mirror_x):
        image = s.size[cut, MIRROR_SUM] - i
        out = 0.0 if i < image else (1.0 if i == image else 2.0)
    return out


@ti.func
def multiplicity(s: ti.template(), cut, i, j):
    """How many mirror images a node stands for."""
    out = multiplicity_x(s, cut, i)
    if ti.static(s.mirror_y):
        plane = s.size[cut, PLANE_Y]
        out *= 0.0 if j > plane else (1.0 if j == plane else 2.0)
    return out
