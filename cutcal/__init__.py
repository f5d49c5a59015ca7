"""Calibrated cuts of food: ``from cutcal import Calibration, Design, Food, Study, Trace``.

Importing it imports no Taichi, no plotting and no pandas; each name is loaded when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import calib
from calib._version import __version__ as __version__

if TYPE_CHECKING:
    from calib import Calibration, Design, Food, Study, Trace

__all__ = ["Calibration", "Design", "Food", "Study", "Trace"]


def __getattr__(name: str) -> Any:
    """Import what is asked for, and nothing before."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(calib, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
