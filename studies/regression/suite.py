"""Whether cuts are still those that were recorded, and recording those that are not."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from calib.errors import RegressionError
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, versions
from calib.simulation.workers import DIED, Workers
from mpm.arrays import FloatArray
from studies.regression.baseline import (
    KEY_LENGTH,
    OTHER_SEEDS,
    RECORDED_SEED,
    BaselineCut,
    CutOutcome,
    cut_numbers,
    repeatability,
    run_cut,
)
from studies.regression.comparison import compare_cut, is_another, library_versions, plain_scene
from studies.regression.reference_curves import Reference, References
from studies.regression.result import CutComparison, RegressionResult

Say = Callable[[str], None]

KILLED = CutOutcome(DIED, None)


def regression_result(comparisons: Sequence[CutComparison], device: str, *, update: bool) -> RegressionResult:
    """The result of a comparison, with where it comes from.

    Args:
        comparisons: What became of each cut.
        device: Device of the simulations.
        update: Whether references were recorded.

    Returns:
        The result.
    """
    return RegressionResult(
        update=update, cases=tuple(comparisons), device=device, versions=versions(), git=git_commit()
    )


def compare_with_references(
    cuts: Sequence[BaselineCut], references: References, pool: Workers, say: Say
) -> list[CutComparison]:
    """Simulate cuts and compare them with their references.

    Args:
        cuts: What to simulate.
        references: The recorded curves.
        pool: Where the simulations run.
        say: Called with a line after each run.

    Returns:
        What became of each cut.

    Raises:
        RegressionError: A reference is missing or damaged; nothing is simulated then.
    """
    return _compared(cuts, [references.read(cut.name) for cut in cuts], pool, say)


def _compared(
    cuts: Sequence[BaselineCut], known: Sequence[Reference | None], pool: Workers, say: Say
) -> list[CutComparison]:
    found: dict[int, CutComparison] = {}
    for k, outcome, counted in _runs([(cut, RECORDED_SEED) for cut in cuts], pool):
        found[k] = compare_cut(cuts[k], known[k], outcome)
        say(f"{cuts[k].words}: {found[k].verdict}; {counted}")
    return [found[k] for k in range(len(cuts))]


def record_changes(
    cuts: Sequence[BaselineCut], references: References, pool: Workers, say: Say, order: Sequence[str]
) -> list[CutComparison]:
    """Simulate cuts and record those that changed, each as soon as its repetitions are there.

    A reference that a cut repeats to rounding, made from the same scene, is kept to the byte.

    Args:
        cuts: What to simulate.
        references: The recorded curves.
        pool: Where the simulations run.
        say: Called with a line after each run.
        order: Names of all cuts there are, in which order they are recorded.

    Returns:
        What became of each cut; ``recorded`` says whether a new reference was written.

    Raises:
        CutcalError: The folder cannot be written, or ``reference.json`` is damaged.
    """
    references.settle()
    commit = git_commit()
    known = [_readable(cut.name, references, say) for cut in cuts]
    found = _compared(cuts, known, pool, say)
    todo = [k for k in range(len(cuts)) if is_another(found[k], cuts[k], known[k])]
    runs: dict[int, dict[int, Mapping[str, FloatArray] | None]] = {k: {RECORDED_SEED: found[k].columns} for k in todo}
    repeats = [(k, seed) for k in todo for seed in OTHER_SEEDS]
    for j, outcome, counted in _runs([(cuts[k], seed) for k, seed in repeats], pool):
        k, seed = repeats[j]
        cut, runs[k][seed] = cuts[k], outcome.columns
        if outcome.columns is None:
            found[k] = replace(found[k], verdict="broke down", reason=f"{outcome.status} with seed {seed}")
        whole = [columns for s in (RECORDED_SEED, *OTHER_SEEDS) if (columns := runs[k].get(s)) is not None]
        if len(whole) == 1 + len(OTHER_SEEDS):
            references.write(cut.name, whole[0], reference_entry(cut, whole, commit, pool.arch), order)
            found[k] = replace(found[k], recorded=True)
        say(f"{cut.words}, seed {seed}: {'recorded' if found[k].recorded else 'done'}; {counted}")
    return found


def reference_entry(
    cut: BaselineCut, runs: Sequence[Mapping[str, FloatArray]], commit: str | None, arch: str
) -> dict[str, Any]:
    """What ``reference.json`` says of a cut.

    Args:
        cut: The cut.
        runs: Its columns with the recorded seed and with the others: stroke [m], forces [N] and work [J], shape (60,).
        commit: Commit of the checkout.
        arch: Device.

    Returns:
        The entry, without the hash of its columns.
    """
    scatter, tolerances = repeatability(runs)
    groups = asdict(scatter)
    return {
        "food": cut.food.name,
        "contact": cut.contact,
        "knife": cut.knife.name,
        "seed": RECORDED_SEED,
        "dx_m": cut.scene().numerics.dx,
        "results": {name: _short(x) for name, x in asdict(cut_numbers(runs[0])).items()},
        "repeatability": {
            "seeds": [RECORDED_SEED, *OTHER_SEEDS],
            **{group: {name: _short(x) for name, x in values.items()} for group, values in groups.items()},
        },
        "tolerances": {name: _up(x) for name, x in tolerances.items()},
        "inputs": cut.inputs,
        "scene": plain_scene(cut),
        "solver": code_key()[:KEY_LENGTH],
        "versions": library_versions(),
        "platform": f"{platform.system()} {platform.machine()}",
        "device": arch,
        "commit": commit,
    }


def _runs(jobs: Sequence[tuple[BaselineCut, int]], pool: Workers) -> Iterator[tuple[int, CutOutcome, str]]:
    """Place of each job, how it ended, and how many there are left, in order of completion."""
    rest = Countdown(sum(cut.cost for cut, _ in jobs)) if jobs else None
    for count, (k, outcome) in enumerate(pool.each(run_cut, [(cut.scene(seed),) for cut, seed in jobs]), start=1):
        assert rest is not None
        yield k, outcome or KILLED, f"{count} of {len(jobs)} cuts, {rest.left(jobs[k][0].cost)}"


def _readable(name: str, references: References, say: Say) -> Reference | None:
    """The reference, None where it is missing or damaged: it is recorded anew."""
    try:
        return references.read(name)
    except RegressionError as e:
        say(f"note: {str(e).rpartition(';')[0]}; it is recorded anew")
        return None


def _short(x: float) -> float:
    """Four digits of a number."""
    return float(f"{x:.4g}")


def _up(x: float) -> float:
    """The next larger number of four digits."""
    short = _short(x)
    return short if short >= x else _short(x * (1 + 1e-3))
