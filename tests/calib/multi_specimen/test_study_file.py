"""Studies of several cuts: what their file may say, each mistake in it in one line, and what is held out of what."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calib.material.food import load_food
from calib.material.food_file import dump_material
from calib.multi_specimen.compression_modulus import compression_modulus, with_measured_modulus
from calib.multi_specimen.spec import SCATTER, SPECIMEN_PROPERTIES
from calib.multi_specimen.study_file import read_study
from calib.problem.food_parameters import fit_parameters
from mpm.scene.errors import CutcalError
from tests.calib.fake import FIVE, goal

GOOD = """
food: banana
knife: edc
fit: [E, R, R_skin]
hold_out: b
set: {nu: 0.4}
traces:
  a: {trace: a.csv, air: air.csv, width: 0.03}
  b: {trace: b.csv, speed: 0.02, knife: kitchen, gain_sd: 0.1, sign: "-"}
  gel: {kind: compression, trace: [one.csv, two.csv], height: 0.03, diameter: 0.05, nu: 0.45}
"""


def written(folder: Path, text: str) -> Path:
    """A study in a folder."""
    path = folder / "study.yaml"
    path.write_text(text)
    return path


def test_a_study_is_read_with_paths_from_its_folder(tmp_path: Path) -> None:
    """What is said once holds for all traces, what is said of one for that one."""
    study = read_study(written(tmp_path, GOOD))
    a, b = study.requests["a"], study.requests["b"]
    assert a.trace == tmp_path / "a.csv" and a.air == tmp_path / "air.csv" and b.air is None
    assert (a.knife, b.knife) == ("edc", "kitchen") and (a.sizing.width, b.sizing.width) == (0.03, None)
    assert b.speed == 0.02 and b.gain_sd == 0.1 and b.columns["sign"] == "-"
    assert a.scaled and b.scaled and a.fit == ("E", "R", "R_skin") and a.food.value("nu") == 0.4
    assert study.hold_out == ("b",) and study.specimen_properties == SPECIMEN_PROPERTIES
    assert study.budget == 100.0 and study.scatter == SCATTER
    assert study.compressions[0].traces == (tmp_path / "one.csv", tmp_path / "two.csv")


def test_a_trace_of_a_study_has_its_own_outline(tmp_path: Path) -> None:
    """A file beside the study; what is wrong with it is said with its place."""
    (tmp_path / "egg.csv").write_text("y_mm,radius_mm\n0,0\n30,20\n60,0\n")
    text = GOOD.replace("width: 0.03", "outline: egg.csv, outline_as: half, at: 0.25")
    sizing = read_study(written(tmp_path, text)).requests["a"].sizing
    assert (sizing.length, sizing.width, sizing.height, sizing.at) == pytest.approx((0.06, 0.04, 0.02, 0.25))
    assert sizing.outline is not None and sizing.outline.how == "half"
    with pytest.raises(CutcalError, match=r"study.yaml: traces.a: .*egg.csv: .*leave --scale out"):
        read_study(written(tmp_path, text.replace("at: 0.25", "scale: 1mm/px")))


def test_numbers_may_have_their_unit(tmp_path: Path) -> None:
    """Sizes, speed, cells and those of a compression are written as on the command line."""
    plain = read_study(written(tmp_path, GOOD + "dx: 0.004\n"))
    text = GOOD.replace("width: 0.03", "width: 30 mm").replace("speed: 0.02", "speed: 20mm/s")
    units = read_study(written(tmp_path, text.replace("diameter: 0.05", "diameter: 5cm") + "dx: 4mm\n"))
    for name, request in plain.requests.items():
        other = units.requests[name]
        assert (other.sizing, other.speed, other.dx) == (request.sizing, request.speed, 0.004)
    assert units.compressions[0].sizes == plain.compressions[0].sizes


def test_a_cut_says_what_its_board_does(tmp_path: Path) -> None:
    """One specimen may lie on a rack: its board is set for it alone, and its suction is then not fitted."""
    text = GOOD.replace("food: banana", "food: potato").replace("width: 0.03", "set: {board_suction: 0}")
    study = read_study(written(tmp_path, text))
    held = {name: request.food.value("board_suction") for name, request in study.requests.items()}
    assert held == {"a": 0.0, "b": study.food.value("board_suction")} and held["b"] != 0.0
    on_rack, on_board = (study.requests[name].food.default_fit for name in ("a", "b"))
    assert [name for name in on_board if name not in on_rack] == ["board_suction"]


def test_a_food_of_ones_own_is_a_file_beside_the_study(tmp_path: Path) -> None:
    """A file stands where a food's name does; its food has the name that it has there."""
    dump_material(replace(load_food("banana"), name="mine"), tmp_path / "mine.yaml", {})
    study = read_study(written(tmp_path, GOOD.replace("food: banana", "food: mine.yaml")))
    assert study.food.name == "mine"
    with pytest.raises(CutcalError, match=r"study.yaml: food: .*none.yaml"):
        read_study(written(tmp_path, GOOD.replace("food: banana", "food: none.yaml")))


