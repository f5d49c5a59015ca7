"""The page of numerics and provenance: settings, audits, simulations that failed, and where all of it came from."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mpm.output.energy import spent, unbooked
from mpm.scene.errors import BREAKDOWNS
from reports.base.format import breakable, count, duration, interval, listed, plain, quantity
from reports.base.labels import in_words, shown
from reports.base.run_folder import Data

if TYPE_CHECKING:
    from calib.calibration.result import CalibrationResult
    from calib.calibration.result_parts import BrokenRun, SearchHistory

#: Fidelities of the store in words.
KINDS = {
    "coarse": "on the screening grid",
    "fine": "on the grid that counts",
    "again": "as repeats (half the speed, other particles)",
    "check": "as checks of the numerics",
}
#: Why a simulation broke down, in words; another reason is told as the solver has it.
REASONS = {**BREAKDOWNS, "worker_died": "its process was killed"}
#: Why a search ended.
ENDS = {
    "converged": "no gain was in sight",
    "stalled": "gains were promised and none came",
    "budget": "its budget was spent",
    "interrupted": "it was stopped",
}
#: Part of the simulations from which on the first page says that they broke down [-].
MANY_FAILED = 0.1
#: The line of the first page that has the energy that no law took.
LOST = "energy lost by the discretisation"


def numerics(result: CalibrationResult) -> Data:
    """Numerical settings and audits by name; the template labels them."""
    cut, history = result.cut, result.history
    images, ripple, peak = cut.mirror_images, cut.ripple_N, result.agreement.peak_sim_N
    part = None if ripple is None or not peak > 0.0 else ripple / peak
    return {
        "dx": quantity(cut.dx_m, "m"), "cells": plain(cut.shape.height / cut.dx_m, 2),
        "particles": count(cut.particles),
        "far": _far(cut.scene),
        "images": "none" if images in (None, False, 1) else "yes" if images is True else str(images),
        "mach": quantity(cut.mach, "-"), "momentum": shown(cut.momentum_residual, "fraction", 3),
        "kinetic": quantity(cut.ke_over_ie, "fraction"), "ripple": quantity(ripple, "N"),
        "ripple_part": quantity(part, "fraction", digits=2), "wall": duration(result.wall_s),
        **_energy(result),
        **_simulations(history, result.search),
        "counters": cut.counters,
    }  # fmt: skip


def broke_down(history: SearchHistory) -> str:
    """A sentence for the first page where many simulations broke down, with a space before it; else nothing."""
    every, failed = history.every.simulations, history.every.failed
    if not failed or failed < MANY_FAILED * every:
        return ""
    return f" {count(failed)} of {count(every)} simulations broke down: where they lie the fit is blind."


def _simulations(history: SearchHistory, search: str | None) -> Data:
    """How many simulations there are and failed, and of which kinds; of older runs those of the search alone.

    Args:
        history: The simulations.
        search: How the search ended.

    Returns:
        Texts by name.
    """
    kept = history.kept
    known = {kind: kept[kind] for kind in KINDS if kind in kept} | {k: t for k, t in kept.items() if k not in KINDS}
    kinds = [f"{count(t.simulations)} {KINDS.get(kind, kind)}" for kind, t in known.items()]
    every, failed = history.every.simulations, history.every.failed
    end = "" if search not in ENDS else f", which ended as {ENDS[search]}"
    of_search = f"{count(history.simulations)} of all were the search's{end}; the others are for intervals and checks"
    return {
        "simulations": count(every),
        "failed": count(failed),
        "kinds": f"{listed(kinds)}; {of_search}" if kept else "those of the search",
        "elsewhere": count(failed - len(history.failures)) if failed > len(history.failures) else None,
    }


def _far(scene: Mapping[str, Any]) -> str | None:
    """Distance from the cut beyond which particles are fewer; None where they are not, or it was not recorded."""
    far = scene.get("numerics", {}).get("far")
    return None if far is None else quantity(far, "m", digits=2)


def _energy(result: CalibrationResult) -> Data:
    """Energy lost by the discretisation, where the rest has gone, and both parts of the work of fracture; None where it
    was not recorded. What was lost is that of the first page where it has the line."""
    energy, fracture = result.cut.energy_J or {}, result.cut.fracture
    line = next((v.value for v in result.verdicts if v.name == LOST), None)
    part = unbooked(energy) if line is None else line
    opening = None if fracture is None else fracture.get("opening_J_m2")
    return {
        "unbooked": None if part is None else shown(part, "fraction", 3),
        "spent": spent(energy),
        "opened": None if opening is None else quantity(opening, "J/m^2", digits=3),
        "parted": None if fracture is None else quantity(fracture["edge_J_m2"], "J/m^2", digits=3),
    }


def failures(failures: Sequence[BrokenRun]) -> list[list[str]]:
    """Failed simulations by reason: number, completed parts of the stroke, parameter values of the first."""
    rows = []
    for reason in sorted({f.reason for f in failures}):
        same = [f for f in failures if f.reason == reason]
        parts = [f.fraction for f in same if f.fraction is not None]
        span = interval(min(parts), max(parts), "fraction", digits=2) if parts else ""
        units = same[0].units
        first = [f"{name} = {shown(x, units[name], 3)}" for name, x in same[0].parameters.items()]
        rows.append(
            [
                breakable(in_words(reason) + (f": {REASONS[reason]}" if reason in REASONS else "")),
                str(len(same)),
                span,
                "; ".join(first),
            ]
        )
    return rows


def provenance(result: CalibrationResult) -> Data:
    """Hashes, commit, seed, device, command and versions."""
    software, called, air = result.software, result.invocation, result.air
    return {
        "trace": result.trace_sha256,
        "air": (air.sha256 or "not recorded") if air else "",
        "commit": software.git or "",
        "seed": str(called.seed),
        "device": breakable(called.device or "not recorded"),
        "command": [breakable(shlex.quote(word)) for word in called.command],
        "versions": ", ".join(f"{name}\u00a0{software.versions[name]}" for name in sorted(software.versions)),
    }
