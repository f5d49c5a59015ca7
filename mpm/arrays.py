"""The types of the project's arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""An array of doubles; the docstring of what takes or returns one gives its shape and unit."""
