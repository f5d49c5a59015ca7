"""A made-up food on fine cells: what its cut under one blade says, on default cells, of the cuts under others.

The truth is the solver itself on fine cells, so that what is asked is whether values belong to the food, or to the
blade and the grid on which they were found. With the values held, what default cells miss shows bare. With a fit the
values take up what they can under the blade that was seen, and leave the rest to the others.

Run it with ``python -m studies.transfer.other_blade``.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from calib.material.food import load_food
from calib.material.scene import cut_scene
from mpm.arrays import FloatArray
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Knife, Scene
from mpm.scene.shapes import Shape
from mpm.solver import Simulation

FOLDING = Knife("folding", 2e-3, math.radians(11.0), 10.4e-3, 0.2)
KITCHEN = Knife("kitchen", 2e-3, math.radians(2.5), 45e-3, 0.2)
THICK = Knife("thick", 6e-3, math.radians(20.0), 30e-3, 0.2)
BLADES = (FOLDING, KITCHEN, THICK)
"""The one that is calibrated with, and two others: thinner and thicker."""
FLESH: Mapping[str, Mapping[str, float]] = {
    "potato": {"E": 9.5e6, "yield_stress": 0.14e6, "R": 87, "R_initiation": 87, "mu": 0.17, "tensile_strength": 0.11e6},
    "apple": {"E": 3.3e6, "yield_stress": 0.26e6, "R": 105, "R_initiation": 105, "mu": 0.34, "skin_thickness": 0.0},
}
"""Values of real cuts, by food, without skin [SI]. The potato's tensile strength is 0.8 of its yield stress."""
HALF = Shape("half_cylinder", 0.06, 0.06, 0.036)
FINE = 1.5e-3
"""Cell of the truth [m], half the default one."""
FITS = (("R",), ("R", "yield_stress"))
"""Properties that are fitted to the truth under the first blade: one by itself, and two that trade with each other."""
SAMPLES = 40  # of a curve that is fitted
PART = 0.01  # step of a difference, of a value
LIMIT = 0.03  # largest error of peak and work that passes


@dataclass(frozen=True)
class Prediction:
    """A cut on default cells against the truth.

    Attributes:
        knife: Name of the blade.
        peak: Error of the largest force [-].
        work: Error of the work [-].
        fitted: Whether values were fitted under the first blade; else they are those of the truth.
    """

    knife: str
    peak: float
    work: float
    fitted: bool

    @property
    def passed(self) -> bool:
        """Whether both are small enough."""
        return max(abs(self.peak), abs(self.work)) <= LIMIT


@dataclass(frozen=True)
class Truth:
    """A food whose cuts under all blades are known.

    Attributes:
        scenes: The cuts on default cells, by blade; the first is what is fitted.
        records: The true ones.
    """

    scenes: tuple[Scene, ...]
    records: tuple[ForceRecord, ...]


def truth_of(scenes: Sequence[Scene], cell: float, runtime: Runtime) -> Truth:
    """Simulate a food under some blades on fine cells.

    Args:
        scenes: The cuts on default cells.
        cell: Fine cell [m].
        runtime: Device.

    Returns:
        The truth.
    """
    fine = [replace(scene, numerics=replace(scene.numerics, dx=cell)) for scene in scenes]
    return Truth(tuple(scenes), tuple(Simulation(scene, runtime).run() for scene in fine))


def scenes_of(food: str, shape: Shape = HALF, blades: Sequence[Knife] = BLADES) -> list[Scene]:
    """Default cuts of a food under some blades.

    Args:
        food: Its name, one of :data:`FLESH`.
        shape: Specimen.
        blades: The blades; the first is that of a fit.

    Returns:
        A scene for each blade.
    """
    return [cut_scene(load_food(food).with_values(dict(FLESH[food])), shape, blade) for blade in blades]


def held(truth: Truth, runtime: Runtime) -> list[Prediction]:
    """Predictions with the true values.

    Args:
        truth: The food.
        runtime: Device.

    Returns:
        One for each blade.
    """
    return _predictions(truth, runtime, {})


def fitted(truth: Truth, runtime: Runtime, names: Sequence[str]) -> tuple[dict[str, float], list[Prediction]]:
    """Predictions with values that were fitted to the curve under the first blade, by least squares from the true ones.

    Args:
        truth: The food.
        runtime: Device.
        names: What is fitted.

    Returns:
        The values [SI], and a prediction for each blade.
    """
    scene, seen = truth.scenes[0], truth.records[0]
    simulation, own = Simulation(scene, runtime), scene.food.material
    at = np.linspace(0.0, seen.stroke[-1], SAMPLES + 1)[1:]
    wanted = _force(seen, at)

    def material(logs: FloatArray) -> dict[str, float]:
        return {name: getattr(own, name) * math.exp(x) for name, x in zip(names, logs, strict=True)}

    def missed(logs: FloatArray) -> FloatArray:
        record = simulation.run(replace(own, **_with_start(material(logs))))
        return (_force(record, at) - wanted) / float(wanted.max())

    best = least_squares(missed, np.zeros(len(names)), x_scale=0.1, diff_step=PART, xtol=1e-3, ftol=1e-4, max_nfev=8)
    values = material(best.x)
    return values, _predictions(truth, runtime, values)


def _with_start(values: Mapping[str, float]) -> dict[str, Any]:
    """Values with the line force that starts the cut, which is R in these foods."""
    return dict(values) | ({"R_initiation": values["R"]} if "R" in values else {})


def _force(record: ForceRecord, at: FloatArray) -> FloatArray:
    """Force without the ripple of the cells [N], at strokes [m]."""
    return np.interp(at, record.stroke, record.resolved)


def _predictions(truth: Truth, runtime: Runtime, values: Mapping[str, float]) -> list[Prediction]:
    out = []
    for scene, true in zip(truth.scenes, truth.records, strict=True):
        got = Simulation(scene.with_material(**_with_start(values)), runtime).run()
        out.append(Prediction(scene.knife.name, got.peak / true.peak - 1, got.work / true.work - 1, bool(values)))
    return out


def main() -> None:
    """Print what default cells predict of potato and apple under three blades."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--food", action="append", choices=list(FLESH), help="food; all where none is given")
    parser.add_argument("--cell", type=float, default=FINE, help="cell of the truth [m] (default 1.5e-3)")
    args = parser.parse_args()
    runtime = Runtime()
    for food in args.food or FLESH:
        truth = truth_of(scenes_of(food), args.cell, runtime)
        _tell(f"{food}, values held", held(truth, runtime))
        for names in FITS:
            values, found = fitted(truth, runtime, names)
            said = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
            _tell(f"{food}, fitted under the first blade: {said}", found)


def _tell(title: str, found: Sequence[Prediction]) -> None:
    """Print predictions."""
    rows = [f"  {p.knife:8s} peak {p.peak:+.1%} work {p.work:+.1%} {'pass' if p.passed else 'FAIL'}" for p in found]
    sys.stdout.write("\n".join([title, *rows, ""]))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
