"""An analytic simulator in place of the particles, with noise and failures like theirs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluation

LENGTH, WIDTH = 0.04, 0.03
STROKE = np.linspace(0.0, LENGTH, 500)
GRID = np.linspace(0.0, LENGTH, 240)
NOISE = 0.01

FIVE = ParameterSet(
    (
        Parameter("E", 5e5, 2e4, 1e7, "Pa", 1e5, 2e6),
        Parameter("yield_stress", 5e4, 2e3, 2e6, "Pa", 1e4, 3e5),
        Parameter("R", 300.0, 10.0, 5e3, "J/m^2", 80.0, 1200.0),
        Parameter("R_skin", 300.0, 5.0, 9e3, "N/m", 60.0, 2000.0),
        Parameter("mu", 0.3, 0.0, 1.0, "-", 0.05, 0.6, "linear"),
    )
)


def three_terms(p: Mapping[str, float]) -> np.ndarray:
    """Force of a cut [N] (500,): skin that is pierced, flesh that is parted, faces that are pressed and rub.

    The skin gives way at a depth that follows from its stiffness, the pressure on the faces saturates at the
    yield stress, friction multiplies it (so that mu and yield_stress are known mainly as a product).
    """
    pierced = 0.004 * math.sqrt((p["R_skin"] / 300.0) / (p["E"] / 5e5))
    skin = np.where(STROKE < pierced, (STROKE / pierced) ** 1.5, np.exp(-(STROKE - pierced) / 0.002))
    rise = 0.002 * math.sqrt((p["R"] / 300.0) / (p["E"] / 5e5))
    flesh = 1.0 - np.exp(-np.maximum(STROKE - 0.7 * pierced, 0.0) / rise)
    pressure = 1.0 / (1.0 / (0.12 * p["E"]) + 1.0 / p["yield_stress"])
    faces = pressure * 0.002 * (1.0 + p["mu"] / 0.2) * np.minimum(STROKE / 0.02, 1.0) ** 1.2
    release = np.sqrt(np.minimum((LENGTH - STROKE) / 0.004, 1.0))
    return WIDTH * (p["R_skin"] * skin + p["R"] * flesh + faces) * release


def two_terms(p: Mapping[str, float]) -> np.ndarray:
    """A quick fake: a plateau for R, a ramp of 4 N for mu = 0.2 [N] (500,)."""
    return WIDTH * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + 20.0 * p["mu"] * STROKE / LENGTH


def noise(p: Mapping[str, float], size: float) -> np.ndarray:
    """Smooth noise (500,) that depends on the parameters like that of a chaotic, repeatable solver."""
    digest = hashlib.sha256(repr(sorted(p.items())).encode()).digest()
    kernel = np.exp(-0.5 * (np.arange(-30, 31) / 10.0) ** 2)
    white = np.random.default_rng(list(digest)).standard_normal(560)
    return size * np.convolve(white, kernel / np.linalg.norm(kernel), "valid")


class Fake:
    """An analytic simulator with noise that breaks down at 40 % of the stroke where ``breaks`` says so."""

    def __init__(
        self,
        force: Callable[[Mapping[str, float]], np.ndarray] = three_terms,
        *,
        noisy: float = NOISE,
        breaks: Callable[[Mapping[str, float]], bool] = lambda p: False,
        backwards: bool = True,
        interrupt_after: int | None = None,
        parted: Callable[[Mapping[str, float]], float] = lambda p: 1.0,
    ) -> None:
        self.force, self.noisy, self.breaks, self.backwards = force, noisy, breaks, backwards
        self.parted = parted
        self.interrupt_after = interrupt_after
        self.runs = 0
        self.batches: list[int] = []

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Runs in reverse order of the batch (or in order), as if the last had finished first."""
        self.batches.append(len(batch))
        for index in sorted(range(len(batch)), reverse=self.backwards):
            if self.runs == self.interrupt_after:
                raise KeyboardInterrupt
            self.runs += 1
            p = dict(batch[index])
            force = self.force(p)
            force = force + self.noisy * force.max() * noise(p, 1.0)
            if self.breaks(p):
                yield Evaluation(index, p, "failed", "inverted", 0.4, STROKE[:200], force[:200], {}, 2.0)
            else:
                yield Evaluation(
                    index,
                    p,
                    "ok",
                    "",
                    1.0,
                    STROKE,
                    force,
                    {"peak_N": float(force.max()), "parted": self.parted(p)},
                    4.0,
                )


def unstable(p: Mapping[str, float]) -> bool:
    """A yield stress above 0.3 E breaks the fake: a tenth of the prior box, beside the truths."""
    return p["yield_stress"] > 0.3 * p["E"]


def goal(
    truth: Mapping[str, float],
    parameters: ParameterSet = FIVE,
    force: Callable[[Mapping[str, float]], np.ndarray] = three_terms,
) -> Objective:
    """Objective whose real curve is the truth's with its own 1 % of noise."""
    curve = force(truth)
    curve = np.interp(GRID, STROKE, curve + NOISE * curve.max() * noise({"trace": 1.0}, 1.0))
    target = Target(GRID, curve, NOISE * curve.max(), NOISE * curve.max(), np.interp)
    return Objective(target, parameters)
