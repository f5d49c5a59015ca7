"""From the published numbers of one cut to those of another: properties are fitted to the given ones and predict the rest.

The fit runs on the coarse grid that a calibration screens with; a run on the default grid at its end corrects each number, and
the fit goes on until that correction stands. What is not fitted is drawn from its prior for the band: for each draw the fit is
made again, to given numbers that are scattered by their own uncertainty and with priors centred on a draw from them, so that what
the numbers leave open stays open (randomised maximum likelihood: Oliver, He and Reynolds 1996). Draws that cannot meet the numbers are
left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from calib._version import __version__
from calib.errors import PublishedError
from calib.io.folder import prepare, write_json
from calib.io.provenance import code_key, git_commit
from calib.io.schema import tag
from calib.material.properties import rule_of
from calib.material.scene import cut_scene
from calib.problem.parameters import ParameterSet
from calib.scalars.gauss_newton import Aim, Minimum, descent, together
from calib.scalars.published_data import ENERGY, PEAK, QUANTITIES, Cut, Published, Scalar
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore, Header
from calib.simulation.workers import Workers
from calib.validation.prior_predictive import draw
from mpm.arrays import FloatArray
from mpm.scene import Scene

Values = Mapping[str, float]

DRAWS = 32
STRIDE = 1.0  # standard deviations of the prior to either side of a first fit, where further fits start: a peak where the cut begins
# and one in its middle are two minima
ROUNDS = 4  # fits, each corrected by the default grid at the end of the one before, at most
STANDS = 0.005  # change of the corrections below which they stand, in logarithms
MET = 2.0  # standard deviations within which a given number is met
BAND = (0.025, 0.975)
FINE, COARSE = "fine", "coarse"


def numbers(run: Evaluation, cut: Cut) -> dict[str, float]:
    """The numbers that a run has for what is published of a cut: logarithms by quantity [-]."""
    return {PEAK: math.log(run.scalars["peak_N"]), ENERGY: math.log(run.scalars["work_J"] / cut.area)}


@dataclass
class Bench:
    """Where cuts are simulated.

    Attributes:
        published: The cuts.
        evaluators: By fidelity and name of the cut.
        say: Called with a line after each batch.
        runs: Simulations that were asked for, known ones included.
        broken: Those of them that broke down.
        correction: Logarithm of default over coarse grid, by cut and quantity [-].
    """

    published: Published
    evaluators: Mapping[str, Mapping[str, CachedEvaluator]]
    say: Callable[[str], None]
    runs: int = 0
    broken: int = 0
    correction: dict[tuple[str, str], float] = field(default_factory=dict)

    def cut(self, cut: Cut, batch: Sequence[Values], fidelity: str = COARSE) -> list[dict[str, float] | None]:
        """Logarithms by quantity of each candidate, corrected where the grid is the coarse one; None for a breakdown."""
        found: list[dict[str, float] | None] = [None] * len(batch)
        for run in self.evaluators[fidelity][cut.name].evaluate(batch):
            self.runs += 1
            self.broken += not run.ok
            if run.ok:
                shift = self.correction if fidelity == COARSE else {}
                found[run.index] = {q: x + shift.get((cut.name, q), 0.0) for q, x in numbers(run, cut).items()}
        return found

    def given(self, batch: Sequence[Values]) -> list[FloatArray | None]:
        """Logarithms of the given numbers (n,) for each candidate, on the coarse grid; None for a breakdown."""
        found = {cut.name: self.cut(cut, batch) for cut in self.published.cuts if cut.given}
        out: list[FloatArray | None] = []
        for k in range(len(batch)):
            rows = [found[cut.name][k] for cut, _ in self.published.given]
            names = [scalar.quantity for _, scalar in self.published.given]
            whole = [row[name] for row, name in zip(rows, names, strict=True) if row is not None]
            out.append(np.array(whole) if len(whole) == len(rows) else None)
        self.say(f"{self.runs} simulations, {self.broken} broke down")
        return out

    def correct(self, values: Values) -> float:
        """Measure the corrections at these values; returns the largest change of one [-].

        Raises:
            PublishedError: A run there breaks down.
        """
        change = 0.0
        for cut in self.published.cuts:
            fine, coarse = self.cut(cut, [values], FINE)[0], self.cut(cut, [values])[0]
            if fine is None or coarse is None:
                raise PublishedError(
                    f"{cut.name}: its cut breaks down at {_shown(values)}; the food is squashed before it is cut: give a stiffer E "
                    "or yield_stress, or a lower R_initiation, under 'properties'"
                )
            for quantity, x in fine.items():
                step = x - coarse[quantity]
                change = max(change, abs(step))
                self.correction[cut.name, quantity] = self.correction.get((cut.name, quantity), 0.0) + step
        return change


@dataclass(frozen=True)
class Drawn:
    """What the draws came to.

    Attributes: values [SI] by name of each that met the given numbers; numbers, logarithms by cut and quantity, of the same;
    unmet, how many could not; broken, how many broke down.
    """

    values: list[dict[str, float]]
    numbers: list[dict[tuple[str, str], float]]
    unmet: int
    broken: int


def run(
    published: Published,
    out: Path,
    pool: Workers,
    *,
    draws: int = DRAWS,
    seed: int = 0,
    resume: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Fit, predict, and write scalars.json.

    Args:
        published: What was published.
        out: Output folder.
        pool: Where the simulations run.
        draws: Draws from the priors of what is not fitted; 0 for no band.
        seed: Seed of the draws and of the particles.
        resume: Go on with the runs in ``out``.
        say: Called with a line after each batch.

    Returns:
        The content of scalars.json.

    Raises:
        CutcalError: Anything wrong with the input, or a cut that breaks down at the fitted values.
    """
    scenes = {
        fidelity: {
            cut.name: cut_scene(published.food, cut.shape, published.knife, coarse=fidelity == COARSE, seed=seed)
            for cut in published.cuts
        }
        for fidelity in (COARSE, FINE)
    }
    prepare(out, resume=resume)
    with EvaluationStore(out / "evaluations.h5", Header("", "published scalars"), resume=resume) as store:
        evaluators = {fidelity: _evaluators(named, pool, store, fidelity) for fidelity, named in scenes.items()}
        bench = Bench(published, evaluators, say)
        best = fit(bench)
        found = {cut.name: bench.cut(cut, [_values(published, best)], FINE)[0] or {} for cut in published.cuts}
        drawn = band(bench, best, draws, seed)
    document = {"schema": tag("scalars"), **conclude(published, best, found, drawn)}
    document |= {"draws_asked": draws, "seed": seed, "evaluations": bench.runs, "failed_evaluations": bench.broken}
    document |= {"dx_m": {name: scene.numerics.dx for name, scene in scenes[FINE].items()}, "device": pool.arch}
    document |= {"cutcal": __version__, "commit": git_commit()}
    write_json(out / "scalars.json", document)
    return document


