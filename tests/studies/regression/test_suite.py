"""Recorded force curves: what a cut gives today against them, and the command that compares and records."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import calib
from calib.material.food import load_foods
from calib.material.knife import load_knife
from calib.simulation.workers import Workers
from cutcal.main import main
from mpm.scene import CONTACTS
from mpm.solver import Simulation
from studies.regression.baseline import (
    OTHER_SEEDS,
    RECORDED_KNIFE,
    RECORDED_POINTS,
    RECORDED_SEED,
    SAME,
    CutOutcome,
    baseline_cuts,
    columns_of,
    limit_factor,
    repeatability,
    run_cut,
    scales,
)
from studies.regression.comparison import differences
from studies.regression.reference_curves import CHECKED, COLUMNS, INDEX, References
from studies.regression.suite import compare_with_references, record_changes
from tests.calib.documents import valid

ALL = {case.name: case for case in baseline_cuts(list(load_foods().values()), load_knife(RECORDED_KNIFE))}
# By default, those of a second or less, with skin and without, that flow and that do not; nodal kernels take seconds to
# compile.
QUICK = (
    "banana-cohesive", "strawberry-cohesive", "kiwi-cohesive", "grape-cohesive", "shine_muscat-cohesive",
    "plum-cohesive", "cherry-cohesive", "grape-nodal", "shine_muscat-nodal",
)  # fmt: skip
ORDER = [f"{food}-{contact}" for food in load_foods() for contact in CONTACTS]
FOLDER = References().folder


def cuts(names=tuple(ALL)):
    """Parameters of a test that simulates: the quick ones by default."""
    return [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in names]


def scaled(food, **factors):
    """A food with some of its values times a factor."""
    return food.with_values({name: food.value(name) * factor for name, factor in factors.items()})


# What is recorded ---------------------------------------------------------------------------------


def test_every_food_and_contact_is_recorded():
    """Each has its file and its entry, in the order of materials.yaml, and nothing else lies there."""
    entries = json.loads((FOLDER / INDEX).read_text(encoding="utf-8"))["references"]
    assert list(entries) == ORDER
    assert {p.name for p in FOLDER.iterdir()} == {f"{name}.csv" for name in ORDER} | {INDEX}


@pytest.mark.parametrize("name", ALL)
def test_reference_is_of_this_food_and_scene(name):
    """It was recorded from the values that materials.yaml and knives.yaml have now,
    in the scene that is simulated now.
    """
    origin, case = References().read(name).origin, ALL[name]
    assert origin["inputs"] == case.inputs, f"record it again: cutcal regress {case.food.name} --update"
    assert origin["scene"] == json.loads(json.dumps(case.scene().as_dict()))
    assert (origin["food"], origin["contact"], origin["seed"]) == (case.food.name, case.contact, RECORDED_SEED)


@pytest.mark.parametrize("name", ALL)
def test_tolerances_are_those_of_measured_repeatability(name):
    """2.8 s_r in each column at least, 3.34 as it is from eight seeds;
    where they hardly differ, a thousandth; no more.
    """
    reference = References().read(name)
    spread, least = reference.origin["repeatability"], scales(reference.columns)
    assert spread["seeds"] == [RECORDED_SEED, *OTHER_SEEDS]
    for column in CHECKED:
        assert reference.tolerances[column] >= 2.8 * spread["s_r"][column]
        exact = max(limit_factor(8) * spread["s_r"][column], SAME * least[column])
        # s_r and tolerance are rounded to four digits
        assert exact * (1 - 1e-3) <= reference.tolerances[column] <= exact * (1 + 2e-3)


@pytest.mark.parametrize("name", cuts())
def test_cut_is_that_of_the_reference(name, dataframe_regression):
    """Forces and work over the stroke, simulated again, stay within what another seed changes of the recorded ones."""
    case, reference = ALL[name], References().read(name)
    record = Simulation(case.scene()).run()
    frame = pd.DataFrame(columns_of(record, case.scene().motion.stroke)).set_index("stroke_m")
    dataframe_regression.check(
        frame,
        fullpath=References().path(name),
        tolerances={column: {"atol": x, "rtol": 0.0} for column, x in reference.tolerances.items()},
        default_tolerance={"atol": 1e-9, "rtol": 1e-7},
    )


def test_screening_cells_are_those_of_the_record():
    """A grape has nearly the cells that a fit screens with;
    a melon, whose cut would take twenty seconds, twelve over its height.
    """
    cells = {name: ALL[f"{name}-cohesive"].scene().numerics.dx for name in ("grape", "melon")}
    assert cells == {"grape": pytest.approx(0.97 * 2.5e-3), "melon": pytest.approx(0.97 * 0.1 / 12)}


def test_last_bit_of_a_cell_moves_no_curve():
    """A cell that is longer by a part in 1e12 gives the same curve:
    rounding in another machine's libraries does not decide it.
    """
    scene = ALL["strawberry-cohesive"].scene()
    longer = replace(scene, numerics=replace(scene.numerics, dx=scene.numerics.dx * (1 + 1e-12)))
    one, other = (run_cut(s, "cpu", 1).columns for s in (scene, longer))
    for column, scale in scales(one).items():
        assert np.abs(one[column] - other[column]).max() < 1e-6 * scale


# What a change of physics does --------------------------------------------------------------------


class Here(Workers):
    """Workers in this very process.

    Args:
        work: Called with each scene in place of the simulation.
        most: Jobs after which it is interrupted.
    """

    def __init__(self, work=None, most=None):
        super().__init__(1, "cpu", 1)
        self.work, self.left = work, most

    def close(self):
        """There is nothing to end."""

    def each(self, work, jobs):
        """One job after the other."""
        for k, (scene,) in enumerate(jobs):
            if self.left == 0:
                raise KeyboardInterrupt
            self.left = None if self.left is None else self.left - 1
            yield k, self.work(scene) if self.work else work(scene, self.arch, self.threads)


@pytest.mark.parametrize(
    ("name", "change"),
    [("cherry-cohesive", {"R": 1.1}), ("strawberry-cohesive", {"R": 1.1}), ("grape-nodal", {"E": 1.2})],
)
def test_changed_physics_is_outside(name, change):
    """A tenth more resistance of the flesh, or a fifth more stiffness where contact has no edge,
    is found, and named.
    """
    case = replace(ALL[name], food=scaled(ALL[name].food, **change))
    (row,) = compare_with_references([case], References(), Here(), lambda _: None)
    assert row.verdict == "outside" and row.largest.over_tolerance > 1
    assert row.results.work_J.over_limit > 1
    (said,) = (text for text in row.because if "material" in text)
    old, new = (c.food.value(*change) for c in (ALL[name], case))
    assert said == f"food.material.{next(iter(change))} {old} -> {new}"


def test_another_seed_is_within():
    """A seed that no tolerance was made from is another curve, and no change of physics."""
    case = ALL["cherry-cohesive"]

    class Other(type(case)):
        def scene(self, seed=RECORDED_SEED):
            return super().scene(8)

    (row,) = compare_with_references([Other(case.food, case.knife, case.contact)], References(), Here(), lambda _: None)
    assert row.verdict == "within"
    assert row.largest.part > SAME
    assert row.because[0] == "numerics.seed 0 -> 8"


# Scatter and tolerances ---------------------------------------------------------------------------


def curves(level, n=60, length=0.03):
    """Half a sine of this peak [N], two thirds of it on the edge."""
    s = np.linspace(0, length, n + 1)[1:]
    force = level * np.sin(np.pi * s / length)
    work = level * length / np.pi * (1 - np.cos(np.pi * s / length))
    return {"stroke_m": s, "knife_N": force, "edge_N": 2 / 3 * force, "face_N": force / 3, "work_J": work}


def test_scatter_of_known_curves():
    """Peaks of 9, 10 and 11 N have a standard deviation of 1 N, edge and work their parts of it;
    the limit of three runs is 6.08.
    """
    found, tolerances = repeatability([curves(10.0), curves(9.0), curves(11.0)])
    assert found.s_r == pytest.approx({"knife_N": 1, "edge_N": 2 / 3, "face_N": 1 / 3, "work_J": 0.06 / np.pi})
    assert tolerances == pytest.approx({name: 6.085 * x for name, x in found.s_r.items()}, rel=1e-3)
    assert found.limits["peak_N"] == pytest.approx(6.085, rel=1e-3)
    assert found.limits["work_J"] == pytest.approx(6.085 * 0.06 / np.pi, rel=1e-3)
    assert found.s_r_results["peak_stroke_m"] == 0
    assert found.limits["peak_stroke_m"] == pytest.approx(0.0005)  # a point of the curve


def test_limit_of_few_runs():
    """The root of two times Student's t of tables, 2.365 for eight runs and 1.984 for a hundred; 2.8 for ever more."""
    assert limit_factor(8) == pytest.approx(2.365 * np.sqrt(2), rel=1e-3)
    assert limit_factor(101) == pytest.approx(1.984 * np.sqrt(2), rel=1e-3)
    assert limit_factor(10**6) == 2.8


