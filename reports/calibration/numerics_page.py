"""The page of numerics and provenance: settings, audits, simulations that failed, and where all of it came from."""

from __future__ import annotations

import shlex

from calib.material.properties import PROPERTIES
from mpm.output.energy import spent, unbooked
from reports.base.format import breakable, count, duration, interval, plain, quantity
from reports.base.labels import shown, words
from reports.base.run_folder import Data


def numerics(s: Data) -> Data:
    """Numerical settings and audits by name; the template labels them."""
    images, ripple = s["mirror_images"], s["ripple_N"]
    part = None if ripple is None or not s["peak_sim_N"] > 0.0 else ripple / s["peak_sim_N"]
    return {
        "dx": quantity(s["dx_m"], "m"), "cells": plain(s["shape"]["height"] / s["dx_m"], 2),
        "particles": count(s["particles"]),
        "far": _far(s),
        "images": "none" if images in (None, False, 1) else "yes" if images is True else str(images),
        "mach": quantity(s["mach"], "-"), "momentum": quantity(s["momentum_residual"], "fraction"),
        "kinetic": quantity(s["ke_over_ie"], "fraction"), "ripple": quantity(ripple, "N"),
        "ripple_part": quantity(part, "fraction", digits=2), "wall": duration(s["wall_s"]),
        **_energy(s.get("energy_J") or {}, s.get("fracture")),
        "simulations": count(s["simulations"]), "failed": count(s["failed_simulations"]),
        "coarse": count(s["coarse_simulations"]) if s.get("coarse_simulations") else None,
        "counters": s.get("counters"),
    }  # fmt: skip


def _far(s: Data) -> str | None:
    """Distance from the cut beyond which particles are fewer; None where they are not, or it was not recorded."""
    far = s.get("scene", {}).get("numerics", {}).get("far")
    return None if far is None else quantity(far, "m", digits=2)


def _energy(energy: Data, fracture: Data | None) -> Data:
    """Part of the work that no law has taken, where the rest has gone, and both parts of the work of fracture; None where it
    was not recorded."""
    part = unbooked(energy)
    per_area = fracture or {"edge_J_m2": None, "released_J_m2": None}
    return {
        "unbooked": None if part is None else quantity(part, "fraction", digits=2),
        "spent": spent(energy),
        "released": None if fracture is None else quantity(per_area["released_J_m2"], "J/m^2", digits=3),
        "parted": None if fracture is None else quantity(per_area["edge_J_m2"], "J/m^2", digits=3),
    }


def failures(failures: list[Data]) -> list[list[str]]:
    """Failed simulations by reason: number, completed parts of the stroke, parameter values of the first."""
    rows = []
    for reason in sorted({f["reason"] for f in failures}):
        same = [f for f in failures if f["reason"] == reason]
        parts = [f["fraction"] for f in same if f["fraction"] is not None]
        span = interval(min(parts), max(parts), "fraction") if parts else ""
        first = [f"{k} = {shown(v, PROPERTIES[k].unit if k in PROPERTIES else '-', 3)}"
                 for k, v in same[0]["parameters"].items()]  # fmt: skip
        rows.append([breakable(words(reason)), str(len(same)), span, "; ".join(first)])
    return rows


def provenance(s: Data) -> Data:
    """Hashes, commit, seed, device, command and versions."""
    return {
        "trace": s["trace_sha256"],
        "air": str(s["air"].get("sha256", "not recorded")) if s["air"] else "",
        "commit": s["git"] or "",
        "seed": str(s["seed"]),
        "device": breakable(s["device"] or "not recorded"),
        "command": [breakable(shlex.quote(word)) for word in s["command"]],
        "versions": ", ".join(f"{name}\u00a0{s['versions'][name]}" for name in sorted(s["versions"])),
    }
