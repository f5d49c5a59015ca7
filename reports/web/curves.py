"""The curves of a calibration as the page's script draws them, and their legend."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import FloatArray
from reports.base.run_folder import BAND_COLUMNS, Finished
from reports.web.markup import Markup, element

if TYPE_CHECKING:
    from calib.calibration.members import Member

#: Other columns of ``curves.csv`` and what they are called; the page does not draw them at first.
PARTS = (
    ("edge_N", "edge part of the simulation"),
    ("face_N", "face part of the simulation"),
    ("start_N", "simulation at literature values"),
    ("ramp_N", "ramp"),
    ("half_sine_N", "half sine"),
    ("three_term_N", "three-term curve"),
)
BAND = "95 % predictive band"
BAND_SHORT = "95\u00a0% band"
AXES = {"across": ("stroke", "mm"), "up": ("force on the knife", "N")}
"""What is drawn over what, with their units."""
DIGITS = 6
"""Significant digits of a member's curve."""
MOST_PLACES = 4
"""Decimals that are shown at most: a tenth of a millinewton is less than any sensor of a cut tells."""


def drawable(done: Finished, members: Sequence[Member]) -> dict[str, Any]:
    """Everything that the script draws: stroke [mm], forces [N], names, decimals.

    Args:
        done: The run and its curves.
        members: Simulations to choose from.

    Returns:
        Plain data; a value that is not known is None.
    """
    curves, label = done.curves, done.result.trace.label
    names = {"real_N": label, "sim_N": "simulated"} | {key: name for key, name in PARTS if known(curves, key)}
    ends = dict(zip(("low", "high"), BAND_COLUMNS, strict=True))
    band = {end: numbers(curves[key]) for end, key in ends.items()} if known(curves, BAND_COLUMNS[0]) else None
    peak = max(float(np.max(curves[key])) for key in ("real_N", "sim_N"))
    force, residual = places(peak), places(float(np.max(np.abs(curves["residual_N"]))))
    decimals = {"stroke": places(1e3 * float(curves["stroke_m"][-1])), "force": force, "residual": max(force, residual)}
    return {
        "x": numbers(1e3 * curves["stroke_m"], 9),
        "names": names,
        "y": {key: numbers(curves[key]) for key in names},
        "band": band,
        "band_name": BAND_SHORT,
        "main": ["real_N", "sim_N"],
        "axes": AXES,
        "residual": numbers(curves["residual_N"]),
        "residual_name": f"simulated − {label}",
        "noise": done.result.conditioning.noise_sd_N,
        "places": decimals,
        "members": [{"name": f"member {m.number}", "curve": numbers(m.curve, DIGITS)} for m in members],
    }


def known(curves: Mapping[str, FloatArray], column: str) -> bool:
    """Whether there is a curve to draw, of those by name of the column, each (n,) [N]."""
    return column in curves and bool(np.any(np.isfinite(curves[column])))


def places(largest: float) -> int:
    """Decimals that show three digits of the largest value."""
    return min(max(2 - math.floor(math.log10(largest)), 0), MOST_PLACES) if largest > 0.0 else 0


def legend(done: Finished, said: Mapping[str, str]) -> Markup:
    """A switch for each curve, with its line beside its name.

    Args:
        done: The run and its curves.
        said: What trace and simulation are called with their peaks, by column, and what lies ``inside`` the band.

    Returns:
        A list of switches.
    """
    rows = [("real_N", said["real_N"], True), ("sim_N", said["sim_N"], True)]
    if known(done.curves, BAND_COLUMNS[0]):
        rows.append(("band", f"{BAND}{said['inside']}", True))
    rows += [(key, name, False) for key, name in PARTS if known(done.curves, key)]
    return switches(rows)


def switches(rows: Iterable[tuple[str, str, bool]]) -> Markup:
    """A switch for each curve: its key, its name, and whether it is drawn at first."""
    return element("ul", *(_switch(*row) for row in rows), class_="legend")


def _switch(key: str, name: str, shown: bool) -> Markup:
    line = element("path", d="M0 6H34", class_=f"line {key}")
    area = element("rect", width="34", height="12", class_="band")
    sample = element("svg", area if key == "band" else line, viewBox="0 0 34 12", aria_hidden="true")
    box = element("input", type="checkbox", data_curve=key, checked=shown)
    return element("li", element("label", box, sample, element("span", name)), class_=None if shown else "more")


def numbers(values: FloatArray, digits: int | None = None) -> list[float | None]:
    """Numbers (n,) that JSON can hold, with as many significant digits, or all for None."""
    rounded = (float(x) if digits is None else float(f"{x:.{digits}g}") for x in values)
    return [x if math.isfinite(x) else None for x in rounded]