def test_seeds_that_agree_leave_the_floor():
    """Where seeds do not differ, a thousandth of the largest force or work is allowed,
    in a column without force too.
    """
    flat = curves(10.0) | {"edge_N": np.zeros(60)}
    _, tolerances = repeatability([flat, flat])
    force, work = 0.01, 1e-3 * 10 * 0.06 / np.pi
    assert tolerances == pytest.approx({"knife_N": force, "edge_N": force, "face_N": force, "work_J": work})


# The command, with made-up cuts -------------------------------------------------------------------

PLAY = ("grape", "cherry")
WOBBLE = (0.0, 1.0, -1.0, 0.5, -0.5, 0.2, 0.8, -0.7)  # per cent of force that a seed adds


def made_up(scene):
    """A cut whose force follows R and, by a per cent, the seed."""
    level = 0.1 * scene.food.material.R * (1 + 0.01 * WOBBLE[scene.numerics.seed])
    return CutOutcome("done", curves(level, length=scene.motion.stroke))


@pytest.fixture
def play(tmp_path, monkeypatch):
    """A folder of made-up references of two foods, and cuts that are made up alike;
    yields folder and ``use(work, most)``.
    """

    def use(work=made_up, most=None):
        monkeypatch.setattr("cutcal.commands.solver.regress.workers_of", lambda *_: Here(work, most))

    monkeypatch.setattr("studies.regression.reference_curves.data_path", lambda name: tmp_path / name)
    use()
    assert main(["regress", *PLAY, "--update"]) == 0
    return tmp_path / "force_data" / "reference", use


