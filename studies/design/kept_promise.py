"""A made-up food is cut, calibrated, and asked for its next test; that test is made of the truth and fitted too.

The truth has other values, particles and width than the fit is told. Its records go the whole way of a measured one:
sensor, tare, contact, filter, search, profiles. What is compared is the width of the 95 % interval that was promised
with that which the product reports once it has the second record.

Run it with ``python -m studies.design.kept_promise --food banana --for R --out runs/promise``.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from calib.calibration.result import CalibrationResult
from calib.calibration.run import run as calibrate
from calib.compression.measured import strain_grid
from calib.design.candidates import NARROWER
from calib.design.linear import information, posterior
from calib.design.measurement import PRESS_SPREAD, PRESS_STRAIN, compression_measurement, pressed_stress
from calib.design.result import DesignedTest, DesignResult, read_design
from calib.design.run import DesignRequest
from calib.design.run import run as design
from calib.design.start import Start, start_of_run
from calib.errors import OutputError
from calib.io.folder import write_json
from calib.material.food import FoodSpec, load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.multi_specimen.compression_modulus import PLATES_SD
from calib.multi_specimen.run import run as fit_together
from calib.multi_specimen.spec import SPECIMEN_PROPERTIES, StudySpec
from calib.problem.food_parameters import fit_parameters, size_relative_sd
from calib.problem.parameters import Z95, Parameter
from calib.problem.request import Request
from calib.simulation.process_pool import Pool
from calib.simulation.workers import Workers
from calib.validation.interval_coverage import TRIES, TRUTH_PART, TRUTH_SEED, MadeUpSensor
from mpm.scene import Knife
from mpm.scene.shapes import Shape

KEPT = 0.3
"""Largest difference of the interval's width from the promised one, part of that [-]."""


@dataclass(frozen=True)
class Truth:
    """A made-up food.

    Attributes:
        food: The food with the literature's values and ranges.
        values: Its true values [SI] by name.
        shape: Its specimen, of a width that nobody is told.
        seed: Seed of its particles and sensors.
    """

    food: FoodSpec
    values: Mapping[str, float]
    shape: Shape
    seed: int

    def record(self, path: Path, pool: Workers, knife: Knife, shape: Shape) -> bool:
        """Cut a specimen of it, measure, and write the record.

        Args:
            path: The CSV file.
            pool: Where the cut is simulated.
            knife: The blade.
            shape: The specimen.

        Returns:
            Whether the food was cut.
        """
        scene = cut_scene(self.food, shape, knife, seed=TRUTH_SEED + self.seed)
        run = next(iter(pool.evaluator(scene).evaluate([self.values])))
        if run.completed < 1.0:
            return False
        number = sum(path.name.encode())
        table = MadeUpSensor().measure(run.stroke, run.force, np.random.default_rng([self.seed, number]))
        table.to_csv(path, index=False, float_format="%.6g")
        return True


def made_up(food: FoodSpec, seed: int, folder: Path, pool: Workers) -> Truth:
    """A food drawn from the middle of the literature's ranges that the kitchen knife cuts, and its first record.

    Args:
        food: The food.
        seed: Seed of the draw.
        folder: Where ``first.csv`` is written.
        pool: Where it is cut.

    Returns:
        The truth.

    Raises:
        OutputError: No draw is cut.
    """
    random = np.random.default_rng(seed)
    parameters = fit_parameters(food, food.default_fit)
    usual = specimen(food, None, Sizing())[0]
    wide = math.exp(size_relative_sd(food, "width") * float(random.standard_normal()) / 2.0)
    for _ in range(TRIES):
        z = parameters.in_box(0.5 + TRUTH_PART * (random.random(len(parameters)) - 0.5))
        truth = Truth(food, parameters.to_dict(z), replace(usual, width=wide * usual.width), seed)
        if truth.record(folder / "first.csv", pool, load_knife("kitchen"), truth.shape):
            return truth
    raise OutputError(f"none of {TRIES} foods drawn from the ranges of {food.name} is cut")


def first_request(truth: Truth, folder: Path) -> Request:
    """How the first record is calibrated: its width is not known.

    Args:
        truth: The food.
        folder: Where the record lies.

    Returns:
        The request.
    """
    shape = truth.shape
    sizing = Sizing(shape.kind, shape.height, None, shape.length)
    return Request(food=truth.food, trace=folder / "first.csv", sizing=sizing, gain_sd=MadeUpSensor().gain_sd)


def made_test(truth: Truth, test: DesignedTest, start: Start, folder: Path, pool: Workers) -> dict[str, Any]:
    """Make a test of the truth, fit what there is then, and give the parameters as the product reports them.

    Args:
        truth: The food.
        test: The test.
        start: What was known before it.
        folder: Where records and fits are written.
        pool: Where the simulations run.

    Returns:
        Parameters of the summary, by name.

    Raises:
        OutputError: The test cannot be made or its record cannot be fitted.
    """
    first = first_request(truth, folder)
    if test.kind == "width":
        sizing = replace(first.sizing, width=truth.shape.width)
        return _alone(replace(first, sizing=sizing), folder / f"after-{test.kind}", pool)
    if test.kind == "compression":
        return _alone(replace(first, food=_pressed(truth, start)), folder / f"after-{test.kind}", pool)
    if test.kind not in ("blade", "narrower"):
        raise OutputError(f"{test.name}: no command fits its record")
    knife = load_knife(test.name.split()[-1] if test.kind == "blade" else "kitchen")
    shape = replace(start.shape, width=start.shape.width * (NARROWER if test.kind == "narrower" else 1.0))
    if not truth.record(folder / "next.csv", pool, knife, shape):
        raise OutputError(f"{test.name}: the true food is not cut")
    sizing = Sizing(shape.kind, shape.height, shape.width, shape.length)
    second = replace(first, trace=folder / "next.csv", knife=knife.name, sizing=sizing)
    requests = {"first": replace(first, scaled=True), "next": replace(second, scaled=True)}
    spec = StudySpec("made up", truth.food, requests, (), SPECIMEN_PROPERTIES, (), first.budget, 0)
    out = folder / f"after-{test.kind}"
    fit_together(spec, out, pool, resume=out.is_dir())
    return dict(json.loads((out / "summary.json").read_text(encoding="utf-8"))["parameters"])


