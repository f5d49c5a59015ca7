"""MLS-MPM as tutorials write it, with the solver's physics: the yardstick of the benchmarks, not meant for use.

Quadratic B-splines, APIC, scatter with atomic additions, ``ti.svd`` for everything, a fixed box of nodes that is swept
whole, unsorted particles (Hu et al. 2018, ACM TOG 37:150), contact by projecting grid velocities out of blade and
board, and the force from the momentum that this takes away. The contact laws are the solver's; J2 flow returns the
logarithmic strain, as is usual.
"""

import math
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import taichi as ti

from mpm.discretisation.particles import seed
from mpm.kernels.signed_distance import blade_distance, coulomb
from mpm.runtime import Runtime, start
from mpm.scene import Knife, Scene
from mpm.scene.errors import SceneError

BOTTOM = 4  # index of the nodes on the board
THRESHOLD = 1e30  # yield stress and strain of a material without plasticity or damage


@ti.func
def returned(sigma, mu, limit):
    """Singular values after J2 flow by radial return of the logarithmic strain [-]."""
    log = ti.Vector([ti.log(ti.max(sigma[0], 1e-6)), ti.log(ti.max(sigma[1], 1e-6)), ti.log(ti.max(sigma[2], 1e-6))])
    dev = log - log.sum() / 3
    over = dev.norm() - limit / (2 * mu)
    out = sigma
    if over > 0:
        log -= over / dev.norm() * dev
        out = ti.exp(log)
    return out


@dataclass(frozen=True)
class Timing:
    """What one step costs. Attributes: seconds a step [s]; particles; nodes of the grid."""

    seconds: float
    particles: int
    nodes: int

    @property
    def rate(self) -> float:
        """Particle steps a second [1/s]."""
        return self.particles / self.seconds


