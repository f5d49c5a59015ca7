"""One cut on several grids, and apart from that with other time steps, speeds, particles: how much is numerical."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import CurveError
from calib.io.folder import prepare, write_csv, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of, versions
from calib.io.schema import tag
from calib.material.scene import with_other_particles
from calib.simulation.evaluation import FULLY_PARTED, Evaluation, pressed_away
from calib.simulation.evaluation_store import EvaluationStore, Header, content_key
from calib.simulation.workers import Workers
from calib.trace.filters import filter_simulated
from mpm.scene import Scene
from studies.convergence.gci import CurveEstimate, Estimate, curve_estimate, estimate

AXES = ("safety", "mach", "ppc", "offset", "repeat")
"""What can be varied beside the cell size, each apart from the others: dt over its limit, speed over the P-wave's,
particles per cell and direction, blade against the grid [cells], and what should not matter at all."""
POINTS = 240
"""Points of the common stroke grid, as of a calibration."""
WORK_LIMIT, PEAK_LIMIT = 0.02, 0.03
"""Largest change between the two finest grids that counts as converged [-]."""


@dataclass(frozen=True)
class Case:
    """One run. Attributes: axis that is varied (``repeat``: particles and the grid's place), its value, the scene."""

    axis: str
    value: float
    scene: Scene

    @property
    def cost(self) -> float:
        """Particle steps of the run up to a constant."""
        n = self.scene.numerics
        whole = 4 / 2 ** sum(self.scene.mirrors)
        return n.ppc**3 / n.dx**4 / (n.safety * self.scene.motion.mach) * whole

    @property
    def words(self) -> str:
        """The case in words."""
        return f"dx {self.value * 1e3:g} mm" if self.axis == "dx" else f"{self.axis} {self.value:g}"


def cases(scene: Scene, axes: Mapping[str, Sequence[float]], repeats: int) -> list[Case]:
    """Runs of a study; the other axes are varied on the coarsest grid, runs repeated on the next finer one.

    Args:
        scene: The cut.
        axes: Values of each axis to vary, ``dx`` at least two.
        repeats: Runs with other particles and the grid elsewhere, to tell noise from trend. With two grids they are on the
            coarser one.

    Raises:
        CurveError: Fewer than two cell sizes.
        SceneError: A value that cannot be simulated.
    """
    cells = sorted(axes["dx"], reverse=True)
    if len(cells) < 2:
        raise CurveError(f"--dx {cells[0]:g}: give at least two cell sizes, for instance 3e-3,2e-3,1.5e-3")
    out = [Case("dx", dx, replace(scene, numerics=replace(scene.numerics, dx=dx))) for dx in cells]
    base = out[0].scene
    for value in axes.get("safety", ()):
        out.append(Case("safety", value, replace(base, numerics=replace(base.numerics, safety=value))))
    for value in axes.get("mach", ()):
        out.append(Case("mach", value, replace(base, motion=replace(base.motion, mach=value))))
    for value in axes.get("ppc", ()):
        out.append(Case("ppc", value, replace(base, numerics=replace(base.numerics, ppc=round(value)))))
    for value in axes.get("offset", ()):
        shifted = replace(base.numerics, grid_shift=(0.0, value, 0.0))
        out.append(Case("offset", value, replace(base, numerics=shifted)))
    own = out[min(1, len(cells) - 2)].scene
    for k in range(1, repeats + 1):
        out.append(Case("repeat", k, with_other_particles(own, k)))
    return out


def run(
    scene: Scene,
    axes: Mapping[str, Sequence[float]],
    out: Path,
    pool: Workers,
    *,
    about: Mapping[str, Any],
    repeats: int = 3,
    resume: bool = False,
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Run a study and write converge.json, curves.csv, converge.svg and report.pdf.

    Args:
        scene: The cut; its cell size is not used.
        axes: Values to try by axis.
        out: Output folder.
        pool: Where the runs are made.
        about: What converge.json says of food, knife and command.
        repeats: Runs with other particles and the grid elsewhere.
        resume: Go on with the study in ``out``.
        say: Called with a line after each run.

    Returns:
        The content of converge.json.

    Raises:
        CutcalError: Impossible values, or results of something else in ``out``; nothing that was computed is lost.
    """
    todo = cases(scene, axes, repeats)
    prepare(out, resume=resume)
    with EvaluationStore(out / "evaluations.h5", Header("", key_of(scene.as_dict())), resume=resume) as store:
        results = _evaluate(todo, store, pool, say)
    document = {"schema": tag("converge"), **about, **_conclude(todo, results, out)}
    least = min((r.parted for r in results if r.parted < FULLY_PARTED), default=None)
    if least is not None:
        say(f"note: {pressed_away(least)}")
        document["warnings"] = [*about["warnings"], pressed_away(least)]
    document |= {"device": pool.arch, "versions": versions(), "git": git_commit()}
    write_json(out / "converge.json", document)
    from reports.convergence import write_figure, write_report

    write_figure(out)
    write_report(out)
    return document


def _evaluate(
    todo: Sequence[Case], store: EvaluationStore, pool: Workers, say: Callable[[str], None]
) -> list[Evaluation]:
    """Results of all cases in their order; what the store knows is not run again, and the longest runs start first."""
    keys = [content_key(case.scene.as_dict(), {}, code_key()) for case in todo]
    found = {k: known for k, key in enumerate(keys) if (known := store.get(key))}
    new = sorted((k for k in range(len(todo)) if k not in found), key=lambda k: -todo[k].cost)
    if found:
        say(f"{len(found)} of {len(todo)} runs are known already")
    total = sum(todo[k].cost for k in new)
    rest = Countdown(total)
    if new:
        say(f"{len(new)} runs; the finest grid costs {max(todo[k].cost for k in new) / total:.0%} of them")
        for result in pool.run([(todo[k].scene, {}) for k in new]):
            k = new[result.index]
            store.append(keys[k], result, todo[k].words)
            found[k] = result
            peak, work = (result.scalars.get(name, math.nan) for name in ("peak_N", "work_J"))
            state = f"peak {peak:.2f} N, work {work:.4f} J" if result.ok else f"broke down ({result.reason})"
            say(f"{todo[k].words}: {state}; {len(found)} of {len(todo)} runs, {rest.left(todo[k].cost)}")
    return [found[k] for k in range(len(todo))]


def _conclude(todo: Sequence[Case], results: Sequence[Evaluation], out: Path) -> dict[str, Any]:
    """The document; writes curves.csv."""
    grids = [(c, r) for c, r in zip(todo, results, strict=True) if c.axis == "dx"]
    sound = [(c.value, r) for c, r in grids if r.ok]
    if len(sound) < 2:
        reasons = ", ".join(f"{c.words}: {r.reason}" for c, r in grids if not r.ok)
        raise CurveError(
            f"fewer than two grids reached the end of the stroke ({reasons}); try other --dx or --set values"
        )
    h = [dx for dx, _ in sound]
    same = _repeated(todo, results)
    noise = {name: float(_deviation([r.scalars[name] for r in same])) for name in ("peak_N", "work_J")}
    by_name = {name: estimate(h, [r.scalars[name] for _, r in sound], noise[name]) for name in ("peak_N", "work_J")}
    stroke = np.linspace(0.0, min(r.stroke[-1] for r in (*(r for _, r in sound), *same)), POINTS)
    curves = [filter_simulated(stroke, r.stroke, r.force) for _, r in sound]
    curve = curve_estimate(h, curves, _deviation([filter_simulated(stroke, r.stroke, r.force) for r in same]))
    columns = {f"force_dx_{dx:g}_N": values for dx, values in zip(h, curves, strict=True)}
    write_csv(
        out / "curves.csv",
        {"stroke_m": stroke, **columns, "u_num_N": curve.u_num, "u_num_coarsest_N": curve.u_coarsest},
    )
    peak, work = by_name["peak_N"], by_name["work_J"]
    return {
        "grids": [{"dx_m": c.value, **_row(r)} for c, r in grids],
        **_agreement(peak, work, curve),
        "repeat_sd_peak_N": noise["peak_N"],
        "repeat_sd_work_J": noise["work_J"],
        **{axis: _axis(todo, results, axis) for axis in AXES},
    }


def _agreement(peak: Estimate, work: Estimate, curve: CurveEstimate) -> dict[str, Any]:
    return {
        "order": work.order,
        "gci_peak": peak.gci,
        "gci_work": work.gci,
        "verdict": work.verdict,
        "converged": abs(work.change) <= WORK_LIMIT and abs(peak.change) <= PEAK_LIMIT,
        "limits": {"work": WORK_LIMIT, "peak": PEAK_LIMIT},
        "peak": vars(peak),
        "work": vars(work),
        "order_curve": curve.order,
        "gci_curve_median": float(np.median(curve.gci)),
        "gci_curve_max": float(curve.gci.max()),
    }


def _row(r: Evaluation) -> dict[str, Any]:
    names = ("peak_N", "work_J", "parted", "particles", "steps", "momentum_residual", "ke_over_ie", "ripple_N")
    numbers = {name: r.scalars.get(name) for name in names}
    return {**numbers, "wall_s": r.seconds, "status": r.status, "reason": r.reason, "fraction": r.fraction}


def _axis(todo: Sequence[Case], results: Sequence[Evaluation], axis: str) -> dict[str, Any] | None:
    """Rows of one axis with the run that they differ from among them, and the spread of what they give."""
    base = _base(todo, axis)
    own = {"safety": base.scene.numerics.safety, "mach": base.scene.motion.mach, "ppc": base.scene.numerics.ppc}
    rows = [(c.value, r) for c, r in zip(todo, results, strict=True) if c.axis == axis]
    if not rows:
        return None
    rows = sorted([(float(own.get(axis, 0)), results[todo.index(base)]), *rows], key=lambda row: row[0])
    rows = [row for k, row in enumerate(rows) if k == 0 or row[0] != rows[k - 1][0]]
    good = [(v, r) for v, r in rows if r.ok]
    out: dict[str, Any] = {"rows": [{axis: v, **_row(r)} for v, r in rows]}
    for name in ("peak_N", "work_J"):
        values = np.array([r.scalars[name] for _, r in good])
        if len(values) > 1:
            out[f"spread_{name[:4]}"] = float(np.abs(values / values.mean() - 1).max())
            if axis == "mach":
                speeds = np.log([v for v, _ in good])
                out[f"slope_{name[:4]}"] = float(np.polyfit(speeds, np.log(values), 1)[0])
    return out


def _base(todo: Sequence[Case], axis: str) -> Case:
    """The run from which those of an axis differ."""
    cells = {c.scene.numerics.dx for c in todo if c.axis == axis}
    return next(c for c in todo if c.axis == "dx" and (not cells or c.value in cells))


def _repeated(todo: Sequence[Case], results: Sequence[Evaluation]) -> list[Evaluation]:
    """Results that should agree: runs that differ in their particles and the grid's place only."""
    base = results[todo.index(_base(todo, "repeat"))]
    return [r for r in (base, *(r for c, r in zip(todo, results, strict=True) if c.axis == "repeat")) if r.ok]


def _deviation(values: Sequence[float] | Sequence[np.ndarray]) -> np.ndarray:
    """Standard deviation between some values or curves; 0 where there are fewer than two."""
    return np.asarray(np.std(values, axis=0, ddof=1) if len(values) > 1 else 0.0)
