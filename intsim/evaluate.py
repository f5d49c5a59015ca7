"""Episodes of a policy, judged one by one and counted with intervals; a stopped evaluation goes on."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import OutputError
from calib.io.folder import prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import git_commit, key_of, versions
from calib.io.schema import tag
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.simulation.workers import Workers
from intsim.sim.severing import PANDA_ARM, SeveringOutcome, simulate_severing
from intsim.sim.world import World
from intsim.task.kinematic_table import KinematicTable
from intsim.task.rollout import Policy, Rollout
from intsim.task.success import PLACE_TOLERANCE, GeometricOutcome, judge_geometry, wilson
from intsim.task.suites import FIRST_TEST_SEED, SUITES, Episode, sample_episode
from intsim.task.targets import target
from mpm.scene import Arm

TABLE_STEPS = 2000  # of an episode, at most: 100 s
ROWS_FILE = "evaluate.jsonl"

Say = Callable[[str], None]


def roll_out(policy: Policy, episode: Episode) -> tuple[Rollout, KinematicTable]:
    """One episode on the plain table."""
    table = KinematicTable([episode.item, *episode.others])
    policy.reset(zlib.crc32(f"{episode.suite} {episode.seed}".encode()))
    for _ in range(TABLE_STEPS):
        action = policy.act(table.observe(), episode.instruction)
        if action is None:
            break
        table.step(action)
    return table.rollout, table


def run_episode(
    policy: Policy, episode: Episode, foods: Mapping[str, FoodSpec], *, severing: bool, knife: str, arm: Arm
) -> dict[str, Any]:
    """One row of the evaluation: what was asked for, what was found."""
    rollout, table = roll_out(policy, episode)
    judged = judge_geometry(episode.spec, episode.item, rollout, table.items[0])
    row = _row(episode, rollout, judged)
    if severing and not episode.spec.pieces:
        row["severing"] = _sever(episode, rollout, judged, foods, knife, arm).as_dict()
    return row


def _row(episode: Episode, rollout: Rollout, judged: GeometricOutcome) -> dict[str, Any]:
    """What was asked for, and what geometry says of it."""
    return {
        "suite": episode.suite,
        "seed": episode.seed,
        "food": episode.item.name,
        "instruction": episode.instruction,
        "ratio": float(episode.spec.ratio),
        "side": episode.spec.side,
        "pieces": episode.spec.pieces,
        "length_m": episode.item.shape.length,
        "steps": len(rollout.pose),
        "clipped": sum(bool(c) for c in rollout.clipped),
        "height_m": judged.height,
        "angle_rad": _finite(judged.angle),
        "offset": _finite(judged.offset),
        "criteria": dict(judged.criteria),
        "published": judged.published,
        "strict": judged.strict,
    }


def _finite(x: float) -> float | None:
    return x if math.isfinite(x) else None


def _sever(
    episode: Episode, rollout: Rollout, judged: GeometricOutcome, foods: Mapping[str, FoodSpec], knife: str, arm: Arm
) -> SeveringOutcome:
    """The cut in the solver, where the edge came down over the food."""
    if not judged.criteria["region"] or not math.isfinite(judged.offset):
        return SeveringOutcome(False, why="the edge does not come down on the food")
    along = target(episode.spec, episode.item) + judged.offset * episode.item.shape.length
    found, _ = simulate_severing(
        episode.item, along, np.array(rollout.command), foods[episode.item.name], knife=knife, arm=arm
    )
    return found


def expected_place_rate(length: float, sigma: float) -> float:
    """Chance that a cut whose place has a normal error [m] is within the published tolerance [-]: erf(0.1 L / (sigma sqrt 2))."""
    return math.erf(PLACE_TOLERANCE * length / (sigma * math.sqrt(2.0)))


def evaluate(
    policy: Policy,
    name: str,
    foods: Mapping[str, FoodSpec],
    suites: Sequence[str],
    episodes: int,
    out: Path,
    *,
    seed: int = 0,
    sigma: float | None = None,
    severing: bool = False,
    knife: str = "kitchen",
    arm: Arm = PANDA_ARM,
    world: World | None = None,
    pool: Workers | None = None,
    resume: bool = False,
    say: Say = lambda _: None,
    command: Sequence[str] = (),
) -> dict[str, Any]:
    """Evaluate a policy, and write evaluate.jsonl (a row for each episode) and evaluate.json.

    Args:
        policy: The policy.
        name: What it is called.
        foods: Foods that are asked for, by name.
        suites: Names in :data:`intsim.task.suites.SUITES`.
        episodes: Of each suite.
        out: Folder of the results.
        seed: Of the first episode of each suite, above :data:`intsim.task.suites.FIRST_TEST_SEED`.
        sigma: Standard deviation of the noisy oracle [m]: its closed form is given beside what was found.
        severing: Simulate single cuts in the solver too; on the table.
        knife: Name of the knife.
        arm: What holds it in the solver; on the table.
        world: Where the episodes take place: in IntSim, in closed loop with the food; without it on the table.
        pool: Where IntSim runs.
        resume: Go on with what is in ``out``.
        say: Called with a line now and then.
        command: Command line, for provenance.

    Returns:
        The content of evaluate.json.

    Raises:
        CutcalError: The folder is taken, or holds another evaluation.
    """
    load_knife(knife)
    prepare(out, resume=resume)
    about = {
        "policy": name,
        "foods": {n: key_of(vars(f.to_scene_food().material)) for n, f in foods.items()},
        "knife": knife,
        "seed": seed,
        "sigma_m": sigma,
        "severing": severing,
        "arm": vars(arm),
        "world": None if world is None else {"coupled": world.coupled, "stiffness": world.stiffness},
    }
    rows = _rows(out / ROWS_FILE, about)
    done = {(r["suite"], r["seed"]) for r in rows}
    todo = [
        (s, FIRST_TEST_SEED + seed + k)
        for s in suites
        for k in range(episodes)
        if (s, FIRST_TEST_SEED + seed + k) not in done
    ]
    with (out / ROWS_FILE).open("a", encoding="utf-8") as file:
        if not rows and file.tell() == 0:
            file.write(json.dumps(about) + "\n")

        def made() -> Iterator[dict[str, Any]]:
            if world is not None and pool is not None:
                yield from _in_world(policy, todo, foods, world, pool)
                return
            for suite, at in todo:
                episode = sample_episode(suite, at, dict(foods))
                yield run_episode(policy, episode, foods, severing=severing, knife=knife, arm=arm)

        rest = Countdown(max(len(todo), 1))
        for k, row in enumerate(made(), 1):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            left = rest.left(1)
            if severing or world is not None or k % 100 == 0:
                say(f"{k} of {len(todo)} episodes: {row['suite']}, {row['food']}, {_words(row)}; {left}")
    wanted = {(s, FIRST_TEST_SEED + seed + k) for s in suites for k in range(episodes)}
    document = {
        "schema": tag("evaluate"),
        **about,
        "suites": {s: _count([r for r in rows if r["suite"] == s and (s, r["seed"]) in wanted], sigma) for s in suites},
        "command": list(command),
        "versions": versions(),
        "git": git_commit(),
    }
    write_json(out / "evaluate.json", document)
    return document


def _in_world(
    policy: Policy, todo: Sequence[tuple[str, int]], foods: Mapping[str, FoodSpec], world: World, pool: Workers
) -> Iterator[dict[str, Any]]:
    """Rows of episodes in IntSim, in order of completion."""
    from intsim.sim.closed_loop import closed_loop_episode

    for k, result in pool.each(
        closed_loop_episode, [(policy, suite, seed, dict(foods), world) for suite, seed in todo]
    ):
        suite, seed = todo[k]
        if result is None:
            raise OutputError(
                f"{suite} {seed}: its process was killed twice, perhaps for lack of memory; free some and add --resume"
            )
        rollout, after, found = result
        episode = sample_episode(suite, seed, dict(foods))
        judged = judge_geometry(episode.spec, episode.item, rollout, after)
        row = _row(episode, rollout, judged)
        yield row | {"severing": found.as_dict()} if world.coupled else row


def _rows(path: Path, about: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of an evaluation that was stopped; a line that was cut off is dropped."""
    if not path.exists():
        return []
    whole = [line for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
    path.write_text("".join(whole), encoding="utf-8")
    if not whole:
        return []
    if json.loads(whole[0]) != json.loads(json.dumps(about)):
        raise OutputError(
            f"--out {path.parent}: holds an evaluation of something else ({path.name}); choose another folder"
        )
    return [json.loads(line) for line in whole[1:]]


def _words(row: Mapping[str, Any]) -> str:
    found = row.get("severing")
    if found is None:
        return "published criteria met" if row["published"] else "not met"
    return str(found["why"])


def _count(rows: Sequence[Mapping[str, Any]], sigma: float | None) -> dict[str, Any]:
    """Rates of success of a suite."""
    out: dict[str, Any] = {
        "what": SUITES[rows[0]["suite"]].what if rows else "",
        "published": success_rate([r["published"] for r in rows]),
        "strict": success_rate([r["strict"] for r in rows]),
        "criteria": {},
        "clipped_steps": sum(r["clipped"] for r in rows),
    }
    for name in ("tip", "region", "angle", "place", "strict_tip", "count", "even"):
        found = [r["criteria"][name] for r in rows if name in r["criteria"]]
        if found:
            out["criteria"][name] = success_rate(found)
    cut = [r["severing"]["severed"] for r in rows if "severing" in r]
    if cut:
        out["severing"] = success_rate([c for c in cut if c is not None])
        out["not_simulated"] = sum(c is None for c in cut)
        both = [
            r["published"] and r["severing"]["severed"]
            for r in rows
            if "severing" in r and r["severing"]["severed"] is not None
        ]
        out["published_and_severed"] = success_rate(both)
    if sigma is not None and rows and not any(r["pieces"] for r in rows):
        out["expected_place"] = sum(expected_place_rate(r["length_m"], sigma) for r in rows) / len(rows)
    return out


def success_rate(found: Sequence[bool]) -> dict[str, float | int]:
    """Successes, trials, rate and its 95 % interval."""
    n, k = len(found), sum(bool(f) for f in found)
    low, high = wilson(k, n)
    return {"successes": k, "trials": n, "rate": k / n if n else 0.0, "low95": low, "high95": high}
