"""One simulated cut: which part of the blade bears the force, and where the work goes."""

import matplotlib.pyplot as plt

from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from cutcal import Food
from mpm.solver import simulate

food = Food.load("cucumber")
scene = cut_scene(food, food.to_scene_food().shape, load_knife("kitchen"), coarse=True)
record = simulate(scene)
stroke = 1e3 * record.stroke

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.8), layout="constrained")
left.plot(stroke, record.resolved, color="black", label="whole knife")
left.plot(stroke, record.edge[:, 2], color="#0072B2", ls=":", label="edge")
left.plot(stroke, record.resolved_face, color="#009E73", ls="-.", label="faces")
left.set(xlabel="stroke [mm]", ylabel="force on the knife [N]")

parts = {"new surface": record.parting + record.cohesion, "friction": record.friction, "elastic": record.elastic}
right.stackplot(stroke, *parts.values(), labels=list(parts), colors=["#56B4E9", "#009E73", "#E69F00"])
right.plot(stroke, record.work_done, color="black", label="work of the knife")
right.set(xlabel="stroke [mm]", ylabel="energy [J]")
for axes, columns in ((left, 3), (right, 2)):
    axes.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns)
figure.savefig("cut.png")
