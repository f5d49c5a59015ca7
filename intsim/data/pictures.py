"""Pictures of a dataset: each trajectory before each background, rendered in worker processes and kept beside it.

``pictures-128-01-0000.h5`` belongs to ``shard-0000.h5`` (128 pixels, background 1). For trajectory k it has a group
``traj_k`` with ``front``, ``side``, ``wrist`` and ``work`` (T,), a PNG of what each camera sees before each step, and
the attribute ``seconds``, the processor time that rendering took: of what several backgrounds took together each has
the same part. Nothing is simulated for it.
"""

from __future__ import annotations

import io
import struct
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.io.meaning import describe_sets
from calib.io.progress import Countdown
from calib.simulation.workers import Workers
from intsim.data.dataset_document import DatasetDocument, PictureTotals
from intsim.data.manifest import PUBLISHED_TRAJECTORIES
from intsim.data.shard_meanings import picture_meaning
from intsim.data.shards import StoredTrajectory, merge_parts, shard_entries, shard_number, shard_paths, write_part
from intsim.render.background import BACKGROUNDS
from intsim.render.view import PICTURE_CAMERAS
from intsim.sim.world import World

PICTURE_FILE = "pictures-{:d}-{:02d}-{:04d}.h5"  # pixels, background, shard
PICTURE_PART = "picture-{:d}-{:02d}-{:06d}.h5"  # pixels, background, trajectory: until the file is complete
RENDERED_GROUPS = ("obs/agent/qpos", "obs/extra/edge", "mpm/pieces", "mpm/surface")  # for pictures
PNG_SIGNATURE, FILTER_SUB = b"\x89PNG\r\n\x1a\n", 1  # of the PNG standard (ISO/IEC 15948)
_renderer: tuple[int, Any] | None = None  # pixels, and the renderer of this process


def render_dataset(
    folder: Path,
    backgrounds: Sequence[int],
    pixels: int,
    pool: Workers,
    say: Callable[[str], None] = lambda text: None,
) -> PictureTotals:
    """Make the pictures that are not there yet; what is there is kept, also after a kill.

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        backgrounds: Numbers of the backgrounds.
        pixels: Width and height.
        pool: Where they are made.
        say: Called with a line after each trajectory.

    Returns:
        What ``dataset.json`` then has in ``pictures``.

    Raises:
        CutcalError: A background that does not exist, there is no renderer, the folder holds no dataset or cannot be
            written.
    """
    check_backgrounds(backgrounds)
    paths = shard_paths(folder)  # or it is no dataset at all
    document = DatasetDocument.read(folder)
    shards = {shard_number(path): (path, shard_entries(path)) for path in paths}
    todo = {
        n: [[b for b in backgrounds if not _there(folder, pixels, b, n, one)] for one in entries]
        for n, (_, entries) in shards.items()
    }
    count = sum(len(missing) for all_missing in todo.values() for missing in all_missing)
    total = len(backgrounds) * sum(len(one) for _, one in shards.values())
    if 0 < count < total:
        say(f"pictures of {total - count} of {total} are there already")
    rest, done = Countdown(max(count, 1)), 0
    for n, (path, entries) in shards.items():
        own = [k for k, missing in enumerate(todo[n]) if missing]
        jobs = [(_slim(path, k), entries[k], todo[n][k], pixels) for k in own]
        for place, made in pool.each(render_trajectory, jobs):
            k = own[place]
            index = entries[k]["index"]
            if made is None:
                raise OutputError(
                    f"pictures of trajectory {index}: their process was killed twice, perhaps for lack of memory; "
                    "what was rendered before is kept"
                )
            for background, content in zip(todo[n][k], made, strict=True):
                write_part(folder / PICTURE_PART.format(pixels, background, index), content)
            done += len(made)
            before = ", ".join(map(str, todo[n][k]))
            say(f"pictures of trajectory {index} before background {before}: {done} of {count}, {rest.left(len(made))}")
        for background in backgrounds:
            _merge(folder, pixels, background, n, entries)
    found = _totals(folder, backgrounds, pixels)
    replace(document, pictures=found).write(folder)
    return found


