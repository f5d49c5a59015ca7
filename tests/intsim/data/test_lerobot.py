"""The export for LeRobot: what its reader needs is there, equal to what was stored, and force is nothing that a policy
learns from."""

from __future__ import annotations

import json

import numpy as np
import pytest

from calib.errors import OutputError
from intsim.data import generate as g
from intsim.data.cameras import CAMERA_NAMES
from intsim.data.dataset_document import DatasetSpec
from intsim.data.lerobot import FEATURES, episode_columns, export_lerobot, merge_statistics, statistics
from intsim.data.manifest import Manifest
from intsim.data.shards import is_kept, trajectories
from intsim.task.planner import CONTROL_RATE
from tests.intsim.data.test_generate import Inline
from tests.intsim.painter import PIXELS, Here, Painter, paint_with

pq = pytest.importorskip("pyarrow.parquet", reason="the extra [data] is not installed")
av = pytest.importorskip("av", reason="the extra [data] is not installed")


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """Three made-up trajectories."""
    monkeypatch.setattr(g, "require_simulator", lambda: None)
    g.generate(DatasetSpec(Manifest(trajectories=3), shard=2), tmp_path / "set", Inline())
    return tmp_path / "set"


@pytest.fixture
def painted(stored, tmp_path, monkeypatch):
    """Their export before two backgrounds."""
    paint_with(Painter, monkeypatch)
    info = export_lerobot(stored, tmp_path / "lr", backgrounds=[0, 2], pixels=PIXELS, pool=Here())
    return tmp_path / "lr", info


def test_the_columns_are_what_was_stored(stored, painted):
    """Episode by episode, value by value, with indices that run on; every feature of info.json has its column and
    statistics."""
    out, info = painted
    table = pq.read_table(out / "data/chunk-000/file-000.parquet").to_pydict()
    assert info == json.loads((out / "meta/info.json").read_text())
    told = [len(one.entry["instructions"]) for one in trajectories(stored)]
    assert min(told) >= 5 and info["total_episodes"] == 2 * sum(told) and info["total_frames"] == len(table["index"])
    assert table["index"] == list(range(info["total_frames"]))
    first = 0
    every = [one for one, times in zip(trajectories_of(stored), told, strict=True) for _ in range(times)]
    for place, one in enumerate([*every, *every]):
        n = len(one["timestamp"])
        for name, values in one.items():
            assert np.array_equal(np.array(table[name][first : first + n]), values), name
        assert set(table["episode_index"][first : first + n]) == {place}
        first += n
    stats = json.loads((out / "meta/stats.json").read_text())
    plain = set(table)
    assert plain == set(FEATURES) and set(info["features"]) == set(stats) == plain | {
        f"observation.images.{v}" for v in CAMERA_NAMES
    }
    for name, feature in info["features"].items():
        if feature["dtype"] not in ("video", "bool"):
            whole = np.array(table[name], float).reshape(first, -1)
            assert feature["shape"] == [whole.shape[1]]
            assert stats[name]["mean"] == pytest.approx(whole.mean(axis=0).tolist())
            assert stats[name]["std"] == pytest.approx(whole.std(axis=0).tolist())
            assert stats[name]["count"] == [first]


def trajectories_of(folder) -> list[dict[str, np.ndarray]]:
    """Columns of each, while its file is open."""
    return [episode_columns(one) for one in trajectories(folder)]


def test_pictures_are_found_by_their_time(painted):
    """Frame n of a video is at n / fps; each episode's begin where the table of episodes says, before its own
    background."""
    out, info = painted
    episodes = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for view in CAMERA_NAMES:
        key = f"observation.images.{view}"
        with av.open(str(out / f"videos/{key}/chunk-000/file-000.mp4")) as file:
            frames = [(float(f.time), f.to_ndarray(format="rgb24")) for f in file.decode(video=0)]
        seen = {e[f"videos/{key}/from_timestamp"]: e["length"] for e in episodes}
        assert len(frames) == sum(seen.values()) < info["total_frames"] / 4, "a video for all sentences"
        assert np.allclose([t for t, _ in frames], np.arange(len(frames)) / CONTROL_RATE, atol=1e-4)
        for e in episodes:
            begin = round(e[f"videos/{key}/from_timestamp"] * CONTROL_RATE)
            scene = 0 if e["episode_index"] < len(episodes) / 2 else 2
            for k in (0, e["length"] - 1):
                assert frames[begin + k][1].mean() == pytest.approx((10 * k + 40 * scene) % 256, abs=3)


def test_force_is_nothing_that_a_policy_learns_from(painted):
    """LeRobot takes ``observation*`` for inputs and ``action*`` for outputs: pose, pictures and commanded change alone
    are."""
    _, info = painted
    learned = {n for n in info["features"] if n.startswith(("observation", "action"))}
    assert learned == {"observation.state", "action", *(f"observation.images.{v}" for v in CAMERA_NAMES)}
    assert {"contact.force", "contact.impulse", "extra.qpos"} <= set(info["features"])


