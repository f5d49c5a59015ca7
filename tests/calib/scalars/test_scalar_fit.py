"""Published numbers: the file, least squares with few evaluations, closed forms,
a study killed and resumed, Kachru 1995.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import PublishedError
from calib.problem.parameters import Parameter, ParameterSet
from calib.scalars.cut_simulator import CutSimulator
from calib.scalars.fitted_numbers import fitted_numbers
from calib.scalars.gauss_newton import LeastSquaresProblem, gauss_newton, solve_together
from calib.scalars.given_numbers_fit import fit_given_numbers
from calib.scalars.published_data import CUT_ENERGY, PEAK_FORCE, load_published
from calib.scalars.randomised_likelihood import randomised_fits
from calib.simulation.evaluation import Evaluation
from cutcal.main import main
from tests.calib.documents import valid
from tests.data_dir import ROOT

KACHRU = ROOT / "force_data" / "kachru1995.yaml"
PATIENCE_S = 120.0
R = 400.0  # J/m^2
WIDTH = 0.024  # m
# A blade of 0.1 mm between frictionless faces; R_initiation = R, so that the force is R times the width from start to
# end.
KNIFE = """thin:
  spine: {value: 1.0e-4, unit: m}
  angle: {value: 0.2, unit: deg}
  height: {value: 0.045, unit: m}
  length: {value: 0.2, unit: m}
"""
PRISM = f"""source: closed form
food: potato
knife: thin.yaml
fit: [R]
vary: [E]
properties:
  skin_thickness: {{value: 0, low: 0, high: 0, unit: m, status: assumed, source: none}}
  mu: {{value: 0, low: 0, high: 0.1, unit: "-", status: assumed, source: none}}
  R: {{value: 300, low: 100, high: 1000, unit: J/m^2, status: assumed, source: none}}
  R_initiation: {{value: 100, low: 50, high: 200, unit: N/m, status: assumed, source: none}}
  initiation_depth: {{value: 1.0e-3, low: 0.5e-3, high: 2.0e-3, unit: m, status: assumed, source: none}}
specimens:
  one:
    shape: block
    width_m: {WIDTH}
    height_m: 0.024
    given: {{peak_N: {{value: {R * WIDTH}, relative_sd: 0.02}}}}
    predicted: {{energy_J_m2: {{value: {R}, relative_sd: 0.02}}}}
