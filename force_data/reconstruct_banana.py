"""Writes banana_reconstructed.csv: a banana cut rebuilt from the few published numbers of one real cut.

Nobody published the trace. What is known is the sampling rate, the baseline, and the peak; the shape here is
a guess
from geometry, on purpose not from the solver of this project: a solver must not be tested on its own output.

Run it from anywhere: ``python force_data/reconstruct_banana.py``. The file comes out the same to the last
    byte.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

# Published: CulinaryCut, sections 4.1 and 4.2 (one cut, Franka Emika Panda, kitchen knife, wrist sensor).
RATE_HZ = 60.0
BASELINE_N = 25.0
PEAK_N = 12.5
# Assumed by us.
DIAMETER_M = 0.030  # Kachru et al. (1995) cut green bananas of 23.3 and 37.1 mm
SPEED_M_S = 0.030 / 1.8  # the whole cut takes 1.8 s; the paper says only "constant speed"
TOE_M = 3e-3  # depth over which the skin and the flesh give way before the edge cuts
RELEASE_M = 1e-3  # last stretch above the board, where what is left gives way at once
NOISE_N = 0.15
DRIFT_N_PER_S = 0.05
BEFORE_S = 1.0
AFTER_S = 0.5
SEED = 7

OUTPUT = Path(__file__).with_name("banana_reconstructed.csv")
HEADER = f"""\
# label: reconstructed
# THIS IS NOT A MEASUREMENT. It is a reconstruction of a banana cut from published numbers; the trace itself
# was never published. Use it to try the tools, not to validate a model.
# Published (CulinaryCut, sections 4.1 and 4.2): {RATE_HZ:g} Hz, a baseline of about {BASELINE_N:g} N before
# contact, one downward cut at constant speed, a peak of about {PEAK_N:g} N above the baseline, a release at
# the end.
# Assumed: a round section of {1e3 * DIAMETER_M:g} mm with a resistance proportional to the width that the
# blade cuts (the chord); a soft toe of {1e3 * TOE_M:g} mm at contact and a release within
# {1e3 * RELEASE_M:g} mm of the board; a speed of {1e3 * SPEED_M_S:.1f} mm/s; white noise of {NOISE_N:g} N
# (standard deviation); a drift of {DRIFT_N_PER_S:g} N/s; {BEFORE_S:g} s before contact and {AFTER_S:g} s
# after the release. Not made with the solver of this project.
time_s,force_N
"""


def resistance(stroke: np.ndarray) -> np.ndarray:
    """Force above the baseline: chord of a circle with a toe and a release [N], shape of stroke."""

    def shape(s: np.ndarray) -> np.ndarray:
        inside = np.clip(s, 0.0, DIAMETER_M)
        left = DIAMETER_M - inside
        chord = 2.0 * np.sqrt(inside * left)
        return np.asarray(chord * (1.0 - np.exp(-inside / TOE_M)) * (1.0 - np.exp(-left / RELEASE_M)))

    return PEAK_N * shape(stroke) / float(shape(np.linspace(0.0, DIAMETER_M, 10001)).max())


def text() -> str:
    """The whole file as text, header included."""
    cut_s = DIAMETER_M / SPEED_M_S
    time = np.arange(round((BEFORE_S + cut_s + AFTER_S) * RATE_HZ) + 1) / RATE_HZ
    # RandomState: numpy guarantees its stream for all versions, which default_rng does not
    noise = NOISE_N * np.random.RandomState(SEED).standard_normal(len(time))
    force = BASELINE_N + DRIFT_N_PER_S * time + resistance(SPEED_M_S * (time - BEFORE_S)) + noise
    rows = [f"{t:.5f},{f:.3f}\n" for t, f in zip(time, force, strict=True)]
    return HEADER + "".join(rows)


if __name__ == "__main__":
    OUTPUT.write_bytes(text().encode())
    print(f"wrote {OUTPUT}")
