"""Tables and texts that the reports of tests between two plates share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from reports.base.brief import ReportTable
from reports.base.format import DASH, NBSP, plain
from reports.base.labels import as_sentence, capital, related, shown

if TYPE_CHECKING:
    from calib.texture.repeats import Scatter
    from calib.validation.acceptance import Verdict

MARKS = {True: "yes", False: "no", None: "none"}
MOST_PLACES = 6  # decimals


def verdict_table(lines: Sequence[Verdict]) -> ReportTable:
    """A row for each line of a verdict."""
    rows = [
        [
            capital(line.name) + (f": {line.note}" if line.note else ""),
            shown(line.value, line.unit or "-", 3),
            related(line.value, line.limit, line.passed) + shown(line.limit, line.unit or "-", None),
            MARKS[line.passed],
        ]
        for line in lines
    ]
    return ReportTable(("What is judged", "Value", "Limit", "Verdict"), ("1fr", "20mm", "20mm", "22mm"), rows, marked=3)


def mean_and_sd(one: Scatter) -> str:
    """Mean and standard deviation of a group, or its only value."""
    return with_sd(one.mean, one.sd)


def with_sd(mean: float, sd: float) -> str:
    """A value and its standard deviation with the same decimals: two digits of the latter, or four of the former."""
    if not math.isfinite(sd):
        return plain(mean)
    if sd == 0.0:
        return f"{plain(mean)}{NBSP}±{NBSP}0"
    finest = 3 - math.floor(math.log10(abs(mean))) if mean else MOST_PLACES
    places = min(max(min(1 - math.floor(math.log10(sd)), finest), 0), MOST_PLACES)
    texts = [f"{x:.{places}f}".replace("-", "−") for x in (mean, sd)]
    least = texts[1] if texts[1].strip("0.") else f"<{NBSP}{10.0**-places:.{places}f}"
    return f"{texts[0]}{NBSP}±{NBSP}{least}"


def between(low: float, high: float) -> str:
    """An interval of three digits at each end; a dash where there is none."""
    return DASH if math.isnan(low) or math.isnan(high) else f"{plain(low)} to {plain(high)}".replace(" ", NBSP)


def sentences(texts: Sequence[str]) -> list[str]:
    """Remarks with a capital and a full stop."""
    return [as_sentence(text) for text in texts]
