"""What a study of several cuts is asked to do: which traces, what they share, which are held out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from calib.errors import TraceError
from calib.material.food import FoodSpec
from calib.problem.request import Request
from calib.trace.cuts import find_cuts
from calib.trace.mending import mended

CUT, COMPRESSION = "cut", "compression"
"""Kinds of traces."""
SPECIMEN_PROPERTIES = ("R_skin", "skin_thickness", "initiation_depth", "bow", "height", "aspect", "roundness")
"""What each specimen has of its own unless the study says otherwise: its skin, how its surface gives way, its size and
form. The rest is flesh and blade, which are the same."""
KNIFE_PROPERTIES = ("mu",)
"""What each knife has of its own where a study has several, unless it says otherwise: friction is of food and blade."""
SCATTER = 0.25
"""Standard deviation of the logarithm of each stiffness, strength and resistance of flesh among specimens [-]
(docs/theory.md, "Measured choices"). What all of them have in common is in the specimen's own factor."""


@dataclass(frozen=True)
class CompressionSpec:
    """A compression test of the food, which narrows the prior of Young's modulus.

    Attributes:
        name: Its name in the study.
        traces: CSV files, each one repeat or several.
        sizes: ``height`` and ``diameter``, or ``height``, ``width`` and ``length`` [m].
        nu: Poisson's ratio that is assumed [-].
    """

    name: str
    traces: tuple[Path, ...]
    sizes: Mapping[str, float]
    nu: float


@dataclass(frozen=True)
class StudySpec:
    """Several cuts of one food, and what is asked of them.

    Attributes:
        source: The file.
        food: The food with its literature ranges.
        requests: What to calibrate, by the name of the trace.
        compressions: Compression tests.
        specimen_properties: Properties that each specimen has of its own.
        hold_out: Traces that are predicted from the others, in turn.
        budget: Largest number of simulations of each trace, in each fit.
        seed: Seed of particles and search.
        scatter: Standard deviation of the logarithm of each property of the flesh among specimens [-].
        knife_properties: Properties that all cuts of a knife share, and no others.
    """

    source: str
    food: FoodSpec
    requests: Mapping[str, Request]
    compressions: tuple[CompressionSpec, ...]
    specimen_properties: tuple[str, ...]
    hold_out: tuple[str, ...]
    budget: float
    seed: int
    scatter: float = SCATTER
    knife_properties: tuple[str, ...] = KNIFE_PROPERTIES

    @property
    def first(self) -> Request:
        """The request of the first trace, which says for all how they are run."""
        return next(iter(self.requests.values()))

    @property
    def fitted(self) -> tuple[str, ...]:
        """Traces of the final fit: all but those that are held out, and all where each is held out in turn."""
        return tuple(name for name in self.requests if name not in self.hold_out) or tuple(self.requests)

    def run_with(self, *, budget: float | None, arch: str, command: tuple[str, ...]) -> StudySpec:
        """The study with what the command line says of how to run it.

        Args:
            budget: Largest number of simulations of each trace, in each fit; None for the study's own.
            arch: Device of the simulations.
            command: Command line, for provenance.

        Returns:
            The study.
        """
        spend = self.budget if budget is None else budget
        requests = {n: replace(r, budget=spend, arch=arch, command=command) for n, r in self.requests.items()}
        return replace(self, requests=requests, budget=spend)


def study_of_cuts(request: Request) -> StudySpec:
    """The cuts of one record as specimens of one food, which share flesh and blade.

    Args:
        request: What is to be calibrated, on a record of several cuts.

    Returns:
        A study with a trace for each cut, ``cut1``, ``cut2`` and so on; nothing is held out.

    Raises:
        TraceError: The record cannot be read, or holds one cut.
    """
    trace, _ = request.records()
    count = len(find_cuts(mended(trace).trace))
    if count < 2:
        raise TraceError(f"{trace.source}: the record holds one cut; leave --all out")
    return StudySpec(
        source=trace.source,
        food=request.food,
        requests={f"cut{k}": replace(request, cut=k, scaled=True) for k in range(1, count + 1)},
        compressions=(),
        specimen_properties=SPECIMEN_PROPERTIES,
        hold_out=(),
        budget=request.budget,
        seed=request.seed,
    )
