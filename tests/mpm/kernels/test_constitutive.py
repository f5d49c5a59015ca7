from __future__ import annotations

import numpy as np
import pytest
import taichi as ti
from scipy.linalg import polar
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from mpm.kernels.constitutive import laws as law
from mpm.runtime import Runtime, start
from mpm.scene.material import Material
from tests.mpm import twins

M = Material(E=1.0, nu=0.35, rho=1.0)


@pytest.fixture(scope="module")
def evaluate():
    """Run one law on a matrix in f64 and return it as NumPy."""
    start(Runtime(threads=1), "f64")
    inp, out = ti.Matrix.field(3, 3, ti.f64, ()), ti.Matrix.field(3, 3, ti.f64, ())
    par = ti.field(ti.f64, 4)

    @ti.kernel
    def stretch():
        for _ in range(1):  # Taichi cannot break out of an outermost loop
            f = inp[None]
            out[None] = law.full(law.left_stretch(law.left_cauchy_green(f), f.determinant()))

    @ti.kernel
    def returned():
        for _ in range(1):
            v = law.upper(inp[None])
            xx, yy, zz, yz, xz, xy = law.deviator_stress(v[0], v[1], v[2], v[3], v[4], v[5], par[0])
            mises2 = law.mises_squared(xx, yy, zz, yz, xz, xy)
            out[None] = law.full(law.j2_return_one(v, law.determinant(v), mises2, par[0], par[1]))

    @ti.kernel
    def eigen():
        out[None][0, 0] = law.largest_eigenvalue(law.upper(inp[None]))

    @ti.kernel
    def damaged():
        out[None] = law.full(law.degrade(law.upper(inp[None]), par[0]))

    @ti.kernel
    def inverse():
        a = law.upper(inp[None])
        out[None] = law.full(law.cofactor(a) / law.determinant(a))

    @ti.kernel
    def softening():
        out[None][0, 0] = law.damage_of(par[0], par[1], par[2])

    kernels = {f.__name__: f for f in (stretch, returned, eigen, damaged, inverse, softening)}

    def run(name: str, matrix: np.ndarray | None = None, *values: float) -> np.ndarray:
        inp[None] = np.eye(3) if matrix is None else matrix
        par.from_numpy(np.array([*values, *[0.0] * (4 - len(values))]))
        kernels[name]()
        return out.to_numpy()

    return run


def random_f(rng: np.random.Generator, size: float) -> np.ndarray:
    """A deformation gradient with strains up to ``size`` and any rotation."""
    return Rotation.random(random_state=rng.integers(1 << 31)).as_matrix() @ (
        np.eye(3) + rng.uniform(-size, size, (3, 3))
    )


def test_left_stretch_agrees_with_scipy(evaluate):
    """V is the left polar factor: 1e-12 unstrained and at 15 % strain, 1e-10 at stretches of 0.2 to 3."""
    rng = np.random.default_rng(0)
    for f in [np.eye(3), *(random_f(rng, size) for size in (1e-6, 1e-2, 0.15) for _ in range(20))]:
        np.testing.assert_allclose(evaluate("stretch", f), polar(f, side="left")[1], atol=1e-12)
    for k in range(10):
        turn = Rotation.random(random_state=k).as_matrix()
        f = turn.T @ np.diag([0.2, 1.3, 3.0]) @ turn @ Rotation.random(random_state=k + 50).as_matrix()
        np.testing.assert_allclose(evaluate("stretch", f), polar(f, side="left")[1], atol=1e-10)


@pytest.mark.parametrize("stretches", [(50.0, 0.02, 0.02), (50.0, 50.0, 0.02), (0.02, 0.02, 0.02)])
def test_left_stretch_of_a_crushed_element(evaluate, stretches):
    """Stretches as no food survives still give V, to 1e-6 of the largest: the run ends by its audit, not by a NaN."""
    turn = Rotation.random(random_state=1).as_matrix()
    f = turn.T @ np.diag(stretches) @ turn
    np.testing.assert_allclose(evaluate("stretch", f), f, atol=1e-6 * max(stretches))


def test_symmetric_inverse(evaluate):
    """Cofactor over determinant is the inverse."""
    a = np.array([[2.0, 0.3, -0.2], [0.3, 1.5, 0.4], [-0.2, 0.4, 0.9]])
    np.testing.assert_allclose(evaluate("inverse", a) @ a, np.eye(3), atol=1e-14)


@pytest.mark.parametrize(("stretch", "lateral", "nominal"), [(0.95, 1.01784, -0.05119), (0.7, 1.11636, -0.35968)])
def test_uniaxial_stress_of_the_corotated_law(stretch, lateral, nominal):
    """Uniaxial stress has the lateral stretch and nominal stress of the closed form (E = 1, nu = 0.35)."""

    def side(s: float) -> float:
        return twins.kirchhoff(np.diag([stretch, s, s]), M.shear, M.lame)[1, 1]

    s = brentq(side, 0.9, 1.3)
    tau = twins.kirchhoff(np.diag([stretch, s, s]), M.shear, M.lame)
    assert s == pytest.approx(lateral, abs=1e-5)
    assert tau[0, 0] / stretch == pytest.approx(nominal, abs=1e-5)