def tougher(monkeypatch, *foods):
    """From here on these foods have a tenth more R."""

    known = load_foods()
    monkeypatch.setattr(
        "cutcal.commands.solver.regress.load_foods", lambda: known | {n: scaled(known[n], R=1.1) for n in foods}
    )


def content(folder):
    """All files of a folder."""
    return {p.name: p.read_bytes() for p in folder.iterdir()}


def refused(capsys, *words):
    """The one error line of a command that is refused."""
    capsys.readouterr()
    assert main(["regress", *words]) == 1
    printed = capsys.readouterr()
    assert printed.out == "" and "Traceback" not in printed.err
    (line,) = (x for x in printed.err.splitlines() if x.startswith("cutcal: "))
    return line


def test_same_is_said_and_kept_to_the_byte(play, capsys):
    """What was recorded is the same when it is simulated again;
    recording again changes no byte, and repeats no seed.
    """
    folder, use = play
    before = content(folder)
    names = [name for name in ORDER if name.startswith(PLAY)]
    assert list(json.loads(before[INDEX])["references"]) == names  # in whichever order they were simulated
    capsys.readouterr()
    assert main(["regress", *PLAY]) == 0
    printed = capsys.readouterr()
    assert "4 cuts: 4 same" in printed.out and "left" in printed.err
    use(most=4)  # a fifth run would be interrupted
    assert main(["regress", *PLAY, "--update"]) == 0
    assert "0 recorded, 4 kept as they were" in capsys.readouterr().out
    assert content(folder) == before


