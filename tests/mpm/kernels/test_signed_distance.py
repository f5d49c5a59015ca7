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


HALF = ANGLE / 2
ARC_TO_TANGENT = 0.5 * SPINE * np.cos(HALF) ** 2 / np.sin(HALF)  # height above the edge where the shoulder's arc begins


@pytest.mark.parametrize(
    ("y", "above", "distance", "normal"),
    [
        (2e-3, 3e-3, 2e-3 * np.cos(HALF) - 3e-3 * np.sin(HALF), (np.cos(HALF), -np.sin(HALF))),  # the wedge
        (1.5e-3, 30e-3, 0.5e-3, (1.0, 0.0)),  # the parallel faces
        (0.0, 41.5e-3, 0.5e-3, (0.0, 1.0)),  # above the back, which is half round
        (1e-3, 41e-3, np.sqrt(2) * 1e-3 - 1e-3, (np.sqrt(0.5), np.sqrt(0.5))),
        (0.5e-3, 40e-3, -0.5e-3, (1.0, 0.0)),  # where the back begins it is as thick as the spine
    ],
)
def test_rounded_blade(rounded, y, above, distance, normal):
    """A blade 2 mm thick and 40 mm high: the wedge, its parallel faces, and a back that is half round."""
    d, n = rounded(y, above)
    assert d == pytest.approx(distance, abs=1e-12)
    np.testing.assert_allclose(n, normal, atol=1e-12)


def test_the_shoulder_is_an_arc_that_touches_both_faces(rounded):
    """Distance and normal go over from the wedge to the arc and on to the parallel face without a step."""
    middle = 0.5 * SPINE / np.sin(HALF)
    for height in (ARC_TO_TANGENT, middle):
        below, above = rounded(1e-3, height - 1e-9), rounded(1e-3, height + 1e-9)
        assert below[0] == pytest.approx(above[0], abs=1e-8)
        np.testing.assert_allclose(below[1], above[1], atol=1e-5)
    between = 0.5 * (ARC_TO_TANGENT + middle)
    d, n = rounded(1e-3, between)
    assert d == pytest.approx(np.hypot(1e-3, between - middle) - 0.5 * SPINE, abs=1e-12)
    assert np.hypot(*n) == pytest.approx(1.0)


@pytest.fixture(scope="module")
def rounded():
    """Distance and normal (across, up) of a rounded blade 40 mm high, or as high as its shoulder lies."""
    out, inp = ti.field(ti.f64, 3), ti.field(ti.f64, 2)

    @ti.kernel
    def run():
        d, n = signed_distance.rounded_blade_distance(inp[0], inp[1], SPINE, ti.cos(HALF), ti.sin(HALF), 0.0, 40e-3)
        out[0], out[1], out[2] = d, n[1], n[2]

    def call(y: float, above: float):
        inp[0], inp[1] = y, above
        run()
        return out[0], (out[1], out[2])

    return call