def test_each_is_all_in_turn(tmp_path: Path) -> None:
    """hold_out: each names every cut, and no compression test."""
    study = read_study(written(tmp_path, GOOD.replace("hold_out: b", "hold_out: each")))
    assert study.hold_out == ("a", "b")


def test_the_command_line_says_how_to_run_it(tmp_path: Path) -> None:
    """Budget, device and command reach every trace."""
    study = read_study(written(tmp_path, GOOD))
    new = study.run_with(budget=30.0, arch="cpu", command=("calibrate",))
    assert {(r.budget, r.arch, r.command) for r in new.requests.values()} == {(30.0, "cpu", ("calibrate",))}
    assert new.budget == 30.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("food: banana", "food: bananna", "study.yaml: food: unknown food 'bananna', did you mean 'banana'"),
        ("hold_out: b", "holdout: b", "study.yaml: holdout: unknown key, did you mean 'hold_out'"),
        (
            "hold_out: b",
            "scatter: 20",
            "study.yaml: scatter: is 20; give 0 to 1, the standard deviation of a logarithm",
        ),
        ("hold_out: b", "scatter: -0.1", "scatter: is -0.1; give 0 to 1"),
        ("hold_out: b", "hold_out: c", "'c' is no trace of this study; known: a, b"),
        ("hold_out: b", "hold_out: [a, b]", "nothing would be left to fit"),
        ("width: 0.03", "widht: 0.03", "study.yaml: traces.a.widht: unknown key, did you mean 'width'"),
        (
            "width: 0.03",
            "width: wide",
            "study.yaml: traces.a.width: 'wide' is not a length: write it in m, or with its unit",
        ),
        (
            "width: 0.03",
            "set: {R: 200}",
            "study.yaml: traces.a.set.R: only board_friction, board_suction and bow are set for one cut",
        ),
        ("speed: 0.02", "speed: -0.02", "study.yaml: traces.b.speed: is -0.02; it must be positive"),
        ("kind: compression", "kind: pull", "study.yaml: traces.gel.kind: unknown value 'pull'"),
        ("diameter: 0.05, ", "", "give height and diameter of an upright cylinder"),
        ("  a: {trace: a.csv,", "  a@b: {trace: a.csv,", "may not hold '@'"),
        ("set: {nu: 0.4}", "set: {nu: 0.7}", "cannot be the Poisson's ratio"),
        ("  b: {trace", "  a: {trace", "the key 'a' is given twice"),
        ("food: banana", "food: 3", "study.yaml: food: is a number, but text is needed"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    """Each mistake is one error that says where it is and what to write."""
    assert old in GOOD
    with pytest.raises(CutcalError) as error:
        read_study(written(tmp_path, GOOD.replace(old, new)))
    assert said in str(error.value) and "\n" not in str(error.value)


def test_a_study_without_cuts_is_refused(tmp_path: Path) -> None:
    """Compression tests alone are the business of another command."""
    text = GOOD.replace("  a: {trace: a.csv, air: air.csv, width: 0.03}\n", "").replace("hold_out: b\n", "")
    with pytest.raises(CutcalError, match="holds no cut"):
        read_study(written(tmp_path, "\n".join(x for x in text.splitlines() if not x.startswith("  b:"))))


def test_a_compression_test_pins_the_modulus(tmp_path: Path) -> None:
    """A block of 1 MPa between plates: E to 2 %, and a prior of E that is as narrow as plates allow."""
    strain = np.linspace(0.0, 0.25, 200)
    for name, modulus in (("one", 0.97e6), ("two", 1.03e6)):
        force = modulus * (strain + 0.9 * strain**2) * np.pi / 4 * 0.05**2  # near the law's own curve at nu 0.45
        pd.DataFrame({"compression_m": 0.03 * strain, "force_N": force}).to_csv(tmp_path / f"{name}.csv", index=False)
    test = compression_modulus(read_study(written(tmp_path, GOOD)).compressions[0])
    assert test.repeats == 2 and test.E == pytest.approx(1e6, rel=0.1) and 0.1 < test.spread < 0.15
    banana = load_food("banana")
    narrowed = with_measured_modulus(FIVE, [test], banana)
    before, after = FIVE["E"], narrowed["E"]
    assert after.prior_sd < 0.25 * before.prior_sd and after.prior_low < test.E < after.prior_high
    assert narrowed["yield_stress"].prior_sd < 0.7 * fit_parameters(banana, ("yield_stress",))["yield_stress"].prior_sd
    assert with_measured_modulus(FIVE, [], banana) is FIVE


def test_factor_of_a_specimen_is_least_squares_with_its_prior() -> None:
    """Without a scale nuisance the factor is 1, with a wide one that of the curves, with a narrow one nearly 1."""
    one = goal({"E": 3e5, "yield_stress": 4e4, "R": 500.0, "R_skin": 200.0, "mu": 0.2})
    curve = one.target.curve
    assert one.factor(0.5 * curve) == 1.0
    for sd, expected in ((10.0, 2.0), (1e-3, 1.0)):
        scaled = replace(one, scale_sd=sd)
        assert scaled.factor(0.5 * curve) == pytest.approx(expected, abs=0.01)
