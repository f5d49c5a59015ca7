"""Stand-ins for what tests of exports need: jobs that are done here, and pictures that no renderer has made."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from calib.simulation.workers import Workers
from intsim.data import pictures
from intsim.render.view import PICTURE_CAMERAS

PIXELS = 32


class Here(Workers):
    """Jobs one after the other in this process, until so many are done."""

    def __init__(self, most: int = 1_000_000) -> None:
        super().__init__(1, "cpu", 1)
        self.most = most

    def close(self) -> None:
        """Nothing to end."""

    def each(self, work: Any, jobs: Any) -> Iterator[tuple[int, Any]]:
        """In order."""
        for k, job in enumerate(jobs):
            if self.most == 0:
                raise KeyboardInterrupt
            self.most -= 1
            yield k, work(*job, "cpu", 1)


class Painter:
    """Pictures that tell scene and step by their colour."""

    def __init__(self, pixels: int, threads: int = 1) -> None:
        self.pixels = pixels

    def frames(self, stored: Any, backgrounds: Sequence[int]) -> Iterator[dict[int, dict[str, np.ndarray]]]:
        """One colour a picture; the food's surface must be there."""
        n = len(stored.group["obs/agent/qpos"]) - 1
        assert len(stored.group["mpm/surface"]) == 2
        for t in range(n):
            yield {k: {view: self.painted(k, t) for view in PICTURE_CAMERAS} for k in backgrounds}

    def painted(self, background: int, step: int) -> np.ndarray:
        """The picture of a step before a background."""
        return np.full((self.pixels, self.pixels, 3), (10 * step + 40 * background) % 256, np.uint8)

    def pictures(self, stored: Any, background: int) -> dict[str, np.ndarray]:
        """All of a trajectory before a background (T, h, w, 3)."""
        n = len(stored.group["obs/agent/qpos"]) - 1
        return {view: np.array([self.painted(background, t) for t in range(n)]) for view in PICTURE_CAMERAS}


def paint_with(painter: type, patch: pytest.MonkeyPatch) -> None:
    """Have it asked for pictures."""
    module = ModuleType("intsim.data.rendering")
    module.Renderer = painter  # type: ignore[attr-defined]
    patch.setitem(sys.modules, "intsim.data.rendering", module)
    patch.setattr(pictures, "_renderer", None)
