"""Export as RLDS, the TFDS layout that OpenVLA and Octo read; needs the extras ``[data]`` and ``[robot]``.

It needs no TensorFlow. A record is a ``tf.train.Example`` for each episode, its steps end to end, written here by hand:
a message of one map from names to lists, and TFRecord's frame of length and checksum. The force is not in it.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from calib.simulation.workers import Workers
from intsim.data.cameras import CAMERA_NAMES
from intsim.data.export_episodes import ExportEpisode, check_pictured_target, export_episodes
from intsim.data.lerobot import episode_columns
from intsim.task.language import SENTENCES_PER_TASK
from intsim.task.selection import EVERY_TASK, TaskFilter

DATASET_NAME, DATASET_VERSION = "cutcal", "1.0.0"
VALIDATION_STRIDE = 20  # every so many-th trajectory is kept for validation
JPEG_QUALITY = 95  # of the JPEG pictures
CRC_MASK = 0xA282EAD8  # of TFRecord's checksums
LANGUAGE_KEYS = ("language_instruction", *(f"language_instruction_{k}" for k in range(2, SENTENCES_PER_TASK + 1)))
"""Names of the sentences of a step."""
FEATURE_CLASS = "tensorflow_datasets.core.features."


def export_rlds(
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
    """Write ``cutcal/1.0.0`` with the splits train and val.

    Each step has the observation, the action (one of ``pd_ee_delta_pose``, :mod:`intsim.task.gym_action`), reward,
    discount, the flags of its place, and the sentence, with the others that ask for the same beside it
    (``language_instruction_2`` to ``_5``): a loader of Octo draws one of ``language_instruction*``. The observation is
    the pictures ``image``, ``side_image`` and ``wrist_image``, and ``state``: x y z roll pitch yaw pad gripper. ``val``
    are whole trajectories, before every background.

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        out: Folder that is made.
        backgrounds: Numbers of those that are rendered, at least one.
        pixels: Width and height of the pictures.
        pool: Where pictures are rendered that the dataset does not have yet.
        say: Called with a line after each episode.
        keep: Which trajectories, in :data:`intsim.data.shards.KEEP_KINDS`.
        tasks: Which of them by what they ask for.

    Returns:
        The content of dataset_info.json.

    Raises:
        CutcalError: A package or the renderer is missing, no background is named, the folder is taken or holds no
            dataset.
    """
    check_pictured_target(out, backgrounds, "RLDS", "google_crc32c", "PIL")
    shown = export_episodes(folder, backgrounds, pixels, pool, say, keep, tasks)
    home = out / DATASET_NAME / DATASET_VERSION
    home.mkdir(parents=True)
    counts, sizes = {"train": 0, "val": 0}, {"train": 0, "val": 0}
    files = {split: (home / _file(split)).open("wb") for split in counts}
    try:
        for episode in shown:
            last = episode.stored.entry["index"] % VALIDATION_STRIDE == VALIDATION_STRIDE - 1
            split = "val" if last else "train"
            sizes[split] += write_record(files[split], encode_example(episode_lists(episode)))
            counts[split] += 1
    finally:
        for file in files.values():
            file.close()
    for split in [s for s, n in counts.items() if n == 0]:
        (home / _file(split)).unlink()
    info = _info(counts, sizes)
    (home / "dataset_info.json").write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")
    (home / "features.json").write_text(json.dumps(features(pixels), indent=2) + "\n", encoding="utf-8")
    return info


def _info(counts: Mapping[str, int], sizes: Mapping[str, int]) -> dict[str, Any]:
    """Content of dataset_info.json, from the number of episodes and bytes of each split."""
    return {
        "name": DATASET_NAME,
        "version": DATASET_VERSION,
        "description": "Cuts of food by a simulated Panda, told in words.",
        "fileFormat": "tfrecord",
        "splits": [
            {
                "name": split,
                "numBytes": str(sizes[split]),
                "shardLengths": [str(n)],
                "filepathTemplate": "{DATASET}-{SPLIT}.{FILEFORMAT}-{SHARD_X_OF_Y}",
            }
            for split, n in counts.items()
            if n
        ],
    }


def _file(split: str) -> str:
    return f"{DATASET_NAME}-{split}.tfrecord-00000-of-00001"


def episode_lists(episode: ExportEpisode) -> dict[str, list[bytes] | np.ndarray]:
    """The lists of one episode by name."""
    found = episode_columns(episode.stored)
    n = len(found["timestamp"])
    step, index = np.arange(n), episode.stored.entry["index"]
    out: dict[str, list[bytes] | np.ndarray] = {
        f"steps/observation/{name}": [_jpeg(picture) for picture in episode.pictures[camera]]
        for camera, name in zip(CAMERA_NAMES, ("image", "side_image", "wrist_image"), strict=True)
    }
    done = (step == n - 1) & bool(episode.stored.entry["success"])
    return out | {
        "steps/observation/state": found["observation.state"],
        "steps/action": found["action"],
        "steps/reward": done.astype(np.float32),
        "steps/discount": np.ones(n, np.float32),
        "steps/is_first": step == 0,
        "steps/is_last": step == n - 1,
        "steps/is_terminal": done,
        **{f"steps/{key}": [text.encode()] * n for key, text in zip(LANGUAGE_KEYS, _told(episode), strict=True)},
        "episode_metadata/file_path": [f"trajectory {index}, background {episode.background}".encode()],
    }


def _told(episode: ExportEpisode) -> list[str]:
    """As many sentences as there are keys, the first again where a task has fewer."""
    own = episode.sentences
    return [own[k % len(own)] for k in range(SENTENCES_PER_TASK)]


def _jpeg(picture: np.ndarray) -> bytes:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="JPEG", quality=JPEG_QUALITY)
    return stream.getvalue()


def encode_example(lists: Mapping[str, list[bytes] | np.ndarray]) -> bytes:
    """A ``tf.train.Example`` as protocol buffer: bytes, floats, or integers and flags by name."""
    entries = b""
    for name, values in lists.items():
        if isinstance(values, list):
            feature = _field(1, b"".join(_field(1, value) for value in values))
        elif values.dtype.kind == "f":
            feature = _field(2, _field(1, values.astype("<f4").tobytes()))
        else:
            feature = _field(3, _field(1, b"".join(_varint(int(v)) for v in values.ravel())))
        entries += _field(1, _field(1, name.encode()) + _field(2, feature))
    return _field(1, entries)


def _field(number: int, content: bytes) -> bytes:
    """A field with a length before it."""
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def write_record(file: BinaryIO, content: bytes) -> int:
    """Append a record with TFRecord's frame; returns the size of its content [bytes]."""
    length = struct.pack("<Q", len(content))
    file.write(length + _checksum(length) + content + _checksum(content))
    return len(content)