def test_change_is_outside_and_said_in_terms_of_physics(play, capsys, monkeypatch):
    """A tenth more force is exit code 2: peak, work and shape, what other seeds change,
    and the value that is another.
    """
    tougher(monkeypatch, "grape")
    capsys.readouterr()
    assert main(["regress", *PLAY, "--contact", "cohesive"]) == 2
    said = capsys.readouterr().out
    assert "1 outside" in said and "1 same" in said and "OUTSIDE" in said
    sd = np.std([0.08 * w for w in WOBBLE], ddof=1)
    times = 0.8 / (limit_factor(8) * sd)
    assert f"peak 8 -> 8.8 N (+10.0 %, {times:.1f} times what another seed changes), at the same place" in said
    assert "work" in said and "shape error 0.0000" in said
    assert "food.material.R 80.0 -> 88.0" in said
    assert said.count("changed since") == 1


def test_update_records_the_change_and_nothing_else(play, capsys, monkeypatch):
    """The changed food is recorded, with the argument for a review; the other's file and entry stay;
    then all is the same.
    """
    folder, _ = play
    before = content(folder)
    tougher(monkeypatch, "grape")
    capsys.readouterr()
    assert main(["regress", *PLAY, "--update"]) == 0
    said = capsys.readouterr().out
    assert "2 recorded, 2 kept as they were" in said and "peak 8 -> 8.8 N (+10.0 %" in said
    after = content(folder)
    assert [name for name in sorted(after) if after[name] != before[name]] == [
        "grape-cohesive.csv", "grape-nodal.csv", INDEX,
    ]  # fmt: skip
    old, new = (json.loads(x[INDEX])["references"] for x in (before, after))
    assert list(new) == list(old) and new["cherry-cohesive"] == old["cherry-cohesive"]
    assert new["grape-cohesive"]["results"]["peak_N"] == 8.8
    assert main(["regress", *PLAY]) == 0


def test_value_without_effect_is_recorded(play, capsys, monkeypatch):
    """A value that the cut does not feel leaves it the same, but the record says which values it is of:
    it is written anew.
    """
    folder, _ = play
    before = content(folder)
    known = load_foods()
    monkeypatch.setattr(
        "cutcal.commands.solver.regress.load_foods", lambda: known | {"grape": scaled(known["grape"], E=2.0)}
    )
    assert main(["regress", "grape"]) == 0
    assert main(["regress", "grape", "--update"]) == 0
    after = content(folder)
    assert [name for name in after if after[name] != before[name]] == [INDEX]
    assert json.loads(after[INDEX])["references"]["grape-nodal"]["scene"]["food"]["material"]["E"] == 8e5
    assert "2 recorded" in capsys.readouterr().out


def test_value_beside_the_scene_is_recorded(play, capsys, monkeypatch):
    """So does one that no scene has, such as a fracture energy without a strength:
    it is in the hash of the inputs alone.
    """
    known = load_foods()
    properties = {name: p for name, p in known["grape"].properties.items() if name != "strength_ratio"}
    weak = replace(known["grape"], properties=properties)
    torn = weak.with_values({"fracture_energy": 1.0})
    monkeypatch.setattr("cutcal.commands.solver.regress.load_foods", lambda: known | {"grape": weak})
    assert main(["regress", "grape", "--contact", "nodal", "--update"]) == 0
    monkeypatch.setattr("cutcal.commands.solver.regress.load_foods", lambda: known | {"grape": torn})
    case, reference = replace(ALL["grape-nodal"], food=torn), References(play[0]).read("grape-nodal")
    assert differences(case, reference) == ["values of the food or the knife that its scene does not show"]
    capsys.readouterr()
    assert main(["regress", "grape", "--contact", "nodal", "--update"]) == 0
    assert "1 recorded" in capsys.readouterr().out
    assert differences(case, References(play[0]).read("grape-nodal")) == []


def test_scene_without_effect_is_recorded(play, capsys, monkeypatch):
    """So it is with another cell that the cut does not feel."""
    monkeypatch.setattr("studies.regression.baseline.MOST_CELLS", 4)
    capsys.readouterr()
    assert main(["regress", "grape", "--contact", "nodal", "--update"]) == 0
    assert "1 recorded" in capsys.readouterr().out
    origin = References(play[0]).read("grape-nodal").origin
    assert origin["scene"]["numerics"]["dx"] == origin["dx_m"] == pytest.approx(0.97 * 0.02 / 4)


