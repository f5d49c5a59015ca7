"""A dataset on disk: ManiSkill's layout of HDF5 and JSON, with what the food did in a group ``mpm`` of each trajectory.

``shard-0000.h5`` has for trajectory k (T steps) a group ``traj_k``:

    actions (T, 8)                     joint targets [rad] and gripper, ``pd_joint_pos``
    obs/agent/qpos, qvel (T + 1, 9)    joints [rad, m] and their velocities
    obs/extra/edge (T + 1, 5)          edge: x, y, z [m], direction, angle to the board [rad]
    success, terminated, truncated (T,)
    control/command (T, 5)             commanded pose of the edge
    control/delta (T, 7)               commanded pose less the present one: x, y, z [m], roll, pitch, yaw [rad], gripper
    control/phase (T,)                 approach 0, contact 1, cut 2, hold 3, retract 4
    mpm/force (T, 5, 3)                force of the food on the knife, world axes [N], in each step of the robot's
                                       physics (100 Hz)
    mpm/force_control, impulse (T, 3)  their mean [N], and the impulse so far [N s]
    mpm/touching, severed, published (T,)
    mpm/uncut, pieces (T,)             part of the section that holds, pieces of the food
    mpm/surface/C                      food under the knife in cut C; attribute food: which one
        step (F,)                      steps after which it was kept
        vertices (F, m, 3)             half precision [m], less the attribute origin (3,)
        triangles (t, 3), flesh (m,)   flesh tells the face of the cut
    attributes of mpm: food, material (JSON), material_sha256, solver_sha256, knife, arm,
        contact_step (-1 without contact)

``shard-0000.json`` beside it lists environment and episodes as ManiSkill's does: seeds, sentences, task, success.
The force is in no group that a loader of observations or actions reads. Each data set says its unit and meaning as
attributes (:mod:`intsim.data.shard_meanings`).
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.io.folder import finite
from calib.io.meaning import describe_attributes, describe_sets
from intsim.data.demonstrate import Demonstration
from intsim.data.shard_meanings import GROUP, GROUP_ATTRIBUTES, meaning_of
from intsim.task.gym_action import GRIPPER_CLOSED
from intsim.task.planner import CONTROL_RATE, PHASES
from intsim.task.targets import Item
from mpm.files import replacing, write_atomic
from mpm.scene.shapes import Shape

SHARD_NAME = "shard-{:04d}"
EPISODE_PART = "part-{:06d}.h5"  # an episode whose shard is not complete
KEEP_KINDS = ("severed", "published", "all")
"""Which trajectories are learnt from: in pieces and by the published criteria, by these criteria, or all."""
ENTRY_ATTRIBUTE = "about"  # attribute of such a file: the entry in the JSON file


def pack_episode(demo: Demonstration, entry: Mapping[str, Any], mpm: Mapping[str, Any]) -> bytes:
    """An episode as the bytes of an HDF5 file with the content of its group.

    Args:
        demo: What was done.
        entry: Its entry in the JSON file.
        mpm: Attributes of its group ``mpm``.

    Returns:
        The bytes.
    """
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs[ENTRY_ATTRIBUTE] = json.dumps(finite(dict(entry)))
        n = len(demo.action)
        force = np.array(demo.force, np.float32).reshape(n, -1, 3)
        mean = force.mean(axis=1)
        command, edge = np.array(demo.command), np.array(demo.edge)
        change = command - edge[:-1]
        gripper = np.full(n, GRIPPER_CLOSED)
        delta = np.column_stack([change[:, :3], np.zeros(n), change[:, 4], change[:, 3], gripper])
        last = np.arange(n) == n - 1
        columns = {
            "actions": np.array(demo.action, np.float32),
            "obs/agent/qpos": np.array(demo.qpos, np.float32),
            "obs/agent/qvel": np.array(demo.qvel, np.float32),
            "obs/extra/edge": edge.astype(np.float32),
            "success": np.array(demo.published) & np.array(demo.severed),
            "terminated": np.zeros(n, bool),
            "truncated": last,
            "control/command": command.astype(np.float32),
            "control/delta": delta.astype(np.float32),
            "control/phase": np.array([PHASES.index(p) for p in demo.phase], np.int8),
            "mpm/force": force,
            "mpm/force_control": mean,
            "mpm/impulse": np.cumsum(mean, axis=0) / np.float32(CONTROL_RATE),
            "mpm/touching": np.array(demo.touching),
            "mpm/uncut": np.array(demo.uncut, np.float32),
            "mpm/pieces": np.array(demo.pieces, np.int16),
            "mpm/severed": np.array(demo.severed),
            "mpm/published": np.array(demo.published),
        }
        for name, values in columns.items():
            file.create_dataset(name, data=values, compression="gzip", shuffle=True)
        _surface(file, demo)
        touched = np.flatnonzero(demo.touching)
        attributes = {**mpm, "contact_step": int(touched[0]) if len(touched) else -1}
        for name, value in attributes.items():
            file["mpm"].attrs[name] = value
        describe_sets(file, meaning_of)
        describe_attributes(file["mpm"], GROUP, GROUP_ATTRIBUTES)
    return stream.getvalue()


def _surface(file: h5py.File, demo: Demonstration) -> None:
    """The food's surface in each step of a cut; each cut has triangles of its own."""
    cuts: list[list[int]] = []
    for k, (step, which, points, _, _) in enumerate(demo.meshes):
        before = demo.meshes[k - 1] if k else None
        if before is None or before[0] != step - 1 or before[1] != which or len(before[2]) != len(points):
            cuts.append([])
        cuts[-1].append(k)
    for n, frames in enumerate(cuts):
        group = file.create_group(f"mpm/surface/{n}")
        shown = [demo.meshes[k] for k in frames]
        group.attrs["food"] = shown[0][1]
        group["step"] = np.array([s[0] for s in shown], np.int32)
        origin = shown[0][2].mean(axis=0)
        group.attrs["origin"] = origin
        vertices = np.array([s[2] - origin for s in shown])
        group.create_dataset(
            "vertices", data=vertices.astype(np.float16), compression="gzip", compression_opts=1, shuffle=True
        )
        group.create_dataset("triangles", data=shown[0][3].astype(np.int32), compression="gzip", shuffle=True)
        group.create_dataset("flesh", data=shown[0][4])


