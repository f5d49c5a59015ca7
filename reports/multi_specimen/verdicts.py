"""Verdicts of a study of several cuts: a line for each cut, the lines of each cut, and the result in a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reports.base.format import DASH, breakable, compared, listed, quantity, uncertain
from reports.base.labels import LEAST_PART, related, shown
from reports.base.run_folder import Data

WIDE = 0.5
"""Mean width of a 95 % band over the measured peak from which on it tells little [-]: the limit of a calibration on one
trace."""
NRMSE, BAND_WIDTH = "curve error (NRMSE)", "width of the 95 % band"
QUARTER, HALF_LISTED = "a quarter of the simulated speed", "Half the speed is listed as it was"
IN_SAMPLE = {NRMSE: "NRMSE", "normalised-shape error": "shape", "peak force error": "peak"}
"""Lines of a fitted cut that are columns of the summary as well."""
HELD_OUT = {
    "nrmse": ("NRMSE ≤ ", "fraction"),
    "rating": ("ISO rating ≥ ", "-"),
    "inside": ("in band ≥ ", "fraction"),
    "width": ("band width ≤ ", "fraction"),
}
"""Limits of a held-out cut as the document calls them: words and unit."""


def band_width(curves: Mapping[str, np.ndarray], held: bool) -> float | None:
    """Mean width of a cut's band over its measured peak [-].

    Args:
        curves: Columns of its file, each (n,): forces [N].
        held: Whether the band is that of a prediction.

    Returns:
        The width; None where there is no band.
    """
    low, high = ("predicted_low_N", "predicted_high_N") if held else ("band_low_N", "band_high_N")
    if low not in curves or high not in curves:
        return None
    width = float(np.nanmean(curves[high] - curves[low])) / float(curves["real_N"].max())
    return width if np.isfinite(width) else None


def summary_line(name: str, cut: Data, width: float | None) -> Data:
    """A cut in the table of all cuts.

    Args:
        name: The cut.
        cut: What the document says of it.
        width: Mean width of its band over the measured peak [-]; None where there is no band.

    Returns:
        Name, cells and mark.
    """
    m = cut["metrics"]
    return {
        "name": breakable(name),
        "cells": [
            quantity(m["nrmse"], "fraction"),
            quantity(m["shape_error"], "fraction"),
            quantity(m["iso18571"]["R"], "-"),
            quantity(m["peak_error"], "fraction", signed=True),
            quantity(m["work_error"], "fraction", signed=True),
            quantity(cut.get("predictive_inside"), "fraction", digits=2),
            quantity(width, "fraction", digits=2),
            quantity(cut["factor"], "-"),
        ],
        "mark": "yes" if cut["passed"] else "no",
    }


def fitted_lines(cut: Data) -> list[Data]:
    """The lines of a fitted cut's verdict; none in documents that do not have them."""
    return [_line(v) for v in cut.get("verdicts") or []]


def held_lines(cut: Data, width: float | None) -> list[Data]:
    """The lines of a held-out cut: curve, rating, band and balances.

    Args:
        cut: What the document says of it.
        width: Mean width of its band over the measured peak [-].

    Returns:
        The lines; that of the width only where the run had a limit for it.
    """
    m, limits = cut["metrics"], cut["limits"]
    found = [
        (NRMSE, m["nrmse"], limits.get("nrmse"), "fraction", 1),
        ("ISO rating", m["iso18571"]["R"], limits.get("rating"), "-", -1),
        ("trace within the 95 % band", cut.get("predictive_inside"), limits.get("inside"), "fraction", -1),
        (BAND_WIDTH, width, limits.get("width"), "fraction", 1),
    ]
    own = [
        {"name": n, "value": x, "limit": limit, "unit": unit, "passed": sign * (x - limit) <= 0.0,
         "note": "mean, of the peak" if n == BAND_WIDTH else "", "sign": "≤ " if sign > 0 else "≥ "}
        for n, x, limit, unit, sign in found if x is not None and limit is not None
    ]  # fmt: skip
    return [_line(v) for v in (*own, *(cut.get("verdicts") or []))]


def _line(v: Data) -> Data:
    value, limit, unit, passed = v["value"], v["limit"], v["unit"] or "-", v["passed"]
    return {
        "name": breakable(v["name"]),
        "value": "not run" if value is None else shown(value, unit, 3),
        "limit": v.get("sign", related(value, limit, passed)) + shown(limit, unit, None),
        "mark": "none" if passed is None else "yes" if passed else "no",
        "note": v.get("note") or "",
    }


def reason(name: str, cut: Data, lines: list[Data]) -> str:
    """Why a cut failed, in words.

    Args:
        name: The cut.
        cut: What the document says of it.
        lines: Its lines.

    Returns:
        A sentence; empty where it passed or its lines are not known.
    """
    apart = [f"{row['name']} {row['value']}" for row in lines if row["mark"] == "no"]
    if cut["passed"] or not apart:
        return ""
    return f"{name} fails {len(apart)} of {len(lines)} lines: {listed(apart)}."


