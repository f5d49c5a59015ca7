"""Making a dataset: episodes in worker processes, shards on disk, going on after a stop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from calib.errors import CurveError, OutputError
from calib.io.folder import write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of, versions
from calib.io.schema import tag
from calib.material.knife import load_knife
from calib.simulation.workers import Workers
from intsim.data.manifest import Manifest, TrajectorySpec
from intsim.data.shards import DATASET_FILE, EPISODE_PART, SHARD_NAME, keep, pack_episode, shard_entries, write_shard
from intsim.sim.closed_loop import make_environment
from intsim.sim.world import ENV_ID, World
from intsim.task.language import instructions
from intsim.task.planner import CONTROL_RATE

DEMONSTRATION_KINDS = ("sustained", "planned", "kinematic")
"""Demonstrations: ``sustained`` goes on until the food is in pieces, ``planned`` is the motion that geometry plans, whatever the food does, and
``kinematic`` the same without food that resists: nothing is in pieces then but in geometry."""
DRAWN_STYLES = ("slice", "rock", "saw")  # styles whose way along the edge and tilt the solver follows
WHOLE_SET = 21_000  # trajectories of the published data set


def require_simulator() -> None:
    """Whether the robot simulator is here.

    Raises:
        CurveError: It is not installed.
    """
    try:
        import mani_skill  # noqa: F401
    except ImportError:
        raise CurveError(
            "dataset: ManiSkill is not installed; pip install 'cutcal[robot]' (Python 3.10 to 3.12)"
        ) from None


def make_episode(
    spec: TrajectorySpec, demos: str, knife: str, stiffness: float | None, arch: str, threads: int
) -> dict[str, Any]:
    """One episode in a worker: its bytes, and what it took.

    Args:
        spec: What is done.
        demos: Kind of demonstration.
        knife: Name of the knife.
        stiffness: Of the arm's joints [N m/rad]; ManiSkill's own without it.
        arch, threads: Device of the solver; only CPUs are used.
    """
    del arch, threads
    from intsim.data.demonstrate import demonstrate

    began = time.perf_counter()
    env = make_environment(World(demos != "kinematic", stiffness, knife))
    start = time.perf_counter() - began
    episode, before = spec.episode, env.solver_s
    env.foods = {**env.foods, spec.food.name: spec.food}
    env.reset(seed=spec.seed, options={"episode": episode, "draws": spec.style in DRAWN_STYLES})
    track = demonstrate(env, style=spec.style, sustained=demos == "sustained")
    solver = env.solver_s - before
    material = vars(spec.food.to_scene_food().material)
    about = {
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
            {"name": i.name, "x": i.x, "y": i.y, "yaw": i.yaw, **vars(i.shape)} for i in (episode.item, *episode.others)
        ],
        "values": spec.values,
        "peak_N": max((float(f[:, 2].max()) for f in track.force), default=0.0),
        "seconds": {"solver": solver, "robot": time.perf_counter() - began - start - solver, "start": start},
    }
    mpm = {
        "food": spec.food.name,
        "material": json.dumps(material),
        "material_sha256": key_of(material),
        "solver_sha256": code_key(),
        "knife": knife,
        "arm": json.dumps({"stiffness": stiffness}),
    }
    return {"about": about, "content": pack_episode(track, about, mpm)}


def generate(
    manifest: Manifest,
    out: Path,
    pool: Workers,
    *,
    demos: str = "sustained",
    knife: str = "kitchen",
    stiffness: float | None = None,
    shard: int = 20,
    resume: bool = False,
    say: Callable[[str], None] = lambda text: None,
    command: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Make the trajectories of a manifest, and write shards and dataset.json.

    Args:
        manifest: Which.
        out: Folder.
        pool: Where they are made.
        demos: Kind of demonstration, in :data:`DEMONSTRATION_KINDS`.
        knife: Name of the knife.
        stiffness: Of the arm's joints [N m/rad]; ManiSkill's own without it.
        shard: Trajectories of a file.
        resume: Go on with what is in ``out``.
        say: Called with a line after each.
        command: Command line, for provenance.

    Returns:
        The content of dataset.json.

    Raises:
        CutcalError: The folder is taken or holds another dataset, or ManiSkill is not installed.
    """
    require_simulator()
    load_knife(knife)
    about = {"manifest": manifest.as_dict(), "demos": demos, "knife": knife, "stiffness": stiffness, "shard": shard}
    _claim(out, about, resume)
    groups = [range(k, min(k + shard, manifest.trajectories)) for k in range(0, manifest.trajectories, shard)]
    todo = [
        k
        for n, group in enumerate(groups)
        if not (out / f"{SHARD_NAME.format(n)}.h5").exists()
        for k in group
        if not (out / EPISODE_PART.format(k)).exists()
    ]
    if len(todo) < manifest.trajectories:
        say(f"{manifest.trajectories - len(todo)} of {manifest.trajectories} trajectories are there already")
    rest, done, left = Countdown(max(len(todo), 1)), 0, set(todo)
    info = {"env_id": ENV_ID, "env_kwargs": {"knife": knife, "stiffness": stiffness}, "control_freq": CONTROL_RATE}
    _close(out, groups, info)
    for group in groups:
        own = [k for k in group if k in left]
        jobs = [(manifest.trajectory(k), demos, knife, stiffness) for k in own]
        for place, made in pool.each(make_episode, jobs):
            if made is None:
                raise OutputError(
                    f"trajectory {own[place]}: its process was killed twice, perhaps for lack of memory; add --resume"
                )
            keep(out / EPISODE_PART.format(own[place]), made["content"])
            done += 1
            say(_told(made["about"], f"{done} of {len(todo)}, {rest.left(1)}"))
        _close(out, groups, info)
        if own:
            pool.renew()  # each food and size has fields of its own
    return _conclude(out, about, command)


