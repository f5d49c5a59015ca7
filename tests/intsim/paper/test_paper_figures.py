"""The figures of the paper beside ours: their tasks, whose rates are counted where, and what is printed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.errors import OutputError
from calib.io.schema import schema
from calib.io.typed_document import to_document
from calib.material.food import load_food
from cutcal.commands.dataset import evaluate as command
from cutcal.main import main
from intsim.evaluate import PolicyEvaluation, evaluate
from intsim.outcomes import SuccessRate
from intsim.paper.designs import (
    RATIOS,
    SPLITS,
    figure_evaluations,
    figure_foods,
    figure_tasks,
    held_out,
    transfers_of,
)
from intsim.paper.printing import NOT_PRINTED, text
from intsim.paper.published import GEOMETRY, PUBLISHED, WITH_FOOD, training_row
from intsim.paper.runs import MET, MET_AND_SEVERED, PaperRun, rates, read_runs
from intsim.paper.tables import IN_PLACE, RESISTING, WITHOUT_RESISTANCE, PaperComparison, compare
from intsim.policy.oracles import Oracle, make_policy
from intsim.sim.severing import SeveringOutcome
from intsim.sim.world import World
from intsim.task.selection import TaskFilter, TrainingTasks
from intsim.task.suites import FIRST_TEST_SEED, FOODS
from intsim.task.targets import TaskError
from mpm.scene.errors import CutcalError
from tests.calib.documents import valid

N = 2
FIGURES = tuple(PUBLISHED)
TWO = ["banana", "cherry"]
UNTAUGHT = TrainingTasks(None, None, None, (), None)


class FirstCutOnly(Oracle):
    """Makes the first cut of a split and no other."""

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """Nothing more to do when the first plan is done."""
        return None if self._cuts and not self._todo else super().act(obs, instruction)


Parts = list[tuple[str, PolicyEvaluation]]


def evaluations(figure: str, policy: Any = None, name: str = "oracle", **more: Any) -> Parts:
    """The evaluations of a figure on the plain table."""
    trained = more.get("trained")
    asked, needed = figure_foods(figure, more.pop("foods", None), trained)
    foods = {food: load_food(food) for food in needed}
    base = PolicyEvaluation(policy or make_policy(name), name, foods, (), more.pop("episodes", N), **more)
    return figure_evaluations(figure, base, asked)


def found(figure: str, out: Path, *args: Any, **more: Any) -> PaperComparison:
    """A figure whose episodes are run; the cuts of Table 4 are not simulated."""
    for part, evaluation in evaluations(figure, *args, **more):
        evaluate(replace(evaluation, severing=False), out / part)
    return compare(figure, read_runs([out]))


def test_the_command_and_the_schemas_know_all_figures():
    """Names of the option, of the document and of the settings are those that have a design."""
    assert set(command.FIGURES) == set(FIGURES)
    for name, key in (("paper", "figure"), ("evaluate", "paper")):
        assert schema(name)["properties"][key]["enum"] == list(FIGURES)


@pytest.mark.parametrize("figure", FIGURES)
def test_each_task_is_asked_for_as_often_and_of_new_places(figure):
    """Food, part, side and pieces are those of the task in every episode; no seed comes twice in a suite; places and
    sizes differ from episode to episode."""
    tasks = figure_tasks(figure, TWO, None)
    for _, evaluation in evaluations(figure, foods=TWO):
        assert evaluation.paper == figure and list(evaluation.tasks) == tasks
        assert len(evaluation.tests) == len(set(evaluation.tests)) == N * len(tasks)
        assert min(seed for _, seed in evaluation.tests) == FIRST_TEST_SEED
        made = [evaluation.episode(suite, seed) for suite, seed in evaluation.tests]
        for k, episode in enumerate(made):
            suite, task = tasks[k % len(tasks)]
            assert (episode.suite, episode.item.name, episode.spec.item) == (suite, task.food, task.food)
            assert episode.spec.pieces == task.pieces
            assert task.ratio in (None, episode.spec.ratio) and task.side in (None, episode.spec.side)
        assert len({(e.item.x, e.item.y, e.item.shape.length) for e in made}) == len(made)


def test_the_tasks_are_those_of_the_paper():
    """Fifteen foods alone and beside others; nine parts and three splits of a banana and a cucumber; an orange; two
    worlds for Table 4 with a robot, the other figures one evaluation."""
    usual = {figure: figure_foods(figure, None, None)[0] for figure in FIGURES}
    assert usual["fig4"] == usual["fig5"] == usual["fig6"] == list(FOODS)
    assert usual["fig7"] == usual["table3"] == ["banana", "cucumber"] and usual["table4"] == ["orange"]
    sizes = {figure: len(figure_tasks(figure, usual[figure], None)) for figure in FIGURES}
    assert sizes == {"fig4": 15, "fig5": 30, "fig6": 30, "fig7": 18, "table3": 6, "table4": 1, "fig8": 4}
    parts = evaluations("table4", world=World())
    assert [(part, e.world.coupled) for part, e in parts if e.world] == [("kinematic", False), ("intsim", True)]
    assert [(part, e.severing) for part, e in evaluations("table4")] == [("", True)]
    with pytest.raises(TaskError, match="with and without the food"):
        evaluations("table4", world=World(coupled=False))


@pytest.mark.parametrize("figure", [name for name in FIGURES if name != "table4"])
def test_the_oracle_succeeds_and_the_stuck_policy_fails_in_every_row(tmp_path, figure):
    """Every printed number has a row of ours beside it, with as many trials as were asked for; a knife that does not
    move succeeds nowhere."""
    oracle = found(figure, tmp_path / "oracle", foods=TWO if figure != "table3" else None)
    (table,) = oracle.tables
    assert set(PUBLISHED[figure].rates) <= {row.label for row in table.rows}
    for row in table.rows:
        assert row.ours and all(rate.successes == rate.trials >= N for rate in row.ours.values())
        assert row.paper == PUBLISHED[figure].rates.get(row.label) or row.label not in PUBLISHED[figure].rates
    stuck = found(figure, tmp_path / "stuck", name="stuck", foods=TWO)
    assert [rate.successes for row in stuck.tables[0].rows for rate in row.ours.values() if rate.successes] == []
    valid(to_document(oracle))


def test_who_takes_left_for_right_parts_halves_alone(tmp_path):
    """Fig. 8: only the cut in the middle is where it was asked for."""
    (table,) = found("fig8", tmp_path, name="wrong-side").tables
    right = {row.label for row in table.rows if row.ours[MET].successes}
    assert right == {"trained on 0.5 in the middle, tested on 0.5 in the middle"}


def test_a_policy_that_stops_after_the_first_cut_misses_the_others(tmp_path):
    """Table 3 counts a cut that was not made as missed."""
    (table,) = found("table3", tmp_path, FirstCutOnly(), "first cut").tables
    assert len(table.rows) == 2 * sum(pieces - 1 for pieces in SPLITS)
    for row in table.rows:
        assert row.ours[IN_PLACE] == SuccessRate(N if row.label.endswith("cut 1") else 0, N)


def test_each_ratio_is_counted_by_itself(tmp_path):
    """Fig. 7: a policy that cuts everything in half succeeds where about half is asked for: the place may be off by a
    tenth of the food."""

    class Halver(Oracle):
        def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
            """The middle of the food, whatever part was asked for."""
            food = "banana" if "banana" in instruction else "cucumber"
            return super().act(obs, f"cut 1/2 of the {food} in the middle")

    (table,) = found("fig7", tmp_path, Halver(), "halver").tables
    met = {row.label: row.ours["banana"].successes for row in table.rows}
    assert {label for label, count in met.items() if count == N} >= {"0.5"}
    assert all(met[label] == 0 for label in ("0.1", "0.2", "0.3", "0.7", "0.8", "0.9"))
    assert [row.label for row in table.rows] == [*(f"{ratio:g}" for ratio in RATIOS), "all"]
    assert all(row.paper is None for row in table.rows) and text(compare("fig7", read_runs([tmp_path]))).count(
        NOT_PRINTED
    ) == len(table.rows)


def test_an_episode_counts_once_however_often_it_is_named(tmp_path):
    """Fig. 5 begins with the episodes of Fig. 4: both folders together have no more of them, and the folder above
    stands for both."""
    one = found("fig4", tmp_path / "a" / "fig4", foods=TWO)
    two = found("fig5", tmp_path / "a" / "fig5", foods=TWO)
    both = compare("fig5", read_runs([tmp_path / "a" / "fig4", tmp_path / "a" / "fig5", tmp_path / "a"]))
    assert both.tables[0].rows == two.tables[0].rows
    assert one.tables[0].rows[-1].ours == two.tables[0].rows[0].ours
    assert compare("fig4", read_runs([tmp_path / "a"])).tables[0].rows == one.tables[0].rows


def test_two_policies_are_two_tables(tmp_path):
    """Rates of one policy are not mixed with another's."""
    for name in ("oracle", "stuck"):
        found("fig5", tmp_path / name, name=name, foods=TWO)
    tables = compare("fig5", read_runs([tmp_path])).tables
    assert [(t.policy, t.rows[0].ours[MET].successes) for t in tables] == [("oracle", 2 * N), ("stuck", 0)]


