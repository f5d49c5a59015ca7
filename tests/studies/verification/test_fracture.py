"""Cases of fracture: where the tip of a crack is found, how a sweep picks its worst row, how a force is smoothed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions
from studies.verification.fracture import surface_work
from studies.verification.fracture.crack_tip import tip_height
from studies.verification.fracture.scene import TUBER, Wedge, brittle, scene, simulation
from studies.verification.fracture.surface_work import Food, Paid, sweep
from studies.verification.fracture.wedge_cuts import smoothed

DX = 2e-3
BLOCK = Shape("block", 0.016, 0.008, 0.02)


@pytest.mark.parametrize(("degrees", "food", "lead"), [(2.5, brittle(1e6, 300.0, 0.17e6), 0.0), (30.0, TUBER, 6e-3)])
def test_the_tip_is_at_the_edge_or_ahead_of_it(degrees, food, lead):
    """A thin blade in a tough food cuts at its edge; a thick one in a brittle food splits it far ahead."""
    made = simulation(SuiteOptions(), scene(BLOCK, food, Wedge(degrees), 6e-3, DX))
    record = made.run()
    ahead = BLOCK.height - record.stroke[-1] - tip_height(made)
    assert ahead == pytest.approx(lead, abs=1.5e-3)


def test_a_sweep_shows_the_worst_food_and_one_that_broke_down(monkeypatch):
    """The largest error of each kind, with the name of its food; what is no number is worst and fails."""
    soft, stiff = Food(1e6, False), Food(1e7, True)
    found = {soft: Paid(0.98, 0.01), stiff: Paid(1.01, -0.06)}
    monkeypatch.setattr(surface_work, "paid", lambda options, degrees, food, dx: found[food])
    work, books = sweep(SuiteOptions(), 11.0, (soft, stiff), (3e-3,))
    assert (work.got, books.got) == (0.98, -0.06)
    assert "E 1 MPa, elastic" in work.case and "E 10 MPa, flows" in books.case
    assert work.passed and not books.passed
    found[stiff] = Paid(math.nan, math.nan)
    work, books = sweep(SuiteOptions(), 11.0, (soft, stiff), (3e-3,))
    assert not work.passed and not books.passed and "flows" in work.case


def test_a_smoothed_force_keeps_its_work():
    """A constant force is itself; a ripple of half the window is gone."""
    stroke = np.linspace(0.0, 0.01, 1001)
    force = 5.0 + np.sin(2 * math.pi * stroke / 1e-3)
    work = np.concatenate([[0.0], np.cumsum(np.diff(stroke) * (force[1:] + force[:-1]) / 2)])
    np.testing.assert_allclose(smoothed(stroke, work, np.array([3e-3, 5.2e-3])), 5.0, atol=1e-6)
