"""The whole record of the best values: kept in a file, read back as it was, made again where that is of something
else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.errors import OutputError
from calib.simulation.record_file import read_record, record_errands
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Motion, Scene
from mpm.solver import Simulation
from tests.mpm.scenes import PRISM, WEDGE


def whole(scene: Scene, path: Path) -> tuple[ForceRecord, int]:
    """A record with two looks at the section, and how many simulations it took."""
    errands = record_errands(scene, path)
    for errand in errands:
        errand.keep(Simulation(errand.scene, Runtime(threads=1)).run(sections=2))
    return read_record(scene, path), len(errands)


def test_a_record_is_read_back_with_its_section(tmp_path: Path) -> None:
    """Every number is the same, pieces, counters and section too; another scene or a damaged file is simulated
    again."""
    path = tmp_path / "record.h5"
    scene = replace(PRISM, motion=Motion(4e-3, 0.02))
    (first, one), (again, none) = (whole(scene, path) for _ in range(2))
    assert (one, none) == (1, 0)
    assert first.section is not None and again.section is not None
    for one, two in ((vars(first), vars(again)), (vars(first.section), vars(again.section))):
        for name, value in one.items():
            if name not in ("section", "pieces"):
                assert np.array_equal(value, two[name]), name
    assert first.pieces == again.pieces and len(again.section.stroke) == 2
    assert whole(replace(scene, motion=Motion(5e-3, 0.02)), path)[1] == 1
    path.write_bytes(b"damaged")
    with pytest.raises(OutputError, match="--resume"):
        read_record(scene, path)
    assert whole(scene, path)[1] == 1


def test_energy_of_ties_is_read_back(tmp_path: Path) -> None:
    """Of a cohesive crack; a record without one has none when it is read back."""
    scene = replace(PRISM, knife=WEDGE, motion=Motion(4e-3, 0.02)).with_material(E=1e7, R=30.0, R_initiation=30.0)
    (first, one), (again, none) = (whole(scene, tmp_path / "tied.h5") for _ in range(2))
    assert (one, none) == (1, 0) and first.cohesion is not None and again.cohesion is not None
    assert np.array_equal(first.cohesion, again.cohesion) and first.cohesion[-1] > 0
    nodal = replace(scene, numerics=replace(scene.numerics, contact="nodal"))
    assert whole(nodal, tmp_path / "nodal.h5")[0].cohesion is None
