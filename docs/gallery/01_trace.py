"""A record, and the curve over the stroke that a calibration makes of it."""

import matplotlib.pyplot as plt

from calib.trace.conditioning import condition
from cutcal import Trace

trace = Trace.read("banana_reconstructed")
cut = condition(trace, speed=0.0167)  # [m/s]; this record has no position

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.5), layout="constrained")
trace.plot(left)
left.axhline(cut.baseline_N, color="#D55E00", ls="--", label="baseline")
left.axvline(cut.onset_s, color="#0072B2", ls=":", label="contact")
left.axvline(cut.end_s, color="#009E73", ls="-.", label="end of the cut")
right.plot(1e3 * cut.stroke, cut.curve, color="black")
right.set(xlabel="stroke from contact [mm]", ylabel="force on the knife [N]", title="conditioned")
figure.legend(frameon=False, loc="outside lower left", ncols=3)
figure.savefig("trace.png")
