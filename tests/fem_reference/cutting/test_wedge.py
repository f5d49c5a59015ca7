"""A wedge in a split beam and a blade through a block: Griffith's crack, R whoever pays it, and balanced books."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fem_reference.cutting.case import CutCaseError
from fem_reference.cutting.griffith import beam_crack_length, beam_release_rate, crack_length, energy_release
from fem_reference.cutting.wedge import Blade, Block, Cut, Grid, Interface, cut, split
from fem_reference.laws import Corotated, Linear, Plastic
from fem_reference.solid import EquilibriumError

E, NU, R = 9.5e6, 0.3, 87.0
MU, LAM = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
FLESH = Linear(MU, LAM)
TIE = Interface(toughness=R, strength=0.3e6)
THICK = Blade(angle=math.radians(22), thickness=2e-3)
BEAM = Block(length=0.016, height=0.05, law=FLESH, held=True)
BLOCK = Block(length=0.03, height=0.03, law=FLESH)
GRID = Grid(size=1e-3)


def rate(result: Cut, column: np.ndarray, low: float, high: float) -> float:
    """Mean rise of an energy over the stroke [J/m^2]."""
    return float(np.diff(np.interp([low, high], result.stroke, column))[0]) / (high - low)


@pytest.mark.parametrize("slenderness", [4, 8])
def test_long_arms_have_the_release_rate_of_beams(slenderness: int):
    """Within 2 % of 3 E D^2 h^3 / (16 (a + 0.64 h)^4), which the plain formula is not."""
    arm, depth = 6e-3, 0.012
    tip = 0.1 - depth + THICK.shoulder - slenderness * arm
    tip = round(tip / GRID.size) * GRID.size
    (got,) = energy_release(Block(2 * arm, 0.1, FLESH, held=True), THICK, depth, [tip], GRID)
    a, modulus = 0.1 - depth + THICK.shoulder - tip, E / (1 - NU**2)
    assert got == pytest.approx(beam_release_rate(modulus, arm, THICK.thickness, a), rel=0.02)
    assert got < 0.8 * beam_release_rate(modulus, arm, THICK.thickness, a, root=0.0)
    assert beam_crack_length(modulus, arm, THICK.thickness, float(got)) == pytest.approx(a, rel=0.006)


def test_a_wedge_in_a_split_beam():
    """The crack runs ahead at constant length, near Griffith's; the force is R, and the tie takes R per new area."""
    found = split(BEAM, THICK, TIE, 0.02, GRID)
    low, high = 0.013, 0.02
    length = found.crack_length[(found.stroke > low)]
    want, _ = crack_length(BEAM, THICK, high, R, GRID)
    assert length.std() < 0.01 * length.mean()
    assert length.mean() == pytest.approx(want, rel=0.04)
    assert length.mean() < want  # a weak tie opens ahead of the tip and lets the arms turn there
    assert found.mean_force(low, high) == pytest.approx(R, rel=0.02)
    assert rate(found, found.tied, low, high) == pytest.approx(R, rel=0.02)
    assert abs(rate(found, found.unbooked, low, high)) < 0.02 * R
    assert (found.edge == 0).all() and (found.parted == 0).all()
    np.testing.assert_allclose(found.board, found.force, rtol=1e-4, atol=0.01)


@pytest.mark.parametrize(("angle", "edge"), [(2.5, (75, 85)), (11, (11, 15)), (22, (0, 0.01))])
def test_tie_and_edge_together_take_the_toughness(angle: float, edge: tuple[float, float]):
    """Of a long beam, steadily, under any blade: a thin one cuts, a thick one splits ahead of its edge."""
    beam = Block(length=0.024, height=0.05, law=FLESH, held=True)
    found = cut(beam, replace(THICK, angle=math.radians(angle)), TIE, 0.024, Grid(2e-3))
    low, high = 0.016, 0.024
    tied, parted = (rate(found, column, low, high) for column in (found.tied, found.parted))
    assert tied + parted == pytest.approx(R, rel=0.02)
    assert edge[0] <= parted <= edge[1]
    assert found.mean_force(low, high) == pytest.approx(R + rate(found, found.stored, low, high), rel=0.03)


def test_a_cut_block_does_not_follow_tie_band_or_elements():
    """Work to 12 mm, and the books: the board carries the blade, and what nobody took is little."""
    blade = replace(THICK, angle=math.radians(11))
    base = cut(BLOCK, blade, TIE, 0.012, GRID)
    np.testing.assert_allclose(base.board, base.force, rtol=1e-4, atol=0.01)
    assert abs(base.unbooked[-1]) < 0.01 * base.work[-1]
    for other in (replace(TIE, tie=300.0), replace(TIE, band=4e-3)):
        assert cut(BLOCK, blade, other, 0.012, GRID).work[-1] == pytest.approx(base.work[-1], rel=0.01)
    coarse = cut(BLOCK, blade, TIE, 0.012, Grid(2e-3))
    assert coarse.work[-1] == pytest.approx(base.work[-1], rel=0.02)
    assert coarse.smoothed(4e-3).max() == pytest.approx(base.smoothed(4e-3).max(), rel=0.02)


