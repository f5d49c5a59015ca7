"""Which cuts are recorded as references, what is kept of each, and how much another seed of the particles changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.stats import t as student

from calib.io.provenance import key_of
from calib.material.food import FoodSpec
from calib.material.scene import CELL_PER_ZONE, Sizing, cut_scene, specimen
from mpm.arrays import FloatArray
from mpm.output.record import ForceRecord
from mpm.scene import CONTACTS, Knife, Scene
from mpm.shapes import volume
from studies.convergence.gci import REPEATABILITY
from studies.regression.reference_curves import CHECKED

RECORDED_KNIFE = "kitchen"  # of every recorded cut
MOST_CELLS = 12
"""Cells over the height of a food at most. The screening grid of a melon has 25 and takes long to simulate; a changed
law shows with fewer as well. See docs/theory.md, "Measured choices"."""
UNEVEN = 0.97
"""Cells over those that divide a food evenly. Where a size is a whole number of cells, the last bit of the cell decides
what lies at its end, and the curve jumps. See docs/theory.md, "Measured choices"."""
RECORDED_POINTS = 60  # of a curve: five to a cell, or more
RECORDED_SEED = 0  # of the recorded cut
OTHER_SEEDS = (1, 2, 3, 4, 5, 6, 7)
"""Seeds that are repeated beside it, for the repeatability standard deviation: seven degrees of freedom."""
SAME = 1e-3
"""Part of a column's largest value that the same seed may differ by between machines: rounding, which compilers and
processors do differently, above all in single precision (tests/mpm/test_regression.py). Also the least tolerance, where
seeds hardly differ. See docs/theory.md, "Measured choices"."""
KEY_LENGTH = 16  # letters of a hash that a record shows
START_UP = 0.3  # time of each run apart from its cells [s], for the estimate of the time left
CELL_RATE = 2e4  # cells times cells of stroke a second, for that estimate


@dataclass(frozen=True)
class BaselineCut:
    """One recorded cut: the food as it is shipped, whole height, :data:`RECORDED_KNIFE`, on the screening grid.

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

    def scene(self, seed: int = RECORDED_SEED) -> Scene:
        """The cut, with uneven cells (:data:`UNEVEN`) about as large as those that a fit screens with.

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
        return START_UP + volume(scene.food.shape) / dx**3 / images * scene.motion.stroke / dx / CELL_RATE

    @property
    def inputs(self) -> str:
        """Hash of everything a user may edit that the curve depends on: food and knife."""
        food, knife = self.food, self.knife
        values = {name: item.value for name, item in (dict(food.dims) | dict(food.properties)).items()}
        blade = [knife.spine, knife.angle, knife.height, knife.length, knife.radius]
        return key_of([food.shape_kind, values, blade])[:KEY_LENGTH]


def baseline_cuts(foods: Sequence[FoodSpec], knife: Knife, contacts: Sequence[str] = CONTACTS) -> list[BaselineCut]:
    """All recorded cuts of these foods, one contact mode after the other: their kernels are compiled once.

    Args:
        foods: The foods.
        knife: The knife.
        contacts: Kinds of contact.

    Returns:
        The cuts.
    """
    return [BaselineCut(food, knife, contact) for contact in contacts for food in foods]


def columns_of(record: ForceRecord, stroke: float) -> dict[str, FloatArray]:
    """What is recorded of a cut: forces upwards on the knife [N] and its work [J] over the stroke [m].

    Args:
        record: The cut.
        stroke: Its whole stroke [m].

    Returns:
        By the names of :data:`studies.regression.reference_curves.COLUMNS`, at :data:`RECORDED_POINTS` even strokes,
        shape (60,) each.
    """
    grid = np.linspace(0.0, stroke, RECORDED_POINTS + 1)[1:]
    forces = {"knife_N": record.resolved, "edge_N": record.edge[:, 2], "face_N": record.resolved_face}
    curves = {name: np.interp(grid, record.stroke, values) for name, values in forces.items()}
    work = np.interp(grid, np.append(0.0, record.stroke), np.append(0.0, record.work_done))
    return {"stroke_m": grid, **curves, "work_J": work}


@dataclass(frozen=True, eq=False)
class CutOutcome:
    """How the simulation of a cut ended.

    Attributes:
        status: ``done``, or why it did not reach its end.
        columns: What is recorded of it, see :func:`columns_of`; None where it did not reach its end.
    """

    status: str
    columns: Mapping[str, FloatArray] | None


def run_cut(scene: Scene, arch: str, threads: int) -> CutOutcome:
    """One cut in a worker.

    Args:
        scene: The cut.
        arch: Device.
        threads: CPU threads.

    Returns:
        How it ended.
    """
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    record = Simulation(scene, Runtime(arch, threads)).run()
    done = record.status == "done"
    return CutOutcome(record.status, columns_of(record, scene.motion.stroke) if done else None)


@dataclass(frozen=True)
class CutNumbers:
    """Peak [N], where it is [m] and work [J] of a recorded cut."""

    peak_N: float
    peak_stroke_m: float
    work_J: float


def cut_numbers(columns: Mapping[str, FloatArray]) -> CutNumbers:
    """The numbers of a recorded cut."""
    knife, work = columns["knife_N"], columns["work_J"]
    where = float(columns["stroke_m"][np.argmax(knife)])
    return CutNumbers(float(knife.max()), where, float(work[-1]))


def scales(columns: Mapping[str, FloatArray]) -> dict[str, float]:
    """What parts of each checked column are parts of: the largest force on the knife [N], the largest work [J]."""
    force, work = (float(np.abs(columns[name]).max()) for name in ("knife_N", "work_J"))
    return {name: work if name == "work_J" else force for name in CHECKED}


def limit_factor(runs: int) -> float:
    """Repeatability limit over a standard deviation that so many runs gave [-]: 95 of 100 pairs of runs differ by less.

    It is the root of two times Student's t, 3.34 for eight runs, and not below the 2.8 of ISO 5725-6 for many runs.
    """
    return max(REPEATABILITY, math.sqrt(2) * float(student.ppf(0.975, runs - 1)))


@dataclass(frozen=True)
class Repeatability:
    """How much runs of one cut with other seeds scatter (ISO 5725-2).

    Attributes:
        s_r: Largest standard deviation over the stroke between the runs [unit of the column], by column.
        s_r_results: Standard deviation of peak [N], its place [m] and work [J] between the runs, by name.
        limits: Their repeatability limits [the same units], by name.
    """

    s_r: Mapping[str, float]
    s_r_results: Mapping[str, float]
    limits: Mapping[str, float]


def repeatability(runs: Sequence[Mapping[str, FloatArray]]) -> tuple[Repeatability, dict[str, float]]:
    """How much runs of one cut with other seeds scatter, and the tolerances that follow.

    Tolerances are the repeatability limit (:func:`limit_factor`), and :data:`SAME` at least.

    Args:
        runs: Columns of at least two runs, the recorded one first.

    Returns:
        The scatter, and the tolerances [unit of the column] by column.
    """
    s_r = {name: float(np.std([run[name] for run in runs], axis=0, ddof=1).max()) for name in CHECKED}
    numbers = [asdict(cut_numbers(run)) for run in runs]
    own = {name: float(np.std([n[name] for n in numbers], ddof=1)) for name in numbers[0]}
    first, scale = numbers[0], scales(runs[0])
    floors = {name: SAME * abs(first[name]) for name in first}
    floors["peak_stroke_m"] = float(np.diff(runs[0]["stroke_m"]).max())  # a peak is at one of the points
    factor = limit_factor(len(runs))
    limits = {name: max(factor * own[name], floors[name]) for name in own}
    tolerances = {name: max(factor * s_r[name], SAME * scale[name]) for name in CHECKED}
    return Repeatability(s_r, own, limits), tolerances