def require_renderer(pool: Workers, backgrounds: Sequence[int], pixels: int) -> None:
    """Do nothing where there is a renderer: asked before hours of simulation.

    Args:
        pool: Where pictures would be made.
        backgrounds: Numbers of the backgrounds.
        pixels: Width and height.

    Raises:
        CutcalError: There is none, or it ends its process; or a background does not exist.
    """
    check_backgrounds(backgrounds)
    for _, found in pool.each(_renders, [(pixels,)]):
        if found is None:
            raise OutputError("dataset: the renderer ends its process; cutcal doctor says what is missing")


def _renders(pixels: int, arch: str, threads: int) -> bool:
    """Whether a worker has a renderer."""
    del arch
    _rendering(pixels, threads)
    return True


def check_backgrounds(backgrounds: Sequence[int]) -> None:
    """Do nothing where all backgrounds exist.

    Raises:
        OutputError: One does not.
    """
    if any(not 0 <= k < BACKGROUNDS for k in backgrounds):
        raise OutputError(f"--scenes {','.join(map(str, backgrounds))}: give numbers from 0 to {BACKGROUNDS - 1}")


def render_trajectory(
    content: bytes, entry: dict[str, Any], backgrounds: Sequence[int], pixels: int, arch: str, threads: int
) -> list[bytes]:
    """Render one trajectory before backgrounds, in a worker.

    Args:
        content: HDF5 file with what is shown (:data:`RENDERED_GROUPS`).
        entry: What the JSON file of its shard says of it.
        backgrounds: Numbers of the backgrounds.
        pixels: Width and height.
        arch, threads: Device of the solver; rendering takes as many threads.

    Returns:
        For each background the bytes of an HDF5 file with the content of its group.
    """
    del arch
    began = time.process_time()
    made: dict[int, dict[str, list[bytes]]] = {background: {} for background in backgrounds}
    with h5py.File(io.BytesIO(content)) as file:
        for seen in _rendering(pixels, threads).frames(StoredTrajectory(file, entry), backgrounds):
            for background, views in seen.items():
                for camera, frame in views.items():
                    made[background].setdefault(camera, []).append(png_bytes(frame))
    seconds = (time.process_time() - began) / len(backgrounds)
    return [_packed(made[background], seconds) for background in backgrounds]


def _packed(views: Mapping[str, Sequence[bytes]], seconds: float) -> bytes:
    """PNG files by camera as an HDF5 file."""
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        for camera, frames in views.items():
            column = np.empty(len(frames), object)
            column[:] = [np.frombuffer(frame, np.uint8) for frame in frames]
            file.create_dataset(camera, data=column, dtype=h5py.vlen_dtype(np.uint8))
        describe_sets(file, picture_meaning)
        file.attrs["seconds"] = seconds
    return out.getvalue()


def deflate(content: Any) -> bytes:
    """Bytes packed as zlib packs them, by Intel's ISA-L where it is installed: a quarter of zlib's time, as small."""
    try:
        from isal import isal_zlib
    except ImportError:
        packer = zlib.compressobj(1, strategy=zlib.Z_RLE)  # runs of equal bytes alone: half the time of the default
        return packer.compress(content) + packer.flush()
    return isal_zlib.compress(content, 1)


def png_bytes(frame: np.ndarray) -> bytes:
    """A picture as a PNG file.

    Each row is written as the change from the pixel at its left (the standard's filter *Sub*). Pillow tries five
    filters for each row, which takes longer than all the rest and saves nothing in rendered pictures.

    Args:
        frame: Red, green and blue, 8 bits [-], shape (h, w, 3).

    Returns:
        The bytes of the file.
    """
    height, width, _ = frame.shape
    row = frame.reshape(height, 3 * width)
    lines = np.empty((height, 3 * width + 1), np.uint8)
    lines[:, 0], lines[:, 1:4] = FILTER_SUB, row[:, :3]
    np.subtract(row[:, 3:], row[:, :-3], out=lines[:, 4:])
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)  # eight bits of red, green and blue, not interlaced
    chunks = ((b"IHDR", head), (b"IDAT", deflate(lines.data)), (b"IEND", b""))
    return PNG_SIGNATURE + b"".join(
        struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        for name, content in chunks
    )


