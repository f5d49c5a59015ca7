"""Crack length under a wedge by energy release rate: elements with G = -dU/da, and the formula of a split beam."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fem_reference.cutting.case import Blade, Block, Grid
from fem_reference.cutting.halves import Halves
from fem_reference.solid import EquilibriumError
from fem_reference.surface import Tie

ROOT = 0.64  # way that an arm turns ahead of the crack's tip, over its height (Kanninen 1973)


def beam_release_rate(
    modulus: float, arm: float, opening: float, length: float | np.ndarray, root: float = ROOT
) -> float | np.ndarray:
    """Energy release rate of a beam that is split along its middle and held open by a wedge.

    Each arm is a cantilever of height h and unit width, whose end a force P bends by half the opening D: with I =
    h^3/12, ``P = 3 E I (D/2) / a^3``, both arms store ``U = P D/2 = E h^3 D^2 / (16 a^3)``, and at a fixed opening
    ``G = -dU/da = 3 E h^3 D^2 / (16 a^4)`` (Gurney and Hunt 1967, whose wedge is this one). The arms are clamped by
    what is not split yet, which gives way: a is longer by a part of h (Kanninen 1973; Williams 1989).

    Args:
        modulus: E, in plane strain E / (1 - nu^2) [Pa].
        arm: Height of an arm h [m].
        opening: Thickness of the wedge where it touches D [m].
        length: Way from there to the crack's tip a [m], scalar or shape (n,).
        root: Part of h that is added to a [-]; 0 for the plain formula.

    Returns:
        G [J/m^2], of the shape of ``length``.
    """
    return 3 * modulus * arm**3 * opening**2 / (16 * (length + root * arm) ** 4)


def beam_crack_length(modulus: float, arm: float, opening: float, toughness: float, root: float = ROOT) -> float:
    """Length at which :func:`beam_release_rate` is R.

    Args:
        modulus: E, in plane strain E / (1 - nu^2) [Pa].
        arm: Height of an arm [m].
        opening: Thickness of the wedge where it touches [m].
        toughness: R [J/m^2].
        root: Part of the arm's height that is added to the length [-].

    Returns:
        Way from where the wedge touches to the crack's tip [m].
    """
    return (3 * modulus * arm**3 * opening**2 / (16 * toughness)) ** 0.25 - root * arm


def energy_release(beam: Block, blade: Blade, depth: float, tips: Sequence[float], grid: Grid) -> np.ndarray:
    """Energy release rates of cracks of given tips under a blade at rest, by elements: G = -dU/da.

    The same model as :func:`fem_reference.cutting.wedge.split`, but for the plane: it is rigidly tied below the tip and
    free above, so that no cohesive law has a part in it. U is that of two cracks, one element longer and shorter.

    Args:
        beam: The split block; elastic.
        blade: The wedge, without friction.
        depth: Way of its edge below the top [m].
        tips: Heights of the crack's tip in the undeformed block [m], shape (n,); rounded to ends of elements.
        grid: Elements.

    Returns:
        G of both halves [J/m^2], shape (n,).

    Raises:
        EquilibriumError: No equilibrium, or the blade's faces rub.
    """
    model = _Cracked(beam, blade, depth, grid)
    rows = [round(tip / model.size) for tip in tips]
    energies = {row: model.energy(row) for row in sorted({r + k for r in rows for k in (-1, 1)}, reverse=True)}
    return np.array([(energies[row + 1] - energies[row - 1]) / (2 * model.size) for row in rows])


def crack_length(beam: Block, blade: Blade, depth: float, toughness: float, grid: Grid) -> tuple[float, float]:
    """Griffith's crack under a blade at rest: its energy release rate is R.

    Args:
        beam: The split block; elastic.
        blade: The wedge, without friction.
        depth: Way of its edge below the top [m].
        toughness: R [J/m^2].
        grid: Elements.

    Returns:
        Way from the blade's shoulder to the crack's tip [m], and the tip's height in the undeformed block [m].

    Raises:
        EquilibriumError: No equilibrium, the blade's faces rub, or no such crack ends in the block below the edge.
    """
    model = _Cracked(beam, blade, depth, grid)
    edge = beam.height - depth
    row = math.floor(edge / model.size)
    before, energies = (math.nan, math.nan), [model.energy(row + 1), model.energy(row)]
    while row > 1:
        energies.append(model.energy(row - 1))
        rate = (energies[-3] - energies[-1]) / (2 * model.size)
        if rate <= toughness:
            if math.isnan(before[0]):
                raise EquilibriumError("energy release: the crack does not reach beyond the edge")
            part = math.log(before[1] / toughness) / math.log(before[1] / rate)
            tip = before[0] + part * (row * model.size - before[0])
            return edge + blade.shoulder - model.now(tip), tip
        before, row = (row * model.size, rate), row - 1
    raise EquilibriumError("energy release: the crack runs through the block")


class _Cracked(Halves):
    """Halves under a blade at rest, tied below a row of elements."""

    def __init__(self, beam: Block, blade: Blade, depth: float, grid: Grid) -> None:
        if blade.friction:
            raise EquilibriumError("energy release: a blade with friction takes energy from the crack; give it none")
        super().__init__(beam, blade, grid)
        self.size = beam.height / round(beam.height / grid.size)
        self.wedge.height = beam.height - depth
        self._tie = Tie(self.points, 100 * self.modulus)
        self.solid.surfaces.insert(0, self._tie)

    def energy(self, row: int) -> float:
        """Energy of both halves with the crack's tip at the lower end of a row of elements [J/m]."""
        self._tie.on = self.height < (row + 0.25) * self.size
        self.solid.solve()
        return self.scale * (self.solid.energy(self.solid.u) + self._tie.energy(self.x)) + self.springs
