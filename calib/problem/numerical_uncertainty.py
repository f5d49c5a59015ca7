"""The numerical uncertainty of a simulated curve, as a convergence study has left it in its folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from calib.errors import CurveError, OutputError
from calib.trace.conditioning import Conditioned
from mpm.arrays import FloatArray
from mpm.scene import Scene


def numerical_uncertainty(folder: Path, food: str, scene: Scene, curve: Conditioned) -> FloatArray:
    """Numerical standard uncertainty of a simulated curve, from ``cutcal converge``.

    It is that of the study's coarsest grid as a part of its peak, at equal parts of the stroke.

    Args:
        folder: Folder of the convergence study.
        food: Name of the food, which must be that of the study.
        scene: The cut whose knife and cell must be those of the study's coarsest grid.
        curve: The conditioned trace.

    Returns:
        The uncertainty on the stroke grid of the trace [N] (n,).

    Raises:
        OutputError: There is no such study in the folder.
        CurveError: It is of another food, knife or cell.
    """
    import pandas as pd  # takes long to import

    try:
        document = json.loads((folder / "converge.json").read_text(encoding="utf-8"))
        table = pd.read_csv(folder / "curves.csv", comment="#")
        coarsest = max(row["dx_m"] for row in document["grids"])
        stroke, u_num = table["stroke_m"].to_numpy(), table["u_num_coarsest_N"].to_numpy()
        peak = float(table[f"force_dx_{coarsest:g}_N"].max())
    except (OSError, ValueError, KeyError) as e:
        raise OutputError(f"--u-num {folder}: no finished study of cutcal converge there ({e})") from None
    for what, own, theirs in (
        ("food", food, document["food"]),
        ("knife", scene.knife.name, document["knife"]),
        ("cell", f"{scene.numerics.dx * 1e3:.3g} mm", f"{coarsest * 1e3:.3g} mm"),
    ):
        if own != theirs:
            raise CurveError(
                f"--u-num {folder}: its {what} is {theirs}, that of this calibration {own}; repeat cutcal converge "
                "with the same, its coarsest --dx the cell of the calibration"
            )
    parts = curve.stroke / curve.stroke[-1]
    out: FloatArray = np.interp(parts, stroke / stroke[-1], u_num) / peak * float(curve.curve.max())
    return out
