"""Figures that are stable, need no font and no colour, and hide no sample of the record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from pypdf import PdfReader

from calib.calibration.report import write_report
from calib.calibration.result import from_document
from mpm.output.section import Section
from mpm.scene import Knife
from reports.base import figures
from reports.base.run_folder import Runs
from reports.calibration import cut_figure as pictures
from reports.calibration import failures, parameter_figures, parameter_page
from tests.reports import sample
from tests.reports.sample import pages


def test_figures_are_stable_and_need_no_font() -> None:
    """The same curves give the same bytes, letters are paths, and a dollar sign is no formula."""
    curves = sample.curves()
    made = [figures.forces(curves, "cost $5 and $6", "b", 80.0) for _ in range(2)]
    assert made[0] == made[1] and b"<text" not in made[0] and b"<dc:date>" not in made[0]


def test_figures_do_not_change_the_users_style() -> None:
    """Drawing leaves matplotlib's settings as they were, and the user's settings do not reach the report."""
    plain = figures.null_models(sample.curves(), "measured", {})
    with matplotlib.rc_context({"axes.facecolor": "red", "lines.linewidth": 9.0}):
        assert figures.null_models(sample.curves(), "measured", {}) == plain
        assert matplotlib.rcParams["lines.linewidth"] == 9.0


def test_curves_differ_without_colour() -> None:
    """Measured, simulated, edge and face parts have four different dash patterns."""
    looks = (figures.MEASURED, figures.SIMULATED, figures.EDGE, figures.FACE)
    assert len({look.get("dashes") for look in looks}) == 4


def test_envelope_keeps_extremes_and_order() -> None:
    """A spike of one sample in a million survives; a short record is unchanged."""
    t = np.arange(1_000_000) * 1e-3
    y = np.sin(t)
    y[123_456], y[654_321] = 50.0, -40.0
    x, few = figures.envelope(t, y)
    assert len(x) <= 2 * figures.ENVELOPE_PARTS and np.all(np.diff(x) > 0.0)
    assert few.max() == 50.0 and few.min() == -40.0
    assert np.array_equal(figures.envelope(t[:100], y[:100]), (t[:100], y[:100]))


def test_marks_of_the_conditioning_are_drawn_when_known(tmp_path: Path) -> None:
    """A saved baseline window and the end's uncertainty change the figure."""
    s = sample.summary()
    time, raw, tared = sample.record()
    draw = {"time": time, "raw": raw, "tared": tared, "onset": s["onset_s"], "onset_sd": 0.006,
            "end": s["end_s"], "baseline_kind": "constant", "peak": 10.8, "peak_sd": 0.1}  # fmt: skip
    bare = figures.conditioning(figures.ConditioningRecord(**draw, window=None, end_sd=None), sample.curves())
    full = figures.conditioning(figures.ConditioningRecord(**draw, window=(0.1, 0.7), end_sd=0.02), sample.curves())
    assert len(full) > len(bare)
    run = sample.write_run(tmp_path, baseline_window_s=[0.1, 0.7], end_sd_s=0.02)
    assert pages(write_report(run).read_bytes()) == 8


def test_the_predictive_band_is_drawn_where_there_is_one() -> None:
    """With the columns the figure has a patch more; without them, or with empty ones, it has none."""
    whole, bare = sample.curves(), sample.curves("interrupted")
    empty = whole | {name: np.full(240, np.nan) for name in ("band_low_N", "band_high_N")}
    with_band, without, none = (figures.forces(c, "a", "b", 80.0, " (98 %)") for c in (whole, bare, empty))
    assert b"FillBetween" in with_band and b"FillBetween" not in without
    assert none == without


def test_profiles_are_in_the_units_that_people_use() -> None:
    """Pascals become kilopascals, the literature too; a friction has a linear axis; a profile of one point is left
    out."""
    s = sample.summary()
    s["profiles"]["E"] = {key: value[:1] for key, value in s["profiles"]["E"].items()}
    result = from_document(s, Path())
    panels = {p.title: p for p in parameter_page.panels(result.posterior.profiles, result.fitted)}
    assert list(panels) == ["yield_stress [kPa]", "R [J/m²]", "mu", "R_skin [N/m]"]
    panel = panels["yield_stress [kPa]"]
    assert panel.prior == (5.0, 200.0) and panel.value == 31.0 and panel.log and not panels["mu"].log
    assert panel.x[np.argmin(panel.rise)] == pytest.approx(31.0)
    assert parameter_figures.profile_panels(list(panels.values())).startswith(b"<?xml")


