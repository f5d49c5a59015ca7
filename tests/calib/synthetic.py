"""Curves and noise that several tests of the fit make up."""

from __future__ import annotations

import math

import numpy as np

POINTS, CORRELATION = 240, 0.05
X = np.linspace(0.0, 1.0, POINTS)
WEIGHT = math.sqrt(1.0 / CORRELATION / POINTS)


def correlated_noise(random: np.random.Generator, length: float = CORRELATION) -> np.ndarray:
    """Noise of unit variance whose autocorrelation integrates to the correlation length (240,)."""
    grid = np.linspace(-0.2, 1.2, 700)
    kernel = np.exp(-0.5 * ((X[:, None] - grid) * 2.0 * math.sqrt(math.pi) / length) ** 2)
    return (kernel / np.linalg.norm(kernel, axis=1)[:, None]) @ random.standard_normal(grid.size)
