"""The map of severing over force and what the arm can give."""

from __future__ import annotations

import json

import pytest

from calib.material.food import load_food
from intsim import severing_map
from intsim.severing_map import SeveringTrial, drawn_food, main, press, table


def test_foods_are_drawn_evenly_from_the_literature():
    """In the logarithm, within the range, the middle of three its geometric mean."""
    r = load_food("grape").properties["R"]
    found = [drawn_food("grape", k, 3).properties["R"].value for k in range(3)]
    assert r.low < found[0] < found[1] < found[2] < r.high
    assert found[1] == pytest.approx((r.low * r.high) ** 0.5) == pytest.approx((found[0] * found[2]) ** 0.5)


def test_the_table_counts_by_load_and_a_broken_simulation_as_whole():
    """F_peak over stiffness x lead, in its bin; n and the 95 % interval of each."""

    def one(peak, severed, kind="relative"):
        return SeveringTrial("grape", 80.0, kind, 1000.0, 5e-3, peak, severed, 0.0)

    found = [one(2.0, True), one(2.4, None), one(6.0, False), one(6.0, True, "absolute")]
    assert found[0].load == pytest.approx(0.4)
    lines = table(found).splitlines()
    assert "| 0 to 0.5 | 1 of 2 (9% to 91%) | - |" in lines and "| 1 to 1.25 | 0 of 1 (0% to 79%) | 1 of 1" in lines[5]


def test_the_command_line(tmp_path, monkeypatch, capsys):
    """Each trial in a file that is never overwritten; what cannot be is one line."""
    monkeypatch.setattr(severing_map, "press", lambda food, kind, stiffness, lead: (5.0, kind == "absolute", 0.1))
    out = tmp_path / "map.json"
    words = ["--food", "grape", "--draws", "2", "--stiffness", "1000", "--lead", "0.002", "--out", str(out)]
    assert main(words) == 0 and "| 2 to inf | 0 of 2" in capsys.readouterr().out
    assert [row["kind"] for row in json.loads(out.read_text())] == ["relative", "absolute"] * 2
    assert main(words) == 1 and "never overwritten" in capsys.readouterr().err
    assert main(["--draws", "0"]) == 1 and "above 0" in capsys.readouterr().err


@pytest.mark.slow
def test_a_relative_policy_never_has_more_than_stiffness_times_lead():
    """Half of what a grape asks for: the edge stands in it, with that force; commanded to the board and as far below,
    behind the same arm, the grape parts."""
    food = load_food("grape")
    peak, severed, _ = press(food, "rigid", 1.0, 0.0)
    assert severed
    lead = peak / 1754.0 / 2
    most, severed, uncut = press(food, "relative", 1754.0, lead)
    assert not severed and uncut > 0.1 and most == pytest.approx(1754.0 * lead, rel=0.05)
    _, severed, uncut = press(food, "absolute", 1754.0, lead)
    assert severed and uncut == 0
