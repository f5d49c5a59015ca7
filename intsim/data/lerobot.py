"""Export as a LeRobotDataset v3.0; needs the extra ``[data]``, for pictures ``[robot]`` too.

LeRobot takes every ``observation*`` for an input of the policy and every ``action*`` for its output. The force is
therefore ``contact.*``, and joints are ``extra.*``: in the data, and in no policy that was not told to look at them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import OutputError
from calib.simulation.workers import Workers
from intsim.data.cameras import CAMERA_NAMES, WORK_CAMERA
from intsim.data.dataset_card import CARD_FILE, dataset_card
from intsim.data.export_episodes import ExportEpisode, check_target, export_episodes
from intsim.data.shards import StoredTrajectory
from intsim.task.gym_action import policy_state, to_gym_action
from intsim.task.planner import CONTROL_RATE
from intsim.task.selection import EVERY_TASK, TaskFilter

CODEBASE_VERSION = "v3.0"
FILE_FRAMES = 50_000  # frames of a file of data or video
SAMPLED_PICTURES = 32  # pictures of an episode from which its statistics are found
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
POSE_NAMES = ("x", "y", "z", "roll", "pitch", "yaw")
JOINT_NAMES = tuple(f"panda_joint{k}" for k in range(1, 8))
#: Name: type, names of the components.
FEATURES: dict[str, tuple[str, tuple[str, ...] | None]] = {
    "observation.state": ("float32", (*POSE_NAMES, "pad", "gripper")),
    "action": ("float32", (*(f"d{name}" for name in POSE_NAMES), "gripper")),
    "extra.qpos": ("float32", (*JOINT_NAMES, "finger1", "finger2")),
    "extra.joint_target": ("float32", (*JOINT_NAMES, "gripper")),
    "contact.force": ("float32", ("x", "y", "z")),
    "contact.impulse": ("float32", ("x", "y", "z")),
    "contact.phase": ("int64", None),
    "contact.touching": ("bool", None),
    "cut.severed_fraction": ("float32", None),
    "cut.n_pieces": ("int64", None),
    "next.done": ("bool", None),
    "next.success": ("bool", None),
    "timestamp": ("float32", None),
    "frame_index": ("int64", None),
    "episode_index": ("int64", None),
    "index": ("int64", None),
    "task_index": ("int64", None),
}

TASK_COLUMN = "__index_level_0__"  # of meta/tasks.parquet: the sentences
SIDE_KEYS = (
    "index", "suite", "style", "demos", "food", "episode_seed", "severed", "published", "instructions",
)  # fmt: skip
"""Keys of a trajectory's entry that meta/culinary.parquet has."""


def episode_columns(stored: StoredTrajectory) -> dict[str, np.ndarray]:
    """Features of one trajectory, a row for each step, without what depends on its place in the dataset."""
    g = stored.group
    n = len(g["actions"])
    edge = g["obs/extra/edge"][()][:n]
    return {
        "observation.state": policy_state(edge).astype(np.float32),
        "action": to_gym_action(g["control/delta"][()], edge[:, 3]).astype(np.float32),
        "extra.qpos": g["obs/agent/qpos"][()][:n],
        "extra.joint_target": g["actions"][()],
        "contact.force": g["mpm/force_control"][()],
        "contact.impulse": g["mpm/impulse"][()],
        "contact.phase": g["control/phase"][()].astype(np.int64),
        "contact.touching": g["mpm/touching"][()],
        "cut.severed_fraction": 1 - g["mpm/uncut"][()],
        "cut.n_pieces": g["mpm/pieces"][()].astype(np.int64),
        "next.done": np.arange(n) == n - 1,
        "next.success": g["success"][()],
        "timestamp": (np.arange(n) / CONTROL_RATE).astype(np.float32),
        "frame_index": np.arange(n),
    }


