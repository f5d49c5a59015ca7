"""From a force trace to calibrated food properties: ``from calib import Calibration, Food, Study,
Trace``.

Importing it imports no Taichi, no plotting and no pandas; each name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calib.calibration import Calibration
    from calib.config import Study
    from calib.materials import FoodSpec as Food
    from calib.trace import Trace

__all__ = ["Calibration", "Food", "Study", "Trace"]
__version__ = "0.1.0"

_PLACES = {
    "Calibration": ("calib.calibration", "Calibration"),
    "Food": ("calib.materials", "FoodSpec"),
    "Study": ("calib.config", "Study"),
    "Trace": ("calib.trace", "Trace"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for, and nothing before."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, item = _PLACES[name]
    return getattr(import_module(module), item)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
