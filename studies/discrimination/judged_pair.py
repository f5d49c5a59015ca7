"""A pair calibrated as a user would, and judged."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calib.calibration.calibrated import Calibrated
from calib.calibration.summary import verdicts_of
from calib.errors import OutputError
from calib.fit.options import FitOptions
from calib.material.food import load_food
from calib.material.scene import Sizing
from calib.problem.request import Request
from calib.problem.setup import Setup, set_up
from calib.simulation.evaluation_store import EvaluationStore
from calib.simulation.record_file import read_record, record_errands
from calib.simulation.workers import Workers
from calib.uncertainty.global_search import fit_with_uncertainty
from mpm.scene.errors import CutcalError
from studies.discrimination.made_up_cut import Truth, made_up, write_record
from studies.discrimination.pair import SIZES, Pair


@dataclass(frozen=True)
class Judged:
    """What the verdict said of a pair.

    Attributes:
        name: Name of the pair.
        kind: What is wrong with it; ``right`` where nothing is.
        failed: Lines of the verdict that failed, by name: value and limit.
        error: What the input was refused for; empty where it was calibrated.
        truth: Values that were cut [SI], by name.
        fitted: Values that were fitted [SI], by name.
        intervals: Their 95 % intervals [SI], by name.
        numbers: What the verdict rests on, by name.
        seconds: Wall time [s].
    """

    name: str
    kind: str
    failed: Mapping[str, tuple[float | None, float | None]]
    error: str
    truth: Mapping[str, float]
    fitted: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    numbers: Mapping[str, float | None]
    seconds: float

    @property
    def refused(self) -> bool:
        """Whether the claim did not pass."""
        return bool(self.failed or self.error)

    @property
    def held(self) -> tuple[int, int]:
        """How many intervals hold what was cut, of those that are of a property of its food."""
        both = [name for name in self.intervals if name in self.truth]
        ends = self.intervals
        return sum(ends[name][0] <= self.truth[name] <= ends[name][1] for name in both), len(both)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return dict(vars(self))

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Judged:
        """The value that :meth:`as_dict` has written."""
        ends = {key: {name: tuple(pair) for name, pair in raw[key].items()} for key in ("failed", "intervals")}
        return cls(**{**raw, **ends})


def judge_pair(pair: Pair, out: Path, store: EvaluationStore, pool: Workers, budget: float) -> Judged:
    """Make up the cut of a pair, calibrate what is claimed of it, and judge.

    Args:
        pair: The pair.
        out: Folder for its record.
        store: Where simulations are kept.
        pool: Where they run.
        budget: Largest number of simulations.

    Returns:
        What the verdict said. The lines of the numerical checks are not among it: they vary the solver, and say nothing
        of a claim.

    Raises:
        OutputError: No truth could be made up.
    """
    began = time.monotonic()
    truth = made_up(pair, store, pool)
    path = out / f"{pair.name}.csv"
    write_record(pair, truth, path)
    request = claimed(pair, truth, path, budget, pool.arch)
    values = dict(truth.values)
    try:
        done = calibrated(set_up(request), out / f"{pair.name}.h5", store, pool)
    except CutcalError as e:
        return Judged(pair.name, pair.kind, {}, str(e), values, {}, {}, {}, time.monotonic() - began)
    lines = verdicts_of(done)
    return Judged(
        pair.name,
        pair.kind,
        {v.name: (v.value, v.limit) for v in lines if v.passed is False},
        "",
        values,
        dict(done.fit.best.evaluation.parameters),
        {}
        if done.analysis is None
        else {i.parameter.name: (i.low95, i.high95) for i in done.analysis.uncertainty.intervals},
        {v.name: v.value for v in lines if v.passed is not None},
        time.monotonic() - began,
    )


def claimed(pair: Pair, truth: Truth, path: Path, budget: float, arch: str) -> Request:
    """What a user who believes the claim asks for.

    Args:
        pair: The pair.
        truth: Its cut.
        path: Its record.
        budget: Largest number of simulations.
        arch: Device.

    Returns:
        The request.
    """
    food = load_food(pair.claim.food)
    shape = pair.claim.shape if pair.own else truth.shape
    sizes = {name: getattr(shape, name) * pair.factor(name) for name in SIZES}
    return Request(
        food=food,
        trace=path,
        columns={"sign": pair.sign},
        knife=pair.claim.knife,
        sizing=Sizing(shape.kind, **sizes) if pair.told else Sizing(),
        budget=budget,
        seed=pair.number,
        arch=arch,
    )


def calibrated(setup: Setup, record: Path, store: EvaluationStore, pool: Workers) -> Calibrated:
    """The fit, its uncertainty and the whole record of its best values.

    Args:
        setup: What was decided for the trace.
        record: File of the whole record.
        store: Where simulations are kept.
        pool: Where they run.

    Returns:
        What was computed, without numerical checks.

    Raises:
        KeyboardInterrupt: Interrupted.
        OutputError: The search ended before there were intervals.
    """
    options = FitOptions(budget=setup.request.budget, batch=pool.batch, seed=setup.request.seed)
    fit, analysis = fit_with_uncertainty(setup.objective, setup.evaluators(pool, store), options)
    if fit.status == "interrupted":
        raise KeyboardInterrupt
    if analysis is None:
        raise OutputError("the search ended before there were intervals")
    best = fit.best.evaluation.parameters
    scene = setup.scene(best)
    errands = record_errands(scene, record)
    if errands:
        pool.errands(errands)
    start = np.full_like(setup.curve.stroke, np.nan)
    return Calibrated(setup.sized(best), fit, analysis, read_record(scene, record), [], start)