def test_friction_adds_what_it_rubs():
    """The work that friction adds is booked as friction; the crack hardly knows."""
    blade = Blade(math.radians(11), 2e-3)
    smooth, rough = (cut(BLOCK, replace(blade, friction=mu), TIE, 0.01, Grid(2e-3)) for mu in (0.0, 0.2))
    assert (smooth.rubbed == 0).all()
    assert rough.rubbed[-1] > 0.5 * smooth.work[-1]
    assert abs(rough.unbooked[-1]) < 0.02 * rough.work[-1]
    assert rough.crack_length[-1] == pytest.approx(smooth.crack_length[-1], rel=0.02)


def test_small_strains_are_enough_for_a_stiff_block():
    """The particles' finite-strain law gives the same work to 1 %."""
    blade = Blade(math.radians(11), 2e-3)
    linear = cut(BLOCK, blade, TIE, 0.006, Grid(2e-3))
    large = cut(replace(BLOCK, law=Corotated(MU, LAM)), blade, TIE, 0.006, Grid(2e-3))
    assert large.work[-1] == pytest.approx(linear.work[-1], rel=0.01)
    assert large.work[-1] != linear.work[-1]


def test_a_block_of_finite_width_lies_between_plane_stress_and_plane_strain():
    """Without lateral contraction it is its section; with it, narrow is plane stress and wide near plane strain."""
    blade, grid = Blade(math.radians(11), 2e-3), Grid(2.5e-3)

    def work(law: Linear, width: float | None = None) -> float:
        found = cut(replace(BLOCK, law=law, width=width), blade, TIE, 5e-3, grid)
        np.testing.assert_allclose(found.board, found.force, rtol=1e-4, atol=0.01)
        return float(found.work[-1])

    straight = Linear(E / 2, 0.0)
    assert work(straight, 0.03) == pytest.approx(work(straight), rel=1e-4)
    stress, strain = work(Linear(MU, 2 * LAM * MU / (LAM + 2 * MU))), work(FLESH)
    narrow, wide = work(FLESH, 0.004), work(FLESH, 0.1)
    assert narrow == pytest.approx(stress, rel=3e-3)
    assert wide == pytest.approx(strain, rel=8e-3)
    assert strain / stress > 1.02


@pytest.mark.slow
def test_a_block_that_flows_books_its_flow():
    """With a yield stress below the tie's strength the work of the cut has one more part; new surface still costs R."""
    blade = Blade(math.radians(11), 2e-3)
    flowing = replace(BLOCK, law=Plastic(MU, LAM, 0.14e6))
    found = cut(flowing, blade, TIE, 0.008, Grid(2e-3, mixed=True))
    elastic = cut(BLOCK, blade, TIE, 0.008, Grid(2e-3))
    assert found.flowed[-1] > 0.05 * found.work[-1]
    assert (np.diff(found.flowed) > -1e-3 * found.work[-1]).all()
    assert abs(found.unbooked[-1]) < 0.02 * found.work[-1]
    assert (found.lead[-1] < elastic.lead[-1]) and (elastic.flowed == 0).all()


@pytest.mark.slow
def test_a_stronger_tie_comes_to_griffiths_crack():
    """The crack's length tends to that without a cohesive zone. The edge of this wedge reaches the zone of ties of less
    than 0.2 MPa, which is refused: there the edge would have to pay a part."""
    want, _ = crack_length(BEAM, THICK, 0.016, R, Grid(0.5e-3))
    off = [
        1 - cut(BEAM, THICK, replace(TIE, strength=strength), 0.016, GRID).crack_length[-1] / want
        for strength in (0.15e6, 0.3e6, 0.45e6)
    ]
    assert off[0] > 2 * off[1] > 0
    assert off[1] > off[2] and abs(off[2]) < 0.02


def test_errors_of_cuts_say_what_to_do():
    """An edge that comes to the end of the split, rubbing faces where energy is released, cracks that are none."""
    with pytest.raises(EquilibriumError, match="make a deeper notch"):
        split(BEAM, Blade(math.radians(2.5), 2e-3), TIE, 0.01, Grid(2.5e-3), notch=5e-3)
    with pytest.raises(EquilibriumError, match="give it none"):
        crack_length(BEAM, replace(THICK, friction=0.1), 0.02, R, GRID)
    with pytest.raises(EquilibriumError, match="not reach beyond the edge"):
        crack_length(BEAM, Blade(math.radians(2.5), 2e-3), 0.02, R, Grid(2.5e-3))
    with pytest.raises(EquilibriumError, match="runs through"):
        crack_length(BEAM, THICK, 0.02, 1e-3, Grid(2.5e-3))
    with pytest.raises(CutCaseError, match="up to half the thickness"):
        Blade(math.radians(11), 1e-3, rounding=1e-3)
    with pytest.raises(CutCaseError, match="0 to 180"):
        Blade(0.0, 2e-3)
    with pytest.raises(CutCaseError, match="above 0"):
        Interface(R, 0.0)
    with pytest.raises(EquilibriumError, match="make it stiffer"):
        cut(BLOCK, THICK, replace(TIE, tie=1e-4), 0.01, GRID)
