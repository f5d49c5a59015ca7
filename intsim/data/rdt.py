"""Export in the layout that RDT's ManiSkill loader reads; needs the extras ``[data]`` and ``[robot]``.

    TASK/motionplanning/TASK.h5           traj_K/actions (T, 8), traj_K/obs/agent/qpos (T + 1, 9)
    TASK/motionplanning/K//100/K%100/S.png    what the front camera sees before step S, from 1

That loader knows one sentence for a task, which stands in its own source. A task here is one instruction's meaning,
such as ``orange-0_25-left``, and ``tasks.json`` has the sentence and the number of episodes of each. The loader scales
by the range of each joint and action that it finds, and the gripper, closed on the knife throughout, has none: 0 / 0.
The first row of each trajectory therefore has an open hand, joints and action, as before it closed on the handle; the
gripper moves nothing here. ``statistics.json`` has the ranges that the loader finds. The force is not in it.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.io.meaning import describe_sets
from calib.simulation.workers import Workers
from intsim.data.export_episodes import ExportEpisode, check_pictured_target, export_episodes
from intsim.data.shard_meanings import meaning_of
from intsim.data.shards import is_kept, trajectories
from intsim.task.selection import EVERY_TASK, TaskFilter

CAMERA_NAME = "front"
STATE_SIZE = 8  # of the state that RDT is given: the second finger does what the first does
GRIPPER_RANGE = {"state_min": 0.0, "state_max": 0.04, "action_min": -1.0, "action_max": 1.0}
"""Ranges of the Panda's finger [m] and of its action."""
FOLDER_EPISODES = 100  # episodes of a folder of pictures
TASKS_FILE, STATISTICS_FILE = "tasks.json", "statistics.json"


def export_rdt(
    folder: Path,
    out: Path,
    *,
    backgrounds: Sequence[int],
    pixels: int = 128,
    pool: Workers | None = None,
    say: Callable[[str], None] = lambda text: None,
    keep: str = "all",
    tasks: TaskFilter = EVERY_TASK,
) -> dict[str, Any]:
    """Write a folder for each task, tasks.json and statistics.json.

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        out: Folder that is made.
        backgrounds: Numbers of those that are rendered, at least one; each makes an episode of its own.
        pixels: Width and height of the pictures.
        pool: Where pictures are rendered that the dataset does not have yet.
        say: Called with a line after each episode.
        keep: Which trajectories, in :data:`intsim.data.shards.KEEP_KINDS`.
        tasks: Which of them by what they ask for.

    Returns:
        The content of tasks.json: by task its ``instruction``, all sentences for it in ``instructions``, and how many
        ``episodes``.

    Raises:
        CutcalError: A package or the renderer is missing, no background is named, the folder is taken or holds no
            dataset.
    """
    check_pictured_target(out, backgrounds, "RDT's input", "PIL")
    from PIL import Image

    listed: dict[str, dict[str, Any]] = {}
    for episode in export_episodes(folder, backgrounds, pixels, pool, say, keep, tasks):
        name = task_name(episode.stored.entry["food"], episode.stored.entry["task"])
        home = out / name / "motionplanning"
        known = listed.setdefault(name, {"instruction": episode.sentence, "instructions": [], "episodes": 0})
        known["instructions"] = sorted({*known["instructions"], *episode.stored.entry["instructions"]})
        k = known["episodes"]
        shown = home / str(k // FOLDER_EPISODES) / str(k % FOLDER_EPISODES)
        try:
            shown.mkdir(parents=True)
            _trajectory(home / f"{name}.h5", k, episode)
            for step, picture in enumerate(episode.pictures[CAMERA_NAME], 1):
                stream = io.BytesIO()
                Image.fromarray(picture).save(stream, "PNG")
                (shown / f"{step}.png").write_bytes(stream.getvalue())
        except OSError as e:
            raise OutputError(f"{home}: cannot be written ({e}); free some space and export again elsewhere") from None
        known["episodes"] = k + 1
    (out / STATISTICS_FILE).write_text(json.dumps(_statistics(folder, keep, tasks), indent=1) + "\n", encoding="utf-8")
    (out / TASKS_FILE).write_text(json.dumps(listed, indent=1) + "\n", encoding="utf-8")
    return listed


def _trajectory(path: Path, k: int, episode: ExportEpisode) -> None:
    """Add a trajectory to the file of its task."""
    stored = episode.stored.group
    with h5py.File(path, "a") as file:
        group = file.create_group(f"traj_{k}")
        for name, values in zip(("actions", "obs/agent/qpos"), _opened(stored), strict=True):
            group.create_dataset(name, data=values, compression="gzip", shuffle=True)
        describe_sets(group, meaning_of)
        group.attrs["scene"], group.attrs["sentence"] = episode.background, episode.sentence


def _opened(stored: h5py.Group) -> tuple[np.ndarray, np.ndarray]:
    """Actions (T, 8) and joints (T + 1, 9), with an open hand in the first row."""
    actions, joints = stored["actions"][()], stored["obs/agent/qpos"][()]
    actions[0, 7] = GRIPPER_RANGE["action_max"]
    joints[0, 7:] = GRIPPER_RANGE["state_max"]
    return actions, joints


def _statistics(folder: Path, keep: str, tasks: TaskFilter) -> dict[str, list[float]]:
    """Smallest and largest state and action of the trajectories, the gripper's of its mechanism."""
    ends: dict[str, list[float]] = {}
    for stored in (one for one in trajectories(folder) if is_kept(one.entry, keep) and tasks.keeps(one.entry)):
        for kind, name in (("state", "obs/agent/qpos"), ("action", "actions")):
            values = stored.group[name][()][:, :STATE_SIZE]
            for end, pick in (("min", np.min), ("max", np.max)):
                before = ends.get(f"{kind}_{end}")
                now = pick(values, axis=0)
                ends[f"{kind}_{end}"] = (now if before is None else pick([before, now], axis=0)).astype(float).tolist()
    return {name: [*values[:-1], GRIPPER_RANGE[name]] for name, values in ends.items()}


def task_name(food: str, task: Mapping[str, Any]) -> str:
    """Name of a task: one for all sentences that ask for the same cut of the same food."""
    if task["pieces"]:
        return f"{food}-in_{task['pieces']}"
    return f"{food}-{task['ratio']:.4g}-{task['side']}".replace(".", "_")
