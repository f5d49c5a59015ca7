"""A block with a cohesive plane under a blade: equilibria over the stroke, and the books of their energies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fem_reference.cutting.case import Blade, Block, Cut, Grid, Interface
from fem_reference.cutting.cohesive import Cohesion, CutPlane
from fem_reference.cutting.halves import Halves
from fem_reference.laws import Plastic
from fem_reference.solid import EquilibriumError

STEP = 0.3819  # way of the blade in a step over the size of the elements: no simple part of it, so that no ripple hides
HALVINGS = 2  # how often a step that finds no equilibrium is halved
DRAGGED = 400  # proximal steps after which a plane that tears by itself must have come to rest
LOOSEN, TIGHTEN = 0.5, 8.0  # change of the drag after a proximal step that has found equilibrium, and after another
LOOSE = 1e-3  # drag below which none is tried, over the one that makes the plane's energy convex
HALF = 0.5  # part of R that the tie has taken, or the edge cut, at the crack's tip
FREE = 0.01  # part of R that a tie may have left above the edge of a wedge in a split
NEAR = 1e-6  # places nearer than this part of the height are the same


class CutModel(Halves):
    """Half a block with a cohesive plane of symmetry.

    Args:
        block: The food.
        blade: The blade.
        interface: What holds the halves together.
        grid: Elements.
        notch: Depth of a split that is there at the beginning [m], whose end the edge must not reach; None: the edge
            cuts.

    Attributes:
        plane: The tie, and the edge's work on it.
        toughness: R [J/m^2].
    """

    def __init__(
        self, block: Block, blade: Blade, interface: Interface, grid: Grid, notch: float | None = None
    ) -> None:
        super().__init__(block, blade, grid)
        self.block, self.blade, self.toughness, self.size = block, blade, interface.toughness, grid.size
        law = Cohesion(interface.toughness, interface.strength, interface.tie * self.modulus)
        band = interface.band or 2 * grid.size
        self.wedge.height = block.height + band / 2
        self.plane = CutPlane(self.points, law, self.wedge if notch is None else None, band)
        self.plane.cut[self.height > block.height - (notch or 0.0) + NEAR * block.height] = 1.0
        self.solid.surfaces.insert(0, self.plane)
        self.notched = notch is not None

    def run(self, depth: float) -> Cut:
        """Drive the blade down to a depth and note what happens."""
        start = self.wedge.height
        steps = math.ceil((start - self.block.height + depth) / (STEP * self.size))
        heights = np.linspace(start, self.block.height - depth, steps + 1)
        book = Books(self)
        for done, height in zip(heights[:-1], heights[1:], strict=True):
            try:
                self._advance(done, height)
            except EquilibriumError as e:
                raise EquilibriumError(f"{e} (edge {(self.block.height - height) * 1e3:.3g} mm deep)") from e
            book.note()
            if self.notched and self._reached():
                raise EquilibriumError(
                    "finite elements: the edge has come to the end of the split; make a deeper notch"
                )
        return book.cut()

    def _reached(self) -> bool:
        """Whether something above the edge is still tied."""
        left = (1 - self.plane.cut) * (1 - self.plane.spent(self.x) / self.toughness)
        return bool((left[self.points.at(self.x)[:, 2] > self.wedge.height] > FREE).any())

    def _advance(self, done: float, height: float, halvings: int = HALVINGS) -> None:
        try:
            self._to(height)
        except EquilibriumError:
            if halvings == 0:
                self._drag(height)
                return
            middle = 0.5 * (done + height)
            self._advance(done, middle, halvings - 1)
            self._advance(middle, height, halvings - 1)

    def _to(self, height: float) -> None:
        self.wedge.height = height
        self.solid.solve()

    def _drag(self, height: float) -> None:
        """Let the plane tear to the next equilibrium: proximal steps (Rockafellar 1976) with less and less drag."""
        most = self.plane.law.slope
        drag = most
        try:
            for _ in range(DRAGGED):
                self.plane.drag = drag
                try:
                    self._to(height)
                except EquilibriumError:
                    if drag == most:
                        raise
                    drag = min(max(drag, LOOSE * most) * TIGHTEN, most)
                    continue
                if drag == 0:
                    return
                drag = drag * LOOSEN if drag > LOOSE * most else 0.0
        finally:
            self.plane.drag = 0.0
        raise EquilibriumError("finite elements: the crack does not come to rest; use smaller elements")


class Moment(NamedTuple):
    """One equilibrium as :class:`Cut` has it."""

    stroke: float
    force: float
    edge: float
    tip: float
    reference_tip: float
    stored: float
    flowed: float
    tied: float
    parted: float
    rubbed: float
    board: float
    edge_height: float


class Books:
    """Energies added up from equilibrium to equilibrium, by the trapezium rule."""

    def __init__(self, model: CutModel) -> None:
        self.model = model
        self.tied = self.parted = self.rubbed = self.absorbed = 0.0
        self.last = self._now()
        self.moments = [self._moment()]

    def _now(self) -> _Instant:
        model = self.model
        x = model.x
        inner = model.solid.forces(model.solid.u)[0] if isinstance(model.block.law, Plastic) else np.zeros_like(x)
        spent, faces = model.plane.spent(x), model.faces
        return _Instant(x, model.wedge.height, spent, model.plane.cut, faces.rubbing(x), inner)

    def note(self) -> None:
        """Add what has happened since the last equilibrium."""
        now, last, model = self._now(), self.last, self.model
        each = model.scale / 2  # of what is said of both halves already, or is twice its mean
        areas, whole = model.points.areas, 1 - 0.5 * (now.cut + last.cut)
        self.tied += each * float((areas * whole * (now.spent - last.spent)).sum())
        left = model.toughness - 0.5 * (now.spent + last.spent)
        self.parted += each * float((areas * left * (now.cut - last.cut)).sum())
        slip = model.faces.points.at(now.x - last.x)
        slip[:, 2] -= now.height - last.height
        self.rubbed -= each * float((now.rubbing + last.rubbing).ravel() @ slip.ravel())
        self.absorbed += each * float((now.inner + last.inner).ravel() @ (now.x - last.x).ravel())
        self.last = now
        self.moments.append(self._moment())

    def _moment(self) -> Moment:
        model, now = self.model, self.last
        edge = -model.scale * float(model.plane.tractions(now.x)[:, 2].sum())
        elastic = model.scale * model.solid.energy(model.solid.u)
        reference = self._tip()
        return Moment(
            stroke=model.block.height - now.height,
            force=edge - model.scale * float(model.faces.tractions(now.x)[:, 2].sum()),
            edge=edge,
            tip=model.now(reference),
            reference_tip=reference,
            stored=elastic + model.springs,
            flowed=self.absorbed - elastic if isinstance(model.block.law, Plastic) else 0.0,
            tied=self.tied,
            parted=self.parted,
            rubbed=self.rubbed,
            board=model.board,
            edge_height=now.height,
        )

    def _tip(self) -> float:
        """Height of the crack's tip in the undeformed block [m]: above it, more than half of R is taken."""
        model, now = self.model, self.last
        taken, z = 1 - model.rows((1 - now.cut) * (1 - now.spent / model.toughness)), model.levels
        if not (taken > HALF).any():
            return float(z[-1])
        at = max(int(np.argmax(taken > HALF)), 1)
        return float(np.interp(HALF, taken[at - 1 : at + 1], z[at - 1 : at + 1]))

    def cut(self) -> Cut:
        """The books as one value."""
        columns = {
            name: np.array(column) for name, column in zip(Moment._fields, zip(*self.moments, strict=True), strict=True)
        }
        return Cut(**columns, shoulder=self.model.blade.shoulder, unknowns=self.model.solid.u.size)


@dataclass(frozen=True, eq=False)
class _Instant:
    """What the books need of one equilibrium: places [m], height of the edge [m], work of the tie [J/m^2], part that is
    cut, friction [N/m] on the points of the faces, forces inside the solid [N/m]."""

    x: np.ndarray
    height: float
    spent: np.ndarray
    cut: np.ndarray
    rubbing: np.ndarray
    inner: np.ndarray
