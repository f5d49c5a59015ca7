"""The model section of a study's report: the cuts as simulated, the laws, what is minimised, and where limits and
ranges come from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mpm.scene import Knife
from reports.base.format import DASH, breakable, compared, count, listed, plain, quantity, uncertain
from reports.base.labels import in_words
from reports.base.references import Citations
from reports.base.run_folder import Data
from reports.calibration import model_page
from reports.multi_specimen.parameters import apart, how_far, priors
from reports.multi_specimen.shown_cut import Cited, Known, as_calibration
from reports.multi_specimen.verdicts import HELD_OUT

NOT_SAID = "What was simulated is not said in this document, which is of an older version."
STUDY = (
    "In a study the sum is over all fitted cuts, each with one factor on its force, lognormal about 1; tare, drift, "
    "lag and bandwidth are integrated out of the curve [@Kennedy 2001]."
)
PRESSED = "The prior of E is the literature's range times what the compression tests say of it."
TERMS = (
    ("Prior", "what was known before these cuts: the literature's range, for E with the study's compression tests"),
    ("Held out", "not in the fit whose flesh predicts it; *in-sample*: of a cut that was fitted"),
)
#: Where the limits of a held-out cut come from, and of those of a fitted one what is other than in a calibration.
HELD_SOURCES = {
    "nrmse": "sensors of such traces are uncertain by 10 % and more",
    "rating": "from 0.8 on the standard calls an agreement good [@ISO 18571]",
    "inside": "a right band holds 95 % of many curves' points, and of one curve, whose points hang together, now and "
    "then less: 90 % is chosen here",
    "width": "a band wider than a quarter of the peak either way predicts nothing of use",
}
TIGHTER = "chosen here: less than the 10 % of a prediction, because the values were fitted to this very curve"
FITTED_SOURCES = {"curve error (NRMSE)": TIGHTER, "normalised-shape error": TIGHTER}
BASELINES = {"constant": "constant", "linear": "line", "zero": "nothing", "air": "air run"}


def model(
    s: Data,
    curves: Mapping[str, Mapping[str, np.ndarray]],
    known: Known,
    cited: Cited,
) -> Data:
    """What the report prints of the model.

    Args:
        s: ``summary.json``.
        curves: Columns of the curves of each cut, each (n,): stroke [m], forces [N].
        known: What the folder says of food and records.
        cited: What gives the references that sources name.

    Returns:
        Sentences and rows by name.
    """
    shown = shown_cut(s, curves)
    page: Data = {} if shown is None else model_page.model(as_calibration(s, shown, known, cited))
    citations = Citations()
    content: Data = citations.numbered(
        {
            "shown": "" if shown is None else breakable(shown),
            "method": page.get("method", NOT_SAID),
            "conditions": page.get("conditions", []),
            "cuts": [_cut(name, s, columns) for name, columns in curves.items()],
            "steps": _steps(known),
            "laws": page.get("laws", []),
            "conditioning": [row for name in curves if (row := _conditioning(name, s))],
            "objective": " ".join(text for text in (page.get("objective", ""), STUDY, _pressed(s)) if text),
            "limit_sources": _limit_sources(s),
            "ranges": priors(s, known),
            "abbreviations": [*page.get("abbreviations", []), *([name, text] for name, text in TERMS)],
            "presses": [_press(press, s) for press in (s.get("presses") or {}).values()],
            "food_references": page.get("food_references", []),
        }
    )
    return {**content, "references": citations.listed}


def shown_cut(s: Data, curves: Iterable[str]) -> str | None:
    """The cut whose model is shown, the first that was fitted; None where no document says what was simulated."""
    return next((n for n in curves if {"shape", "knife", "dx_m"} <= set(s["traces"].get(n) or {})), None)


def sketch(s: Data, curves: Iterable[str], known: Known) -> bytes | None:
    """The sketch of the cut that is shown.

    Args:
        s: ``summary.json``.
        curves: Names of the cuts, in their order.
        known: What the folder says of food and records.

    Returns:
        An SVG document; None where no document says what was simulated.
    """
    shown = shown_cut(s, curves)
    return None if shown is None else model_page.sketch(as_calibration(s, shown, known, lambda sources: {}))


def _steps(known: Known) -> str:
    """The time steps of each fitted cut, in words; empty where no record says them."""
    said = [f"{plain(1e6 * x.dt)} µs in {name} ({count(x.steps)} steps)" for name, x in known.stored.items()]
    return breakable(f"Time step: {listed(said)}.") if said else ""


def _pressed(s: Data) -> str:
    return PRESSED if s.get("presses") and "E" in s["parameters"] else ""


def _of(name: str, s: Data) -> Data:
    found: Data = s["traces"].get(name) or s["hold_out"][name]
    return found


def _cut(name: str, s: Data, columns: Mapping[str, np.ndarray]) -> list[str]:
    """A line of the table of all cuts.

    Args:
        name: The cut.
        s: ``summary.json``.
        columns: Columns of its curves, each (n,): stroke [m], forces [N].

    Returns:
        Name, specimen, knife, cells, particles, stroke, and both peaks.
    """
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


def _limit_sources(s: Data) -> list[list[str]]:
    """Lines of the verdicts that share a reason for their limit, and the reason; held-out and fitted cuts apart."""
    grouped: dict[str, list[str]] = {}
    held: Data = next((cut["limits"] for cut in s["hold_out"].values()), {})
    for key, (words, unit) in HELD_OUT.items():
        if held.get(key) is not None:
            limit = f"{words}{quantity(held[key], unit, digits=None)} of a held-out cut"
            grouped.setdefault(HELD_SOURCES[key], []).append(limit)
    lines = {v["name"] for cut in (*s["traces"].values(), *s["hold_out"].values()) for v in cut.get("verdicts") or []}
    for name, why in {**model_page.LIMIT_SOURCES, **FITTED_SOURCES}.items():
        if name in lines:
            grouped.setdefault(why, []).append(f"{name} of a fitted cut" if name in FITTED_SOURCES else name)
    return [["; ".join(names), why] for why, names in grouped.items()]


def _press(press: Data, s: Data) -> list[str]:
    """Name, modulus, its uncertainty, repeats, Poisson's ratio, the fit's modulus, and files of a compression test."""
    files = "; ".join(f"{breakable(file['name'])}, SHA-256 {file['sha256'][:16]}" for file in press["files"])
    far = apart(s).get(press["name"])
    return [
        breakable(press["name"]), quantity(press["E"], "Pa"), quantity(press["spread"], "fraction", digits=2),
        count(press["repeats"]), plain(press["nu"], None), DASH if far is None else f"{how_far(far)} it", files,
    ]  # fmt: skip
