"""What the measurement leaves open: it is integrated out exactly, found where it is there, and said."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calib.api import Calibration
from calib.errors import TraceError
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.problem.nuisance import (
    GAIN_SD,
    TORQUE_BANDWIDTH,
    TORQUE_BANDWIDTH_SPREAD,
    TORQUE_GAIN_SD,
    Nuisance,
    Sensor,
    Whitening,
    nuisances,
    sensor_of,
)
from calib.problem.numerical_uncertainty import numerical_uncertainty
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.setup import set_up
from calib.problem.target import Target
from calib.trace.conditioning import Conditioned, condition
from calib.trace.filters import BandLimited
from calib.trace.trace import Trace
from mpm.scene.errors import CutcalError
from tests.calib.made_cuts import made_cut

ONE = ParameterSet((Parameter("E", 1e5, 1e3, 1e7, "Pa", 5e4, 2e5),))


def cut(column: str = "force_N") -> Conditioned:
    """A cut of 10 N at 50 mm/s over 40 mm with noise of 0.1 N."""
    time = np.arange(0.0, 1.4, 0.005)
    stroke = np.clip(0.05 * (time - 0.5), 0.0, None)
    force = 10.0 * np.sin(np.pi * np.clip(stroke / 0.04, 0.0, 1.0) / 1.2)
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(time))
    trace = Trace(time, force + noise + 3.0, 0.1 - 0.05 * time, "cut.csv", "", {"force": column, "position": "z_m"})
    return condition(trace, t_end=1.3)


def goal(curve: Conditioned, given: tuple[Nuisance, ...]) -> Objective:
    """The objective of a cut."""
    target = Target(curve.stroke, curve.curve, 0.1, 0.1, np.interp)
    return Objective(target, ONE, nuisances=given)


def test_whitening_is_the_inverse_root_of_the_covariance() -> None:
    """V^(-1/2) V V^(-1/2) = 1 with V = 1 + G G^T, for columns that are far from independent."""
    columns = np.random.default_rng(1).standard_normal((30, 3)) @ np.diag([5.0, 1.0, 0.1])
    columns[:, 2] += columns[:, 0]
    root = Whitening(columns)(np.eye(30))
    assert root @ (np.eye(30) + columns @ columns.T) @ root == pytest.approx(np.eye(30), abs=1e-9)
    assert Whitening(np.zeros((30, 0)))(np.arange(30.0)) == pytest.approx(np.arange(30.0))


def test_chi_square_is_the_least_over_the_nuisances() -> None:
    """The whitened chi-square equals the least one over all sizes of the nuisances, each paying for itself."""
    curve = cut()
    given = nuisances(curve, Sensor(0.1, 0.01), scaled=True)
    assert [n.name for n in given] == ["tare", "drift", "lag"]
    whole, bare = goal(curve, given), goal(curve, ())
    simulated = np.interp(curve.stroke - 5e-4, curve.stroke, curve.curve) + 0.05
    columns = np.array([bare._weights * n.shape * n.sd for n in given]).T
    rows = bare.data_residual(simulated)[:-2]
    system = np.vstack([columns, np.eye(len(given))])
    least = np.linalg.lstsq(system, np.concatenate([rows, np.zeros(len(given))]), rcond=None)[1][0]
    assert float(np.sum(whole.data_residual(simulated)[:-2] ** 2)) == pytest.approx(least, rel=1e-9)
    assert least < 0.5 * float(rows @ rows)


def test_the_peak_is_met_bare() -> None:
    """No nuisance that the search integrates out explains a peak: the drift only widens its tolerance, by what it may
    do there."""
    curve = cut()
    given = nuisances(curve, Sensor(0.1, 0.01), width_sd=0.2)
    whole, bare = goal(curve, given), goal(curve, ())
    drift = next(n for n in given if n.name == "drift")
    assert whole.sigma_peak == pytest.approx(np.hypot(bare.sigma_peak, drift.sd * drift.peak))
    assert drift.peak == pytest.approx(float(curve.stroke[curve.curve.argmax()] / curve.stroke[-1]))
    simulated = curve.curve + 1.5 * np.minimum(curve.stroke / 0.02, 1.0)
    row = whole.data_residual(simulated)[-2]
    assert row == pytest.approx((simulated.max() - curve.curve.max()) / whole.sigma_peak)


@pytest.mark.parametrize(
    ("name", "size"), [("tare", 0.5), ("drift", 0.3), ("lag", 4e-4), ("gain", 0.06)], ids=lambda x: str(x)
)
def test_each_is_found_where_it_is_there(name: str, size: float) -> None:
    """A measured curve that is off by one of them gives that one back within two standard deviations, and no other."""
    curve = cut()
    given = tuple(replace(n, sd=s) for n, s in zip(nuisances(curve, Sensor(0.1)), (1.0, 0.5, 1e-3, 0.1), strict=True))
    off = next(n for n in given if n.name == name)
    found = {e.name: e for e in goal(curve, given).nuisance_estimates(curve.curve - size * off.shape)}
    assert found[name].value == pytest.approx(size, abs=2.0 * found[name].sd) and found[name].sd < off.sd
    assert all(abs(e.value) < 2.0 * e.sd for e in found.values() if e.name != name)


def test_a_gain_beyond_three_of_its_prior_is_outside() -> None:
    """A curve 30 % too large for a sensor that is good to 2 % contradicts it; 3 % does not."""
    curve = cut()
    given = tuple(n for n in nuisances(curve, Sensor(GAIN_SD)) if n.name == "gain")
    for size, outside in ((0.3, True), (0.03, False)):
        (found,) = goal(curve, given).nuisance_estimates(curve.curve / (1.0 + size))
        assert found.outside is outside


def test_nothing_makes_a_force_look_right() -> None:
    """Gain and width are not searched, and half the force is half the force however little is known of either."""
    curve = cut()
    given = nuisances(curve, Sensor(0.15), width_sd=0.2)
    assert [n.name for n in given if not n.searched] == ["gain", "width"]
    half = goal(curve, given).data_residual(0.5 * curve.curve)
    assert half @ half > 100.0


def test_a_late_onset_is_not_a_misfit() -> None:
    """The right curve, measured with an onset that is one standard deviation off, costs about one; without the lag it
    costs more."""
    curve = cut()
    given = nuisances(curve, Sensor(0.0, 0.01))
    lag = next(n for n in given if n.name == "lag")
    late = np.interp(curve.stroke + lag.sd, curve.stroke, curve.curve)
    with_lag, without = goal(curve, (lag,)).data_residual(late), goal(curve, ()).data_residual(late)
    assert with_lag @ with_lag < 1.5 < 5.0 < without @ without


def test_a_wrench_from_joint_torques_has_an_uncertain_gain() -> None:
    """The sensor is told by its column, the user's word goes before, and nonsense is refused."""
    robot, said = sensor_of(cut("base_Fz_N"), None, None)
    assert robot.gain_sd == TORQUE_GAIN_SD and "--gain-sd" in said[0]
    assert sensor_of(cut(), None, 0.02) == (Sensor(GAIN_SD, 0.02), ())
    given, said = sensor_of(cut("base_Fz_N"), 0.01, None)
    assert given.gain_sd == 0.01 and not any("--gain-sd" in text for text in said)
    with pytest.raises(TraceError, match="--gain-sd 15"):
        Sensor(15.0)


