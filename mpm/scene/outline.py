"""Outlines that no closed form gives: tabulated sections of a food that is in one piece over any point of the board.

A section across the food, at a place v along y, reaches from ``left`` to ``right`` along x, and over each point of that
from ``bottom`` to ``top``. All are parts of the food's half length, half width and height, so that a table serves every
size. The places lie closer towards the ends and towards the flanks, at -cos of even angles: there the sections of round
foods grow as the root of the distance, and the table is straight.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from mpm.scene.errors import SceneError

ALONG = 129
"""Sections along the food."""
ACROSS = 97
"""Points across a section."""
SYMMETRY = 5e-3
"""An outline counts as its own mirror image, and is made so, where it differs by no more than this part of its half
width and height; less is asked near its rim, which is steep."""
FLAT = 0.01
"""The lower surface lies on the board below this part of the height."""
HALVED = 0.5
"""Part of the plan from which on a lower surface on the board is the face where the food was halved."""
SUMMED = 400  # points along and across at which a table is summed up


def places(count: int) -> np.ndarray:
    """Places of a table from -1 to 1, closer towards both ends, shape (count,)."""
    return -np.cos(np.pi * np.arange(count) / (count - 1))


@dataclass(frozen=True, eq=False)
class Sections:
    """The table of an outline.

    Attributes:
        left: Where each section begins along x, over the half width [-], shape (n,), at ``places(n)`` along y.
        right: Where it ends.
        bottom: Height of the lower surface over the food's height [-], shape (n, m), at ``places(m)`` from left to
            right.
        top: The same of the upper surface.
        bare: Whether the food was cut off at its first and its last section, whose faces then have no skin and no rind.

    Raises:
        SceneError: The arrays do not belong together, or have values outside the food's box.
    """

    left: np.ndarray
    right: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    bare: tuple[bool, bool] = (False, False)

    def __post_init__(self) -> None:
        n, m = self.bottom.shape
        arrays = (self.left, self.right, self.bottom, self.top)
        fits = self.left.shape == self.right.shape == (n,) and self.top.shape == (n, m) and min(n, m) > 2
        if not fits or not all(np.isfinite(a).all() and np.abs(a).max() < 1.02 for a in arrays):
            raise SceneError("shape: a table of sections must be finite, of one size, and lie in the food's box")
        if (self.right < self.left).any() or (self.top < self.bottom).any():
            raise SceneError("shape: a section ends before it begins; its lower surface must lie below the upper one")
        for on, mirrored in zip(self.symmetric, (self._mirrored_along, self._mirrored_across), strict=True):
            for name, other in zip(("left", "right", "bottom", "top"), mirrored(), strict=True):
                if on:
                    object.__setattr__(self, name, (getattr(self, name) + other) / 2)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sections) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the numbers of the table."""
        out = hashlib.sha256()
        for array in (self.left, self.right, self.bottom, self.top):
            out.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
        if any(self.bare):
            out.update(repr(self.bare).encode())
        return out.hexdigest()

    @cached_property
    def symmetric(self) -> tuple[bool, bool]:
        """Whether x = 0, and the plane across the food through its middle, are mirrors of it to :data:`SYMMETRY`."""
        own = (self.left, self.right, self.bottom, self.top)
        along, across = (np.sin(np.pi * np.arange(n) / (n - 1)) for n in self.bottom.shape)
        weights = (along, along, np.outer(along, across), np.outer(along, across))  # of the plan, nought on its rim

        def same(turned: tuple[np.ndarray, ...]) -> bool:
            pairs = zip(own, turned, weights, strict=True)
            return all(float((np.abs(a - b) * weight).max()) <= SYMMETRY for a, b, weight in pairs)

        return same(self._mirrored_along()), self.bare[0] == self.bare[1] and same(self._mirrored_across())

    def _mirrored_along(self) -> tuple[np.ndarray, ...]:
        """The arrays of the mirror image at x = 0."""
        return -self.right, -self.left, self.bottom[:, ::-1], self.top[:, ::-1]

    def _mirrored_across(self) -> tuple[np.ndarray, ...]:
        """The arrays of the mirror image at the middle of the length."""
        return self.left[::-1], self.right[::-1], self.bottom[::-1], self.top[::-1]

    def span(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where sections begin and end along x, over the half width.

        Args:
            v: Places over the half length [-], any shape.

        Returns:
            Left and right [-], same shape; NaN beyond the ends.
        """
        j, part = self._between(v, len(self.left))
        left, right = (np.where(np.abs(v) <= 1, _line(a[j], a[j + 1], part), np.nan) for a in (self.left, self.right))
        return left, right

    def surface(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper surface over the height.

        Args:
            u: Places along x over the half width [-], any shape.
            v: Places along y over the half length [-], same shape.

        Returns:
            Bottom and top [-], same shape, NaN where there is no food.
        """
        left, right = self.span(v)
        half = np.maximum((right - left) / 2, 1e-12)
        s = (u - (left + right) / 2) / half
        j, part = self._between(v, len(self.left))
        i, share = self._between(s, self.bottom.shape[1])
        with np.errstate(invalid="ignore"):
            there = np.abs(s) <= 1
        bottom, top = (
            np.where(there, _line(_line(a[j, i], a[j, i + 1], share), _line(a[j + 1, i], a[j + 1, i + 1], share), part),
                     np.nan)
            for a in (self.bottom, self.top)
        )  # fmt: skip
        return bottom, top

    def area(self, v: float) -> float:
        """Area of a section over that of the food's width times height [-]; v is its place over the half length."""
        left, right = (float(side) for side in self.span(np.array(v)))
        if not right > left:
            return 0.0
        angle = (np.arange(SUMMED) + 0.5) * np.pi / SUMMED
        u = (left + right) / 2 - (right - left) / 2 * np.cos(angle)
        bottom, top = self.surface(u, np.full_like(u, v))
        return float(((top - bottom) * np.sin(angle)).mean()) * np.pi / 2 * (right - left) / 2

    @cached_property
    def volume(self) -> float:
        """Volume over that of the food's box [-]."""
        angle = (np.arange(SUMMED) + 0.5) * np.pi / SUMMED
        areas = np.array([self.area(float(v)) for v in -np.cos(angle)])
        return float((areas * np.sin(angle)).mean()) * np.pi / 2

    @cached_property
    def prism(self) -> bool:
        """Whether all sections are alike."""
        return all(float(np.abs(a - a[:1]).max()) <= SYMMETRY for a in (self.left, self.right, self.bottom, self.top))

    @cached_property
    def walled(self) -> bool:
        """Whether a section ends upright at its flanks."""
        rim = (self.top - self.bottom)[:, [0, -1]][self.right - self.left > FLAT]
        return bool(len(rim)) and float(rim.max()) > FLAT

    @cached_property
    def halved(self) -> bool:
        """Whether the lower surface lies flat on the board, as that of a half fruit."""
        n, m = self.bottom.shape
        weight = np.outer((self.right - self.left) * np.sin(np.pi * np.arange(n) / (n - 1)),
                          np.sin(np.pi * np.arange(m) / (m - 1)))  # fmt: skip
        return float(weight[self.bottom < FLAT].sum()) >= HALVED * float(weight.sum())

    @staticmethod
    def _between(v: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Index of the place below each v, and the part of the way to the next, in even angles."""
        at = np.arccos(-np.clip(np.nan_to_num(v), -1.0, 1.0)) * ((count - 1) / np.pi)
        index = np.minimum(at.astype(int), count - 2)
        return index, at - index


def _line(a: np.ndarray, b: np.ndarray, part: np.ndarray) -> np.ndarray:
    return a + part * (b - a)


@dataclass(frozen=True)
class Outline:
    """A measured outline, and where it comes from. A document keeps that, and not the table.

    Attributes:
        source: Name of the file.
        sha256: SHA-256 of its content.
        how: How it was read: ``revolved``, ``half``, ``bent``, ``extruded`` or ``mesh``, and with which scale or unit.
        table: Its sections; None where it was read back from a document.
    """

    KEYS: ClassVar[tuple[str, ...]] = ("source", "sha256", "how")

    source: str
    sha256: str
    how: str
    table: Sections | None = field(default=None, repr=False)

    @property
    def sections(self) -> Sections:
        """Its table.

        Raises:
            SceneError: It has none.
        """
        if self.table is None:
            raise SceneError(f"shape: the outline of {self.source} is not in this document; give the file again")
        return self.table

    def as_dict(self) -> dict[str, str]:
        """Where it comes from, and what stands for its numbers."""
        return {name: getattr(self, name) for name in self.KEYS} | {"table": self.sections.digest}


def revolved(radius: np.ndarray, *, halved: bool = False) -> Sections:
    """Round sections about a straight axis along y.

    Args:
        radius: Radius over the largest one [-], shape (n,), at ``places(n)``.
        halved: Whether the lower half is missing, and the axis lies on the board.

    Returns:
        The table.
    """
    return bent(-radius, radius, halved=halved)


def bent(left: np.ndarray, right: np.ndarray, *, halved: bool = False) -> Sections:
    """Round sections between the two flanks of a plan; their middles are all as high.

    Args:
        left: Where each section begins along x, over the half width [-], shape (n,), at ``places(n)``.
        right: Where it ends [-], shape (n,).
        halved: Whether the lower half is missing.

    Returns:
        The table; the food is as high as its widest section is wide, or half as high.
    """
    half = (right - left) / 2
    rise = np.outer(half / half.max(), np.sin(np.pi * np.arange(ACROSS) / (ACROSS - 1)))
    if halved:
        return Sections(left, right, 0.0 * rise, rise)
    return Sections(left, right, (1 - rise) / 2, (1 + rise) / 2)


def extruded(bottom: np.ndarray, top: np.ndarray) -> Sections:
    """The same section all along y.

    Args:
        bottom: Lower surface over the height [-], shape (m,), at ``places(m)``.
        top: Upper surface over the height [-], shape (m,).

    Returns:
        The table.
    """
    alike = np.ones((3, 1))
    return Sections(-np.ones(3), np.ones(3), alike * bottom, alike * top)
