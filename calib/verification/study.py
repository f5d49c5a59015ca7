"""Runs the cases of the verification and writes the table."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from calib.errors import CurveError
from calib.outputs import prepare, write_json
from calib.progress import clock
from calib.provenance import git_commit, versions
from calib.verification.rows import Row, cases
from mpm.errors import CutcalError

Say = Callable[[str], None]


def run(out: Path, *, quick: bool, only: str | None, about: dict[str, Any], say: Say) -> dict[str, Any]:
    """Run cases and write verify.json after each.

    Args:
        out: Output folder.
        quick: Coarse versions of the fast cases.
        only: Part of the name of the cases to run, or None for all.
        about: What verify.json says beside the rows.
        say: Called with a line after each case.

    Returns:
        The content of verify.json.

    Raises:
        CurveError: No case has such a name.
    """
    todo = [c for c in cases() if (c.fast or not quick) and (only is None or only.lower() in c.name.lower())]
    if not todo:
        names = ", ".join(c.name for c in cases())
        raise CurveError(f"--only {only}: no case has this in its name; there are {names}")
    prepare(out, resume=False)
    document: dict[str, Any] = {**about, "quick": quick, "complete": False, "rows": [], "seconds": {}, "broken": {}}
    document |= {"versions": versions(), "git": git_commit()}
    began = time.monotonic()
    for done, case in enumerate(todo, 1):
        since = time.monotonic()
        rows: list[Row] = []
        try:
            for row in case.run(quick):
                rows.append(row)
        except CutcalError as e:  # a case that breaks down fails; the others still run
            document["broken"][case.name] = str(e)
        count = sum(not row.passed for row in rows)
        document["rows"] += [{"group": case.name, **row.as_dict()} for row in rows]
        document["seconds"][case.name] = time.monotonic() - since
        write_json(out / "verify.json", document)
        left = (time.monotonic() - began) / done * (len(todo) - done)
        state = "broke down" if case.name in document["broken"] else f"{count} failed" if count else "passed"
        say(f"{case.name}: {len(rows)} rows, {state}; {done} of {len(todo)} cases, about {clock(left)} left")
    document |= {
        "complete": True,
        "passed": not document["broken"] and all(row["passed"] for row in document["rows"]),
    }
    write_json(out / "verify.json", document)
    from reports.verification import write_figure

    write_figure(out)
    return document
