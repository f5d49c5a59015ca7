"""Reports of tests between two plates: what they say of modulus, law, numerics and files, and how numbers are set."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.compression.measured import CompressionFile
from calib.compression.modulus import ModulusAtNu, ModulusFit
from calib.compression.modulus_calibration import CompressionTest, acceptance_lines, unshown
from calib.compression.press import PressRun
from calib.compression.result import (
    Assumptions,
    CompressionResult,
    FittedModulus,
    ForceError,
    OtherPlates,
    PressSimulation,
    RepeatModulus,
    SmallStrainModulus,
    SpecimenSizes,
    StressCurves,
    write_result,
)
from calib.texture.repeats import scatter
from calib.validation.acceptance import Verdict
from cutcal.main import main
from mpm.scene.shapes import Shape
from reports.base import brief
from reports.base.labels import capital, related
from reports.press.compression import write_report
from reports.press.stress_strain import write_figure
from reports.press.tables import between, mean_and_sd, sentences, verdict_table, with_sd
from tests.reports.sample import spaced

PUCK = Shape("upright_cylinder", 0.05, 0.05, 0.03)
STRAIN = np.linspace(0.0, 0.4, 41)


def result(**changes: Any) -> CompressionResult:
    """A test of three repeats between frictionless plates, and what bonded ones would give."""
    test = CompressionTest(("gel.csv",), PUCK, 0.49, 0.4)
    lines = (
        Verdict("curve error (NRMSE)", 0.004, 0.05, "fraction", True),
        Verdict("error of the solver against the closed form", -0.04, 0.03, "fraction", False, "numerics"),
    )
    whole = CompressionResult(
        command=("press", "compress"),
        specimen=SpecimenSizes.of(PUCK, 1.96e-3),
        assumed=Assumptions(0.49, "frictionless"),
        E=FittedModulus((0.0, 0.4), 96.3e3, 0.5e3, 95.9e3, 96.7e3, 3),
        slope=SmallStrainModulus((0.0, 0.05), 100.2e3, 0.6e3, 101.0e3, 0.008),
        nrmse=0.004,
        force_error=ForceError(0.02, 0.27, 0.021),
        solver_error=-0.04,
        grid_change=None,
        sensitivity=(ModulusAtNu(0.44, 102.0e3),),
        bracket=OtherPlates("bonded", 68.3e3),
        repeats=tuple(RepeatModulus(f"R{k}", 96.3e3 + 500 * k, 100.2e3 + 600 * k) for k in (-1, 0, 1)),
        verdicts=lines,
        not_shown=tuple(unshown(test, True, 3)),
        simulation=PressSimulation(PressRun(10, 0.003, 0.001, 4374, 17947, 12.0), 7, "cpu"),
        files=(CompressionFile("gel.csv", "c0ffee00" * 8, "compression_mm", "load_N"),),
        versions={"cutcal": "0.2.0"},
        git="c0ffee",
    )
    return replace(whole, **changes)


def curves_of(*repeats: tuple[str, np.ndarray], fitted: np.ndarray) -> StressCurves:
    """Stress over strain of repeats by name [Pa], and of a fit, each (41,)."""
    all_of_them = np.array([stress for _, stress in repeats])
    return StressCurves(STRAIN, all_of_them.mean(axis=0), all_of_them.std(axis=0), fitted, dict(repeats))


@pytest.fixture
def told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What the report of a result holds; it is typeset all the same."""
    real, found = brief.publish, []

    def publish(target: Path, template: str, content: dict[str, Any], *rest: Any, **more: Any) -> None:
        found.append(content)
        real(target, template, content, *rest, **more)

    monkeypatch.setattr(brief, "publish", publish)

    def report(one: CompressionResult) -> dict[str, Any]:
        curves = curves_of(("R0", 1e5 * STRAIN), ("R1", 1e5 * STRAIN), fitted=1e5 * STRAIN)
        (tmp_path / "compress.json").write_text("{}")
        write_figure(one, curves, tmp_path)
        write_report(one, curves, tmp_path)
        content = json.loads(spaced(json.dumps(found[-1], ensure_ascii=False, default=lambda picture: "")))
        return dict(content)

    return report


