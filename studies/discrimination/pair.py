"""A made-up cut and what is claimed of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from calib.material.food import load_food
from calib.material.scene import Sizing, specimen
from mpm.arrays import FloatArray
from mpm.scene.shapes import Shape

Change = Callable[[FloatArray], FloatArray]
"""What is done to the force of a record before it is fitted: forces [N] (k,) in, forces (k,) out."""
SIZES = ("height", "width", "length")


def as_measured(force: FloatArray) -> FloatArray:
    """The force as it was measured."""
    return force


def backwards(force: FloatArray) -> FloatArray:
    """The cut from its end to its start.

    What is measured before contact stays where it is, so that there is a baseline. Contact is where the force first
    leaves what the first half second shows.
    """
    start = int(np.argmax(force > force[:APPROACH].mean() + CONTACT * np.ptp(force)))
    return np.concatenate([force[:start], force[start:][::-1]])


def negative(force: FloatArray) -> FloatArray:
    """The force with the other sign."""
    return -force


APPROACH = 100  # samples of a made-up record that are surely before contact
CONTACT = 0.05  # part of the range of a force at which the cut has begun


@dataclass(frozen=True)
class Cut:
    """What was cut in truth, or what is claimed to have been.

    Attributes:
        food: Food of materials.yaml.
        knife: Knife of knives.yaml.
        height: Height of the piece [m]; None for that of the food. Width and length keep its proportions.
    """

    food: str
    knife: str = "kitchen"
    height: float | None = None

    @property
    def shape(self) -> Shape:
        """The specimen."""
        return specimen(load_food(self.food), None, Sizing(height=self.height))[0]


@dataclass(frozen=True)
class Pair:
    """A cut, what is claimed of it, and whether that is right.

    Attributes:
        name: Name, of its files as well.
        kind: What is wrong, in a word or two; ``right`` where nothing is.
        truth: What was cut.
        claim: What is claimed.
        change: What is done to the force of its record.
        sizes: Factors on the sizes that are claimed, by name; 1 where there is none.
        own: Whether the sizes claimed are those of the claimed food, as where a file was mixed up; else those of the
            specimen that was cut.
        told: Whether sizes and shape are claimed at all.
        sign: Sign of the force that is claimed, ``+`` or ``-``; None where it is left to the trace.
    """

    name: str
    kind: str
    truth: Cut
    claim: Cut
    change: Change = as_measured
    sizes: Mapping[str, float] | None = None
    own: bool = False
    told: bool = True
    sign: str | None = None

    @property
    def right(self) -> bool:
        """Whether the claim is right."""
        return self.kind == RIGHT

    @property
    def number(self) -> int:
        """Seed of the pair, from its name."""
        return sum(ord(c) * 31**k for k, c in enumerate(self.name)) % SEEDS

    def factor(self, size: str) -> float:
        """Factor on a claimed size [-]."""
        factor = (self.sizes or {}).get(size, 1.0)
        assert math.isfinite(factor)
        return factor


RIGHT = "right"
SEEDS = 100_003  # a prime: names that differ have other seeds
