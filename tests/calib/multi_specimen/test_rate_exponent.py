"""Cuts of one food at several speeds tell how its resistance depends on them; cuts at one speed are sent back."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calib.errors import MaterialError
from calib.material.food import load_food, load_material_file
from calib.multi_specimen.specimens import Specimens, set_ups
from calib.multi_specimen.study_file import read_study
from calib.problem.rate_exponent import check_speeds
from calib.problem.setup import way_of
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.workers import Errand, Workers
from cutcal.main import main
from mpm.scene import Motion, Scene
from tests.calib.documents import valid

E, R, N, SKIN = 4e5, 420.0, 0.3, 500.0
HEIGHT, WIDTH = 0.033, 0.03
SLOW, FAST = 4e-3, 0.04
FIT = "fit: [E, R, R_skin, rate_exponent]"


def force(stroke: np.ndarray, modulus: float, flesh: float, skin: float) -> np.ndarray:
    """A cut [N]: a skin that is pierced, flesh that is parted, faces that are pressed."""
    x = stroke / HEIGHT
    pierced, parted = skin * np.exp(-(((x - 0.12) / 0.05) ** 2)), flesh * (1.0 - np.exp(-x / 0.06))
    out: np.ndarray = WIDTH * (pierced + parted + 6e-4 * modulus * np.minimum(x / 0.5, 1.0))
    return out


class Formula(Workers):
    """That cut in place of the particles, of what the solver takes: the scene at its real speed."""

    def __init__(self) -> None:
        super().__init__(2, "cpu", 1)

    def close(self) -> None:
        """Nothing to end."""

    def errands(self, errands: Sequence[Errand]) -> None:
        """A fit asks for none."""
        raise AssertionError("a whole record was asked of a formula")

    def each(self, work: Any, jobs: Any) -> Any:
        """Nor for other work."""
        raise AssertionError(f"{work} was asked of a formula")

    def run(self, jobs: Sequence[tuple[Scene, Mapping[str, float]]]) -> Iterator[Evaluation]:
        """Each cut at once, with half a per cent of repeatable waviness."""
        for index, (scene, values) in enumerate(jobs):
            food = scene.with_material(**values).at_its_speed.food.material
            stroke = np.linspace(0.0, scene.motion.stroke, 400)[1:]
            assert food.R_skin is not None
            curve = force(stroke, food.E, food.R, food.R_skin) * (1 + 0.005 * np.sin(40 * stroke / HEIGHT + food.E))
            scalars = {
                "peak_N": float(curve.max()),
                "work_J": float(np.trapezoid(curve, stroke)),
                "unbooked_J": 0.0,
                "momentum_residual": 1e-12,
                "ke_over_ie": 1e-3,
            }
            yield Evaluation(index, dict(values), "ok", "", 1.0, stroke, curve, scalars, 0.01)


def made_up(folder: Path, speeds: Mapping[str, float], *lines: str) -> Path:
    """Write a cut at each speed [m/s], by name, and a study of them with more lines."""
    random = np.random.default_rng(4)
    for name, v in speeds.items():
        time = np.linspace(0.0, 1.0 + HEIGHT / v, 1500)
        way = v * (time - 1.0)
        faster = (v / 0.01) ** N
        cut = force(np.clip(way, 0.0, HEIGHT), E, faster * R, faster * SKIN)
        noisy = np.where((way > 0.0) & (way <= HEIGHT), cut, 0.0) + 5.0 + 0.05 * random.standard_normal(len(time))
        table = {"time_s": time, "force_N": noisy, "position_m": 0.1 - way}
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", index=False)
    traces = [f"  {n}: {{trace: {n}.csv, height: {HEIGHT}, width: {WIDTH}, gain_sd: 0.01}}" for n in speeds]
    path = folder / "speeds.yaml"
    head = ["food: banana", "set: {rate_exponent: 0.1}", *lines, "budget: 40", "traces:"]
    path.write_text("\n".join([*head, *traces]))
    return path


@pytest.mark.slow
def test_two_speeds_tell_resistance_and_exponent(tmp_path: Path) -> None:
    """Two cuts at speeds a factor of ten apart, fitted together: R at 10 mm/s, which neither of them had, and the
    exponent come back within 10 %, inside intervals that say so."""
    study = read_study(made_up(tmp_path, {"slow": SLOW, "fast": FAST}, FIT))
    setups = set_ups(study)
    assert [s.fine.motion.speed for s in setups.values()] == pytest.approx([SLOW, FAST], rel=0.02)
    with EvaluationStore(tmp_path / "runs.h5", Header("two", "cuts"), resume=False, say=print) as store:
        fit = Specimens(study, setups, (), Formula(), store).fit(study.fitted)
    found = fit.shared_values("kitchen")
    assert found["R"] == pytest.approx(R, rel=0.1) and found["rate_exponent"] == pytest.approx(N, rel=0.1)
    assert fit.analysis is not None
    names = [p.name for p in fit.result.parameters]
    for name, true in (("R", R), ("rate_exponent", N)):
        interval = fit.analysis.uncertainty.intervals[names.index(name)]
        assert interval.low95 < true < interval.high95


def test_a_calibration_on_one_cut_is_sent_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Before anything is simulated, in one line that says why and what to do; with the exponent held it goes on, at the
    speed of the trace, and so does a fit of the exponent alone where R is held and the speed is not the reference."""
    made_up(tmp_path, {"fast": FAST})
    common = ["calibrate", "--food", "banana", "--trace", str(tmp_path / "fast.csv"), "--check", "--height", "33mm"]
    given = ["--set", "rate_exponent=0.1"]
    assert main([*common, *given, "--fit", "E,R,rate_exponent"]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "--fit rate_exponent: the speed of one cut (fast.csv)" in said
    assert "cannot tell it from R; fit cuts whose speeds are a factor of 1.5 or more apart in one study" in said
    for names in ("E,R", "E,rate_exponent"):
        assert main([*common, *given, "--fit", names]) == 0
    assert main([*common, "--fit", "E,rate_exponent"]) == 1
    assert "no literature range for rate_exponent; give a value for it first" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("speeds", "lines", "said"),
    [
        ({"a": FAST, "b": 0.9 * FAST}, (), "fit rate_exponent: the speeds of a, b, 36.* to 40.* cannot tell it from R"),
        ({"a": FAST, "b": SLOW}, ("hold_out: [b]",), "fit rate_exponent: the speed of one cut .a., 40"),
        (
            {"a": FAST, "b": FAST, "c": SLOW},
            ("hold_out: each",),
            "hold_out: rate_exponent: the speeds of a, b, 40.* cannot tell it from R",
        ),
        ({"a": FAST, "b": SLOW}, ("own: [R]",), "own R: a cut with R of its own tells nothing of how R depends on"),
        ({"a": FAST, "b": SLOW}, ("own: [rate_exponent]",), "own rate_exponent: a cut with rate_exponent of its own"),
    ],
)
def test_a_study_that_cannot_tell_the_exponent_is_sent_back(
    tmp_path: Path, speeds: dict[str, float], lines: tuple[str, ...], said: str
) -> None:
    """Speeds that are alike, be it in the fit or in one that predicts a cut from the others, or a resistance of each
    cut's own; the same cuts without the exponent, or all of them in one fit, are taken."""
    study = made_up(tmp_path, speeds, FIT, *lines)
    with pytest.raises(MaterialError, match=said):
        set_ups(read_study(study))
    study.write_text(study.read_text().replace(", rate_exponent]", "]"))
    assert len(set_ups(read_study(study))) == len(speeds)


