"""Relaxation from the files of hold tests: read, fit a Prony series to each, put the repeats together, judge, write."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from calib.compression.measured import area
from calib.compression.result import SpecimenSizes
from calib.io.folder import prepare
from calib.io.provenance import git_commit, versions
from calib.relaxation.branch_search import common_branches, fastest_seen, search_branches, tried_branches
from calib.relaxation.hold import find_hold
from calib.relaxation.relaxation_fit import RelaxationFit, fit_searched
from calib.relaxation.relaxation_result import (
    BranchScatter,
    HoldCurve,
    RelaxationBranch,
    RelaxationResult,
    RelaxedSpecimen,
    write_result,
)
from calib.texture.plate_record import PlateColumns, PlateRecord, read_records
from calib.texture.repeats import scatter
from calib.validation.acceptance import Verdict
from mpm.scene.shapes import Shape

NRMSE_LIMIT = 0.01
"""Largest residual of a hold, over the load with which it begins [-]."""
UNSEEN_SHARE = 0.1
"""Share of a branch of which it is said how fast it may be to be seen [-]."""
Say = Callable[[str], None]


@dataclass(frozen=True)
class RelaxationTest:
    """What was measured.

    Attributes:
        paths: Files of one food, each of one specimen.
        outline: Kind and sizes of the specimen under the plate; its height where no gap is recorded.
        columns: How the columns are found.
        height: Height of every specimen [m]; None for the first gap of each record.
        branches: Number of branches of the Prony series; None to choose it.
        trigger: Load from which the plate touches the food [N]; None for 5 % of the largest.
    """

    paths: Sequence[str | Path]
    outline: tuple[str, float, float]
    columns: PlateColumns
    height: float | None = None
    branches: int | None = None
    trigger: float | None = None

    def shape(self, record: PlateRecord) -> Shape:
        """The specimen of a record.

        Raises:
            TraceError: Its height is not known.
        """
        return Shape(*self.outline, record.height(self.height))


def evaluate_relaxation(test: RelaxationTest, out: Path, *, command: Sequence[str], say: Say) -> RelaxationResult:
    """Fit and write relax.json, curves.csv, report.pdf and report.html.

    Args:
        test: What was measured.
        out: Output folder.
        command: Words of the command line.
        say: Called with a sentence about the records.

    Returns:
        What relax.json holds.

    Raises:
        CutcalError: Bad input, or a folder that cannot be used.
    """
    records = read_records(test.paths, test.columns)
    for text in (text for record in records for text in record.notes):
        say(f"note: {text}")
    shapes = [test.shape(record) for record in records]
    holds = [find_hold(record, test.trigger) for record in records]
    most = tried_branches(holds, test.branches)
    with prepare(out, "relax", resume=False):
        searches = [search_branches(hold, most) for hold in holds]
        count = common_branches(searches) if test.branches is None else test.branches
        fits = [fit_searched(search, count) for search in searches]
        repeats = [_specimen(*each) for each in zip(shapes, fits, strict=True)]
        result = RelaxationResult(
            command=tuple(command),
            specimen=SpecimenSizes.of(shapes[0], area(shapes[0])),
            count=count,
            chosen=test.branches is None,
            series=tuple(_common(fits, k) for k in range(count)),
            E0_Pa=scatter([one.E0_Pa for one in repeats]),
            equilibrium=scatter([one.equilibrium for one in repeats]),
            repeats=tuple(repeats),
            verdicts=tuple(_verdicts(fits)),
            not_shown=(*_unshown(fits), *(text for record in records for text in record.notes)),
            files=tuple(record.file for record in records),
            versions=versions(),
            git=git_commit(),
        )
        curves = [_curve(fit) for fit in fits]
        write_result(result, curves, out)
        from reports.press.relaxation import write_report

        write_report(result, curves, out)
        return result


def _specimen(shape: Shape, fit: RelaxationFit) -> RelaxedSpecimen:
    """The hold of one specimen as it is reported."""
    hold = fit.hold
    return RelaxedSpecimen(
        name=hold.name,
        strain=float(hold.way[hold.held].mean()) / shape.height,
        hold_s=hold.duration,
        ramp_s=float(hold.time[hold.start]),
        E0_Pa=fit.stiffness * shape.height / area(shape),
        equilibrium=fit.equilibrium,
        equilibrium_sd=fit.equilibrium_sd,
        branches=tuple(RelaxationBranch(**asdict(one)) for one in fit.branches),
        nrmse=fit.nrmse,
        bic=fit.bic,
    )


def _common(fits: Sequence[RelaxationFit], k: int) -> BranchScatter:
    """A branch over the repeats."""
    own = [fit.branches[k] for fit in fits]
    time = float(np.exp(np.mean([np.log(one.time_s) for one in own])))
    return BranchScatter(time, scatter([one.share for one in own]), all(one.identified for one in own))


def _verdicts(fits: Sequence[RelaxationFit]) -> list[Verdict]:
    """The lines of the verdict: how well the series fits, and whether the holds tell its branches."""
    worst = max(fit.nrmse for fit in fits)
    fine = worst <= NRMSE_LIMIT
    note = "" if fine else "the load does not relax as a Prony series, or it rings or drifts"
    lines = [Verdict("largest residual of a hold (NRMSE)", worst, NRMSE_LIMIT, "fraction", fine, note)]
    untold = sorted({one.why for fit in fits for one in fit.branches if not one.identified})
    count = sum(not one.identified for fit in fits for one in fit.branches)
    lines.append(Verdict("branches that a hold does not tell", count, 0, "", not count, "; ".join(untold)))
    return lines


def _curve(fit: RelaxationFit) -> HoldCurve:
    hold = fit.hold
    return HoldCurve(hold.name, hold.time[hold.held] - hold.time[hold.start], hold.load[hold.held], fit.load)


def _unshown(fits: Sequence[RelaxationFit]) -> list[str]:
    """What the result does not show, in words."""
    longest = max(fit.hold.duration for fit in fits)
    fastest = max(fastest_seen(fit.hold, fit.stiffness, UNSEEN_SHARE) for fit in fits)
    out = [
        f"a branch with a share of {UNSEEN_SHARE:g} that is faster than {fastest:.2g} s would be within the noise: E0 "
        f"has no part of it",
        f"nothing is shown about times above {longest:.3g} s: what remains in the end is what remains then",
        "contact is where the load just above the trigger, continued to zero, would begin; of a food that stiffens at "
        "once the way before it is not counted",
        "during the ramp the load is taken as proportional to the way at each instant; of a food that stiffens, "
        "shares of branches faster than the ramp are too small",
        "one strain was held: that shares are the same at another one is not shown",
        "a compression tells no bulk from shear relaxation; water that is pressed out relaxes too, and more slowly in "
        "a larger specimen",
    ]
    if len(fits) == 1:
        out.append("one repeat: no standard deviation and no interval of repeats")
    return out
