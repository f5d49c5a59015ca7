"""The standing block in Newton, through its own implicit MPM solver. Needs ``newton``.

Reads the block as JSON from the command line, prints the time of a step as JSON. An implicit step may be longer than an
explicit one: its time step is that of the others times ``longer`` of the block.
"""

import json
import sys
import time

import newton
import numpy as np
import warp as wp
from newton.solvers import SolverImplicitMPM

NO_YIELD = 1e15
"""Yield pressure and yield stress of a material that does not flow [Pa]."""


def run(block: dict) -> tuple[float, int, list[float]]:
    """Seconds a step, particles, and the mean velocity upwards after each window of steps [m/s]."""
    wp.config.quiet = True
    dx, longer = block["dx"], block["longer"]
    builder = newton.ModelBuilder()
    SolverImplicitMPM.register_custom_attributes(builder)
    points = np.mgrid[tuple(slice(0, n) for n in block["counts"])].reshape(3, -1).T * dx / 2 + dx / 4
    volume = (dx / 2) ** 3
    builder.add_particles(
        pos=[wp.vec3(*map(float, p)) for p in points],
        vel=[wp.vec3(0.0)] * len(points),
        mass=[block["rho"] * volume] * len(points),
        radius=[dx / 4] * len(points),
    )
    builder.add_ground_plane()
    model = builder.finalize(device=block["device"])
    model.set_gravity((0.0, 0.0, -block["gravity"]))
    law = {
        "young_modulus": block["E"],
        "poisson_ratio": 0.0,
        "damping": 0.0,
        "friction": 0.0,
        "yield_pressure": NO_YIELD,
        "yield_stress": NO_YIELD,
        "tensile_yield_ratio": 1.0,
    }
    for name, value in law.items():
        getattr(model.mpm, name).fill_(value)
    solver = SolverImplicitMPM(model, config=SolverImplicitMPM.Config(voxel_size=dx, air_drag=0.0))
    one, two = model.state(), model.state()
    best, velocity = np.inf, []
    for _ in range(block["windows"]):
        wp.synchronize()
        began = time.perf_counter()
        for _ in range(block["steps"] // longer):
            solver.step(one, two, None, None, block["dt"] * longer)
            one, two = two, one
        wp.synchronize()
        best = min(best, (time.perf_counter() - began) / (block["steps"] // longer))
        velocity.append(float(one.particle_qd.numpy()[:, 2].mean(dtype=float)))
    return float(best), len(points), velocity


if __name__ == "__main__":
    seconds, particles, velocity = run(json.loads(sys.argv[1]))
    answer = {"seconds": seconds, "version": newton.__version__, "particles": particles, "velocity": velocity}
    print(json.dumps(answer))
