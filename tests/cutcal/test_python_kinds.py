"""Arguments of a wrong kind to the names of the interface: one sentence each, never an error of Python's own."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutcal import Calibration, Design, Food, Study, Trace
from mpm.scene.errors import CutcalError
from tests.data_dir import ROOT

RECORD = ROOT / "force_data" / "banana_reconstructed.csv"
WRONG: tuple[Any, ...] = (3, None, True, 3.5, [1], {1: 2}, b"x", object())
"""Values of which an argument may take some, but none may do more than be refused."""


def with_one(call: Callable[..., object], name: str, /, **others: Any) -> Callable[[Any], object]:
    """The call with one argument left open."""
    return lambda value: call(**others, **{name: value})


def calls() -> Mapping[str, Callable[[Any], object]]:
    """A call of each function that simulates nothing, or refuses before it does, with one argument left open."""
    food, trace, plain = Food.load("banana"), Trace.read(RECORD), np.arange(30.0)
    calibration = Calibration("banana", RECORD)
    cut = {"food": "banana", "trace": RECORD}
    out: dict[str, Callable[[Any], object]] = {
        "Food.load: name": Food.load,
        "Food.save: path": food.save,
        "Food.with_sizes: sizes": partial(food.with_sizes, status="given", source="here"),
        "Food.with_values: values": food.with_values,
        "Food.with_values: a name": lambda value: food.with_values({value: 1.0} if value.__hash__ else value),
        "a property: name": food.value,
        "a property, its prior: name": food.prior,
        "Trace.until: end": trace.until,
        "Trace.part: kept": trace.part,
        "Trace.read: path": Trace.read,
        "Trace: time": lambda value: Trace(value, plain),
        "Trace: force": lambda value: Trace(plain, value),
        "Calibration.check: png": lambda value: calibration.check("" if value is None else value),
        "Calibration.load: out": Calibration.load,
        "Calibration.request: out": calibration.request,
        "Study: spec": Study,
        "Study.read: path": Study.read,
        "Study.load: out": Study.load,
        "Study.of_cuts: calibration": Study.of_cuts,
        "Design: start": Design,
    }
    out |= {f"Food.to_scene_food: {n}": with_one(food.to_scene_food, n) for n in ("height", "width", "length", "shape")}
    out |= {f"Food: {f.name}": with_one(Food, f.name, **{k: v for k, v in vars(food).items() if k != f.name})
            for f in fields(food)}  # fmt: skip
    out |= {f"Trace: {f.name}": with_one(Trace, f.name, time=plain, force=plain) for f in fields(Trace)[2:]}
    reading = ("time_col", "force_col", "position_col", "depth_col", "sign", "rate", "decimal")
    out |= {f"Trace.read: {n}": with_one(Trace.read, n, path=RECORD) for n in reading}
    out |= {f"Trace.from_frame: {n}": with_one(Trace.from_frame, n, frame=trace.frame()) for n in ("source", "label")}
    for item in fields(Calibration):
        if item.init:
            others = {k: v for k, v in cut.items() if k != item.name}
            out[f"Calibration: {item.name}"] = with_one(Calibration, item.name, **others)
    for item in fields(Design)[1:]:
        if item.init:
            out[f"Design: {item.name}"] = with_one(Design, item.name, start="banana")
    return out


def raised(call: Callable[[Any], object], value: Any) -> Exception | None:
    """What a call raises that is given a value."""
    try:
        call(value)
    except (CutcalError, AttributeError, LookupError, OSError, TypeError, ValueError) as error:
        return error
    return None


def test_a_wrong_kind_is_an_error_of_our_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever an argument is given, it is taken, or refused in one line of text."""
    monkeypatch.chdir(tmp_path)
    found = [
        (name, value, error) for name, call in calls().items() for value in WRONG if (error := raised(call, value))
    ]
    assert len(found) > 400
    assert [one for one in found if not isinstance(one[2], CutcalError)] == []
    assert [one for one in found if "\n" in str(one[2]) or len(str(one[2])) > 450] == []


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Food.load(3), "Food.load: name = 3; give a name or a YAML file"),  # type: ignore[arg-type]
        (lambda: Food.load("banana").with_values(3), "Food.with_values: values = 3; give a dict"),  # type: ignore[arg-type]
        (lambda: Food.load("banana").value(3), "a property: name = 3; give text, such as 'E'"),  # type: ignore[arg-type]
        (lambda: Trace.read(3), "3 is no record: give the path of a file, or a pandas DataFrame"),  # type: ignore[arg-type]
        (lambda: Trace.read(RECORD, force_col=3), "record: force_col = 3; give the name of a column"),
        (lambda: Trace.read(RECORD).until(None), "Trace.until: end = None; give a number"),  # type: ignore[arg-type]
        (lambda: Calibration.load(3), "Calibration.load: out = 3; give the path of a folder"),  # type: ignore[arg-type]
        (lambda: Calibration("banana", RECORD, budget=None), "budget = None must be a number"),  # type: ignore[arg-type]
        (lambda: Study.read(3), "Study.read: path = 3; give the path of a file"),  # type: ignore[arg-type]
        (lambda: Study.of_cuts("x"), "Study.of_cuts: calibration = 'x'; give a Calibration"),  # type: ignore[arg-type]
        (lambda: Design("banana", set=3), "Design: set = 3; give a dict such as"),  # type: ignore[arg-type]
        (lambda: Design("banana", blade=[1]), "Design: a blade = 1; give a name or a YAML file"),  # type: ignore[list-item]
        (lambda: Design("banana", minutes=3), "Design: minutes = 3; give a dict"),  # type: ignore[arg-type]
    ],
)
def test_a_wrong_kind_is_named_with_what_is_wanted(call: Callable[[], object], words: str) -> None:
    """Which argument, what was given, and what to give."""
    with pytest.raises(CutcalError, match=re.escape(words)):
        call()


def test_runs_refuse_a_wrong_kind_before_they_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder and the listener of a design, and the folder of a calibration and of a study."""
    for module in ("calibration", "multi_specimen", "design"):
        monkeypatch.setattr(f"calib.{module}.run.run", lambda *_, **__: pytest.fail("the run began"))
    study = tmp_path / "study.yaml"
    study.write_text(f"food: banana\ntraces:\n  a: {{trace: {RECORD}}}\n  b: {{trace: {RECORD}}}\n")
    design = Design("banana")
    for one in (Calibration("banana", RECORD), Study.read(study), design):
        with pytest.raises(CutcalError, match=rf"{type(one).__name__}.run: out = 3; give the path of a folder"):
            one.run(3)  # type: ignore[arg-type]
    for how, words in (({"say": "print"}, "say = 'print'"), ({"resume": "yes"}, "resume = 'yes'")):
        with pytest.raises(CutcalError, match=rf"Design.run: {words}"):
            design.run(tmp_path / "out", **how)  # type: ignore[arg-type]
