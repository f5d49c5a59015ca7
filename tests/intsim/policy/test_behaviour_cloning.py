"""A policy that was learnt: what it is given and gives, its file, and that learning does what demonstrations did."""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np
import pytest

from calib.errors import OutputError
from calib.material.food import load_food
from cutcal.main import main
from intsim.data.demonstrate import Demonstration
from intsim.data.manifest import Manifest
from intsim.data.shards import EPISODE_PART, pack_episode, write_part, write_shard
from intsim.evaluate import PolicyEvaluation, evaluate, roll_out
from intsim.policy.behaviour_cloning import (
    ACTION_CHUNK,
    Clone,
    bag_of_words,
    from_food_frame,
    observed_features,
    to_food_frame,
    tokens,
)
from intsim.task.language import instructions
from intsim.task.planner import HOME, plan_cut
from intsim.task.selection import TaskFilter, TrainingTasks
from intsim.task.suites import sample_episode
from intsim.task.targets import Item, TaskError, target

ORANGE = {"orange": load_food("orange")}
GIVEN = 13  # numbers beside the words


def item(yaw: float = 1.2) -> Item:
    """An orange somewhere."""
    return Item("orange", load_food("orange").to_scene_food().shape, 0.03, -0.07, yaw)


@pytest.mark.parametrize("yaw", [0.3, 1.2, 2.9])
@pytest.mark.parametrize("turn", [-1.5, 0.0, 0.7, 1.57])
def test_a_pose_seen_from_a_food_comes_back(yaw, turn):
    """Place, height and direction; an edge that is turned round is the same edge."""
    pose = np.array([0.1, 0.2, 0.05, turn, 0.0])
    food = item(yaw)
    back = from_food_frame(to_food_frame(pose, food), food)
    assert back[:3] == pytest.approx(pose[:3], abs=1e-12)
    assert math.sin(back[3] - turn) == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(to_food_frame(pose + [0, 0, 0, math.pi, 0], food), to_food_frame(pose, food))


def test_what_is_seen_turns_with_the_food():
    """A scene that is moved and turned as a whole looks the same; two poses a step apart give the way between them."""
    food, c, s = item(1.2), math.cos(0.4), math.sin(0.4)
    pose, before = np.array([0.1, 0.0, 0.2, 0.3, 0.0]), np.array([0.09, 0.0, 0.21, 0.3, 0.0])

    def moved(p: np.ndarray) -> np.ndarray:
        return np.array([c * p[0] - s * p[1] + 0.1, s * p[0] + c * p[1] - 0.2, p[2], p[3] + 0.4, 0.0])

    other = Item("orange", food.shape, *moved(np.array([food.x, food.y, 0, 0, 0]))[:2], food.yaw + 0.4)
    assert np.allclose(observed_features(moved(pose), moved(before), other), observed_features(pose, before, food))
    assert observed_features(pose, before, food).shape == (GIVEN,)


def constant(pose: np.ndarray, food: Item, words: tuple[str, ...] = ("cut",)) -> Clone:
    """A clone that always wants to be there."""
    goal = np.tile(to_food_frame(pose, food), ACTION_CHUNK)
    return Clone(words, [(np.zeros((len(goal), GIVEN + len(words))), goal)], {"trajectories": 1})


def test_it_goes_where_its_network_says_and_stops_when_it_is_back_up():
    """Changes are from where the edge is; nothing but pose and foods is looked at; down and up again ends the episode,
    as the time does."""
    food = item()
    goal = np.array([*food.at(0.01), 0.02, food.yaw - math.pi / 2, 0.0])
    clone = constant(goal, food)
    clone.reset(0)
    here = np.array([*HOME, 0.0, 0.0])
    change = clone.act({"pose": here, "items": (food,)}, "cut the orange")
    assert change is not None and change.shape == (7,)
    assert here[:3] + change[:3] == pytest.approx(goal[:3], abs=1e-9)
    assert math.sin(here[3] + change[5] - goal[3]) == pytest.approx(0, abs=1e-9) and abs(change[5]) <= math.pi / 2
    assert clone.act({"pose": goal, "items": (food,)}, "cut the orange") is not None
    assert clone.act({"pose": here, "items": (food,)}, "cut the orange") is None
    clone.reset(0)
    steps = 0
    while clone.act({"pose": here, "items": (food,)}, "cut the orange") is not None:
        steps += 1
    assert steps == 240


def test_it_looks_at_the_food_that_is_named():
    """Among several; a grape is no shine muscat."""
    shape = item().shape
    foods = tuple(Item(name, shape, 0.1 * k, 0.0) for k, name in enumerate(("grape", "shine_muscat", "orange")))
    clone = constant(np.array([0.0, 0.0, 0.1, 0.0, 0.0]), foods[0])
    names = [clone._food(foods, f"cut half of the {w} from the left").name for w in ("shine muscat", "grape", "orange")]
    assert names == ["shine_muscat", "grape", "orange"]


