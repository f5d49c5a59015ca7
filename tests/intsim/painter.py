"""Stand-ins for what tests of exports need: jobs that are done here, and pictures that no renderer has made."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from calib.simulation.workers import Workers
from intsim.data import pictures
from intsim.data.cameras import CAMERA_NAMES

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

    def __init__(self, scene: int, pixels: int) -> None:
        self.scene, self.pixels = scene, pixels

    def close(self) -> None:
        """Nothing to give back."""

    def pictures(self, stored: Any) -> dict[str, np.ndarray]:
        """One colour a picture; the food's surface must be there."""
        n = len(stored.group["obs/agent/qpos"]) - 1
        assert len(stored.group["mpm/surface"]) == 2
        shades = (10 * np.arange(n) + 40 * self.scene).astype(np.uint8)[:, None, None, None]
        return {view: np.broadcast_to(shades, (n, self.pixels, self.pixels, 3)).copy() for view in CAMERA_NAMES}


def paint_with(painter: type, patch: pytest.MonkeyPatch) -> None:
    """Have it asked for pictures."""
    module = ModuleType("intsim.data.rendering")
    module.Renderer = painter  # type: ignore[attr-defined]
    patch.setitem(sys.modules, "intsim.data.rendering", module)
    patch.setattr(pictures, "_renderer", None)
