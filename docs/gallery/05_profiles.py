"""How fast the misfit rises when a value is held away from its best one."""

import matplotlib.pyplot as plt

from cutcal import Calibration

sizes = {"height": 0.03, "length": 0.03, "width": 0.03}  # [m]
fit = Calibration("banana", "banana_reconstructed", **sizes, fit=["E", "R"], dx=5e-3, budget=13)
result = fit.run("runs/gallery", resume=True)  # nothing is simulated twice

figure, panels = plt.subplots(1, 2, figsize=(8, 3.5), layout="constrained", sharey=True)
for axes, name, unit, scale in zip(panels, ("E", "R"), ("kPa", "J/m²"), (1e-3, 1.0), strict=True):
    profile, found = result.posterior.profiles[name], result.fitted[name]
    value = [scale * x for x in profile.value]
    axes.axvspan(scale * found.low95, scale * found.high95, color="#e8e8e8", label="95 % interval")
    axes.plot(value, profile.trace_alone, color="#0072B2", ls="--", label="trace alone")
    axes.plot(value, profile.rise, color="black", label="with the literature")
    axes.plot(scale * found.value, 0.0, "o", color="#D55E00", clip_on=False, label="fitted value")
    axes.axhline(3.84, color="0.5", ls=":", label="3.84")
    axes.set(xlabel=f"{name} [{unit}]", ylim=(0, 8))
panels[0].set_ylabel("rise of chi-square [-]")
figure.legend(*panels[0].get_legend_handles_labels(), frameon=False, loc="outside upper center", ncols=5)
figure.savefig("profiles.png")
