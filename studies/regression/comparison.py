"""One cut against what is recorded of it: verdict, change of peak, work and shape, and what else is another.

Two questions have two tolerances. The same seed gives the same curve on every machine but for rounding
(:data:`studies.regression.baseline.SAME`): more is another solver, food or library. Whether that change matters is
asked of the tolerances of the record, the repeatability limits (ISO 5725-6): what is no more than another draw of the
particles passes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from calib.errors import CurveError
from calib.io.provenance import code_key, versions
from calib.validation.metrics import compare
from mpm.arrays import FloatArray
from studies.regression.baseline import KEY_LENGTH, SAME, BaselineCut, CutOutcome, cut_numbers, scales
from studies.regression.reference_curves import CHECKED, Reference
from studies.regression.result import CutComparison, LargestDeviation, NumberChange, NumberChanges

UNCHANGED = 1e-6
"""Part of a column's largest value below which a record is kept as it is:
what rounding and the digits of a file leave.
"""
LIBRARIES = ("cutcal", "taichi", "numpy")  # that a curve depends on


def compare_cut(cut: BaselineCut, known: Reference | None, outcome: CutOutcome) -> CutComparison:
    """What became of a cut.

    Args:
        cut: The cut.
        known: What is recorded of it, None for nothing.
        outcome: How its simulation ended.

    Returns:
        The comparison.
    """
    columns = outcome.columns
    about: dict[str, Any] = {"food": cut.food.name, "contact": cut.contact, "columns": columns}
    about["because"] = () if known is None else tuple(differences(cut, known))
    if columns is None:
        return CutComparison(**about, verdict="broke down", reason=outcome.status)
    now = asdict(cut_numbers(columns))
    if known is None:
        alone = NumberChanges(**{name: NumberChange(now=x) for name, x in now.items()})
        return CutComparison(**about, verdict="new", results=alone)
    before, limits = asdict(cut_numbers(known.columns)), known.limits
    changes = {name: _change(before[name], now[name], limits[name]) for name in now}
    verdict, largest = _deviation(known, columns)
    shape_error, nrmse = _shape(known.columns, columns)
    return CutComparison(
        **about,
        results=NumberChanges(**changes),
        shape_error=shape_error,
        nrmse=nrmse,
        verdict=verdict,
        largest=largest,
    )


def _change(before: float, now: float, limit: float) -> NumberChange:
    return NumberChange(before=before, now=now, change=now - before, over_limit=abs(now - before) / limit)


def differences(cut: BaselineCut, known: Reference) -> list[str]:
    """What is another than when the reference was recorded, in words: scene, code of the solver, libraries."""
    then, now = _flat(known.origin["scene"]), _flat(plain_scene(cut))
    said = [f"{name} {then.get(name)} -> {now.get(name)}" for name in now | then if then.get(name) != now.get(name)]
    if not said and known.origin["inputs"] != cut.inputs:
        said.append("values of the food or the knife that its scene does not show")
    solver = code_key()[:KEY_LENGTH]
    if known.origin["solver"] != solver:
        said.append(f"the solver's code {known.origin['solver']} -> {solver}")
    for name, version in library_versions().items():
        if (old := known.origin["versions"].get(name)) != version:
            said.append(f"{name} {old} -> {version}")
    return said


def is_another(found: CutComparison, cut: BaselineCut, known: Reference | None) -> bool:
    """Whether a cut is to be recorded: it went to its end, and curve or scene are not those of the record.

    Args:
        found: What became of it.
        cut: The cut.
        known: What is recorded of it, None for nothing.

    Returns:
        Whether it is.
    """
    if found.columns is None:
        return False
    if known is None or found.largest is None or _flat(known.origin["scene"]) != _flat(plain_scene(cut)):
        return True
    return known.origin["inputs"] != cut.inputs or found.largest.part > UNCHANGED


def _deviation(known: Reference, columns: Mapping[str, FloatArray]) -> tuple[str, LargestDeviation]:
    """Verdict, and the column that is furthest away over its tolerance."""
    grid, scale = known.columns["stroke_m"], scales(known.columns)
    found = []
    for name in CHECKED:
        miss = np.abs(np.interp(grid, columns["stroke_m"], columns[name]) - known.columns[name])
        k, tolerance = int(np.argmax(miss)), known.tolerances[name]
        found.append((float(miss[k]) / tolerance, name, k, float(miss[k])))
    worst, name, k, most = max(found)
    part = max(m / scale[n] for _, n, _, m in found)
    verdict = "outside" if worst > 1 else "within" if part > SAME else "same"
    return verdict, LargestDeviation(name, float(grid[k]), most, worst, part)


def _shape(before: Mapping[str, FloatArray], now: Mapping[str, FloatArray]) -> tuple[float, float]:
    """Shape error and NRMSE of the force on the knife [-]; NaN where one of the curves has no force."""
    grid = before["stroke_m"]
    try:
        found = compare(grid, before["knife_N"], np.interp(grid, now["stroke_m"], now["knife_N"]))
    except CurveError:
        return float("nan"), float("nan")
    return found.shape_error, found.nrmse


def plain_scene(cut: BaselineCut) -> dict[str, Any]:
    """The scene of a cut as a JSON file gives it back."""
    return dict(json.loads(json.dumps(cut.scene().as_dict())))


def library_versions() -> dict[str, str]:
    """Versions of what a curve depends on."""
    have = versions()
    return {name: have[name] for name in LIBRARIES if name in have}


def _flat(content: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Values of a scene by their whole names."""
    out: dict[str, Any] = {}
    for name, value in content.items():
        out |= _flat(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
    return out
