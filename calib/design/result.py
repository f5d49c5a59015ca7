"""What a design ends with, as a typed value: ``design.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from calib.design.candidates import CALIBRATE, NONE, RANGES, STUDY, LeftOut
from calib.io import typed_document
from calib.io.provenance import Invocation, Software
from calib.io.type_schema import Count, Fraction, NotNegative, Positive, Shared, keywords, one_of
from calib.io.typed_document import FLAT, NULL

if TYPE_CHECKING:
    from calib.io.wide_table import WideTable

ALL = "all"
"""What is to be narrowed, where that is every parameter."""
HELPS = 0.9
"""Part of the present interval's width below which a test narrows it, as the verdicts of a fit have it [-]."""


@dataclass(frozen=True)
class Known:
    """What is known of a parameter or a quantity before the test.

    Attributes:
        value: Present value [unit].
        unit: SI unit, - where there is none.
        low95: Lower end of the 95 % interval in the normal approximation [unit].
        high95: Upper end [unit].
        reported: Ends of the calibration's own 95 % interval [unit]; left out where there is none.
    """

    value: float
    unit: str
    low95: float
    high95: float
    reported: tuple[float, float] | None = None


@dataclass(frozen=True)
class Expected:
    """What would be known after the test.

    Attributes:
        low95: Lower end of the expected 95 % interval about the present value [unit].
        high95: Upper end [unit].
        part: Its width over the present one, in the coordinate of the fit (mostly the logarithm).
    """

    low95: float
    high95: float
    part: Fraction


@dataclass(frozen=True)
class DesignedTest:
    """A test that could be made next.

    Attributes:
        name: Its name.
        kind: What kind of test it is.
        what: What is done.
        taken_by: Command that takes its record; none: no command does yet.
        minutes: Assumed lab work [min].
        bits: Expected information on all parameters together [bit].
        asked: What would be known of what was asked for; null where all parameters were.
        parameters: What would be known of the parameters, by name.
        draws: Foods over which it is averaged.
    """

    name: str
    kind: Annotated[str, one_of("cut", "blade", "narrower", "rack", "slicing", "compression", "width", "photograph")]
    what: str
    taken_by: Annotated[str, one_of(CALIBRATE, STUDY, RANGES, NONE)]
    minutes: Positive
    bits: NotNegative
    asked: Expected | None = field(metadata=NULL)
    parameters: Mapping[str, Expected]
    draws: Count

    @property
    def shown(self) -> tuple[str | None, Expected]:
        """What a table shows of it: what was asked for, which has no name here; of all parameters the one that it
        narrows most, with its name."""
        if self.asked is not None:
            return None, self.asked
        name = min(self.parameters, key=lambda n: self.parameters[n].part)
        return name, self.parameters[name]

    @property
    def helps(self) -> bool:
        """Whether it narrows what was asked for, and a command takes its record."""
        return self.taken_by != NONE and self.shown[1].part <= HELPS


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class DesignResult:
    """The next test of a food.

    ``design.json`` of ``cutcal design``, and what ``cutcal design --json`` prints.

    Attributes:
        food: Food of materials.yaml, or of the file given.
        run: Folder of the calibration that it starts from; null where it starts from the literature.
        knife: Knife of the cut that was made, or would be.
        asked: What is to be narrowed: all, a parameter, or peak or work under a knife.
        recommended: The first test that narrows it and whose record a command takes; null where there is none.
        known: What is known before, by parameter.
        quantity: What is known before of the peak or work that was asked for; left out where none was.
        tests: The tests, the one that narrows most first.
        left_out: Tests that are not judged.
        simulations: Coarse simulations that were run.
        failed_simulations: Those that broke down.
        invocation: How it was called.
        software: What was run.
        warnings: What a reader of the numbers must know about the input, one sentence each.
        limits: What the result does not show, one sentence each.
        wall_s: Run time [s].
    """

    DOCUMENT: ClassVar[str] = "design"
    KEYS: ClassVar[tuple[str, ...]] = (
        *("food", "run", "knife", "asked", "recommended", "known", "quantity", "tests", "left_out", "simulations"),
        *("failed_simulations", "invocation", "software", "warnings", "limits", "wall_s"),
    )

    food: str
    run: str | None = field(metadata=NULL)
    knife: str
    asked: str
    known: Mapping[str, Annotated[Known, keywords(description="One of them")]]
    quantity: Known | None = None
    tests: Annotated[tuple[DesignedTest, ...], keywords(minItems=1)]
    left_out: tuple[LeftOut, ...]
    simulations: Count
    failed_simulations: Count
    invocation: Invocation = field(metadata=FLAT)
    software: Software = field(metadata=FLAT)
    warnings: Annotated[tuple[str, ...], Shared("warnings")]
    limits: Annotated[tuple[str, ...], Shared("limits")]
    wall_s: NotNegative

    def __repr__(self) -> str:
        return f"DesignResult({self.food!r}, asked={self.asked!r}, recommended={self.recommended!r})"

    @property
    def recommended(self) -> str | None:
        """The first test that narrows what was asked for by a tenth and whose record a command takes; null where there
        is none."""
        return next((t.name for t in self.tests if t.helps), None)

    @property
    def ranking(self) -> WideTable:
        """The tests by name, the one that narrows most first: minutes [min], bits [bit], what it narrows, expected ends
        of the 95 % interval [unit], its width over the present one [-], the command that takes the record, and what is
        done."""
        from calib.io.wide_table import table_of_rows  # it takes long to import

        rows = {}
        for test in self.tests:
            name, expected = test.shown
            rows[test.name] = {
                "minutes": test.minutes,
                "bits": test.bits,
                "narrows": self.asked if name is None else name,
                "low95": expected.low95,
                "high95": expected.high95,
                "part": expected.part,
                "record": test.taken_by,
                "what": test.what,
            }
        return table_of_rows(rows)

    def plot(self) -> Any:
        """Draw what each test leaves of the present intervals; the figure of ``design.svg``.

        Returns:
            The axes, on a new figure.
        """
        from reports.studies.design import design_axes

        return design_axes(self)

    def _repr_html_(self) -> str:
        best = "no test narrows it by a tenth" if self.recommended is None else f"next: {self.recommended}"
        return f"<p>{escape(self.food)}, asked: {escape(self.asked)}; {escape(best)}</p>{self.ranking.to_html()}"


def to_document(result: DesignResult) -> dict[str, Any]:
    """The content of ``design.json``."""
    return typed_document.to_document(result)


def read_design(folder: Path) -> DesignResult:
    """The finished design in a folder.

    Args:
        folder: The output folder of ``cutcal design``.

    Returns:
        The design.

    Raises:
        DocumentError: The document is missing, damaged or incomplete.
    """
    return typed_document.read_document(folder / "design.json", DesignResult)