def write_part(path: Path, content: bytes) -> None:
    """Write a file whole or not at all.

    Raises:
        OutputError: The disk is full, or the like.
    """
    try:
        write_atomic(path, content, sync=True)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror}); what was made before is there") from None


def merge_parts(
    path: Path, parts: Sequence[Path], beside: Callable[[list[dict[str, Any]]], None] = lambda entries: None
) -> None:
    """Make one file of several, each of them the group ``traj_k`` of it; a kill leaves them or the file.

    Args:
        path: The file.
        parts: The others, in order; they are removed when the file is there.
        beside: Called with what each part is said to be, before the file is there.

    Raises:
        OutputError: The disk is full, or the like.
    """
    listed = []
    try:
        with replacing(path) as draft:
            with h5py.File(draft, "w") as file:
                for k, name in enumerate(parts):
                    with h5py.File(name) as own:
                        group = file.create_group(f"traj_{k}")
                        for child in own:
                            own.copy(child, group)
                        for key in set(own.attrs) - {ENTRY_ATTRIBUTE}:
                            group.attrs[key] = own.attrs[key]
                        listed.append(json.loads(own.attrs.get(ENTRY_ATTRIBUTE, "{}")))
            beside(listed)
        for part in parts:
            part.unlink()
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e}); what was made before is there") from None


def write_shard(out: Path, number: int, indices: Sequence[int], env_info: Mapping[str, Any]) -> None:
    """Put episodes together, in order, and remove their parts.

    Args:
        out: Folder of the dataset.
        number: Of the shard.
        indices: Numbers of its trajectories.
        env_info: What the JSON file says of the environment.

    Raises:
        OutputError: The disk is full, or the like.
    """
    path = out / f"{SHARD_NAME.format(number)}.h5"
    head = {"env_info": dict(env_info), "source_type": "motionplanning", "source_desc": "cutcal"}

    def beside(listed: list[dict[str, Any]]) -> None:
        text = json.dumps(
            {**head, "episodes": [{"episode_id": k, **entry} for k, entry in enumerate(listed)]}, indent=1
        )
        path.with_suffix(".json").write_text(text + "\n", encoding="utf-8")

    merge_parts(path, [out / EPISODE_PART.format(index) for index in indices], beside)


@dataclass(frozen=True, eq=False)
class StoredTrajectory:
    """One trajectory of a dataset.

    Attributes:
        group: Its group in the HDF5 file, open while it is looked at.
        entry: What the JSON file says of it.
        shard: Number of its shard.
    """

    group: h5py.Group
    entry: dict[str, Any]
    shard: int = 0


def shard_paths(folder: Path) -> list[Path]:
    """The shards in a folder, in order.

    Raises:
        OutputError: There is none that is complete.
    """
    shards = sorted(folder.glob("shard-*.h5"))
    if not shards:
        raise OutputError(
            f"{folder}: no shards of a dataset (shard-0000.h5, ...); name the folder that was made, or finish it"
        )
    return shards


def shard_number(shard: Path) -> int:
    """The number in the name of a shard: those before it may still be missing."""
    return int(shard.stem.removeprefix("shard-"))


def shard_entries(shard: Path) -> list[dict[str, Any]]:
    """What the JSON file of a shard says of each trajectory.

    Raises:
        OutputError: It is damaged.
    """
    try:
        listed: list[dict[str, Any]] = json.loads(shard.with_suffix(".json").read_text(encoding="utf-8"))["episodes"]
    except (OSError, KeyError, ValueError) as e:
        raise OutputError(f"{shard}: damaged ({e}); make the dataset again") from None
    return listed


def trajectories(folder: Path) -> Iterator[StoredTrajectory]:
    """All trajectories of the shards in a folder, in order.

    Raises:
        OutputError: There is no complete shard, or one is damaged.
    """
    for path in shard_paths(folder):
        listed = shard_entries(path)
        try:
            with h5py.File(path) as file:
                for entry in listed:
                    yield StoredTrajectory(file[f"traj_{entry['episode_id']}"], entry, shard_number(path))
        except (OSError, KeyError, ValueError) as e:
            raise OutputError(f"{path}: damaged ({e}); make the dataset again") from None


def stored_item(listed: dict[str, Any]) -> Item:
    """A food as a dataset lists it."""
    shape = {name: value for name, value in listed.items() if name not in ("name", "x", "y", "yaw")}
    return Item(listed["name"], Shape(**shape), listed["x"], listed["y"], listed["yaw"])


def is_kept(entry: Mapping[str, Any], keep: str) -> bool:
    """Whether a trajectory is one of a kind.

    Args:
        entry: What its shard's JSON file says of it.
        keep: In :data:`KEEP_KINDS`. A trajectory whose simulation broke down is in none but ``all``.

    Raises:
        OutputError: There is no such kind.
    """
    if keep not in KEEP_KINDS:
        raise OutputError(f"keep {keep!r}: none of {', '.join(KEEP_KINDS)}")
    if keep == "all":
        return True
    return bool(entry["status"] == "done" and entry["published"] and (keep == "published" or entry["severed"]))
