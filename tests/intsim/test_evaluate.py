"""The evaluation, with policies whose success is known in advance."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.errors import OutputError
from calib.io.typed_document import read_document
from calib.material.food import load_food
from calib.material.food_file import dump_material
from cutcal.main import main
from intsim.evaluate import RESULT_FILE, PolicyEvaluation, evaluate, roll_out, run_episode
from intsim.outcomes import EvaluationResult, SuiteResult, expected_place_rate
from intsim.policy.oracles import POLICIES, SHALLOW_HEIGHT, make_policy
from intsim.sim.severing import PANDA_ARM, SeveringOutcome, commanded_scene, simulate_severing
from intsim.sim.world import World
from intsim.task.kinematic_table import KinematicTable
from intsim.task.rollout import Rollout
from intsim.task.success import TIP_HEIGHT, judge_geometry, wilson
from intsim.task.suites import FIRST_TEST_SEED, FOODS, SUITES, Episode, sample_episode
from intsim.task.targets import CutSpec, Item, TaskError, target
from mpm.scene import Arm
from mpm.scene.errors import CutcalError
from mpm.scene.shapes import Shape
from tests.calib.documents import valid

ALL = {name: load_food(name) for name in FOODS}
BERRY = Item("strawberry", Shape("ellipsoid", 0.04, 0.032, 0.032))
HALF = Episode("seeds", 0, CutSpec("strawberry"), BERRY, (), "cut half of the strawberry in the middle")
FEW = 30


def document(evaluation: PolicyEvaluation, out: Path) -> dict[str, Any]:
    """What an evaluation writes; it is read back as what it returns."""
    result = evaluate(evaluation, out)
    assert read_document(out / RESULT_FILE, EvaluationResult) == result
    return valid(json.loads((out / RESULT_FILE).read_text()))


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> dict[str, dict]:
    """What the evaluation says of each policy."""
    out = tmp_path_factory.mktemp("evaluate")
    names = ("oracle", "wrong-side", "wrong-item", "shallow", "random", "stuck", "hover")
    return {
        name: document(PolicyEvaluation(make_policy(name), name, ALL, list(SUITES), FEW), out / name) for name in names
    }


def test_the_oracle_succeeds_everywhere(found):
    """Each criterion in each suite, with no command clipped."""
    for suite in found["oracle"]["suites"].values():
        assert suite["published"]["successes"] == suite["strict"]["successes"] == FEW
        assert suite["clipped_steps"] == 0


def test_nothing_succeeds_without_contact(found):
    """A knife that stays where it is, and one that turns back a millimetre above the food in the right place, succeed
    in no suite by any reading; the second is within the published 50 mm of the table over small foods.
    """
    for name in ("stuck", "hover"):
        for suite in found[name]["suites"].values():
            assert suite["published"]["successes"] == suite["strict"]["successes"] == 0
    seeds = found["hover"]["suites"]["seeds"]["criteria"]
    assert seeds["tip"]["successes"] > 0 and seeds["angle"]["successes"] == seeds["place"]["successes"] == FEW


def test_a_broken_simulation_stays_in_every_denominator():
    """Of three cuts one is in pieces, one holds, and one broke down: one of three, and one that was not simulated."""
    row = run_episode(PolicyEvaluation(make_policy("oracle"), "oracle", ALL, ["seeds"], 1), HALF)
    rows = [replace(row, severing=SeveringOutcome(severed)) for severed in (True, False, None)]
    suite = SuiteResult.of(rows, None)
    assert (suite.severing.successes, suite.severing.trials) == (1, 3)
    assert (suite.published_and_severed.successes, suite.published_and_severed.trials) == (1, 3)
    assert suite.not_simulated == 1 and suite.published.trials == 3


def test_each_wrong_oracle_fails_in_its_own_way(found):
    """The wrong side fails the place alone, the other food the region, a knife that stops short nothing that was
    published."""
    for name, suite in found["wrong-side"]["suites"].items():
        failed = {key for key, c in suite["criteria"].items() if c["successes"] < FEW}
        assert failed == (set() if name == "split" else {"place"})
    assert found["wrong-side"]["suites"]["flips"]["published"]["successes"] == 0
    objects = found["wrong-item"]["suites"]["objects"]
    assert objects["criteria"]["tip"]["successes"] == FEW and objects["criteria"]["region"]["successes"] == 0
    for name, suite in found["shallow"]["suites"].items():
        if name != "split":
            assert suite["published"]["successes"] == FEW and suite["strict"]["successes"] == 0
    assert all(suite["strict"]["rate"] < 0.1 for suite in found["random"]["suites"].values())


def test_noise_succeeds_as_often_as_its_closed_form_says(tmp_path):
    """erf(0.1 L / (sigma sqrt 2)) of the place, averaged over foods of all lengths, within three standard deviations of
    600 trials."""
    noisy = PolicyEvaluation(make_policy("noisy", 0.01), "noisy", ALL, ["seeds", "language"], 300, sigma=0.01)
    for suite in document(noisy, tmp_path / "e")["suites"].values():
        p = suite["expected_place"]
        assert 0.3 < p < 0.7
        assert suite["criteria"]["place"]["rate"] == pytest.approx(p, abs=3 * math.sqrt(p * (1 - p) / 300))
    assert expected_place_rate(0.1, 0.01) == pytest.approx(0.6827, abs=1e-4)


@pytest.mark.parametrize(
    ("pose", "failed"),
    [
        ((0.0, 0.0, 0.001, 0.0, 0.0), set()),
        ((0.0, 0.0, 0.032 - 1e-6, 0.0, 0.0), {"strict_tip"}),
        ((0.0, 0.0, 0.032 + 1e-6, 0.0, 0.0), {"region", "strict_tip"}),
        ((0.0, 0.0, TIP_HEIGHT - 1e-6, 0.0, 0.0), {"region", "strict_tip"}),
        ((0.0, 0.0, TIP_HEIGHT + 1e-6, 0.0, 0.0), {"tip", "region", "strict_tip"}),
        ((0.0, 0.0, 0.0, math.radians(9.9), 0.0), set()),
        ((0.0, 0.0, 0.0, math.radians(10.1), 0.0), {"angle"}),
        ((0.0, 0.0039, 0.0, 0.0, 0.0), set()),
        ((0.0, 0.0041, 0.0, 0.0, 0.0), {"place"}),
        ((0.0, 0.021, 0.0, 0.0, 0.0), {"region", "angle", "place"}),
        ((0.1, 0.0, 0.0, 0.0, 0.0), {"region", "angle", "place"}),
    ],
)
def test_criteria_turn_at_their_thresholds(pose, failed):
    """A strawberry 40 mm long, its axis along y, cut in half: a pose on either side of each threshold."""
    judged = judge_geometry(HALF.spec, BERRY, Rollout(pose=[np.array(pose)]), BERRY)
    assert {name for name, ok in judged.criteria.items() if not ok} == failed


def test_a_knife_that_stops_short_meets_the_published_criteria_and_severs_nothing():
    """7 mm above the board is within the published 50 mm; the solver finds the food in one piece, and in two under the
    full cut."""
    rows = {
        name: run_episode(
            PolicyEvaluation(make_policy(name), name, ALL, ["seeds"], 1, severing=True, knife="edc", arm=Arm()), HALF
        )
        for name in ("shallow", "oracle")
    }
    short, whole = rows["shallow"], rows["oracle"]
    assert short.severing is not None and whole.severing is not None
    assert short.published and not short.strict and short.severing.severed is False
    assert short.severing.uncut > 0.1 and short.height_m == pytest.approx(SHALLOW_HEIGHT, abs=1e-6)
    assert whole.strict and whole.severing.severed is True and whole.severing.uncut == 0.0


@pytest.mark.slow
def test_a_soft_arm_needs_overdrive():
    """An orange stops ManiSkill's arm above the board: an edge sent to the board leaves it whole, one sent 30 mm deeper
    parts it."""
    shape = ALL["orange"].to_scene_food().shape
    item = Item("orange", shape)
    episode = Episode("seeds", 0, CutSpec("orange"), item, (), "cut half of the orange in the middle")
    found = {}
    for name in ("oracle", "overdrive"):
        rollout, _ = roll_out(make_policy(name), episode)
        found[name], record = simulate_severing(item, 0.0, np.array(rollout.command), ALL["orange"])
        assert record is not None and record.momentum_residual < 1e-9
    assert found["oracle"].severed is False and found["overdrive"].severed is True
    force = found["oracle"].short * (PANDA_ARM.stiffness or 0.0)
    assert 0.2 * found["oracle"].peak < force < 1.2 * found["oracle"].peak


def test_what_the_solver_cannot_cut_counts_as_neither():
    """A slice of a millimetre would take cells too fine, and says so; one of 3 mm gets finer cells under the same edge;
    an edge that stays above the food has cut nothing."""
    down = np.array([[0.0, 0.0, z, 0.0, 0.0] for z in np.linspace(0.05, 0.0, 30)])
    thin, record = simulate_severing(BERRY, 0.019, down, ALL["strawberry"])
    assert thin.severed is None and "slice of 1 mm" in thin.why and record is None
    usual, finer = (commanded_scene(BERRY, along, down, ALL["strawberry"]) for along in (0.0, 0.017))
    assert usual is not None and finer is not None
    assert finer.numerics.dx == pytest.approx(1.5e-3) and usual.numerics.dx > 2 * finer.numerics.dx
    assert (finer.edge, finer.motion) == (usual.edge, usual.motion)
    above, record = simulate_severing(
        BERRY, 0.0, np.array([[0, 0, z, 0, 0] for z in np.linspace(0.2, 0.05, 30)]), ALL["strawberry"]
    )
    assert above.severed is False and "does not reach" in above.why and record is None


def test_an_evaluation_that_was_stopped_goes_on(tmp_path, monkeypatch):
    """What was done is not done again, a line that was cut off is, and another evaluation is not mixed in."""
    six = PolicyEvaluation(make_policy("oracle"), "oracle", ALL, ["seeds"], 6)
    whole = evaluate(six, tmp_path / "whole")
    out = tmp_path / "stopped"
    evaluate(replace(six, episodes=3), out)
    (out / "evaluate.json").unlink()
    with (out / "evaluate.jsonl").open("a") as file:
        file.write('{"suite": "se')
    done: list[int] = []
    monkeypatch.setattr(
        "intsim.evaluate.sample_episode",
        lambda suite, seed, foods: done.append(seed) or sample_episode(suite, seed, foods),
    )
    assert evaluate(six, out, resume=True).suites == whole.suites
    assert done == [FIRST_TEST_SEED + 3, FIRST_TEST_SEED + 4, FIRST_TEST_SEED + 5]
    with pytest.raises(OutputError, match="something else"):
        evaluate(replace(six, policy=make_policy("shallow"), name="shallow"), out, resume=True)


def test_an_evaluation_that_cannot_go_on_is_one_line(tmp_path):
    """A row that is damaged, and a world without processes to run it in."""
    two = PolicyEvaluation(make_policy("oracle"), "oracle", ALL, ["seeds"], 2)
    evaluate(two, tmp_path / "e")
    rows = (tmp_path / "e" / "evaluate.jsonl").read_text()
    (tmp_path / "e" / "evaluate.jsonl").write_text(rows.replace('"steps": ', '"stops": ', 1))
    with pytest.raises(OutputError, match=r"evaluate\.jsonl: damaged \(steps is missing\)"):
        evaluate(two, tmp_path / "e", resume=True)
    with pytest.raises(CutcalError, match="give a pool"):
        evaluate(replace(two, world=World()), tmp_path / "w")


def test_episodes_repeat_with_their_seed_and_differ_between_suites():
    """The same seed is the same episode; foods do not touch each other; every food is asked for."""
    assert sample_episode("objects", FIRST_TEST_SEED + 5, ALL) == sample_episode("objects", FIRST_TEST_SEED + 5, ALL)
    assert (
        sample_episode("seeds", FIRST_TEST_SEED + 5, ALL).item != sample_episode("flips", FIRST_TEST_SEED + 5, ALL).item
    )
    asked = set()
    for k in range(200):
        episode = sample_episode("objects", FIRST_TEST_SEED + k, ALL)
        asked.add(episode.item.name)
        assert 1 <= len(episode.others) <= 3 and episode.item.name not in {o.name for o in episode.others}
        target(episode.spec, episode.item)
        for a in (episode.item, *episode.others):
            for b in episode.others:
                if a is not b:
                    reach = [math.hypot(i.shape.length, i.shape.width) / 2 for i in (a, b)]
                    assert math.hypot(a.x - b.x, a.y - b.y) > sum(reach)
    assert asked == set(FOODS)
    assert len(sample_episode("objects", FIRST_TEST_SEED, {"banana": ALL["banana"]}).others) >= 1


def test_wilson_intervals():
    """Newcombe 1998 (Stat. Med. 17:857), table I: 81 of 263, 0 of 20, 1 of 29."""
    for k, n, low, high in ((81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)):
        assert wilson(k, n) == pytest.approx((low, high), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_command_line(tmp_path, capsys):
    """A table of rates, JSON on demand, and errors in a line."""
    argv = ["evaluate", "--suite", "flips", "--food", "banana", "--episodes", "3"]
    assert main([*argv, "--policy", "wrong-side", "--out", str(tmp_path / "a")]) == 0
    text = capsys.readouterr().out
    assert "0% (0% to 56%)" in text and "fails: place" in text
    assert main([*argv, "--json", "--out", str(tmp_path / "b")]) == 0
    assert valid(json.loads(capsys.readouterr().out))["suites"]["flips"]["published"]["rate"] == 1.0
    assert main([*argv, "--out", str(tmp_path / "b")]) == 1
    assert "never overwritten" in capsys.readouterr().err
    made = tmp_path / "material.yaml"
    dump_material(load_food("banana").with_values({"R": 500.0}), made, {})
    assert (
        main(["evaluate", "--suite", "flips", "--material", str(made), "--json", "--out", str(tmp_path / "own")]) == 0
    )
    own = valid(json.loads(capsys.readouterr().out))["foods"]
    assert list(own) == ["banana"] and own != json.loads((tmp_path / "b" / "evaluate.json").read_text())["foods"]
    for more, says in (
        (["--policy", "noisy"], "give both or neither"),
        (["--suite", "hard"], "none of seeds"),
        (["--policy", "x"], "none of oracle"),
    ):
        assert main([*argv, *more, "--out", str(tmp_path / "c")]) == 1
        assert says in capsys.readouterr().err
    assert main(["evaluate", "--policy", "list"]) == 0
    text = capsys.readouterr().out
    assert [name for name in (*POLICIES, *SUITES) if f" {name} " not in text] == []


def test_a_table_keeps_every_food_where_it_is():
    """Only the food under the edge is cut."""
    other = Item("apple", Shape("ellipsoid", 0.07, 0.07, 0.07), 0.0, 0.2)
    table = KinematicTable([BERRY, other])
    episode = Episode(
        "objects",
        0,
        CutSpec("strawberry", Fraction(1, 4), "left"),
        BERRY,
        (other,),
        "cut a quarter of the strawberry from the left",
    )
    _, table = roll_out(make_policy("oracle"), episode)
    assert len(table.items[0].pieces) == 2 and table.items[1] == other
    with pytest.raises(TaskError, match="none of oracle"):
        make_policy("genius")
