"""Resistances that follow the real speed of the knife: R (v / 10 mm/s)^n."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.simulation.evaluation import doubts_of_the_crack
from mpm.batch import simulate_together
from mpm.live import LiveCut
from mpm.runtime import Runtime
from mpm.scene import Motion, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import REFERENCE_SPEED, RESISTANCES, Material
from mpm.solver import Simulation
from tests.mpm.scenes import FLESH, PRISM, cut

N = 0.3


def at(speed: float, exponent: float = N, stroke: float = 0.016) -> Scene:
    """The prism under a thin blade at a real speed [m/s]."""
    return replace(PRISM, motion=Motion(stroke, 0.01, speed=speed)).with_material(rate_exponent=exponent)


def test_new_surface_costs_the_power_of_the_speed() -> None:
    """At 100 mm/s an area costs 10^0.3 R, at 1 mm/s 10^-0.3 R, both within 1 % as at the reference; *pressed away* is
    judged against that. A slope between two depths leaves the start out."""
    for speed in (1e-3, 0.1):
        record = cut(at(speed))
        first, last = (int(np.searchsorted(record.stroke, depth)) for depth in (8e-3, 15e-3))
        area = PRISM.food.shape.width * (record.stroke[last] - record.stroke[first])
        paid = record.parting + record.cohesion
        want = FLESH.R * (speed / REFERENCE_SPEED) ** N
        assert (paid[last] - paid[first]) / area == pytest.approx(want, rel=0.01)
        assert record.resistance == pytest.approx(want, rel=1e-12)


def test_nothing_changes_at_the_reference_speed_or_without_an_exponent() -> None:
    """Bit for bit the cut of a food without the law, and the key of a stored run of such a food is what it was."""
    plain = replace(PRISM, motion=Motion(4e-3, 0.01))
    base = cut(plain)
    for scene in (at(REFERENCE_SPEED, stroke=4e-3), at(0.2, 0.0, stroke=4e-3)):
        np.testing.assert_array_equal(cut(scene).resolved, base.resolved)
    assert at(0.2, 0.0).at_its_speed == at(0.2, 0.0)
    assert "rate_exponent" not in plain.as_dict()["food"]["material"]
    assert at(0.2).as_dict()["food"]["material"]["rate_exponent"] == N


def test_all_that_the_edge_works_against_follows_the_speed() -> None:
    """Flesh, rind, core, skin and the start have one factor; what a food has not stays absent, the rest as it was."""
    layered = replace(FLESH, R_rind=500.0, rind_thickness=1e-3, R_core=90.0, core_ratio=0.3, rate_exponent=N)
    fast = layered.at_speed(0.1)
    for name in ("R", "R_rind", "R_core", "R_initiation"):
        assert getattr(fast, name) == pytest.approx(10**N * getattr(layered, name), rel=1e-12)
    assert fast.R_skin is None and replace(layered, R_skin=8.0).at_speed(0.1).R_skin == pytest.approx(8 * 10**N)
    same = {name: getattr(layered, name) for name in RESISTANCES} | {"rate_exponent": N}  # all that has changed
    assert replace(fast, **same) == layered and fast.rate_exponent == 0


@pytest.mark.slow
def test_every_way_to_run_a_cut_has_the_speed() -> None:
    """A candidate of a scene, cuts side by side, a cut followed live and one loaded by hand have the same table of
    parameters as a cut of a food whose resistances are those at the speed."""
    scene, runtime = at(0.1, stroke=2e-3), Runtime(threads=1)
    scaled = replace(PRISM, motion=Motion(2e-3, 0.01)).with_material(**vars(scene.food.material.at_speed(0.1)))
    base = cut(scaled)
    for record in (Simulation(at(0.1, 0.0, 2e-3), runtime).run(scene.food.material), *simulate_together([scene])):
        np.testing.assert_allclose(record.resolved, base.resolved, rtol=1e-9)
        assert record.dt == base.dt and record.resistance == base.resistance

    def table(simulation: Simulation, material: Material) -> np.ndarray:
        simulation.load(material)
        out: np.ndarray = simulation.state.par.to_numpy()[0]
        return out

    want = table(Simulation(scaled, runtime), scaled.food.material)
    np.testing.assert_allclose(table(Simulation(scene, runtime), scene.food.material), want, rtol=1e-12)
    live = LiveCut(scene, runtime)
    np.testing.assert_allclose(live._simulation.state.par.to_numpy()[0], want, rtol=1e-12)
    assert live._dt == base.dt and live.scene.food.material == scaled.food.material  # of which its record is


def test_a_speed_is_needed_and_the_blade_may_slow_down() -> None:
    """Without a real speed the scene is refused in one line that says what to give, as is a power beyond 1. No law
    follows the time, so a blade that waits for the halves still does."""
    with pytest.raises(
        SceneError, match=r"rate_exponent makes the force .* give motion\.speed .* or rate_exponent 0 for a cut at 10"
    ):
        PRISM.with_material(rate_exponent=N)
    with pytest.raises(SceneError, match=r"material: rate_exponent = 1\.5 "):
        replace(FLESH, rate_exponent=1.5)
    scene = at(0.1)
    assert replace(scene, motion=replace(scene.motion, end_speed=0.5)).slows_down


def test_what_the_grid_resolves_is_judged_at_the_speed() -> None:
    """A food of little resistance parts in a short zone, which coarse cells do not resolve: the weaker a slow cut."""
    strong = at(0.1).with_material(R=15.0, R_initiation=15.0, tensile_strength=1.5e5, rate_exponent=1.0)
    slow = replace(strong, motion=replace(strong.motion, speed=1e-3))
    assert doubts_of_the_crack(strong) == []
    assert "more than cells of" in doubts_of_the_crack(slow)[0]
    sticky = strong.with_material(adhesion=5e5, adhesion_energy=0.5)
    assert "the adhesion of 500\u00a0kPa is more than cells of" in doubts_of_the_crack(sticky)[0]
