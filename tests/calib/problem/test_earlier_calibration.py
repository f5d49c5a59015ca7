"""Where a search begins that follows another: at the earlier food whose simulated curve is closest to the new trace."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from calib.api import Calibration
from calib.errors import OutputError
from calib.problem.earlier_calibration import earlier_guesses
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.setup import set_up
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_file import Header
from calib.simulation.evaluation_store import EvaluationStore
from cutcal.main import main
from tests.calib.problem.test_objective import FINE, GRID, interpolate, wave

PARAMETERS = ParameterSet(
    (
        Parameter("E", 1e5, 1e3, 1e7, "Pa", 5e4, 2e5),
        Parameter("R", 100.0, 1.0, 1e4, "J/m^2", 50.0, 200.0),
    )
)
OBJECTIVE = Objective(Target(GRID, wave(GRID), 0.0, 0.0, interpolate), PARAMETERS)


def earlier(folder: Path, *runs: tuple[float, float, float], knife: str = "kitchen", **more: Any) -> None:
    """A finished calibration with simulations of E [Pa], R [J/m^2] and a factor on the wave that they gave."""
    folder.mkdir()
    fidelity, fitted = more.get("fidelity", "coarse"), more.get("fitted", ("E", "R"))
    with EvaluationStore(folder / "evaluations.h5", Header("a trace", "a scene")) as store:
        for k, (*values, factor) in enumerate(runs):
            named = dict(zip(fitted, values, strict=True))
            store.append(f"{k}", Evaluation(k, named, "ok", "", 1.0, FINE, factor * wave(FINE)), fidelity)
    (folder / "summary.json").write_text(json.dumps({"food": "banana", "knife": {"name": knife}}))


def found(folder: Path) -> list[dict[str, float]]:
    """The foods that a search begins at."""
    return [PARAMETERS.to_dict(z) for z in earlier_guesses(folder, OBJECTIVE, "banana", "kitchen")]


def test_the_closest_curve_and_that_of_another_valley(tmp_path: Path) -> None:
    """Not the closest neighbour of the first, and not what did not explain the earlier trace best."""
    earlier(tmp_path / "one", (2e5, 50.0, 1.3), (9.1e4, 81.0, 1.03), (9e4, 80.0, 1.02), (3e4, 300.0, 1.05))
    one, two = found(tmp_path / "one")
    assert one == {"E": pytest.approx(9e4), "R": pytest.approx(80.0)}
    assert two == {"E": pytest.approx(3e4), "R": pytest.approx(300.0)}


def test_a_folder_of_several_gives_the_closest_of_all(tmp_path: Path) -> None:
    """Those of another knife or other parameters are passed over, and so are checks of an answer."""
    earlier(tmp_path / "far", (5e4, 90.0, 1.2))
    earlier(tmp_path / "near", (1.5e5, 120.0, 0.99))
    earlier(tmp_path / "knife", (1e5, 100.0, 1.0), knife="edc")
    earlier(tmp_path / "others", (1e5, 0.3, 1.0), fitted=("E", "mu"))
    earlier(tmp_path / "checks", (1e5, 101.0, 1.0), fidelity="check")
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "summary.json").write_text("[]")
    first, *_ = found(tmp_path)
    assert first["E"] == pytest.approx(1.5e5)
    with pytest.raises(OutputError, match=r"--start-from .*knife: no simulation of banana under the knife kitchen"):
        found(tmp_path / "knife")


def test_a_damaged_store_is_named(tmp_path: Path) -> None:
    """In one line, also where the file is not there."""
    earlier(tmp_path / "one", (9e4, 80.0, 1.02))
    store = tmp_path / "one" / "evaluations.h5"
    store.write_bytes(b"no HDF5")
    with pytest.raises(OutputError, match=r"evaluations.h5 is no store of evaluations"):
        found(tmp_path / "one")
    store.unlink()
    with pytest.raises(OutputError, match=r"evaluations.h5 cannot be read"):
        found(tmp_path / "one")


def test_a_calibration_begins_there(tmp_path: Path) -> None:
    """Its search is given the earlier food, and without one nothing of it."""
    trace = Path(__file__).parents[3] / "force_data" / "banana_reconstructed.csv"
    asked = {"food": "banana", "trace": trace, "fit": ["E", "R"]}
    alone = set_up(Calibration(**asked).request()).objective
    (usual,) = alone.guesses
    assert alone.parameters.to_dict(usual) == pytest.approx({p.name: p.value for p in alone.parameters})
    earlier(tmp_path / "one", (2e5, 300.0, 1.0))
    objective = set_up(Calibration(**asked, start_from=tmp_path / "one").request()).objective
    (guess,) = objective.guesses
    assert objective.parameters.to_dict(guess) == {"E": pytest.approx(2e5), "R": pytest.approx(300.0)}


@pytest.mark.parametrize("beside", [["--all"], ["--sample"]])
def test_what_it_does_not_go_with(beside: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Fits of several cuts, and a sampled posterior, which begins nowhere."""
    given = ["calibrate", "--food", "banana", "--trace", "cut.csv", "--start-from", "runs/one"]
    assert main([*given, *beside]) == 1
    assert "--start-from" in capsys.readouterr().err
