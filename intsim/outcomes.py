"""What an evaluation finds: of each episode, of each suite, and together; evaluate.jsonl and evaluate.json."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from calib.io.typed_document import FLAT
from intsim.sim.severing import SeveringOutcome
from intsim.sim.world import World
from intsim.task.selection import TrainingTasks
from intsim.task.success import CRITERIA, PLACE_TOLERANCE, GeometricOutcome, wilson
from intsim.task.suites import SUITES, Episode
from mpm.scene import Arm


@dataclass(frozen=True)
class ArmSettings:
    """What holds the knife in the solver.

    Attributes:
        stiffness: Vertical stiffness [N/m]; None for a rigid one.
        force_limit: Most force [N]; None without a limit.
    """

    stiffness: float | None
    force_limit: float | None

    @staticmethod
    def of(arm: Arm) -> ArmSettings:
        """Those of an arm of the solver."""
        return ArmSettings(arm.stiffness, arm.force_limit)


@dataclass(frozen=True)
class WorldSettings:
    """Where the episodes took place in IntSim.

    Attributes:
        coupled: Whether the food resists.
        stiffness: Of all the arm's joints [N m/rad]; None for libfranka's example gains.
    """

    coupled: bool
    stiffness: float | None

    @staticmethod
    def of(world: World | None) -> WorldSettings | None:
        """Those of a world; None on the plain table."""
        return None if world is None else WorldSettings(world.coupled, world.stiffness)


@dataclass(frozen=True)
class EvaluationSettings:
    """What was evaluated: the first line of evaluate.jsonl. Two evaluations with the same settings may be mixed.

    Attributes:
        policy: Who moved the knife.
        foods: Foods that were asked for, and SHA-256 over the values of each.
        knife: Name of the knife.
        seed: Of the first episode of each suite, above those of training.
        sigma_m: Standard deviation of the noisy oracle's place [m]; None for others.
        severing: Whether single cuts were simulated.
        arm: What holds the knife in the solver.
        world: Where the episodes took place in IntSim; None on the plain table.
        paper: Figure of the paper whose tasks were asked for; None for the suites as they are.
        trained: What the policy has learnt from; None where it has not learnt, or does not say.
    """

    policy: str
    foods: Mapping[str, str]
    knife: str
    seed: int
    sigma_m: float | None
    severing: bool
    arm: ArmSettings
    world: WorldSettings | None
    paper: str | None = None
    trained: TrainingTasks | None = None


@dataclass(frozen=True)
class EpisodeOutcome:
    """What was asked for in an episode, and what was found: a line of evaluate.jsonl.

    Attributes:
        suite, seed: Which episode.
        food, instruction: What was asked for, in words.
        ratio, side, pieces: The same in numbers, as in :class:`intsim.task.targets.CutSpec`.
        length_m: Length of the food [m].
        steps: Control steps.
        clipped: Steps in which a command was beyond the arm's limits.
        height_m: Lowest height of the edge above the table [m].
        angle_rad: Between the edge and across the food [rad]; NaN where the food was not met.
        offset: Place of the cut less the one asked for, over the food's length [-]; NaN where it was not met.
        criteria: Which criteria are met.
        pieces_made: Pieces of the food at the end, in plain geometry.
        offsets: Of every cut in order, the error of its place over the length of what was cut [-].
        volume_variation: Standard deviation of the volumes of the pieces over their mean [-]; NaN for one piece.
        published: Whether the four published criteria are.
        strict: Whether the stricter ones are.
        severing: What the solver has found; None where it was not asked.
    """

    suite: str
    seed: int
    food: str
    instruction: str
    ratio: float
    side: str
    pieces: int
    length_m: float
    steps: int
    clipped: int
    height_m: float
    angle_rad: float
    offset: float
    criteria: Mapping[str, bool]
    pieces_made: int
    offsets: Sequence[float]
    volume_variation: float
    published: bool
    strict: bool
    severing: SeveringOutcome | None = None

    @staticmethod
    def of(
        episode: Episode,
        clipped: Sequence[tuple[str, ...]],
        judged: GeometricOutcome,
        severing: SeveringOutcome | None,
    ) -> EpisodeOutcome:
        """The outcome of an episode.

        Args:
            episode: What was asked for.
            clipped: Limits that were met, for each control step.
            judged: What geometry says.
            severing: What the solver says; None where it was not asked.

        Returns:
            Both together.
        """
        return EpisodeOutcome(
            suite=episode.suite,
            seed=episode.seed,
            food=episode.item.name,
            instruction=episode.instruction,
            ratio=float(episode.spec.ratio),
            side=episode.spec.side,
            pieces=episode.spec.pieces,
            length_m=episode.item.shape.length,
            steps=len(clipped),
            clipped=sum(bool(limits) for limits in clipped),
            height_m=judged.height,
            angle_rad=judged.angle,
            offset=judged.offset,
            criteria=dict(judged.criteria),
            pieces_made=judged.pieces,
            offsets=judged.offsets,
            volume_variation=judged.volume_variation,
            published=judged.published,
            strict=judged.strict,
            severing=severing,
        )

    def words(self) -> str:
        """The finding in words."""
        if self.severing is None:
            return "published criteria met" if self.published else "not met"
        return self.severing.why


@dataclass(frozen=True)
class SuccessRate:
    """How often something succeeded.

    Attributes:
        successes: Successes.
        trials: Trials.
    """

    KEYS: ClassVar[tuple[str, ...]] = ("successes", "trials", "rate", "low95", "high95")

    successes: int
    trials: int

    @staticmethod
    def of(found: Sequence[bool]) -> SuccessRate:
        """The rate of some trials."""
        return SuccessRate(sum(bool(one) for one in found), len(found))

    @property
    def rate(self) -> float:
        """Successes over trials; 0 without trials."""
        return self.successes / self.trials if self.trials else 0.0

    @property
    def low95(self) -> float:
        """Lower end of the 95 % interval of the rate (Wilson 1927)."""
        return wilson(self.successes, self.trials)[0]

    @property
    def high95(self) -> float:
        """Upper end of the 95 % interval of the rate (Wilson 1927)."""
        return wilson(self.successes, self.trials)[1]


@dataclass(frozen=True)
class SuiteResult:
    """Successes in one suite.

    Attributes:
        what: What the suite tests.
        published: The four published criteria together.
        strict: The same, to 5 mm above the table, and equal pieces.
        criteria: Each criterion alone.
        clipped_steps: Steps in which a command was beyond the arm's limits.
        severing: Episodes whose food is in pieces in the solver; None where none was simulated, as the next two.
        not_simulated: Those of them that the solver cannot make or did not end: they are in every denominator, and
            no success.
        published_and_severed: Episodes that are in pieces and meet the published criteria.
        steps: Of equal pieces, how often the k-th cut was where it had to be, to a tenth of the piece that was cut, by
            pieces and cut, such as ``1/5, cut 3``; a cut that was not made missed. None without equal pieces.
        volume_variation: Mean over the splits that left pieces of the standard deviation of their volumes over the
            mean [-]: 0 for equal pieces. None without any.
        expected_place: Rate of the place criterion that the noisy oracle's closed form gives; None for others.
    """

    what: str
    published: SuccessRate
    strict: SuccessRate
    criteria: Mapping[str, SuccessRate]
    clipped_steps: int
    severing: SuccessRate | None = None
    not_simulated: int | None = None
    published_and_severed: SuccessRate | None = None
    steps: Mapping[str, SuccessRate] | None = None
    volume_variation: float | None = None
    expected_place: float | None = None

    @staticmethod
    def of(rows: Sequence[EpisodeOutcome], sigma: float | None) -> SuiteResult:
        """The successes of the episodes of one suite.

        Args:
            rows: The episodes.
            sigma: Standard deviation of the noisy oracle [m]; None for others.
        """
        cuts = [(row.published, row.severing.severed) for row in rows if row.severing is not None]
        single = sigma is not None and bool(rows) and not any(row.pieces for row in rows)
        return SuiteResult(
            what=SUITES[rows[0].suite].what if rows else "",
            published=SuccessRate.of([row.published for row in rows]),
            strict=SuccessRate.of([row.strict for row in rows]),
            criteria={
                name: SuccessRate.of([row.criteria[name] for row in rows if name in row.criteria])
                for name in CRITERIA
                if any(name in row.criteria for row in rows)
            },
            clipped_steps=sum(row.clipped for row in rows),
            severing=SuccessRate.of([bool(severed) for _, severed in cuts]) if cuts else None,
            not_simulated=sum(severed is None for _, severed in cuts) if cuts else None,
            published_and_severed=SuccessRate.of([published and bool(severed) for published, severed in cuts])
            if cuts
            else None,
            steps=_step_rates(rows),
            volume_variation=_mean_variation(rows),
            expected_place=_mean_place_rate(rows, sigma) if single and sigma is not None else None,
        )


def _step_rates(rows: Sequence[EpisodeOutcome]) -> dict[str, SuccessRate] | None:
    """How often each cut of a split was where it had to be."""
    out = {}
    for pieces in sorted({row.pieces for row in rows if row.pieces}):
        asked = [row.offsets for row in rows if row.pieces == pieces]
        for k in range(pieces - 1):
            found = [len(offsets) > k and abs(offsets[k]) <= PLACE_TOLERANCE for offsets in asked]
            out[f"1/{pieces}, cut {k + 1}"] = SuccessRate.of(found)
    return out or None


def _mean_variation(rows: Sequence[EpisodeOutcome]) -> float | None:
    """Mean of how uneven the pieces of splits are; None without any."""
    found = [row.volume_variation for row in rows if row.pieces and row.pieces_made > 1]
    return sum(found) / len(found) if found else None


def expected_place_rate(length: float, sigma: float) -> float:
    """Chance that a cut whose place has a normal error is within the published tolerance [-].

    It is erf(0.1 L / (sigma sqrt 2)).

    Args:
        length: L, length of the food [m].
        sigma: Standard deviation of the place [m].
    """
    return math.erf(PLACE_TOLERANCE * length / (sigma * math.sqrt(2.0)))


def _mean_place_rate(rows: Sequence[EpisodeOutcome], sigma: float) -> float:
    """Mean of :func:`expected_place_rate` over the foods of some episodes."""
    return sum(expected_place_rate(row.length_m, sigma) for row in rows) / len(rows)


@dataclass(frozen=True)
class EvaluationResult:
    """What an evaluation found: evaluate.json.

    Attributes:
        settings: What was evaluated.
        suites: Successes by suite.
        command: Command line that it came from.
        versions: Of cutcal, Python and the packages that it depends on.
        git: Commit of the checkout; None where cutcal is installed.
    """

    DOCUMENT: ClassVar[str] = "evaluate"

    settings: EvaluationSettings = field(metadata=FLAT)
    suites: Mapping[str, SuiteResult]
    command: Sequence[str]
    versions: Mapping[str, str]
    git: str | None
