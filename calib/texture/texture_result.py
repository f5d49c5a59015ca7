"""What ``cutcal press tpa`` ends with: ``tpa.json`` and the curves of ``curves.csv``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np

from calib.io.folder import write_csv, write_json
from calib.io.provenance import CommandLine, Commit, Seed, Versions
from calib.io.type_schema import NumberOrNull, Positive, Shared, keywords, one_of
from calib.io.typed_document import FLAT, to_document
from calib.texture.law_result import LawResult
from calib.texture.plate_record import RecordedFile
from calib.texture.repeats import Ratio, Scatter
from calib.texture.texture_profile import TextureProfile
from calib.validation.acceptance import Verdict
from mpm.arrays import FloatArray

RESULT_FILE, CURVES_FILE = "tpa.json", "curves.csv"
ONLY, ALONG, ACROSS = "only", "along", "across"
ONE = keywords(description="One of them")
Direction = Annotated[str, one_of(ONLY, ALONG, ACROSS)]
QUANTITIES = ("hardness_N", "cohesiveness", "springiness", "resilience", "adhesiveness_Ns")
"""Quantities of which groups have a mean and a scatter."""


@dataclass(frozen=True)
class RepeatProfile:
    """Texture profile of one specimen, by its name.

    Attributes:
        name: Its name.
        profile: Its texture profile.
    """

    name: str
    profile: TextureProfile = field(metadata=FLAT)


@dataclass(frozen=True)
class TextureGroup:
    """Repeats of one direction at one speed.

    Attributes:
        name: Its name: direction and time of the first descent.
        direction: Direction of the load: along or across the fibres, or only one that was measured.
        descent_s: Median time in which the plate goes down [s].
        hardness_N: Largest load of the first bite [N].
        cohesiveness: Area of the second bite over that of the first [-].
        springiness: Way of the second bite over that of the first [-].
        resilience: Area behind the peak of the first bite over that before it [-].
        adhesiveness_Ns: Area below load zero between the bites [N s].
        repeats: The specimens.
    """

    name: str
    direction: Direction
    descent_s: Positive
    hardness_N: Scatter
    cohesiveness: Scatter
    springiness: Scatter
    resilience: Scatter
    adhesiveness_Ns: Scatter
    repeats: Annotated[tuple[Annotated[RepeatProfile, ONE], ...], keywords(minItems=1)]


@dataclass(frozen=True)
class DirectionRatio:
    """Along over across the fibres of one quantity.

    Attributes:
        quantity: The quantity.
        descent_s: Time in which the plate goes down [s]; null where specimens of all speeds are taken together.
        ratio: The ratio of the means, with its interval.
    """

    quantity: str
    descent_s: NumberOrNull
    ratio: Ratio = field(metadata=FLAT)


@dataclass(frozen=True, kw_only=True)
class TextureResult:
    """Texture profile of two bites.

    ``tpa.json`` of ``cutcal press tpa``, and what ``cutcal press tpa --json`` prints.

    Attributes:
        command: Command line, or the call from Python, that made the document.
        trigger_N: Load from which the plate touches the food [N]; null for 5 % of the first peak of each record.
        groups: Repeats by direction and speed.
        ratios: Along over across the fibres; empty where one direction was measured.
        laws: Law of each direction, with --law; empty without.
        verdicts: Lines of the verdict on the laws; empty without.
        not_shown: What the result does not show, one sentence each.
        seed: Seed of the draws.
        files: Files of the test.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
    """

    DOCUMENT: ClassVar[str] = "tpa"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "trigger_N", "groups", "ratios", "laws", "verdicts", "passed", "not_shown", "seed", "files",
        "versions", "git",
    )  # fmt: skip

    command: CommandLine
    trigger_N: NumberOrNull
    groups: Annotated[tuple[Annotated[TextureGroup, ONE], ...], keywords(minItems=1)]
    ratios: tuple[Annotated[DirectionRatio, ONE], ...]
    laws: tuple[Annotated[LawResult, ONE], ...]
    verdicts: tuple[Annotated[Verdict, Shared("verdict")], ...]
    not_shown: Annotated[tuple[str, ...], Shared("limits")]
    seed: Seed
    files: Annotated[tuple[Annotated[RecordedFile, keywords(description="One file")], ...], keywords(minItems=1)]
    versions: Versions
    git: Commit

    @property
    def passed(self) -> bool:
        """Whether every line that is judged passed; true where nothing is judged."""
        return all(line.passed is not False for line in self.verdicts)

    @property
    def device(self) -> str:
        """Nothing is simulated on a device."""
        return "none"


@dataclass(frozen=True, eq=False)
class BiteCurves:
    """Two bites of each repeat of a group, on common times.

    Attributes:
        group: Name of the group.
        time: Time from the first peak [s], shape (n,).
        loads: Load of each repeat [N], shape (repeats, n).
        predicted: Load that the law of the other speeds predicts [N], shape (n,); None without a law.
    """

    group: str
    time: FloatArray
    loads: FloatArray
    predicted: FloatArray | None = None


def write_result(result: TextureResult, curves: Sequence[BiteCurves], out: Path) -> None:
    """Write ``tpa.json``, and ``curves.csv`` with mean and scatter of each group.

    Args:
        result: The result.
        curves: Loads of each group.
        out: Output folder.

    Raises:
        OutputError: A file cannot be written.
    """
    columns = {
        "group": np.concatenate([[one.group] * len(one.time) for one in curves]),
        "time_s": np.concatenate([one.time for one in curves]),
        "mean_N": np.concatenate([one.loads.mean(axis=0) for one in curves]),
        "low_N": np.concatenate([one.loads.min(axis=0) for one in curves]),
        "high_N": np.concatenate([one.loads.max(axis=0) for one in curves]),
    }
    if any(one.predicted is not None for one in curves):
        empty = [np.full(len(one.time), np.nan) if one.predicted is None else one.predicted for one in curves]
        columns["predicted_N"] = np.concatenate(empty)
    write_csv(out / CURVES_FILE, columns, head=["low_N and high_N: smallest and largest load of the repeats"])
    write_json(out / RESULT_FILE, to_document(result))
