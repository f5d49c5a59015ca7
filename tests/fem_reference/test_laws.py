from __future__ import annotations

import numpy as np
import pytest

from fem_reference.laws import Corotated, Graded, NeoHookean, Plastic, determinant, mises, product
from tests.mpm import twins

MU, LAM, SY = 0.37, 0.86, 0.05
RNG = np.random.default_rng(0)
F = np.eye(3)[:, :, None] + RNG.uniform(-0.25, 0.25, (3, 3, 40))


@pytest.mark.parametrize("law", [Corotated(MU, LAM), NeoHookean(MU, LAM)])
def test_stress_and_tangent_are_derivatives(law):
    """P is the derivative of the energy and the tangent that of P, by central differences."""
    h = 1e-6
    p, _ = law.stress(F, None)
    a = law.tangent(F, None)
    for i in range(3):
        for j in range(3):
            d = np.zeros_like(F)
            d[i, j] = h
            np.testing.assert_allclose((law.energy(F + d) - law.energy(F - d)) / (2 * h), p[i, j], atol=1e-8)
            change = (law.stress(F + d, None)[0] - law.stress(F - d, None)[0]) / (2 * h)
            np.testing.assert_allclose(change, a[:, :, i, j], atol=1e-7)


def test_corotated_stress_is_that_of_the_particles():
    """The same law as the particle solver's, against its NumPy twin with SciPy's polar decomposition."""
    p, _ = Corotated(MU, LAM).stress(F)
    for k in range(F.shape[2]):
        np.testing.assert_allclose(p[:, :, k] @ F[:, :, k].T, twins.kirchhoff(F[:, :, k], MU, LAM), atol=1e-12)


def test_plastic_stress_is_that_of_the_particles():
    """A step from the undeformed state: elastic points as the elastic law, flowing ones on the yield surface, with the
    left stretch of the particles' return."""
    law = Plastic(MU, LAM, 4 * SY)
    p, state = law.stress(F, law.start((40,)))
    tau = np.einsum("ij...,kj...->ik...", p, F)
    size, trial = mises(tau), np.array([twins.mises(twins.kirchhoff(F[:, :, k], MU, LAM)) for k in range(40)])
    np.testing.assert_allclose(size[trial > 4 * SY], 4 * SY, rtol=1e-10)
    np.testing.assert_allclose(size[trial <= 4 * SY], trial[trial <= 4 * SY], rtol=1e-10)
    assert 0 < (trial <= 4 * SY).sum() < 40
    np.testing.assert_allclose(determinant(state), 1.0, rtol=1e-12)
    again, same = law.stress(F, state)
    np.testing.assert_allclose(again, p, atol=1e-10)
    np.testing.assert_allclose(same, state, atol=1e-10)


def test_plastic_path_unloads_elastically():
    """After flow the stress falls along the elastic slope and part of the deformation stays."""
    law, state = Plastic(MU, LAM, SY), Plastic(MU, LAM, SY).start((1,))
    stress = []
    for g in [*np.linspace(0, 0.2, 21), 0.199]:
        f = np.array([[1, g, 0], [0, 1, 0], [0, 0, 1.0]])[:, :, None]
        p, state = law.stress(f, state)
        stress.append(product(p, np.swapaxes(f, 0, 1))[0, 1, 0])
    assert max(stress) == pytest.approx(SY / np.sqrt(3), rel=2e-3)
    assert stress[-2] - stress[-1] == pytest.approx(1e-3 * MU, rel=0.03)
    assert np.abs(np.linalg.inv(state[:, :, 0]) - np.eye(3)).max() > 0.05


def test_a_point_on_the_yield_surface_stays_a_number():
    """States that were returned before lie above or below the yield stress by rounding; none becomes not a number."""
    law = Plastic(MU, LAM, SY)
    state = law.start((40,))
    for _ in range(4):
        p, state = law.stress(F, state)
        assert np.isfinite(p).all()
        assert np.isfinite(law.tangent(F, state)).all()


def test_a_graded_law_is_its_law_times_a_factor_at_each_point():
    """Stress, energy and tangent, with flow and without; all points yield at the strain of the law."""
    factor = RNG.uniform(0.1, 5.0, 40)
    law = Plastic(MU, LAM, SY)
    graded, state = Graded(law, factor), law.start((40,))
    for one, other in ((graded, law), (graded.elastic, law.elastic)):
        (p, after), (want, flowed) = one.stress(F, state), other.stress(F, state)
        np.testing.assert_allclose(p, factor * want)
        np.testing.assert_allclose(after, flowed)
        np.testing.assert_allclose(one.energy(F, after), factor * other.energy(F, flowed))
        np.testing.assert_allclose(one.tangent(F, state), factor * other.tangent(F, state))
    assert np.abs(graded.stress(F, state)[1] - state).max() > 0.01  # or nothing would flow
    np.testing.assert_allclose(graded.elastic.stress(F, state)[1], state, atol=1e-12)
