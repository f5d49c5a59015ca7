"""Down into a potato and up again, with little friction and with more."""

from dataclasses import replace

import matplotlib.pyplot as plt

from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from cutcal import Food
from mpm.solver import simulate

food = Food.load("potato")
down = cut_scene(food, food.to_scene_food().shape, load_knife("kitchen"), stroke=0.03, coarse=True)
scene = replace(down, motion=replace(down.motion, retract=0.03))  # [m]

figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
for mu, style in ((0.1, "--"), (0.3, "-")):
    record = simulate(scene.with_material(mu=mu))
    axes.plot(1e3 * record.stroke, record.resolved, ls=style, label=f"coefficient of friction {mu:g}")
axes.axhline(0.0, color="0.5", lw=0.8)
axes.set(xlabel="depth of the edge [mm]", ylabel="upward force on the knife [N]")
axes.legend(frameon=False, loc="upper left")
figure.savefig("withdrawal.png")