def _alone(request: Request, out: Path, pool: Workers) -> dict[str, Any]:
    """Calibrate one record."""
    return dict(calibrate(request, out, pool, resume=out.is_dir()).summary["parameters"])


def _pressed(truth: Truth, start: Start) -> FoodSpec:
    """The food with the ranges of E and yield stress that three compressed cylinders leave."""
    random = np.random.default_rng([truth.seed, 7])
    strain = strain_grid(PRESS_STRAIN)
    nu = truth.food.properties["nu"].value
    factor = math.exp(math.hypot(PLATES_SD, PRESS_SPREAD) * float(random.standard_normal()))
    seen = factor * pressed_stress(truth.values["E"], nu, truth.values["yield_stress"], strain)
    logs = np.log([start.parameters["E"].prior_centre, start.parameters["yield_stress"].prior_centre])

    def missed(x: np.ndarray) -> np.ndarray:
        return (pressed_stress(math.exp(x[0]), nu, math.exp(x[1]), strain) - seen) / float(seen.max())

    best = least_squares(missed, logs).x
    prior = start.parameters.prior_covariance
    z = start.parameters.start
    sd = np.sqrt(np.diag(posterior(prior, information([compression_measurement(start, z)]))))
    known = dict(truth.food.properties)
    for x, name in zip(best, ("E", "yield_stress"), strict=True):
        half = Z95 * float(sd[start.parameters.names.index(name)])
        value = math.exp(float(x))
        known[name] = replace(known[name], value=value, low=value * math.exp(-half), high=value * math.exp(half))
    return replace(truth.food, properties=known)


def width_of(parameter: Parameter, low: float, high: float) -> float:
    """Width of an interval.

    Args:
        parameter: The parameter.
        low: Lower end [unit].
        high: Upper end [unit].

    Returns:
        The width in the coordinate of the fit [-].
    """
    return parameter.to_internal(high) - parameter.to_internal(low)


def study(truth: Truth, asked: str, which: str | None, out: Path, pool: Workers) -> dict[str, Any]:
    """Calibrate a made-up food, design, make a test, and compare.

    Args:
        truth: The food.
        asked: The parameter that is asked for.
        which: The test that is made; None for the recommended one.
        out: Output folder; a calibration and a design that are there are used again.
        pool: Where the simulations run.

    Returns:
        What was promised and what was found.
    """
    before = _before(truth, out, pool)
    start = start_of_run(before.folder)
    found = _designed(start, asked, out, pool)
    name = which or found.recommended
    document: dict[str, Any] = {"food": truth.food.name, "asked": asked, "truth": dict(truth.values)}
    document |= {"width_m": truth.shape.width, "recommended": found.recommended, "made": name}
    test = next((t for t in found.tests if t.name == name), None)
    if test is not None:
        after = made_test(truth, test, start, out, pool)[asked]
        document |= _compared(start, found, test, asked, after)
    write_json(out / f"promise-{asked}-{test.kind if test else 'none'}.json", document)
    return document


def _before(truth: Truth, out: Path, pool: Workers) -> CalibrationResult:
    from calib.calibration.result import read_result

    if (out / "before" / "summary.json").is_file():
        return read_result(out / "before")
    return calibrate(first_request(truth, out), out / "before", pool, resume=(out / "before").is_dir())


def _designed(start: Start, asked: str, out: Path, pool: Workers) -> DesignResult:
    folder = out / f"design-{asked}"
    if (folder / "design.json").is_file():
        return read_design(folder)
    return design(DesignRequest(start, asked), folder, pool, resume=folder.is_dir(), say=_tell)


def _compared(
    start: Start, found: DesignResult, test: DesignedTest, asked: str, after: Mapping[str, Any]
) -> dict[str, Any]:
    """Widths before, promised and found, in the coordinate of the fit."""
    p, known = start.parameters[asked], found.known[asked]
    assert test.asked is not None
    assert known.reported is not None
    promised = width_of(p, test.asked.low95, test.asked.high95)
    kept = width_of(p, after["low95"], after["high95"])
    return {
        "reported_before": width_of(p, *known.reported),
        "before": width_of(p, known.low95, known.high95),
        "promised": promised,
        "found": kept,
        "ratio": kept / promised,
        "after": dict(after),
        "kept": abs(kept / promised - 1.0) <= KEPT,
    }


def _tell(text: str) -> None:
    sys.stderr.write(text + "\n")


def main() -> None:
    """Print what was promised and what was found."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--food", default="banana", help="food of materials.yaml (default banana)")
    parser.add_argument("--for", dest="asked", default="R", help="parameter to narrow (default R)")
    parser.add_argument("--test", help="test that is made (default: the recommended one)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the truth (default 0)")
    parser.add_argument("--out", type=Path, required=True, help="output folder")
    parser.add_argument("--workers", type=int, default=2, help="simulations at a time (default 2)")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with Pool(args.workers, "cpu") as pool:
        truth = made_up(load_food(args.food), args.seed, args.out, pool)
        found = study(truth, args.asked, args.test, args.out, pool)
    sys.stdout.write(json.dumps(found, indent=2, default=float) + "\n")


if __name__ == "__main__":
    main()
