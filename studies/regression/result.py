"""What a comparison with the recorded cuts ends with: ``regress.json``, and the new curves beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from calib.io.folder import write_csv, write_json
from calib.io.typed_document import to_document
from mpm.arrays import FloatArray
from studies.regression.reference_curves import DIGITS

RESULT_FILE = "regress.json"
VERDICT_MEANINGS = {
    "same": "the recorded curve, but for rounding",
    "within": "another curve, but no further away than another seed's",
    "outside": "further away than another seed's",
    "broke down": "the cut did not reach its end",
    "new": "nothing was recorded that could be read",
}


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
    over_limit: float | None = None


@dataclass(frozen=True)
class NumberChanges:
    """Peak [N], stroke at which it is [m], and work [J] of a cut."""

    peak_N: NumberChange
    peak_stroke_m: NumberChange
    work_J: NumberChange


@dataclass(frozen=True)
class LargestDeviation:
    """The deviation that is largest over its tolerance.

    Attributes:
        column: Column of the reference.
        stroke_m: Where it is [m].
        difference: How much it is [unit of the column].
        over_tolerance: The same over the tolerance [-].
        part: Largest deviation of any column over the largest force or work [-].
    """

    column: str
    stroke_m: float
    difference: float
    over_tolerance: float
    part: float


@dataclass(frozen=True, kw_only=True)
class CutComparison:
    """What became of a recorded cut.

    Attributes:
        food: Name of the food.
        contact: Kind of contact.
        reason: Why the cut broke down, empty where it did not.
        recorded: Whether a new reference was written.
        because: What is another than when the reference was recorded.
        results: Peak and work; None where the cut broke down.
        shape_error: Difference of the curves, each over its own peak [-]; NaN where one has no force, None without
            curves.
        nrmse: Root mean square difference of the curves over the recorded peak [-]; the same.
        verdict: One of :data:`VERDICT_MEANINGS`.
        largest: The largest deviation; None where there is nothing to compare.
        columns: The new curves by the names of the reference's columns, (60,) each; None where the cut broke down.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "food", "contact", "reason", "recorded", "because", "results", "shape_error", "nrmse", "verdict", "largest",
    )  # fmt: skip

    food: str
    contact: str
    reason: str = ""
    recorded: bool = False
    because: tuple[str, ...] = ()
    results: NumberChanges | None = None
    shape_error: float | None = None
    nrmse: float | None = None
    verdict: str
    largest: LargestDeviation | None = None
    columns: Mapping[str, FloatArray] | None = field(default=None, compare=False)


@dataclass(frozen=True, kw_only=True)
class RegressionResult:
    """Cuts compared with those that were recorded.

    Attributes:
        update: Whether references were recorded.
        cases: The cuts.
        device: Device of the simulations.
        versions: Versions of cutcal, Python and packages.
        git: Commit of the checkout.
    """

    DOCUMENT: ClassVar[str] = "regress"
    KEYS: ClassVar[tuple[str, ...]] = ("passed", "update", "counts", "cases", "device", "versions", "git")

    update: bool
    cases: tuple[CutComparison, ...]
    device: str
    versions: Mapping[str, str]
    git: str | None

    @property
    def passed(self) -> bool:
        """Whether no cut broke down, and none is outside its tolerances where nothing was recorded."""
        bad = {"broke down"} if self.update else {"broke down", "outside"}
        return not any(one.verdict in bad for one in self.cases)

    @property
    def counts(self) -> dict[str, int]:
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