def test_a_file_keeps_it(tmp_path):
    """Every number and word; another file or none is one error."""
    clone = constant(np.array([0.0, 0.0, 0.1, 0.0, 0.0]), item(), ("cut", "1/4", "left"))
    clone.save(tmp_path / "deep" / "c.npz")
    back = Clone.load(tmp_path / "deep" / "c.npz")
    assert back.vocabulary == clone.vocabulary and back.about == clone.about
    for one, two in zip(clone.weights, back.weights, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
    (tmp_path / "bad.npz").write_text("no")
    for name in ("bad.npz", "none.npz"):
        with pytest.raises(OutputError, match="not a trained clone"):
            Clone.load(tmp_path / name)


def test_words_and_numbers_are_told_apart():
    """Fractions and percentages are words of their own; order and capitals do not matter."""
    assert tokens("Cut 1/4 of the orange, 25% or 0.25") == ["cut", "1/4", "of", "the", "orange", "25%", "or", "0.25"]
    assert bag_of_words("left cut", ("cut", "left", "right")).tolist() == [1, 1, 0]


def test_the_command_line_says_what_is_wrong(tmp_path, capsys):
    """Weights without clone and the other way round; options of another world; no dataset; a file that is there."""
    for words, said in (
        (["evaluate", "--policy", "clone"], "--weights"),
        (["evaluate", "--weights", "w.npz"], "--weights"),
        (["evaluate", "--stiffness", "500"], "--world intsim"),
        (["evaluate", "--world", "intsim", "--severing"], "--severing"),
        (["dataset", "clone", "--out", str(tmp_path / "c.npz")], "name the folder"),
        (["dataset", "clone", str(tmp_path), "--out", str(tmp_path)], "never overwritten"),
    ):
        assert main(words) == 1
        assert said in capsys.readouterr().err


def dataset(folder, count: int) -> None:
    """Planned presses of oranges in half, whose edge is where it is commanded."""
    manifest = Manifest(count, foods=("orange",), suites=("seeds",), styles=("press",))
    folder.mkdir()
    for k in range(count):
        episode = sample_episode("seeds", k, ORANGE)
        path = plan_cut(episode.item, target(episode.spec, episode.item))
        track = Demonstration()
        track.edge = [np.array([*HOME, 0.0, 0.0]), *path.pose]
        n = len(path.pose)
        track.command, track.phase = list(path.pose), [str(p) for p in path.phase]
        track.qpos = track.qvel = [np.zeros(9)] * (n + 1)
        track.action, track.force = [np.zeros(8)] * n, [np.zeros((5, 3))] * n
        track.touching = track.published = track.severed = [False] * n
        track.uncut, track.pieces = [1.0] * n, [1] * n
        i = episode.item
        about = {
            "status": "done" if k else "broken",
            "published": True,
            "severed": k % 2 == 0,
            "demos": "planned",
            "task": {**asdict(episode.spec), "ratio": float(episode.spec.ratio)},
            "items": [{"name": i.name, "x": i.x, "y": i.y, "yaw": i.yaw, **vars(i.shape)}],
            "instructions": instructions(episode.spec, k),
        }
        write_part(folder / EPISODE_PART.format(k), pack_episode(track, about, {}))
    write_shard(folder, 0, range(count), {})
    assert manifest.trajectory(1).style == "press"


def test_it_learns_to_do_what_is_demonstrated(tmp_path):
    """From 60 planned cuts: most of unseen oranges are cut where they should be, all to the board and across; a broken
    trajectory and uncut food are left out; the same seed gives the same weights."""
    pytest.importorskip("torch", reason="the extra [robot] is not installed")
    from intsim.policy.training import train

    dataset(tmp_path / "d", 60)
    clone = train(tmp_path / "d", keep="published")
    assert clone.about["trajectories"] == 59
    found = evaluate(PolicyEvaluation(clone, "clone", ORANGE, ["seeds"], 60), tmp_path / "e").suites["seeds"]
    assert found.published.rate > 0.6 and found.criteria["angle"].rate > 0.9
    few = train(tmp_path / "d", keep="severed", most=3)
    again = train(tmp_path / "d", keep="severed", most=3)
    assert few.about["trajectories"] == 3
    assert all(np.array_equal(a[0], b[0]) for a, b in zip(few.weights, again.weights, strict=True))
    few.save(tmp_path / "few.npz")
    one, two = (
        roll_out(c, sample_episode("seeds", 1_000_001, ORANGE))[0] for c in (few, Clone.load(tmp_path / "few.npz"))
    )
    assert np.array_equal(one.pose, two.pose)
    with pytest.raises(OutputError, match="keep"):
        train(tmp_path / "d", keep="most")
    right = train(tmp_path / "d", keep="published", tasks=TaskFilter(side="right"))
    asked = [sample_episode("seeds", k, ORANGE).spec.side for k in range(1, 60)]
    assert right.about["trajectories"] == asked.count("right") and "left" not in right.vocabulary
    assert right.trained == TrainingTasks("planned", None, "right", (), ("orange",)) and "side right" in right.name
    right.save(tmp_path / "right.npz")
    assert Clone.load(tmp_path / "right.npz").trained == right.trained
    with pytest.raises(TaskError, match="published, without orange"):
        train(tmp_path / "d", keep="published", tasks=TaskFilter(without=("orange",)))
    assert (
        main(["dataset", "clone", str(tmp_path / "d"), "--most", "2", "--out", str(tmp_path / "c.npz"), "--json"]) == 0
    )
