"""No number of the report contradicts another: one text for each meaning, wherever it stands."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from pypdf import PdfReader

from calib.calibration.credibility import write_credibility
from calib.calibration.result import CalibrationResult, read_result
from calib.calibration.result_parts import SearchHistory, Tally
from calib.calibration.summary import WITHDRAWAL_LINE
from calib.material.food import load_foods
from calib.material.properties import PROPERTIES
from calib.material.references import cited, references, remarks
from calib.problem.food_parameters import YIELD_STRAIN_FACTOR
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.validation.acceptance import NUISANCE_LINES, Conservation, changes, judge
from calib.validation.bounds import bound_word
from calib.validation.metrics import compare
from calib.validation.null_models import null_models
from calib.validation.numerical_checks import HALF_SPEED, VARIANTS, Check
from calib.validation.predictive_score import PredictiveScore
from calib.validation.prior_conflict import PriorConflict
from mpm.output.section import Section
from mpm.scene import Knife
from mpm.scene.shapes import Shape
from reports.base.figures import BLUE
from reports.base.format import quantity
from reports.base.labels import capital, in_words, source_in_words
from reports.calibration import cut_figure, model_page, model_sketch, numerics_page, parameter_page, report
from tests.reports import sample
from tests.reports.sample import spaced

NUMBER = r"([+−]?\(?[\d.]+(?: ± [\d.]+\)?)?(?: × 10\S+)?(?: ?(?:%|[µmk]?N|[µm]?m|m?J|s|kPa))?)"
#: Each meaning, and the places where the report says it; the number is the group.
MEANINGS: dict[str, tuple[str, ...]] = {
    "measured peak": (rf"measured, peak {NUMBER}", rf"\nPeak {NUMBER} parabola"),
    "simulated peak": (rf"simulated, peak {NUMBER}", rf"\nPeak {NUMBER}, [+−]", r"\nPeak force (\S+ N) \S+ N "),
    "simulated work": (rf"\nWork {NUMBER}, [+−]", r"\nWork (\S+ m?J) \S+ m?J [+−]"),
    "measured work": (r"Work in the trace (\S+ m?J)", r"\nWork \S+ m?J (\S+ m?J) [+−]"),
    "peak error": (
        rf"peak force error {NUMBER}",
        rf"simulation, fitted \S+ % \S+ % \S+ {NUMBER}",
        r"\nPeak \S+ N, (\S+ %)",
    ),
    "NRMSE": (rf"curve error \(NRMSE\) {NUMBER}", rf"simulation, fitted {NUMBER}"),
    "shape error": (
        rf"normalised-shape error {NUMBER}",
        rf"shape better than ramp and half sine {NUMBER}",
        rf"simulation, fitted \S+ % {NUMBER}",
    ),
    "best null model's shape": (r"half sine \d+\.?\d* % ≤ (\S+ %)", r"half sine \(1 number\) \S+ % (\S+ %)"),
    "ISO rating": (r"simulation, fitted \S+ % \S+ % (\S+)", r"ISO rating (0\.\d+)"),
    "work error": (r"simulation, fitted .* (\S+ %)\n", r"Work \S+ m?J, (\S+ %)"),
    "baseline": (rf"before contact, {NUMBER}, was subtracted", rf"\nBaseline {NUMBER}"),
    "contact": (rf"touches the food at\s+{NUMBER}", rf"\nContact {NUMBER}"),
    "end of the stroke": (rf"stroke ends at {NUMBER}", rf"\nEnd of the stroke {NUMBER}"),
    "stroke": (rf"{NUMBER}\s+deeper", rf"\nStroke {NUMBER}"),
    "lag": (rf"lag {NUMBER}, expected", rf"Lag shift of the force along the stroke 0 ± \S+ \S+ {NUMBER}"),
    "lag before": (r"lag .*, expected (0 ± \S+ \S+)", r"Lag shift of the force along the stroke (0 ± \S+ \S+)"),
    "gain": (r"passed gain (.*), expected 0", r"Gain factor on the force: the sensor 0 ± \S+ % (.*) yes"),
    "simulations": (r"\nSimulations (\d+) ", r"Failed simulations: \d+ of (\d+)"),
    "failed": (r"\nSimulations \d+ (\d+) failed", r"Failed simulations: (\d+) of", r"failed \((\d+) with values"),
    "cell": (r"cells\s+of\s+(\S+ mm)\s+\(", r"Cell size dx (\S+ mm)"),
    "particles": (r": (\d[\d ]*) particles", r"\nParticles (\d[\d ]*\d) mirror"),
    "Mach number": (r"goes\s+down\s+at\s+(\S+)\s+of\s+the\s+speed", r"Mach number of the knife (\S+)"),
    "momentum": (rf"momentum balance residual {NUMBER}", rf"Momentum residual {NUMBER}"),
    "energy lost": (
        rf"energy lost by the discretisation {NUMBER} ≤",
        rf"Energy lost by the discretisation {NUMBER} of\s+the\s+work\s+of\s+the\s+knife",
    ),
    "kinetic": (rf"kinetic over internal energy {NUMBER}", rf"Kinetic over internal energy {NUMBER}"),
    "mirror images": (r"(\d)\s+parts\s+from\s+one", r"mirror images: (\d)"),
    "seed's food": (r"Calibration of (\w+)", r"--food (\w+)"),
}
#: What parts the words of the pages from those of the figures.
FIGURES = "--- figures ---"


def judged(kind: str = "good") -> dict[str, Any]:
    """A summary whose verdict table is made by the same code as in a real run, with friction at its natural limit."""
    data, columns = sample.summary(kind), sample.curves(kind)
    s, real = columns["stroke_m"], columns["real_N"]
    data["parameters"]["mu"] |= {"verdict": "at_bound", "value": 0.004, "low95": 0.0}
    fitted = {name: FittedParameter(**p) for name, p in data["parameters"].items()}
    for name, p in fitted.items():
        data["parameters"][name]["verdict"] = bound_word(name, p)
    lines = judge(
        compare(s, real, columns["sim_N"]),
        {name: model.metrics for name, model in null_models(s, real).items()},
        conservation=Conservation(data["momentum_residual"], data["ke_over_ie"], 0.93, 0.0213),
        fitted=fitted,
        nuisances={name: FittedNuisance(**n) for name, n in data["nuisances"].items()},
    )
    data["scene"] = {"numerics": {"ppc": 2, "safety": 0.7, "gravity": 9.81}, "board": {"mu": 0.5},
                     "edge": {"zone": 0.004, "slip": 0.001}}  # fmt: skip
    return data | {"verdicts": [v.as_dict() for v in lines]}


def words(folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str = "good", **changes: Any) -> str:
    """All text of the report: of its pages, and of its figures, whose letters are paths there."""
    drawn: list[str] = []
    publish = report.publish

    def caught(target: Path, template: str, content: Any, pictures: dict[str, bytes], **more: Any) -> None:
        for picture in pictures.values():
            drawn.extend(re.findall(r"<!-- (.*?) -->", picture.decode()))
        publish(target, template, content, pictures, **more)

    monkeypatch.setattr(report, "publish", caught)
    run = sample.write_run(folder, kind, **(judged(kind) | changes))
    write_credibility(read_result(run))
    path = report.write_report(read_result(run))
    pages = [page.extract_text() for page in PdfReader(path).pages]
    return spaced("\n".join([*pages, FIGURES, *drawn]))


def said(text: str, patterns: tuple[str, ...]) -> list[str]:
    """What the report says in all places of a meaning, without the sign of a positive number."""
    found = [hit.strip().lstrip("+") for pattern in patterns for hit in re.findall(pattern, text)]
    return [hit.lower().rstrip(",.") for hit in found]


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The words of the report of a run that ended well."""
    with pytest.MonkeyPatch.context() as patch:
        return words(tmp_path_factory.mktemp("run"), patch)


