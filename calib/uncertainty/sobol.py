"""What moves the curve: Sobol indices of its peak, work and initial slope over the box of the literature's ranges.

The first-order index is the part of a quantity's variance that goes when a parameter is known, the total index the part
that stays when all others are (Sobol 2001, Math. Comput. Simul. 55:271; Saltelli et al. 2010, Comput. Phys. Commun.
181:259); both by SALib (Herman & Usher 2017, J. Open Source Softw. 2:97). They are evaluated on the surrogate of a fit:
no simulation is added, and far from the runs of the fit they are its extrapolation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from calib.fit.multistart import FitResult
from calib.problem.objective import Objective
from mpm.arrays import FloatArray

Indices = dict[str, dict[str, dict[str, float]]]

BASE = 128
"""Base samples; a power of 2, as the sequence wants. With p parameters the curve is evaluated (p + 2) times as
often."""
INITIAL_PART = 0.2
"""Part of the stroke whose mean slope is the initial one [-]."""


def sensitivity(objective: Objective, result: FitResult, *, seed: int = 0) -> Indices:
    """Sobol indices of a fit on one trace, empty where it ended before it had a surrogate.

    Args:
        objective: What was fitted.
        result: How.
        seed: Seed of the samples and of the confidence intervals.

    Returns:
        For ``peak``, ``work`` and ``initial_slope`` and each parameter: ``first``, ``total`` and the half widths of
        their 95 % intervals, ``first_conf`` and ``total_conf`` [-].
    """
    if result.surrogate is None:
        return {}
    process, chosen = result.surrogate.each[0], objective.parameters
    stroke = objective.target.stroke

    def model(points: FloatArray) -> dict[str, FloatArray]:
        return quantities(stroke, np.array([process.predict(z)[0] for z in points]))

    ends = [[p.to_internal(x) for x in p.prior_range] for p in chosen]
    box = np.clip(np.array(ends).T, chosen.lower, chosen.upper)
    return indices(chosen.names, box, model, seed=seed)


def quantities(stroke: FloatArray, curves: FloatArray) -> dict[str, FloatArray]:
    """Peak [N], work [J] and mean slope of the first fifth of the stroke [N/m] of curves.

    Args:
        stroke: Stroke [m] (n,), rising.
        curves: Forces [N] (k, n).

    Returns:
        The three by name, each (k,).
    """
    first = stroke <= stroke[0] + INITIAL_PART * (stroke[-1] - stroke[0])
    arm = stroke[first] - stroke[first].mean()
    return {
        "peak": curves.max(axis=1),
        "work": 0.5 * (curves[:, 1:] + curves[:, :-1]) @ np.diff(stroke),
        "initial_slope": curves[:, first] @ arm / float(arm @ arm),
    }


def indices(
    names: Sequence[str],
    box: FloatArray,
    model: Callable[[FloatArray], Mapping[str, FloatArray]],
    *,
    base: int = BASE,
    seed: int = 0,
) -> Indices:
    """Sobol indices of all quantities of a model over a box.

    Args:
        names: The parameters.
        box: Their lowest and highest internal coordinates [-], (2, p), between which each is uniform.
        model: Gives quantities by name, each (k,) [SI], at points (k, p) in internal coordinates.
        base: Number of base samples, a power of 2.
        seed: Seed of the samples and of the confidence intervals.

    Returns:
        As :func:`sensitivity`; NaN for a quantity that nothing moves.
    """
    # SALib loads pandas and matplotlib.
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as sampling

    problem = {"num_vars": len(names), "names": list(names), "bounds": box.T.tolist()}
    points = sampling.sample(problem, base, calc_second_order=False, seed=seed)
    out: Indices = {}
    for quantity, values in model(points).items():
        if np.ptp(values) == 0.0:
            out[quantity] = {n: dict.fromkeys(("first", "first_conf", "total", "total_conf"), np.nan) for n in names}
            continue
        found = analysis.analyze(problem, values, calc_second_order=False, seed=seed + 1)  # SALib takes 0 for no seed
        columns = {"first": "S1", "first_conf": "S1_conf", "total": "ST", "total_conf": "ST_conf"}
        out[quantity] = {n: {key: float(found[c][i]) for key, c in columns.items()} for i, n in enumerate(names)}
    return out
