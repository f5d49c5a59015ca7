"""What a comparison with the recorded cuts ends with: ``regress.json``, and the new curves beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from calib.io.folder import write_csv, write_json
from calib.io.provenance import Commit, DeviceName, Versions
from calib.io.type_schema import NotNegative, NumberOrNull, keywords, one_of
from calib.io.typed_document import to_document
from mpm.arrays import FloatArray
from mpm.scene import CONTACTS
from studies.regression.reference_curves import DIGITS

RESULT_FILE = "regress.json"
VERDICT_MEANINGS = {
    "same": "the recorded curve, but for rounding",
    "within": "another curve, but no further away than another seed's",
    "outside": "further away than another seed's",
    "broke down": "the cut did not reach its end",
    "new": "nothing was recorded that could be read",
}
VERDICT: Mapping[str, Any] = {
    "description": "same: the recorded curve but for rounding; within: no further away than another seed's; "
    "outside: further; broke down: no end; new: nothing recorded",
    "enum": [*VERDICT_MEANINGS],
}
"""JSON Schema of a verdict."""
VerdictWord = Annotated[str, one_of(*VERDICT_MEANINGS)]


@dataclass(frozen=True, kw_only=True)
class NumberChange:
    """One number of a cut: as it was recorded, as it is, and how far that is; without a record only as it is.

    Attributes:
        before: As it was recorded.
        now: As it is.
        change: Now less before.
        over_limit: Size of the change over what two seeds differ by in 95 of 100 pairs [-].
    """

    before: float | None = None
    now: float
    change: float | None = None
    over_limit: NotNegative | None = None


@dataclass(frozen=True)
class NumberChanges:
    """Peak [N], stroke at which it is [m], and work [J] of a cut.

    Attributes:
        peak_N: One number of a cut.
        peak_stroke_m: One number of a cut.
        work_J: One number of a cut.
    """

    peak_N: NumberChange
    peak_stroke_m: NumberChange
    work_J: NumberChange


@dataclass(frozen=True)
class LargestDeviation:
    """The deviation that is largest over its tolerance.

    Attributes:
        column: Column of the reference.
        stroke_m: Where [m].
        difference: How much, in the unit of the column.
        over_tolerance: The same over the tolerance [-].
        part: Largest deviation of any column over the largest force or work [-].
    """

    column: str
    stroke_m: float
    difference: NotNegative
    over_tolerance: NotNegative
    part: NotNegative


@dataclass(frozen=True, kw_only=True)
class CutComparison:
    """What became of a recorded cut.

    Attributes:
        food: Food of materials.yaml.
        contact: Kind of contact.
        reason: Why a cut broke down; empty where it did not.
        recorded: Whether a new reference was written.
        because: What is another than when the reference was recorded.
        results: Largest force [N], stroke at which it is [m], and work [J].
        shape_error: Difference of the curves, each over its own peak [-]; null where one has no force.
        nrmse: Root mean square difference of the curves over the recorded peak [-].
        verdict: same: the recorded curve but for rounding; within: no further away than another seed's; outside:
            further; broke down: no end; new: nothing recorded.
        largest: The deviation that is largest over its tolerance.
        columns: The new curves by the names of the reference's columns, (60,) each; None where the cut broke down.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "food", "contact", "reason", "recorded", "because", "results", "shape_error", "nrmse", "verdict", "largest",
    )  # fmt: skip

    food: str
    contact: Annotated[str, one_of(*CONTACTS)]
    reason: str = ""
    recorded: bool = False
    because: tuple[str, ...] = ()
    results: NumberChanges | None = None
    shape_error: NumberOrNull | None = None
    nrmse: NumberOrNull | None = None
    verdict: VerdictWord
    largest: LargestDeviation | None = None
    columns: Mapping[str, FloatArray] | None = field(default=None, compare=False)


@dataclass(frozen=True, kw_only=True)
class RegressionResult:
    """Cuts against those that were recorded.

    ``regress.json`` of ``cutcal regress``, and what ``cutcal regress --json`` prints.

    Attributes:
        update: Whether references were recorded (--update).
        cases: The cuts, in the order of the foods.
        device: Device of the simulations.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
    """

    DOCUMENT: ClassVar[str] = "regress"
    KEYS: ClassVar[tuple[str, ...]] = ("passed", "update", "counts", "cases", "device", "versions", "git")

    update: bool
    cases: tuple[Annotated[CutComparison, keywords(description=None)], ...]
    device: DeviceName
    versions: Versions
    git: Commit

    @property
    def passed(self) -> bool:
        """Whether no cut is outside its tolerances or broke down (with --update: whether none broke down)."""
        bad = {"broke down"} if self.update else {"broke down", "outside"}
        return not any(one.verdict in bad for one in self.cases)

    @property
    def counts(self) -> Annotated[Mapping[str, Annotated[int, keywords(minimum=1)]], keywords(propertyNames=VERDICT)]:
        """Number of cuts of each verdict."""
        return dict(Counter(one.verdict for one in self.cases))


def write_result(result: RegressionResult, out: Path) -> None:
    """Write regress.json, and the curves of the cuts that reached their end in the layout of the references.

    Args:
        result: The comparison.
        out: Output folder.

    Raises:
        OutputError: A file cannot be written.
    """
    for one in result.cases:
        if one.columns is not None:
            write_csv(out / f"{one.food}-{one.contact}.csv", one.columns, digits=DIGITS)
    write_json(out / RESULT_FILE, to_document(result))
