"""Arguments of the interface in Python: what they may be, and one sentence about one that cannot be."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from numbers import Real
from pathlib import Path

from calib.io.kinds import FILE, FLAG, FOLDER, NAMED, TEXT
from calib.io.progress import Progress, ProgressBar
from calib.io.wording import quoted
from calib.material.food import FoodSpec
from calib.table.si_numbers import si_number
from mpm.scene.errors import CutcalError, check_number

LIMITS: dict[str, tuple[float, float, str]] = {
    "speed": (0.0, 10.0, "m/s"),
    "board_z": (-100.0, 100.0, "m"),
    "t_end": (0.0, 1e6, "s"),
    "height": (1e-3, 1.0, "m"),
    "width": (1e-3, 1.0, "m"),
    "length": (1e-3, 1.0, "m"),
    "at": (0.0, 1.0, ""),
    "dx": (1e-4, 0.02, "m"),
    "budget": (0.0, 1e6, ""),
    "gain_sd": (0.0, 1.0, ""),
    "lag_sd": (0.0, 1.0, "s"),
    "bandwidth": (1.0, 1e5, "Hz"),
    "discrepancy": (0.0, 1.0, ""),
}
"""Numbers between which a value must lie, and its unit: those of the command line."""
PLAIN = ("at", "budget")
"""Those of them that are numbers alone; the others may be text with a unit, such as ``45mm``."""
_OF_TEXT = {"": "-", "Hz": "/s"}
"""How a unit of ``LIMITS`` is called where numbers are read from text, where it differs."""
KINDS: Mapping[str, tuple[tuple[type, ...], str]] = {
    "food": ((str, Path, FoodSpec), "a name, a YAML file or a Food"),
    "knife": NAMED,
    "outline": FILE,
    **dict.fromkeys(("sample", "withdrawal"), FLAG),
    **dict.fromkeys(("shape", "scale", "outline_as", "scheduler"), TEXT),
    **dict.fromkeys(("time_col", "force_col", "position_col", "depth_col", "decimal"), TEXT),
    **dict.fromkeys(("u_num", "start_from"), FOLDER),
    "sign": ((str, Real), "'+' or '-'"),
    "rate": ((Real,), "the rows a second"),
    "set": ((Mapping,), "a dict such as {'E': 2e5}"),
    "columns": ((Mapping,), "a dict such as {'force_col': 'Fz=N'}"),
    "fit": ((Sequence,), "a list of names, such as ['E', 'R']"),
}
"""What arguments of a calibration may be, and in words; None where that is the default."""


def as_number(call: str, name: str, value: float | str | None) -> float | None:
    """A number between its limits, from a number or from text with a unit.

    Args:
        call: What it is an argument of.
        name: Its name, one of ``LIMITS``.
        value: The number [the unit of its limits], text such as ``45mm``, or None. Those of ``PLAIN`` are numbers.

    Returns:
        The number, or None.

    Raises:
        CutcalError: It is something else, or not between its limits.
    """
    low, high, unit = LIMITS[name]
    if isinstance(value, str) and name not in PLAIN:
        try:
            value = si_number(value, _OF_TEXT.get(unit, unit))
        except ValueError as error:
            raise CutcalError(f"{call}: {name}: {error}") from None
    if value is not None or name in PLAIN:
        check_number(call, name, value, low, high, unit)  # type: ignore[arg-type]
    return value  # type: ignore[return-value]


def listeners(
    call: str,
    progress: Callable[[Progress], None] | bool | None,
    say: Callable[[str], None] | None,
    shown: ExitStack,
) -> Callable[[Progress], None] | None:
    """Who is told after each simulation, with both listeners checked before there is one.

    Args:
        call: What they are arguments of, such as ``Calibration.run``.
        progress: Called after each simulation; True for a bar on standard error.
        say: Called with each sentence.
        shown: Ends the bar.

    Returns:
        The listener, or None.

    Raises:
        CutcalError: One of them cannot be called.
    """
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise CutcalError(f"{call}: progress = {quoted(progress)}; give True for a bar, or a function")
    if not (say is None or callable(say)):
        raise CutcalError(f"{call}: say = {quoted(say)}; give a function that takes a sentence, such as print")
    if isinstance(progress, bool):
        return shown.enter_context(ProgressBar()) if progress else None
    return progress
