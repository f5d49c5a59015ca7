"""The food about the blade at the largest force, coloured by its stress."""

import matplotlib.pyplot as plt

from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from cutcal import Food
from mpm.solver import Simulation
from reports.calibration.cut_figure import glance

food = Food.load("strawberry")
scene = cut_scene(food, food.to_scene_food().shape, load_knife("edc"), dx=2.5e-3)
record = Simulation(scene).run(sections=40)

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 4.2), layout="compressed", width_ratios=(1.3, 1))
left.plot(1e3 * record.stroke, record.resolved, color="black")
left.plot(1e3 * record.stroke[record.resolved.argmax()], record.peak, "o", color="#D55E00")
left.set(xlabel="stroke [mm]", ylabel="force on the knife [N]", ylim=(0, None))
glance(record.section, scene.knife, scene.food.shape.height, record.stroke, record.resolved)(right)
figure.savefig("section.png")
