"""Why a run cannot go on."""

from __future__ import annotations

import numpy as np

from mpm.state.tables import INVERTED, OUTSIDE


def health(sums: np.ndarray, particles: np.ndarray) -> str:
    """``done`` for a sound interval, else the typed reason why the run cannot go on.

    Args:
        sums: What the kernels booked in the interval, shape (N_SUMS,).
        particles: Momentum and energies of all particles at its end, shape (N_PARTICLE_SUMS,).
    """
    if not np.isfinite(particles).all() or not np.isfinite(sums).all():
        return "not_finite"
    if sums[OUTSIDE] > 0:
        return "left_grid"
    if sums[INVERTED] > 0:
        return "inverted"
    return "done"
