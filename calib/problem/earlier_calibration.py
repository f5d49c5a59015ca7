"""Where a search begins that follows another: at what the simulations of earlier calibrations say of the new trace.

The simulations of one cut hang on food, knife and values, and on the trace only by its length. So those of an earlier
cut of the same food under the same knife, compared with the new trace, show its valleys before anything is run.
Specimens differ in height and so in their cells: the curves are nearly those of the new scene and no more. They are
therefore no part of the fit. They say where it begins, and whatever it uses is simulated anew.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.errors import OutputError
from calib.io.wording import brief
from calib.problem.objective import Objective
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_file import read_runs
from calib.simulation.evaluation_frame import STORE
from mpm.arrays import FloatArray

SUMMARY = "summary.json"
MOST_GUESSES = 2
"""Foods that a search begins at: the closest, and the closest of another valley."""
VALLEY = 1.0
"""So far apart two foods are of two valleys, in internal coordinates over the prior's standard deviation [-]."""
SEARCHED = ("fine", "coarse")
"""Fidelities of the simulations of a search."""


def earlier_guesses(folder: Path, objective: Objective, food: str, knife: str) -> tuple[FloatArray, ...]:
    """The foods of earlier calibrations that are closest to a trace.

    Args:
        folder: Output folder of a calibration, or a folder of several; those of another food or knife, or that fitted
            other parameters, are passed over.
        objective: Target, parameters and error model of the new calibration.
        food: Name of its food.
        knife: Name of its knife.

    Returns:
        Internal coordinates, each (p,), the closest first: at most :data:`MOST_GUESSES`, in as many valleys.

    Raises:
        OutputError: There is no such calibration.
    """
    names = set(objective.parameters.names)
    runs = [
        objective.score(replace(run, index=0))
        for path in _calibrations(folder, food, knife)
        for run in _searched(path / STORE)
        if run.ok and set(run.parameters) == names
    ]
    if not runs:
        raise OutputError(
            f"--start-from {folder}: no simulation of {food} under the knife {knife} there that has the parameters "
            f"{', '.join(objective.parameters.names)}; name the output folder of such a calibration, or of several"
        )
    found: list[FloatArray] = []
    for run in sorted(runs, key=lambda run: run.misfit):
        apart = all(_distance(objective, run.z, z) > VALLEY for z in found)
        if apart and len(found) < MOST_GUESSES:
            found.append(run.z)
    return tuple(found)


def _distance(objective: Objective, one: FloatArray, other: FloatArray) -> float:
    """Largest difference of two points in a parameter, over its prior's standard deviation [-]."""
    parameters = objective.parameters
    return float(np.abs(parameters.prior_residual(one) - parameters.prior_residual(other)).max())


def _calibrations(folder: Path, food: str, knife: str) -> Iterator[Path]:
    """Folders of finished calibrations of a food under a knife, the folder itself or those in it."""
    within = [folder] if (folder / SUMMARY).is_file() else sorted(path.parent for path in folder.glob(f"*/{SUMMARY}"))
    for path in within:
        try:
            said = json.loads((path / SUMMARY).read_text(encoding="utf-8"))
            same = (said["food"], said["knife"]["name"]) == (food, knife)
        except (OSError, ValueError, KeyError, TypeError):
            continue  # of something else than one cut
        if same:
            yield path


def _searched(store: Path) -> list[Evaluation]:
    """The simulations of a search that a store holds.

    Raises:
        OutputError: It is missing or damaged.
    """
    try:
        return [entry.evaluation.down for entry in read_runs(store) if entry.fidelity in SEARCHED]
    except OSError as e:
        raise OutputError(f"--start-from: {store} cannot be read ({brief(str(e))}); name another folder") from None
