"""From a force trace to calibrated food properties. Importing it imports no Taichi and no plotting."""

from __future__ import annotations

__version__ = "0.1.0"