def test_what_cannot_be_read_is_said(tmp_path):
    """No folder, no evaluation in it, one that was stopped, and one of another figure."""
    with pytest.raises(OutputError, match="no such folder"):
        read_runs([tmp_path / "none"])
    with pytest.raises(OutputError, match="no evaluation"):
        read_runs([tmp_path])
    ((_, evaluation),) = evaluations("fig7", episodes=1)
    evaluate(evaluation, tmp_path / "e")
    with pytest.raises(CutcalError, match="none of the evaluations has an episode"):
        compare("fig4", read_runs([tmp_path / "e"]))
    (tmp_path / "e" / "evaluate.json").unlink()
    with pytest.raises(OutputError, match="not finished; add --resume"):
        read_runs([tmp_path / "e"])


def simulated(run: PaperRun, outcomes: list[bool | None]) -> PaperRun:
    """A run whose cuts had these outcomes in the solver."""
    rows = [replace(row, severing=SeveringOutcome(one)) for row, one in zip(run.rows, outcomes, strict=True)]
    return PaperRun(replace(run.settings, severing=True), rows)


@pytest.mark.parametrize(("demos", "home"), [("kinematic", "ManiSkill"), ("sustained", "IntSim")])
def test_table_4_stands_beside_the_training_that_is_like_it(tmp_path, demos, home):
    """Motions that geometry plans beside the paper's of ManiSkill, those that part the food beside IntSim's; a cut that
    broke down is no success and stays in the denominator."""
    found("table4", tmp_path, name="oracle", episodes=4, trained=replace(UNTAUGHT, demos=demos))
    (run,) = read_runs([tmp_path])
    (table,) = compare("table4", [simulated(run, [True, True, False, None])]).tables
    rows = {row.label: row for row in table.rows}
    assert rows[WITHOUT_RESISTANCE].ours == {MET: SuccessRate(4, 4)}
    assert rows[RESISTING].ours == {MET_AND_SEVERED: SuccessRate(2, 4)}
    for label, judged in ((WITHOUT_RESISTANCE, GEOMETRY), (RESISTING, WITH_FOOD)):
        printed = PUBLISHED["table4"].rates[training_row(home, judged)]["RDT"]
        assert rows[label].paper == {f"RDT trained in {home}": printed}


