"""What a study's report says of its model: that of a calibration, values, priors, terms, and what does not agree."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure
from pypdf import PdfReader

from calib.material.properties import MEANINGS
from calib.material.references import cited
from calib.multi_specimen.report import write_report
from mpm.scene import Knife
from reports.base.labels import LEAST_PART
from reports.calibration import cut_figure
from reports.multi_specimen import verdicts
from reports.multi_specimen.model import HELD_SOURCES
from reports.multi_specimen.report import content, read_study
from reports.web.study import study_page
from tests.reports import sample
from tests.reports import study_sample as study
from tests.reports.base.test_figures import looked_at
from tests.reports.sample import spaced

PRESS = {"name": "pressed", "E": 278e3, "spread": 0.13, "repeats": 4, "nu": 0.45,
         "files": [{"name": "press.csv", "sha256": "c0ffee00" * 8}]}  # fmt: skip


def printed(folder: Path, **changes: Any) -> dict[str, Any]:
    """What the report of a study prints."""
    return content(read_study(study.write_study(folder, **changes), MEANINGS, cited))


def words(folder: Path) -> str:
    """All words of the PDF of a study."""
    pages = PdfReader(write_report(folder)).pages
    return spaced(" ".join(" ".join(page.extract_text() for page in pages).split()))


def test_the_model_is_said_as_in_a_calibration(tmp_path: Path) -> None:
    """Sketch, symmetry, board, laws and time steps of a fitted cut, from the code of a calibration's page."""
    run = study.write_study(tmp_path)
    with h5py.File(run / "record-second.h5", "w") as file:
        file.attrs.update(images=4, dt=8.2e-5, steps=1406)
    done = read_study(run, MEANINGS, cited)
    w = content(done)["model"]
    assert w["shown"] == "first" and "0.7 of the stability limit" in spaced(w["method"])
    assert "Time step: 82.0 µs in second (1406 steps)." == spaced(w["steps"])
    laws = {part: spaced(law) for part, law, _ in w["laws"]}
    assert laws["Board"] == "contact without adhesion, Coulomb friction 0.500"
    assert "24.8 kPa" in laws["Crack"]  # 0.8 of the fitted yield stress
    assert [letter for letter, _ in w["conditions"]] == ["A", "B", "C", "D", "E", "F", "G"]
    assert w["conditions"][5][1] == "planes of symmetry: not recorded, and not drawn"
    blade = spaced(w["conditions"][0][1])
    assert "0.0100 of the speed of pressure waves in the food, 260 mm/s, where the trace has 20 mm/s" in blade
    with h5py.File(run / "record-first.h5", "w") as file:
        file.attrs.update(images=4, dt=8.2e-5, steps=1406)
    four = content(read_study(run, MEANINGS, cited))["model"]["conditions"]
    assert four[5][0] == "F" and four[5][1].startswith("planes of symmetry: normal velocity zero")
    with h5py.File(run / "record-first.h5", "a") as file:
        file.attrs["images"] = 1
    whole = content(read_study(run, MEANINGS, cited))["model"]["conditions"]
    assert [letter for letter, _ in whole] == ["A", "B", "C", "D", "E", "G"]
    (run / "record-first.h5").unlink()
    found = words(run)
    for said in (
        "faces of the blade: contact and friction",
        "planes of symmetry: not recorded",
        "Words and abbreviations",
        "Kind of source",
        "proxy, another food",
    ):
        assert said in found


def test_the_pdf_alone_has_all_values(tmp_path: Path) -> None:
    """What was not fitted stands with value, kind and source; their references are in full; without the file it says
    so."""
    got = printed(tmp_path / "whole")
    fixed = {row[0]: [spaced(cell) for cell in row[1:]] for row in got["fixed"]}
    assert fixed["nu"][1:] == ["0.350", "paper, Table 2", "CulinaryCut Table 2"]
    assert {"rho", "strength_ratio", "loss_factor", "board_friction"} <= set(fixed)
    assert not {"E", "R", "R_skin", "mu", "yield_stress"} & set(fixed)
    page = study_page(got, read_study(tmp_path / "whole").curves, [study.HELD], {})
    assert "strength_ratio" in page and "Values that were not fitted" in page and "only as a product" in page
    references = dict(got["model"]["food_references"])
    assert references["Kachru 1995"].startswith("Kachru, R. P.") and "Muscadine" in references
    linked = references["CulinaryCut"]
    assert got["model"]["references"][int(linked[1 : linked.index("]")]) - 1].startswith("Koh")
    run = study.write_study(tmp_path / "without")
    (run / "material.yaml").unlink()
    assert "could not be read from material.yaml" in words(run)


def test_a_value_outside_its_prior_and_far_from_a_test_is_named(tmp_path: Path) -> None:
    """On the first page, in the table, and beside the test; nothing is said where all agree."""
    parameters = study.summary()["parameters"]
    assert printed(tmp_path / "agreed")["conflicts"] == []
    parameters["E"] |= {"value": 415e3, "prior_low": 216e3, "prior_high": 359e3, "status": "proxy"}
    got = printed(tmp_path / "apart", parameters=parameters, presses={"pressed": PRESS})
    assert [spaced(text) for text in got["conflicts"]] == [
        "The fitted E, 415 kPa, is outside its prior, 216 to 359 kPa, and 3.1 standard deviations above the "
        "compression test pressed, 278 kPa ± 13 %."
    ]
    assert got["shared"][0][7] == "outside its prior" and not any(row[7] for row in got["shared"][1:])
    pdf = words(tmp_path / "apart")
    assert "outside its prior, 216 to 359 kPa" in pdf and "3.1 standard deviations above it" in pdf
    assert "outside its prior" in (tmp_path / "apart" / "report.html").read_text()
    parameters["E"] |= {"value": 300e3}
    near = printed(tmp_path / "near", parameters=parameters, presses={"pressed": PRESS})
    assert near["conflicts"] == [] and "0.59 standard deviations above it" in spaced(near["model"]["presses"][0][5])


