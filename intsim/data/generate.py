"""Making a dataset: episodes in worker processes, shards on disk, going on after a stop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from calib.errors import CurveError, OutputError
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of, versions
from calib.io.typed_document import to_document
from calib.material.knife import load_knife
from calib.simulation.workers import Workers
from intsim.data.dataset_document import (
    DATASET_FILE,
    BrokenTrajectory,
    CoreSeconds,
    DatasetDocument,
    DatasetSpec,
    DatasetTotals,
)
from intsim.data.demonstrate import Demonstration, demonstrate
from intsim.data.manifest import PUBLISHED_TRAJECTORIES, TrajectorySpec
from intsim.data.shards import EPISODE_PART, SHARD_NAME, pack_episode, shard_entries, write_part, write_shard
from intsim.sim.closed_loop import make_environment
from intsim.sim.world import ENV_ID, World
from intsim.task.language import instructions
from intsim.task.planner import CONTROL_RATE

DRAWN_STYLES = ("slice", "rock", "saw")  # styles whose way along the edge and tilt the solver follows


@dataclass(frozen=True)
class PackedEpisode:
    """An episode as a worker sends it back.

    Attributes:
        entry: What the JSON file of its shard says of it.
        content: An HDF5 file with the content of its group.
    """

    entry: Mapping[str, Any]
    content: bytes


def require_simulator() -> None:
    """Do nothing where the robot simulator is installed.

    Raises:
        CurveError: It is not.
    """
    try:
        import mani_skill  # noqa: F401
    except ImportError:
        raise CurveError(
            "dataset: ManiSkill is not installed; pip install 'cutcal[robot]' (Python 3.10 to 3.12)"
        ) from None


def make_episode(spec: TrajectorySpec, demos: str, world: World, arch: str, threads: int) -> PackedEpisode:
    """Make one episode in a worker.

    Args:
        spec: What is done.
        demos: Kind of demonstration, in :data:`intsim.data.dataset_document.DEMONSTRATION_KINDS`.
        world: Where.
        arch, threads: Device of the solver; only CPUs are used.

    Returns:
        Its bytes, and what it took.
    """
    del arch, threads
    began = time.perf_counter()
    env = make_environment(world)
    start = time.perf_counter() - began
    before = env.solver_s
    env.foods = {**env.foods, spec.food.name: spec.food}
    env.reset(seed=spec.seed, options={"episode": spec.episode, "draws": spec.style in DRAWN_STYLES})
    track = demonstrate(env, style=spec.style, sustained=demos == "sustained")
    solver = env.solver_s - before
    seconds = {"solver": solver, "robot": time.perf_counter() - began - start - solver, "start": start}
    entry = _entry(spec, demos, track, seconds)
    return PackedEpisode(entry, pack_episode(track, entry, _attributes(spec, world)))


def _entry(spec: TrajectorySpec, demos: str, track: Demonstration, seconds: Mapping[str, float]) -> dict[str, Any]:
    """What the JSON file of a shard says of a trajectory: ManiSkill's keys first."""
    episode = spec.episode
    return {
        "episode_seed": spec.seed,
        "reset_kwargs": {"seed": spec.seed},
        "control_mode": "pd_joint_pos",
        "elapsed_steps": len(track.action),
        "success": track.published[-1] and track.severed[-1],
        "published": track.published[-1],
        "severed": track.severed[-1],
        "status": track.status,
        "index": spec.index,
        "suite": spec.suite,
        "style": spec.style,
        "demos": demos,
        "food": spec.food.name,
        "instruction": episode.instruction,
        "instructions": instructions(episode.spec, spec.seed),
        "task": {**asdict(episode.spec), "ratio": float(episode.spec.ratio)},
        "items": [
            {"name": i.name, "x": i.x, "y": i.y, "yaw": i.yaw, **to_document(i.shape)}
            for i in (episode.item, *episode.others)
        ],
        "values": spec.values,
        "peak_N": max((float(f[:, 2].max()) for f in track.force), default=0.0),
        "seconds": dict(seconds),
    }


def _attributes(spec: TrajectorySpec, world: World) -> dict[str, Any]:
    """Attributes of a trajectory's group ``mpm``."""
    material = vars(spec.food.to_scene_food().material)
    return {
        "food": spec.food.name,
        "material": json.dumps(material),
        "material_sha256": key_of(material),
        "solver_sha256": code_key(),
        "knife": world.knife,
        "arm": json.dumps({"stiffness": world.stiffness}),
    }