def test_rates_of_rows_without_a_solver_have_no_column_of_pieces(tmp_path):
    """Nothing is said of severing where nothing was simulated, and nothing at all without episodes."""
    found("table4", tmp_path, episodes=1)
    (run,) = read_runs([tmp_path])
    assert rates(run.rows) == {MET: SuccessRate(1, 1)} and rates([]) == {}


def test_a_food_that_training_left_out_is_the_unseen_one(tmp_path):
    """Fig. 6 asks a policy that has not seen a cherry for cherries in new words, and for the others in known ones; one
    that has seen everything has nothing to show."""
    trained = replace(UNTAUGHT, without=("cherry",))
    ((_, evaluation),) = evaluations("fig6", foods=["banana", "kiwi"], trained=trained)
    assert [(suite, task.food) for suite, task in evaluation.tasks] == [
        ("seeds", "banana"), ("seeds", "kiwi"), ("language", "cherry"),
    ]  # fmt: skip
    evaluate(evaluation, tmp_path)
    (table,) = compare("fig6", read_runs([tmp_path])).tables
    assert [row.ours[MET].trials for row in table.rows] == [2 * N, N]
    assert held_out(["banana", "kiwi"], replace(UNTAUGHT, foods=("kiwi",))) == (["kiwi"], ["banana"])
    assert held_out(TWO, None) == (TWO, TWO)
    with pytest.raises(TaskError, match="left no food out"):
        held_out(["kiwi"], replace(UNTAUGHT, foods=("kiwi",)))
    with pytest.raises(TaskError, match="has learnt from none of cherry"):
        held_out(["cherry"], trained)


