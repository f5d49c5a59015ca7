"""Whether cuts are still those that were recorded, and what changed in peak, work and shape where they are not.

Two questions have two tolerances. The same seed gives the same curve on every machine but for rounding (``baseline.SAME``): more is
another solver, food or library. Whether that change matters is asked of the tolerances of the record, the
repeatability limits (ISO 5725-6): what is no more than another draw of the particles passes.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from calib.errors import CurveError, RegressionError
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, versions
from calib.simulation.workers import DIED, Workers
from calib.validation.metrics import compare
from mpm.arrays import FloatArray
from studies.regression.baseline import KEY_LENGTH, OTHERS, SAME, SEED, Case, cut, repeatability, results, scales
from studies.regression.reference_curves import CHECKED, Reference, References

Say = Callable[[str], None]

UNCHANGED = 1e-6
"""Part of a column's largest value below which a record is kept as it is: what rounding and the digits of a file leave."""
LIBRARIES = ("cutcal", "taichi", "numpy")  # that a curve depends on
VERDICTS = {
    "same": "the recorded curve, but for rounding",
    "within": "another curve, but no further away than another seed's",
    "outside": "further away than another seed's",
    "broke down": "the cut did not reach its end",
    "new": "nothing was recorded that could be read",
}


def check(cases: Sequence[Case], references: References, pool: Workers, say: Say) -> list[dict[str, Any]]:
    """Simulate the cases and compare them with their references.

    Args:
        cases: What to simulate.
        references: The recorded curves.
        pool: Where the simulations run.
        say: Called with a line after each run.

    Returns:
        A row for each case, see :func:`row`; ``columns`` of it hold the new curves.

    Raises:
        RegressionError: A reference is missing or damaged; nothing is simulated then.
    """
    known = [references.read(case.name) for case in cases]
    rows: dict[int, dict[str, Any]] = {}
    for k, result, counted in _runs([(case, SEED) for case in cases], pool):
        rows[k] = row(cases[k], known[k], result)
        say(f"{cases[k].words}: {rows[k]['verdict']}; {counted}")
    return [rows[k] for k in range(len(cases))]


def update(
    cases: Sequence[Case], references: References, pool: Workers, say: Say, order: Sequence[str]
) -> list[dict[str, Any]]:
    """Simulate the cases and record those that changed, each as soon as its repetitions are there.

    A reference that a cut repeats to rounding, made from the same scene, is kept to the byte.

    Args:
        cases: What to simulate.
        references: The recorded curves.
        pool: Where the simulations run.
        say: Called with a line after each run.
        order: Names of all cases there are, in which order they are recorded.

    Returns:
        A row for each case, see :func:`row`; ``recorded`` says whether a new reference was written.

    Raises:
        CutcalError: The folder cannot be written, or ``reference.json`` is damaged.
    """
    references.settle()
    commit = git_commit()
    known = [_readable(case.name, references, say) for case in cases]
    rows: dict[int, dict[str, Any]] = {}
    for k, result, counted in _runs([(case, SEED) for case in cases], pool):
        rows[k] = row(cases[k], known[k], result)
        say(f"{cases[k].words}: {rows[k]['verdict']}; {counted}")
    todo = [k for k in range(len(cases)) if _is_another(rows[k], cases[k], known[k])]
    runs: dict[int, dict[int, Mapping[str, FloatArray] | None]] = {k: {SEED: rows[k]["columns"]} for k in todo}
    repeats = [(k, seed) for k in todo for seed in OTHERS]
    for j, result, counted in _runs([(cases[k], seed) for k, seed in repeats], pool):
        k, seed = repeats[j]
        case, runs[k][seed] = cases[k], result["columns"]
        if result["columns"] is None:
            rows[k] |= {"verdict": "broke down", "reason": f"{result['status']} with seed {seed}"}
        whole = [columns for s in (SEED, *OTHERS) if (columns := runs[k].get(s)) is not None]
        if len(whole) == 1 + len(OTHERS):
            references.write(case.name, whole[0], origin(case, whole, commit, pool.arch), order)
            rows[k]["recorded"] = True
        say(f"{case.words}, seed {seed}: {'recorded' if rows[k]['recorded'] else 'done'}; {counted}")
    return [rows[k] for k in range(len(cases))]


def origin(case: Case, runs: Sequence[Mapping[str, FloatArray]], commit: str | None, arch: str) -> dict[str, Any]:
    """What ``reference.json`` says of a case.

    Args:
        case: The case.
        runs: Its columns with the recorded seed and with the others.
        commit: Commit of the checkout.
        arch: Device.
    """
    scatter, tolerances = repeatability(runs)
    return {
        "food": case.food.name,
        "contact": case.contact,
        "knife": case.knife.name,
        "seed": SEED,
        "dx_m": case.scene().numerics.dx,
        "results": {name: _short(x) for name, x in results(runs[0]).items()},
        "repeatability": {
            "seeds": [SEED, *OTHERS],
            **{group: {name: _short(x) for name, x in values.items()} for group, values in scatter.items()},
        },
        "tolerances": {name: _up(x) for name, x in tolerances.items()},
        "inputs": case.inputs,
        "scene": _plain(case),
        "solver": code_key()[:KEY_LENGTH],
        "versions": _libraries(),
        "platform": f"{platform.system()} {platform.machine()}",
        "device": arch,
        "commit": commit,
    }