def _evaluators(
    scenes: Mapping[str, Scene], pool: Workers, store: EvaluationStore, fidelity: str
) -> dict[str, CachedEvaluator]:
    """Evaluators of candidates of each cut's scene, through the store."""
    return {
        name: CachedEvaluator(
            pool.evaluator(scene), store, scene=scene.as_dict(), code=code_key(), fidelity=f"{name} {fidelity}"
        )
        for name, scene in scenes.items()
    }


def _values(published: Published, end: Minimum) -> dict[str, float]:
    return published.fitted.to_dict(end.z)


def _shown(values: Values) -> str:
    return ", ".join(f"{name} = {x:.4g} {rule_of(name).unit}" for name, x in values.items())


def _aim(published: Published, noise: FloatArray | None = None, centre: FloatArray | None = None) -> Aim:
    """The given numbers, scattered by ``noise`` (n,) standard deviations, with priors about ``centre`` (p,)."""
    target = np.array([math.log(scalar.value) for _, scalar in published.given])
    sd = np.array([scalar.relative_sd for _, scalar in published.given])
    return Aim(published.fitted, target if noise is None else target + noise * sd, sd, centre)


def fit(bench: Bench) -> Minimum:
    """The fitted properties at which the default grid meets the given numbers best.

    Raises:
        PublishedError: The cut at the start or at the end breaks down.
    """
    published = bench.published
    parameters, aim = published.fitted, _aim(published)

    values = partial(_given, bench, parameters, [{}] * (1 + 2 * len(parameters)))
    ends = together([descent(aim, parameters.start)], values)
    strides = STRIDE * np.diag(parameters.prior_sd)
    ends += together([descent(aim, ends[0].z + stride) for stride in (*strides, *-strides)], values)
    for _ in range(ROUNDS):
        end = min(ends, key=lambda one: aim.half(one.z, one.y))
        if bench.correct(parameters.to_dict(end.z)) < STANDS:
            break
        ends = together([descent(aim, end.z, end.jacobian)], values)
    return end


def band(bench: Bench, best: Minimum, draws: int, seed: int) -> Drawn:
    """Fit again for each draw of what is not fitted, and predict with it.

    Args:
        bench: Where it is simulated; corrected at the best values.
        best: The fit at the values of the food.
        draws: How many draws.
        seed: Their seed.
    """
    published = bench.published
    parameters, varied = published.fitted, published.varied
    if draws == 0:
        return Drawn([], [], 0, 0)
    fixed: list[dict[str, float]] = draw(varied, draws, seed) if varied is not None else [{}] * draws
    sample = qmc.Sobol(len(published.given), scramble=True, seed=seed + 1).random_base2(math.ceil(math.log2(draws)))
    noise = norm.ppf(sample[:draws])
    centres = [parameters.to_vector(x) for x in draw(parameters, draws, seed + 2)]
    aims = [_aim(published, *both) for both in zip(noise, centres, strict=True)]
    ends: dict[int, Minimum] = {}
    places = [best.z] * draws
    for again in (False, True):
        late = [k for k in range(draws) if not _met(aims[k], ends.get(k))]
        retried = together(
            [descent(aims[k], places[k], None if again else best.jacobian) for k in late],
            partial(_given, bench, parameters, [fixed[k] for k in late]),
        )
        for k, end in zip(late, retried, strict=True):
            if k not in ends or aims[k].half(end.z, end.y) < aims[k].half(ends[k].z, ends[k].y):
                ends[k] = end
        places = centres
    whole = [k for k in range(draws) if ends[k].y is not None]
    kept = [k for k in whole if _met(aims[k], ends[k])]
    values = [fixed[k] | parameters.to_dict(ends[k].z) for k in kept]
    rows: list[dict[tuple[str, str], float]] = [{} for _ in kept]
    for cut in published.cuts:
        for row, found in zip(rows, bench.cut(cut, values), strict=True):
            row.update({(cut.name, quantity): x for quantity, x in (found or {}).items()})
    good = [k for k, row in enumerate(rows) if len(row) == len(published.cuts) * len(QUANTITIES)]
    return Drawn(
        [values[k] for k in good],
        [rows[k] for k in good],
        unmet=len(whole) - len(kept),
        broken=draws - len(whole) + len(kept) - len(good),
    )


