"""A food of formulas for tests of a design: forces that the parameters make under any blade, in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from calib.io.provenance import key_of
from calib.simulation.evaluation import Evaluation
from calib.simulation.workers import Workers
from mpm.scene import Knife, Scene

ROWS = 300


def force(scene: Scene, values: Mapping[str, float], noisy: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Stroke [m] and force [N]: R along the edge, pressure on the faces that the blade's angle decides, a start.

    Args:
        scene: The cut.
        values: Values [SI] by name.
        noisy: Noise of a run, part of the peak.
    """
    m = {**vars(scene.food.material), **values}
    width, height = scene.food.shape.width, scene.food.shape.height
    assert isinstance(scene.knife, Knife)
    x = np.linspace(0.0, 1.0, ROWS)
    flesh = m["R"] * (1.0 - np.exp(-x / 0.05))
    start = (m["R_initiation"] - m["R"]) * np.exp(-(((x - 0.1) / 0.03) ** 2))
    pressure = 1.0 / (1.0 / (0.3 * m["E"]) + 1.0 / m["yield_stress"])
    faces = pressure * np.tan(scene.knife.angle / 2.0) * height * x * (1.0 + m["mu"]) / 8.0
    curve = width * (flesh + start + faces)
    seed = int(key_of([scene.as_dict(), sorted(values.items())])[:8], 16)
    wave = np.random.default_rng(seed).standard_normal(8) @ np.sin(np.outer(np.arange(1, 9), np.pi * x)) / 2.0
    return scene.motion.stroke * x, curve + noisy * curve.max() * wave


class MadeFood(Workers):
    """Runs the formula; counts its runs, and breaks where it is told to.

    Args:
        noisy: Noise of a run, part of the peak.
        breaks: Whether a cut with these values is none.
    """

    def __init__(self, noisy: float = 0.0, breaks: Callable[[Scene, Mapping[str, float]], bool] | None = None) -> None:
        super().__init__(1, "cpu", 1)
        self.noisy, self.breaks, self.runs = noisy, breaks, 0

    def close(self) -> None:
        """Nothing is open."""

    def each(self, work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Each job by the formula."""
        for k, (scene, values) in enumerate(jobs):
            self.runs += 1
            if self.breaks is not None and self.breaks(scene, values):
                yield k, Evaluation(0, {}, "failed", "inverted", 0.5, np.empty(0), np.empty(0))
            else:
                yield k, Evaluation(0, {}, "ok", "", 1.0, *force(scene, values, self.noisy), {"parted": 1.0})