@pytest.mark.parametrize("meaning", MEANINGS)
def test_a_number_is_the_same_wherever_it_stands(text: str, meaning: str) -> None:
    """Verdict table, prose, tables and legends of figures say one thing, in one unit and with one number of digits."""
    values = said(text, MEANINGS[meaning])
    assert len(values) >= 2, f"{meaning}: found {values}"
    assert len(set(values)) == 1, f"{meaning}: {values}"


def test_a_contradiction_would_be_found(text: str) -> None:
    """The test sees another number in one of the places."""
    value = said(text, MEANINGS["NRMSE"])[0]
    other = text.replace(f"simulation, fitted {value}", "simulation, fitted 9.99 %")
    assert len(set(said(other, MEANINGS["NRMSE"]))) == 2


def test_a_parameter_at_a_bound_has_one_word(text: str) -> None:
    """Friction at zero is at its natural limit in table, figure, legend and note, and at no bound anywhere."""
    assert text.count("at its natural limit") >= 4
    assert "mu at its natural limit" in text and "at its bound" not in text
    assert re.search(r"parameters at a bound 0 ≤ 0 ✓ passed", text)


def test_sentences_begin_with_a_capital() -> None:
    """A word with a hyphen does too; a file, a column and a symbol keep their letters."""
    found = [capital(t) for t in ("normalised-shape error: failed", "cut.csv has none", "force_N is", "mu and R")]
    assert found == ["Normalised-shape error: failed", "cut.csv has none", "force_N is", "mu and R"]


