"""How good a predictive band is: narrow, and the measured curve within it.

A band that is wide enough holds any curve. The interval score charges for width and for what lies outside alike, so
that neither a wide band nor a wrong one has a good score (Gneiting & Raftery 2007, J. Am. Stat. Assoc. 102:359,
eq. 43).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.problem.parameters import Z95
from calib.validation.null_models import NullModel
from calib.validation.prior_conflict import PriorConflict
from mpm.arrays import FloatArray

OUTSIDE = 0.05
"""Part of the points outside a 95 % band that is right [-]."""
SIMPLE = ("ramp", "half_sine")
"""Null models that a simulation must be better than."""


@dataclass(frozen=True)
class PredictiveScore:
    """A band and curves that explain nothing, against the measured curve.

    Attributes:
        explained: Posterior predictive p-value: how probably the right food would leave a larger misfit [-].
        width: Mean width of the 95 % band over the measured peak [-].
        score: Mean interval score of the band over the peak [-]; less is better.
        null_scores: The same of null models in bands of their own residuals, by name.
        conflict: How far the values are from what was known of the food; None where nobody compared them.
        size: How probably the food is as large as the specimen [-]; None where nobody compared them.
    """

    explained: float
    width: float
    score: float
    null_scores: Mapping[str, float]
    conflict: PriorConflict | None = None
    size: float | None = None

    @property
    def simple(self) -> tuple[str, float]:
        """The better one of the simple null models, and its score."""
        name = min((n for n in self.null_scores if n in SIMPLE), key=lambda n: self.null_scores[n])
        return name, self.null_scores[name]

    @property
    def better(self) -> tuple[str, ...]:
        """Null models whose score is better than that of the band."""
        return tuple(name for name, score in self.null_scores.items() if score < self.score)


def interval_score(low: FloatArray, high: FloatArray, measured: FloatArray) -> float:
    """Mean interval score of a 95 % band.

    Args:
        low: Its lower end [N] (n,).
        high: Its upper end [N] (n,).
        measured: The measured curve [N] (n,).

    Returns:
        Width, and what lies outside times 40, on average [N].
    """
    outside = np.maximum(low - measured, 0.0) + np.maximum(measured - high, 0.0)
    return float(np.mean(high - low + 2.0 / OUTSIDE * outside))


def predictive_score(
    explained: float, band: tuple[FloatArray, FloatArray], measured: FloatArray, nulls: Mapping[str, NullModel]
) -> PredictiveScore:
    """The score of a band.

    Args:
        explained: Posterior predictive p-value [-].
        band: Lower and upper end of the 95 % band [N] (n,) each.
        measured: The measured curve [N] (n,).
        nulls: Null models by name.

    Returns:
        The score.
    """
    peak = float(measured.max())
    scores = {}
    for name, null in nulls.items():
        half = Z95 * float(np.sqrt(np.mean((null.curve - measured) ** 2)))
        scores[name] = interval_score(null.curve - half, null.curve + half, measured) / peak
    low, high = band
    width = float(np.mean(high - low)) / peak
    return PredictiveScore(explained, width, interval_score(low, high, measured) / peak, scores)
