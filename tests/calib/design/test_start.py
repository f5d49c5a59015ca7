"""What a design knows at its start is what the folder of a calibration says."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from calib.design.start import start_of_run
from calib.errors import OutputError
from calib.io.folder import write_json
from calib.io.schema import tag
from calib.material.food import load_food
from calib.material.food_file import dump_material
from calib.problem.parameters import Z95
from cutcal.commands.calibration.design import table
from cutcal.main import main
from tests.calib.design_sample import RESULT
from tests.reports import sample


@pytest.fixture
def finished(tmp_path: Path) -> Path:
    """The folder of a calibration."""
    folder = sample.write_run(tmp_path / "run")
    dump_material(load_food("banana"), folder / "material.yaml", {})
    return folder


def test_a_start_is_what_the_calibration_says(finished: Path) -> None:
    """Values, blade, sensor, correlation, size of the errors, and present standard deviations."""
    start = start_of_run(finished)
    summary = json.loads((finished / "summary.json").read_text())
    assert start.parameters.names == tuple(summary["parameters"])
    assert start.parameters["R"].value == pytest.approx(summary["parameters"]["R"]["value"])
    assert (start.knife.name, start.shape.kind) == ("kitchen", "cylinder")
    assert (start.width_sd, start.sensor.gain, start.widened) == (0.15, 0.02, 1.3)
    assert start.errors.correlation == pytest.approx(2.1e-3 / summary["stroke_m"])
    k = start.parameters.names.index("R")
    low, high = start.reported["R"]
    assert start.present_sd[k] == pytest.approx(math.log(high / low) / (2.0 * Z95))
    assert np.all(start.present_sd <= start.parameters.prior_sd)


def test_what_is_no_start_is_refused(finished: Path, tmp_path: Path) -> None:
    """An interrupted calibration, a fit of several specimens, a folder that is not there."""
    with pytest.raises(OutputError, match="ended before it had intervals"):
        start_of_run(sample.write_run(tmp_path / "stopped", "interrupted"))
    write_json(finished / "summary.json", {"schema": tag("study")})
    with pytest.raises(OutputError, match="fit of several specimens"):
        start_of_run(finished)
    with pytest.raises(OutputError, match="no such folder"):
        start_of_run(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "give --run DIR"),
        ("--run x --food banana", "not both"),
        ("--run x --knife edc", "--knife: the calibration of --run has its food and knife"),
        ("--food banana --for F", "--for F: no such parameter"),
        ("--food banana --minutes blade", "write TEST=MINUTES"),
        ("--food banana --minutes spoon=3", "--minutes spoon: no such test"),
        ("--food banana --blade spoon", "unknown knife 'spoon'"),
    ],
)
def test_slips_on_the_command_line(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line that says what is wrong, before anything is simulated."""
    assert main(["design", *words.split()]) == 1
    error = capsys.readouterr().err.splitlines()
    assert said in error[-1]


def test_the_terminal_shows_the_tests_and_the_next_one() -> None:
    """Every test with its interval, what was left out, and the first whose record a command takes."""
    text = table(RESULT)
    assert [name for name in ("slicing", "blade edc", "width") if name in text] == ["slicing", "blade edc", "width"]
    assert "no command takes it yet" in text and "left out: speed: no law" in text
    assert text.splitlines()[-1] == "next: cut with the edc knife (15 min)"
    assert "500 to 1.1e+03" in text and "60%" in text
