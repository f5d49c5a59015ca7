"""Sobol indices: a closed form, SALib's own values, a surrogate whose indices are known, and a light import."""

from __future__ import annotations

import math
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as sampling

from calib.fit.multistart import multistart_search
from calib.fit.options import FitOptions
from calib.uncertainty.sobol import indices, quantities, sensitivity
from tests.calib.fake import FIVE, Fake, goal
from tests.data_dir import ROOT

PI3 = np.array([[-math.pi] * 3, [math.pi] * 3])


def ishigami(x: np.ndarray) -> np.ndarray:
    """Ishigami and Homma's function with a = 7, b = 0.1."""
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_indices_of_ishigami_are_the_closed_form() -> None:
    """First-order and total indices of Ishigami's function to 0.02, five per cent of the largest."""
    a, b = 7.0, 0.1
    total = a**2 / 8 + b * math.pi**4 / 5 + b**2 * math.pi**8 / 18 + 0.5
    v1, v2, v13 = 0.5 * (1 + b * math.pi**4 / 5) ** 2, a**2 / 8, 8 * b**2 * math.pi**8 / 225
    got = indices(("x", "y", "z"), PI3, lambda x: {"f": ishigami(x)}, base=4096)["f"]
    for name, first, whole in (("x", v1, v1 + v13), ("y", v2, v2), ("z", 0.0, v13)):
        assert got[name]["first"] == pytest.approx(first / total, abs=0.02)
        assert got[name]["total"] == pytest.approx(whole / total, abs=0.02)


def test_indices_are_those_of_salib() -> None:
    """The same samples and seed give SALib's own values, in the order of the parameters."""
    problem = {"num_vars": 3, "names": ["x", "y", "z"], "bounds": PI3.T}
    points = sampling.sample(problem, 128, calc_second_order=False, seed=5)
    own = analysis.analyze(problem, ishigami(points), calc_second_order=False, seed=6)
    got = indices(("x", "y", "z"), PI3, lambda x: {"f": ishigami(x)}, seed=5)["f"]
    for k, name in enumerate("xyz"):
        assert got[name]["first"] == pytest.approx(own["S1"][k], rel=1e-12)
        assert got[name]["total"] == pytest.approx(own["ST"][k], rel=1e-12)
        assert got[name]["total_conf"] == pytest.approx(own["ST_conf"][k], rel=1e-12)


def test_quantities_of_a_known_curve() -> None:
    """A ramp of 2 N over 40 mm has its peak, work and slope; the slope is that of the first fifth alone."""
    stroke = np.linspace(0.0, 0.04, 241)
    ramp = 50.0 * stroke
    late = np.where(stroke > 0.0081, 9.0, ramp)
    got = quantities(stroke, np.array([ramp, late]))
    assert got["peak"] == pytest.approx([2.0, 9.0])
    assert got["work"][0] == pytest.approx(0.04)
    assert got["initial_slope"] == pytest.approx([50.0, 50.0])


def test_indices_of_a_surrogate_that_is_known() -> None:
    """A curve whose peak is 3 a + b in box coordinates: b has a tenth of its variance, and only c moves the slope."""
    objective = goal({p.name: p.value for p in FIVE})
    mean = [p.prior_mean for p in FIVE]
    sd = [p.prior_sd for p in FIVE]
    parts = np.linspace(0.0, 1.0, 240)

    def predict(z: np.ndarray) -> tuple[np.ndarray, float, float]:
        a, b, c = ((z - mean) / sd)[:3]
        late = np.where(parts > 0.5, 100.0 + 3.0 * a + b, 0.0)
        return np.where(parts <= 0.2, (10.0 + c) * parts, late), 0.0, 1.0

    result = SimpleNamespace(surrogate=SimpleNamespace(each=[SimpleNamespace(predict=predict)]))
    got = sensitivity(objective, result)
    first, second, third = FIVE.names[:3]
    assert got["peak"][first]["total"] == pytest.approx(0.9, abs=0.05)
    assert got["peak"][second]["total"] == pytest.approx(0.1, abs=0.03)
    assert got["initial_slope"][third]["first"] == pytest.approx(1.0, abs=0.05)
    assert got["peak"][third]["total"] == pytest.approx(0.0, abs=1e-9)


def test_a_fit_says_what_moved_it_and_a_constant_says_nothing() -> None:
    """A surrogate of real runs gives finite indices, repeatably; without one there are none; a constant has none."""
    objective = goal({p.name: p.value for p in FIVE})
    result = multistart_search(objective, Fake(), options=FitOptions(budget=30, batch=1, seed=0))
    got = sensitivity(objective, result)
    assert list(got) == ["peak", "work", "initial_slope"] and list(got["work"]) == list(FIVE.names)
    assert got == sensitivity(objective, result)
    assert got["initial_slope"]["E"]["total"] > got["initial_slope"]["mu"]["total"]
    assert sensitivity(objective, SimpleNamespace(surrogate=None)) == {}
    assert math.isnan(indices(("x", "y"), PI3[:, :2], lambda x: {"f": np.ones(len(x))})["f"]["x"]["total"])


def test_the_module_is_cheap_to_import() -> None:
    """SALib, and matplotlib with it, are loaded when indices are computed, not before."""
    code = "import sys, calib.uncertainty.sobol; assert not {'SALib', 'matplotlib', 'taichi'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
