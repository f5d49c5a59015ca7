"""Datasets: which episodes there are, what is stored of them, and that a stopped one goes on."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from calib.errors import OutputError
from calib.simulation.workers import Workers
from cutcal.main import main
from intsim.data import generate as g
from intsim.data.dataset_document import DATASET_FILE, DatasetDocument, DatasetSpec, PictureTotals
from intsim.data.demonstrate import Demonstration
from intsim.data.manifest import PROPERTY_SCATTER, TRAINING_SUITES, Manifest
from intsim.data.shard_meanings import COLUMNS, meaning_of
from intsim.data.shards import pack_episode, trajectories
from intsim.task.language import instructions, parse_instruction
from intsim.task.planner import CONTROL_RATE, PHASES
from intsim.task.suites import FIRST_TEST_SEED, FOODS
from intsim.task.targets import TaskError
from tests.calib.documents import valid
from tests.calib.io.test_meaning import assert_told, attributes, axes, rank, sets


def track(steps: int = 12, seed: int = 0) -> Demonstration:
    """A made-up trajectory with contact from its fifth step on, and two cuts."""
    rng = np.random.default_rng(seed)
    t = Demonstration()
    for k in range(steps + 1):
        t.qpos.append(rng.random(9))
        t.qvel.append(rng.random(9))
        t.edge.append(rng.random(5))
        if k == steps:
            break
        t.command.append(rng.random(5))
        t.action.append(rng.random(8))
        t.phase.append(PHASES[k % 5])
        t.force.append(rng.random((5, 3)) if k > 4 else np.zeros((5, 3)))
        t.touching.append(k > 4)
        t.uncut.append(1 - k / steps)
        t.pieces.append(1 + (k > 8))
        t.published.append(k > 8)
        t.severed.append(k > 8)
        if k in (5, 6, 9, 10):
            vertices = rng.random((30 if k < 8 else 40, 3))
            t.meshes.append((k + 1, 0, vertices, np.array([[0, 1, 2]]), np.zeros(len(vertices), bool)))
    return t


def test_the_manifest_counts_the_whole_product_and_draws_each_once():
    """21,000 x 15 x 5 samples, none stored; every index is another triple; a number beyond is none."""
    whole = Manifest()
    assert len(whole) == 1_575_000
    small = Manifest(trajectories=4, backgrounds=3, instructions=2)
    assert len({(s.trajectory, s.background, s.instruction) for s in small}) == len(small) == 24
    last = whole[len(whole) - 1]
    assert (last.trajectory, last.background, last.instruction) == (20_999, 14, 4)
    with pytest.raises(IndexError):
        whole[len(whole)]


@pytest.mark.parametrize(("foods", "tasks"), [(1, 2), (2, 3)])
def test_every_task_is_asked_of_every_food(foods, tasks):
    """Whatever the numbers of foods and tasks: one of each pair in as many trajectories as there are pairs."""
    m = Manifest(foods * tasks, foods=FOODS[:foods], suites=TRAINING_SUITES[:tasks])
    made = [m.trajectory(k) for k in range(foods * tasks)]
    assert len({(one.food.name, one.suite) for one in made}) == foods * tasks


def test_a_trajectory_is_drawn_from_its_number_alone():
    """Same number, same episode; all foods and tasks come in turn; values stay within their ranges and differ; no seed
    of a test."""
    m = Manifest(trajectories=80)
    draws = [m.trajectory(k) for k in range(80)]
    assert m.trajectory(7) == draws[7]
    assert [d.food.name for d in draws[:15]] == list(FOODS)
    assert {d.suite for d in draws[:15]} == set(TRAINING_SUITES)
    assert len({(d.suite, d.food.name) for d in draws[:75]}) == 75
    assert {d.style for d in draws} == {"press", "slice", "rock", "saw"}
    assert max(d.seed for d in draws) < FIRST_TEST_SEED
    for d in draws:
        names = [d.episode.item.name, *(o.name for o in d.episode.others)]
        found = parse_instruction(d.episode.instruction, names)
        assert float(found.ratio) == pytest.approx(float(d.episode.spec.ratio))
        assert replace(found, ratio=d.episode.spec.ratio) == d.episode.spec
        assert set(d.values) <= set(PROPERTY_SCATTER) and d.values["R"] > 0
    assert len({d.values["R"] for d in draws if d.food.name == "banana"}) > 1


@pytest.mark.parametrize("how", [{"trajectories": 0}, {"suites": ("none",)}, {"seed": FIRST_TEST_SEED}, {"foods": ()}])
def test_an_impossible_manifest_is_an_error(how):
    """Nothing to draw, an unknown task, seeds of the tests; demonstrations of a kind that is none."""
    with pytest.raises(TaskError, match="dataset"):
        Manifest(**{"trajectories": 10, **how})
    with pytest.raises(TaskError, match="demos 'lazy' is none of sustained"):
        DatasetSpec(Manifest(), demos="lazy")
    with pytest.raises(TaskError, match=r"'half' is none of seeds, .* \(option --task\)"):
        Manifest(suites=("half",))


class Inline(Workers):
    """Jobs one after the other, in this process, until so many are made."""

    def __init__(self, most: int = 1000) -> None:
        super().__init__(1, "cpu", 1)
        self.most = most

    def close(self) -> None:
        """Nothing to end."""

    def each(self, work, jobs) -> Iterator[tuple[int, g.PackedEpisode]]:
        """A made-up episode for each."""
        for k, (spec, *_) in enumerate(jobs):
            if self.most == 0:
                raise KeyboardInterrupt
            self.most -= 1
            yield k, made(spec)


def made(spec) -> g.PackedEpisode:
    """What a worker sends back."""
    t = track(seed=spec.seed)
    entry = {
        "episode_seed": spec.seed,
        "index": spec.index,
        "instruction": spec.episode.instruction,
        "instructions": instructions(spec.episode.spec, spec.seed),
        "suite": spec.suite,
        "demos": "sustained",
        "task": {
            "ratio": float(spec.episode.spec.ratio),
            "side": spec.episode.spec.side,
            "pieces": spec.episode.spec.pieces,
        },
        "items": [{"name": spec.food.name}],
        "elapsed_steps": len(t.action),
        "food": spec.food.name,
        "style": spec.style,
        "status": "done",
        "success": True,
        "published": True,
        "severed": True,
        "peak_N": 1.0,
        "seconds": {"solver": 2.0, "robot": 1.0, "start": 0.0},
    }
    return g.PackedEpisode(entry, pack_episode(t, entry, {"food": spec.food.name, "material": "{}"}))


@pytest.fixture(autouse=True)
def no_simulator(monkeypatch):
    """These tests make episodes up."""
    monkeypatch.setattr(g, "require_simulator", lambda: None)


def test_a_stopped_dataset_goes_on_and_comes_out_the_same(tmp_path):
    """Stopped after 4 of 7 and begun again: nothing is made twice, and the shards are those of one go; parts are
    gone."""
    m = DatasetSpec(Manifest(trajectories=7), shard=3)
    with pytest.raises(KeyboardInterrupt):
        g.generate(m, tmp_path / "a", Inline(4))
    (tmp_path / "a" / "part-000001.h5").touch()  # killed when its shard was written and the part not yet removed
    rest = Inline(3)
    document = g.generate(m, tmp_path / "a", rest, resume=True)
    assert DatasetDocument.read(tmp_path / "a") == document and valid(document.as_dict())
    assert document.totals is not None and rest.most == 0 and document.totals.trajectories == 7
    g.generate(m, tmp_path / "b", Inline())
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == sorted(p.name for p in (tmp_path / "b").iterdir())
    assert not list((tmp_path / "a").glob("part-*"))
    for one, two in zip(trajectories(tmp_path / "a"), trajectories(tmp_path / "b"), strict=True):
        assert one.entry == two.entry
        assert np.array_equal(one.group["actions"], two.group["actions"])
    assert document.totals.core_hours_of_21000 == pytest.approx(21_000 * 3.0 / 3600)


def test_a_dataset_that_is_not_finished_has_a_document(tmp_path):
    """What it is, with a stiffness that nobody gave as null; what its pictures took may be said before it is
    finished."""
    spec = DatasetSpec(Manifest(trajectories=7, foods=["plum"]), demos="planned")
    pictures = PictureTotals((0, 3), 64, 12, 1.5, 10.0, 1000)
    for document in (DatasetDocument(spec), DatasetDocument(spec, pictures=pictures)):
        document.write(tmp_path)
        assert DatasetDocument.read(tmp_path) == document
    plain = json.loads((tmp_path / DATASET_FILE).read_text())
    assert list(plain) == ["schema", "manifest", "demos", "knife", "stiffness", "shard", "pictures"]
    assert plain["stiffness"] is None and plain["manifest"]["foods"] == ["plum"]


def test_what_is_stored_has_maniskills_layout_and_keeps_the_force_apart(tmp_path):
    """Shapes as documented; force and impulse agree; no name outside ``mpm`` has a force in it; the surface comes back
    to a tenth of a millimetre."""
    g.generate(DatasetSpec(Manifest(trajectories=2), shard=2), tmp_path / "d", Inline())
    listed = json.loads((tmp_path / "d" / "shard-0000.json").read_text())
    assert [e["episode_id"] for e in listed["episodes"]] == [0, 1] and listed["env_info"]["env_id"] == "CutFood-v1"
    for k, stored in enumerate(trajectories(tmp_path / "d")):
        t, file = track(seed=k), stored.group
        n = len(t.action)
        assert file["actions"].shape == (n, 8) and file["obs/agent/qpos"].shape == (n + 1, 9)
        assert file["control/delta"].shape == (n, 7) and file["mpm/force"].shape == (n, 5, 3)
        assert np.allclose(
            file["mpm/impulse"][-1], file["mpm/force"][()].mean(axis=1).sum(axis=0) / CONTROL_RATE, rtol=1e-5
        )
        assert np.allclose(
            file["control/delta"][:, :3], (np.array(t.command) - np.array(t.edge)[:-1])[:, :3], atol=1e-6
        )
        assert file["mpm"].attrs["contact_step"] == 5
        names: list[str] = []
        file.visit(names.append)
        assert not [name for name in names if not name.startswith("mpm") and ("force" in name or "impulse" in name)]
        assert list(file["mpm/surface"]) == ["0", "1"]
        first = file["mpm/surface/0"]
        assert first["step"][()].tolist() == [6, 7]
        assert np.allclose(first["vertices"][0] + first.attrs["origin"], t.meshes[0][2], atol=3e-4)


def test_every_set_says_its_unit_and_what_it_is(tmp_path):
    """Of the trajectories and of the food's surface; the attributes of what the food did are those that are told."""
    g.generate(DatasetSpec(Manifest(trajectories=2), shard=2), tmp_path / "d", Inline())
    found = sets(tmp_path / "d" / "shard-0000.h5")
    assert_told(found)
    ranks = {name: rank(meaning_of(name.split("/", 1)[1]).shape) for name in found}
    assert axes(tmp_path / "d" / "shard-0000.h5") == ranks
    assert found["traj_1/mpm/force"][0] == "N" and found["traj_0/mpm/surface/1/vertices"][0] == "m"
    assert {name.removeprefix("traj_0/") for name in found if name.startswith("traj_0/") and "surface" not in name} == {
        *COLUMNS
    }
    names, told = attributes(tmp_path / "d" / "shard-0000.h5", "traj_0/mpm")
    assert names == {"food", "material", "contact_step"} and names < set(told)
    spec = Manifest(trajectories=1).trajectory(0)
    assert {*g._attributes(spec, g.World()), "contact_step"} == set(told)