def _checksum(content: bytes) -> bytes:
    import google_crc32c

    crc = google_crc32c.value(content)
    return struct.pack("<I", ((crc >> 15 | crc << 17) + CRC_MASK) & 0xFFFFFFFF)


def features(pixels: int) -> dict[str, Any]:
    """Content of features.json: what TFDS builds its reader from."""
    picture = {
        "pythonClassName": FEATURE_CLASS + "image_feature.Image",
        "image": {"shape": _shape(pixels, pixels, 3), "dtype": "uint8", "encodingFormat": "jpeg"},
    }
    text = {"pythonClassName": FEATURE_CLASS + "text_feature.Text", "text": {}}
    observation = {"image": picture, "side_image": picture, "wrist_image": picture, "state": _tensor("float32", 8)}
    flags = {name: _tensor("bool") for name in ("is_first", "is_last", "is_terminal")}
    steps = {
        "observation": _dictionary(observation),
        "action": _tensor("float32", 7),
        "reward": _tensor("float32"),
        "discount": _tensor("float32"),
        **flags,
        **dict.fromkeys(LANGUAGE_KEYS, text),
    }
    sequence = {"feature": _dictionary(steps), "length": "-1"}
    dataset = {"pythonClassName": FEATURE_CLASS + "dataset_feature.Dataset", "sequence": sequence}
    return _dictionary({"steps": dataset, "episode_metadata": _dictionary({"file_path": text})})


def _shape(*sizes: int) -> dict[str, Any]:
    return {"dimensions": [str(size) for size in sizes]} if sizes else {}


def _tensor(kind: str, *sizes: int) -> dict[str, Any]:
    name = "tensor_feature.Tensor" if sizes else "scalar.Scalar"
    return {
        "pythonClassName": FEATURE_CLASS + name,
        "tensor": {"shape": _shape(*sizes), "dtype": kind, "encoding": "none"},
    }


def _dictionary(parts: Mapping[str, Any]) -> dict[str, Any]:
    return {"pythonClassName": FEATURE_CLASS + "features_dict.FeaturesDict", "featuresDict": {"features": dict(parts)}}