def row(case: Case, known: Reference | None, result: Mapping[str, Any]) -> dict[str, Any]:
    """What became of a case: verdict, change of peak, work and shape, the largest deviation, and what else is another.

    Args:
        case: The case.
        known: What is recorded of it, None for nothing.
        result: What :func:`studies.regression.baseline.cut` gave.

    Returns:
        ``verdict`` (one of :data:`VERDICTS`), ``reason`` of a cut that broke down, ``results`` with ``before``, ``now``, ``change``
        and ``over_limit`` of each number, ``shape_error`` and ``nrmse`` [-], ``largest`` deviation, ``because``, ``columns``.
    """
    out: dict[str, Any] = {"food": case.food.name, "contact": case.contact, "reason": "", "recorded": False}
    columns = result["columns"]
    out |= {"columns": columns, "because": [] if known is None else differences(case, known)}
    if columns is None:
        return out | {"verdict": "broke down", "reason": result["status"]}
    if known is None:
        return out | {"verdict": "new", "results": {name: {"now": x} for name, x in results(columns).items()}}
    before, now = results(known.columns), results(columns)
    change = {
        name: {
            "before": before[name],
            "now": now[name],
            "change": now[name] - before[name],
            "over_limit": abs(now[name] - before[name]) / known.limits[name],
        }
        for name in now
    }
    return out | {"results": change, **_shape(known.columns, columns), **_deviation(known, columns)}


def differences(case: Case, known: Reference) -> list[str]:
    """What is another than when the reference was recorded, in words: values of the scene, code of the solver, libraries."""
    then, now = _flat(known.origin["scene"]), _flat(_plain(case))
    said = [f"{name} {then.get(name)} -> {now.get(name)}" for name in now | then if then.get(name) != now.get(name)]
    if not said and known.origin["inputs"] != case.inputs:
        said.append("values of the food or the knife that its scene does not show")
    solver = code_key()[:KEY_LENGTH]
    if known.origin["solver"] != solver:
        said.append(f"the solver's code {known.origin['solver']} -> {solver}")
    for name, version in _libraries().items():
        if (old := known.origin["versions"].get(name)) != version:
            said.append(f"{name} {old} -> {version}")
    return said


def _runs(jobs: Sequence[tuple[Case, int]], pool: Workers) -> Iterator[tuple[int, dict[str, Any], str]]:
    """Place of each job, its result, and how many there are left, in order of completion."""
    rest = Countdown(sum(case.cost for case, _ in jobs)) if jobs else None
    for count, (k, result) in enumerate(pool.each(cut, [(case.scene(seed),) for case, seed in jobs]), start=1):
        assert rest is not None
        plain = {"status": DIED, "columns": None} if result is None else result
        yield k, plain, f"{count} of {len(jobs)} cuts, {rest.left(jobs[k][0].cost)}"


def _readable(name: str, references: References, say: Say) -> Reference | None:
    """The reference, None where it is missing or damaged: it is recorded anew."""
    try:
        return references.read(name)
    except RegressionError as e:
        say(f"note: {str(e).rpartition(';')[0]}; it is recorded anew")
        return None


def _is_another(row: Mapping[str, Any], case: Case, known: Reference | None) -> bool:
    """Whether the cut of a row is to be recorded: it went to its end, and curve or scene are not those of the record."""
    if row["columns"] is None:
        return False
    if known is None or _flat(known.origin["scene"]) != _flat(_plain(case)):
        return True
    return known.origin["inputs"] != case.inputs or row["largest"]["part"] > UNCHANGED


def _deviation(known: Reference, columns: Mapping[str, FloatArray]) -> dict[str, Any]:
    """Verdict, and the column that is furthest away over its tolerance: where, by how much, and which part of its scale."""
    grid, scale = known.columns["stroke_m"], scales(known.columns)
    found = []
    for name in CHECKED:
        miss = np.abs(np.interp(grid, columns["stroke_m"], columns[name]) - known.columns[name])
        k, tolerance = int(np.argmax(miss)), known.tolerances[name]
        found.append((float(miss[k]) / tolerance, name, k, float(miss[k])))
    worst, name, k, most = max(found)
    parts = [m / scale[n] for _, n, _, m in found]
    verdict = "outside" if worst > 1 else "within" if max(parts) > SAME else "same"
    largest = {"column": name, "stroke_m": float(grid[k]), "difference": most, "over_tolerance": worst}
    return {"verdict": verdict, "largest": largest | {"part": max(parts)}}


def _shape(before: Mapping[str, FloatArray], now: Mapping[str, FloatArray]) -> dict[str, float | None]:
    """Shape error and NRMSE of the force on the knife; None where one of the curves has no force."""
    grid = before["stroke_m"]
    try:
        found = compare(grid, before["knife_N"], np.interp(grid, now["stroke_m"], now["knife_N"]))
    except CurveError:
        return {"shape_error": None, "nrmse": None}
    return {"shape_error": found.shape_error, "nrmse": found.nrmse}


def _plain(case: Case) -> dict[str, Any]:
    """The scene as a JSON file gives it back."""
    return dict(json.loads(json.dumps(case.scene().as_dict())))


def _flat(content: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Values of a scene by their whole names."""
    out: dict[str, Any] = {}
    for name, value in content.items():
        out |= _flat(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
    return out


def _libraries() -> dict[str, str]:
    have = versions()
    return {name: have[name] for name in LIBRARIES if name in have}


def _short(x: float) -> float:
    """Four digits of a number."""
    return float(f"{x:.4g}")


def _up(x: float) -> float:
    """The next larger number of four digits."""
    short = _short(x)
    return short if short >= x else _short(x * (1 + 1e-3))
