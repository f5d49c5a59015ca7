"""The same on coarse cells without the product's search: Gauss-Newton on the records themselves.

The truth is drawn from the literature, cut with other particles and the grid elsewhere, and measured by the made-up
sensor. Its first record is fitted from the literature's values, then a design is made, its test is made of the truth,
and both records are fitted together. It costs some 250 coarse cuts, where the product's own fits cost hours of a stiff
food on two busy cores.

Run it with ``python -m studies.design.linearised --food potato --for yield_stress --out runs/linearised``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.design.candidates import WIDTH_SD, Candidate, candidates, coarse_cut
from calib.design.expectation import FIRST, first_test, next_cut
from calib.design.linear import information, posterior, pulled
from calib.design.measurement import CutTest, cut_measurement, measured_rows
from calib.design.result import DesignResult
from calib.design.run import DesignRequest
from calib.design.run import run as design
from calib.design.start import Start, start_of_food
from calib.design.stencil import CutScene, Simulator, stencils, steps_of
from calib.errors import OutputError
from calib.io.folder import write_json
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import with_other_particles
from calib.problem.food_parameters import size_relative_sd
from calib.problem.parameters import Z95
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.process_pool import Pool
from calib.simulation.workers import Workers
from calib.trace.conditioning import condition
from calib.trace.filters import N_STROKE
from calib.trace.trace import read_trace
from calib.validation.interval_coverage import TRIES, MadeUpSensor
from mpm.arrays import FloatArray

TRUTH = 5
"""Which of the shifted grids, with its own particles, the truth has; a replicate has another one."""
SPREAD = 0.7
"""Standard deviation of the truth about the literature's values, of the priors' [-]."""
MADE = ("width", "blade", "narrower", "slicing")
"""Kinds of tests that are made of the truth."""
ROUNDS = (4, 2)
"""Gauss-Newton steps on the first record, and on both."""
RADIUS = 0.7
"""Longest step, in standard deviations of the priors [-]."""


@dataclass(frozen=True, eq=False)
class Record:
    """A record of the truth.

    Attributes:
        cut: What is simulated of it.
        test: How it is measured.
        curve: Measured force [N] on 240 equal steps of the stroke (240,).
    """

    cut: CutScene
    test: CutTest
    curve: FloatArray


class Bench:
    """The truth and what was made of it.

    Args:
        start: What the literature says; its parameters have the literature's values.
        simulator: Runs the cuts.
        seed: Seed of truth and sensor.
    """

    def __init__(self, start: Start, simulator: Simulator, seed: int) -> None:
        self.start, self.simulator = start, simulator
        self.random = np.random.default_rng(seed)
        self.width = float(np.exp(start.width_sd * self.random.standard_normal() / 2.0))
        self.truth = start.parameters.start

    def first(self) -> Record:
        """Draw a truth that is cut, of another width than is believed, and measure its first cut.

        Raises:
            OutputError: No draw is cut.
        """
        start = self.start
        cut = CutScene(coarse_cut(start, start.knife, start.shape), True, start.kept)
        believed = start.parameters
        for _ in range(TRIES):
            drawn = believed.start + SPREAD * believed.prior_root @ self.random.standard_normal(len(believed))
            self.truth = believed.clip(drawn)
            curve = self.measured(cut, start.stroke)
            if curve is not None:
                return Record(cut, first_test(start, start.width_sd), self.width * curve)
        raise OutputError(f"none of {TRIES} foods is cut")

    def measured(self, cut: CutScene, stroke: float) -> FloatArray | None:
        """A record of the truth, conditioned [N] (240,); None where it is not cut."""
        scene, values = cut.at(self.start.parameters.to_dict(self.truth))
        (run,) = self.simulator.run([(with_other_particles(scene, TRUTH), values)])
        if run.completed < 1.0:
            return None
        found = condition(read_trace(MadeUpSensor().measure(run.stroke, run.force, self.random)), height=stroke)
        return np.interp(np.linspace(0.0, stroke, N_STROKE), found.stroke, found.curve)

    def fitted(self, records: Mapping[str, Record], start: Start, rounds: int) -> tuple[Start, FloatArray]:
        """Start with the values that the records ask for, and their covariance.

        Args:
            records: The records, by name.
            start: Where the fit begins.
            rounds: Gauss-Newton steps.

        Returns:
            The start with the fitted values, and the covariance about them (p, p).

        Raises:
            OutputError: The fit has come to a food that is not cut.
        """
        parameters = start.parameters
        cuts = {name: record.cut for name, record in records.items()}
        own, prior = np.linalg.inv(parameters.prior_covariance), parameters.prior_covariance
        z = parameters.start
        for left in range(rounds, -1, -1):
            about = stencils(self.simulator, cuts, parameters, z, steps_of(parameters, start.present_sd))
            if not all(one.sound for one in about.values()):
                raise OutputError("the fit has come to a food that is not cut; take another --seed")
            tests = [cut_measurement(start, about[n], r.test) for n, r in records.items()]
            covariance = posterior(prior, information(tests))
            if left > 0:
                rows = np.concatenate([measured_rows(start, about[n], r.test, r.curve) for n, r in records.items()])
                pull = pulled(tests, rows) + own @ (parameters.prior_mean - z)
                step = covariance @ pull
                size = float(np.max(np.abs(step) / parameters.prior_sd))
                z = parameters.clip(z + min(1.0, RADIUS / max(size, 1e-9)) * step)
        return replace(start, parameters=parameters.with_values(parameters.to_dict(z))), covariance


def with_intervals(start: Start, covariance: FloatArray) -> Start:
    """The start with the 95 % intervals of a covariance (p, p) about its values."""
    reported = {}
    for p, z, sd in zip(start.parameters, start.parameters.start, np.sqrt(np.diag(covariance)), strict=True):
        reported[p.name] = (p.from_internal(z - Z95 * sd), p.from_internal(z + Z95 * sd))
    return replace(start, reported=reported)


def study(food: str, asked: str, seed: int, out: Path, pool: Workers) -> dict[str, Any]:
    """Fit a first record, design, make each test that is a cut, and compare promised and found intervals.

    Args:
        food: Its name in materials.yaml.
        asked: The parameter that is asked for.
        seed: Seed of the truth.
        out: Output folder.
        pool: Where the simulations run.

    Returns:
        What was promised and what was found, by test.
    """
    out.mkdir(parents=True, exist_ok=True)
    known = load_food(food)
    start = replace(start_of_food(known, load_knife("kitchen")), run=out, width_sd=size_relative_sd(known, "width"))
    header = Header("", f"linearised {food} {seed}")
    with EvaluationStore(out / "evaluations.h5", header, resume=True) as store:
        bench = Bench(start, Simulator(pool, store, _tell), seed)
        first = bench.first()
        fitted, covariance = bench.fitted({FIRST: first}, start, ROUNDS[0])
        before = with_intervals(fitted, covariance)
        folder = out / f"design-{asked}"
        promised = design(DesignRequest(before, asked), folder, pool, resume=folder.is_dir(), say=_tell)
        rows: dict[str, Any] = {}
        truth = start.parameters.to_dict(bench.truth)
        document = {"food": food, "asked": asked, "seed": seed, "truth": truth, "recommended": promised.recommended}
        document |= {"now": vars(promised.known[asked]), "tests": rows}
        tests = sorted(candidates(before)[0], key=lambda t: t.scene is not None)
        for test in tests:
            if test.kind in MADE and any(t.name == test.name for t in promised.tests):
                rows[test.name] = _made(bench, before, first, test, promised, asked)
                write_json(out / f"linearised-{asked}.json", document)
    return document


def _made(
    bench: Bench, before: Start, first: Record, test: Candidate, promised: DesignResult, asked: str
) -> dict[str, Any]:
    """Make a test of the truth, fit both records, and compare all widths."""
    records = _records(bench, before, first, test)
    if records is None:
        return {"cut": False}
    after, covariance = bench.fitted(records, before, ROUNDS[1])
    sd = np.sqrt(np.diag(covariance))
    expected = next(t for t in promised.tests if t.name == test.name)
    parts = {}
    for k, p in enumerate(after.parameters):
        now = promised.known[p.name]
        wide = (p.to_internal(now.high95) - p.to_internal(now.low95)) / (2.0 * Z95)
        parts[p.name] = {"promised": expected.parameters[p.name].part, "found": float(sd[k]) / wide}
    own = parts[asked]
    return {"ratio": own["found"] / own["promised"], "parts": parts}


def _records(bench: Bench, before: Start, first: Record, test: Candidate) -> dict[str, Record] | None:
    """All records after a test; None where its cut is none of the true food."""
    if test.scene is None:
        return {FIRST: replace(first, test=first_test(before, WIDTH_SD), curve=first.curve / bench.width)}
    cut, how = CutScene(test.scene), next_cut(before, test)
    curve = bench.measured(cut, how.stroke)
    if curve is None:
        return None
    # as in a fit of several traces, each has an error of the model of its own
    return {
        FIRST: replace(first, test=replace(first.test, model="")),
        test.name: Record(cut, replace(how, model=""), curve),
    }


def _tell(text: str) -> None:
    sys.stderr.write(text + "\n")


def main() -> None:
    """Print what was promised and what was found."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--food", default="potato", help="food of materials.yaml (default potato)")
    parser.add_argument("--for", dest="asked", default="R", help="parameter to narrow (default R)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the truth (default 0)")
    parser.add_argument("--out", type=Path, required=True, help="output folder")
    parser.add_argument("--workers", type=int, default=2, help="simulations at a time (default 2)")
    args = parser.parse_args()
    with Pool(args.workers, "cpu") as pool:
        found = study(args.food, args.asked, args.seed, args.out, pool)
    sys.stdout.write(json.dumps(found, indent=2, default=float) + "\n")


if __name__ == "__main__":
    main()
