from __future__ import annotations

import numpy as np
import pytest
import taichi as ti

from mpm.kernels import cohesive_law, signed_distance
from mpm.runtime import Runtime, start
from mpm.state import stencil
from tests.mpm import twins

SPINE, ANGLE = 2e-3, 2 * np.deg2rad(5.5)


@pytest.fixture(scope="module")
def evaluate():
    """Run one contact law on up to eight numbers in f64."""
    start(Runtime(threads=1), "f64")
    inp, out = ti.field(ti.f64, 8), ti.field(ti.f64, 4)

    @ti.kernel
    def blade():
        d, n = signed_distance.blade_distance(inp[0], inp[1], inp[2], ti.cos(inp[3] / 2), ti.sin(inp[3] / 2), inp[4])
        out[0], out[1], out[2], out[3] = d, n[0], n[1], n[2]

    @ti.kernel
    def stick():
        s = signed_distance.stick_slip(
            ti.Vector([inp[0], inp[1], 0.0]),
            ti.Vector([inp[2], inp[3], 0.0]),
            ti.Vector([inp[4], inp[5], 0.0]),
            inp[6],
        )
        out[0], out[1], out[2] = s[0], s[1], s[2]

    @ti.kernel
    def level():
        out[0] = cohesive_law.softening_law(inp[0], inp[1], inp[2], inp[3])

    @ti.kernel
    def spline():
        out[0] = stencil.bspline(inp[0])

    kernels = {f.__name__: f for f in (blade, stick, level, spline)}

    def run(name: str, *values: float) -> np.ndarray:
        inp.from_numpy(np.array([*values, *[0.0] * (8 - len(values))]))
        kernels[name]()
        return out.to_numpy()

    return run


@pytest.mark.parametrize(("y", "z"), [(0.1e-3, 0.1e-3), (0.4e-3, 0.2e-3), (0.6e-3, 0.5e-3), (0.8e-3, 4e-3)])
def test_rounded_tip_is_a_circle_that_touches_the_faces(evaluate, y, z):
    """With a tip radius the distance is that to a circle at the edge and to the wedge's faces tangent to it."""
    r, half = 0.5e-3, ANGLE / 2
    tangent = np.array([r * np.cos(half), r - r * np.sin(half)])
    along = np.array([np.sin(half), np.cos(half)])
    face = tangent + np.linspace(0, 20e-3, 40001)[:, None] * along
    angle = np.linspace(-np.pi / 2, -half, 4001)
    arc = np.stack([r * np.cos(angle), r + r * np.sin(angle)], -1)
    outline = np.concatenate([arc, face])
    expected = np.sqrt(((outline - [y, z]) ** 2).sum(1)).min()
    got = evaluate("blade", y, z, 1.0, ANGLE, r)
    assert abs(got[0]) == pytest.approx(expected, abs=2e-6)
    assert np.linalg.norm(got[1:]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("y", [0.05e-3, 0.3e-3, 0.9e-3, 1.5e-3, 4e-3])
@pytest.mark.parametrize("z", [2e-3, 6e-3, 14e-3])
def test_blade_distance_is_the_distance_to_the_wedge(evaluate, y, z):
    """Distance and sign agree with a brute-force search over the outline, wherever the nearest point is on a face."""
    expected = twins.wedge(y, z, SPINE, ANGLE)
    got = evaluate("blade", y, z, SPINE, ANGLE)
    assert got[0] == pytest.approx(expected, abs=2e-6)
    assert np.linalg.norm(got[1:]) == pytest.approx(1.0, abs=1e-12)
    assert got[2] > 0


def test_blade_normal_is_the_gradient_of_the_distance(evaluate):
    """The normal points where the distance grows fastest."""
    y, z, h = 0.4e-3, 3e-3, 1e-8
    d, _, ny, nz = evaluate("blade", y, z, SPINE, ANGLE)
    assert (evaluate("blade", y + h, z, SPINE, ANGLE)[0] - d) / h == pytest.approx(ny, abs=1e-6)
    assert (evaluate("blade", y, z + h, SPINE, ANGLE)[0] - d) / h == pytest.approx(nz, abs=1e-6)


def test_friction_sticks_then_slides(evaluate):
    """Friction is the spring's pull, and the food's own traction; it saturates at the largest, in its direction."""
    np.testing.assert_allclose(evaluate("stick", 0, 0, 1e-6, 0, 0, 0, 5e-5)[:2], [-1e-6, 0])
    np.testing.assert_allclose(evaluate("stick", 0, 0, 0, 0, 2e-5, 0, 5e-5)[:2], [2e-5, 0])
    s = evaluate("stick", 4e-5, 0, 3e-5, 3e-5, 0, 0, 5e-5)[:2]
    assert np.linalg.norm(s) == pytest.approx(0.5e-4)
    assert s[1] / s[0] == pytest.approx(3 / 7)
    assert s[0] < 0


def test_edge_level_falls_from_start_to_resistance(evaluate):
    """The edge carries the starting force at no cut and the propagation resistance after many softening lengths."""
    assert evaluate("level", 0.0, 1e-3, 700.0, 150.0)[0] == pytest.approx(700)
    assert evaluate("level", 1e-3, 1e-3, 700.0, 150.0)[0] == pytest.approx(150 + 550 / np.e)
    assert evaluate("level", 2e-2, 1e-3, 700.0, 150.0)[0] == pytest.approx(150, rel=1e-6)


@pytest.mark.parametrize("r", [-2.0, -1.2, -0.3, 0.0, 0.49, 0.51, 1.4, 1.6])
def test_bspline_is_the_quadratic_b_spline(evaluate, r):
    """The process zone's weight is the quadratic B-spline."""
    assert evaluate("spline", r)[0] == pytest.approx(float(twins.bspline(r)), abs=1e-14)


def test_kink_is_averaged_by_a_hat():
    """The mean of a kink over a hat of half width 1, by quadrature; beyond it the kink itself."""
    out, inp = ti.field(ti.f64, 1), ti.field(ti.f64, 1)

    @ti.kernel
    def run():
        out[0] = signed_distance.kink(inp[0])

    x = np.linspace(-1.0, 1.0, 20001)
    for q in (-1.5, -0.7, 0.0, 0.4, 1.0, 2.5):
        inp[0] = q
        run()
        mean = np.trapezoid(np.maximum(0.0, q - x) * (1 - np.abs(x)), x)
        assert out[0] == pytest.approx(mean, abs=1e-8)
