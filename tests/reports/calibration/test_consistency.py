"""No number of the report contradicts another: one text for each meaning, wherever it stands."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pypdf import PdfReader

from calib.calibration.result import CalibrationResult, read_result
from calib.material.references import cited, references
from calib.problem.food_parameters import YIELD_STRAIN_FACTOR
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.validation.acceptance import Conservation, judge
from calib.validation.bounds import bound_word
from calib.validation.metrics import compare
from calib.validation.null_models import null_models
from mpm.output.section import Section
from mpm.scene import Knife
from reports.base.format import quantity
from reports.base.labels import in_words
from reports.calibration import cut_figure, model_page, report
from tests.reports import sample
from tests.reports.sample import spaced

NUMBER = r"([+−]?\(?[\d.]+(?: ± [\d.]+\)?)?(?: × 10\S+)?(?: ?(?:%|[µmk]?N|[µm]?m|m?J|s|kPa))?)"
#: Each meaning, and the places where the report says it; the number is the group.
MEANINGS: dict[str, tuple[str, ...]] = {
    "measured peak": (rf"measured, peak {NUMBER}", rf"\nPeak {NUMBER} parabola"),
    "simulated peak": (rf"simulated, peak {NUMBER}", rf"\nPeak {NUMBER}, [+−]"),
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
    "Mach number": (r"one speed, (\S+) of that", r"Mach number of the knife (\S+)"),
    "momentum": (rf"momentum balance residual {NUMBER}", rf"Momentum residual {NUMBER}"),
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
        conservation=Conservation(data["momentum_residual"], data["ke_over_ie"], 0.93, 0.02),
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
    assert re.search(r"parameters at a bound 0 0 ✓ passed", text)


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


def test_simulations_add_up(text: str, tmp_path: Path) -> None:
    """The kinds of simulations add up to their number, which is that of the store."""
    total, kinds = re.search(r"\nSimulations (\d+) \d+ failed; (.*?); the", text, re.S).groups()  # type: ignore[union-attr]
    assert sum(int(n) for n in re.findall(r"\d+", kinds)) == int(total)
    run = sample.write_run(tmp_path)
    stored = json.loads((run / "summary.json").read_text())["simulations"]
    assert int(total) == stored


def test_the_figure_of_failures_counts_what_the_heading_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Failed and finished runs of the figure add up to the simulations of the heading."""
    found = words(tmp_path, monkeypatch, "failed")
    failed, total = re.search(r"Failed simulations: (\d+) of (\d+)", found).groups()  # type: ignore[union-attr]
    drawn = {name: n for name, n in re.findall(r"(finished|failed) \((\d+) with values", found)}
    assert drawn["failed"] == failed
    assert int(drawn["failed"]) + int(drawn["finished"]) == int(total)


def test_looks_of_the_cut_share_their_scale() -> None:
    """Three looks are three pictures, of which the last has the one scale of colours."""
    y = np.linspace(-0.02, 0.02, 9)
    section = Section(
        np.array([0.0, 0.01, 0.03]), np.tile(y, (3, 1)), np.full((3, 9), 0.01), np.full((3, 9), 2e3),
        np.full((2, 9), 4e-3), False,
    )  # fmt: skip
    knife, force = Knife(**sample.summary()["knife"]), np.array([0.0, 9.0, 1.0])
    looks = cut_figure.cut(section, knife, 0.033, section.stroke, force)
    assert ["von Mises" in look.decode() for look in looks] == [False] * (len(looks) - 1) + [True]


def test_every_limit_has_its_reason_and_every_citation_its_reference(text: str) -> None:
    """Each line of the first page that has a limit says where the limit comes from; numbers in brackets are listed."""
    lines = [v["name"] for v in judged()["verdicts"] if v["limit"] is not None]
    assert set(lines) <= set(model_page.LIMIT_SOURCES)
    numbers = {int(n) for n in re.findall(r"\[(\d+)\]", text)}
    assert numbers == set(range(1, len(model_page.REFERENCES) + 1))


def test_names_in_sources_have_their_reference() -> None:
    """A short name in a source is followed by its full text, also where the list has one space after it."""
    found = cited(["ripe kiwi, 2.88e5 (Du 2019)", "loses 0.13 to 0.4 (J. Texture Stud. 14:155, 1983)", None])
    assert found["Du 2019"].startswith("Du, Wang, Wang and Yao")
    assert found["J. Texture Stud. 14:155"].startswith("A practical method")
    assert len(found) == 2 and len(references()) > 50


def test_the_model_page_says_how_well_the_yield_strain_is_known() -> None:
    """With the factor of the fit's prior; nothing is said of it where only one of the two was fitted."""
    both, one = (
        SimpleNamespace(fitted=dict.fromkeys(names), nuisances={}) for names in (("E", "yield_stress"), ("E",))
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