@ti.data_oriented
class Textbook:
    """The textbook solver on a cube of nodes, with the food of a scene in its middle.

    Args:
        scene: The cut; mirrors are not used.
        dx: Cell size [m].
        dt: Time step [s].
        speed: Speed of the blade [m/s].
        nodes: Nodes along each axis.
        runtime: Device.

    Raises:
        SceneError: The food is larger than the cube.
    """

    def __init__(self, scene: Scene, *, dx: float, dt: float, speed: float, nodes: int, runtime: Runtime) -> None:
        start(runtime, scene.numerics.precision)
        real = ti.f64 if scene.numerics.precision == "f64" else ti.f32
        whole = replace(scene, numerics=replace(scene.numerics, dx=dx, far=None, mirror=False))
        seeds = seed(whole)
        if max(vars(scene.food.shape)[side] for side in ("length", "width", "height")) > (nodes - 2 * BOTTOM) * dx:
            raise SceneError(f"the food does not fit into {nodes} nodes of {dx * 1e3:g} mm; take a larger cell")
        shape, m, knife = scene.food.shape, scene.food.material, scene.knife
        x = seeds.x + [nodes * dx / 2, nodes * dx / 2, BOTTOM * dx]
        x = x[np.random.default_rng(0).permutation(len(x))]
        self.n, self.nodes, self.dx, self.inv, self.dt = len(x), nodes, dx, 1 / dx, dt
        self.mu, self.lam, self.limit = m.shear, m.lame, min(math.sqrt(2 / 3) * m.yield_stress, THRESHOLD)
        self.mass, self.vol = m.rho * seeds.volume, seeds.volume
        self.eps0 = m.tensile_strength / m.E if m.damaged and m.tensile_strength else THRESHOLD
        self.friction, self.speed = m.mu, speed
        self.top, self.middle = BOTTOM * dx + shape.height, nodes * dx / 2
        if not isinstance(knife, Knife):
            raise SceneError("textbook: cuts with a knife; this scene has a press")
        self.spine, self.cos, self.sin = knife.spine, math.cos(knife.angle / 2), math.sin(knife.angle / 2)
        self.height, self.board, self.gravity = knife.height, scene.board.mu, scene.numerics.gravity
        self.x, self.v = ti.Vector.field(3, real, self.n), ti.Vector.field(3, real, self.n)
        self.C, self.F = ti.Matrix.field(3, 3, real, self.n), ti.Matrix.field(3, 3, real, self.n)
        self.D = ti.field(real, self.n)
        self.gv, self.gm = ti.Vector.field(3, real, (nodes,) * 3), ti.field(real, (nodes,) * 3)
        self.impulse = ti.Vector.field(3, real, ())
        self.x.from_numpy(x.astype(np.float64 if real == ti.f64 else np.float32))
        self.F.from_numpy(np.tile(np.eye(3), (self.n, 1, 1)).astype(np.float64 if real == ti.f64 else np.float32))
        self.way = 0.0

    @ti.func
    def projected(self, v, n, tool, mu, m):
        """Velocity of a node that may not enter a tool; books the momentum of a mass ``m`` that this takes away."""
        rel = v - tool
        into = rel.dot(n)
        out = v
        if into < 0:
            slide = rel - into * n
            out = tool + slide + coulomb(-into, slide, mu)
            self.impulse[None] += m * (v - out)
        return out

    @ti.kernel
    def step(self, way: float):
        """One step with the edge ``way`` below the top of the food [m]."""
        for i, j, k in self.gm:
            self.gv[i, j, k] = ti.Vector.zero(float, 3)
            self.gm[i, j, k] = 0.0
        for p in self.x:
            base = ti.cast(self.x[p] * self.inv - 0.5, ti.i32)
            fx = self.x[p] * self.inv - ti.cast(base, float)
            w = [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]
            f = (ti.Matrix.identity(float, 3) + self.dt * self.C[p]) @ self.F[p]
            u, s, vt = ti.svd(f)
            s3 = returned(ti.Vector([s[0, 0], s[1, 1], s[2, 2]]), self.mu, self.limit)
            f = u @ ti.Matrix([[s3[0], 0.0, 0.0], [0.0, s3[1], 0.0], [0.0, 0.0, s3[2]]]) @ vt.transpose()
            self.F[p] = f
            self.D[p] = ti.max(self.D[p], ti.math.clamp((s3.max() - 1) / self.eps0 - 1, 0.0, 0.999))
            r = u @ vt.transpose()
            jac = s3[0] * s3[1] * s3[2]
            tau = 2 * self.mu * (f - r) @ f.transpose()
            tau += ti.Matrix.identity(float, 3) * self.lam * jac * (jac - 1)
            affine = -self.dt * self.vol * 4 * self.inv**2 * (1 - self.D[p]) * tau + self.mass * self.C[p]
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                dpos = (ti.Vector([i, j, k]) - fx) * self.dx
                weight = w[i][0] * w[j][1] * w[k][2]
                at = base + ti.Vector([i, j, k])
                self.gv[at] += weight * (self.mass * self.v[p] + affine @ dpos)
                self.gm[at] += weight * self.mass
        for i, j, k in self.gm:
            m = self.gm[i, j, k]
            if m > 0:
                v = self.gv[i, j, k] / m
                v[2] -= self.gravity * self.dt
                if k <= BOTTOM:
                    v = self.projected(v, ti.Vector([0.0, 0.0, 1.0]), ti.Vector.zero(float, 3), self.board, 0.0)
                y, above = j * self.dx - self.middle, k * self.dx - (self.top - way)
                d, n = blade_distance(ti.abs(y), above, self.spine, self.cos, self.sin, 0.0)
                if ti.abs(y) < 1e-6 * self.dx:
                    n = ti.Vector([0.0, 0.0, -1.0])
                elif y < 0:
                    n[1] = -n[1]
                if d <= 0 and 0 <= above <= self.height:
                    v = self.projected(v, n, ti.Vector([0.0, 0.0, -self.speed]), self.friction, m)
                self.gv[i, j, k] = v
        for p in self.x:
            base = ti.cast(self.x[p] * self.inv - 0.5, ti.i32)
            fx = self.x[p] * self.inv - ti.cast(base, float)
            w = [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]
            v, c = ti.Vector.zero(float, 3), ti.Matrix.zero(float, 3, 3)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                g = w[i][0] * w[j][1] * w[k][2] * self.gv[base + ti.Vector([i, j, k])]
                v += g
                c += 4 * self.inv * g.outer_product(ti.Vector([i, j, k]) - fx)
            self.v[p], self.C[p] = v, c
            self.x[p] += self.dt * v

    def run(self, steps: int) -> Timing:
        """Time some steps, from where the last ones ended."""
        began = perf_counter()
        for _ in range(steps):
            self.step(self.way)
            self.way += self.speed * self.dt
        ti.sync()
        return Timing((perf_counter() - began) / steps, self.n, self.nodes**3)