def test_a_wrench_from_joint_torques_went_through_a_low_pass() -> None:
    """It is told by its column and known to a factor of two, unless the user knows it; another sensor has none."""
    robot, said = sensor_of(cut("base_Fz_N"), None, None)
    assert (robot.bandwidth, robot.bandwidth_sd) == (TORQUE_BANDWIDTH, TORQUE_BANDWIDTH_SPREAD)
    assert "--bandwidth" in said[1]
    known, said = sensor_of(cut("base_Fz_N"), None, None, 30.0)
    assert (known.bandwidth, known.bandwidth_sd) == (30.0, 0.0) and not any("--bandwidth" in text for text in said)
    assert sensor_of(cut(), None, None)[0].bandwidth == math.inf
    sizes = [{n.name: n.sd for n in nuisances(cut("base_Fz_N"), sensor)} for sensor in (robot, Sensor())]
    delay = math.sqrt(2.0) / (2.0 * math.pi * TORQUE_BANDWIDTH)
    speed = cut().stroke_length_m / (cut().end_s - cut().onset_s)
    assert math.sqrt(sizes[0]["lag"] ** 2 - sizes[1].get("lag", 0.0) ** 2) == pytest.approx(0.5 * delay * speed)
    names = [n.name for n in nuisances(cut("base_Fz_N"), robot)]
    assert "bandwidth" in names and "bandwidth" not in [n.name for n in nuisances(cut("base_Fz_N"), known)]


