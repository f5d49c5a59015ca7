"""The study of right and wrong claims: what is claimed, what is counted, and that nothing is judged twice."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.io.folder import write_json
from calib.material.food import load_food
from calib.material.scene import Sizing, specimen
from calib.simulation.evaluation import Evaluation
from calib.trace.conditioning import condition
from calib.trace.trace import read_trace
from studies.discrimination.judged_pair import Judged, claimed
from studies.discrimination.made_up_cut import Truth, write_record
from studies.discrimination.pair import RIGHT, Cut, Pair, backwards
from studies.discrimination.pair_set import CORRECT, PAIRS, WIDER, WRONG
from studies.discrimination.study import passed, run, table, told, words
from tests.calib.multi_specimen.test_run import FakePool

BANANA = Cut("banana")
SHAPE = specimen(load_food("banana"), None, Sizing())[0]
STROKE = np.linspace(0.0, 0.033, 300)[1:]
FORCE = 12.0 * np.minimum(STROKE / 0.03, 1.0)
TRUTH = Truth(SHAPE, {"R": 350.0}, Evaluation(0, {}, "ok", "", 1.0, STROKE, FORCE))


def judged(name: str, kind: str, *failed: str) -> Judged:
    """What became of a pair."""
    values, ends = {"R": 1.0, "E": 3.0}, {"R": (0.5, 2.0), "E": (4.0, 5.0), "R_skin": (0.0, 9.0)}
    return Judged(name, kind, dict.fromkeys(failed, (1.0, 0.5)), "", values, {"R": 2.0}, ends, {"x": None}, 3.0)


def test_there_are_twenty_of_each() -> None:
    """Wrong pairs are wrong in something, right ones in nothing, and no two have one seed."""
    assert (len(WRONG), len(CORRECT)) == (20, 20)
    assert len({p.name for p in PAIRS}) == len({p.number for p in PAIRS}) == 40
    assert set(Counter(p.kind for p in WRONG)) == {
        "wrong food", "another food's trace", "wrong knife", "wrong width", "wrong height", "reversed trace",
        "wrong sign",
    }  # fmt: skip
    assert all(p.truth == p.claim and p.told and not p.own and not p.sizes for p in CORRECT)
    same = [p for p in WRONG if p.truth == p.claim]
    assert all(p.sizes or p.sign or p.change(np.arange(200.0))[-1] != 199.0 for p in same)


def test_a_record_is_that_of_the_cut(tmp_path: Path) -> None:
    """Peak and stroke of the made-up record are those of the simulation."""
    path = tmp_path / "a.csv"
    write_record(Pair("a", RIGHT, BANANA, BANANA), TRUTH, path)
    cut = condition(read_trace(path))
    assert cut.peak_N == pytest.approx(12.0, rel=0.1) and cut.stroke_length_m == pytest.approx(0.033, abs=1e-3)


def test_a_reversed_trace_has_its_baseline_and_ends_where_it_began() -> None:
    """A ramp after 150 silent samples falls from its end to nothing."""
    ramp = np.concatenate([np.zeros(150), np.linspace(0.0, 10.0, 201)])
    found = backwards(ramp)
    assert not found[:150].any() and found[161] == pytest.approx(10.0) and found[-1] == pytest.approx(0.55, abs=0.05)
    assert sorted(found) == sorted(ramp)


def test_a_claim_is_what_a_user_would_type(tmp_path: Path) -> None:
    """Sizes of the specimen, wrong by a factor, of another food, or none; knife and sign as they are claimed."""

    def sizing(pair: Pair) -> Sizing:
        return claimed(pair, TRUTH, tmp_path / "a.csv", 60, "cpu").sizing

    plain = Pair("a", RIGHT, BANANA, Cut("banana", "edc"), sign="-")
    assert sizing(plain) == Sizing("cylinder", SHAPE.height, SHAPE.width, SHAPE.length)
    assert sizing(replace(plain, sizes={"width": WIDER})).width == pytest.approx(1.3 * SHAPE.width)
    other = replace(plain, claim=Cut("strawberry"), own=True)
    assert sizing(other).height == pytest.approx(0.032) and sizing(other).shape == "ellipsoid"
    assert sizing(replace(plain, told=False)) == Sizing()
    request = claimed(plain, TRUTH, tmp_path / "a.csv", 60, "cpu")
    assert request.knife == "edc" and request.columns["sign"] == "-"


def test_intervals_are_counted_where_the_truth_has_the_property() -> None:
    """One of two holds; that of a skin which the truth has not is left out."""
    assert judged("a", RIGHT).held == (1, 2)


def test_eighteen_of_twenty_pass_and_seventeen_do_not() -> None:
    """Both kinds are counted for themselves."""
    wrong = [judged(f"w{k}", "wrong food", "peak force error") for k in range(18)] + [judged("w", "wrong food")] * 2
    lost = [judged("r", RIGHT, "x"), replace(judged("r", RIGHT), error="e")]
    right = [judged(f"r{k}", RIGHT) for k in range(18)] + lost
    assert told([*wrong, *right]) == (18, 20, 18, 20) and passed([*wrong, *right])
    assert not passed([*wrong[1:], judged("w", "wrong food"), *right])
    assert not passed([*wrong, *right[1:], judged("r", RIGHT, "x")])


def test_the_table_has_a_line_for_each_pair() -> None:
    """Its cells are those of the head; what was refused says by what, an error in short."""
    error = replace(judged("c", "wrong sign"), error="c.csv: away from resistance; use --sign -")
    lines = table([judged("a", RIGHT), judged("b", "wrong food", "x", "y"), error]).splitlines()
    assert len({line.count("|") for line in lines}) == 1 and len(lines) == 5
    assert "| passed |" in lines[2] and lines[3].endswith("| x, y |")
    assert "refused" in lines[4] and lines[4].endswith("| input: away from resistance |")


def test_what_a_folder_knows_is_not_judged_again(tmp_path: Path) -> None:
    """The document of a pair comes back as it was, and no simulation is asked for."""
    known = judged(PAIRS[0].name, PAIRS[0].kind, "curve explained by the food")
    write_json(tmp_path / f"{known.name}.json", known.as_dict())
    before, said = FakePool.runs, list[str]()
    assert run(PAIRS[:1], tmp_path, FakePool(), say=said.append) == [known]
    assert FakePool.runs == before
    assert said == [words(known)] and "refused: curve explained by the food" in said[0]
