"""The elastic block in NVIDIA Warp: explicit MLS-MPM as one writes it with Warp's kernels. Needs ``warp-lang``.

Quadratic B-splines, APIC, atomic additions, sorted particles, single precision, the polar decomposition by four Newton
steps (Higham 1986) instead of the several times slower ``svd3``. Reads the block as JSON from the command line, prints
the time of a step as JSON.
"""

import json
import sys
import time

import numpy as np
import warp as wp

NEWTON_STEPS = wp.constant(4)


@wp.func
def spline(fx: float, i: int):
    """Quadratic B-spline weight of the node i above the lowest one at distance fx."""
    w = 0.5 * (1.5 - fx) * (1.5 - fx)
    if i == 1:
        w = 0.75 - (fx - 1.0) * (fx - 1.0)
    if i == 2:
        w = 0.5 * (fx - 0.5) * (fx - 0.5)
    return w


@wp.kernel
def scatter(
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
    c: wp.array(dtype=wp.mat33),
    f: wp.array(dtype=wp.mat33),
    grid: wp.array3d(dtype=wp.vec4),
    dx: float,
    dt: float,
    mass: float,
    volume: float,
    mu: float,
    lam: float,
):
    """Stress, momentum and mass of the particles to the grid.

    Args:
        x: Places [m], shape (n,).
        v: Velocities [m/s], shape (n,).
        c: Affine velocities [1/s], shape (n,).
        f: Deformation gradients [-], shape (n,).
        grid: Momentum [kg m/s] and mass [kg] of the nodes.
        dx: Cell size [m].
        dt: Time step [s].
        mass: Mass of a particle [kg].
        volume: Its volume [m^3].
        mu: Shear modulus [Pa].
        lam: First Lame constant [Pa].
    """
    p = wp.tid()
    eye = wp.identity(n=3, dtype=float)
    new = (eye + dt * c[p]) @ f[p]
    f[p] = new
    rotation = new
    for _ in range(NEWTON_STEPS):
        rotation = 0.5 * (rotation + wp.transpose(wp.inverse(rotation)))
    j = wp.determinant(new)
    tau = 2.0 * mu * (new - rotation) @ wp.transpose(new) + eye * (lam * j * (j - 1.0))
    affine = (-dt * volume * 4.0 / (dx * dx)) * tau + mass * c[p]
    at = x[p] / dx
    bx, by, bz = int(at[0] - 0.5), int(at[1] - 0.5), int(at[2] - 0.5)
    fx = at - wp.vec3(float(bx), float(by), float(bz))
    for a in range(3):
        for b in range(3):
            for k in range(3):
                w = spline(fx[0], a) * spline(fx[1], b) * spline(fx[2], k)
                to = (wp.vec3(float(a), float(b), float(k)) - fx) * dx
                q = w * (mass * v[p] + affine @ to)
                wp.atomic_add(grid, bx + a, by + b, bz + k, wp.vec4(q[0], q[1], q[2], w * mass))


@wp.kernel
def update(grid: wp.array3d(dtype=wp.vec4), dt: float, gravity: float, floor: int):
    """Momentum to velocity, gravity, and a floor that holds.

    Args:
        grid: Momentum [kg m/s] and mass [kg] of the nodes; velocity [m/s] in place of momentum afterwards.
        dt: Time step [s].
        gravity: Acceleration downwards [m/s^2].
        floor: Index of the nodes on the floor.
    """
    i, j, k = wp.tid()
    q = grid[i, j, k]
    if q[3] > 0.0:
        u = wp.vec3(q[0], q[1], q[2]) / q[3]
        u = wp.vec3(u[0], u[1], u[2] - gravity * dt)
        if k <= floor and u[2] < 0.0:
            u = wp.vec3(u[0], u[1], 0.0)
        grid[i, j, k] = wp.vec4(u[0], u[1], u[2], q[3])


@wp.kernel
def gather(
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
    c: wp.array(dtype=wp.mat33),
    grid: wp.array3d(dtype=wp.vec4),
    dx: float,
    dt: float,
):
    """Velocity, its gradient and the position of the particles from the grid.

    Args:
        x: Places [m], shape (n,).
        v: Velocities [m/s], shape (n,).
        c: Affine velocities [1/s], shape (n,).
        grid: Velocity [m/s] and mass [kg] of the nodes.
        dx: Cell size [m].
        dt: Time step [s].
    """
    p = wp.tid()
    at = x[p] / dx
    bx, by, bz = int(at[0] - 0.5), int(at[1] - 0.5), int(at[2] - 0.5)
    fx = at - wp.vec3(float(bx), float(by), float(bz))
    u = wp.vec3()
    gradient = wp.mat33()
    for a in range(3):
        for b in range(3):
            for k in range(3):
                w = spline(fx[0], a) * spline(fx[1], b) * spline(fx[2], k)
                q = grid[bx + a, by + b, bz + k]
                node = w * wp.vec3(q[0], q[1], q[2])
                u += node
                gradient += (4.0 / dx) * wp.outer(node, wp.vec3(float(a), float(b), float(k)) - fx)
    v[p] = u
    c[p] = gradient
    x[p] = x[p] + dt * u


def run(block: dict) -> tuple[float, list[float]]:
    """Seconds a step of the block, and the mean velocity upwards after each window of steps [m/s]."""
    wp.config.quiet = True
    wp.config.enable_backward = False
    wp.init()
    device = block["device"]
    dx, nodes = block["dx"], tuple(block["nodes"])
    x0 = np.array(block["low"])[:, None] + np.mgrid[tuple(slice(0, n) for n in block["counts"])].reshape(3, -1) * dx / 2
    points = (x0 + dx / 4).T
    x = wp.array(points, dtype=wp.vec3, device=device)
    v, c = wp.zeros(len(points), dtype=wp.vec3, device=device), wp.zeros(len(points), dtype=wp.mat33, device=device)
    f = wp.array(np.tile(np.eye(3), (len(points), 1, 1)), dtype=wp.mat33, device=device)
    grid = wp.zeros(nodes, dtype=wp.vec4, device=device)
    volume = (dx / 2) ** 3
    law = [dx, block["dt"], block["rho"] * volume, volume, block["E"] / 2, 0.0]

    def step() -> None:
        grid.zero_()
        wp.launch(scatter, len(points), inputs=[x, v, c, f, grid, *law], device=device)
        wp.launch(update, nodes, inputs=[grid, block["dt"], block["gravity"], block["floor"]], device=device)
        wp.launch(gather, len(points), inputs=[x, v, c, grid, dx, block["dt"]], device=device)

    wp.load_module(device=device)
    best, velocity = np.inf, []
    for _ in range(block["windows"]):
        wp.synchronize()
        began = time.perf_counter()
        for _ in range(block["steps"]):
            step()
        wp.synchronize()
        best = min(best, (time.perf_counter() - began) / block["steps"])
        velocity.append(float(v.numpy()[:, 2].mean(dtype=float)))
    return float(best), velocity


if __name__ == "__main__":
    task = json.loads(sys.argv[1])
    seconds, velocity = run(task)
    answer = {"seconds": seconds, "version": wp.config.version, "particles": int(np.prod(task["counts"]))}
    print(json.dumps({**answer, "velocity": velocity}))
