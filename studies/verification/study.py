"""Runs the cases of the verification and writes the table."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from calib.errors import CurveError
from calib.io.folder import prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, versions
from calib.io.schema import tag
from calib.simulation.workers import Workers
from mpm.scene.errors import CutcalError
from studies.verification.case import Case, How, cases

Say = Callable[[str], None]


def run(
    out: Path,
    how: How,
    pool: Workers,
    *,
    only: str | None,
    about: dict[str, Any],
    resume: bool = False,
    say: Say,
) -> dict[str, Any]:
    """Run cases and write verify.json after each.

    Args:
        out: Output folder.
        how: Quick or whole, seed, device.
        pool: Where the cases run, each in a process of its own.
        only: Part of the name of the cases to run, or None for all.
        about: What verify.json says beside the rows.
        resume: Keep the cases of ``out`` that ran to their end.
        say: Called with a line after each case.

    Returns:
        The content of verify.json.

    Raises:
        CurveError: No case has such a name, or ``out`` holds cases of another seed, device, extent or version.
    """
    todo = [c for c in cases() if (c.fast or not how.quick) and (only is None or only.lower() in c.name.lower())]
    if not todo:
        names = ", ".join(c.name for c in cases())
        raise CurveError(f"--only {only}: no case has this in its name; there are {names}")
    prepare(out, resume=resume)
    own = {"quick": how.quick, "seed": how.seed, "device": how.arch, "code": code_key()}
    found = _known(out, own) if resume else {}
    new = sorted((c for c in todo if c.name not in found), key=lambda c: -c.cost)
    document = {"schema": tag("verify"), **about, **own, "versions": versions(), "git": git_commit()}
    if len(new) < len(todo):
        say(f"{len(todo) - len(new)} of {len(todo)} cases are known already")
    rest = Countdown(sum(c.cost for c in new))
    for k, done in pool.each(_rows, [(c.name, how) for c in new]):
        name = new[k].name
        found[name] = done or {
            "rows": [],
            "seconds": 0.0,
            "broken": "its process was killed, perhaps for lack of memory",
        }
        write_json(out / "verify.json", document | _table(todo, found))
        count = sum(not row["passed"] for row in found[name]["rows"])
        state = "broke down" if found[name]["broken"] else f"{count} failed" if count else "passed"
        done_now = f"{len(found)} of {len(todo)} cases, {rest.left(new[k].cost)}"
        say(f"{name}: {len(found[name]['rows'])} rows, {state}; {done_now}")
    document |= _table(todo, found)
    write_json(out / "verify.json", document)
    from reports.verification import write_figure, write_report

    write_figure(out)
    write_report(out)
    return document


def _rows(name: str, how: How, arch: str, threads: int) -> dict[str, Any]:
    """The rows of one case as plain data; one that breaks down has those before, and says why."""
    case = next(c for c in cases() if c.name == name)
    began, rows, broken = time.monotonic(), [], None
    try:
        for row in case.run(how):
            rows.append({"group": name, **row.as_dict()})
    except CutcalError as e:
        broken = str(e)
    return {"rows": rows, "seconds": time.monotonic() - began, "broken": broken}


def _table(todo: Sequence[Case], found: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """What verify.json says of the cases that are done, in the order of the table."""
    done = {c.name: found[c.name] for c in todo if c.name in found}
    rows = [row for one in done.values() for row in one["rows"]]
    broken = {name: one["broken"] for name, one in done.items() if one["broken"]}
    return {
        "complete": len(done) == len(todo),
        "passed": len(done) == len(todo) and not broken and all(row["passed"] for row in rows),
        "rows": rows,
        "seconds": {name: one["seconds"] for name, one in done.items()},
        "broken": broken,
    }


def _known(out: Path, own: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Cases of an earlier run that need not run again: those that did not break down."""
    path = out / "verify.json"
    if not path.exists():
        return {}
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
        other = [name for name, value in own.items() if before[name] != value]
        seconds = {name: s for name, s in before["seconds"].items() if name not in before["broken"]}
        rows = before["rows"]
    except (ValueError, KeyError, TypeError):
        raise CurveError(f"--resume: {path} is damaged; choose another folder") from None
    if other:
        words = ", ".join(f"{name} {before[name]}, not {own[name]}" for name in other)
        raise CurveError(f"--resume: {path} holds another verification ({words}); choose another folder")
    return {
        name: {"rows": [row for row in rows if row["group"] == name], "seconds": s, "broken": None}
        for name, s in seconds.items()
    }
