"""A potato cut by pressing, and by pressing while the knife moves along its edge."""

from dataclasses import replace

import matplotlib.pyplot as plt

from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from cutcal import Food
from mpm.solver import simulate

food = Food.load("potato")
pressed = cut_scene(food, food.to_scene_food().shape, load_knife("kitchen"), coarse=True)

figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
for ratio, style in ((0.0, "-"), (0.5, "--"), (1.0, "-."), (2.0, ":")):
    record = simulate(replace(pressed, motion=replace(pressed.motion, slice_ratio=ratio)))
    axes.plot(1e3 * record.stroke, record.resolved, ls=style, label=f"{ratio:g}")
axes.set(xlabel="stroke [mm]", ylabel="upward force on the knife [N]", xlim=(0, None), ylim=(0, None))
figure.legend(title="way along the edge over the way down", frameon=False, loc="outside upper center", ncols=4)
figure.savefig("slicing.png")
