"""The quasi-linear law against closed forms, the texture profile of bodies made of it, and laws told from bites."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import CurveError
from calib.texture.bite_path import BitePath, path_of
from calib.texture.law_fit import SpeedGroup, fit_law
from calib.texture.left_out import law_of_direction, outside, passes, predicted_profile
from calib.texture.quasi_linear import QuasiLinearLaw
from tests.calib.texture.made_bites import DEPTH, HEIGHT, record, two_bites

LAW = QuasiLinearLaw(E_Pa=1e5, stiffening=4.0, equilibrium=0.1, power=0.3, damage=0.0)
BITE = BitePath(descent_s=1.0, dwell_s=0.3, apart_s=2.6, strain=0.5)
AREA = 1e-4


def test_small_strains_are_linear_viscoelasticity():
    """Up to a strain of 1e-4 the stress is that of the Prony series within 0.1 %, and a hold relaxes as its closed form
    within 1 %."""
    time = np.concatenate([np.linspace(0.0, 1e-3, 5), np.geomspace(2e-3, 500.0, 200)])
    strain = 1e-4 * np.minimum(time / 1e-3, 1.0)
    found = LAW.stress(time, strain)
    np.testing.assert_allclose(found, LAW.series.stress(time, 1e5 * strain), rtol=1e-3)
    held = time > 0.02
    np.testing.assert_allclose(found[held], 10.0 * LAW.series.relaxation(time[held]), rtol=0.01)


def test_large_strains_relax_by_the_same_series():
    """Quasi-linear: a fast step to any strain has the same relaxation over its first stress."""
    time = np.concatenate([[0.0], np.geomspace(1e-6, 100.0, 60)])
    for strain in (0.1, 0.5):
        found = LAW.stress(time, np.minimum(time / 1e-6, 1.0) * strain)
        want = LAW.elastic(np.array([strain]))[0] * LAW.series.relaxation(time[1:])
        np.testing.assert_allclose(found[1:], want, rtol=1e-3)


def test_an_elastic_body_gives_all_back_and_damage_is_its_closed_form():
    """Texture profile 1, 1, 1 without damage; with damage d the second peak over the first is
    (1 - d (1 - e^-3)) / (1 - d (1 - e^-1)), as three times the work of a bite has gone through."""
    elastic = replace(LAW, equilibrium=1.0)
    bite = replace(BITE, dwell_s=0.0)
    profile = predicted_profile(bite, elastic.stress(*bite.history()), AREA)
    found = [profile.cohesiveness, profile.springiness, profile.resilience]
    assert found == pytest.approx([1.0] * 3, rel=0.01)
    assert profile.hardness_N == pytest.approx(1e5 * np.expm1(2.0) / 4.0 * AREA, rel=1e-6)
    hurt = replace(elastic, damage=0.4)
    profile = predicted_profile(bite, hurt.stress(*bite.history()), AREA)
    want = (1 + 0.4 * np.expm1(-3)) / (1 + 0.4 * np.expm1(-1))
    assert profile.second_hardness_N / profile.hardness_N == pytest.approx(want, rel=1e-3)


def test_a_viscous_body_stays_deformed():
    """Without a spring, springiness falls with the weight of fast times in the spectrum; the plate never pulls, steps
    in time do not count, and what is given back is less than what was put in."""
    lasting = [
        predicted_profile(BITE, replace(LAW, equilibrium=0.0, power=power).stress(*BITE.history()), AREA).springiness
        for power in (-0.5, 0.0, 0.5)
    ]
    assert lasting[0] > lasting[1] > lasting[2] and lasting[2] < 0.6
    time, strain = BITE.history()
    fine = np.unique(np.concatenate([time, np.linspace(time[0], time[-1], 4000)]))
    stress = LAW.stress(fine, np.interp(fine, time, strain))
    assert stress.min() == 0.0
    assert np.interp(time, fine, stress)[24] == pytest.approx(LAW.stress(time, strain)[24], rel=0.01)
    late = replace(BITE, dwell_s=0.0, apart_s=2.0)
    profile = predicted_profile(late, LAW.stress(*late.history()), AREA)
    assert profile.resilience < 0.8 and 0.3 < profile.springiness < 0.9 and profile.adhesiveness_Ns == 0.0


def test_a_path_is_found_in_records():
    """Descent, standing and distance of the peaks of made bites, also where the way is recorded 40 ms late."""
    time, way = two_bites(1.0, rest=0.5)
    for late in (0.0, 0.04):
        made = record(time, np.interp(time - late, time, way), 8.0 * way / DEPTH)
        path = path_of([made], [HEIGHT])
        assert path.descent_s == pytest.approx(1.0, rel=0.01) and path.apart_s == pytest.approx(2.5, abs=0.01)
        assert path.strain == pytest.approx(0.5, rel=0.02) and path.dwell_s < 0.08


def made(law: QuasiLinearLaw, descent: float, *, factors=(0.9, 1.0, 1.1)) -> SpeedGroup:
    """Repeats of a law that differ by a factor."""
    path = BitePath(descent, 0.3 if descent < 10 else 0.0, 2.1 * descent + 0.4, 0.5)
    stress = law.stress(*path.history())
    return SpeedGroup(f"{descent:g} s", path, np.array([factor * stress for factor in factors]))


def test_a_law_is_told_by_its_bites_and_predicts_another_speed():
    """From three speeds of a made-up law its parameters within 5 %, and the fourth speed within its repeats' scatter
    in every quantity; damage is left out where there is none."""
    groups = [made(LAW, descent) for descent in (0.5, 2.0, 20.0)]
    fit = fit_law(groups, damaged=False)
    for name in ("E_Pa", "stiffening", "equilibrium", "power"):
        assert getattr(fit.law, name) == pytest.approx(getattr(LAW, name), rel=0.05), name
    group = made(LAW, 1.0)
    profiles = [predicted_profile(group.path, stress, AREA) for stress in group.stress]
    every = [*groups, group]
    scattered = [[predicted_profile(g.path, s, AREA) for s in g.stress] for g in groups] + [profiles]
    law, curves = law_of_direction("only", every, scattered, AREA)
    assert law.damage_evidence < 0.0 and list(curves) == [g.name for g in every]
    unseen = law.left_out[-1]
    assert unseen.group == "1 s" and not unseen.extrapolated and unseen.curve_inside == 1.0
    hardness = unseen.quantities[0]
    assert hardness.inside and hardness.predicted == pytest.approx(hardness.mean, rel=0.02)
    assert hardness.area_metric == pytest.approx(hardness.area_of_mean, rel=0.05)


def test_a_speed_of_another_batch_fails_and_says_why():
    """Specimens of one speed three times as stiff: that speed is not predicted, and the report names the batch."""
    groups = [made(LAW, 0.5), made(LAW, 2.0, factors=(2.7, 3.0, 3.3)), made(LAW, 20.0)]
    profiles = [[predicted_profile(g.path, s, AREA) for s in g.stress] for g in groups]
    told = law_of_direction("only", groups, profiles, AREA)[0].left_out[1]
    assert not passes(told) and "hardness is outside" in told.why and "another batch" in told.why
    assert "of it and 0.5 s the slower one is harder" in told.why
    assert told.factor > 1.5


def test_one_repeat_is_not_judged():
    """A speed of one repeat has no scatter: neither passed nor failed, and the document says so; the others are
    judged."""
    groups = [made(LAW, 0.5), made(LAW, 2.0, factors=(3.0,)), made(LAW, 20.0)]
    profiles = [[predicted_profile(g.path, s, AREA) for s in g.stress] for g in groups]
    first, alone, last = law_of_direction("only", groups, profiles, AREA)[0].left_out
    assert passes(alone) is None and outside(alone) is None and alone.why == "one repeat has no scatter"
    assert [each.inside for each in alone.quantities] == [None] * 4 and np.isnan(alone.curve_inside)
    assert passes(first) in (True, False) and passes(last) in (True, False)


def test_one_speed_tells_no_law():
    """Refused with the reason; and a law without stiffness is none."""
    with pytest.raises(CurveError, match="one speed does not tell stiffness from rate"):
        fit_law([made(LAW, 1.0)], damaged=False)
    with pytest.raises(CurveError):
        replace(LAW, E_Pa=0.0)
    with pytest.raises(CurveError):
        replace(LAW, damage=1.5)