def tables(content: dict[str, Any]) -> dict[str, list[list[str]]]:
    """Rows of each part that has a table."""
    return {part["title"]: part["table"]["rows"] for part in content["parts"] if part["table"]}


def test_the_interval_is_said_to_be_of_the_repeats_alone(told: Any) -> None:
    """Beside the modulus stands what the other plates give, else what is assumed; one repeat has no interval."""
    said = told(result())["sentence"]
    assert said == (
        "Young's modulus is 96.3 kPa over 0 to 40 % strain. The 95 % interval of 95.9 to 96.7 kPa is of the 3 repeats "
        "alone: between bonded plates, in place of frictionless ones, the same forces give 68.3 kPa. A Poisson's ratio "
        "of 0.49 is assumed."
    )
    alone = told(result(bracket=None))["sentence"]
    assert alone.endswith("repeats alone: a Poisson's ratio of 0.49 and frictionless plates are assumed.")
    one = result(E=FittedModulus((0.0, 0.4), 96.3e3, None, None, None, 1), repeats=(RepeatModulus("R", 96e3, 1e5),))
    assert "from one repeat, without an interval: between bonded" in told(one)["sentence"]


def test_a_compression_says_law_numerics_seed_and_files(told: Any) -> None:
    """What another laboratory needs to do it again, and what the words of the verdict mean."""
    content = told(result())
    facts, rows = dict(content["facts"]), tables(content)
    assert facts["Law"].startswith("fixed-corotated") and facts["Seed"] == "7"
    assert "10 cells of 3.00 mm" in facts["Simulation"] and "4374 particles, 17 947 steps" in facts["Simulation"]
    (file,) = rows["Files"]
    assert file[:3] == ["gel.csv", "compression_mm", "load_N"] and file[3].replace("\u200b", "") == "c0ffee00" * 8
    assert [row[0] for row in rows["References"]] == ["[1]", "[2]", "[3]"] and "Stomakhin" in rows["References"][0][1]
    cited = re.findall(r"\[(\d)\]", " ".join(text for _, text in content["facts"]))
    assert cited == ["1", "2"]  # in the order in which they are read
    (verdict,) = [part for part in content["parts"] if part["title"] == "Verdict"]
    assert "NRMSE: root mean square" in verdict["text"] and "closed form of the same law" in verdict["text"]
    assert rows["Verdict"] == [
        ["Curve error (NRMSE)", "0.40 %", "≤ 5 %", "yes"],
        ["Error of the solver against the closed form: numerics", "−4.00 %", "≤ 3 %", "no"],
    ]
    bonded = told(result(solver_error=None, grid_change=0.01))
    assert "two thirds of the cells" in bonded["parts"][0]["text"]


def test_each_limit_of_a_compression_has_a_source(told: Any) -> None:
    """Of every line that a run judges, between either plates, with a number of the list where somebody is cited."""
    fit = ModulusFit(np.ones(1), 1.0, 0.0, 1.0, 1.0, STRAIN, 1.0, 0.0, 0.0, 0.0, 0.02)
    lines = {line.name: line for error in (0.0, None) for line in acceptance_lines(fit, error, 0.0)}
    content = told(result(verdicts=tuple(lines.values())))
    rows = dict(tables(content)["Where the limits come from"])
    assert set(rows) == {capital(name) for name in lines} and len(rows) == 4
    assert rows["Curve error (NRMSE)"].endswith("[3]") and "Dawood" in tables(content)["References"][2][1]
    titles = [part["title"] for part in content["parts"]]
    assert titles[:2] == ["Verdict", "Where the limits come from"]