def test_speeds_that_are_a_factor_apart_are_enough() -> None:
    """From 1.5 on; where R is held it is known at 10 mm/s, so that one cut at another speed tells the exponent."""
    check_speeds(["R", "rate_exponent"], {"a": 0.01, "b": 0.016})
    check_speeds(["rate_exponent"], {"a": 0.02})
    check_speeds(["R"], {"a": 0.01})
    for names, speeds in ((["R", "rate_exponent"], {"a": 0.01, "b": 0.014}), (["rate_exponent"], {"a": 0.012})):
        with pytest.raises(MaterialError, match="cannot tell it from R"):
            check_speeds(names, speeds)


def test_a_food_has_the_exponent_where_it_is_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No food has it by default. It reaches the solver and comes back from a file and as a document; its range lies to
    either side, so a fit may find none or a negative one; a cut of it has the mean real speed of its trace."""
    plain = load_food("banana")
    assert plain.value("rate_exponent") is None and "rate_exponent" not in plain.as_dict()["properties"]
    assert plain.to_scene_food().material.rate_exponent == 0 and not plain.rate_dependent
    food = plain.with_values({"rate_exponent": 0.2})
    assert food.to_scene_food().material.rate_exponent == 0.2 and "rate_exponent" not in food.default_fit
    assert food.prior("rate_exponent") == pytest.approx((-0.3, 0.7))
    food.save(tmp_path / "food.yaml")
    assert load_material_file(tmp_path / "food.yaml").value("rate_exponent") == 0.2
    assert main(["foods", str(tmp_path / "food.yaml"), "--json"]) == 0
    assert valid(json.loads(capsys.readouterr().out))["banana"]["properties"]["rate_exponent"]["value"] == 0.2
    setup = next(iter(set_ups(read_study(made_up(tmp_path, {"a": FAST}, "fit: [E, R]"))).values()))
    way = way_of(food, setup.curve)
    assert isinstance(way, Motion) and way.speed == pytest.approx(FAST, rel=0.02)
    assert not isinstance(way_of(plain, setup.curve), Motion)
    none = plain.with_values({"rate_exponent": 0.0})  # from where a fit begins
    assert none.rate_dependent and none.prior("rate_exponent") == (-0.5, 0.5)
    with pytest.raises(MaterialError, match="1.2 cannot be the power of the real speed, over 10 mm/s, in all resist"):
        plain.with_values({"rate_exponent": 1.2})
