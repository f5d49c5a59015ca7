"""Every trajectory before every background that is asked for, with one of its sentences: what exports go through."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from calib.errors import OutputError
from calib.io.progress import Countdown
from calib.simulation.workers import Workers
from intsim.data.pictures import check_backgrounds, load_pictures, render_dataset
from intsim.data.shards import StoredTrajectory, trajectories


@dataclass(frozen=True, eq=False)
class ExportEpisode:
    """A trajectory before a background. Attributes: stored; scene, None without pictures; sentence; pictures by camera (T, h, w, 3)."""

    stored: StoredTrajectory
    scene: int | None
    sentence: str
    pictures: dict[str, np.ndarray]


def check_pictured_target(out: Path, scenes: Sequence[int], kind: str, *packages: str) -> None:
    """The same for an export that is nothing without pictures.

    Args:
        out, scenes: As in :func:`check_target`.
        kind: What it is called.
        packages: Names of the modules that it is written with.

    Raises:
        OutputError: Those of :func:`check_target`, no background, or a package that is not installed.
    """
    for name in packages:
        if find_spec(name) is None:
            raise OutputError(f"dataset export: {name} is not installed; pip install 'cutcal[data]'")
    if not scenes:
        raise OutputError(f"dataset export: {kind} is pictures and actions; name backgrounds, such as --scenes 0,1,2")
    check_target(out, scenes)


def check_target(out: Path, scenes: Sequence[int]) -> None:
    """Before anything is written.

    Raises:
        OutputError: A background that does not exist, or a folder that is taken.
    """
    check_backgrounds(scenes)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise OutputError(f"--out {out}: exists already and is never overwritten; choose another folder")


def export_episodes(
    folder: Path,
    scenes: Sequence[int],
    pixels: int,
    pool: Workers | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Iterator[ExportEpisode]:
    """Each trajectory for each background; its sentences come in turn. What has to be rendered is, before this returns.

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        scenes: Backgrounds; without any each trajectory comes once, without pictures.
        pixels: Width and height of the pictures.
        pool: Where those are rendered that are not in the folder yet; they are kept there.
        say: Called with a line after each.

    Raises:
        CutcalError: There is no renderer, or the folder holds no dataset, or not the pictures and there is no pool.
    """
    if scenes and pool is not None:
        render_dataset(folder, scenes, pixels, pool, say)
    return _each(folder, scenes, pixels, say)


def _each(folder: Path, scenes: Sequence[int], pixels: int, say: Callable[[str], None]) -> Iterator[ExportEpisode]:
    total = sum(1 for _ in trajectories(folder)) * max(len(scenes), 1)
    rest, done = Countdown(max(total, 1)), 0
    for place, scene in enumerate(scenes or [None]):
        for k, stored in enumerate(trajectories(folder)):
            sentences = stored.about["instructions"]
            pictures = {} if scene is None else load_pictures(folder, stored, scene, pixels)
            yield ExportEpisode(stored, scene, sentences[(k + place) % len(sentences)], pictures)
            done += 1
            say(f"episode {done} of {total}, {rest.left(1)}")
