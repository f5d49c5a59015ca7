"""What was fitted in a study: values beside their priors, where these come from, and what a compression test says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from reports.base.format import breakable, interval, listed, quantity
from reports.base.labels import in_words, source_in_words
from reports.base.run_folder import Data
from reports.calibration import parameter_page
from reports.multi_specimen.shown_cut import Known, not_fitted

SIZES = {
    "length": "size of the specimen across the blade",
    "width": "size of the specimen along the blade",
    "height": "height of the specimen",
}
"""What a fitted size is, in words."""
FAR = 2.0
"""Standard deviations from a compression test from which on a fitted modulus is named on the first page."""
BEFORE = ". Before: "
"""What stands before the literature's source where a document says that a compression test has narrowed a range."""
MEASURED_HERE = "measured"
"""Kind of the source of a modulus that a compression test of the study has narrowed."""


def parameter(name: str, p: Data, meanings: Mapping[str, str]) -> list[str]:
    """A line of the table of fitted values.

    Args:
        name: The parameter, that of one cut as ``NAME@CUT``.
        p: What the document says of it.
        meanings: What each property is, in words.

    Returns:
        Name, meaning, value, interval, prior, identifiability, the cut that has it for itself, and whether the value
        is outside of its prior, in words.
    """
    of, _, cut = name.partition("@")
    row = parameter_page.parameter(of, _typed(p), meanings.get(of) or SIZES.get(of, ""))
    cells = [row[key] for key in ("name", "meaning", "value", "interval", "literature", "verdict")]
    return [*cells, breakable(cut), "outside its prior" if row["outside"] else ""]


def _typed(p: Data) -> Any:
    """A parameter of the document with attributes, as a calibration's pages read it."""
    return SimpleNamespace(**{"status": "", "source": "", **p})


def legend(s: Data) -> list[list[str]]:
    """The verdicts on identifiability that occur, and what they mean."""
    return parameter_page.legend({name: _typed(p) for name, p in s["parameters"].items()})


def correlations(s: Data) -> tuple[list[str], np.ndarray]:
    """Names of parameters and their posterior correlations (k, k); none where the document does not have them."""
    return parameter_page.correlation_matrix(s.get("correlations") or {}, list(s["parameters"]))


def fixed(s: Data, known: Known, meanings: Mapping[str, str]) -> list[list[str]]:
    """Lines of the table of values that were not fitted.

    Args:
        s: ``summary.json``.
        known: What the folder says of food and records.
        meanings: What each property is, in words.

    Returns:
        Name, meaning, value, kind and text of the source of each.
    """
    return [parameter_page.fixed(name, _typed(p), meanings.get(name, "")) for name, p in not_fitted(s, known).items()]


def priors(s: Data, known: Known) -> list[list[str]]:
    """Where the prior of each property comes from, each once: name, prior, kind and text of the source."""
    tests = list((s.get("presses") or {}).values())
    found: dict[tuple[str, ...], str] = {}
    for name, p in s["parameters"].items():
        of = name.partition("@")[0]
        kind, source = in_words(p.get("status") or ""), (p.get("source") or "").split(BEFORE)[-1]
        if tests and of == "E":
            kind, source = MEASURED_HERE, _narrowed(source, p["unit"], known.properties.get("E", {}), tests)
        elif tests and of == "yield_stress" and "E" in s["parameters"]:
            source += "; follows the prior of E, which the compression test has narrowed"
        if source:
            ends = interval(p["prior_low"], p["prior_high"], p["unit"])
            found.setdefault((of, ends, kind, source_in_words(source)), name)
    return [[breakable(row[0]), *row[1:]] for row in found]


def _narrowed(source: str, unit: str, food: Data, tests: list[Data]) -> str:
    """The source of a prior that is the literature's range and compression tests together.

    Args:
        source: Where the literature's range is from.
        unit: Unit of the property.
        food: What the food's file says of the property; nothing where it cannot be read.
        tests: The compression tests.

    Returns:
        The source in words.
    """
    low, high = food.get("low"), food.get("high")
    ends = "" if low is None or high is None else f", {interval(low, high, unit)}"
    said = listed([f"{t['name']} ({_test(t)})" for t in tests])
    return f"literature{ends}: {source}; narrowed by the compression test {said}"


def _test(test: Data) -> str:
    return f"{quantity(test['E'], 'Pa')} ± {quantity(test['spread'], 'fraction', digits=2)}"


def apart(s: Data) -> dict[str, float]:
    """Standard deviations of each compression test by which the fitted modulus is above it, by its name."""
    p = s["parameters"].get("E")
    tests = (s.get("presses") or {}).values()
    return {} if p is None else {t["name"]: math.log(p["value"] / t["E"]) / t["spread"] for t in tests if t["spread"]}


def conflicts(s: Data) -> list[str]:
    """Fitted values that are outside of their priors or far from a compression test, a sentence for each."""
    said = []
    for name, p in s["parameters"].items():
        of, _, cut = name.partition("@")
        row = parameter_page.parameter(of, _typed(p), "")
        parts = [f"outside its prior, {row['literature']}"] if row["outside"] else []
        tests = {t["name"]: t for t in (s.get("presses") or {}).values()}
        for test, far in apart(s).items() if name == "E" else ():
            if abs(far) >= FAR:
                parts.append(f"{how_far(far)} the compression test {test}, {_test(tests[test])}")
        if parts:
            whose = f" of {cut}" if cut else ""
            said.append(breakable(f"The fitted {of}{whose}, {row['value']}, is {', and '.join(parts)}."))
    return said


def how_far(far: float) -> str:
    """Standard deviations of a test above or below it, in words."""
    return f"{quantity(abs(far), '-', digits=2)} standard deviations {'above' if far > 0.0 else 'below'}"