def test_a_simulation_is_compared_through_the_sensors_low_pass() -> None:
    """That of the trace's kind, or the one that is given: a force that falls at once has another curve."""
    record = replace(made_cut().trace(), columns={"force": "base_Fz_N"})
    curves = []
    for bandwidth in (None, 30.0, 9e4):
        setup = set_up(Calibration("banana", record, bandwidth=bandwidth).request())
        target = setup.objective.target
        step = np.where(target.stroke < 0.5 * target.stroke[-1], 10.0, 0.0)
        curves.append(target.smooth(target.stroke, target.stroke, step))
        cut_off = TORQUE_BANDWIDTH if bandwidth is None else bandwidth
        want = BandLimited(cut_off, setup.curve.stroke, setup.curve.clock)(target.stroke, target.stroke, step)
        np.testing.assert_array_equal(curves[-1], want)
        assert setup.bandwidth == cut_off and any("--bandwidth" in text for text in setup.assumed) is (
            bandwidth is None
        )
    slopes = [float(np.max(-np.diff(curve))) for curve in curves]
    assert slopes[0] < slopes[1] < slopes[2]


def test_another_bandwidth_is_what_the_nuisance_says() -> None:
    """A curve whose low-pass is a fifth higher differs from that of the usual one along the nuisance, by a half to all
    of it: its own curve is the only one known, and went through the low-pass already."""
    curve = cut("base_Fz_N")
    peaked = 10.0 * np.exp(-(((curve.stroke / curve.stroke[-1] - 0.5) / 0.1) ** 2))
    middle, higher = (
        BandLimited(f, curve.stroke, curve.clock)(curve.stroke, curve.stroke, peaked) for f in (15.0, 18.0)
    )
    robot = sensor_of(curve, None, None)[0]
    (found,) = (n for n in nuisances(replace(curve, curve=middle), robot) if n.name == "bandwidth")
    change, said = higher - middle, math.log(1.2) * found.shape
    size = float(said @ change) / float(said @ said)
    assert 0.5 < size < 1.5 and np.linalg.norm(change - size * said) < 0.3 * np.linalg.norm(change)
    assert found.searched and found.peak == pytest.approx(found.shape[int(np.argmax(middle))])


def test_a_drift_is_not_extrapolated_without_end() -> None:
    """A short baseline says nothing of the drift over the cut: its standard deviation ends at a twentieth of the
    peak."""
    curve = replace(cut(), drift_sd_N_per_s=50.0)
    drift = next(n for n in nuisances(curve, Sensor()) if n.name == "drift")
    assert drift.sd == pytest.approx(0.05 * float(curve.curve.max()))


def study_of(folder: Path, **changes: Any) -> Path:
    """What cutcal converge leaves: two grids, 0.2 N of 10 N uncertain on the coarser one, growing to 0.4 N."""
    document = {"food": "banana", "knife": "kitchen", "grids": [{"dx_m": 3e-3}, {"dx_m": 2e-3}]} | changes
    (folder / "converge.json").write_text(json.dumps(document))
    stroke = np.linspace(0.0, 0.033, 240)
    columns = {
        "stroke_m": stroke,
        "force_dx_0.003_N": 10.0 * stroke / 0.033,
        "u_num_coarsest_N": 0.2 + 0.2 * stroke / 0.033,
    }
    pd.DataFrame(columns).to_csv(folder / "curves.csv", index=False)
    return folder


def test_numerical_uncertainty_enters_at_equal_parts_of_stroke_and_peak(tmp_path: Path) -> None:
    """2 to 4 % of the study's peak become 2 to 4 % of the trace's, and add to the errors of each point in squares."""
    curve, food = cut(), load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"), dx=3e-3)
    found = numerical_uncertainty(study_of(tmp_path), "banana", scene, curve)
    peak = float(curve.curve.max())
    assert found[[0, -1]] == pytest.approx([0.02 * peak, 0.04 * peak], rel=1e-6)
    plain = Objective(Target(curve.stroke, curve.curve, 0.0, 0.1, np.interp), ONE)
    wide = Objective(Target(curve.stroke, curve.curve, 0.0, 0.1, np.interp, found), ONE)
    assert wide.sigmas[-1] == pytest.approx(np.hypot(plain.sigmas[-1], 0.04 * peak))
    assert np.linalg.norm(wide.data_residual(0.8 * curve.curve)) < np.linalg.norm(
        plain.data_residual(0.8 * curve.curve)
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"food": "apple"}, "its food is apple, that of this calibration banana"),
        ({"knife": "edc"}, "its knife is edc"),
        ({"grids": [{"dx_m": 4e-3}]}, "force_dx_0.004_N"),
        ({"grids": []}, "no finished study"),
    ],
)
def test_a_study_of_something_else_is_refused(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    """Another food, knife or cell, or no study: one line that says so."""
    food = load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"), dx=3e-3)
    with pytest.raises(CutcalError, match=said):
        numerical_uncertainty(study_of(tmp_path, **changes), "banana", scene, cut())