def statistics(values: np.ndarray) -> dict[str, list[Any]]:
    """Least, largest, mean, standard deviation, count and quantiles over the rows, as LeRobot has them."""
    rows = np.asarray(values, np.float64).reshape(len(values), -1)
    found = {"min": rows.min(0), "max": rows.max(0), "mean": rows.mean(0), "std": rows.std(0)}
    found |= {name: np.quantile(rows, q, axis=0) for name, q in QUANTILES.items()}
    return {name: v.tolist() for name, v in found.items()} | {"count": [len(rows)]}


def picture_statistics(frames: np.ndarray) -> dict[str, list[Any]]:
    """The same of pictures (n, h, w, 3) by colour, in parts of 255; shape (3, 1, 1)."""
    some = frames[np.linspace(0, len(frames) - 1, min(SAMPLED_PICTURES, len(frames))).round().astype(int)]
    found = statistics(some.reshape(-1, 3) / 255)
    return {n: v if n == "count" else [[[x]] for x in v] for n, v in (found | {"count": [len(some)]}).items()}


def merge_statistics(parts: Sequence[dict[str, list[Any]]]) -> dict[str, list[Any]]:
    """Statistics of several episodes as one; quantiles are the weighted means of theirs, as LeRobot's are."""
    counts = np.array([p["count"][0] for p in parts], float)
    weight = counts / counts.sum()

    def mean(name: str) -> np.ndarray:
        return np.tensordot(weight, np.array([p[name] for p in parts]), axes=1)

    middle = mean("mean")
    square = np.tensordot(
        weight, np.array([np.square(p["std"]) + np.square(np.array(p["mean"]) - middle) for p in parts]), axes=1
    )
    out = {
        "min": np.min([p["min"] for p in parts], axis=0),
        "max": np.max([p["max"] for p in parts], axis=0),
        "mean": middle,
        "std": np.sqrt(square),
        **{name: mean(name) for name in QUANTILES},
    }
    return {name: v.tolist() for name, v in out.items()} | {"count": [int(counts.sum())]}


def export_lerobot(
    folder: Path,
    out: Path,
    *,
    backgrounds: Sequence[int] = (),
    pixels: int = 128,
    pool: Workers | None = None,
    say: Callable[[str], None] = lambda text: None,
    keep: str = "all",
    tasks: TaskFilter = EVERY_TASK,
    work_camera: bool = False,
) -> dict[str, Any]:
    """Write a LeRobotDataset v3.0.

    Each trajectory is an episode for each background and each of its sentences: those of one background have the same
    video. Its task, material and seed are in ``meta/culinary.parquet``. An action is one of ``pd_ee_delta_pose``
    (:mod:`intsim.task.gym_action`).

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        out: Folder that is made.
        backgrounds: Numbers of those that are rendered; without any there are no pictures.
        pixels: Width and height of the pictures.
        pool: Where pictures are rendered that the dataset does not have yet.
        say: Called with a line after each episode.
        keep: Which trajectories, in :data:`intsim.data.shards.KEEP_KINDS`.
        tasks: Which of them by what they ask for.
        work_camera: Whether the close camera's pictures are there, beside those of the published three.

    Returns:
        The content of meta/info.json.

    Raises:
        CutcalError: pyarrow or av is not installed, there is no renderer, the folder is taken or holds no dataset.
    """
    try:
        import av  # noqa: F401
        import pyarrow  # noqa: F401
    except ImportError as e:
        raise OutputError(f"dataset export: {e.name} is not installed; pip install 'cutcal[data]'") from None
    check_target(out, backgrounds)
    cameras = (*CAMERA_NAMES, WORK_CAMERA) if work_camera else CAMERA_NAMES
    writer = _Writer(out, pixels, cameras if backgrounds else ())
    for episode in export_episodes(folder, backgrounds, pixels, pool, say, keep, tasks, cameras):
        writer.add(episode)
    return writer.close()


