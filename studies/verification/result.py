"""What a verification ends with: ``verify.json``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

RESULT_FILE = "verify.json"


@dataclass(frozen=True)
class Comparison:
    """One comparison: a row of the verification table.

    Attributes:
        case: What is simulated.
        quantity: What is compared, with its unit.
        expected: Value of the closed form or the reference [unit of the quantity]; with ``least`` the least that
            passes.
        got: What the solver gives [unit of the quantity]; NaN where that is no number.
        tolerance: Largest error that passes [-].
        source: Where the expected value comes from.
        least: Whether more is also right: orders of convergence.
        group: Name of the verification case that it belongs to.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "group", "case", "quantity", "expected", "got", "tolerance", "source", "least", "error", "passed",
    )  # fmt: skip

    case: str
    quantity: str
    expected: float
    got: float
    tolerance: float
    source: str
    least: bool = False
    group: str = ""

    @property
    def error(self) -> float:
        """Difference over the expected value, or the difference itself where that is 0 [-]."""
        difference = self.got - self.expected
        return difference / abs(self.expected) if self.expected else difference

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance; never where it is no number."""
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
    """A verification, finished or not.

    Attributes:
        command: Words of the command line.
        quick: Whether only the fast cases were run, in coarse versions.
        seed: Seed of the particles.
        device: Device of the simulations.
        code: SHA-256 over the source of the solver.
        versions: Versions of cutcal, Python and packages.
        git: Commit of the checkout.
        complete: Whether all cases are done.
        rows: The comparisons, in the order of the cases.
        seconds: Run time [s] of each case that is done, by its name.
        broken: Why a case broke down, by its name.
    """

    DOCUMENT: ClassVar[str] = "verify"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "quick", "seed", "device", "code", "versions", "git", "complete", "passed", "rows", "seconds",
        "broken",
    )  # fmt: skip

    command: tuple[str, ...]
    quick: bool
    seed: int
    device: str
    code: str
    versions: Mapping[str, str]
    git: str | None
    complete: bool
    rows: tuple[Comparison, ...]
    seconds: Mapping[str, float]
    broken: Mapping[str, str]

    @property
    def passed(self) -> bool:
        """Whether all cases are done, none broke down and every comparison passed."""
        return self.complete and not self.broken and all(row.passed for row in self.rows)