def test_the_card_says_what_is_in_it(stored, painted, tmp_path):
    """Licence by whether meshes of others are seen, counts of episodes and outcomes, and statistics of each component;
    the head is one that a hub reads."""
    import yaml

    out, info = painted
    card = (out / "README.md").read_text()
    head = yaml.safe_load(card.split("---\n")[1])
    assert head["license"] == "cc-by-nc-4.0" and "LeRobot" in head["tags"]
    entries = [one.entry for one in trajectories(stored)]
    severed = 2 * sum(len(e["instructions"]) * e["severed"] for e in entries)
    for line in (
        f"| episodes | {info['total_episodes']} |",
        "| trajectories | 3 |",
        "| backgrounds | 2 |",
        f"| end with the food in pieces | {severed} |",
    ):
        assert line in card, line
    stats = json.loads((out / "meta/stats.json").read_text())
    assert f"| `contact.force` | z | {stats['contact.force']['min'][2]:.4g} |" in card
    assert card.count("| `observation.state` |") == 8 and card.count("| `action` |") == 7
    export_lerobot(stored, tmp_path / "bare")
    assert "license: mit" in (tmp_path / "bare" / "README.md").read_text()


def test_tasks_are_looked_up_by_their_row(painted):
    """Row n of tasks.parquet is task n, the sentence its index; a trajectory is there in all of its sentences before
    each background, and begins with another one."""
    out, info = painted
    tasks = pq.read_table(out / "meta/tasks.parquet")
    frame = tasks.to_pandas()
    assert frame["task_index"].tolist() == list(range(info["total_tasks"]))
    episodes = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert {e["tasks"][0] for e in episodes} == set(frame.index)
    side = pq.read_table(out / "meta/culinary.parquet").to_pylist()
    half = len(episodes) // 2
    assert episodes[0]["tasks"] != episodes[half]["tasks"]
    assert [s["scene"] for s in side] == [0] * half + [2] * half
    for scene in (0, 2):
        for index in range(3):
            own = [k for k, s in enumerate(side) if (s["scene"], s["index"]) == (scene, index)]
            assert sorted(episodes[k]["tasks"][0] for k in own) == sorted(side[own[0]]["instructions"])


def test_without_pictures_there_are_no_videos(stored, tmp_path):
    """No renderer is asked for."""
    info = export_lerobot(stored, tmp_path / "bare")
    assert info["video_path"] is None and not (tmp_path / "bare/videos").exists()
    assert not [n for n in info["features"] if "images" in n]


def test_statistics_of_parts_are_those_of_the_whole():
    """Mean and standard deviation exactly, least and largest too."""
    rng = np.random.default_rng(0)
    parts = [rng.normal(k, 1 + k, (10 * (k + 1), 2)) for k in range(3)]
    both, whole = merge_statistics([statistics(p) for p in parts]), statistics(np.concatenate(parts))
    for name in ("min", "max", "mean", "std", "count"):
        assert both[name] == pytest.approx(whole[name])


def test_a_wrong_scene_or_a_taken_folder_is_an_error(stored, tmp_path):
    """Before anything is written."""
    with pytest.raises(OutputError, match="0 to 14"):
        export_lerobot(stored, tmp_path / "x", backgrounds=[15])
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").touch()
    with pytest.raises(OutputError, match="never overwritten"):
        export_lerobot(stored, tmp_path / "full")
    assert not (tmp_path / "x").exists()


def test_actions_are_the_environments(stored, painted):
    """A commanded change of 0.1 m is 1, as ``pd_ee_delta_pose`` has it."""
    out, _ = painted
    table = pq.read_table(out / "data/chunk-000/file-000.parquet").to_pydict()
    for one in trajectories(stored):
        first = one.group["control/delta"][()]
        break
    found = np.array(table["action"][: len(first)])
    assert found[:, :3] == pytest.approx(first[:, :3] / 0.1, abs=1e-6) and found[:, 5] == pytest.approx(
        -first[:, 5] / 0.1
    )
    assert np.array_equal(found[:, 6], first[:, 6]) and np.abs(first[:, :3]).max() > 0


def test_failed_demonstrations_stay_out_where_they_are_not_wanted(stored, tmp_path):
    """Those in pieces alone, or by the published criteria too, or all; none that is kept is one line."""
    entries = [one.entry for one in trajectories(stored)]
    one = {"status": "done", "published": True, "severed": False}
    assert [is_kept(one, keep) for keep in ("severed", "published", "all")] == [False, True, True]
    broken = {**one, "severed": True, "status": "stopped"}
    assert [is_kept(broken, keep) for keep in ("severed", "published", "all")] == [False, False, True]
    info = export_lerobot(stored, tmp_path / "kept", keep="severed")
    wanted = [e for e in entries if is_kept(e, "severed")]
    assert info["total_episodes"] == sum(len(e["instructions"]) for e in wanted)
    with pytest.raises(OutputError, match="none of"):
        export_lerobot(stored, tmp_path / "x", keep="good")
