"""What is cut, with what and how finely, and what comes of it: input and result of
:mod:`fem_reference.cutting.wedge`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fem_reference.laws import Corotated, Linear, NeoHookean, Plastic
from mpm.scene.errors import CutcalError

TIE = 100.0  # stiffness of the tie over the food's P-wave modulus and the size of the elements

Flesh = Linear | Corotated | NeoHookean | Plastic


class CutCaseError(CutcalError):
    """A cut that is impossible as it is described."""


@dataclass(frozen=True)
class Block:
    """A food that is parted in its middle.

    Attributes:
        length: Across the blade, both halves [m].
        height: [m].
        law: Material law of the flesh.
        held: Whether the base stays on the board; else it may lift, and the board only pushes. It slides either way.
        width: Along the blade, with free ends [m]; None for plane strain. Results are per metre of width either way.
    """

    length: float
    height: float
    law: Flesh
    held: bool = False
    width: float | None = None


@dataclass(frozen=True)
class Blade:
    """A symmetric wedge up to its thickness, with parallel faces above it.

    Attributes:
        angle: Angle between its faces [rad].
        thickness: [m].
        friction: Coulomb's coefficient on its faces [-].
        rounding: Radius of the shoulder [m]; None: half the thickness. A sharp one would dent the food without limit as
            elements become smaller.
    """

    angle: float
    thickness: float
    friction: float = 0.0
    rounding: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.angle < math.pi:
            raise CutCaseError(f"blade: an angle of {math.degrees(self.angle):g} degrees is none of a wedge; 0 to 180")
        if self.rounding is not None and not 0 < 2 * self.rounding <= self.thickness:
            raise CutCaseError("blade: round the shoulder with a radius above 0 and up to half the thickness")

    @property
    def fillet(self) -> float:
        """Radius of the shoulder [m]."""
        return self.thickness / 2 if self.rounding is None else self.rounding

    @property
    def shoulder(self) -> float:
        """Height of the shoulder above the edge [m]."""
        return self.thickness / 2 / math.tan(self.angle / 2)


@dataclass(frozen=True)
class Interface:
    """What holds the halves together.

    Attributes:
        toughness: Work of new surface R [J/m^2].
        strength: Cohesive strength [Pa].
        band: Height over which the edge cuts [m]; None: two elements.
        tie: Stiffness of the tie before its strength, over the food's modulus and the size of the elements.
    """

    toughness: float
    strength: float
    band: float | None = None
    tie: float = TIE

    def __post_init__(self) -> None:
        if not min(self.toughness, self.strength, self.tie) > 0:
            raise CutCaseError("interface: toughness, strength and stiffness of the tie must be above 0")


@dataclass(frozen=True)
class Grid:
    """Elements of one half.

    Attributes:
        size: Their height, and their width at the plane [m].
        growth: Width of each over that of its neighbour nearer to the plane, until four times ``size``.
        mixed: Elements that do not lock, for plastic flow or little compressibility.
        layers: Elements along half the width, where the block has one.
    """

    size: float
    growth: float = 1.3
    mixed: bool = False
    layers: int = 2


@dataclass(frozen=True, eq=False)
class Cut:
    """What happens over the stroke, of both halves and per metre of width. Heights are above the board.

    Attributes:
        stroke: Way of the edge below the top [m], shape (n,).
        force: Force down on the blade [N/m], shape (n,): faces and edge. It ripples as elements pass the shoulder.
        edge: Part of it on the edge [N/m], shape (n,).
        tip: Height of the crack's tip, where tie and edge have taken half of R [m], shape (n,).
        reference_tip: Height of the same point in the undeformed block [m], shape (n,).
        stored: Elastic energy [J/m], shape (n,).
        flowed: Work of plastic flow [J/m], shape (n,).
        tied: Work that the tie has taken [J/m], shape (n,).
        parted: Work that the edge has taken [J/m], shape (n,).
        rubbed: Work of friction on the faces [J/m], shape (n,).
        board: Force down on the board [N/m], shape (n,).
        edge_height: Height of the edge [m], shape (n,).
        shoulder: Height of the blade's shoulder above its edge [m].
        unknowns: Number of unknown displacements.
    """

    stroke: np.ndarray
    force: np.ndarray
    edge: np.ndarray
    tip: np.ndarray
    reference_tip: np.ndarray
    stored: np.ndarray
    flowed: np.ndarray
    tied: np.ndarray
    parted: np.ndarray
    rubbed: np.ndarray
    board: np.ndarray
    edge_height: np.ndarray
    shoulder: float
    unknowns: int

    @property
    def crack_length(self) -> np.ndarray:
        """Way from the blade's shoulder down to the crack's tip [m], shape (n,)."""
        return self.edge_height + self.shoulder - self.tip

    @property
    def lead(self) -> np.ndarray:
        """Way of the crack's tip ahead of the edge [m], shape (n,)."""
        return self.edge_height - self.tip

    @property
    def work(self) -> np.ndarray:
        """Work of the blade [J/m], shape (n,), by the trapezium rule."""
        return np.concatenate([[0.0], np.cumsum(np.diff(self.stroke) * (self.force[1:] + self.force[:-1]) / 2)])

    @property
    def unbooked(self) -> np.ndarray:
        """Work that nothing has taken [J/m], shape (n,): what a crack that runs by itself sets free, and rounding."""
        return self.work - self.stored - self.flowed - self.tied - self.parted - self.rubbed

    def mean_force(self, low: float, high: float) -> float:
        """Mean force between two strokes [N/m]: work over way."""
        return float(np.diff(np.interp([low, high], self.stroke, self.work))[0]) / (high - low)

    def smoothed(self, window: float) -> np.ndarray:
        """Force at each stroke as the mean over a window about it [N/m], shape (n,); the window is cut at the ends."""
        low = np.maximum(self.stroke - window / 2, self.stroke[0])
        high = np.minimum(self.stroke + window / 2, self.stroke[-1])
        work = self.work
        return (np.interp(high, self.stroke, work) - np.interp(low, self.stroke, work)) / (high - low)
