"""What that nobody measured limits an answer: how much narrower its interval would be, if one thing more was known.

All of it is in the normal approximation about the best values. A parameter of the specimen that is known conditions the
posterior: with the correlation c to it a standard deviation s becomes s (1 - c^2)^(1/2). A nuisance that is known
(width, gain) is no longer integrated out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.material.properties import BOARD, BOARD_FRICTION, BOARD_SUCTION, BOW
from calib.material.scene import FITTED_SIZES
from calib.problem.objective import Objective
from calib.uncertainty.intervals import Uncertainty, marginal_information

ANSWER = "R"
"""The parameter whose interval is looked at: what belongs to the food and is wanted most."""
SAID = 0.9
"""What would leave the interval wider than this part of it is not worth a sentence [-]."""
REMEDIES = {
    "roundness": ("shape", "a photograph of the specimen would tell it (--outline)"),
    "height": ("height", "a ruler or a photograph would tell it (--height)"),
    BOARD_FRICTION: (
        "friction of the board",
        "a tilted board would tell it (--set; --fit without it)",
    ),
    BOARD_SUCTION: (
        "suction of the board",
        "a rack or a board with grooves lets air under the food (--set board_suction=0)",
    ),
    BOW: ("bow", "a specimen that touches the board all along has none (--set bow=0)"),
    "aspect": ("width", "a calliper or a photograph would tell it (--width)"),
    "width": ("width", "a calliper or a photograph would tell it (--width)"),
    "gain": ("gain of the sensor", "a hung mass would tell it (--gain-sd)"),
}
"""What may be known, in words, and how one comes to know it."""


@dataclass(frozen=True)
class Limiting:
    """How wide an interval would be, if one thing more was known.

    Attributes:
        name: The parameter whose interval it is.
        parts: Its width over what it is [-], by what would be known: ``roundness``, ``height``,
            ``aspect``, ``board_friction``, ``board_suction``, ``bow``, ``width``, ``gain``.
    """

    name: str
    parts: dict[str, float]

    @property
    def most(self) -> str | None:
        """What widens the interval most, None where nothing does so by a tenth."""
        name = min(self.parts, key=lambda n: self.parts[n], default=None)
        return name if name is not None and self.parts[name] < SAID else None

    @property
    def sentence(self) -> str | None:
        """What widens it most in words, None where nothing does."""
        if self.most is None:
            return None
        what, remedy = REMEDIES[self.most]
        return (
            f"The {what} limits {self.name}: its interval would be {self.parts[self.most]:.0%} as wide if the {what} "
            f"was known; {remedy}."
        )


def limiting(objective: Objective, found: Uncertainty) -> Limiting | None:
    """What limits the answer of a fit of one trace.

    Args:
        objective: What was fitted.
        found: The normal approximation about the best values.

    Returns:
        The parts; None where the answer is not among the fitted parameters.
    """
    names = objective.parameters.names
    if ANSWER not in names:
        return None
    k = names.index(ANSWER)
    parts: dict[str, float] = {
        name: float(np.sqrt(max(1.0 - found.correlation[k, names.index(name)] ** 2, 0.0)))
        for name in (*FITTED_SIZES, *BOARD)
        if name in names
    }
    prior = objective.parameters.prior_jacobian()
    unsearched = [n.name for n in objective.nuisances if not n.searched]
    for j, name in enumerate(unsearched):
        others = np.delete(found.data.unsearched, j, axis=1)
        known = marginal_information(found.data.jacobian, others, found.widened) + prior.T @ prior
        parts[name] = float(np.sqrt(np.linalg.inv(known)[k, k] / found.covariance[k, k]))
    return Limiting(ANSWER, parts)