def test_an_interval_is_drawn_where_the_table_has_it() -> None:
    """Counted from the fitted value, also where that is not the valley's bottom; the line that it ends at is as far
    above it."""
    x = np.linspace(1.0, 9.0, 81)
    panel = parameter_figures.Panel("R", x, (x - 4.0) ** 2, 0.5 * (x - 4.0) ** 2, 6.0, (1.7, 6.8), None, False)
    assert panel.level == pytest.approx(4.0) and replace(panel, value=None).level == 0.0
    axes = Figure().subplots()
    parameter_figures._profile(axes, panel)
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    assert lines["fitted value"].tolist() == [[6.0, pytest.approx(4.0)]]
    assert lines["3.84 above the fitted value"][:, 1] == pytest.approx(7.84)
    assert lines["ends of the 95 % interval"][:, 0] == pytest.approx([1.7, 6.8])


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that are drawn, with their text laid out."""
    found: list[Figure] = []

    def keep(draw: Callable[[Figure], None], height: float) -> bytes:
        figure = Figure(figsize=(figures.WIDTH * figures.MM, height * figures.MM), layout="constrained")
        draw(figure)
        figure.draw_without_rendering()
        found.append(figure)
        return b""

    for module in (figures, parameter_figures):
        monkeypatch.setattr(module, "svg", keep)
    return found


def test_names_of_correlations_do_not_overlap_and_nought_has_no_sign(drawn: list[Figure]) -> None:
    """Sixteen long names stand under their columns, apart by more than the height of a letter across their slant."""
    names = [f"long_name_of_one_{k}" for k in range(16)]
    matrix = np.full((16, 16), -0.001) + np.diag(np.ones(16))
    matrix[2, 1], matrix[3, 1] = -0.95, 0.25
    parameter_figures.correlations(names, matrix)
    (axes,) = drawn[0].axes
    labels = axes.get_xticklabels()
    apart = np.diff([label.get_transform().transform(label.get_position())[0] for label in labels])
    letter = labels[0].get_fontsize() * drawn[0].dpi / 72.0
    slant = np.radians([label.get_rotation() for label in labels])[1:]
    assert np.all(apart * np.sin(slant) > 0.9 * letter)
    assert {text.get_text() for text in axes.texts} == {"0.00", "\u22120.95", "+0.25"}


def test_a_peak_at_the_end_of_the_stroke_is_drawn_whole(drawn: list[Figure]) -> None:
    """The axis of the filtered curve goes beyond the stroke by more than half of the circle."""
    s = sample.summary()
    time, raw, tared = sample.record()
    curves = sample.curves() | {"real_N": sample.curves()["stroke_m"]}
    record = figures.ConditioningRecord(
        time, raw, tared, s["onset_s"], None, s["end_s"], None, None, "constant", float(curves["real_N"][-1]), 0.1
    )
    figures.conditioning(record, curves)
    axes = next(axes for axes in drawn[0].axes if "peak ±" in axes.get_title())
    end = 1e3 * float(curves["stroke_m"][-1])
    room = np.ptp(axes.transData.transform([[end, 0.0], [axes.get_xlim()[1], 0.0]])[:, 0])
    assert room > 0.5 * 3.5 * drawn[0].dpi / 72.0


@pytest.mark.parametrize(
    ("ends", "ticks"),
    [((1e6, 1e9), ["10⁶", "10⁷", "10⁸", "10⁹"]), ((1e4, 1.2e5), ["10 000", "20 000", "50 000", "100 000"])],
)
def test_numbers_at_a_log_axis_are_those_of_the_text(ends: tuple[float, float], ticks: list[str]) -> None:
    """No computer's powers of ten, and thousands set apart."""
    axes = Figure().subplots()
    axes.set_xscale("log")
    axes.set_xlim(*ends)
    figures.log_ticks(axes.xaxis, *ends)
    shown = [x for x in axes.get_xticks() if ends[0] <= x <= ends[1]]
    assert [sample.spaced(axes.xaxis.get_major_formatter()(x)) for x in shown] == ticks


def test_profiles_and_indices_differ_without_colour() -> None:
    """With and without the literature have different dashes; the two bars differ by a hatch."""
    assert parameter_figures.WITH_PRIOR.get("dashes") != parameter_figures.TRACE_ALONE.get("dashes")
    drawn = parameter_figures.influence(from_document(sample.summary(), Path()).sensitivity, parameter_page.QUANTITIES)
    assert b"hatch" in drawn.lower() or b"<pattern" in drawn


def test_failures_are_split_by_what_separates_them() -> None:
    """Of three parameters the two that differ come first, in logarithms; too few failures have no region."""
    random = np.random.default_rng(0)
    failed = np.arange(40) < 8
    values = {
        "mu": random.uniform(0.1, 0.5, 40),
        "E": np.where(failed, 2e4, 6e5) * np.exp(0.2 * random.standard_normal(40)),
        "R": np.where(failed, 900.0, 300.0) * np.exp(0.4 * random.standard_normal(40)),
        "other": np.arange(40.0),
    }
    known = from_document(sample.summary(), Path()).fitted
    found = failures.splits(Runs(values, failed), known)
    assert [s.name for s in found] == ["E", "R", "mu"] and found[0].apart < 0.0 < found[1].apart
    assert failures.sentence(Runs(values, failed), found).startswith("Simulations failed at low E (median ")
    assert failures.splits(Runs(values, np.arange(40) < 2), known) == []
    same = failures.splits(Runs({"mu": values["mu"]}, failed), known)
    assert failures.sentence(Runs({"mu": values["mu"]}, failed), same).startswith("No parameter separates")
    for split in (found, same):
        assert failures.picture(Runs(values, failed), split).startswith(b"<?xml")


