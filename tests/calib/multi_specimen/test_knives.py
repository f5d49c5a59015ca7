"""Cuts of one food under several knives: each knife has its own friction, and the flesh is that of all."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from calib.errors import TraceError
from calib.multi_specimen.specimens import JointFit, Specimens, own_of_knives, set_ups
from calib.multi_specimen.study_file import read_study
from calib.problem.joint_objective import JointObjective
from tests.calib.multi_specimen.test_rate_exponent import FAST, made_up

KNIVES = {"one": "edc", "two": "edc", "long": "slicing", "other": "kitchen"}
FIT = "fit: [E, R, R_skin, mu]"


def specimens(folder: Path, *lines: str, knives: dict[str, str] = KNIVES) -> Specimens:
    """A cut under each knife, and where nothing runs."""
    path = made_up(folder, dict.fromkeys(knives, FAST), FIT, *lines)
    text = path.read_text()
    for name, knife in knives.items():
        text = text.replace(f"{{trace: {name}.csv,", f"{{trace: {name}.csv, knife: {knife},")
    path.write_text(text)
    study = read_study(path)
    nothing: Any = None
    return Specimens(study, set_ups(study), (), nothing, nothing)


def joint(made: Specimens, *names: str) -> JointObjective:
    """The objective of some of them."""
    return made._joint_objective(names)


def test_friction_is_each_knifes(tmp_path: Path) -> None:
    """The cuts of a knife share it; the flesh is one, and each specimen has its skin."""
    made = specimens(tmp_path)
    names = joint(made, "one", "two", "long").parameters.names
    assert names == ("E", "R", "R_skin@one", "mu@edc", "R_skin@two", "R_skin@long", "mu@slicing")


@pytest.mark.parametrize(
    ("line", "friction"),
    [("by_knife: []", {"mu"}), ("own: [R_skin, mu]", {"mu@one", "mu@long"}), ("by_knife: [R]", {"mu"})],
)
def test_a_study_says_otherwise(tmp_path: Path, line: str, friction: set[str]) -> None:
    """Shared by all, each specimen's own, or another property in its place."""
    names = joint(specimens(tmp_path, line), "one", "long").parameters.names
    assert {n for n in names if n.startswith("mu")} == friction
    assert ("R@edc" in names) == ("[R]" in line)


def test_one_knife_has_nothing_of_its_own(tmp_path: Path) -> None:
    """All of its cuts share the friction, by its own name."""
    made = specimens(tmp_path, knives={"one": "edc", "two": "edc"})
    assert own_of_knives(made.study, made.setups) == set()
    assert "mu" in joint(made, "one", "two").parameters.names


def test_a_held_out_cut_has_the_friction_of_its_knife(tmp_path: Path) -> None:
    """Where none of the fitted cuts was of that knife, its friction is fitted to the held-out one."""
    made = specimens(tmp_path)
    objective = joint(made, "one", "long")
    values = dict(zip(objective.parameters.names, (4e5, 300.0, 1.0, 0.1, 2.0, 0.3), strict=True))
    assert list(values) == ["E", "R", "R_skin@one", "mu@edc", "R_skin@long", "mu@slicing"]
    result: Any = SimpleNamespace(best=SimpleNamespace(evaluation=SimpleNamespace(parameters=values)))
    fit = JointFit(("one", "long"), objective, result, None)
    assert fit.values("long") == {"E": 4e5, "R": 300.0, "R_skin": 2.0, "mu": 0.3}
    known = fit.shared_values(made.knives["two"])
    assert known == {"E": 4e5, "R": 300.0, "mu": 0.1}
    assert made.own_parameters("two", known) == ("R_skin",)
    unknown = fit.shared_values(made.knives["other"])
    assert unknown == {"E": 4e5, "R": 300.0}
    assert made.own_parameters("other", unknown) == ("R_skin", "mu")


def test_a_trace_may_not_have_the_name_of_a_knife(tmp_path: Path) -> None:
    """Their parameters would have one name."""
    with pytest.raises(TraceError, match="a trace has the name of the knife edc; give it another one"):
        specimens(tmp_path, knives={"edc": "edc", "two": "kitchen"})
