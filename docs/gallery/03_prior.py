"""Forces that the literature predicts of a banana, and a trace of one."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from calib.trace.conditioning import condition
from cutcal import Trace

drawn = pd.read_csv(Path(__file__).parents[2] / "force_data" / "prior_predictive" / "banana.csv", comment="#")
cut = condition(Trace.read("banana_reconstructed"), speed=0.0167)
stroke = 1e3 * drawn["stroke_m"]

figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
axes.fill_between(stroke, drawn["q025_N"], drawn["q975_N"], color="#dcdcdc", label="95 % of the draws")
axes.fill_between(stroke, drawn["q25_N"], drawn["q75_N"], color="#b0b0b0", label="50 % of the draws")
axes.plot(stroke, drawn["default_N"], color="#D55E00", ls="--", label="values of materials.yaml")
axes.plot(1e3 * cut.stroke, cut.curve, color="black", label="trace (reconstructed)")
axes.set(xlabel="stroke from contact [mm]", ylabel="force on the knife [N]", xlim=(0, None), ylim=(0, None))
figure.legend(frameon=False, loc="outside upper center", ncols=2)
figure.savefig("prior.png")
