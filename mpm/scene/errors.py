"""Errors a user may meet: each says what was wrong, where, and what to do."""

from __future__ import annotations

import math
import reprlib


class CutcalError(Exception):
    """Base of every error that cutcal raises on purpose; the command line prints it without a traceback."""


class SceneError(CutcalError):
    """A scene (food, knife, board, motion, numerics) that cannot be simulated as asked."""


class OutputError(CutcalError):
    """An output folder or file that cannot be written, or that belongs to another run."""


class SimulationError(CutcalError):
    """A run that broke down after it had started.

    Attributes:
        reason: Typed reason, one of ``not_finite``, ``inverted``, ``left_grid``, ``stopped``,
            ``worker_died``.
        fraction: Part of the stroke that was completed [-], 0 to 1.
    """

    def __init__(self, message: str, *, reason: str, fraction: float) -> None:
        super().__init__(message)
        self.reason = reason
        self.fraction = fraction


BREAKDOWNS = {
    "not_finite": "a force, energy or position is no number",
    "inverted": "a particle was turned inside out",
    "left_grid": "food left the grid",
}
"""Why a simulation cannot go on, in words, by its typed reason."""
HAIR = 1e-200  # a lower limit this near below zero lets zero pass


def check_number(where: str, name: str, value: float, low: float, high: float, unit: str) -> None:
    """Insist on a finite number between two limits, which it must not reach.

    Args:
        where: What the number belongs to, for the message.
        name: Its name.
        value: The number, in the unit.
        low: Lower limit; a hair below zero where zero is a value.
        high: Upper limit.
        unit: Its unit, for the message.

    Raises:
        SceneError: It is no finite number, or not between the limits.
    """
    plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not plain or not math.isfinite(value) or not low < value < high:
        limits = f"from 0 to less than {high:g}" if -HAIR < low < 0.0 else f"between {low:g} and {high:g}"
        shown = f"{value!r} {unit}".rstrip() if plain else reprlib.repr(value)
        raise SceneError(f"{where}: {name} = {shown} must be a number {limits} {unit}".rstrip())