def _given(
    bench: Bench, parameters: ParameterSet, fixed: Sequence[Values], asked: list[tuple[int, FloatArray]]
) -> list[FloatArray | None]:
    """What descents ask for, each with the values that are fixed in it."""
    return bench.given([{**fixed[k], **parameters.to_dict(z)} for k, z in asked])


def _met(aim: Aim, end: Minimum | None) -> bool:
    """Whether a fit meets all given numbers."""
    return end is not None and end.y is not None and bool(np.max(np.abs(end.y - aim.target) / aim.sd) <= MET)


def conclude(
    published: Published, best: Minimum, found: Mapping[str, Mapping[str, float]], drawn: Drawn
) -> dict[str, Any]:
    """The content of scalars.json: parameters, each number with its prediction and band, and the verdict.

    Args:
        published: What was published.
        best: The fit.
        found: Logarithms by cut and quantity on the default grid at the best values.
        drawn: The draws.
    """
    rows = [
        _row(cut, scalar, role, found[cut.name][scalar.quantity], [n[cut.name, scalar.quantity] for n in drawn.numbers])
        for cut in published.cuts
        for role, scalars in (("given", cut.given), ("predicted", cut.predicted))
        for scalar in scalars
    ]
    consistent = all(abs(r["misfit_sd"]) <= MET for r in rows if r["role"] == "given")
    predicted = all(abs(r["error"]) <= published.limit for r in rows if r["role"] == "predicted")
    return {
        "passed": consistent and predicted,
        "consistent": consistent,
        "predicted": predicted,
        "source": published.source,
        "food": published.food.name,
        "knife": published.knife.name,
        "limit": published.limit,
        "fit": list(published.fit),
        "vary": list(published.vary),
        "parameters": _parameters(published, best, drawn),
        "numbers": rows,
        "fullness": [_fullness(cut, found[cut.name]) for cut in published.cuts],
        "draws": {"met": len(drawn.numbers), "unmet": drawn.unmet, "broke_down": drawn.broken},
    }


def _row(cut: Cut, scalar: Scalar, role: str, log: float, draws: Sequence[float]) -> dict[str, Any]:
    """One number: published, simulated, and between which ends the draws have it."""
    error = log - math.log(scalar.value)
    low, high = np.exp(np.quantile(draws, BAND)) if len(draws) else (math.nan, math.nan)
    return {
        "specimen": cut.name,
        "quantity": scalar.quantity,
        "role": role,
        "published": scalar.value,
        "relative_sd": scalar.relative_sd,
        "simulated": math.exp(log),
        "error": math.expm1(error),
        "misfit_sd": error / scalar.relative_sd,
        "low95": float(low),
        "high95": float(high),
        "inside": bool(low <= scalar.value <= high) if len(draws) else None,
    }


def _fullness(cut: Cut, found: Mapping[str, float]) -> dict[str, Any]:
    """Largest over mean force: as published, as simulated, and where the force goes with the width cut."""
    simulated = math.exp(found[PEAK] - found[ENERGY]) * cut.shape.height / cut.area
    return {"specimen": cut.name, "published": cut.fullness, "simulated": simulated, "uniform": cut.uniform_fullness}


def _parameters(published: Published, best: Minimum, drawn: Drawn) -> dict[str, Any]:
    """Each fitted and drawn property: best value, where the draws that met the given numbers have it, and its prior."""
    fitted = _values(published, best)
    rows: dict[str, dict[str, Any]] = {n: {"role": "fitted", "value": x} for n, x in fitted.items()}
    rows |= {n: {"role": "drawn", "value": published.food.value(n)} for n in published.vary}
    for name, row in rows.items():
        draws = [values[name] for values in drawn.values]
        low, high = np.quantile(draws, BAND) if draws else (math.nan, math.nan)
        prior = published.food.prior(name)
        row |= {"unit": rule_of(name).unit, "low95": float(low), "high95": float(high)}
        row |= {"prior_low": prior[0], "prior_high": prior[1]}
    return rows
