"""What ``cutcal press relax`` ends with: ``relax.json`` and the curves of ``curves.csv``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np

from calib.compression.result import SpecimenSizes
from calib.io.folder import write_csv, write_json
from calib.io.provenance import CommandLine, Commit, Versions
from calib.io.type_schema import Count, Fraction, NotNegative, NumberOrNull, Positive, Shared, keywords
from calib.io.typed_document import to_document
from calib.texture.plate_record import RecordedFile
from calib.texture.repeats import Scatter
from calib.validation.acceptance import Verdict
from mpm.arrays import FloatArray

RESULT_FILE, CURVES_FILE = "relax.json", "curves.csv"
ONE = keywords(description="One of them")


@dataclass(frozen=True)
class RelaxationBranch:
    """A branch of a Prony series, fitted to one hold.

    Attributes:
        time_s: Relaxation time [s].
        time_low_s: Lower end of its 95 % interval [s].
        time_high_s: Upper end [s].
        share: Share in the instantaneous modulus [-].
        share_sd: Its standard uncertainty [-].
        identified: Whether the record tells it.
        why: Why it does not; empty where it does.
    """

    time_s: Positive
    time_low_s: NotNegative
    time_high_s: Positive
    share: Fraction
    share_sd: NumberOrNull
    identified: bool
    why: str


@dataclass(frozen=True)
class RelaxedSpecimen:
    """The hold of one specimen.

    Attributes:
        name: Its name.
        strain: Strain that is held [-].
        hold_s: Duration of the hold [s].
        ramp_s: Time from contact to the hold [s].
        E0_Pa: Instantaneous modulus, secant at the strain that is held [Pa].
        equilibrium: Share of the modulus that remains in the end [-].
        equilibrium_sd: Its standard uncertainty [-].
        branches: Branches of the Prony series, the fastest first.
        nrmse: Root mean square residual over the load with which the hold begins, a fraction.
        bic: Bayesian information criterion by number of branches, from 0.
    """

    name: str
    strain: Positive
    hold_s: Positive
    ramp_s: NotNegative
    E0_Pa: Positive
    equilibrium: Fraction
    equilibrium_sd: NumberOrNull
    branches: tuple[Annotated[RelaxationBranch, ONE], ...]
    nrmse: NotNegative
    bic: Annotated[tuple[float, ...], keywords(minItems=1)]


@dataclass(frozen=True)
class BranchScatter:
    """A branch of the common Prony series: relaxation time [s] and share [-] over the repeats.

    Attributes:
        time_s: Geometric mean of the relaxation times [s].
        share: Shares of the repeats [-].
        identified: Whether the records of all repeats tell it.
    """

    time_s: Positive
    share: Scatter
    identified: bool


@dataclass(frozen=True, kw_only=True)
class RelaxationResult:
    """Relaxation of a food under a plate that holds.

    ``relax.json`` of ``cutcal press relax``, and what ``cutcal press relax --json`` prints.

    Attributes:
        command: Command line, or the call from Python, that made the document.
        specimen: The first specimen.
        count: Number of branches, the same of all repeats.
        chosen: Whether the number was chosen by the information criterion; false where it was given.
        series: The common Prony series.
        E0_Pa: Instantaneous modulus of the repeats [Pa].
        equilibrium: Share that remains in the end [-].
        repeats: The specimens.
        verdicts: Lines of the verdict.
        not_shown: What the result does not show, one sentence each.
        files: Files of the test.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
    """

    DOCUMENT: ClassVar[str] = "relax"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "specimen", "count", "chosen", "series", "E0_Pa", "equilibrium", "repeats", "verdicts", "passed",
        "not_shown", "files", "versions", "git",
    )  # fmt: skip

    command: CommandLine
    specimen: SpecimenSizes
    count: Count
    chosen: bool
    series: tuple[Annotated[BranchScatter, ONE], ...]
    E0_Pa: Scatter
    equilibrium: Scatter
    repeats: Annotated[tuple[Annotated[RelaxedSpecimen, ONE], ...], keywords(minItems=1)]
    verdicts: Annotated[tuple[Annotated[Verdict, Shared("verdict")], ...], keywords(minItems=1)]
    not_shown: Annotated[tuple[str, ...], Shared("limits")]
    files: Annotated[tuple[Annotated[RecordedFile, keywords(description="One file")], ...], keywords(minItems=1)]
    versions: Versions
    git: Commit

    @property
    def passed(self) -> bool:
        """Whether every line passed."""
        return all(line.passed for line in self.verdicts)

    @property
    def device(self) -> str:
        """Nothing is simulated on a device."""
        return "none"


@dataclass(frozen=True, eq=False)
class HoldCurve:
    """Measured and fitted load of one hold.

    Attributes:
        name: Name of the specimen.
        time: Time from the start of the hold [s], shape (n,).
        measured: Load [N], shape (n,).
        fitted: Load of the Prony series [N], shape (n,).
    """

    name: str
    time: FloatArray
    measured: FloatArray
    fitted: FloatArray


def write_result(result: RelaxationResult, curves: Sequence[HoldCurve], out: Path) -> None:
    """Write ``relax.json``, and ``curves.csv`` with the holds.

    Args:
        result: The result.
        curves: The holds.
        out: Output folder.

    Raises:
        OutputError: A file cannot be written.
    """
    columns = {
        "specimen": np.concatenate([[one.name] * len(one.time) for one in curves]),
        "time_s": np.concatenate([one.time for one in curves]),
        "measured_N": np.concatenate([one.measured for one in curves]),
        "fitted_N": np.concatenate([one.fitted for one in curves]),
    }
    write_csv(out / CURVES_FILE, columns, head=["time from the start of the hold"])
    write_json(out / RESULT_FILE, to_document(result))