@pytest.mark.parametrize("before", ["", "compression: pressed, 278 kPa to 13 %. Before: "])
def test_a_prior_that_a_test_has_narrowed_is_called_so(tmp_path: Path, before: str) -> None:
    """It is that of literature and test together, in documents of either version; other priors are the literature's."""
    parameters = study.summary()["parameters"]
    parameters["E"] |= {"source": f"{before}ripe kiwi, 288 kPa (Du 2019)", "status": "proxy"}
    rows = printed(tmp_path, parameters=parameters, presses={"pressed": PRESS})["model"]["ranges"]
    found = {row[0]: [spaced(cell) for cell in row[1:]] for row in rows}
    assert found["E"][1:] == [
        "measured",
        "literature, 0.0500 to 2.00 MPa: ripe kiwi, 288 kPa (Du 2019); narrowed by the compression test pressed "
        "(278 kPa ± 13 %)",
    ]
    assert found["yield_stress"][2].endswith("follows the prior of E, which the compression test has narrowed")
    assert found["R"][2] == "half of the energy for green pulp"
    assert "Literature, 95 %" not in words(tmp_path) and "Prior, 95 %" in words(tmp_path)


def test_every_limit_has_its_own_source(tmp_path: Path) -> None:
    """Those of a held-out cut, and those of a fitted one; two limits of one figure have two reasons."""
    rows = {line: spaced(why) for line, why in printed(tmp_path)["model"]["limit_sources"]}
    said = spaced(" ".join(rows))
    for limit in ("NRMSE ≤ 10 % of a held-out cut", "ISO rating ≥ 0.8 of", "in band ≥ 90 % of", "band width ≤ 50 % of"):
        assert limit in said
    assert set(HELD_SOURCES) == set(verdicts.HELD_OUT)
    fitted = next(why for line, why in rows.items() if line.startswith("curve error (NRMSE) of a fitted cut"))
    held = next(why for line, why in rows.items() if spaced(line).startswith("NRMSE ≤ 10 %"))
    assert fitted != held and "less than the 10 %" in fitted
    for cut in study.summary()["traces"].values():
        assert all(v["name"] in said for v in cut["verdicts"])


def test_verdicts_on_parameters_and_their_correlations_are_told(tmp_path: Path) -> None:
    """Each word of the table is explained below it; strong pairs are named, a matrix is drawn; older documents have
    none."""
    got = printed(tmp_path / "new")
    assert {word for word, _ in got["legend"]} == {row[5] for row in (*got["shared"], *got["own"])}
    assert got["correlations"] == ["R and E, r = −0.93: raising one and lowering the other hardly changes the force."]
    assert "Posterior correlation of each pair" in words(tmp_path / "new")
    two = printed(tmp_path / "two", correlations={"R,E": -0.5})
    assert spaced(two["pair"]) == "E and R, r = −0.50" and two["correlations"] == []
    s = study.summary()
    del s["correlations"]
    run = study.write_study(tmp_path / "older")
    (run / "summary.json").write_text(json.dumps(s))
    assert "correlations of the parameters are not in this document" in words(run)


def test_small_changes_and_slower_runs_are_said_as_they_are(tmp_path: Path) -> None:
    """One way of writing what two decimals do not show; a quarter of the speed is named where it was run."""
    traces = study.summary()["traces"]
    checks = traces["first"]["numerical_checks"]
    checks.append({"name": "half the slip", "reason": None, "peak_change": -LEAST_PART / 2, "work_change": 0.0})
    got = printed(tmp_path / "half", traces=traces)
    assert [spaced(cell) for cell in got["checks"][2][2:]] == ["< 0.01 %", "0 %"]
    assert not any("0.00 %" in spaced(cell) for row in got["checks"] for cell in row)
    assert got["checks_note"].startswith("Half the speed is listed as it was simulated.")
    checks.append({"name": "a quarter of the simulated speed", "reason": None, "peak_change": 0.1, "work_change": 0.0})
    assert printed(tmp_path / "both", traces=traces)["checks_note"].startswith("Half and a quarter of the speed")


def test_the_scale_of_a_glance_is_no_taller_than_its_picture() -> None:
    """Beside the curve on the first page."""
    figure = Figure((7.0, 3.4), layout="constrained")
    axes = figure.subplots(1, 2)[1]
    stroke = np.linspace(0.0, 0.02, 50)
    cut_figure.glance(looked_at(), Knife(**sample.summary()["knife"]), 0.03, stroke, 1.0 - (stroke - 0.015) ** 2)(axes)
    figure.canvas.draw()
    (scale,) = (a for a in (*figure.axes[2:], *axes.child_axes) if a is not axes)
    assert scale.get_window_extent().height <= 1.01 * axes.get_window_extent().height
