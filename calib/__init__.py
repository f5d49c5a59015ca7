"""From a force trace to calibrated food properties: ``from calib import Calibration, Design, Food, Study, Trace``.

Importing it imports no Taichi, no plotting and no pandas; each name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from calib._version import __version__ as __version__

if TYPE_CHECKING:
    from calib.api import Calibration
    from calib.design_api import Design
    from calib.material.food import FoodSpec as Food
    from calib.study_api import Study
    from calib.trace.trace import Trace

__all__ = ["Calibration", "Design", "Food", "Study", "Trace"]

_PLACES = {
    "Calibration": ("calib.api", "Calibration"),
    "Design": ("calib.design_api", "Design"),
    "Food": ("calib.material.food", "FoodSpec"),
    "Study": ("calib.study_api", "Study"),
    "Trace": ("calib.trace.trace", "Trace"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for, and nothing before."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, item = _PLACES[name]
    return getattr(import_module(module), item)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
