"""Every number in an HDF5 file says its unit and what it is; files that do not are read all the same."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from calib.calibration.summary import add_conditioning
from calib.io.meaning import ATTRIBUTE_MEANINGS, DESCRIPTION, UNIT, UNKNOWN
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.properties import DIMENSIONS, FORM, PROPERTIES, SPECIMEN
from calib.material.scene import Sizing, cut_scene, specimen
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_meanings import FIXED, SCALARS, meaning_of
from calib.simulation.evaluation_store import EvaluationStore
from calib.simulation.record_file import read_record, record_errands, record_meanings
from calib.simulation.workers import evaluation_of
from mpm.output.record import ForceRecord
from mpm.output.section import Section
from mpm.output.topology import Topology
from mpm.scene import Scene
from tests.calib.cheap import cut
from tests.calib.simulation.test_evaluation_store import assert_same
from tests.calib.simulation.test_flipped_bits import HEADER

KNOWN = PROPERTIES | DIMENSIONS | FORM | SPECIMEN
TRACE = "R_skin@cut2"


def scene() -> Scene:
    """The default cut of a banana."""
    food = load_food("banana")
    return cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"))


def withdrawn() -> ForceRecord:
    """A made-up record in which nothing is left out."""
    made = cut(scene())
    wide, one = np.zeros((2, 3)), np.zeros(2)
    return replace(
        made,
        cohesion=made.parting,
        adhesion=made.parting,
        section=Section(one, wide, wide, wide, wide, True),
        pieces=Topology((1e-4, 9e-5), 0.0, 0.0, None, 0.0),
        severed_area=1e-3,
        resistance=100.0,
        rows_down=len(made.stroke) - 5,
    )


def sets(path: Path) -> dict[str, tuple[Any, Any]]:
    """Unit and description of every data set of a file; None where it has none."""
    found: dict[str, tuple[Any, Any]] = {}
    with h5py.File(path) as file:

        def look(name: str, node: Any) -> None:
            if isinstance(node, h5py.Dataset):
                found[name] = node.attrs.get(UNIT), node.attrs.get(DESCRIPTION)

        file.visititems(look)
    return found


def axes(path: Path) -> dict[str, int]:
    """Number of axes of every data set of a file."""
    found: dict[str, int] = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, node: found.update({name: node.ndim}) if isinstance(node, h5py.Dataset) else None)
    return found


def rank(shape: str) -> int:
    """Number of axes of a shape that is written as a tuple; empty for a single value."""
    return len([size for size in shape.strip("()").split(",") if size.strip()])


def attributes(path: Path, group: str = "/") -> tuple[set[str], dict[str, Any]]:
    """Names of the attributes of a file or group, and what is told of them."""
    with h5py.File(path) as file:
        return set(file[group].attrs) - {DESCRIPTION, ATTRIBUTE_MEANINGS}, json.loads(
            file[group].attrs[ATTRIBUTE_MEANINGS]
        )


def assert_told(found: dict[str, tuple[Any, Any]]) -> None:
    """Each has a unit and a sentence."""
    silent = [n for n, (unit, text) in found.items() if not unit or not text or UNKNOWN.unit == unit]
    assert found and silent == []


def bare(path: Path) -> None:
    """Make a file what an older version has written."""
    with h5py.File(path, "r+") as file:

        def strip(name: str, node: Any) -> None:
            for key in (UNIT, DESCRIPTION):
                if isinstance(node, h5py.Dataset):
                    del node.attrs[key]

        file.visititems(strip)
        del file.attrs[DESCRIPTION], file.attrs[ATTRIBUTE_MEANINGS]


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    """A store with a run of every parameter, one of them of a trace alone, and of every scalar, and with its trace."""
    path = tmp_path / "evaluations.h5"
    run = evaluation_of(withdrawn())
    values = dict.fromkeys([*KNOWN, TRACE, "height@cut2"], 0.5)
    with EvaluationStore(path, HEADER) as store:
        store.append("a", replace(run, parameters=values, scalars=dict.fromkeys(SCALARS, 1.0) | run.scalars), "fine")
    three = np.arange(3.0)
    conditioned: Any = SimpleNamespace(time=three, force=three, trace=SimpleNamespace(force=three))
    add_conditioning(path, conditioned)
    return path


def test_every_set_of_a_store_says_what_it_is(stored):
    """Columns, parameters, scalars, curves and the trace; and nothing is described that there is not."""
    found = sets(stored)
    assert_told(found)
    assert {n for n in found if n.split("/")[0] not in ("parameters", "scalars")} == set(FIXED)
    assert found["curves/force"][0] == "N" and found["conditioning/time_s"][0] == "s"
    assert axes(stored) == {name: rank(meaning_of(name).shape) for name in found}
    names, told = attributes(stored)
    assert names == set(told) == {"schema", "trace_sha256", "scene_key"}


def test_parameters_have_the_units_of_the_table_of_properties(stored):
    """Each property and size, and what a property is for one trace alone."""
    found = sets(stored)
    for name, rule in KNOWN.items():
        assert found[f"parameters/{name}"] == (rule.unit, rule.meaning)
    assert found[f"parameters/{TRACE}"][0] == PROPERTIES["R_skin"].unit
    assert "cut2" in found[f"parameters/{TRACE}"][1] and found["parameters/height@cut2"][0] == "m"


def test_scalars_have_the_units_of_their_names(stored):
    """A name that ends in a unit has that unit."""
    ends = {"N": "N", "J": "J", "m": "m", "s": "s"}
    for name, meaning in SCALARS.items():
        head, _, end = name.rpartition("_")
        assert meaning.unit == (ends.get(end, "-") if head else "-"), name
    assert set(evaluation_of(withdrawn()).scalars) <= set(SCALARS)


def test_every_set_and_attribute_of_a_record_says_what_it_is(tmp_path):
    """All that a record has, the section too; units are those of its docstrings."""
    path = tmp_path / "record.h5"
    (errand,) = record_errands(scene(), path)
    errand.keep(withdrawn())
    found = sets(path)
    assert_told(found)
    assert {f"section/{f.name}" for f in fields(Section)} <= set(found)
    assert found["edge"] == ("N", "Force of the food on the cutting edge")
    assert axes(path) == {name: rank(record_meanings()[name].shape) for name in found}
    assert (found["momentum"][0], found["tilt"][0], found["section/mises"][0]) == ("N s", "rad", "Pa")
    names, told = attributes(path)
    assert names == set(told) and "unknown" not in [one[UNIT] for one in told.values()]
    assert told["resistance"][UNIT] == "J/m^2" and told["cell"][UNIT] == "m"
    assert {f.name for f in fields(ForceRecord)} - {"section"} <= set(record_meanings())


def test_older_files_without_it_are_read(stored, tmp_path):
    """A store is gone on with, and says what it has when it is written again; a record is not simulated again."""
    (before,) = EvaluationStore(stored, HEADER, resume=True)
    bare(stored)
    with EvaluationStore(stored, HEADER, resume=True) as store:
        (entry,) = store
        assert_same(entry.evaluation, before.evaluation)
        assert store.damaged == 0 and store.get("a") is not None
        store.append("b", Evaluation(0, {"E": 1.0}, "ok", "", 1.0, np.zeros(1), np.zeros(1)), "fine")
    assert_told(sets(stored))
    path, wanted = tmp_path / "record.h5", withdrawn()
    (errand,) = record_errands(scene(), path)
    errand.keep(wanted)
    with h5py.File(path, "r+") as file:
        for name in ("edge", "section/y"):
            del file[name].attrs[UNIT], file[name].attrs[DESCRIPTION]
    assert record_errands(scene(), path) == []
    assert np.array_equal(read_record(scene(), path).edge, wanted.edge)


def test_a_record_of_an_older_version_is_read(tmp_path, monkeypatch):
    """One that was written before a file said what it has: without an attribute of them all."""
    path = tmp_path / "record.h5"
    with monkeypatch.context() as older:
        older.setattr("calib.simulation.record_file.describe_sets", lambda *_: None)
        older.setattr("calib.simulation.record_file.describe_attributes", lambda *_: None)
        (errand,) = record_errands(scene(), path)
        errand.keep(withdrawn())
    assert set(sets(path).values()) == {(None, None)}
    assert record_errands(scene(), path) == []
