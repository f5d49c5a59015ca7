"""One cut on three grids, and where its work would end on an infinitely fine one."""

from dataclasses import replace

import matplotlib.pyplot as plt

from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from cutcal import Food
from mpm.solver import simulate
from studies.convergence.gci import estimate

food, cells, works = Food.load("banana"), (3e-3, 2e-3, 1.5e-3), []
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.5), layout="constrained", width_ratios=(1.4, 1))
for cell, style in zip(cells, (":", "--", "-"), strict=True):
    scene = cut_scene(food, food.to_scene_food().shape, load_knife("kitchen"), dx=cell)
    record = simulate(replace(scene, motion=replace(scene.motion, mach=0.04)))  # four times as fast as usual
    left.plot(1e3 * record.stroke, record.resolved, ls=style, label=f"cells of {1e3 * cell:g} mm")
    works.append(record.work)
left.set(xlabel="stroke [mm]", ylabel="force on the knife [N]")
left.legend(frameon=False, loc="lower center")

found = estimate(cells, works)
right.plot([1e3 * cell for cell in cells], [1e3 * work for work in works], "o-", color="black", label="simulated")
right.plot(
    0.0, 1e3 * found.extrapolated, "o", mfc="none", color="black", label=f"extrapolated, order {found.order:.1f}"
)
right.set(xlabel="cell [mm]", ylabel="work of the knife [mJ]", xlim=(-0.15, None))
right.legend(frameon=False, loc="lower left")
figure.savefig("grids.png")