def generate(
    spec: DatasetSpec,
    out: Path,
    pool: Workers,
    *,
    resume: bool = False,
    say: Callable[[str], None] = lambda text: None,
    command: Sequence[str] = (),
) -> DatasetDocument:
    """Make the trajectories of a dataset, and write shards and dataset.json.

    Args:
        spec: What the dataset is.
        out: Folder.
        pool: Where the trajectories are made.
        resume: Go on with what is in ``out``.
        say: Called with a line after each.
        command: Command line, for provenance.

    Returns:
        The content of dataset.json.

    Raises:
        CutcalError: The folder is taken or holds another dataset, or ManiSkill is not installed.
    """
    require_simulator()
    load_knife(spec.knife)
    _claim(out, spec, resume)
    todo, total = _missing(out, spec), spec.manifest.trajectories
    if len(todo) < total:
        say(f"{total - len(todo)} of {total} trajectories are there already")
    rest, done, left = Countdown(max(len(todo), 1)), 0, set(todo)
    _write_complete(out, spec)
    for group in spec.shards:
        own = [k for k in group if k in left]
        jobs = [(spec.manifest.trajectory(k), spec.demos, spec.world) for k in own]
        for place, made in pool.each(make_episode, jobs):
            if made is None:
                raise OutputError(
                    f"trajectory {own[place]}: its process was killed twice, perhaps for lack of memory; add --resume"
                )
            write_part(out / EPISODE_PART.format(own[place]), made.content)
            done += 1
            say(f"{_words(made.entry)}; {done} of {len(todo)}, {rest.left(1)}")
        _write_complete(out, spec)
        if own:
            pool.renew()  # each food and size has fields of its own
    document = replace(DatasetDocument.read(out), totals=_totals(out, command))
    document.write(out)
    return document


def _words(entry: Mapping[str, Any]) -> str:
    """A trajectory in words."""
    outcome = "severed" if entry["severed"] else "not severed"
    trouble = "" if entry["status"] == "done" else f" ({entry['status']})"
    asked = f"trajectory {entry['index']}: {entry['instruction']!r}, {entry['style']}"
    return f"{asked}, peak {entry['peak_N']:.1f} N, {outcome}{trouble}"


def _claim(out: Path, spec: DatasetSpec, resume: bool) -> None:
    """Make the folder, or see that it holds the same dataset."""
    if (out / DATASET_FILE).exists() or any(out.glob("shard-*")):
        if not resume:
            raise OutputError(
                f"--out {out}: holds a dataset and is never overwritten; choose another folder, or add --resume"
            )
        if DatasetDocument.read(out).spec != spec:
            raise OutputError(f"--out {out}: holds another dataset; choose another folder")
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise OutputError(f"--out {out}: cannot be written ({e.strerror}); choose another folder") from None
    DatasetDocument(spec).write(out)


def _missing(out: Path, spec: DatasetSpec) -> list[int]:
    """Trajectories that are neither in a shard nor in a part."""
    return [
        k
        for n, group in enumerate(spec.shards)
        if not (out / f"{SHARD_NAME.format(n)}.h5").exists()
        for k in group
        if not (out / EPISODE_PART.format(k)).exists()
    ]


def _write_complete(out: Path, spec: DatasetSpec) -> None:
    """Write the shards whose episodes are all there."""
    info = {
        "env_id": ENV_ID,
        "env_kwargs": {"knife": spec.knife, "stiffness": spec.stiffness},
        "control_freq": CONTROL_RATE,
    }
    for n, group in enumerate(spec.shards):
        parts = [out / EPISODE_PART.format(k) for k in group]
        if (out / f"{SHARD_NAME.format(n)}.h5").exists():
            for part in parts:  # of a process that was killed when the shard was there
                part.unlink(missing_ok=True)
        elif all(part.exists() for part in parts):
            write_shard(out, n, group, info)


def _totals(out: Path, command: Sequence[str]) -> DatasetTotals:
    """What the shards hold, what an episode takes and what the whole published set would."""
    entries = [one for path in sorted(out.glob("shard-*.h5")) for one in shard_entries(path)]
    n = max(len(entries), 1)
    mean = CoreSeconds(*(sum(e["seconds"][part] for e in entries) / n for part in ("solver", "robot")))
    return DatasetTotals(
        trajectories=len(entries),
        steps=sum(e["elapsed_steps"] for e in entries),
        published=sum(e["published"] for e in entries),
        severed=sum(e["severed"] for e in entries),
        broken=tuple(BrokenTrajectory(e["index"], e["status"]) for e in entries if e["status"] != "done"),
        foods={food: sum(e["food"] == food for e in entries) for food in sorted({e["food"] for e in entries})},
        seconds_per_episode=mean,
        most_solver_s=max((e["seconds"]["solver"] for e in entries), default=0.0),
        core_hours_of_21000=PUBLISHED_TRAJECTORIES * sum((mean.solver, mean.robot)) / 3600,
        bytes=sum(p.stat().st_size for p in out.glob("shard-*")),
        command=tuple(command),
        versions=versions(),
        git=git_commit(),
    )
