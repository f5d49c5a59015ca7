"""Two calibrations of one trace: what it is worth to measure the width."""

import matplotlib.pyplot as plt

from cutcal import Calibration

known = {"height": 0.03, "length": 0.03, "fit": ["E", "R"], "dx": 5e-3, "budget": 13}
measured = Calibration("banana", "banana_reconstructed", width=0.03, **known).run("runs/gallery", resume=True)
guessed = Calibration("banana", "banana_reconstructed", **known).run("runs/gallery-no-width", resume=True)

figure, axes = plt.subplots(figsize=(7, 2.4), layout="constrained")
prior = guessed.fitted["R"]
axes.plot([prior.prior_low, prior.prior_high], [0, 0], color="0.75", lw=6, solid_capstyle="butt")
for row, result in enumerate((guessed, measured), 1):
    found = result.fitted["R"]
    axes.plot([found.low95, found.high95], [row, row], color="black", lw=3, solid_capstyle="butt")
    axes.plot(found.value, row, "o", color="#D55E00")
axes.set_yticks(range(3), ["literature", "fit, width not measured", "fit, width measured"])
axes.set(xlabel="cutting resistance R [J/m²], 95 % ranges", xlim=(0, None), ylim=(2.5, -0.5))
figure.savefig("compare.png")