def _told(a: dict[str, Any], rest: str) -> str:
    """A trajectory in words."""
    outcome = "severed" if a["severed"] else "not severed"
    trouble = "" if a["status"] == "done" else f" ({a['status']})"
    return f"trajectory {a['index']}: {a['instruction']!r}, {a['style']}, peak {a['peak_N']:.1f} N, {outcome}{trouble}; {rest}"


def _claim(out: Path, about: dict[str, Any], resume: bool) -> None:
    """Make the folder, or see that it holds the same dataset."""
    path = out / DATASET_FILE
    if path.exists() or any(out.glob("shard-*")):
        if not resume:
            raise OutputError(
                f"--out {out}: holds a dataset and is never overwritten; choose another folder, or add --resume"
            )
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise OutputError(f"{path}: damaged; choose another folder") from None
        if {name: found.get(name) for name in about} != json.loads(json.dumps(about)):
            raise OutputError(f"--out {out}: holds another dataset; choose another folder")
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise OutputError(f"--out {out}: cannot be written ({e.strerror}); choose another folder") from None
    write_json(path, {"schema": tag("dataset"), **about})


def _close(out: Path, groups: list[range], info: dict[str, Any]) -> None:
    """Write the shards whose episodes are all there."""
    for n, group in enumerate(groups):
        parts = [out / EPISODE_PART.format(k) for k in group]
        if (out / f"{SHARD_NAME.format(n)}.h5").exists():
            for part in parts:  # of a process that was killed when the shard was there
                part.unlink(missing_ok=True)
        elif all(part.exists() for part in parts):
            write_shard(out, n, group, info)


def _conclude(out: Path, about: dict[str, Any], command: tuple[str, ...]) -> dict[str, Any]:
    """The document, with what an episode takes and what the whole published set would."""
    episodes = [one for path in sorted(out.glob("shard-*.h5")) for one in shard_entries(path)]
    before = json.loads((out / DATASET_FILE).read_text(encoding="utf-8"))
    n = max(len(episodes), 1)
    mean = {part: sum(e["seconds"][part] for e in episodes) / n for part in ("solver", "robot")}
    document = {
        "schema": tag("dataset"),
        **about,
        "trajectories": len(episodes),
        "steps": sum(e["elapsed_steps"] for e in episodes),
        "published": sum(e["published"] for e in episodes),
        "severed": sum(e["severed"] for e in episodes),
        "broken": [{"index": e["index"], "status": e["status"]} for e in episodes if e["status"] != "done"],
        "foods": {f: sum(e["food"] == f for e in episodes) for f in sorted({e["food"] for e in episodes})},
        "seconds_per_episode": mean,
        "most_solver_s": max((e["seconds"]["solver"] for e in episodes), default=0.0),
        "core_hours_of_21000": WHOLE_SET * sum(mean.values()) / 3600,
        **({"pictures": before["pictures"]} if "pictures" in before else {}),
        "bytes": sum(p.stat().st_size for p in out.glob("shard-*")),
        "command": list(command),
        "versions": versions(),
        "git": git_commit(),
    }
    write_json(out / DATASET_FILE, document)
    return document
