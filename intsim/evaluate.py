"""Episodes of a policy, judged one by one and counted with intervals; a stopped evaluation goes on."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import DocumentError, OutputError
from calib.io.folder import finite, prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import git_commit, key_of, versions
from calib.io.typed_document import from_document, to_document
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.simulation.workers import Workers
from intsim.outcomes import (
    ArmSettings,
    EpisodeOutcome,
    EvaluationResult,
    EvaluationSettings,
    SuiteResult,
    WorldSettings,
)
from intsim.sim.closed_loop import closed_loop_episode
from intsim.sim.severing import PANDA_ARM, SeveringOutcome, simulate_severing
from intsim.sim.world import World
from intsim.task.kinematic_table import KinematicTable
from intsim.task.rollout import Policy, Rollout
from intsim.task.selection import TrainingTasks
from intsim.task.success import GeometricOutcome, judge_geometry
from intsim.task.suites import FIRST_TEST_SEED, Episode, FixedTask, sample_episode
from intsim.task.targets import target
from mpm.scene import Arm
from mpm.scene.errors import CutcalError

TABLE_STEPS = 2000  # of an episode on the plain table, at most: 100 s
TASK_SEEDS = 10_000  # seeds of each task that is asked for in place of what a suite draws
ROWS_FILE, RESULT_FILE = "evaluate.jsonl", "evaluate.json"


@dataclass(frozen=True, eq=False)
class PolicyEvaluation:
    """What is evaluated.

    Attributes:
        policy: Who moves the knife.
        name: What it is called.
        foods: Foods that are asked for, by name.
        suites: Names in :data:`intsim.task.suites.SUITES`.
        episodes: Episodes of each suite.
        seed: Of the first episode of each suite, above :data:`intsim.task.suites.FIRST_TEST_SEED`.
        sigma: Standard deviation of the noisy oracle [m]: its closed form is given beside what was found.
        severing: Whether single cuts on the table are simulated in the solver too.
        knife: Name of the knife.
        arm: What holds it in the solver, on the table.
        world: Where the episodes take place: in IntSim, in closed loop with the food; None for the plain table.
        paper: Figure of the paper whose tasks are asked for; None for the suites as they are.
        tasks: What is asked for, suite and task; ``episodes`` of each. Empty for what the suites draw.
        trained: What the policy has learnt from; None where it has not learnt, or does not say.
    """

    policy: Policy
    name: str
    foods: Mapping[str, FoodSpec]
    suites: Sequence[str]
    episodes: int
    seed: int = 0
    sigma: float | None = None
    severing: bool = False
    knife: str = "kitchen"
    arm: Arm = PANDA_ARM
    world: World | None = None
    paper: str | None = None
    tasks: Sequence[tuple[str, FixedTask]] = ()
    trained: TrainingTasks | None = None

    def __post_init__(self) -> None:
        if self.tasks and self.episodes > TASK_SEEDS:
            raise CutcalError(f"evaluate: {self.episodes} episodes of a task; at most {TASK_SEEDS}")

    @property
    def settings(self) -> EvaluationSettings:
        """What the results say of it."""
        return EvaluationSettings(
            policy=self.name,
            foods={name: key_of(vars(food.to_scene_food().material)) for name, food in self.foods.items()},
            knife=self.knife,
            seed=self.seed,
            sigma_m=self.sigma,
            severing=self.severing,
            arm=ArmSettings.of(self.arm),
            world=WorldSettings.of(self.world),
            paper=self.paper,
            trained=self.trained,
        )

    @property
    def tests(self) -> list[tuple[str, int]]:
        """Suite and seed of every episode."""
        first = FIRST_TEST_SEED + self.seed
        if self.tasks:
            starts = [(suite, first + TASK_SEEDS * n) for n, (suite, _) in enumerate(self.tasks)]
            return [(suite, start + k) for k in range(self.episodes) for suite, start in starts]
        return [(suite, first + k) for suite in self.suites for k in range(self.episodes)]

    def episode(self, suite: str, seed: int) -> Episode:
        """The episode of one of :attr:`tests`."""
        if not self.tasks:
            return sample_episode(suite, seed, dict(self.foods))
        _, task = self.tasks[(seed - FIRST_TEST_SEED - self.seed) // TASK_SEEDS]
        return sample_episode(suite, seed, dict(self.foods), task)


def roll_out(policy: Policy, episode: Episode) -> tuple[Rollout, KinematicTable]:
    """One episode on the plain table: what has happened, and the table at its end."""
    table = KinematicTable([episode.item, *episode.others])
    policy.reset(zlib.crc32(f"{episode.suite} {episode.seed}".encode()))
    for _ in range(TABLE_STEPS):
        action = policy.act(table.observe(), episode.instruction)
        if action is None:
            break
        table.step(action)
    return table.rollout, table


def run_episode(evaluation: PolicyEvaluation, episode: Episode) -> EpisodeOutcome:
    """One episode on the plain table, its cut simulated where the evaluation asks for it."""
    rollout, table = roll_out(evaluation.policy, episode)
    judged = judge_geometry(episode.spec, episode.item, rollout, table.items[0])
    simulated = evaluation.severing and not episode.spec.pieces
    severing = _simulate(evaluation, episode, rollout, judged) if simulated else None
    return EpisodeOutcome.of(episode, rollout.clipped, judged, severing)


def _simulate(
    evaluation: PolicyEvaluation, episode: Episode, rollout: Rollout, judged: GeometricOutcome
) -> SeveringOutcome:
    """The cut in the solver, where the edge came down over the food."""
    if not judged.criteria["region"] or not math.isfinite(judged.offset):
        return SeveringOutcome(False, why="the edge does not come down on the food")
    item = episode.item
    along = target(episode.spec, item) + judged.offset * item.shape.length
    food, command = evaluation.foods[item.name], np.array(rollout.command)
    return simulate_severing(item, along, command, food, knife=evaluation.knife, arm=evaluation.arm)[0]


def evaluate(
    evaluation: PolicyEvaluation,
    out: Path,
    *,
    pool: Workers | None = None,
    resume: bool = False,
    say: Callable[[str], None] = lambda _: None,
    command: Sequence[str] = (),
) -> EvaluationResult:
    """Evaluate a policy, and write evaluate.jsonl (a row for each episode) and evaluate.json.

    Args:
        evaluation: What is evaluated.
        out: Folder of the results.
        pool: Where IntSim runs; not needed on the plain table.
        resume: Go on with what is in ``out``.
        say: Called with a line now and then.
        command: Command line, for provenance.

    Returns:
        What evaluate.json holds.

    Raises:
        CutcalError: The folder is taken, holds another evaluation or a damaged one, or there is a world and no pool.
    """
    if evaluation.world is not None and pool is None:
        raise CutcalError("evaluate: episodes in IntSim run in worker processes; give a pool")
    load_knife(evaluation.knife)
    with prepare(out, "evaluate", resume=resume):
        settings = evaluation.settings
        rows = _read_rows(out / ROWS_FILE, settings)
        done = {(row.suite, row.seed) for row in rows}
        todo = [test for test in evaluation.tests if test not in done]
        often = evaluation.severing or evaluation.world is not None
        with (out / ROWS_FILE).open("a", encoding="utf-8") as file:
            if not rows and file.tell() == 0:
                file.write(_line(settings))
            rest = Countdown(max(len(todo), 1))
            for k, row in enumerate(_outcomes(evaluation, todo, pool), 1):
                rows.append(row)
                file.write(_line(row))
                file.flush()
                left = rest.left(1)
                if often or k % 100 == 0:
                    say(f"{k} of {len(todo)} episodes: {row.suite}, {row.food}, {row.words()}; {left}")
        result = EvaluationResult(settings, _by_suite(evaluation, rows), tuple(command), versions(), git_commit())
        write_json(out / RESULT_FILE, to_document(result))
        return result


def _by_suite(evaluation: PolicyEvaluation, rows: Sequence[EpisodeOutcome]) -> dict[str, SuiteResult]:
    """Successes by suite of the episodes that were asked for."""
    wanted = set(evaluation.tests)
    kept = [row for row in rows if (row.suite, row.seed) in wanted]
    return {s: SuiteResult.of([row for row in kept if row.suite == s], evaluation.sigma) for s in evaluation.suites}


def _outcomes(
    evaluation: PolicyEvaluation, todo: Sequence[tuple[str, int]], pool: Workers | None
) -> Iterator[EpisodeOutcome]:
    """Episodes one after the other, on the table or in IntSim."""
    if evaluation.world is not None and pool is not None:
        yield from _in_world(evaluation, evaluation.world, todo, pool)
        return
    for suite, seed in todo:
        yield run_episode(evaluation, evaluation.episode(suite, seed))


def _in_world(
    evaluation: PolicyEvaluation, world: World, todo: Sequence[tuple[str, int]], pool: Workers
) -> Iterator[EpisodeOutcome]:
    """Episodes in IntSim, in order of completion."""
    foods, episodes = dict(evaluation.foods), [evaluation.episode(suite, seed) for suite, seed in todo]
    jobs = [(evaluation.policy, episode, foods, world) for episode in episodes]
    for k, result in pool.each(closed_loop_episode, jobs):
        episode = episodes[k]
        if result is None:
            raise OutputError(
                f"{episode.suite} {episode.seed}: its process was killed twice, perhaps for lack of memory; free some "
                "and add --resume"
            )
        rollout, after, found = result
        judged = judge_geometry(episode.spec, episode.item, rollout, after)
        yield EpisodeOutcome.of(episode, rollout.clipped, judged, found if world.coupled else None)


def _line(part: EvaluationSettings | EpisodeOutcome) -> str:
    """A line of evaluate.jsonl."""
    return json.dumps(finite(to_document(part))) + "\n"


def _read_rows(path: Path, settings: EvaluationSettings) -> list[EpisodeOutcome]:
    """Rows of an evaluation that was stopped; a line that was cut off is dropped."""
    if not path.exists():
        return []
    whole = [line for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
    path.write_text("".join(whole), encoding="utf-8")
    if not whole:
        return []
    before, rows = _parsed(path, whole)
    if before != settings:
        raise OutputError(
            f"--out {path.parent}: holds an evaluation of something else ({path.name}); choose another folder"
        )
    return rows


def _parsed(path: Path, lines: Sequence[str]) -> tuple[EvaluationSettings, list[EpisodeOutcome]]:
    """Settings and episodes of the whole lines of evaluate.jsonl."""
    try:
        settings = from_document(EvaluationSettings, json.loads(lines[0]))
        return settings, [from_document(EpisodeOutcome, json.loads(line)) for line in lines[1:]]
    except (ValueError, DocumentError) as e:
        raise OutputError(f"{path}: damaged ({e}); choose another folder") from None


def read_evaluation(folder: Path) -> tuple[EvaluationSettings, list[EpisodeOutcome]]:
    """Settings and episodes of a finished evaluation.

    Args:
        folder: Its folder.

    Returns:
        What was evaluated, and its episodes.

    Raises:
        OutputError: There is none, it is not finished, or it is damaged.
    """
    path = folder / ROWS_FILE
    if not (folder / RESULT_FILE).exists():
        state = (
            "an evaluation that is not finished; add --resume to the command that began it"
            if path.exists()
            else (f"no evaluation ({RESULT_FILE}); name a folder of cutcal evaluate")
        )
        raise OutputError(f"{folder}: holds {state}")
    try:
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    except (OSError, UnicodeDecodeError) as e:
        raise OutputError(f"{path}: cannot be read ({e})") from None
    if not lines:
        raise OutputError(f"{path}: is empty; make the evaluation again")
    return _parsed(path, lines)
