"""The elastic block in Genesis, through its own MPM solver. Needs ``genesis-world`` and a build of torch.

Reads the block as JSON from the command line, prints the time of a substep as JSON. Single precision, which is its
default; the number of threads is that of the environment variable QD_NUM_THREADS.
"""

import json
import sys
import time

import genesis as gs
import numpy as np


def run(block: dict) -> tuple[float, int]:
    """Seconds a substep of the block, and its particles."""
    gs.init(backend=gs.cpu, precision="32", logging_level="error")
    dx, low = block["dx"], np.array(block["low"])
    size = np.array(block["counts"]) * dx / 2
    scene = gs.Scene(
        sim_options=gs.options.SimOptions(dt=block["dt"] * block["steps"], substeps=block["steps"]),
        mpm_options=gs.options.MPMOptions(
            lower_bound=(0.0, 0.0, 0.0),
            upper_bound=tuple(float(n * dx) for n in block["nodes"]),
            grid_density=1 / dx,
            particle_size=dx / 2,
        ),
        show_viewer=False,
    )
    mu, lam = block["mu"], block["lam"]
    young, poisson = mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu))
    food = scene.add_entity(
        material=gs.materials.MPM.Elastic(E=young, nu=poisson, rho=block["rho"], sampler="regular"),
        morph=gs.morphs.Box(pos=tuple(float(v) for v in low + size / 2), size=tuple(float(v) for v in size)),
    )
    scene.build()
    scene.step()
    best = np.inf
    for _ in range(block["repeats"]):
        began = time.perf_counter()
        scene.step()
        at = food.get_particles_pos()  # waits for the step
        best = min(best, (time.perf_counter() - began) / block["steps"])
    assert np.isfinite(np.asarray(at)).all()
    return float(best), int(food.n_particles)


if __name__ == "__main__":
    seconds, particles = run(json.loads(sys.argv[1]))
    print(json.dumps({"seconds": seconds, "version": gs.__version__, "particles": particles}))