def held_limits(s: Data) -> str:
    """The limits of the predictions, which are the same for all."""
    found: Data = next((p["limits"] for p in s["hold_out"].values()), {})
    return listed([
        start + quantity(found[k], unit, digits=None)
        for k, (start, unit) in HELD_OUT.items() if found.get(k) is not None
    ])  # fmt: skip


def fitted_limits(s: Data) -> str:
    """The limits of the columns of the fitted cuts; empty where the document has no lines."""
    lines: list[Data] = next((t["verdicts"] for t in s["traces"].values() if t.get("verdicts")), [])
    known = {v["name"]: quantity(v["limit"], v["unit"] or "-", digits=None) for v in lines}
    texts = [f"{word} ≤ {known[n]}" for n, word in IN_SAMPLE.items() if n in known]
    return listed([*texts, "those of balances and numerical choices (the lines of each cut)"]) if texts else ""


def sentence(s: Data, widths: Mapping[str, float | None]) -> str:
    """The verdict in plain words: what was predicted, in how wide a band, and what was only fitted.

    Args:
        s: ``summary.json``.
        widths: Mean width of the band of each held-out cut over its peak [-].

    Returns:
        The sentences.
    """
    failed = [name for name, p in s["hold_out"].items() if not p["passed"]]
    held = len(s["hold_out"])
    if not held:
        text = "No cut was held out: every figure is in-sample, and nothing here is a prediction."
    elif failed:
        text = f"{held - len(failed)} of {held} held-out cuts were predicted within the limits; not {listed(failed)}."
    else:
        all_ = {1: f"The held-out cut {next(iter(s['hold_out']))} was", 2: "Both held-out cuts were"}
        text = f"{all_.get(held, f'All {held} held-out cuts were')} predicted within the limits."
    text += "".join(f" {said}" for said in wide_bands(widths))
    apart: list[str] = []
    for name, t in s["traces"].items():
        lines = fitted_lines(t)
        count = f" ({sum(row['mark'] == 'no' for row in lines)} of {len(lines)} lines)" if lines else ""
        apart += [] if t["passed"] else [name + count]
    text += f" Fitted cuts that failed in-sample: {listed(apart)}." if apart else " All fitted cuts passed in-sample."
    unlike = [n for n, t in s["traces"].items() if t["trace"]["label"] != "measured"]
    return breakable(text + (f" Reconstructed, not measured: {listed(unlike)}." if unlike else ""))


def wide_bands(widths: Mapping[str, float | None]) -> list[str]:
    """What a band says that is wider than half of the peak, a sentence for each."""
    return [
        f"The band of {name} is {quantity(width, 'fraction', digits=2)} of the peak wide on average, more than half of "
        "it: that the curve lies in it tells little."
        for name, width in widths.items()
        if width is not None and width > WIDE
    ]


def peaks(cut: Data, word: str) -> str:
    """Largest forces of a cut, measured and simulated, in words."""
    m = cut["metrics"]
    return f"Peak {compared(m['peak_real_N'], 'N')} measured, {compared(m['peak_sim_N'], 'N')} {word}."


def change(c: Data) -> list[str]:
    """Change of peak and work by one numerical choice."""
    if c.get("reason"):
        return [f"broke down: {c['reason'].replace('_', ' ')}", ""]
    return [_part(c.get(key)) for key in ("peak_change", "work_change")]


def _part(x: float | None) -> str:
    """A change; one that two decimals do not show is said to be below them, whatever its sign."""
    small = x is not None and abs(x) < LEAST_PART
    return shown(abs(x), "fraction", 3) if small and x is not None else quantity(x, "fraction", signed=True)


def carried_on(s: Data) -> str:
    """What the verdicts make of the slower simulations, where they carry them on to rest; else empty."""
    said = [
        f"{name} {v['note'].split(', extrapolated')[0]}"
        for name, t in s["traces"].items()
        for v in t.get("verdicts") or []
        if "extrapolated to rest" in (v.get("note") or "")
    ]
    checks = {c["name"] for t in s["traces"].values() for c in t.get("numerical_checks") or []}
    listed_ = "Half and a quarter of the speed are listed as they were" if QUARTER in checks else HALF_LISTED
    start = f"{listed_} simulated. The verdict carries the change on to rest: "
    return breakable(start + "; ".join(said) + ".") if said else ""


def factor_row(name: str, cut: Data, meaning: str) -> list[str]:
    """The factor on a cut's force beside what was known of it.

    Args:
        name: The cut.
        cut: What the document says of it; in older ones that is the factor alone.
        meaning: What the factor is, in words.

    Returns:
        Cells: cut, name, meaning, before, after, and ``yes``, ``no`` or a dash.
    """
    found: Any = (cut.get("nuisances") or {}).get("scale")
    factor = cut["factor"]
    if found is None:
        return [breakable(name), "Factor", meaning, "not recorded", quantity(factor, "-"), DASH]
    before, after = uncertain(1.0, found["prior_sd"], "-"), uncertain(factor, factor * found["sd"], "-")
    return [breakable(name), "Factor", meaning, before, after, "no" if found["outside"] else "yes"]
