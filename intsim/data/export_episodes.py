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
from intsim.data.cameras import CAMERA_NAMES
from intsim.data.pictures import check_backgrounds, load_pictures, render_dataset
from intsim.data.shards import StoredTrajectory, is_kept, trajectories
from intsim.task.selection import EVERY_TASK, TaskFilter


@dataclass(frozen=True, eq=False)
class ExportEpisode:
    """A trajectory before a background.

    Attributes:
        stored: The trajectory.
        background: Number of the background; None without pictures.
        sentence: What was asked for, in words; another of its sentences before each background.
        pictures: By camera, 8 bits, shape (T, h, w, 3) each; empty without pictures.
    """

    stored: StoredTrajectory
    background: int | None
    sentence: str
    pictures: dict[str, np.ndarray]

    @property
    def sentences(self) -> list[str]:
        """All sentences that ask for the same, that of this episode first."""
        own = list(self.stored.entry["instructions"])
        k = own.index(self.sentence)
        return own[k:] + own[:k]


def check_pictured_target(out: Path, backgrounds: Sequence[int], kind: str, *packages: str) -> None:
    """Check the target of an export that is nothing without pictures, before anything is written.

    Args:
        out: Folder that will be made.
        backgrounds: Numbers of the backgrounds.
        kind: What the export is called.
        packages: Names of the modules that it is written with.

    Raises:
        OutputError: Those of :func:`check_target`, no background, or a package that is not installed.
    """
    for name in packages:
        if find_spec(name) is None:
            raise OutputError(f"dataset export: {name} is not installed; pip install 'cutcal[data]'")
    if not backgrounds:
        raise OutputError(f"dataset export: {kind} is pictures and actions; name backgrounds, such as --scenes 0,1,2")
    check_target(out, backgrounds)


def check_target(out: Path, backgrounds: Sequence[int]) -> None:
    """Check the target of an export, before anything is written.

    Raises:
        OutputError: A background that does not exist, or a folder that is taken.
    """
    check_backgrounds(backgrounds)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise OutputError(f"--out {out}: exists already and is never overwritten; choose another folder")


def export_episodes(
    folder: Path,
    backgrounds: Sequence[int],
    pixels: int,
    pool: Workers | None = None,
    say: Callable[[str], None] = lambda text: None,
    keep: str = "all",
    tasks: TaskFilter = EVERY_TASK,
    cameras: Sequence[str] = CAMERA_NAMES,
) -> Iterator[ExportEpisode]:
    """Each trajectory for each background; its sentences come in turn. What has to be rendered is, before this returns.

    Args:
        folder: A dataset of :func:`intsim.data.generate.generate`.
        backgrounds: Their numbers; without any each trajectory comes once, without pictures.
        pixels: Width and height of the pictures.
        pool: Where those are rendered that are not in the folder yet; they are kept there.
        say: Called with a line after each.
        keep: Which trajectories, in :data:`intsim.data.shards.KEEP_KINDS`.
        tasks: Which of them by what they ask for.
        cameras: Names of the cameras whose pictures they have.

    Returns:
        The episodes, one background after the other.

    Raises:
        CutcalError: There is no renderer, or the folder holds no dataset, none that is kept, or not the
            pictures and there is no pool.
    """
    kept = [
        k for k, stored in enumerate(trajectories(folder)) if is_kept(stored.entry, keep) and tasks.keeps(stored.entry)
    ]
    if not kept:
        kind = ", ".join(filter(None, (keep, tasks.words())))
        raise OutputError(f"dataset export: no trajectory of {folder} is kept ({kind}); make more, or keep others")
    if backgrounds and pool is not None:
        render_dataset(folder, backgrounds, pixels, pool, say)
    return _each(folder, backgrounds, pixels, say, set(kept), cameras)


def _each(
    folder: Path,
    backgrounds: Sequence[int],
    pixels: int,
    say: Callable[[str], None],
    kept: set[int],
    cameras: Sequence[str],
) -> Iterator[ExportEpisode]:
    """Those trajectories whose numbers are kept."""
    total = len(kept) * max(len(backgrounds), 1)
    rest, done = Countdown(total), 0
    what = "trajectory before a background" if len(backgrounds) > 1 else "trajectory"
    for turn, background in enumerate(backgrounds or [None]):
        for k, stored in enumerate(trajectories(folder)):
            if k not in kept:
                continue
            sentences = stored.entry["instructions"]
            pictures = {} if background is None else load_pictures(folder, stored, background, pixels, cameras)
            yield ExportEpisode(stored, background, sentences[(k + turn) % len(sentences)], pictures)
            done += 1
            say(f"{what} {done} of {total}, {rest.left(1)}")
