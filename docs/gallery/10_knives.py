"""One apple under three knives."""

from math import degrees

import matplotlib.pyplot as plt

from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from cutcal import Food
from mpm.solver import simulate

food = Food.load("apple")
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
for name, style in (("edc", "--"), ("slicing", "-."), ("kitchen", "-")):
    knife = load_knife(name)
    record = simulate(cut_scene(food, food.to_scene_food().shape, knife, coarse=True))
    axes.plot(1e3 * record.stroke, record.resolved, ls=style, label=f"{name}: wedge of {degrees(knife.angle):.1f}°")
axes.set(xlabel="stroke [mm]", ylabel="force on the knife [N]", xlim=(0, None), ylim=(0, None))
figure.legend(frameon=False, loc="outside upper center", ncols=3)
figure.savefig("knives.png")
