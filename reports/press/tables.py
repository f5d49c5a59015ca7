"""Tables that the reports of tests between two plates share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from reports.base.brief import ReportTable
from reports.base.format import plain, quantity
from reports.base.labels import capital

if TYPE_CHECKING:
    from calib.texture.repeats import Scatter
    from calib.validation.acceptance import Verdict

MARKS = {True: "yes", False: "no", None: "none"}


def verdict_table(lines: Sequence[Verdict]) -> ReportTable:
    """A row for each line of a verdict."""
    rows = [
        [
            capital(line.name) + (f": {line.note}" if line.note else ""),
            quantity(line.value, line.unit or ""),
            quantity(line.limit, line.unit or "", digits=None),
            MARKS[line.passed],
        ]
        for line in lines
    ]
    return ReportTable(("What is judged", "Value", "Limit", "Verdict"), ("1fr", "20mm", "20mm", "22mm"), rows, marked=3)


def mean_and_sd(one: Scatter) -> str:
    """Mean and standard deviation of a group, or its only value."""
    return plain(one.mean) if math.isnan(one.sd) else f"{plain(one.mean)} ± {plain(one.sd, 2)}"