def test_height_that_is_another(play, capsys, monkeypatch):
    """A higher food has another stroke; the curves are compared where both have one, and the height is named."""
    known = load_foods()
    high = known["grape"].with_sizes({"height": 0.022}, status="given", source="a test")
    monkeypatch.setattr("cutcal.commands.solver.regress.load_foods", lambda: known | {"grape": high})
    capsys.readouterr()
    assert main(["regress", "grape", "--contact", "nodal"]) == 2
    assert "food.shape.height 0.02 -> 0.022" in capsys.readouterr().out


def test_other_code_that_moves_the_peak(play, capsys):
    """The same scene gives a curve of the same peak and work that comes later:
    the place is said, and it can be recorded.
    """

    def later(scene):
        columns = dict(made_up(scene).columns)
        for name in ("knife_N", "edge_N", "face_N"):
            columns[name] = np.roll(columns[name], 6)
        return CutOutcome("done", columns)

    _, use = play
    use(later)
    capsys.readouterr()
    assert main(["regress", "grape", "--contact", "nodal"]) == 2
    said = capsys.readouterr().out
    assert "(+0.0 %, 0.0 times what another seed changes), reached 2.0 mm later" in said
    assert "nothing that a record knows of" in said
    assert main(["regress", "grape", "--contact", "nodal", "--update"]) == 0
    assert "1 recorded" in capsys.readouterr().out
    assert main(["regress", "grape", "--contact", "nodal"]) == 0


def test_within_is_no_failure(play, capsys):
    """A per cent, as much as another seed, is told from the same curve, and passes."""
    _, use = play
    use(lambda scene: made_up(replace(scene, numerics=replace(scene.numerics, seed=1))))
    capsys.readouterr()
    assert main(["regress", "grape", "--contact", "cohesive"]) == 0
    assert "1 within" in capsys.readouterr().out


def test_document_on_stdout_and_in_the_folder(play, capsys, monkeypatch, tmp_path):
    """--json prints one document; --out has the same, and the new curves; a folder with another run is refused."""
    tougher(monkeypatch, "grape")
    out = tmp_path / "out"
    capsys.readouterr()
    assert main(["regress", "grape", "--json", "--out", str(out)]) == 2
    printed = valid(json.loads(capsys.readouterr().out))
    assert printed == json.loads((out / "regress.json").read_text(encoding="utf-8"))
    assert printed["passed"] is False and printed["counts"] == {"outside": 2}
    case = printed["cases"][0]
    assert (case["food"], case["contact"], case["verdict"]) == ("grape", "cohesive", "outside")
    assert case["results"]["work_J"]["change"] / case["results"]["work_J"]["before"] == pytest.approx(0.1)
    assert case["nrmse"] == pytest.approx(0.1 * np.sqrt(0.5), rel=0.01)  # of a half sine a tenth larger
    assert case["largest"]["part"] == pytest.approx(0.1)
    now = pd.read_csv(out / "grape-nodal.csv")
    assert tuple(now) == COLUMNS and now["knife_N"].max() == pytest.approx(8.8)
    assert "regress.json" in refused(capsys, "grape", "--out", str(out))


def test_cut_that_breaks_down(play, capsys):
    """It is exit code 2 and named; --update does not record it, nor one of which another seed breaks down."""
    folder, use = play
    before = content(folder)
    use(lambda _: CutOutcome("inverted", None))
    assert main(["regress", "grape", "--contact", "nodal"]) == 2
    assert "broke down: inverted" in capsys.readouterr().out
    assert main(["regress", "grape", "--update"]) == 2
    use(lambda scene: made_up(scene) if scene.numerics.seed == RECORDED_SEED else CutOutcome("left_grid", None))
    (folder / "grape-nodal.csv").unlink()
    assert main(["regress", "grape", "--contact", "nodal", "--update"]) == 2
    assert f"broke down: left_grid with seed {OTHER_SEEDS[-1]}" in capsys.readouterr().out
    assert content(folder) == {name: text for name, text in before.items() if name != "grape-nodal.csv"}


# Interrupted --------------------------------------------------------------------------------------


