"""The model section of a study's report: the cuts as simulated, the laws, what is minimised, and where limits and
ranges come from."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mpm.scene import Knife
from reports.base.format import DASH, breakable, compared, count, interval, plain, quantity, uncertain
from reports.base.labels import in_words, source_in_words
from reports.base.references import Citations
from reports.base.run_folder import Data

METHOD = (
    "The food is a three-dimensional continuum. Particles carry it and exchange momentum through a regular grid of "
    "cells (moving least squares material point method [@Hu 2018], quadratic kernels). There is no artificial damping, "
    "no scaling of mass, and no clamp on a force or a strain. The blade is rigid and goes down at one speed; the board "
    "is rigid."
)
LAWS = (
    ("Elasticity", "fixed-corotated, isotropic [@Stomakhin 2012]", "E, nu, rho"),
    ("Flow", "von Mises, no hardening", "yield_stress"),
    ("Loss", "Kelvin–Voigt, the loss factor at the first axial mode", "loss_factor"),
    (
        "Crack",
        "on the blade's plane alone [@Nairn 2003]: ties that soften linearly [@Hillerborg 1976]; their work per area "
        "is part of R",
        "strength_ratio, R",
    ),
    (
        "Edge",
        "line force: starts at the resistance of skin or flesh, then needs what the opening has left of R "
        "[@Atkins 2009]",
        "R_skin, initiation_depth, R",
    ),
    ("Faces", "unilateral contact (Nitsche [@Chouly 2013]), Coulomb friction up to the shear yield stress", "mu"),
)
LAYERS = ("Layers", "rind and core have a size, a resistance and a stiffness of their own", "R_rind, R_core")
OBJECTIVE = (
    "The fit minimises one sum over all fitted cuts: squared residuals of curve and peak, whitened, and of the "
    "parameters against the literature's ranges (central 95 % of normal priors, of the logarithm for stresses and "
    "resistances). Each cut has one factor on its force, lognormal about 1; tare, drift, lag and bandwidth are "
    "integrated out of the curve [@Kennedy 2001]. Intervals are profile likelihoods whose ends were simulated "
    "[@Raue 2009]. NRMSE is the root mean square difference of two curves over the measured peak; the ISO rating "
    "follows [@ISO 18571]."
)
FIXED = "Values that were not fitted are in material.yaml of the same folder, each with its source."
BASELINES = {"constant": "constant", "linear": "line", "zero": "nothing", "air": "air run"}


def model(
    s: Data,
    curves: Mapping[str, Mapping[str, np.ndarray]],
    limit_sources: Mapping[str, str],
) -> Data:
    """What the report prints of the model.

    Args:
        s: ``summary.json``.
        curves: Columns of the curves of each cut, each (n,): stroke [m], forces [N].
        limit_sources: Where the limit of each line of a verdict comes from.

    Returns:
        Sentences and rows by name.
    """
    layered = any(name.startswith(("R_rind", "R_core")) for name in s["parameters"])
    citations = Citations()
    content: Data = citations.numbered(
        {
            "method": METHOD,
            "cuts": [_cut(name, s, columns) for name, columns in curves.items()],
            "laws": [[part, law, names] for part, law, names in (*LAWS, *([LAYERS] if layered else []))],
            "conditioning": [row for name in curves if (row := _conditioning(name, s))],
            "objective": OBJECTIVE,
            "fixed": FIXED,
            "limit_sources": _limit_sources(s, limit_sources),
            "ranges": _ranges(s["parameters"]),
            "presses": [_press(press) for press in (s.get("presses") or {}).values()],
        }
    )
    return {**content, "references": citations.listed}


def _of(name: str, s: Data) -> Data:
    found: Data = s["traces"].get(name) or s["hold_out"][name]
    return found


def _cut(name: str, s: Data, columns: Mapping[str, np.ndarray]) -> list[str]:
    """Name, specimen, knife, cells, particles, stroke, and both peaks of a cut."""
    cut = _of(name, s)
    shape, knife, dx = cut.get("shape"), cut.get("knife"), cut.get("dx_m")
    particles = cut.get("particles", (cut.get("scalars") or {}).get("particles"))
    m = cut["metrics"]
    cells = "not recorded" if dx is None else quantity(dx, "m")
    if shape is not None and dx is not None:
        cells += f", {plain(shape['height'] / dx, 2)} over the height"
    return [
        breakable(name),
        "not recorded" if shape is None else _specimen(shape),
        "not recorded" if knife is None else _knife(Knife(**knife)),
        cells,
        count(particles),
        quantity(float(columns["stroke_m"][-1]), "m"),
        compared(m["peak_real_N"], "N"),
        compared(m["peak_sim_N"], "N"),
    ]


def _specimen(shape: Data) -> str:
    sizes = " × ".join(plain(1e3 * shape[key]) for key in ("length", "width", "height"))
    name = in_words(shape["kind"]) + ("" if shape.get("outline") is None else " of its own outline")
    return f"{name}, {sizes} mm"


def _knife(knife: Knife) -> str:
    return f"{breakable(knife.name)}: wedge {quantity(knife.angle, 'rad')}, spine {quantity(knife.spine, 'm')}"


def _conditioning(name: str, s: Data) -> list[str]:
    """How the record of a cut became a curve; empty where the document does not say it."""
    c = _of(name, s).get("conditioning")
    if not c:
        return []
    baseline = f"{BASELINES.get(c['baseline_kind'], c['baseline_kind'])}, "
    baseline += uncertain(c["baseline_N"], c["baseline_sd_N"], "N")
    low_pass = c.get("bandwidth_Hz")
    return [
        breakable(name), baseline, uncertain(c["onset_s"], c["onset_sd_s"], "s"), in_words(c["stroke_source"]),
        quantity(c["noise_sd_N"], "N", digits=2), quantity(c["filter_sd_m"], "m", digits=None),
        DASH if low_pass is None else quantity(low_pass, "Hz"),
    ]  # fmt: skip


def _limit_sources(s: Data, sources: Mapping[str, str]) -> list[list[str]]:
    """Lines of the verdicts that share a reason for their limit, and the reason."""
    names = {v["name"] for cut in (*s["traces"].values(), *s["hold_out"].values()) for v in cut.get("verdicts") or []}
    if any(cut["limits"].get("width") is not None for cut in s["hold_out"].values()):
        names.add("width of the 95 % band")
    grouped: dict[str, list[str]] = {}
    for name, why in sources.items():
        if name in names:
            grouped.setdefault(why, []).append(name)
    return [["; ".join(lines), why] for why, lines in grouped.items()]


def _press(press: Data) -> list[str]:
    """Name, modulus, its uncertainty, repeats, Poisson's ratio and files of a compression test."""
    files = "; ".join(f"{breakable(file['name'])}, SHA-256 {file['sha256'][:16]}" for file in press["files"])
    return [
        breakable(press["name"]), quantity(press["E"], "Pa"), quantity(press["spread"], "fraction", digits=2),
        count(press["repeats"]), plain(press["nu"], None), files,
    ]  # fmt: skip


def _ranges(parameters: Data) -> list[list[str]]:
    """Where the literature's range of each property comes from, each once."""
    found: dict[tuple[str, ...], str] = {}
    for name, p in parameters.items():
        ends, source = (
            interval(p["prior_low"], p["prior_high"], p["unit"]),
            source_in_words(p.get("source") or "", " of materials.yaml"),
        )
        if source:
            found.setdefault((name.split("@")[0], ends, in_words(p.get("status") or ""), source), name)
    return [[breakable(row[0]), *row[1:]] for row in found]
