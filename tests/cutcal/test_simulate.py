"""``cutcal simulate`` from the command line to its files."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calib.trace.trace import read_trace
from cutcal.commands.solver.simulate import _state
from cutcal.main import main
from mpm.output.energy import doubts
from mpm.output.record import ForceRecord
from tests.calib.documents import valid
from tests.calib.made_outlines import half, picture


def test_simulate_writes_a_force_record_that_reads_back(tmp_path: Path, capsys):
    """force.csv and summary.json hold the contract, agree with each other, and the CSV is itself a trace."""
    out = tmp_path / "cut"
    argv = ["simulate", "--food", "strawberry", "--knife", "edc", "--stroke", "0.012", "--threads", "1", "--json"]
    assert main([*argv, "--out", str(out)]) == 0
    summary = valid(json.loads(capsys.readouterr().out))
    contract = "peak_N work_J work_per_area_J_m2 dx_m particles wall_s momentum_residual ke_over_ie severed components"
    assert not [k for k in contract.split() if k not in summary]
    c = pd.read_csv(out / "force.csv")
    assert {"stroke_m", "time_s", "knife_fx_N", "knife_fz_N", "board_fz_N"} <= set(c.columns)
    work = np.sum(c["knife_fz_N"] * np.diff(c["stroke_m"], prepend=0))
    np.testing.assert_allclose(summary["work_J"], work, rtol=1e-6)
    assert summary["momentum_residual"] < 1e-9 and summary["severed"] is False
    back = read_trace(out / "force.csv")
    np.testing.assert_allclose(back.force, c["knife_fz_N"])
    assert main([*argv, "--out", str(out)]) == 1
    assert "never overwritten" in capsys.readouterr().err


def test_a_cut_that_broke_down_says_how_far_it_came() -> None:
    """In words, with the reason that the files have; one that is done is done."""
    found = ForceRecord.__new__(ForceRecord)
    vars(found).update(status="inverted", fraction=0.57)
    said = _state(found)
    assert said == "broke down after 57% of its stroke (inverted: a particle was turned inside out)"
    vars(found).update(status="stopped", fraction=0.5)
    assert _state(found) == "broke down after 50% of its stroke (stopped)"
    vars(found).update(status="done")
    assert _state(found) == "done"


def test_simulate_withdraws_the_blade(tmp_path: Path, capsys):
    """Peak and work are those of the way down, the withdrawal is told beside them, and adhesion is among the energies;
    the stroke of the record comes back up."""
    argv = [
        "simulate",
        "--food",
        "strawberry",
        "--knife",
        "edc",
        "--stroke",
        "8mm",
        "--retract",
        "5mm",
        "--threads",
        "1",
    ]
    stuck = ["--set", "adhesion=5kPa", "--set", "adhesion_energy=1"]
    assert main([*argv, *stuck, "--out", str(tmp_path / "cut")]) == 0
    said = capsys.readouterr().out
    summary = valid(json.loads((tmp_path / "cut" / "summary.json").read_text()))
    up, c = summary["withdrawal"], pd.read_csv(tmp_path / "cut" / "force.csv")
    assert f"withdrawal: held back with up to {up['pull_N']:.2f} N, work {up['work_J']:.3f} J" in said
    works = c["knife_fz_N"] * np.diff(c["stroke_m"], prepend=0)
    turn = int(c["stroke_m"].argmax()) + 1
    assert summary["work_J"] == pytest.approx(works[:turn].sum(), rel=1e-6)
    assert up["work_J"] == pytest.approx(works[turn:].sum(), rel=1e-6)
    assert c["stroke_m"].iloc[-1] == pytest.approx(3e-3, abs=3e-4) and "adhesion" in summary["energy_J"]


def test_simulate_cuts_where_it_is_told(tmp_path: Path, capsys):
    """A strawberry at a quarter of its length parts into caps of a quarter's height and the rest (5/32 of an
    ellipsoid)."""
    argv = ["simulate", "--food", "strawberry", "--knife", "edc", "--at", "0.25", "--threads", "1", "--json"]
    assert main([*argv, "--out", str(tmp_path / "cut")]) == 0
    summary = valid(json.loads(capsys.readouterr().out))
    large, small = summary["volumes_m3"]
    assert summary["severed"] and small / (large + small) == pytest.approx(5 / 32, abs=0.01)
    assert main([*argv[:-3], "--at", "0.99", "--out", str(tmp_path / "end")]) != 0
    assert "leaves a slice of" in capsys.readouterr().err


def test_simulate_keeps_where_an_outline_comes_from(tmp_path: Path, capsys):
    """Name, hash and scale of a picture, in a document that its schema knows."""
    path = picture(tmp_path / "p.png", half(100, 70))
    argv = ["simulate", "--food", "strawberry", "--outline", str(path), "--scale", "0.1mm/px", "--outline-as", "half"]
    assert main([*argv, "--stroke", "2mm", "--threads", "1", "--json", "--out", str(tmp_path / "cut")]) == 0
    shape = valid(json.loads(capsys.readouterr().out))["shape"]
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    assert shape["kind"] == "outline"
    assert shape["outline"] == {"source": "p.png", "sha256": sha256, "how": "half, 0.1mm/px"}


def test_simulate_says_what_was_not_cut(tmp_path: Path, capsys):
    """A cherry that parts has nothing said of it; one that yields under a narrow edge is pressed away, which is said
    and in the document. Below 6 kPa the skin asks for more width than half the fruit, which is squashed at any."""
    argv = ["simulate", "--food", "cherry", "--knife", "edc", "--dx", "2e-3", "--threads", "1", "--json"]
    argv += ["--mach", "0.0031"]
    weak = ["--set", "yield_stress=8e3", "--set", "tensile_strength=2.4e4"]
    runs = (("cut", [], False), ("wide", weak, False), ("pressed", [*weak, "--constant", "bearing=0"], True))
    for name, more, pressed in runs:
        assert main([*argv, *more, "--out", str(tmp_path / name)]) == 0
        out, err = capsys.readouterr()
        summary = valid(json.loads(out))
        assert (summary["parted"] < 0.8) is pressed
        assert ("pressed away rather than cut" in err) is pressed
        assert any("pressed away" in text for text in summary["warnings"]) is pressed


def test_simulate_parts_a_food_by_a_law_of_its_crack(tmp_path: Path, capsys):
    """The document and the columns have what the opening took, which cuts by plain nodal projection do not have."""
    argv = ["simulate", "--food", "strawberry", "--knife", "edc", "--stroke", "0.01", "--threads", "1", "--json"]
    for name, more in (("nodal", ["--contact", "nodal"]), ("law", [])):
        assert main([*argv, *more, "--out", str(tmp_path / name)]) == 0
        summary = valid(json.loads(capsys.readouterr().out))
        columns = pd.read_csv(tmp_path / name / "force.csv").columns
        assert ("cohesion" in summary["energy_J"]) is ("cohesion_J" in columns) is (name == "law")
    assert summary["energy_J"]["cohesion"] > 0


def test_simulate_draws_what_is_asked_for(tmp_path: Path, capsys, monkeypatch):
    """Three pictures and a page beside the record; what cannot be drawn is one line, and the record is there."""
    argv = ["simulate", "--food", "strawberry", "--knife", "edc", "--stroke", "0.004", "--threads", "1"]
    assert main([*argv, "--pictures", "--page", "--out", str(tmp_path / "cut")]) == 0
    names = {p.name for p in (tmp_path / "cut").iterdir()}
    assert names == {"force.csv", "summary.json", "contact.png", "peak.png", "end.png", "cut.html"}
    assert "drawing contact" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert main([*argv, "--video", "--out", str(tmp_path / "film")]) == 1
    assert "pip install 'cutcal[view]'" in capsys.readouterr().err
    assert {p.name for p in (tmp_path / "film").iterdir()} == {"force.csv", "summary.json"}


BALANCED = {"parting": 0.6, "friction": 0.3, "kinetic": 0.02, "unbooked": 0.08}


@pytest.mark.parametrize(
    ("energy", "ke_over_ie", "words"),
    [
        (BALANCED, 0.02, []),
        (BALANCED | {"unbooked": 0.2}, 0.02, ["18% of the work is taken by no law (limit 10%)"]),
        (BALANCED | {"unbooked": -0.2}, 0.02, ["28% of the work is made by no law"]),
        (BALANCED, 5.32, ["kinetic energy is 532% of the internal one (limit 10%)"]),
        (BALANCED | {"unbooked": 0.2}, 0.11, ["taken by no law", "kinetic energy is 11%"]),
        ({}, 0.0, []),
    ],
)
def test_energies_are_judged(energy, ke_over_ie, words):
    """A balance that does not close, either way, and a cut that is mostly motion: a sentence each."""
    found = doubts(energy, ke_over_ie)
    assert len(found) == len(words) and all(word in text for word, text in zip(words, found, strict=True))


def test_simulate_judges_itself(tmp_path: Path, capsys):
    """A blade that is much too fast makes waves: exit code 2, a line, and the sentence in the document."""
    argv = ["simulate", "--food", "cherry", "--knife", "edc", "--dx", "3e-3", "--threads", "1", "--json"]
    argv += ["--set", "E=2e4", "--set", "R=2", "--mach", "0.049"]
    assert main([*argv, "--out", str(tmp_path / "cut")]) == 2
    out, err = capsys.readouterr()
    summary = valid(json.loads(out))
    assert summary["status"] == "done" and "not passed: " in err
    lines = [text for text in summary["warnings"] if "(limit 10%)" in text]
    assert lines and all(f"not passed: {line}\n" in err for line in lines)


def test_simulate_says_that_the_grid_weakens_a_strong_food(tmp_path: Path, capsys):
    """Where cells do not resolve the tensile strength, the one that was used stands in the warnings; so it does where
    the food yields before it parts."""
    argv = ["simulate", "--food", "potato", "--knife", "edc", "--stroke", "0.002", "--threads", "1", "--dx", "4mm"]
    argv += ["--set", "yield_stress=1.2e5"]
    for strength, said in (("1e5", False), ("5e6", True)):
        main([*argv, "--set", f"tensile_strength={strength}", "--out", str(tmp_path / strength)])
        capsys.readouterr()
        warnings = json.loads((tmp_path / strength / "summary.json").read_text())["warnings"]
        assert any("cells of 4 mm resolve" in text for text in warnings) is said
        assert any("flows at the tip of its crack" in text for text in warnings) is said


def test_simulate_has_an_option_for_each_constant(tmp_path: Path, capsys):
    """What was asked for stands in the document; the zone of a food without strength is nothing where it has one."""
    argv = ["simulate", "--food", "strawberry", "--knife", "edc", "--stroke", "0.001", "--threads", "1", "--json"]
    given = ("edge_band=0.4", "extension=0.05", "least_gap=0.01", "cohesive_zone=5mm", "board_friction=0.8")
    argv += [word for pair in given for word in ("--constant", pair)]
    argv += ["--zone", "4mm", "--slip", "2mm", "--contact-stiffness", "3", "--safety", "0.5"]
    main([*argv, "--out", str(tmp_path / "cut")])
    constants = valid(json.loads(capsys.readouterr().out))["constants"]
    assert constants.pop("loss_factor") > 0 and constants == {
        "edge_band": 0.4, "extension": 0.05, "crack_ties": 0.0, "layer_rows": 0.0, "least_gap": 0.01,
        "damper_mass": 0.4, "cohesive_zone": 0.0,
        "board_friction": 0.8, "board_suction": 0.0, "zone": 0.004, "bearing": 1.25, "slip": 0.002,
        "contact_stiffness": 3.0, "safety": 0.5,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "word"),
    [("lead=2", "edge_band"), ("edge_band", "NAME=VALUE"), ("edge_band=x", "not a number"), ("edge_band=9", "5")],
)
def test_an_impossible_constant_is_one_line(given, word, tmp_path: Path, capsys):
    """A constant that there is not, none without a value, no number, and one out of its limits."""
    argv = ["simulate", "--food", "strawberry", "--constant", given, "--out", str(tmp_path / "cut")]
    assert main(argv) == 1
    err = capsys.readouterr().err
    assert word in err and "Traceback" not in err and not (tmp_path / "cut").exists()


def test_simulate_stops_at_a_stone(tmp_path: Path, capsys):
    """A cherry with its stone is not parted by what its flesh takes, and the summary says why; without a limit the
    blade is not let down on it."""
    argv = ["simulate", "--food", "cherry", "--dx", "2.4e-3", "--threads", "1", "--stone"]
    assert main([*argv, "--out", str(tmp_path / "none")]) == 1
    assert "--force-limit 60" in capsys.readouterr().err
    assert main([*argv, "--force-limit", "12", "--json", "--out", str(tmp_path / "stopped")]) == 2
    summary = valid(json.loads(capsys.readouterr().out))
    assert summary["ended"] == "force_limit" and summary["severed"] is False and summary["fraction"] < 0.7
    assert summary["cut"].startswith("not severed: stone at z = ") and summary["severed_part"] < 0.5
    assert summary["stone_size_m"] == [0.0075, 0.0105, 0.0085] and summary["cavity_size_m"] is None
    assert 0.009 < summary["edge_m"] < summary["stone_met_m"] < 0.0145
    assert main([*argv, "--around", "--pictures", "--out", str(tmp_path / "drawn")]) == 1
    assert "its passes are not drawn" in capsys.readouterr().err


def test_simulate_halves_around_a_stone(tmp_path: Path, capsys):
    """Three passes leave too much at the corners of a triangle, which is said; each has its force in a file."""
    argv = ["simulate", "--food", "cherry", "--dx", "2.4e-3", "--threads", "1", "--stone", "--around", "3", "--json"]
    assert main([*argv, "--force-limit", "12", "--mach", "0.02", "--out", str(tmp_path / "cut")]) == 2
    around = valid(json.loads(capsys.readouterr().out))["around"]
    assert [one["ended"] for one in around["passes"]] == ["stroke"] * 3 and not around["severed"]
    assert 0.7 < around["severed_part"] < 0.95 and around["peak_N"] < 12
    assert {p.name for p in (tmp_path / "cut").iterdir()} >= {"force.csv", "force-2.csv", "force-3.csv"}


def test_an_arm_that_stalls_on_a_stone_has_not_passed(tmp_path: Path, capsys):
    """An arm with a stiffness stalls at its limit, and the stone is named; a food that is not cut through passes."""
    argv = ["simulate", "--food", "cherry", "--dx", "2.4e-3", "--threads", "1", "--stone"]
    arm = ["--arm-stiffness", "5000", "--force-limit", "8", "--stroke", "0.011"]
    assert main([*argv, *arm, "--out", str(tmp_path / "stalled")]) == 2
    said = capsys.readouterr()
    assert "not severed: stone at z = " in said.out and "not passed" not in said.err
    assert main([*argv, "--stroke", "0.003", "--out", str(tmp_path / "above")]) == 0
    assert "not severed: " in capsys.readouterr().out
