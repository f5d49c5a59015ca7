"""Which cuts are recorded as references, what is kept of each, and how much another seed of the particles changes it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from calib.io.provenance import key_of
from calib.material.food import FoodSpec
from calib.material.scene import CELL_PER_ZONE, Sizing, cut_scene, specimen
from mpm.output.record import ForceRecord
from mpm.scene import CONTACTS, Knife, Scene
from mpm.scene.shapes import volume
from studies.convergence.gci import REPEATABILITY
from studies.regression.reference_curves import CHECKED

FloatArray = npt.NDArray[np.float64]

KNIFE = "kitchen"  # of every recorded cut
MOST_CELLS = 12
"""Cells over the height of a food at most. The screening grid of a melon has 25, and its cut takes 7 to 20 s on a core; with 12 the
longest takes three, and a changed law shows as well."""
UNEVEN = 0.97
"""Cells over those that divide a food evenly. Where a size is a whole number of cells, as on the screening grid of a strawberry, the
last bit of the cell decides what lies at its end, and the curve jumps by up to 1.8 % of the largest force. With uneven cells a part
in 1e12 of the cell changes it by 7e-11 (a grape's by 6e-4)."""
POINTS = 60  # of a curve: five to a cell, or more
SEED = 0  # of the recorded cut
OTHERS = (1, 2, 3, 4, 5, 6, 7)
"""Seeds that are repeated beside it, for the repeatability standard deviation: seven degrees of freedom."""
SAME = 1e-3
"""Part of a column's largest value that the same seed may differ by between machines. The cuts are not chaotic (R changed by 1e-12
changes a curve by 2e-11 at most), so double precision moves them by rounding alone; compilers and processors move single
precision by up to 8e-4 (tests/mpm/test_regression.py). Also the least tolerance, where seeds hardly differ."""
KEY_LENGTH = 16  # letters of a hash that a record shows
START, RATE = (
    0.3,
    2e4,
)  # seconds of each run, and cells times cells of stroke a second, for the estimate of the time left


@dataclass(frozen=True)
class Case:
    """One recorded cut: the food as it is shipped, whole height, :data:`KNIFE`, on the screening grid.

    Attributes:
        food: The food.
        knife: The knife.
        contact: One of ``mpm.scene.CONTACTS``.
    """

    food: FoodSpec
    knife: Knife
    contact: str

    @property
    def name(self) -> str:
        """Name of its file, such as ``banana-cohesive``."""
        return f"{self.food.name}-{self.contact}"

    @property
    def words(self) -> str:
        """Its name for people."""
        return f"{self.food.name}, {self.contact}"

    def scene(self, seed: int = SEED) -> Scene:
        """The cut with cells of :data:`UNEVEN` of those that a fit screens with, or that :data:`MOST_CELLS` over the height have.

        Raises:
            SceneError: A food that cannot be cut.
        """
        shape, _ = specimen(self.food, None, Sizing())
        screening = cut_scene(self.food, shape, self.knife, coarse=True).numerics.dx
        dx = CELL_PER_ZONE * UNEVEN * max(screening, shape.height / MOST_CELLS)
        return cut_scene(self.food, shape, self.knife, dx=dx, coarse=True, contact=self.contact, seed=seed)

    @property
    def cost(self) -> float:
        """Seconds of one run, roughly."""
        scene = self.scene()
        dx, images = scene.numerics.dx, 2 ** sum(scene.mirrors)
        return START + volume(scene.food.shape) / dx**3 / images * scene.motion.stroke / dx / RATE

    @property
    def inputs(self) -> str:
        """Hash of everything a user may edit that the curve depends on: food and knife."""
        food, knife = self.food, self.knife
        values = {name: item.value for name, item in (dict(food.dims) | dict(food.properties)).items()}
        blade = [knife.spine, knife.angle, knife.height, knife.length, knife.radius]
        return key_of([food.shape_kind, values, blade])[:KEY_LENGTH]


def cases(foods: Sequence[FoodSpec], knife: Knife, contacts: Sequence[str] = CONTACTS) -> list[Case]:
    """All cases of these foods, one contact mode after the other: their kernels are compiled once."""
    return [Case(food, knife, contact) for contact in contacts for food in foods]


def columns_of(record: ForceRecord, stroke: float) -> dict[str, FloatArray]:
    """What is recorded of a cut, by the names of ``reference.COLUMNS``: forces upwards on the knife [N], work of the knife [J],
    at :data:`POINTS` even strokes, (60,) each.

    Args:
        record: The cut.
        stroke: Its whole stroke [m].
    """
    grid = np.linspace(0.0, stroke, POINTS + 1)[1:]
    forces = {"knife_N": record.resolved, "edge_N": record.edge[:, 2], "face_N": record.resolved_face}
    curves = {name: np.interp(grid, record.stroke, values) for name, values in forces.items()}
    work = np.interp(grid, np.append(0.0, record.stroke), np.append(0.0, record.work_done))
    return {"stroke_m": grid, **curves, "work_J": work}


def cut(scene: Scene, arch: str, threads: int) -> dict[str, Any]:
    """One cut in a worker: ``status``, and ``columns`` where it is ``done``."""
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    record = Simulation(scene, Runtime(arch, threads)).run()
    done = record.status == "done"
    return {"status": record.status, "columns": columns_of(record, scene.motion.stroke) if done else None}


def results(columns: Mapping[str, FloatArray]) -> dict[str, float]:
    """Peak [N], where it is [m] and work [J] of a recorded cut."""
    knife, work = columns["knife_N"], columns["work_J"]
    where = float(columns["stroke_m"][np.argmax(knife)])
    return {"peak_N": float(knife.max()), "peak_stroke_m": where, "work_J": float(work[-1])}


def scales(columns: Mapping[str, FloatArray]) -> dict[str, float]:
    """What parts of each checked column are parts of: the largest force on the knife [N], the largest work [J]."""
    force, work = (float(np.abs(columns[name]).max()) for name in ("knife_N", "work_J"))
    return {name: work if name == "work_J" else force for name in CHECKED}


def limit_factor(runs: int) -> float:
    """Repeatability limit over a standard deviation that so many runs gave [-]: 95 of 100 pairs of runs differ by less.

    It is the root of two times Student's t, 3.34 for eight runs, and not below the 2.8 of ISO 5725-6, which is for many.
    """
    return max(REPEATABILITY, math.sqrt(2) * float(student.ppf(0.975, runs - 1)))


def repeatability(runs: Sequence[Mapping[str, FloatArray]]) -> tuple[dict[str, Any], dict[str, float]]:
    """How much runs of one cut with other seeds scatter, and the tolerances that follow.

    The repeatability standard deviation s_r (ISO 5725-2) of a column is the largest over the stroke of the
    standard deviation between the runs; tolerances are the repeatability limit (:func:`limit_factor`), and :data:`SAME` at least.
    Of 256 curves of a ninth seed 235 are within them, in every column and at every point.

    Args:
        runs: Columns of at least two runs, the recorded one first.

    Returns:
        ``s_r`` by column, ``s_r_results`` and ``limits`` of peak [N], its place [m] and work [J]; and the tolerances by column.
    """
    s_r = {name: float(np.std([run[name] for run in runs], axis=0, ddof=1).max()) for name in CHECKED}
    numbers = [results(run) for run in runs]
    own = {name: float(np.std([n[name] for n in numbers], ddof=1)) for name in numbers[0]}
    first, scale = numbers[0], scales(runs[0])
    floors = {name: SAME * abs(first[name]) for name in first}
    floors["peak_stroke_m"] = float(np.diff(runs[0]["stroke_m"]).max())  # a peak is at one of the points
    factor = limit_factor(len(runs))
    limits = {name: max(factor * own[name], floors[name]) for name in own}
    tolerances = {name: max(factor * s_r[name], SAME * scale[name]) for name in CHECKED}
    return {"s_r": s_r, "s_r_results": own, "limits": limits}, tolerances
