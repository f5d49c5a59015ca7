"""Numbers as people read them: units, digits, uncertainties, and words that may break."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from reports.base import format as report_format
from reports.base.format import (
    DASH,
    NBSP,
    before_and_after,
    breakable,
    count,
    duration,
    interval,
    listed,
    quantity,
    uncertain,
)
from reports.base.labels import shown
from tests.reports.sample import spaced


def test_pages_are_set_so_that_none_is_nearly_empty(tmp_path: Path) -> None:
    """Lines that leave one over for a second page move together until they have one; lines that fill a page and a half
    move apart until the second is filled. What has one page is left as it is."""
    source = tmp_path / "lines.typ"
    head = '#set page(paper: "a4", margin: (top: 24mm, bottom: 22mm))\n#let air = float(sys.inputs.air)\n'
    for lines, pages, moved in ((52, 1, -1), (80, 2, 1), (20, 1, 0)):
        body = f"#for k in range({lines}) [#block(above: 5mm * air - 10pt, below: 0mm, height: 10pt)[x]]"
        source.write_text(head + body)
        air = report_format._air(source, {})
        fills = report_format.page_fills(source, air, {})
        assert len(fills) == pages and np.sign(air - 1.0) == moved
        assert lines == 20 or min(fills) >= 0.65


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (3.2e5, "Pa", "320 kPa"), (999.6, "Pa", "1.00 kPa"), (2.5e6, "Pa", "2.50 MPa"),
        (0.033, "m", "33.0 mm"), (1e-3, "m", "1.00 mm"), (6.7e-5, "m", "67.0 µm"), (1.5, "m", "1.50 m"),
        (12.53, "N", "12.5 N"), (0.06, "N", "0.0600 N"), (-3.0, "N", "−3.00 N"), (0.2931, "J", "293 mJ"),
        (1200.0, "J/m^2", "1200 J/m²"), (12345.0, "J/m^2", "12.3 kJ/m²"), (455.0, "N/m", "455 N/m"),
        (960.0, "kg/m^3", "960 kg/m³"), (math.radians(11.0), "rad", "11.0°"), (0.011, "m/s", "11.0 mm/s"),
        (0.0496, "fraction", "4.96 %"), (-0.1234, "fraction", "−12.3 %"), (-2.2e-5, "fraction", "0.00 %"),
        (0.35, "-", "0.350"), (1.2345e-9, "-", "1.23 × 10⁻⁹"), (0.0, "Pa", "0 Pa"), (0.0, "-", "0"),
        (5.0, "m^3/s^2", "5.00 m³/s²"), (None, "Pa", DASH), (math.nan, "N", DASH), (math.inf, "N", DASH),
    ],
)  # fmt: skip
def test_quantity(value: float | None, unit: str, text: str) -> None:
    """SI values come out in the unit people use, with three digits."""
    assert spaced(quantity(value, unit)) == text


def test_quantity_keeps_the_value() -> None:
    """Reading the text back gives the value to three digits, over twelve decades."""
    scales = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}
    for value in 10.0 ** np.arange(-3.0, 9.0, 0.37):
        number, unit = spaced(quantity(value, "Pa")).split(" ")
        assert float(number) * scales[unit] == pytest.approx(value, rel=0.006)


def test_signs_limits_and_digits() -> None:
    """A signed value shows its sign, zero has none, and a limit is as short as it was written."""
    assert quantity(0.012, "fraction", signed=True).startswith("+1.20")
    assert spaced(quantity(1e-6, "fraction", signed=True)) == "0.00 %"
    assert spaced(quantity(0.05, "fraction", digits=None)) == "5 %"
    assert spaced(quantity(3e-4, "m", digits=None)) == "0.3 mm"


@pytest.mark.parametrize(
    ("low", "high", "unit", "text"),
    [
        (8e5, 2e6, "Pa", "0.800 to 2.00 MPa"), (8e4, 2.51e7, "Pa", "0.0800 to 25.1 MPa"), (0.0, 0.6, "-", "0 to 0.600"),
        (100.0, 1200.0, "J/m^2", "100 to 1200 J/m²"), (None, 2e6, "Pa", "below 2.00 MPa"),
        (3.0, math.inf, "N", "above 3.00 N"), (None, None, "Pa", DASH), (0.1, 0.1, "fraction", "10.0 %"),
        (-3.6, 3.79, "N", "−3.60 to 3.79 N"), (1.53e-3, 0.05, "m", "1.53 to 50.0 mm"),
        (9.89e-5, 9.89e-4, "m", "0.0989 to 0.989 mm"),
    ],
)  # fmt: skip
def test_interval(low: float | None, high: float | None, unit: str, text: str) -> None:
    """Both ends share a unit and have three digits, also where one ends in noughts; an open end is a bound."""
    assert spaced(interval(low, high, unit)) == text


def test_numbers_side_by_side_share_a_unit() -> None:
    """A range, a value and its uncertainty take the unit of another number; a nought has none to give. What was written
    short stays short."""
    assert spaced(interval(59.5e3, 1.01e6, "Pa", like=5e5)) == "59.5 to 1010 kPa"
    assert spaced(quantity(1.01e6, "Pa", like=5e5)) == "1010 kPa"
    assert spaced(interval(None, 1.01e6, "Pa", like=5e5)) == "below 1010 kPa"
    assert spaced(interval(0.0, 1.5e-3, "m", like=0.0)) == "0 to 1.50 mm"
    assert spaced(uncertain(-8.3e-5, 8.8e-5, "m", like=5.6e-4)) == "−0.083 ± 0.088 mm"
    assert [spaced(x) for x in before_and_after(2e-5, None, 5e-4, "m")] == ["0 ± 0.50 mm", "0.0200 mm"]
    assert spaced(interval(7e3, 3e5, "Pa", digits=None)) == "7 to 300 kPa"


@pytest.mark.parametrize(
    ("value", "sd", "unit", "text"),
    [
        (12.5271, 0.112, "N", "12.53 ± 0.11 N"), (0.812, 0.0061, "s", "0.8120 ± 0.0061 s"),
        (0.0331, 0.00042, "m", "33.10 ± 0.42 mm"), (0.1, 0.02, "fraction", "(10.0 ± 2.0) %"),
        (12.5, None, "N", "12.5 N"), (12.5, 0.0, "N", "12.5 N"), (12.5, 1e-9, "N", "12.5 N ± 1.0 × 10⁻⁹ N"),
    ],
)  # fmt: skip
def test_uncertain(value: float, sd: float | None, unit: str, text: str) -> None:
    """Value and uncertainty end at the same digit; without an uncertainty there is no ±."""
    assert spaced(uncertain(value, sd, unit)) == text


def test_counts_durations_and_lists() -> None:
    """Small helpers of sentences."""
    assert [spaced(count(n)) for n in (0, 999, 1234567, None)] == ["0", "999", "1 234 567", DASH]
    times = [spaced(duration(t)) for t in (42.31, 2531.0, 3725.0, None)]
    assert times == ["42.3 s", "42 min", "1 h 02 min", DASH]
    assert [listed(x) for x in (["a"], ["a", "b"], ["a", "b", "c"])] == ["a", "a and b", "a, b and c"]


def test_breaks_are_only_in_long_words() -> None:
    """What a reader may copy stays whole; a long path breaks after its separators, a long word anywhere."""
    assert breakable("out/banana --trace run_03.csv") == "out/banana --trace run_03.csv"
    path = "folder/" * 6 + "trace.csv"
    assert breakable(path).split("\u200b") == ["folder/"] * 6 + ["trace.", "csv"]
    assert max(len(part) for part in breakable("x" * 100).split("\u200b")) <= 20


def test_a_part_too_small_for_per_cent_is_no_nought():
    """A probability of one in a million is not shown as 0.00 %; nothing is, and what two decimals hold."""
    assert shown(9.2e-7, "fraction", 3) == f"<{NBSP}0.01{NBSP}%" == shown(-4.9e-5, "fraction", 3)
    assert shown(5.1e-5, "fraction", 3) == f"0.01{NBSP}%"
    assert shown(0.0, "fraction", 3) == f"0{NBSP}%"
    assert shown(9.2e-7, "-", 3) != shown(9.2e-7, "fraction", 3)
