"""The export for RDT, read back by the index arithmetic of its ManiSkill loader."""

from __future__ import annotations

import json
from collections import Counter

import h5py
import numpy as np
import pytest

from calib.errors import OutputError
from intsim.data import generate as g
from intsim.data.dataset_document import DatasetSpec
from intsim.data.manifest import Manifest
from intsim.data.rdt import STATISTICS_FILE, TASKS_FILE, export_rdt, task_name
from intsim.data.shards import trajectories
from intsim.task.language import parse_instruction, same_task
from intsim.task.selection import TaskFilter
from tests.calib.io.test_meaning import assert_told, sets
from tests.intsim.data.test_generate import Inline
from tests.intsim.painter import PIXELS, Here, Painter, paint_with

Image = pytest.importorskip("PIL.Image", reason="the extra [data] is not installed")


@pytest.fixture
def exported(tmp_path, monkeypatch):
    """Made-up trajectories of two foods before two backgrounds, the hand closed throughout as it is in real ones."""
    monkeypatch.setattr(g, "require_simulator", lambda: None)
    g.generate(
        DatasetSpec(Manifest(trajectories=10, foods=("plum", "kiwi"), suites=("flips",))), tmp_path / "set", Inline()
    )
    for path in (tmp_path / "set").glob("*.h5"):
        with h5py.File(path, "r+") as file:
            for group in file.values():
                group["obs/agent/qpos"][:, 7:] = 0.0
                group["actions"][:, 7] = -1.0
    paint_with(Painter, monkeypatch)
    tasks = export_rdt(tmp_path / "set", tmp_path / "rdt", backgrounds=[0, 2], pixels=PIXELS, pool=Here())
    return tmp_path / "set", tmp_path / "rdt", tasks


def test_the_loader_finds_every_picture_and_joint(exported):
    """One .h5 a task; a picture before each step, in the folder of a hundred episodes; actions one fewer than joints;
    no force."""
    folder, out, tasks = exported
    lengths = Counter(len(stored.group["actions"]) for stored in trajectories(folder))
    assert sum(t["episodes"] for t in tasks.values()) == 2 * lengths.total()
    assert json.loads((out / TASKS_FILE).read_text()) == tasks
    for name, task in tasks.items():
        (path,) = (out / name / "motionplanning").glob("*.h5")
        with h5py.File(path) as file:
            keys = sorted(file, key=lambda key: int(key.split("_")[-1]))
            assert len(keys) == task["episodes"]
            assert_told(sets(path))
            for k, key in enumerate(keys):
                actions, states = file[key]["actions"][:], file[key]["obs"]["agent"]["qpos"][:]
                n = len(actions)
                assert n in lengths and actions.shape == (n, 8) and states.shape == (n + 1, 9)
                for step in range(n):
                    with Image.open(path.parent / f"{k // 100}" / f"{k % 100}" / f"{step + 1}.png") as picture:
                        shade = np.array(picture)
                    scene = int(file[key].attrs["scene"])
                    assert shade.shape == (PIXELS, PIXELS, 3) and (shade == 10 * step + 40 * scene).all()
                assert not (path.parent / f"{k // 100}" / f"{k % 100}" / f"{n + 1}.png").exists()
                names: list[str] = []
                file[key].visit(names.append)
                assert sorted(names) == ["actions", "obs", "obs/agent", "obs/agent/qpos"]


def test_ranges_are_those_of_all_trajectories_and_of_the_gripper(exported):
    """Eight of each; no range is nothing, or the loader would divide by it."""
    folder, out, _ = exported
    found = {name: np.array(values) for name, values in json.loads((out / STATISTICS_FILE).read_text()).items()}
    assert {len(values) for values in found.values()} == {8}
    actions = np.concatenate([s.group["actions"][()] for s in trajectories(folder)])
    assert found["action_min"][:7] == pytest.approx(actions.min(axis=0)[:7])
    assert found["action_max"][:7] == pytest.approx(actions.max(axis=0)[:7])
    assert (found["state_max"] > found["state_min"]).all() and (found["action_max"] > found["action_min"]).all()
    assert found["action_min"][7] == -1 and found["state_max"][7] == 0.04


def test_the_loaders_own_scaling_has_no_gap(exported):
    """RDT's loader takes least and largest of all rows of its own (nine joints, eight actions) and scales to -1 to 1:
    finite everywhere, the gripper closed after the first row of each trajectory."""
    _, out, tasks = exported
    states, actions = [], []
    for name in tasks:
        with h5py.File(out / name / "motionplanning" / f"{name}.h5") as file:
            states += [file[key]["obs"]["agent"]["qpos"][:] for key in file]
            actions += [file[key]["actions"][:] for key in file]
    for kind, rows in (("state", states), ("action", actions)):
        low, high = (np.concatenate(rows).min(axis=0), np.concatenate(rows).max(axis=0))
        scaled = [(one - low) / (high - low) * 2 - 1 for one in rows]
        assert all(np.isfinite(one).all() for one in scaled)
        assert all(one[0, 7] == 1 and (one[1:, 7] == -1).all() for one in scaled)
        found = json.loads((out / STATISTICS_FILE).read_text())
        assert found[f"{kind}_min"] == pytest.approx(low[:8]) and found[f"{kind}_max"] == pytest.approx(high[:8])


def test_a_task_is_one_cut_in_all_its_words(exported):
    """Each sentence of a task asks for the same cut, and no other task's does."""
    _, _, tasks = exported
    meant = {}
    for name, task in tasks.items():
        assert task["instruction"] in task["instructions"] and len(task["instructions"]) >= 5
        found = [parse_instruction(sentence, ("plum", "kiwi")) for sentence in task["instructions"]]
        assert all(same_task(found[0], other) for other in found)
        meant[name] = found[0]
    assert len(set(meant.values())) == len(tasks) > 2
    assert task_name("plum", {"pieces": 3}) == "plum-in_3"
    assert task_name("plum", {"pieces": 0, "ratio": 1 / 3, "side": "left"}) == "plum-0_3333-left"


def test_one_cut_alone_is_exported(exported, tmp_path):
    """With a part and a side only the tasks that ask for them; with a food left out none of it."""
    folder, _, tasks = exported
    made = export_rdt(folder, tmp_path / "a", backgrounds=[0], pixels=PIXELS, tasks=TaskFilter(0.75, "right"))
    wanted = {name: task["episodes"] // 2 for name, task in tasks.items() if name.endswith("0_75-right")}
    assert {name: task["episodes"] for name, task in made.items()} == wanted != {}
    made = export_rdt(folder, tmp_path / "b", backgrounds=[0], pixels=PIXELS, tasks=TaskFilter(without=("plum",)))
    assert set(made) == {name for name in tasks if name.startswith("kiwi")}
    with pytest.raises(OutputError, match="all, ratio 0.4"):
        export_rdt(folder, tmp_path / "c", backgrounds=[0], pixels=PIXELS, tasks=TaskFilter(0.4))


def test_what_cannot_be_exported_is_an_error(exported, tmp_path):
    """No background, a folder that is taken."""
    folder, out, _ = exported
    with pytest.raises(OutputError, match="--scenes"):
        export_rdt(folder, tmp_path / "more", backgrounds=[])
    with pytest.raises(OutputError, match="never overwritten"):
        export_rdt(folder, out, backgrounds=[0])
