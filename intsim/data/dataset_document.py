"""dataset.json: what a dataset is, what it holds, and what its pictures took; written and read back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from calib.errors import DocumentError, OutputError
from calib.io.folder import write_json
from calib.io.typed_document import from_document, to_document
from intsim.data.manifest import Manifest
from intsim.sim.world import World
from intsim.task.targets import TaskError

DATASET_FILE = "dataset.json"
DEMONSTRATION_KINDS = ("sustained", "planned", "kinematic")
"""Kinds of demonstration.

``sustained`` goes on until the food is in pieces. ``planned`` is the motion that geometry plans, whatever the food
does. ``kinematic`` is the same in food that does not resist: it is in pieces in geometry alone.
"""


@dataclass(frozen=True)
class DatasetSpec:
    """What a dataset is: all that its trajectories follow from.

    Attributes:
        manifest: Which trajectories there are.
        demos: Kind of demonstration, in :data:`DEMONSTRATION_KINDS`.
        knife: Name of the knife.
        stiffness: Of all the arm's joints [N m/rad]; None for libfranka's example gains.
        shard: Trajectories of a file.

    Raises:
        TaskError: A kind of demonstration that is none.
    """

    DOCUMENT: ClassVar[str] = "dataset"

    manifest: Manifest
    demos: str = "sustained"
    knife: str = "kitchen"
    stiffness: float | None = field(default_factory=lambda: None)  # no plain default: None is written as null
    shard: int = 20

    def __post_init__(self) -> None:
        if self.demos not in DEMONSTRATION_KINDS:
            raise TaskError(f"dataset: demos {self.demos!r} is none of {', '.join(DEMONSTRATION_KINDS)}")

    @property
    def world(self) -> World:
        """Where the demonstrations are made."""
        return World(self.demos != "kinematic", self.stiffness, self.knife)

    @property
    def shards(self) -> list[range]:
        """Numbers of the trajectories of each file."""
        count = self.manifest.trajectories
        return [range(k, min(k + self.shard, count)) for k in range(0, count, self.shard)]


@dataclass(frozen=True)
class BrokenTrajectory:
    """A trajectory in which the solver or the arm did not follow.

    Attributes:
        index: Its number.
        status: What went wrong.
    """

    index: int
    status: str


@dataclass(frozen=True)
class CoreSeconds:
    """Mean time of one core for an episode.

    Attributes:
        solver: In the cutting solver [s].
        robot: In the robot simulator and everything else [s].
    """

    solver: float
    robot: float


@dataclass(frozen=True)
class DatasetTotals:
    """What a finished dataset holds, and what it took.

    Attributes:
        trajectories: Trajectories that were made.
        steps: Control steps of all of them.
        published: Those that meet the published criteria.
        severed: Those whose food is in as many pieces as asked for.
        broken: Those in which the solver or the arm did not follow.
        foods: Trajectories of each food.
        seconds_per_episode: Mean time of one core [s].
        most_solver_s: Longest time of the solver in one episode [s].
        core_hours_of_21000: Core hours of the trajectories of the published data set, at the mean.
        bytes: Size of the shards [bytes].
        command: Command line that they came from.
        versions: Of cutcal, Python and the packages that they depend on.
        git: Commit of the checkout; None where cutcal is installed.
    """

    trajectories: int
    steps: int
    published: int
    severed: int
    broken: Sequence[BrokenTrajectory]
    foods: Mapping[str, int]
    seconds_per_episode: CoreSeconds
    most_solver_s: float
    core_hours_of_21000: float
    bytes: int
    command: Sequence[str]
    versions: Mapping[str, str]
    git: str | None


@dataclass(frozen=True)
class PictureTotals:
    """The pictures that were rendered last, and what they took.

    Attributes:
        scenes: Backgrounds.
        pixels: Width and height.
        number: Pictures of all cameras, steps and backgrounds.
        seconds_per_episode: Mean time of one core for a trajectory before one background [s].
        core_hours_of_315000: Core hours of the published data set before 15 backgrounds, at the mean.
        bytes: Size of their files [bytes].
    """

    scenes: Sequence[int]
    pixels: int
    number: int
    seconds_per_episode: float
    core_hours_of_315000: float
    bytes: int


@dataclass(frozen=True)
class DatasetDocument:
    """The content of dataset.json.

    Attributes:
        spec: What the dataset is.
        totals: What it holds; None until it is finished.
        pictures: What was rendered last; None before.
    """

    spec: DatasetSpec
    totals: DatasetTotals | None = None
    pictures: PictureTotals | None = None

    def as_dict(self) -> dict[str, Any]:
        """As plain data, in the order of the file."""
        totals = {} if self.totals is None else to_document(self.totals)
        pictures = {} if self.pictures is None else {"pictures": to_document(self.pictures)}
        return to_document(self.spec) | totals | pictures

    def write(self, folder: Path) -> None:
        """Write dataset.json into a folder.

        Raises:
            OutputError: It cannot be written.
        """
        write_json(folder / DATASET_FILE, self.as_dict())

    @staticmethod
    def read(folder: Path) -> DatasetDocument:
        """Read dataset.json from a folder.

        Raises:
            OutputError: It is not there, damaged or incomplete.
        """
        path = folder / DATASET_FILE
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            spec = from_document(DatasetSpec, content)
            totals = from_document(DatasetTotals, content) if "trajectories" in content else None
            pictures = from_document(PictureTotals, content["pictures"], "pictures") if "pictures" in content else None
        except (OSError, ValueError, DocumentError) as e:
            raise OutputError(f"{path}: not there or damaged ({e}); make the dataset again") from None
        return DatasetDocument(spec, totals, pictures)