def test_ctrl_c_keeps_what_is_recorded(play, capsys, monkeypatch):
    """Interrupted after the first food, that one is recorded and the other as it was; the same command goes on."""
    folder, use = play
    before = content(folder)
    tougher(monkeypatch, *PLAY)
    use(most=4 + 1 * len(OTHER_SEEDS) + 2)
    assert main(["regress", *PLAY, "--update"]) == 130
    after = content(folder)
    assert {name for name in after if after[name] != before[name]} == {"grape-cohesive.csv", INDEX}
    assert set(after) == set(before)
    use(most=4 + 3 * len(OTHER_SEEDS))
    capsys.readouterr()
    assert main(["regress", *PLAY, "--update"]) == 0
    assert "3 recorded, 1 kept as they were" in capsys.readouterr().out
    assert main(["regress", *PLAY]) == 0


@pytest.mark.parametrize(("step", "level"), [(INDEX, 8.0), ("grape-nodal.csv", 8.8)])
def test_killed_while_writing_is_old_or_new(step, level, play, monkeypatch):
    """Killed before or after the entry is renamed into place, a reference is whole: the old one, or the new one."""
    folder, _ = play
    real = os.replace

    def replaced(source, target):
        if os.path.basename(target) == step:
            raise KeyboardInterrupt
        real(source, target)

    references, case = References(folder), ALL["grape-nodal"]
    hard = replace(case, food=scaled(case.food, R=1.1))
    monkeypatch.setattr(os, "replace", replaced)
    with pytest.raises(KeyboardInterrupt):
        record_changes([hard], references, Here(made_up), lambda _: None, ORDER)
    monkeypatch.undo()
    assert references.read("grape-nodal").columns["knife_N"].max() == pytest.approx(level)
    references.settle()
    assert references.read("grape-nodal").columns["knife_N"].max() == pytest.approx(level)
    assert pd.read_csv(references.path("grape-nodal"))["knife_N"].max() == pytest.approx(level)
    assert not list(folder.glob("*.new"))


# Refused ------------------------------------------------------------------------------------------


def edited(change):
    """Damage to a file: its text through a function."""
    return lambda path: path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")


def entry(**changes):
    """Damage to the entry of grape-cohesive; None takes a key away."""

    def damage(path):
        content = json.loads(path.read_text(encoding="utf-8"))
        one = content["references"]["grape-cohesive"]
        one.update(changes)
        content["references"]["grape-cohesive"] = {k: v for k, v in one.items() if v is not None}
        path.write_text(json.dumps(content), encoding="utf-8")

    return damage


