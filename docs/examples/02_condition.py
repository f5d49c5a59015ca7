"""Condition a trace as a calibration does: tare, contact, stroke, filter; and draw it."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from calib.trace.conditioning import condition
from cutcal import Trace

recorded = Trace.read(Path(__file__).parents[2] / "force_data" / "banana_reconstructed.csv")
frame = recorded.frame()  # any DataFrame with time_s and force_N will do
trace = Trace.from_frame(frame[frame["time_s"] < 3.4], source="banana, first 3.4 s")
cut = condition(trace, speed=0.0167)  # this trace has no position

for text in cut.warnings:
    print("note:", text)
print(f"baseline {cut.baseline_N:.2f} ± {cut.baseline_sd_N:.2f} N")
print(f"contact at {cut.onset_s:.3f} ± {cut.onset_sd_s:.3f} s")
print(f"peak {cut.peak_N:.2f} ± {cut.peak_sd_N:.2f} N over {1e3 * cut.stroke_length_m:.1f} mm")

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
left.plot(trace.time, trace.force)
left.axvline(cut.onset_s, color="black", lw=0.8)
left.set(xlabel="time [s]", ylabel="force as recorded [N]")
right.plot(1e3 * cut.stroke, cut.curve)
right.set(xlabel="stroke [mm]", ylabel="force on the knife [N]")
figure.savefig("conditioned.png")