def test_a_policy_of_one_cut_is_tested_on_it_and_its_counterpart(tmp_path):
    """Fig. 8: a quarter from the right against one from the left, and no other row of the figure."""
    trained = replace(UNTAUGHT, ratio=0.25, side="right")
    (table,) = found("fig8", tmp_path, trained=trained).tables
    assert [row.label for row in table.rows if row.ours] == [
        "trained on 0.25 from the right, tested on 0.25 from the right",
        "trained on 0.25 from the right, tested on 0.25 from the left",
    ]
    assert len(transfers_of(replace(UNTAUGHT, ratio=0.5))) == 1 and len(transfers_of(UNTAUGHT)) == 3
    with pytest.raises(TaskError, match="learnt from 0.25, left; Fig. 8 has --ratio 0.25 --side right"):
        transfers_of(replace(trained, side="left"))


def entry(ratio: float = 0.25, side: str = "right", pieces: int = 0, foods: Any = ("banana",)) -> dict[str, Any]:
    """What a shard's JSON file says of a trajectory."""
    return {"task": {"ratio": ratio, "side": side, "pieces": pieces}, "items": [{"name": name} for name in foods]}


def test_a_filter_keeps_what_it_says():
    """Part and side as they were said; equal pieces have neither; a food left out may not lie beside either."""
    quarter = TaskFilter(0.25, "right", ("kiwi",))
    assert quarter.keeps(entry()) and quarter.words() == "ratio 0.25, side right, without kiwi"
    wrong = (entry(0.75), entry(side="left"), entry(pieces=3), entry(foods=("kiwi",)), entry(foods=("banana", "kiwi")))
    assert [quarter.keeps(one) for one in wrong] == [False] * len(wrong)
    assert TaskFilter().keeps(entry(pieces=3)) and TaskFilter().words() == ""
    for bad, says in (
        ((1.5,), "--ratio 1.5"),
        ((None, "up"), "--side up"),
        ((None, None, ("brick",)), "--without brick"),
    ):
        with pytest.raises(TaskError, match=says):
            TaskFilter(*bad)


def test_the_command_line(tmp_path, capsys):
    """A table with intervals, printed numbers and what differs; the same from its folder; JSON; errors in a line."""
    out = tmp_path / "t"
    argv = ["evaluate", "--paper", "table3", "--episodes", "2"]
    assert main([*argv, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    for part in ("2 of 2 (34 to 100 %)", "RDT 30 %", "What differs", "Table 3 (RDT)", f"wrote {out}"):
        assert part in shown
    assert main([*argv[:3], "--from", str(out)]) == 0
    assert capsys.readouterr().out.strip() == shown.partition("  wrote")[0].strip()
    assert main([*argv[:3], "--from", str(out), "--json"]) == 0
    assert len(valid(json.loads(capsys.readouterr().out))["tables"][0]["rows"]) == 18
    assert main([*argv, "--out", str(out), "--resume"]) == 0
    assert capsys.readouterr().out == shown
    for words, says in (
        (["--paper", "fig4", "--suite", "seeds"], "tasks of its own"),
        (["--paper", "fig9"], "there is no 'fig9'"),
        (["--from", str(out)], "--paper fig4"),
        (["--paper", "fig8", "--ratio", "0.25"], "what a server's policy was trained on"),
        (["--paper", "fig4", "--policy", "clone", "--weights", "x.npz"], "not a trained clone"),
        (["--policy", "clone", "--weights", "x.npz", "--weights", "y.npz"], "one file"),
        (["--paper", "table4", "--world", "kinematic"], "with and without"),
        (["--paper", "fig4", "--out", str(out), "--resume"], "something else"),
    ):
        assert main(["evaluate", *words]) != 0
        assert says in capsys.readouterr().err
    assert main(["dataset", "generate", "--ratio", "0.25", "--out", str(tmp_path / "d")]) == 1
    assert "among trajectories that are there" in capsys.readouterr().err
