"""Pictures of a dataset: every trajectory before every background that is asked for, rendered in worker processes and kept beside it.

``pictures-128-01-0000.h5`` belongs to ``shard-0000.h5`` (128 pixels, background 1) and has for trajectory k a group ``traj_k`` with ``front``, ``side``
and ``wrist`` (T,), a PNG for what each camera sees before each step, and the attribute ``seconds``, what rendering took. Nothing is simulated for it.
"""

from __future__ import annotations

import io
import json
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.io.folder import write_json
from calib.io.progress import Countdown
from calib.simulation.workers import Workers
from intsim.data.shards import (
    DATASET_FILE,
    StoredTrajectory,
    keep,
    put_together,
    shard_entries,
    shard_number,
    shard_paths,
)
from intsim.sim.background import BACKGROUNDS

PICTURE_FILE = "pictures-{:d}-{:02d}-{:04d}.h5"  # pixels, background, shard
PICTURE_PART = "picture-{:d}-{:02d}-{:06d}.h5"  # pixels, background, trajectory: until the file is complete
RENDERED_GROUPS = ("obs/agent/qpos", "mpm/surface")  # of a trajectory, for its pictures
WHOLE_SET = 21_000 * BACKGROUNDS  # trajectories of the published data set, before each background

_renderer: tuple[tuple[int, int], Any] | None = None  # of this process: there is one scene at a time