KNIFE = Knife("kitchen", 2e-3, 0.04, 0.05, 0.2)


def looked_at(width: float = 0.1, height: float = 0.03) -> Section:
    """A block that sinks a little from look to look, in pieces of 2 mm."""
    y, z = (a.ravel() for a in np.meshgrid(np.arange(-width / 2, 0, 2e-3) + 1e-3, np.arange(0, height, 2e-3) + 1e-3))
    sunk = 1 - 0.01 * np.arange(10)[:, None]
    return Section(
        np.linspace(2e-3, 0.02, 10), y / sunk, z * sunk, 1e4 * (1 + 0 * z / sunk), 2e-3 + np.zeros((2, y.size)), True
    )


def test_three_moments_of_the_cut_are_shown() -> None:
    """Early, nearest to the largest force, at the end; a force that is largest at the end makes two. Where no look is
    at the largest force, its name says at which stroke that is."""
    stroke = np.linspace(0, 0.02, 50)
    section = looked_at()
    shown = pictures.moments(section, stroke, np.sin(np.pi * stroke / 0.024))
    peak = stroke[np.argmax(np.sin(np.pi * stroke / 0.024))]
    assert f"{1e3 * peak:.1f}" != f"{1e3 * section.stroke[shown[1][0]]:.1f}"
    near = f"near the\nlargest force at {1e3 * peak:.1f} mm"
    assert [name for _, name in shown] == ["", near, "at the end"]
    there = pictures.moments(section, section.stroke, np.sin(np.pi * section.stroke / 0.024))
    assert [name for _, name in there] == ["", "largest force", "at the end"]
    assert section.stroke[shown[0][0]] == pytest.approx(4e-3) and section.stroke[shown[1][0]] == pytest.approx(12e-3)
    assert len(pictures.moments(section, stroke, stroke)) == 2


@pytest.mark.slow
def test_the_picture_of_the_cut_is_stable_and_fits_its_page(tmp_path: Path) -> None:
    """The same section gives the same bytes, flat foods in a picture for each look and tall ones in a row; the report
    has them where the record is whole."""
    stroke = np.linspace(0, 0.02, 50)
    for section, count in ((looked_at(), 3), (looked_at(0.03, 0.09), 1)):
        made = [pictures.cut(section, KNIFE, 0.03, stroke, np.sin(np.pi * stroke / 0.024)) for _ in range(2)]
        assert made[0] == made[1] and len(made[0]) == count
        assert all(b"<image" in look and b"<text" not in look for look in made[0])
    run = sample.write_run(tmp_path)
    assert "across the middle of the blade" not in printed(write_report(run))
    with h5py.File(run / "record.h5", "w") as file:
        for name, values in vars(looked_at()).items():
            file[f"section/{name}"] = values
    assert "across the middle of the blade" in printed(write_report(run))
    (run / "record.h5").write_bytes(b"damaged")
    assert "across the middle of the blade" not in printed(write_report(run))


def printed(pdf: Path) -> str:
    """The text of a report."""
    return " ".join(page.extract_text() for page in PdfReader(pdf).pages)


@pytest.mark.parametrize(("height", "length"), [(0.024, 0.1), (0.03, 0.02)])
def test_the_glance_on_the_first_page_is_the_food_about_the_blade_at_the_largest_force(
    height: float, length: float
) -> None:
    """A long food is shown to 0.8 heights from the blade, a short one whole; the blade stands at the look nearest to
    the largest force, and the title says where both are."""
    stroke = np.linspace(0.0, 0.02, 50)
    section = looked_at(length, height)
    axes = Figure().subplots()
    pictures.glance(section, KNIFE, height, stroke, np.sin(np.pi * stroke / 0.024))(axes)
    deep = section.stroke[np.argmin(np.abs(section.stroke - 0.012))]
    peak = stroke[np.argmax(np.sin(np.pi * stroke / 0.024))]
    assert axes.get_title(loc="right") == f"{1e3 * deep:.1f} mm deep, near the\nlargest force at {1e3 * peak:.1f} mm"
    edge = axes.patches[0].get_xy()[0]
    np.testing.assert_allclose(edge, [0.0, 1e3 * (height - deep)])
    reach = min(np.abs(section.y).max() + 0.12 * height, 0.8 * height)
    np.testing.assert_allclose(axes.get_xlim(), [-1e3 * reach, 1e3 * reach], rtol=0.05)