def test_a_folder_that_is_taken_or_damaged_is_an_error(tmp_path):
    """Another dataset, no --resume, no shards, a broken file: one line each."""
    out = tmp_path / "d"
    g.generate(DatasetSpec(Manifest(trajectories=1)), out, Inline())
    with pytest.raises(OutputError, match="--resume"):
        g.generate(DatasetSpec(Manifest(trajectories=1)), out, Inline())
    with pytest.raises(OutputError, match="another dataset"):
        g.generate(DatasetSpec(Manifest(trajectories=2)), out, Inline(), resume=True)
    with pytest.raises(OutputError, match="no shards"):
        next(trajectories(tmp_path))
    with h5py.File(out / "shard-0000.h5", "w"):
        pass
    with pytest.raises(OutputError, match="damaged"):
        list(trajectories(out))
    (out / DATASET_FILE).write_text("{")
    with pytest.raises(OutputError, match="damaged"):
        g.generate(DatasetSpec(Manifest(trajectories=1)), out, Inline(), resume=True)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("generate", "--out"),
        ("generate runs/x --out y", "too much"),
        ("generate --food bread --out y", "bread"),
        ("generate --task cook --out y", "cook"),
        ("generate --seed 999990 --out y", "for tests"),
        ("generate --knife spoon --out y", "spoon"),
        ("export --out y", "name the folder"),
        ("export nowhere --out y", "no shards"),
        ("export nowhere --out y --scenes 1,b", "numbers of backgrounds"),
        ("export nowhere --out y --scenes 99", "0 to 14"),
    ],
)
def test_wrong_words_on_the_command_line_are_one_line(words, says, capsys, tmp_path, monkeypatch):
    """What was wrong, before anything is made."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("intsim.data.generate.require_simulator", lambda: None)
    if words.startswith("export nowhere"):
        pytest.importorskip("pyarrow", reason="the extra [data] is not installed")
        pytest.importorskip("av", reason="the extra [data] is not installed")
    assert main(["dataset", *words.split()]) == 1
    error = capsys.readouterr().err.strip()
    assert says in error and "\n" not in error and error.startswith("cutcal: ")
    assert not list((tmp_path).glob("y/shard*"))


def test_without_the_robot_simulator_it_says_what_to_install(monkeypatch, tmp_path: Path):
    """One line that names the extra."""
    monkeypatch.undo()
    monkeypatch.setitem(__import__("sys").modules, "mani_skill", None)
    with pytest.raises(Exception, match=r"cutcal\[robot\]"):
        g.generate(DatasetSpec(Manifest(trajectories=1)), tmp_path / "d", Inline())
