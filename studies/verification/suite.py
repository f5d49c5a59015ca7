"""Runs the cases of the verification and writes the table."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calib.errors import CurveError, DocumentError
from calib.io.folder import prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, versions
from calib.io.typed_document import read_document, to_document
from calib.simulation.workers import Workers
from mpm.scene.errors import CutcalError
from studies.verification.case import SuiteOptions, VerificationCase, cases
from studies.verification.report import write_report
from studies.verification.result import RESULT_FILE, Comparison, Verification

Say = Callable[[str], None]


@dataclass(frozen=True)
class CaseOutcome:
    """How a case ended.

    Attributes:
        rows: Its comparisons; of one that broke down those before.
        seconds: Its run time [s].
        broken: Why it broke down, None where it did not.
    """

    rows: tuple[Comparison, ...]
    seconds: float
    broken: str | None = None


KILLED = CaseOutcome((), 0.0, "its process was killed, perhaps for lack of memory")


def run_suite(
    out: Path,
    options: SuiteOptions,
    pool: Workers,
    *,
    only: str | None,
    command: Sequence[str],
    resume: bool = False,
    say: Say,
) -> Verification:
    """Run cases and write verify.json after each; at the end verify.svg and report.pdf.

    Args:
        out: Output folder.
        options: Quick or whole, seed, device.
        pool: Where the cases run, each in a process of its own.
        only: Part of the name of the cases to run, or None for all.
        command: Words of the command line.
        resume: Keep the cases of ``out`` that ran to their end.
        say: Called with a line after each case.

    Returns:
        What verify.json holds.

    Raises:
        CurveError: No case has such a name, or ``out`` holds cases of another seed, device, extent or version.
    """
    todo = _chosen(options, only)
    with prepare(out, "verify", resume=resume):
        none = _nothing_run(options, command)
        found = _known(out, none) if resume else {}
        new = sorted((c for c in todo if c.name not in found), key=lambda c: -c.cost)
        if len(new) < len(todo):
            say(f"{len(todo) - len(new)} of {len(todo)} cases are known already")
        rest = Countdown(sum(c.cost for c in new))
        for k, done in pool.each(_case_outcome, [(c.name, options) for c in new]):
            name, outcome = new[k].name, done or KILLED
            found[name] = outcome
            write_json(out / RESULT_FILE, to_document(_with_cases(none, todo, found)))
            failed = sum(not row.passed for row in outcome.rows)
            state = "broke down" if outcome.broken else f"{failed} failed" if failed else "passed"
            done_now = f"{len(found)} of {len(todo)} cases, {rest.left(new[k].cost)}"
            say(f"{name}: {len(outcome.rows)} rows, {state}; {done_now}")
        result = _with_cases(none, todo, found)
        write_json(out / RESULT_FILE, to_document(result))
        from reports.studies.verification import write_figure

        write_figure(result, out)
        write_report(out)
        return result


def _chosen(options: SuiteOptions, only: str | None) -> list[VerificationCase]:
    """The cases to run."""
    every = cases()
    chosen = [c for c in every if (c.fast or not options.quick) and (only is None or only.lower() in c.name.lower())]
    if not chosen:
        names = ", ".join(c.name for c in every)
        raise CurveError(f"--only {only}: no case has this in its name; there are {names}")
    return chosen


def _nothing_run(options: SuiteOptions, command: Sequence[str]) -> Verification:
    """The verification before any case is run."""
    return Verification(
        command=tuple(command),
        quick=options.quick,
        seed=options.seed,
        device=options.arch,
        code=code_key(),
        versions=versions(),
        git=git_commit(),
        complete=False,
        rows=(),
        seconds={},
        broken={},
    )


def _case_outcome(name: str, options: SuiteOptions, arch: str, threads: int) -> CaseOutcome:
    """Run one case; one that breaks down has the comparisons before, and says why."""
    case = next(c for c in cases() if c.name == name)
    began, rows, broken = time.monotonic(), [], None
    try:
        for row in case.run(options):
            rows.append(replace(row, group=name))
    except CutcalError as e:
        broken = str(e)
    return CaseOutcome(tuple(rows), time.monotonic() - began, broken)


def _with_cases(
    result: Verification, todo: Sequence[VerificationCase], found: Mapping[str, CaseOutcome]
) -> Verification:
    """The verification with the cases that are done, in the order of the table."""
    done = {c.name: found[c.name] for c in todo if c.name in found}
    return replace(
        result,
        complete=len(done) == len(todo),
        rows=tuple(row for one in done.values() for row in one.rows),
        seconds={name: one.seconds for name, one in done.items()},
        broken={name: one.broken for name, one in done.items() if one.broken},
    )


def _known(out: Path, own: Verification) -> dict[str, CaseOutcome]:
    """Cases of an earlier run that need not run again: those that did not break down."""
    path = out / RESULT_FILE
    if not path.exists():
        return {}
    try:
        before = read_document(path, Verification)
    except DocumentError:
        raise CurveError(f"--resume: {path} is damaged; choose another folder") from None
    settings = ((name, getattr(before, name), getattr(own, name)) for name in ("quick", "seed", "device", "code"))
    other = [f"{name} {then}, not {now}" for name, then, now in settings if then != now]
    if other:
        words = ", ".join(other)
        raise CurveError(f"--resume: {path} holds another verification ({words}); choose another folder")
    return {
        name: CaseOutcome(tuple(row for row in before.rows if row.group == name), seconds)
        for name, seconds in before.seconds.items()
        if name not in before.broken
    }