"""


@pytest.fixture
def prism(tmp_path):
    """The file of a prism, and its knife beside it."""
    (tmp_path / "thin.yaml").write_text(KNIFE)
    path = tmp_path / "prism.yaml"
    path.write_text(PRISM)
    return path


# The file -----------------------------------------------------------------------------------------


def test_kachru_is_what_the_abstract_says():
    """Both slices with their numbers; the largest over the mean force is 1.34 and 1.78,
    where a round section has 4 / pi.
    """
    published = load_published(KACHRU)
    nendran, dwarf = published.cuts
    assert [(s.quantity, s.value) for s in nendran.given] == [(PEAK_FORCE, 28.2), (CUT_ENERGY, 724.46)]
    assert [(s.quantity, s.value) for s in dwarf.predicted] == [(PEAK_FORCE, 22.4), (CUT_ENERGY, 686.81)]
    assert nendran.area == pytest.approx(math.pi / 4 * 0.03708**2)
    assert (nendran.fullness, dwarf.fullness) == pytest.approx((1.337, 1.779), abs=1e-3)
    assert nendran.uniform_fullness == pytest.approx(4 / math.pi)
    assert (published.fit, published.limit) == (("R", "mu"), 0.2)
    assert published.vary == (
        "E",
        "yield_stress",
        "strength_ratio",
        "R_initiation",
        "initiation_depth",
        "board_friction",
    )
    assert published.food.value("skin_thickness") == 0


def test_other_roles():
    """What is fitted in place of something else leaves that to be drawn; together, all numbers are given."""
    published = load_published(KACHRU)
    other = published.fitting(("R", "R_initiation"))
    assert other.fit == ("R", "R_initiation")
    assert set(other.vary) == {"E", "yield_stress", "strength_ratio", "initiation_depth", "mu", "board_friction"}
    assert len(published.all_given().given) == 4
    assert not any(cut.predicted for cut in published.all_given().cuts)
    with pytest.raises(PublishedError, match="fit at most 2"):
        published.fitting(("R", "mu", "E"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("food: potato", "food: potatoe", "prism.yaml: food: unknown food 'potatoe', did you mean 'potato'"),
        ("fit: [R]", "fit: [Rr]", "unknown property 'Rr'"),
        ("fit: [R]", "fit: R", "fit: must be a list"),
        ("fit: [R]", "fit: [R, E]", "leave it out of one"),
        ("fit: [R]", "fit: [R, mu]", "1 given numbers do not determine R, mu"),
        ("knife: thin.yaml", "knife: kichen", "knife: unknown knife 'kichen', did you mean 'kitchen'"),
        ("shape: block", "shape: brick", "specimens.one.shape: unknown value 'brick'"),
        ("width_m: 0.024", "width: 0.024", "specimens.one.width: unknown key, did you mean 'width_m'"),
        ("height_m: 0.024", "height_m: 24", "specimens.one.height_m: is 24 m, but must lie between"),
        ("{peak_N: ", "{force: ", "specimens.one.given.force: unknown key, did you mean 'peak_N'"),
        ("value: 9.6,", "value: -1,", "peak_N.value: is -1; largest force [N] of a cut is positive"),
        ("value: 9.6, relative_sd: 0.02", "value: 9.6", "peak_N: misses relative_sd"),
        ("value: 9.6, relative_sd: 0.02", "value: 9.6, relative_sd: 5", "relative_sd: is 5, but must lie above 0"),
        ("predicted:", "given:", "line"),
        ("{energy_J_m2: ", "{peak_N: ", "specimens.one: peak_N is given and predicted"),
        ("    given:", "    predicted:", "twice"),
        ("unit: J/m^2", "unit: kJ/m^2", "properties.R: has unit 'kJ/m^2'; write it in 'J/m^2'"),
        ("source: closed form\n", "", "misses source"),
        ("fit: [R]", "fit: [R]\nlimit: 20", "limit: is 20, but must lie above 0"),
    ],
)
def test_errors_name_the_place(prism, old, new, said):
    """Each slip is one message that begins with the file and says where and what."""
    assert old in PRISM
    prism.write_text(PRISM.replace(old, new, 1))
    with pytest.raises(PublishedError) as error:
        load_published(prism)
    assert str(error.value).startswith("prism.yaml: ")
    assert said in str(error.value)


def test_nothing_given_is_refused(prism):
    """Numbers that are all predicted have nothing to be predicted from."""
    prism.write_text(
        PRISM.replace("    given: {", "    predicted: {", 1).replace("    predicted: {energy", "    # {energy")
    )
    with pytest.raises(PublishedError, match="no number is given"):
        load_published(prism)


# Least squares ------------------------------------------------------------------------------------


def problem(target, low=0.1, high=1000.0):
    """Two parameters on log scales with wide priors, and a target known to 1 %."""
    items = tuple(Parameter(name, 10.0, low, high, "-", 0.1, 1000.0) for name in ("a", "b"))
    return LeastSquaresProblem(ParameterSet(items), np.log(target), np.full(len(target), 0.01))


def run(one, model, start=(2.0, 2.0), **options):
    """A descent of a model of one point at a time."""
    return solve_together([gauss_newton(one, np.array(start), **options)], lambda asked: [model(z) for _, z in asked])[
        0
    ]


def test_power_laws_are_solved_in_few_evaluations():
    """Products of powers are linear in logarithms: a Jacobian and one or two steps, and the target is met."""
    end = run(problem([50.0, 8.0]), lambda z: np.array([z[0] + z[1], z[0] - 0.5 * z[1]]))
    assert end.converged and end.evaluations <= 8
    assert np.exp(end.y) == pytest.approx([50.0, 8.0], rel=2e-3)


def test_kinks_and_breakdowns_are_passed():
    """A largest of two forces, a region without values, and a jacobian of another place still end at the target."""

    def model(z):
        return None if z[0] > 4.2 else np.array([max(z[0], z[1] + 1.0), 0.3 * z[1] + 0.7 * z[0]])

    end = run(problem(np.exp([4.0, 3.1])), model, jacobian=np.eye(2))
    assert end.y == pytest.approx([4.0, 3.1], abs=0.01)


def test_bounds_are_never_passed():
    """A target beyond the bounds ends at them."""
    seen = []

    def model(z):
        seen.append(z)
        return np.array([z[0], z[1]])

    end = run(problem([5000.0, 5.0]), model)
    assert np.exp(np.array(seen)).max() <= 1000.0 * (1 + 1e-9)
    assert np.exp(end.z) == pytest.approx([1000.0, 5.0], rel=0.01)


def test_descents_side_by_side_are_those_alone():
    """Batches do not mix the values of descents; one whose start breaks down ends without values, the others go on."""
    models = [lambda z: np.array([z[0], z[1]]), lambda z: None, lambda z: np.array([z[0] + z[1], z[1]])]
    problems = [problem([3.0, 4.0]), problem([1.0, 1.0]), problem([30.0, 4.0])]
    descents = [gauss_newton(one, np.full(2, 2.0)) for one in problems]
    ends = solve_together(descents, lambda asked: [models[k](z) for k, z in asked])
    assert ends[1].y is None and not ends[1].converged
    for k in (0, 2):
        assert ends[k].z == pytest.approx(run(problems[k], models[k]).z)


# The study on closed forms ------------------------------------------------------------------------


class Closed:
    """Evaluator: a force R w (1 + mu) from start to end, with a start of R_initiation w that takes no work."""

    def __init__(self, cut, grid=1.0):
        self.cut, self.grid, self.seen = cut, grid, []

    def evaluate(self, batch):
        for k, values in enumerate(batch):
            self.seen.append(values)
            level = self.grid * values.get("R", 300.0) * (1 + values.get("mu", 0.0))
            peak = max(level, values.get("R_initiation", 100.0)) * self.cut.shape.width
            scalars = {"peak_N": peak, "work_J": level * self.cut.area}
            yield Evaluation(k, dict(values), "ok", "", 1.0, np.empty(0), np.empty(0), scalars)


def simulator(published, grid=1.0):
    """Closed forms whose coarse grid is off by a factor."""
    both = (("fine", 1.0), ("coarse", grid))
    evaluators = {f: {c.name: Closed(c, g) for c in published.cuts} for f, g in both}
    return CutSimulator(published, evaluators, lambda text: None)


def fitted(published, grid=1.0, draws=0):
    """The fit on closed forms."""
    where = simulator(published, grid)
    best = fit_given_numbers(where)
    values = published.fitted.to_dict(best.z)
    found = {c.name: where.simulate(c, [values], "fine")[0] for c in published.cuts}
    return fitted_numbers(published, best, found, randomised_fits(where, best, draws, 0))


def starting(published, high):
    """The same with a cut that may start at a force of up to ``high`` [N/m], its prior around less than R."""
    food = published.food
    start = replace(food.properties["R_initiation"], value=200.0, low=50.0, high=high)
    return replace(published, food=replace(food, properties=dict(food.properties) | {"R_initiation": start}))


@pytest.mark.parametrize("grid", [1.0, 0.8])
def test_correction_takes_the_coarse_grid_out(prism, grid):
    """R comes from the default grid whatever factor the coarse one is off by; its energy is then R."""
    result = fitted(load_published(prism), grid)
    assert result.parameters["R"].value == pytest.approx(R, rel=2e-3)
    energy = result.numbers[1]
    assert (energy.role, energy.quantity) == ("predicted", CUT_ENERGY)
    assert energy.simulated == pytest.approx(R, rel=2e-3)
    assert result.passed and result.fullness[0].simulated == pytest.approx(1.0)


def test_numbers_that_contradict_each_other_are_told(prism):
    """A peak of R w and an energy of 0.7 R cannot both be: both given, no R meets them;
    the same numbers alone, each has its R.
    """
    published = load_published(prism)
    (cut,) = published.cuts
    lower = replace(cut.predicted[0], value=0.7 * R)
    wrong = replace(published, cuts=(replace(cut, predicted=(lower,)),))
    alone, both = fitted(wrong), fitted(wrong.all_given())
    assert alone.consistent and not alone.predicted and not alone.passed
    assert alone.numbers[1].error == pytest.approx(1 / 0.7 - 1, rel=0.02)
    assert not both.consistent and not both.passed
    assert both.parameters["R"].value == pytest.approx(R * math.sqrt(0.7), rel=0.02)
    blamed = fitted(replace(starting(wrong, high=1600.0).all_given(), fit=("R", "R_initiation"), vary=()))
    assert blamed.consistent, "a start of 1.4 R explains it, and is found from a first minimum without one"


def test_band_is_of_what_is_drawn_and_of_the_given_numbers(prism):
    """Without an effect of what is drawn the band of the energy is that of the given peak;
    draws that cannot meet it are out.
    """
    published = load_published(prism)
    energy = fitted(published, draws=64).numbers[1]
    half = (energy.high95 - energy.low95) / 2 / R
    assert half == pytest.approx(1.96 * 0.02, rel=0.25) and energy.inside
    started = starting(published, high=1600.0)
    result = fitted(replace(started, vary=("R_initiation",)), draws=64)
    draws, row = result.draws, result.parameters["R_initiation"]
    assert draws.met + draws.unmet == 64 and 20 <= draws.unmet <= 44
    assert row.high95 == pytest.approx(R, rel=0.1)


def test_band_keeps_open_what_the_numbers_leave_open(prism):
    """Peak and energy are both R (1 + mu): its band is that of the numbers, and mu keeps the width of its prior."""
    published = load_published(prism).all_given()
    food = published.food
    mu = replace(food.properties["mu"], value=0.3, low=0.1, high=0.5)
    wide = replace(
        published, food=replace(food, properties=dict(food.properties) | {"mu": mu}), fit=("R", "mu"), vary=()
    )
    where = simulator(wide)
    best = fit_given_numbers(where)
    drawn = randomised_fits(where, best, 64, 0)
    values = np.array([[v["R"] * (1 + v["mu"]), v["mu"]] for v in drawn.values])
    assert len(values) > 60
    assert values[:, 0].std() / values[:, 0].mean() == pytest.approx(0.02 / math.sqrt(2), rel=0.3)
    assert values[:, 1].std() == pytest.approx(0.4 / (2 * 1.96), rel=0.2)


# The command --------------------------------------------------------------------------------------


def known(journal):
    """Runs in the journal of a store."""
    return journal.read_bytes().count(b'"key"') if journal.exists() else 0


@pytest.mark.long
def test_solver_recovers_R_of_a_prism_after_a_kill(prism, tmp_path, capsys):
    """A thin frictionless blade through a block: peak = R w gives R, and energy = R;
    killed, resumed, nothing run twice.
    """
    out = tmp_path / "out"
    words = ["scalars", str(prism), "--draws", "1", "--workers", "1", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-m", "cutcal.main", *words],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    journal, deadline = out / "evaluations.h5.journal", time.monotonic() + PATIENCE_S
    while known(journal) < 2 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None, "the study ended before it could be killed"
    process.kill()
    process.wait()
    assert known(journal) >= 2
    assert main(words) == 1
    assert "--resume" in capsys.readouterr().err
    assert main([*words, "--resume"]) == 0
    result = valid(json.loads((out / "scalars.json").read_text()))
    assert result["parameters"]["R"]["value"] == pytest.approx(R, rel=0.03)
    assert result["numbers"][1]["error"] == pytest.approx(0.0, abs=0.06)  # the last cell above the board takes less
    assert result["draws"]["met"] == 1
    printed = capsys.readouterr().out
    assert "one" in printed and "ok   predicted numbers within 20%" in printed
    stored = (out / "evaluations.h5").read_bytes()
    assert main([*words, "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == result
    assert (out / "evaluations.h5").read_bytes() == stored


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--draws", "-1"], "--draws"), (["--workers", "0"], "--workers"), (["--fit", "R,mue"], "'mue'"),
     (["--fit", "R,mu,E"], "fit at most 2"), (["--knife", "kichen"], "kitchen")],
)  # fmt: skip
def test_bad_options_are_one_clear_error(words, said, tmp_path, capsys):
    """Impossible numbers and unknown names are refused before anything is written."""
    assert main(["scalars", str(KACHRU), *words, "--out", str(tmp_path / "out")]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