DAMAGES = {
    "no file": ("csv", lambda path: path.unlink(), ["no reference is recorded", "--update"]),
    "missing column": ("csv", edited(lambda t: t.replace("edge_N", "edge")), ["misses edge_N"]),
    "not a number": ("csv", edited(lambda t: t.replace("0.015,", "0.015,nan", 1)), ["row", "knife_N", "'nan"]),
    "cut off": ("csv", edited(lambda t: t[:700]), ["grape-cohesive.csv"]),
    "empty": ("csv", edited(lambda _: ""), ["cannot be read"]),
    "not text": ("csv", lambda path: path.write_bytes(b"\xff\xfe\x00\x01"), ["cannot be read"]),
    "edited": ("csv", edited(lambda t: t.replace("8", "7", 1)), ["not the columns that reference.json"]),
    "another order": ("csv", edited(lambda t: "\n".join([*t.split()[:1], *t.split()[:0:-1]])), ["does not increase"]),
    "index cut off": ("json", edited(lambda t: t[: len(t) // 2]), ["reference.json: damaged"]),
    "index of a list": ("json", edited(lambda _: "[]"), ["holds no references"]),
    "later layout": ("json", edited(lambda t: t.replace('"schema": 1', '"schema": 2')), ["layout is 2"]),
    "no tolerances": ("json", entry(tolerances=None), ["misses tolerances"]),
    "tolerance of nothing": ("json", entry(tolerances={}), ["no numbers"]),
    "tolerance of text": ("json", entry(tolerances=dict.fromkeys(CHECKED, "wide")), ["no numbers"]),
    "negative tolerance": ("json", entry(tolerances=dict.fromkeys(CHECKED, -1)), ["no numbers"]),
    "no tolerance at all": ("json", entry(tolerances=dict.fromkeys(CHECKED, 0)), ["no numbers"]),
    "scatter in a list": ("json", entry(repeatability=[]), ["misses repeatability"]),
    "scatter without limits": ("json", entry(repeatability={}), ["no numbers"]),
    "versions in a list": ("json", entry(versions=["1.0"], scene=[]), ["misses scene, versions"]),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_reference_is_one_clear_error(damage, play, capsys):
    """Each is refused before anything is simulated, with file, place and remedy."""
    folder, use = play
    which, spoil, words = DAMAGES[damage]
    spoil(folder / ("grape-cohesive.csv" if which == "csv" else INDEX))
    use(most=0)  # the first run would be interrupted
    line = refused(capsys, *PLAY)
    assert all(word in line for word in [*words, "--update"])


def test_damaged_reference_is_recorded_anew(play, capsys):
    """--update says what was damaged and replaces it."""
    folder, _ = play
    before = content(folder)
    (folder / "grape-cohesive.csv").write_text("stroke_m,knife_N\n0,1\n")
    capsys.readouterr()
    assert main(["regress", *PLAY, "--update"]) == 0
    printed = capsys.readouterr()
    assert "grape-cohesive.csv: misses edge_N, face_N, work_J; it is recorded anew" in printed.err
    assert "1 recorded, 3 kept as they were" in printed.out
    assert content(folder)["grape-cohesive.csv"] == before["grape-cohesive.csv"]


def test_installed_copy_does_not_record(play, capsys, monkeypatch):
    """An installed package has copies of the references;
    --update there is refused in one sentence, and writes nothing.
    """
    data = calib.__path__[0] + "/data"
    monkeypatch.setattr("studies.regression.reference_curves.data_path", lambda name: type(play[0])(data) / name)
    line = refused(capsys, "grape", "--update")
    assert "checkout" in line and "installed copy" in line
    assert not os.path.exists(data)


def test_folder_that_cannot_be_written(play, capsys, monkeypatch, tmp_path):
    """A folder that cannot be made or written is refused in one sentence, before anything is simulated."""
    (tmp_path / "file").write_text("")
    monkeypatch.setattr("studies.regression.reference_curves.data_path", lambda name: tmp_path / "file" / name)
    play[1](most=0)
    assert "--update" in (line := refused(capsys, "grape", "--update")) and "cannot be written" in line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["bananna"], "did you mean 'banana'"),
        (["--workers", "0"], "--workers"),
        (["--update", "--arch", "cuda"], "recorded on the processor"),
    ],
)
def test_bad_options_are_one_clear_error(words, said, capsys):
    """An unknown food, an impossible number and recording on a GPU are refused."""
    assert said in refused(capsys, *words)


def test_line_ends_are_no_damage(play):
    """A checkout with the line ends of Windows holds the same references."""
    folder, _ = play
    path = folder / "grape-cohesive.csv"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert main(["regress", "grape"]) == 0


def test_code_and_libraries_that_are_others_are_named(play, monkeypatch):
    """Where the scene is the same, the code of the solver and the libraries are what a change may come from."""
    known = References(play[0]).read("grape-cohesive")
    case = ALL["grape-cohesive"]
    assert differences(case, known) == []
    monkeypatch.setattr("studies.regression.comparison.code_key", lambda: "f" * 64)
    monkeypatch.setattr("studies.regression.comparison.versions", lambda: known.origin["versions"] | {"taichi": "9.9"})
    assert differences(case, known) == [
        f"the solver's code {known.origin['solver']} -> {'f' * 16}",
        f"taichi {known.origin['versions']['taichi']} -> 9.9",
    ]


def test_worker_gives_what_is_recorded(monkeypatch):
    """The job of a worker gives the columns of the record, and none where the cut did not reach its end."""
    scene = ALL["cherry-cohesive"].scene()
    record = Simulation(scene).run()
    for status, columns in (("done", COLUMNS), ("inverted", None)):
        monkeypatch.setattr(Simulation, "run", lambda _, now=status: replace(record, status=now))
        outcome = run_cut(scene, "cpu", 1)
        assert outcome.status == status
        assert (outcome.columns and tuple(outcome.columns)) == columns
    assert len(columns_of(record, scene.motion.stroke)["work_J"]) == RECORDED_POINTS
