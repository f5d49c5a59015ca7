"""Draw the README's picture from a finished calibration: python docs/picture.py runs/banana docs/banana.png"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pandas as pd


def main(run: Path, picture: Path) -> None:
    """Force over stroke: trace, simulation, edge and faces."""
    c = pd.read_csv(run / "curves.csv")
    s = c["stroke_m"] * 1e3
    figure, axes = plt.subplots(figsize=(8, 3.6), dpi=110)
    axes.plot(s, c["real_N"], color="black", lw=2, label="trace (reconstructed)")
    axes.plot(s, c["sim_N"], color="#d55e00", lw=2, ls="--", label="simulation, calibrated")
    axes.plot(s, c["edge_N"], color="#56b4e9", lw=1.2, label="of it the cutting edge")
    axes.plot(s, c["face_N"], color="#009e73", lw=1.2, ls="-.", label="of it the blade's faces")
    axes.plot(s, c["start_N"], color="0.6", lw=1, ls=":", label="simulation at literature values")
    axes.set(xlabel="stroke [mm]", ylabel="force on the knife [N]", xlim=(0, s.max()), ylim=(0, None))
    axes.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(picture, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