def test_R_is_a_resistance_only(text: str) -> None:
    """The rating is called ISO rating: R has one meaning."""
    assert "rating R" not in text and "ISO rating" in text
    assert not re.search(r"\bR (without|≥|is rated)", text)


def test_values_of_parameters_are_those_of_the_figure(text: str) -> None:
    """Each fitted value stands in the table and in the figure, and verdict words agree."""
    for name, p in judged()["parameters"].items():
        value, verdict = spaced(quantity(p["value"], p["unit"])), in_words(p["verdict"])
        pages, figures = text.split(FIGURES)
        assert re.search(rf"\n{name}\b[^±]*?\s{re.escape(value)} ", pages), name
        assert f"\n{value}\n{verdict[:34]}" in figures, name
        assert verdict in pages


def test_the_peak_has_the_uncertainty_of_its_gain(tmp_path: Path) -> None:
    """Plus or minus is no less than what the gain alone leaves open, and the same as in credibility.json."""
    result: CalibrationResult = read_result(sample.write_run(tmp_path))
    gain = result.nuisances["gain"].prior_sd * result.agreement.peak_real_N
    assert result.peak_sd_N > max(gain, result.agreement.peak_real_sd_N or 0.0)
    assert result.peak_sd_N == pytest.approx(np.hypot.reduce(result.peak_parts_N))


