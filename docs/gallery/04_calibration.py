"""A calibration against its trace, with the predictive band; on cells of 5 mm: quick, and too coarse to be used."""

from cutcal import Calibration

sizes = {"height": 0.03, "length": 0.03, "width": 0.03}  # [m]
fit = Calibration("banana", "banana_reconstructed", **sizes, fit=["E", "R"], dx=5e-3, budget=13)
result = fit.run("runs/gallery", resume=True)  # nothing is simulated twice

upper, lower = result.plot()
upper.figure.savefig("calibration.png")