def load_pictures(
    folder: Path,
    stored: StoredTrajectory,
    background: int,
    pixels: int,
    cameras: Sequence[str] = PICTURE_CAMERAS,
) -> dict[str, np.ndarray]:
    """Load the pictures of a trajectory that were made.

    Args:
        folder: The dataset.
        stored: The trajectory.
        background: Number of the background.
        pixels: Width and height.
        cameras: Names of the cameras.

    Returns:
        Pictures by camera, 8 bits, shape (T, pixels, pixels, 3).

    Raises:
        OutputError: They are not there, or damaged.
    """
    from PIL import Image

    path = folder / PICTURE_FILE.format(pixels, background, stored.shard)
    try:
        with h5py.File(path) as file:
            group = file[f"traj_{stored.entry['episode_id']}"]
            return {
                camera: np.array([np.asarray(Image.open(io.BytesIO(png.tobytes()))) for png in group[camera][()]])
                for camera in cameras
            }
    except (OSError, KeyError, ValueError) as e:
        raise OutputError(f"{path}: not there or damaged ({e}); remove it and have it rendered again") from None


def _rendering(pixels: int, threads: int) -> Any:
    """The renderer of this process."""
    global _renderer
    from intsim.data.rendering import Renderer

    if _renderer is None or _renderer[0] != pixels:
        _renderer = pixels, Renderer(pixels, threads)
    return _renderer[1]


def _there(folder: Path, pixels: int, background: int, shard: int, entry: Mapping[str, Any]) -> bool:
    """Whether the pictures of a trajectory were made."""
    names = (PICTURE_FILE.format(pixels, background, shard), PICTURE_PART.format(pixels, background, entry["index"]))
    return any((folder / name).exists() for name in names)


def _slim(path: Path, k: int) -> bytes:
    """What is shown of a trajectory, as an HDF5 file."""
    stream = io.BytesIO()
    with h5py.File(path) as shard, h5py.File(stream, "w") as file:
        group = shard[f"traj_{k}"]
        for name in RENDERED_GROUPS:
            if name in group:
                group.copy(name, file.require_group(name.rsplit("/", 1)[0]))
        file.require_group("mpm").attrs["knife"] = group["mpm"].attrs.get("knife", World.knife)
    return stream.getvalue()


def _merge(folder: Path, pixels: int, background: int, shard: int, entries: Sequence[Mapping[str, Any]]) -> None:
    """Put the pictures of a shard together and remove their parts, also those that a killed process has left."""
    path = folder / PICTURE_FILE.format(pixels, background, shard)
    parts = [folder / PICTURE_PART.format(pixels, background, one["index"]) for one in entries]
    if not path.exists():
        merge_parts(path, parts)
        return
    for part in parts:
        part.unlink(missing_ok=True)


def _totals(folder: Path, backgrounds: Sequence[int], pixels: int) -> PictureTotals:
    """What rendering took and takes."""
    files = sorted(path for k in backgrounds for path in folder.glob(f"pictures-{pixels}-{k:02d}-*.h5"))
    seconds, number = [], 0
    for path in files:
        with h5py.File(path) as file:
            seconds += [float(group.attrs["seconds"]) for group in file.values()]
            number += sum(len(column) for group in file.values() for column in group.values())
    mean = sum(seconds) / max(len(seconds), 1)
    return PictureTotals(
        scenes=tuple(sorted(set(backgrounds))),
        pixels=pixels,
        number=number,
        seconds_per_episode=mean,
        core_hours_of_315000=PUBLISHED_TRAJECTORIES * BACKGROUNDS * mean / 3600,
        bytes=sum(path.stat().st_size for path in files),
    )
