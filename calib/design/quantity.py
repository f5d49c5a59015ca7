"""What a design is asked to narrow: all parameters, one of them, or the peak or work under another blade."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from calib.design.candidates import check_asked
from calib.design.measurement import curve_of
from calib.design.result import ALL
from calib.design.start import Start
from calib.design.stencil import Stencil
from calib.material.knife import load_knife
from calib.simulation.evaluation import Evaluation
from mpm.arrays import FloatArray
from mpm.scene import Knife

UNDER = re.compile(r"(peak|work) under knife (\S.*)")
UNITS = {"peak": "N", "work": "J"}


@dataclass(frozen=True, eq=False)
class Quantity:
    """Peak or work of the specimen under a blade.

    Attributes:
        name: As it was asked for.
        measure: ``peak`` or ``work``.
        knife: The blade.
    """

    name: str
    measure: str
    knife: Knife

    @property
    def unit(self) -> str:
        """Its SI unit."""
        return UNITS[self.measure]

    def value(self, run: Evaluation, stroke: float) -> float:
        """Its value in a simulated cut [unit].

        Args:
            run: The cut.
            stroke: Its stroke [m].

        Returns:
            The value.
        """
        curve = curve_of(run, stroke)
        if self.measure == "peak":
            return float(curve.max())
        return float(np.trapezoid(curve, np.linspace(0.0, stroke, len(curve))))

    def gradient(self, stencil: Stencil, stroke: float) -> FloatArray:
        """Its logarithm by the internal coordinates.

        Args:
            stencil: The cut and its neighbours.
            stroke: Its stroke [m].

        Returns:
            The gradient [-] (p,).
        """
        out = np.zeros(len(stencil.sides))
        for k, sides in enumerate(stencil.sides):
            ends = sorted([(0.0, stencil.centre), *sides], key=lambda side: side[0])
            (low, below), (high, above) = ends[0], ends[-1]
            if high > low:
                out[k] = np.log(self.value(above, stroke) / self.value(below, stroke)) / (high - low)
        return out


def asked_quantity(start: Start, asked: str) -> Quantity | None:
    """The quantity that was asked for, None for a parameter or all of them.

    Args:
        start: What is known.
        asked: What the user wrote.

    Returns:
        The quantity.

    Raises:
        MaterialError: An unknown parameter.
        SceneError: An unknown knife.
    """
    found = UNDER.fullmatch(asked)
    if found is not None:
        return Quantity(asked, found[1], load_knife(found[2].strip()))
    if asked != ALL:
        check_asked(start, asked)
    return None