def test_a_compression_is_typeset_again_from_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``cutcal report`` writes figure, PDF and page of the files alone; a file that is missing is named."""
    stress = 1e5 * STRAIN
    write_result(result(), curves_of(("R0", stress), ("R1", 1.1 * stress), fitted=stress), tmp_path)
    assert main(["report", str(tmp_path)]) == 0 and "report.pdf and report.html" in capsys.readouterr().out
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF") and (tmp_path / "compress.svg").exists()
    page = (tmp_path / "report.html").read_text()
    assert "R1" in page and "Where the limits come from" in page
    (tmp_path / "curves.csv").unlink()
    assert main(["report", str(tmp_path)]) == 1 and "curves.csv" in capsys.readouterr().err


def test_a_compression_says_slope_and_largest_error(told: Any) -> None:
    """Mean of the measured slopes, the fitted one, and the error of the force that the terminal shows."""
    rows = tables(told(result()))
    assert rows["Modulus of each repeat"][-1] == ["Mean ± standard deviation", "96.30 ± 0.50 kPa", "100.20 ± 0.60 kPa"]
    assert [row[1] for row in rows["How close the fitted curve is"]] == [
        "100.20 ± 0.60 kPa", "101 kPa", "+0.80 %", "+27.0 % at 2.1 %",
    ]  # fmt: skip
    assert rows["If another assumption holds"] == [["Poisson's ratio 0.44", "102 kPa"], ["Bonded plates", "68.3 kPa"]]


def test_remarks_are_sentences(told: Any) -> None:
    """Each has a capital and a full stop, once."""
    limits = told(result())["limits"]
    assert len(limits) == 5 and all(text[0].isupper() and text.endswith(".") for text in limits)
    assert sentences(["a b", "A b.", "is it so?"]) == ["A b.", "A b.", "Is it so?"]


def test_a_value_and_its_deviation_have_the_same_decimals() -> None:
    """Two digits of the deviation, at most four of the value; a deviation below that is said to be."""
    pairs = {
        (2.26, 1.8): "2.3 ± 1.8", (0.521, 0.11): "0.52 ± 0.11", (12.3456, 0.0123): "12.35 ± 0.01", (0.0, 0.0): "0 ± 0",
        (0.836, 5.5e-5): "0.8360 ± 0.0001", (0.836, 5e-7): "0.8360 ± < 0.0001", (153.0, 42.0): "153 ± 42",
        (-0.5, 0.2): "−0.50 ± 0.20",
    }  # fmt: skip
    assert {pair: spaced(with_sd(*pair)) for pair in pairs} == pairs
    assert mean_and_sd(scatter([0.5])) == "0.500"


def test_an_interval_has_three_digits_at_each_end() -> None:
    """In the sentence as in the table; none where an end is not known."""
    assert spaced(between(0.113, 0.17)) == "0.113 to 0.170" and between(float("nan"), 1.0) == "–"


@pytest.mark.parametrize(
    ("value", "limit", "passed", "sign"),
    [(0.1, 0.2, True, "≤ "), (-0.3, 0.2, False, "≤ "), (0.9, 0.8, True, "≥ "), (0.7, 0.8, False, "≥ "),
     (0, 0, True, "≤ "), (2, 0, False, "≤ "), (None, 0.2, False, ""), (0.1, 0.2, None, "")],
)  # fmt: skip
def test_a_limit_has_its_sign(value: Any, limit: Any, passed: Any, sign: str) -> None:
    """It follows from value, limit and outcome."""
    assert related(value, limit, passed) == sign


def test_numbers_of_things_are_whole() -> None:
    """Two that fail are 2, not 2.00."""
    (row,) = verdict_table([Verdict("branches", 2, 0, "", False)]).rows
    assert row == ["Branches", "2", "≤ 0", "no"]


def test_the_head_of_a_page_keeps_the_capital_of_a_name() -> None:
    """Young is a name: no template writes the heading of a report in small letters."""
    assert "lower(c.name)" not in (Path(brief.__file__).parents[1] / "templates" / "brief.typ").read_text()
