"""What a verification ends with: ``verify.json``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

from calib.io.provenance import CommandLine, Commit, DeviceName, Seed, Versions
from calib.io.type_schema import NotNegative, NumberOrNull, Shared, keywords

RESULT_FILE = "verify.json"


@dataclass(frozen=True)
class Comparison:
    """One comparison: a row of the verification table.

    Attributes:
        case: What is simulated.
        quantity: What is compared, with its unit.
        expected: Value of the closed form or the reference [unit of the quantity]; with least the least value that
            passes.
        got: What the solver gives [unit of the quantity]; null where that is no number.
        tolerance: Largest error that passes.
        source: Where the expected value comes from.
        least: Whether more is right too.
        group: Case of the list that it belongs to.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "group", "case", "quantity", "expected", "got", "tolerance", "source", "least", "error", "passed",
    )  # fmt: skip

    case: str
    quantity: str
    expected: float
    got: NumberOrNull
    tolerance: NotNegative
    source: str
    least: bool = False
    group: str = ""

    @property
    def error(self) -> NumberOrNull:
        """Difference over the expected value, or the difference itself where that is 0; null where it is no number."""
        difference = self.got - self.expected
        return difference / abs(self.expected) if self.expected else difference

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return -self.error <= self.tolerance if self.least else abs(self.error) <= self.tolerance

    @property
    def share(self) -> float:
        """Error over the error that it may have [-], infinite where it is no number."""
        if not math.isfinite(self.error):
            return math.inf
        allowed = self.tolerance or abs(self.expected) or 1.0
        return max(-self.error, 0.0) / allowed if self.least else abs(self.error) / allowed


@dataclass(frozen=True, kw_only=True)
class Verification:
    """The solver against closed forms and finite elements.

    ``verify.json`` of ``cutcal verify``, and what ``cutcal verify --json`` prints.

    Attributes:
        command: Command line, or the call from Python, that made the document.
        quick: Whether only the fast cases were run, in coarse versions.
        seed: Seed of the particles, and of the search or the draws where there are any.
        device: Device of the simulations.
        code: SHA-256 over the source of the solver.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
        complete: Whether all cases are done.
        rows: Comparisons.
        seconds: Run time of each case [s], by name.
        broken: Why a case broke down, by name.
    """

    DOCUMENT: ClassVar[str] = "verify"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "quick", "seed", "device", "code", "versions", "git", "complete", "passed", "rows", "seconds",
        "broken",
    )  # fmt: skip

    command: CommandLine
    quick: bool
    seed: Seed
    device: DeviceName
    code: Annotated[str, Shared("sha256")]
    versions: Versions
    git: Commit
    complete: bool
    rows: tuple[Annotated[Comparison, keywords(description="One of them")], ...]
    seconds: Mapping[str, NotNegative]
    broken: Mapping[str, str]

    @property
    def passed(self) -> bool:
        """Whether all cases are done, none broke down and every row passed."""
        return self.complete and not self.broken and all(row.passed for row in self.rows)
