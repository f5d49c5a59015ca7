"""A simulated curve against a measured one, and against curves that explain nothing."""

import numpy as np

from calib.validation.metrics import compare
from calib.validation.null_models import null_models

stroke = np.linspace(0.0, 0.03, 240)
x = stroke / 0.03
real = 12.0 * np.sin(np.pi * x) ** 0.7 + 3.0 * np.exp(-(((x - 0.12) / 0.05) ** 2))  # with a skin
sim = 1.1 * (12.0 * np.sin(np.pi * x) ** 0.7 + 2.0 * np.exp(-(((x - 0.14) / 0.05) ** 2)))  # 10 % too strong

m = compare(stroke, real, sim)
print(f"{'':12s}{'peak':>8s}{'work':>8s}{'NRMSE':>8s}{'shape':>8s}{'R':>8s}")
rows = {"simulation": m} | {name: model.metrics for name, model in null_models(stroke, real).items()}
for name, one in rows.items():
    figures = (one.peak_error, one.work_error, one.nrmse, one.shape_error, one.iso18571.R)
    print(f"{name:12s}" + "".join(f"{x:8.3f}" for x in figures))
print(
    "better than ramp and half sine in shape:", m.shape_error < min(rows[n].shape_error for n in ("ramp", "half_sine"))
)
print(f"Sprague-Geers M {m.sprague_geers.M:+.3f}, P {m.sprague_geers.P:.3f}")
