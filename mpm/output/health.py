"""Why a run cannot go on."""

from __future__ import annotations

import numpy as np

from mpm.kernels.fields import INVERTED, OUTSIDE


def health(sums: np.ndarray, state: np.ndarray) -> str:
    """``done`` for a sound interval, else the typed reason why the run cannot go on.

    Args:
        sums: What the kernels booked in the interval, shape (N_SUMS,).
        state: Momentum and energies at its end, shape (N_STATE,).
    """
    if not np.isfinite(state).all() or not np.isfinite(sums).all():
        return "not_finite"
    if sums[OUTSIDE] > 0:
        return "left_grid"
    if sums[INVERTED] > 0:
        return "inverted"
    return "done"
