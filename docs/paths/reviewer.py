"""A reviewer with the PDF alone: is everything there that one asks for, and are its numbers those of the run?

``python docs/paths/reviewer.py runs/banana`` needs pypdf. It ends with 1 where something is missing.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pypdf import PdfReader

ASKED = {
    "which method": r"material point method \[\d",
    "which laws": r"Part Law Properties",
    "which boundaries": r"rigid; the food lies on it",
    "which mesh": r"grid of cells\s+of \d",
    "what is minimised": r"What is minimised",
    "where limits come from": r"Where the limits of the first page come from",
    "how the trace was treated": r"The trace and what was done to it",
    "which intervals": r"95 % interval Literature",
    "words explained": r"NRMSE root mean square difference",
    "what it does not show": r"not (?:run|measured|known)|does not show|in-sample",
    "which trace, bit for bit": r"SHA-256 [0-9a-f]{8}",
    "which version": r"cutcal \d+\.\d+",
    "references in full": r"\[1\]\s+\w.*\b(?:19|20)\d\d\b",
}
"""What a referee asks, and how the answer begins in the text of the report."""
UNITS = {"%": 100.0, "": 1.0, "sd": 1.0}


def disagreeing(page: str, summary: Mapping[str, Any]) -> list[str]:
    """Lines of the first page whose number is not that of the summary, or that are not there.

    Args:
        page: Text of the first page.
        summary: Content of ``summary.json``.

    Returns:
        A sentence for each.
    """
    out = []
    for line in summary["verdicts"]:
        name = r"\s+".join(re.escape(word) for word in line["name"].split())
        if line["value"] is None:
            out += [] if re.search(rf"{name} not run", page) else [f"{line['name']}: not said to be not run"]
            continue
        found = re.search(rf"{name}\s+(< )?([+−]?[\d.]+) ?(%|sd)? ", page)
        if found is None:
            out.append(f"{line['name']}: not on the page")
            continue
        shown, unit = found[2].replace("−", "-"), found[3] or ""
        step = 10.0 ** -len(shown.partition(".")[2])  # of its last digit
        off = abs(abs(float(shown)) - UNITS[unit] * abs(line["value"]))
        if off > (step if found[1] else 0.51 * step):  # less than the smallest number that is shown
            out.append(f"{line['name']}: {found[2]} {unit} on the page, {line['value']:.4g} in the summary")
    word = "✓ PASSED" if summary["passed"] else "NOT PASSED"
    return out + ([] if word in page.upper() else [f"{word} is not on the page"])


def main(folder: Path) -> int:
    """Read the report of a calibration as a reviewer would.

    Args:
        folder: Output folder of ``calibrate``.

    Returns:
        0 where everything is there and agrees, else 1.
    """
    pages = [re.sub(r"[^\S\n]", " ", page.extract_text()) for page in PdfReader(folder / "report.pdf").pages]
    text = "\n".join(pages)
    missing = [question for question, answer in ASKED.items() if not re.search(answer, text)]
    for question in ASKED:
        print(f"{'MISSING' if question in missing else 'there':8s} {question}")
    wrong = disagreeing(pages[0], json.loads((folder / "summary.json").read_text(encoding="utf-8")))
    print("\n".join(wrong) or "the numbers of the first page are those of summary.json")
    return 1 if missing or wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1])))