def test_a_digitised_trace_has_no_noise_of_1e_16(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise that is rounding is called none, and no uncertainty has a power of ten."""
    changes = {"noise_sd_N": 0.0, "baseline_sd_N": 0.0, "peak_real_sd_N": 0.0}
    found = words(tmp_path, monkeypatch, **changes)
    assert "Noise none digitised" in found
    assert not re.search(r"± \S+ × 10", found)


def test_a_reader_who_divides_finds_the_error(text: str) -> None:
    """Peak and work error follow from the two values beside them, but for the last digit that is printed."""
    row = re.search(r"\nPeak force (\S+) N (\S+) N ([+−]\S+) N", text)
    assert row is not None
    simulated, measured, error = (float(x.replace("−", "-")) for x in row.groups())
    assert simulated - measured == pytest.approx(error, abs=0.02)
    for name in ("peak error", "work error"):
        printed = said(text, MEANINGS[name])[0]
        pair = re.search(rf"\n{'Peak force' if name[0] == 'p' else 'Work'} (\S+) m?[NJ] (\S+) m?[NJ] [+−]", text)
        assert pair is not None
        found = float(pair[1]) / float(pair[2]) - 1.0
        assert 100.0 * found == pytest.approx(float(printed.removesuffix(" %").replace("−", "-")), abs=0.2)


def test_a_change_has_the_digits_of_its_line() -> None:
    """The larger one of peak and work in the note is the value of the line, letter by letter."""
    checks = [Check(name, None, 0.0233, 0.0233, -0.0204) for name in VARIANTS if name != HALF_SPEED]
    checks.append(Check("twice the process zone", None, 0.1234, -0.0101, 0.1234))
    for line in changes(checks):
        value = spaced(quantity(line.value, "fraction", signed=True))
        assert value in spaced(line.note or ""), (line.name, line.note)


def test_samples_a_second_are_those_between_samples(tmp_path: Path) -> None:
    """Of 11 samples in a second there are 10 steps: what --check says is what the report says."""
    summary = sample.summary()
    trace = summary["trace"] | {"samples": 11, "duration_s": 1.0}
    found = read_result(sample.write_run(tmp_path, trace=trace))
    assert spaced(report._trace(found)["rate"]) == "10.0 Hz"


def test_all_simulations_are_counted_one_way() -> None:
    """Those of every kind that was kept; of older runs, which say no kinds, those of the search."""
    history = SearchHistory(simulations=137, failed_simulations=1, failures=(), misfit_history=())
    assert history.every == Tally(137, 1)
    kept = {"coarse": Tally(124, 1), "fine": Tally(13, 0), "check": Tally(18, 2)}
    assert replace(history, kept=kept).every == Tally(155, 3)


def test_the_grid_of_the_sketch_stays_beside_the_blade() -> None:
    """Coarse cells in a short food: fewer of them are drawn, and the letters keep off each other."""
    figure = Figure()
    axes = figure.subplots()
    model_sketch._across(axes, Shape("block", 0.03, 0.036, 0.03), Knife(**sample.summary()["knife"]), 5e-3)
    grid = np.concatenate([line.get_xdata() for line in axes.lines if line.get_color() == BLUE])
    assert -15.0 < grid.min() and grid.max() < -1.0
    at = {a.get_text(): a.xyann for a in axes.texts if a.get_text() in "ABCDE"}
    for one, other in itertools.combinations(at.values(), 2):
        assert np.hypot(one[0] - other[0], one[1] - other[1]) > 4.0


def test_looks_at_a_short_food_stand_in_a_row() -> None:
    """Of 60 mm and 30 mm, too; of 132 mm and 33 mm each has a row of its own."""
    knife, force = Knife(**sample.summary()["knife"]), np.array([0.0, 9.0, 1.0])
    for half, height, documents in ((0.03, 0.03, 1), (0.066, 0.033, 3)):
        y = np.linspace(-half, half, 9)
        section = Section(
            np.array([0.005, 0.015, height]), np.tile(y, (3, 1)), np.full((3, 9), 0.01), np.full((3, 9), 3e3),
            np.full((2, 9), 4e-3), False,
        )  # fmt: skip
        assert len(cut_figure.cut(section, knife, height, section.stroke, force)) == documents


def test_simulations_add_up(text: str, tmp_path: Path) -> None:
    """The kinds of simulations add up to their number, which is that of the store."""
    total, kinds = re.search(r"\nSimulations (\d+) \d+ failed; (.*?);", text, re.S).groups()  # type: ignore[union-attr]
    assert sum(int(n) for n in re.findall(r"\d+", kinds)) == int(total)
    run = sample.write_run(tmp_path)
    stored = json.loads((run / "summary.json").read_text())["simulations"]
    assert int(total) == stored
    said = numerics_page._simulations(read_result(run).history, "budget")["kinds"]
    assert "of all were the search's, which ended as its budget was spent; the others" in said


def test_the_figure_of_failures_counts_what_the_heading_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Failed and finished runs of the figure add up to the simulations of the heading."""
    found = words(tmp_path, monkeypatch, "failed")
    failed, total = re.search(r"Failed simulations: (\d+) of (\d+)", found).groups()  # type: ignore[union-attr]
    drawn = {name: n for name, n in re.findall(r"(finished|failed) \((\d+) with values", found)}
    assert drawn["failed"] == failed
    assert int(drawn["failed"]) + int(drawn["finished"]) == int(total)


def test_looks_of_the_cut_share_their_scale() -> None:
    """Three looks at a long food are three pictures, each with axis, unit and the one scale of colours; the glance at
    one of them has that scale too, though its stress is the least."""
    y = np.linspace(-0.06, 0.06, 9)
    section = Section(
        np.array([0.005, 0.015, 0.03]), np.tile(y, (3, 1)), np.full((3, 9), 0.01),
        np.outer([3e3, 2e3, 9e3], np.ones(9)), np.full((2, 9), 4e-3), False,
    )  # fmt: skip
    knife, force = Knife(**sample.summary()["knife"]), np.array([0.0, 9.0, 1.0])
    looks = [look.decode() for look in cut_figure.cut(section, knife, 0.033, section.stroke, force)]
    assert len(looks) == 3
    assert all("von Mises stress [kPa]" in look and "across the blade [mm]" in look for look in looks)
    scales = [re.findall(r"<!-- ([\d.]+) -->", look.split("across the blade [mm]")[1]) for look in looks]
    assert scales[0][-1] == "9" and all(scale[-5:] == scales[0][-5:] for scale in scales)
    axes = Figure().subplots()
    cut_figure.glance(section, knife, 0.033, section.stroke, force)(axes)
    assert axes.child_axes[0].get_ylim() == pytest.approx((0.0, 9.0), rel=0.1)


def test_every_limit_has_its_reason() -> None:
    """Each line that a first page can have with a limit says where the limit comes from, and no other is explained."""
    s, real, sim = (sample.curves()[name] for name in ("stroke_m", "real_N", "sim_N"))
    score = PredictiveScore(0.5, 0.1, 0.1, {"ramp": 0.5}, conflict=PriorConflict(0.5, 2, "E", 1.0), size=0.5)
    lines = judge(
        compare(s, real, sim),
        {name: model.metrics for name, model in null_models(s, real).items()},
        conservation=Conservation(0.0, 0.0, 0.9, 0.0),
        fitted={},
        checks=[Check(name, None, 0.0, 0.0) for name in (*VARIANTS, "half the time step")],
        nuisances={name: FittedNuisance(0.0, 1.0, 1.0, "m", False) for name in NUISANCE_LINES},
        predictive=score,
    )
    found = {v.name for v in lines if v.limit is not None} | {WITHDRAWAL_LINE}
    assert found == set(model_page.LIMIT_SOURCES)


def test_citations_are_numbered_in_the_order_of_the_text(text: str) -> None:
    """The first [1] stands before the first [2], and so on; each number has its reference, and each reference a number
    that is cited."""
    body, listed = re.split(r"\nReferences\n", text.split(FIGURES)[0])
    listed = listed.split("Of the values, by the names")[0]
    first = list(dict.fromkeys(int(n) for n in re.findall(r"\[(\d+)\]", body)))
    assert first == list(range(1, len(first) + 1)) and len(first) > 10
    assert [int(n) for n in re.findall(r"\[(\d+)\]", listed)] == first


def test_names_in_sources_have_their_reference() -> None:
    """A short name in a source is followed by its full text, also where the list has one space after it."""
    found = cited(["ripe kiwi, 2.88e5 (Du 2019)", "loses 0.13 to 0.4 (J. Texture Stud. 14:155, 1983)", None])
    assert found["Du 2019"].startswith("Du, Wang, Wang and Yao")
    assert found["J. Texture Stud. 14:155"].startswith("Schoorl, D., Holt, J. E. (1983). A practical method")
    assert len(found) == 2 and len(references()) > 50


def assumed(part: float | None) -> SimpleNamespace:
    """What is known of all parameters together: no more than the discrepancy that the fit assumed, part of the peak."""
    return SimpleNamespace(discrepancy=part)


def test_the_model_page_says_what_the_fit_lets_the_model_miss() -> None:
    """The part of the peak of this very fit; of older runs, that the command may have another one than the usual."""
    for part, words in (
        (0.04, "the noise and 4 % of the peak"),
        (None, "3 % (unless its command says another one) of"),
    ):
        result = SimpleNamespace(fitted={}, nuisances={}, withdrawal=None, posterior=assumed(part))
        assert words in spaced(model_page._objective(result))


def test_the_model_page_says_how_well_the_yield_strain_is_known() -> None:
    """With the factor of the fit's prior; nothing is said of it where only one of the two was fitted."""
    both, one = (
        SimpleNamespace(fitted=dict.fromkeys(names), nuisances={}, withdrawal=None, posterior=assumed(0.03))
        for names in (("E", "yield_stress"), ("E",))
    )
    said = f"Yield stress over E is known to a factor of {YIELD_STRAIN_FACTOR:g}."
    assert said in model_page._objective(both) and said not in model_page._objective(one)


def test_the_model_page_says_that_resistances_follow_the_speed() -> None:
    """Where the food has a rate exponent, be it held or fitted; nothing is said where it has none."""
    held = SimpleNamespace(value=0.2, unit="-")
    rows = {}
    for name, fixed in (("none", {}), ("held", {"rate_exponent": held})):
        result = SimpleNamespace(cut=SimpleNamespace(scene={}), fitted={}, fixed_parameters=fixed)
        rows[name] = spaced(" ".join(dict((row[0], row[1]) for row in model_page._laws(result))["Edge"].split()))
    assert "real speed" not in rows["none"]
    assert "; resistances follow the real speed over 10 mm/s to the power 0.2" in rows["held"]


def valued(**values: float) -> dict[str, Any]:
    """Properties with their values and units."""
    return {name: SimpleNamespace(value=x, unit=PROPERTIES[name].unit) for name, x in values.items()}


def laws(fitted: dict[str, Any], fixed: dict[str, Any] | None = None) -> dict[str, list[str]]:
    """Law and properties of each part of the model."""
    scene = {"edge": {"zone": 0.004, "slip": 0.001}, "board": {"mu": 0.5}, "numerics": {"crack_ties": 3.0}}
    result = SimpleNamespace(cut=SimpleNamespace(scene=scene), fitted=fitted, fixed_parameters=fixed or {})
    return {part: [spaced(law), names] for part, law, names in model_page._laws(result)}


FLESH = {"E": 1e6, "nu": 0.4, "rho": 1e3, "yield_stress": 1e5, "R": 200.0, "mu": 0.3, "strength_ratio": 0.6,
         "initiation_depth": 2e-3, "R_initiation": 300.0, "loss_factor": 0.02, "board_friction": 0.4}  # fmt: skip
LAYERS = {"R_rind": 350.0, "rind_thickness": 2e-3, "rind_stiffness": 3.5, "R_core": 90.0, "core_ratio": 0.5,
          "core_stiffness": 0.15, "R_skin": 600.0, "skin_thickness": 8e-4}  # fmt: skip
STICKY = {"adhesion": 5e3, "adhesion_energy": 2.5}


@pytest.mark.parametrize("more", [{}, LAYERS, STICKY, {"relaxing_share": 0.3, "relaxation_time": 2.0}])
def test_every_fitted_property_is_in_a_law(more: dict[str, float]) -> None:
    """What is fitted stands among the properties of the model, and no property stands there that has no value."""
    own = {name: x for name, x in (FLESH | more).items() if not ("R_skin" in more and name == "R_initiation")}
    named = ", ".join(names for _, names in laws(valued(**own)).values()).split(", ")
    assert set(named) == set(own)


def test_the_laws_are_those_of_the_run() -> None:
    """Adhesion, layers and the tensile strength that a ratio stands for are said where they are, and only there; what
    is not known leaves no hole."""
    bare, whole = laws(valued(**FLESH)), laws(valued(**FLESH, **LAYERS, **STICKY))
    assert "no adhesion" in bare["Faces"][0] and "no adhesion" not in whole["Faces"][0]
    assert "a traction of 5.00 kPa at most" in whole["Faces"][0]
    assert "strength_ratio × yield_stress = 60.0 kPa" in bare["Crack"][0]
    assert {"Rind", "Core", "Skin"} <= set(whole) and not {"Rind", "Core", "Skin"} & set(bare)
    assert "3.50 times its E" in whole["Rind"][0] and "resistance of the skin" in whole["Edge"][0]
    assert bare["Board"] == ["contact without adhesion, Coulomb friction 0.400", "board_friction"]
    assert laws({})["Board"] == ["contact without adhesion, Coulomb friction 0.500", "–"]
    assert laws({})["Loss"][0] == "Kelvin–Voigt; else rate-independent"


def slow_cut(**changes: Any) -> Any:
    """As much of a result as the model page asks for: a food of 1 MPa at Mach 0.01, 30 mm cut in 2 s."""
    cut = SimpleNamespace(mach=0.01, speed_real_m_s=None, scene={}, mirror_images=1)
    values = {
        n: SimpleNamespace(value=x, unit=u) for n, x, u in (("E", 1e6, "Pa"), ("nu", 0.0, "-"), ("rho", 1e3, "kg/m^3"))
    }
    trace = SimpleNamespace(stroke_m=0.03, onset_s=1.0, end_s=3.0)
    parts = {"withdrawal": None, "fitted": {}, "fixed_parameters": values, "nuisances": {}, "posterior": assumed(0.03)}
    return SimpleNamespace(cut=cut, conditioning=trace, **{**parts, **changes})


def test_the_model_page_compares_the_speeds() -> None:
    """The simulated one is the Mach number times that of pressure waves, here 31.6 m/s; a blade that slows down is said
    to, and one that does not is not."""
    result = slow_cut()
    said = spaced(model_page._conditions(result)[0][1])
    assert said == (
        "blade: rigid, goes down at 0.0100 of the speed of pressure waves in the food, 320 mm/s, where the trace has "
        "15 mm/s on average"
    )
    result.cut.scene = {"motion": {"end_speed": 0.5}}
    slowed = "; with less than 60 % of the height left it goes down with what is left, to 50 % at the end"
    assert spaced(model_page._conditions(result)[0][1]) == said + slowed


def test_what_is_minimised_names_what_the_measurement_leaves_open() -> None:
    """Those of this trace, and no others."""
    for names, told in (
        (["tare", "lag"], "Tare and lag are integrated out of the curve. Intervals"),
        (["tare", "gain"], "Tare is integrated out of the curve. Gain widens the intervals."),
        ([], "leaves out, in squares [@Kennedy 2001]. Intervals"),
    ):
        assert told in model_page._objective(slow_cut(nuisances=dict.fromkeys(names)))


def test_the_model_page_says_that_the_blade_is_withdrawn() -> None:
    """In the conditions and in what is minimised, and nothing of it where it was not fitted."""
    for up in (None, object()):
        result = slow_cut(withdrawal=up)
        assert ("then up again at the first speed" in model_page._conditions(result)[0][1]) == (up is not None)
        said = model_page._objective(result)
        assert ("the pull on the way up" in said and "10 % of the largest pull" in said) == (up is not None)


def test_two_parameters_have_their_correlation_in_words() -> None:
    """A matrix of one number is no figure; more of them are, and fewer are nothing."""
    of_two = parameter_page.correlation_matrix({"E,R": -0.314}, ["E", "R"])
    assert spaced(parameter_page.pair(*of_two)) == "E and R, r = −0.31"
    of_three = parameter_page.correlation_matrix({"E,R": -0.3, "E,mu": 0.2, "R,mu": 0.1}, ["E", "R", "mu"])
    assert parameter_page.pair(*of_three) == "" == parameter_page.pair(*parameter_page.correlation_matrix({}, ["E"]))


def test_a_source_names_its_remark() -> None:
    """Which the page has among its references, or its reader finds in the file; units are raised."""
    assert source_in_words("as apple (remark 5), 10 J/m^2") == "as apple (remark 5), 10 J/m²"
    assert source_in_words("wet (remark 7)", " of materials.yaml") == "wet (remark 7 of materials.yaml)"


def test_remarks_stand_among_the_references() -> None:
    """In full, with what they refer to themselves; a number that stands elsewhere in a source is no remark."""
    found = cited(["as apple (remark 5)", "wet food on a board (remark 7); 6 kPa"])
    assert [name for name in found if name.startswith("remark")] == ["remark 5", "remark 7"]
    assert found["remark 5"].startswith("Apple is the only flesh") and found["remark 5"].endswith("stay assumed.")
    assert {"De Belie 2000", "Bishop 2012"} <= set(found)
    assert list(remarks()) == [str(n) for n in range(1, len(remarks()) + 1)] and len(remarks()) >= 8


def test_every_remark_of_a_source_is_in_the_file() -> None:
    """No value names one that is not there."""
    named = {
        n
        for food in load_foods().values()
        for p in food.properties.values()
        if p
        for n in re.findall(r"\(remark (\d+)\)", p.source)
    }
    assert named and named <= set(remarks())
