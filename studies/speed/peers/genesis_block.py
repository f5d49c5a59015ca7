"""The elastic block in Genesis, through its own MPM solver. Needs ``genesis-world`` and a build of torch.

Reads the block as JSON from the command line, prints the time of a substep as JSON. Single precision, which is its
default; the number of threads is that of the environment variable QD_NUM_THREADS.
"""

import json
import sys
import time

import genesis as gs
import numpy as np


def run(block: dict) -> tuple[float, int, list[float]]:
    """Seconds a substep of the block, its particles, and the mean velocity upwards after each window [m/s]."""
    backend = gs.cpu if block["device"] == "cpu" else gs.cuda
    gs.init(backend=backend, precision="32", logging_level="error")
    dx, low = block["dx"], np.array(block["low"])
    size = np.array(block["counts"]) * dx / 2
    scene = gs.Scene(
        sim_options=gs.options.SimOptions(
            dt=block["dt"] * block["steps"], substeps=block["steps"], gravity=(0.0, 0.0, -block["gravity"])
        ),
        mpm_options=gs.options.MPMOptions(
            lower_bound=(0.0, 0.0, 0.0),
            upper_bound=tuple(float(n * dx) for n in block["nodes"]),
            grid_density=1 / dx,
            particle_size=dx / 2,
        ),
        show_viewer=False,
    )
    food = scene.add_entity(
        material=gs.materials.MPM.Elastic(E=block["E"], nu=0.0, rho=block["rho"], sampler="regular"),
        morph=gs.morphs.Box(pos=tuple(float(v) for v in low + size / 2), size=tuple(float(v) for v in size)),
    )
    scene.add_entity(gs.morphs.Plane(pos=(0.0, 0.0, float(low[2]))))
    scene.build()
    best, velocity = np.inf, []
    for _ in range(block["windows"]):
        began = time.perf_counter()
        scene.step()
        at = np.asarray(food.get_particles_vel().cpu())  # waits for the step
        best = min(best, (time.perf_counter() - began) / block["steps"])
        velocity.append(float(at.reshape(-1, 3)[:, 2].mean(dtype=float)))
    return float(best), int(food.n_particles), velocity


if __name__ == "__main__":
    seconds, particles, velocity = run(json.loads(sys.argv[1]))
    print(json.dumps({"seconds": seconds, "version": gs.__version__, "particles": particles, "velocity": velocity}))
