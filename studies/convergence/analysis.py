"""What the runs of a convergence study say: order and index of peak, work and curve, and what else changes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib.errors import CurveError
from calib.io.provenance import git_commit, versions
from calib.simulation.evaluation import FULLY_PARTED, Evaluation, pressed_away
from calib.trace.filters import N_STROKE, filter_simulated
from calib.validation.method_constants import CONSTANTS
from mpm.arrays import FloatArray
from mpm.scene import Scene
from studies.convergence.gci import curve_estimate, estimate
from studies.convergence.plan import AXES, CutDescription, PlannedRun
from studies.convergence.result import (
    AxisResult,
    ConstantResult,
    ConvergenceLimits,
    ConvergenceResult,
    ForceCurves,
    RunResult,
)

CONVERGED = ConvergenceLimits(work=0.02, peak=0.03, gci=0.05)
"""What counts as converged: changes between the two finest grids, and the index that says how far the finest may still
be from the end: as much as a calibration's peak may be off."""


def analyse(
    runs: Sequence[PlannedRun], evaluations: Sequence[Evaluation], cut: CutDescription, device: str
) -> tuple[ConvergenceResult, ForceCurves]:
    """The result of a convergence study.

    Args:
        runs: What was run.
        evaluations: How each ended, in the same order.
        cut: What is said of food, knife and command.
        device: Where it was run.

    Returns:
        The result, and the force curves of the grids whose run ended.

    Raises:
        CurveError: Fewer than two grids reached the end of the stroke.
    """
    pairs = list(zip(runs, evaluations, strict=True))
    grids = [(run, done) for run, done in pairs if run.axis == "dx"]
    sound = [(run.value, done) for run, done in grids if done.ok]
    if len(sound) < 2:
        reasons = ", ".join(f"{run.words}: {done.reason}" for run, done in grids if not done.ok)
        raise CurveError(
            f"fewer than two grids reached the end of the stroke ({reasons}); try other --dx or --set values"
        )
    h = [dx for dx, _ in sound]
    same = _repeated(runs, evaluations)
    sd_peak, sd_work = (float(_deviation([r.scalars[name] for r in same])) for name in ("peak_N", "work_J"))
    peak = estimate(h, [r.scalars["peak_N"] for _, r in sound], sd_peak)
    work = estimate(h, [r.scalars["work_J"] for _, r in sound], sd_work)
    stroke = np.linspace(0.0, min(r.stroke[-1] for r in (*(r for _, r in sound), *same)), N_STROKE)
    forces = [filter_simulated(stroke, r.stroke, r.force) for _, r in sound]
    curve = curve_estimate(h, forces, _deviation([filter_simulated(stroke, r.stroke, r.force) for r in same]))
    least = min((r.parted for r in evaluations if r.parted < FULLY_PARTED), default=None)
    result = ConvergenceResult(
        food=cut.food,
        knife=cut.knife,
        shape=cut.shape,
        command=tuple(cut.command),
        warnings=(*cut.warnings, *([] if least is None else [pressed_away(least)])),
        grids=tuple(_run_result("dx", run.value, done) for run, done in grids),
        limits=CONVERGED,
        peak=peak,
        work=work,
        order_curve=curve.order,
        gci_curve_median=float(np.median(curve.gci)),
        gci_curve_max=float(curve.gci.max()),
        repeat_sd_peak_N=sd_peak,
        repeat_sd_work_J=sd_work,
        safety=_axis_result(runs, evaluations, "safety"),
        mach=_axis_result(runs, evaluations, "mach"),
        ppc=_axis_result(runs, evaluations, "ppc"),
        offset=_axis_result(runs, evaluations, "offset"),
        repeat=_axis_result(runs, evaluations, "repeat"),
        constants=_constant_results(runs, evaluations),
        device=device,
        versions=versions(),
        git=git_commit(),
    )
    return result, ForceCurves(stroke, dict(zip(h, forces, strict=True)), curve.u_num, curve.u_coarsest)


def _run_result(axis: str, value: float, done: Evaluation) -> RunResult:
    get = done.scalars.get
    varied: dict[str, Any] = {"dx_m" if axis == "dx" else axis if axis in AXES else "value": value}
    return RunResult(
        **varied,
        peak_N=get("peak_N"),
        work_J=get("work_J"),
        parted=get("parted"),
        particles=get("particles"),
        steps=get("steps"),
        momentum_residual=get("momentum_residual"),
        ke_over_ie=get("ke_over_ie"),
        ripple_N=get("ripple_N"),
        wall_s=done.seconds,
        status=done.status,
        reason=done.reason,
        fraction=done.fraction,
    )


def _constant_results(
    runs: Sequence[PlannedRun], evaluations: Sequence[Evaluation]
) -> Mapping[str, ConstantResult] | None:
    """What each constant of the method changes, by its key; None where none was varied."""
    found = {c: _axis_result(runs, evaluations, c.key) for c in CONSTANTS if c.key not in AXES}
    out = {c.key: ConstantResult(name=c.name, **vars(axis)) for c, axis in found.items() if axis is not None}
    return out or None


def _own_values(scene: Scene) -> dict[str, float]:
    """Values of a scene on the axes that are no shifts, by axis."""
    own = {"safety": scene.numerics.safety, "mach": scene.motion.mach, "ppc": float(scene.numerics.ppc)}
    return {c.key: c.value(scene) for c in CONSTANTS} | own


def _axis_result(runs: Sequence[PlannedRun], evaluations: Sequence[Evaluation], axis: str) -> AxisResult | None:
    """Runs of one axis with the run that they differ from among them, and the spread of what they give."""
    base = _base(runs, axis)
    own = _own_values(base.scene)
    rows = [(run.value, done) for run, done in zip(runs, evaluations, strict=True) if run.axis == axis]
    if not rows:
        return None
    rows = sorted([(own.get(axis, 0.0), evaluations[runs.index(base)]), *rows], key=lambda row: row[0])
    rows = [row for k, row in enumerate(rows) if k == 0 or row[0] != rows[k - 1][0]]
    good = [(value, done) for value, done in rows if done.ok]
    spreads: dict[str, float] = {}
    for name, key in (("peak_N", "peak"), ("work_J", "work")):
        values = np.array([done.scalars[name] for _, done in good])
        if len(values) > 1:
            spreads[f"spread_{key}"] = float(np.abs(values / values.mean() - 1).max())
            if axis == "mach":
                speeds = np.log([value for value, _ in good])
                spreads[f"slope_{key}"] = float(np.polyfit(speeds, np.log(values), 1)[0])
    return AxisResult(rows=tuple(_run_result(axis, value, done) for value, done in rows), **spreads)


def _base(runs: Sequence[PlannedRun], axis: str) -> PlannedRun:
    """The run from which those of an axis differ."""
    cells = {run.scene.numerics.dx for run in runs if run.axis == axis}
    return next(run for run in runs if run.axis == "dx" and (not cells or run.value in cells))


def _repeated(runs: Sequence[PlannedRun], evaluations: Sequence[Evaluation]) -> list[Evaluation]:
    """Runs that should agree: they differ in their particles and the grid's place only."""
    base = evaluations[runs.index(_base(runs, "repeat"))]
    others = (done for run, done in zip(runs, evaluations, strict=True) if run.axis == "repeat")
    return [done for done in (base, *others) if done.ok]


def _deviation(values: Sequence[float] | Sequence[FloatArray]) -> FloatArray:
    """Standard deviation between some values or curves; 0 where there are fewer than two."""
    return np.asarray(np.std(values, axis=0, ddof=1) if len(values) > 1 else 0.0)
