"""The whole record of the best values: kept in a file, read back as it was, made again where that is of something else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.records import whole_record
from mpm.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Motion, Scene
from mpm.solver import Simulation
from tests.mpm.scenes import PRISM


class Counting:
    """Simulates here, and counts."""

    def __init__(self) -> None:
        self.count = 0

    def record(self, scene: Scene) -> ForceRecord:
        """A record with two looks at the section."""
        self.count += 1
        return Simulation(scene, Runtime(threads=1)).run(sections=2)


def test_a_record_is_read_back_with_its_section(tmp_path: Path) -> None:
    """Every number is the same, pieces, counters and section too; another scene or a damaged file is simulated again."""
    pool: Any = Counting()
    path, said = tmp_path / "record.h5", []
    scene = replace(PRISM, motion=Motion(4e-3, 0.02))
    first, again = (whole_record(scene, pool, path, said.append) for _ in range(2))
    assert pool.count == len(said) == 1
    assert first.section is not None and again.section is not None
    for one, two in ((vars(first), vars(again)), (vars(first.section), vars(again.section))):
        for name, value in one.items():
            if name not in ("section", "pieces"):
                assert np.array_equal(value, two[name]), name
    assert first.pieces == again.pieces and len(again.section.stroke) == 2
    whole_record(replace(scene, motion=Motion(5e-3, 0.02)), pool, path, said.append)
    path.write_bytes(b"damaged")
    whole_record(scene, pool, path, said.append)
    assert pool.count == 3