def test_stress_is_the_derivative_of_the_energy():
    """tau = dpsi/dF F^T by central differences: stress and reported energy belong together."""
    f = random_f(np.random.default_rng(1), 0.2)
    p, h = np.zeros((3, 3)), 1e-6
    for i in range(3):
        for j in range(3):
            d = np.zeros((3, 3))
            d[i, j] = h
            p[i, j] = (twins.energy(f + d, M.shear, M.lame) - twins.energy(f - d, M.shear, M.lame)) / (2 * h)
    np.testing.assert_allclose(p @ f.T, twins.kirchhoff(f, M.shear, M.lame), atol=1e-8)


@pytest.mark.parametrize("ratio", [0.01, 0.03, 0.1])
def test_j2_return_lands_on_the_yield_surface(evaluate, ratio):
    """The corotated stress itself yields at sigma_y (the log-strain return overshoots by 0.6, 2.0 and 7.4 %), volume is
    kept, and the direction of the deviator stays."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        a = rng.uniform(-0.3, 0.3, (3, 3))
        s = np.eye(3) + (a + a.T) / 2
        if twins.mises(twins.kirchhoff(s, M.shear, M.lame)) < ratio:
            continue
        back = evaluate("returned", s, M.shear, ratio)
        assert twins.mises(twins.kirchhoff(back, M.shear, M.lame)) == pytest.approx(ratio, rel=1e-5)
        assert np.linalg.det(back) == pytest.approx(np.linalg.det(s), rel=1e-6)
        d0, d1 = (x - np.trace(x) / 3 * np.eye(3) for x in (s, back))
        assert np.sum(d0 * d1) / np.linalg.norm(d0) / np.linalg.norm(d1) > 1 - 1e-9


def test_simple_shear_yields_at_sigma_y_over_root_three(evaluate):
    """The shear stress of a sheared element saturates at sigma_y / sqrt(3)."""
    sy, f = 0.02, np.eye(3)
    step = np.eye(3) + np.array([[0, 1e-3, 0], [0, 0, 0], [0, 0, 0]])
    for _ in range(60):
        f = step @ f
        r, s = polar(f)
        if twins.mises(twins.kirchhoff(f, M.shear, M.lame)) > sy:
            f = r @ evaluate("returned", (s + s.T) / 2, M.shear, sy)
    assert twins.kirchhoff(f, M.shear, M.lame)[0, 1] == pytest.approx(sy / np.sqrt(3), rel=2e-3)


def test_elastic_state_is_not_returned(evaluate):
    """Below the yield stress the return is the identity."""
    s = np.eye(3) + 1e-3 * np.diag([1, -1, 0])
    np.testing.assert_array_equal(evaluate("returned", s, M.shear, 1.0), s)


def test_largest_eigenvalue_agrees_with_numpy(evaluate):
    """The driver of bulk damage is the largest principal strain, also for repeated eigenvalues."""
    rng = np.random.default_rng(3)
    samples = [a + a.T for a in rng.normal(size=(30, 3, 3))] + [np.eye(3), np.diag([2.0, 2.0, 1.0])]
    for a in samples:
        assert evaluate("eigen", a)[0, 0] == pytest.approx(np.linalg.eigvalsh(a)[-1], abs=1e-7)


@pytest.mark.parametrize("band", [1e-3, 2.5e-3, 5e-3])
def test_damage_dissipates_the_fracture_energy(evaluate, band):
    """The area under the softening curve times the band width is Gf for every band width (0.1 %)."""
    e_mod, sigma_t, gf = 3e6, 2e5, 100.0
    eps0 = sigma_t / e_mod
    eps_f = eps0 / 2 + gf / (sigma_t * band)
    kappa = np.concatenate([np.linspace(0, eps0, 50), eps0 + (eps_f - eps0) * np.linspace(0, 14, 1500)[1:]])
    stress = np.array([(1 - evaluate("softening", None, k, eps0, eps_f)[0, 0]) * e_mod * k for k in kappa])
    assert stress.max() == pytest.approx(sigma_t, rel=1e-6)
    assert np.trapezoid(stress, kappa) * band == pytest.approx(gf, rel=1e-3)


def test_damage_keeps_compression(evaluate):
    """Full damage removes deviator and tensile pressure and leaves compressive pressure."""
    tension, compression = np.diag([3.0, 1.0, 2.0]), np.diag([-3.0, -1.0, -2.0])
    np.testing.assert_allclose(evaluate("damaged", tension, 1.0), 0, atol=1e-15)
    np.testing.assert_allclose(evaluate("damaged", compression, 1.0), -2 * np.eye(3), atol=1e-15)