class _Writer:
    """A LeRobotDataset as it grows.

    Args:
        out: Its folder.
        pixels: Width and height of its pictures.
        cameras: Names of the cameras, none without pictures.
    """

    def __init__(self, out: Path, pixels: int, cameras: Sequence[str]) -> None:
        self.out, self.pixels, self.cameras = out, pixels, cameras
        self.tasks: dict[str, int] = {}
        self.episodes: list[dict[str, Any]] = []
        self.side: list[dict[str, Any]] = []
        self.parts: dict[str, list[dict[str, list[Any]]]] = {}
        self.rows: list[dict[str, np.ndarray]] = []
        self.frames, self.file, self.in_file, self.shown = 0, 0, 0, 0  # shown: pictures of a camera in this file
        self.videos: dict[str, _Video] = {}

    def add(self, episode: ExportEpisode) -> None:
        """Add a trajectory before a background: an episode for each sentence, all with the same pictures."""
        found = episode_columns(episode.stored)
        n, sentences = len(found["timestamp"]), episode.sentences
        if self.in_file and self.in_file + len(sentences) * n > FILE_FRAMES:
            self._roll()
        videos: dict[str, Any] = {}
        shown: dict[str, dict[str, list[Any]]] = {}
        for camera, frames in episode.pictures.items():
            key = f"observation.images.{camera}"
            videos |= self._add_frames(key, frames)
            shown[key] = picture_statistics(frames)
        if episode.pictures:
            self.shown += n
        for sentence in sentences:
            self._add_told(episode, found, sentence, videos, shown)

    def _add_told(
        self,
        episode: ExportEpisode,
        columns: dict[str, np.ndarray],
        sentence: str,
        videos: dict[str, Any],
        shown: dict[str, dict[str, list[Any]]],
    ) -> None:
        """Add the episode of one sentence, whose pictures are in the video."""
        n, number = len(columns["timestamp"]), len(self.episodes)
        found = columns | {
            "episode_index": np.full(n, number),
            "index": self.frames + np.arange(n),
            "task_index": np.full(n, self.tasks.setdefault(sentence, len(self.tasks))),
        }
        self.rows.append(found)
        own = {name: statistics(values) for name, values in found.items()} | shown
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [sentence],
            "length": n,
            "data/chunk_index": 0,
            "data/file_index": self.file,
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + n,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            **videos,
        }
        for name, values in own.items():
            self.parts.setdefault(name, []).append(values)
            row |= {f"stats/{name}/{kind}": v for kind, v in values.items()}
        self.episodes.append(row)
        self.side.append(_side_row(episode, number))
        self.frames, self.in_file = self.frames + n, self.in_file + n

    def _add_frames(self, key: str, frames: np.ndarray) -> dict[str, Any]:
        """Append pictures (n, h, w, 3) to the video of a feature; returns where they are in it."""
        if key not in self.videos:
            self.videos[key] = _Video(self.out / f"videos/{key}/chunk-000/file-{self.file:03d}.mp4", self.pixels)
        self.videos[key].add(frames)
        return {
            f"videos/{key}/chunk_index": 0,
            f"videos/{key}/file_index": self.file,
            f"videos/{key}/from_timestamp": self.shown / CONTROL_RATE,
            f"videos/{key}/to_timestamp": (self.shown + len(frames)) / CONTROL_RATE,
        }

    def close(self) -> dict[str, Any]:
        """Write what is left, and all of ``meta``; returns info.json."""
        import pyarrow as pa

        self._roll()
        meta, info = self.out / "meta", self._info()
        _parquet(meta / "episodes/chunk-000/file-000.parquet", pa.Table.from_pylist(self.episodes))
        tasks = pa.table({"task_index": list(self.tasks.values()), TASK_COLUMN: list(self.tasks)})
        _parquet(meta / "tasks.parquet", tasks.replace_schema_metadata({b"pandas": json.dumps(_task_index()).encode()}))
        _parquet(meta / "culinary.parquet", pa.Table.from_pylist(self.side))
        stats = {name: merge_statistics(parts) for name, parts in self.parts.items()}
        (meta / "stats.json").write_text(json.dumps(stats, indent=1) + "\n", encoding="utf-8")
        (meta / "info.json").write_text(json.dumps(info, indent=1) + "\n", encoding="utf-8")
        (self.out / CARD_FILE).write_text(dataset_card(info, stats, self.side), encoding="utf-8")
        return info

    def _info(self) -> dict[str, Any]:
        """Content of info.json."""
        features: dict[str, Any] = {
            name: {"dtype": kind, "shape": [len(names) if names else 1], "names": list(names) if names else None}
            for name, (kind, names) in FEATURES.items()
        }
        features |= {f"observation.images.{camera}": self._video_feature() for camera in self.cameras}
        videos = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
        return {
            "codebase_version": CODEBASE_VERSION,
            "robot_type": "panda",
            "total_episodes": len(self.episodes),
            "total_frames": self.frames,
            "total_tasks": len(self.tasks),
            "chunks_size": 1000,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": round(CONTROL_RATE),
            "splits": {"train": f"0:{len(self.episodes)}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": videos if self.cameras else None,
            "features": features,
        }

    def _video_feature(self) -> dict[str, Any]:
        about = {
            "video.height": self.pixels,
            "video.width": self.pixels,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": round(CONTROL_RATE),
            "video.channels": 3,
            "has_audio": False,
        }
        size = [self.pixels, self.pixels, 3]
        return {"dtype": "video", "shape": size, "names": ["height", "width", "channels"], "info": about}

    def _roll(self) -> None:
        """End the present files."""
        import pyarrow as pa

        if self.rows:
            arrays = {}
            for name, (kind, names) in FEATURES.items():
                values = np.concatenate([row[name] for row in self.rows])
                if names is None:
                    arrays[name] = pa.array(values.astype(kind))
                else:
                    arrays[name] = pa.FixedSizeListArray.from_arrays(pa.array(values.astype(kind).ravel()), len(names))
            _parquet(self.out / f"data/chunk-000/file-{self.file:03d}.parquet", pa.table(arrays))
        for video in self.videos.values():
            video.close()
        self.rows, self.videos = [], {}
        self.file, self.in_file, self.shown = self.file + 1, 0, 0


def _side_row(episode: ExportEpisode, number: int) -> dict[str, Any]:
    """A row of meta/culinary.parquet: what LeRobot has no place for."""
    entry, task = episode.stored.entry, episode.stored.entry["task"]
    return {
        "episode_index": number,
        "scene": -1 if episode.background is None else episode.background,
        "material": episode.stored.group["mpm"].attrs["material"],
        **{name: entry[name] for name in SIDE_KEYS},
        **{name: task[name] for name in ("ratio", "side", "pieces")},
        "peak_N": entry["peak_N"],
    }


def _task_index() -> dict[str, Any]:
    """What pandas wants to know of meta/tasks.parquet: the sentences are its index."""
    columns = (("task_index", "task_index", "int64", "int64"), (None, TASK_COLUMN, "unicode", "object"))
    return {
        "index_columns": [TASK_COLUMN],
        "column_indexes": [],
        "pandas_version": "2.2.0",
        "columns": [
            {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": dtype, "metadata": None}
            for name, field, kind, dtype in columns
        ],
    }


class _Video:
    """Pictures one after the other in an mp4 file, every second one a key frame, at times that are exact.

    Args:
        path: The file.
        pixels: Width and height.
    """

    def __init__(self, path: Path, pixels: int) -> None:
        import av

        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = av.open(str(path), "w")
        self._stream = self._file.add_stream("libx264", rate=round(CONTROL_RATE), options={"crf": "18", "g": "2"})
        self._stream.width = self._stream.height = pixels
        self._stream.pix_fmt = "yuv420p"
        self._count = 0

    def add(self, frames: np.ndarray) -> None:
        """Append pictures (n, h, w, 3)."""
        import av

        for one in frames:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(one), format="rgb24")
            frame.pts = self._count
            self._count += 1
            self._file.mux(self._stream.encode(frame))

    def close(self) -> None:
        """End the file."""
        self._file.mux(self._stream.encode())
        self._file.close()


def _parquet(path: Path, table: Any) -> None:
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)