def render_dataset(
    folder: Path,
    scenes: Sequence[int],
    pixels: int,
    pool: Workers,
    say: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Make the pictures that are not there yet; what is there is kept, also after a kill.

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        scenes: Backgrounds.
        pixels: Width and height.
        pool: Where they are made.
        say: Called with a line after each trajectory.

    Returns:
        What ``dataset.json`` then has in ``pictures``: scenes, pixels, number, seconds of one core for each trajectory and background, bytes, and
        core hours of the whole published set before 15 backgrounds.

    Raises:
        CutcalError: A background that does not exist, there is no renderer, the folder holds no dataset or cannot be written.
    """
    check_backgrounds(scenes)
    about = _about(folder)
    shards = {shard_number(path): (path, shard_entries(path)) for path in shard_paths(folder)}
    todo = {
        n: [(scene, k) for scene in scenes for k, one in enumerate(listed) if not _there(folder, pixels, scene, n, one)]
        for n, (_, listed) in shards.items()
    }
    count, total = sum(map(len, todo.values())), len(scenes) * sum(len(listed) for _, listed in shards.values())
    if 0 < count < total:
        say(f"pictures of {total - count} of {total} are there already")
    rest, done = Countdown(max(count, 1)), 0
    for n, (path, listed) in shards.items():
        for place, made in pool.each(
            render_trajectory, [(_slim(path, k), listed[k], scene, pixels) for scene, k in todo[n]]
        ):
            scene, k = todo[n][place]
            if made is None:
                raise OutputError(
                    f"pictures of trajectory {listed[k]['index']}: their process was killed twice, perhaps for lack of memory; "
                    "what was rendered before is kept"
                )
            keep(folder / PICTURE_PART.format(pixels, scene, listed[k]["index"]), made)
            done += 1
            say(
                f"pictures of trajectory {listed[k]['index']} before background {scene}: {done} of {count}, {rest.left(1)}"
            )
        for scene in scenes:
            _close(folder, pixels, scene, n, listed)
    found = _summed(folder, scenes, pixels)
    write_json(folder / DATASET_FILE, about | {"pictures": found})
    return found


def require_renderer(pool: Workers, scenes: Sequence[int], pixels: int) -> None:
    """Whether there is a renderer, before hours of simulation.

    Raises:
        CutcalError: There is none, or it ends its process; or a background does not exist.
    """
    check_backgrounds(scenes)
    for _, found in pool.each(_ready, [(scenes[0], pixels)]):
        if found is None:
            raise OutputError("dataset: the renderer ends its process; cutcal doctor says what is missing")


def _ready(scene: int, pixels: int, arch: str, threads: int) -> bool:
    del arch
    _rendering(scene, pixels, threads)
    return True


def check_backgrounds(scenes: Sequence[int]) -> None:
    """Raise OutputError where a background does not exist."""
    if any(not 0 <= k < BACKGROUNDS for k in scenes):
        raise OutputError(f"--scenes {','.join(map(str, scenes))}: give numbers from 0 to {BACKGROUNDS - 1}")


def render_trajectory(content: bytes, about: dict[str, Any], scene: int, pixels: int, arch: str, threads: int) -> bytes:
    """Pictures of one trajectory before one background, in a worker: the bytes of an HDF5 file with the content of its group.

    Args:
        content: HDF5 file with what is shown (:data:`RENDERED_GROUPS`).
        about: Entry of the trajectory in its JSON file.
        scene: Background.
        pixels: Width and height.
        arch, threads: Device of the solver; rendering on a CPU takes as many threads.
    """
    del arch
    from PIL import Image

    began = time.perf_counter()
    with h5py.File(io.BytesIO(content)) as file:
        seen = _rendering(scene, pixels, threads).pictures(StoredTrajectory(file, about))
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        for view, frames in seen.items():
            column = file.create_dataset(view, (len(frames),), h5py.vlen_dtype(np.uint8))
            for t, frame in enumerate(frames):
                stream = io.BytesIO()
                Image.fromarray(frame).save(stream, "PNG")
                column[t] = np.frombuffer(stream.getvalue(), np.uint8)
        file.attrs["seconds"] = time.perf_counter() - began
    return out.getvalue()


def load_pictures(folder: Path, stored: StoredTrajectory, scene: int, pixels: int) -> dict[str, np.ndarray]:
    """Pictures that were made, by camera (T, pixels, pixels, 3).

    Raises:
        OutputError: They are not there, or damaged.
    """
    from PIL import Image

    path = folder / PICTURE_FILE.format(pixels, scene, stored.shard)
    try:
        with h5py.File(path) as file:
            group = file[f"traj_{stored.about['episode_id']}"]
            return {
                view: np.array([np.asarray(Image.open(io.BytesIO(png.tobytes()))) for png in group[view][()]])
                for view in group
            }
    except (OSError, KeyError, ValueError) as e:
        raise OutputError(f"{path}: not there or damaged ({e}); remove it and have it rendered again") from None


def _rendering(scene: int, pixels: int, threads: int) -> Any:
    """The renderer of this process."""
    global _renderer
    os.environ.setdefault("LP_NUM_THREADS", str(threads))  # of Mesa, which would take all cores in each worker
    from intsim.data.rendering import Renderer

    if _renderer is None or _renderer[0] != (scene, pixels):
        if _renderer is not None:
            _renderer[1].close()
            _renderer = None
        _renderer = (scene, pixels), Renderer(scene, pixels)
    return _renderer[1]


def _there(folder: Path, pixels: int, scene: int, shard: int, about: dict[str, Any]) -> bool:
    """Whether the pictures of a trajectory were made."""
    names = (PICTURE_FILE.format(pixels, scene, shard), PICTURE_PART.format(pixels, scene, about["index"]))
    return any((folder / name).exists() for name in names)


def _slim(path: Path, k: int) -> bytes:
    """What is shown of a trajectory, as an HDF5 file."""
    stream = io.BytesIO()
    with h5py.File(path) as shard, h5py.File(stream, "w") as file:
        group = shard[f"traj_{k}"]
        for name in RENDERED_GROUPS:
            if name in group:
                group.copy(name, file.require_group(name.rsplit("/", 1)[0]))
    return stream.getvalue()


def _close(folder: Path, pixels: int, scene: int, shard: int, listed: Sequence[dict[str, Any]]) -> None:
    """Put the pictures of a shard together and remove their parts, those too of a process that was killed in between."""
    path = folder / PICTURE_FILE.format(pixels, scene, shard)
    parts = [folder / PICTURE_PART.format(pixels, scene, one["index"]) for one in listed]
    if not path.exists():
        put_together(path, parts)
        return
    for part in parts:
        part.unlink(missing_ok=True)


def _about(folder: Path) -> dict[str, Any]:
    """What dataset.json says, before anything is rendered."""
    shard_paths(folder)  # or it is no dataset at all
    try:
        found: dict[str, Any] = json.loads((folder / DATASET_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise OutputError(f"{folder / DATASET_FILE}: not there or damaged ({e}); make the dataset again") from None
    return found


def _summed(folder: Path, scenes: Sequence[int], pixels: int) -> dict[str, Any]:
    """What rendering took and takes."""
    files = sorted(path for scene in scenes for path in folder.glob(f"pictures-{pixels}-{scene:02d}-*.h5"))
    seconds, number = [], 0
    for path in files:
        with h5py.File(path) as file:
            seconds += [float(group.attrs["seconds"]) for group in file.values()]
            number += sum(len(column) for group in file.values() for column in group.values())
    mean = sum(seconds) / max(len(seconds), 1)
    return {
        "scenes": sorted(set(scenes)),
        "pixels": pixels,
        "number": number,
        "seconds_per_episode": mean,
        "core_hours_of_315000": WHOLE_SET * mean / 3600,
        "bytes": sum(path.stat().st_size for path in files),
    }
