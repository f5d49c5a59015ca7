"""What the literature predicts of a cut before any trace: its default values, and draws from the priors of a fit.

Every cut is the default one (whole height, food and knife as shipped) on the coarse grid that a fit screens with.
Curves are filtered as a calibration filters them, so that a conditioned trace compares with them.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from calib._version import __version__
from calib.errors import CurveError
from calib.io.folder import prepare, write_csv, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of
from calib.io.schema import tag
from calib.material.food import FoodSpec
from calib.material.scene import Sizing, cut_scene, of_specimen, specimen
from calib.problem.food_parameters import fit_parameters
from calib.problem.parameters import ParameterSet
from calib.simulation.evaluation import FULLY_PARTED, Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header, content_key
from calib.simulation.workers import Workers
from calib.trace.filters import N_STROKE, filter_simulated
from mpm.arrays import FloatArray
from mpm.scene import Knife, Scene
from mpm.scene.shapes import volume

PRIOR_DRAWS = 32
"""Draws from the priors of each food."""
QUANTILES: Mapping[str, float] = {"q025": 0.025, "q25": 0.25, "q50": 0.5, "q75": 0.75, "q975": 0.975}
DIGITS = 6
"""Digits of a recorded number; a repeated run moves the sixth at most."""
KEY_LENGTH = 16
"""Letters of a hash that a file shows."""
DYNAMIC = 0.1
"""Kinetic energy over work above which a cut is not quasi-static any more [-]."""
START_UP, CELL_RATE = 0.1, 1e4
"""For the estimate of the time left: seconds that each run takes apart from its cells, and cells times cells of stroke
a second."""


@dataclass(frozen=True)
class Plan:
    """The cuts of one food.

    Attributes:
        food: The food.
        knife: The knife.
        scene: Its default cut on the coarse grid.
        parameters: The default fit parameters with their priors.
        candidates: Values [SI] by name: the food's own first, then the draws.
    """

    food: FoodSpec
    knife: Knife
    scene: Scene
    parameters: ParameterSet
    candidates: tuple[dict[str, float], ...]

    @property
    def stroke(self) -> FloatArray:
        """Stroke grid of the curves [m], (240,)."""
        return np.linspace(0.0, self.scene.motion.stroke, N_STROKE)

    @property
    def cost(self) -> float:
        """Seconds of one run, roughly."""
        motion, dx = self.scene.motion, self.scene.numerics.dx
        return START_UP + volume(self.scene.food.shape) / dx**3 * motion.stroke / dx / CELL_RATE

    @property
    def inputs(self) -> str:
        """Hash of everything a user may edit that the curves depend on: food, priors, knife."""
        food, knife = self.food, self.knife
        values = {name: item.value for name, item in (dict(food.dims) | dict(food.properties)).items()}
        priors = {p.name: (p.prior_low, p.prior_high) for p in self.parameters}
        blade = [knife.spine, knife.angle, knife.height, knife.length]
        return key_of([food.shape_kind, values, priors, blade])[:KEY_LENGTH]


def plan(food: FoodSpec, knife: Knife, draws: int = PRIOR_DRAWS, seed: int = 0) -> Plan:
    """The cuts of one food.

    Args:
        food: The food.
        knife: The knife.
        draws: How many draws from the priors.
        seed: Seed of the draws and of the particles.

    Returns:
        The cuts.

    Raises:
        CutcalError: A food that cannot be cut, or whose priors cannot be fitted.
    """
    shape, _ = specimen(food, None, Sizing())
    parameters = fit_parameters(food, food.default_fit)
    default = {p.name: p.value for p in parameters}
    drawn = tuple(draw(parameters, draws, seed))
    return Plan(food, knife, cut_scene(food, shape, knife, coarse=True, seed=seed), parameters, (default, *drawn))


def draw(parameters: ParameterSet, count: int, seed: int = 0) -> list[dict[str, float]]:
    """Scrambled Sobol draws from the priors, cut off at the hard bounds.

    The first draws of a larger number are those of a smaller one.

    Args:
        parameters: The parameters with their priors.
        count: How many draws.
        seed: Seed of the draws.

    Returns:
        Values [SI] by name, of each draw.

    Raises:
        CurveError: Fewer than one draw.
    """
    if count < 1:
        raise CurveError(f"{count} draws: give at least 1")
    sobol = qmc.Sobol(len(parameters), scramble=True, seed=seed)
    sample = sobol.random_base2(math.ceil(math.log2(count)))[:count]
    return [parameters.to_dict(z) for z in parameters.from_cube(sample)]


@dataclass(frozen=True)
class PriorStudy:
    """What is cut.

    Attributes:
        foods: The foods.
        knife: The knife.
        draws: Draws from the priors of each food.
        seed: Seed of the draws and of the particles.
    """

    foods: tuple[FoodSpec, ...]
    knife: Knife
    draws: int = PRIOR_DRAWS
    seed: int = 0

    def plans(self) -> list[Plan]:
        """The cuts of each food.

        Raises:
            CutcalError: A food that cannot be cut, or whose priors cannot be fitted.
        """
        return [plan(food, self.knife, self.draws, self.seed) for food in self.foods]


def run(study: PriorStudy, out: Path, pool: Workers, *, resume: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Simulate, and write prior.json, prior.svg and one CSV file for each food.

    A folder that is gone on with keeps the other foods that it has.

    Args:
        study: What is cut.
        out: Output folder.
        pool: Where the simulations run.
        resume: Go on with the runs in ``out``.
        say: Called with a line after each run.

    Returns:
        The content of prior.json.

    Raises:
        CutcalError: Anything wrong with the input; nothing that was computed is lost.
    """
    plans = study.plans()
    with prepare(out, "prior", resume=resume):
        with EvaluationStore(out / "evaluations.h5", Header("", "prior predictive"), resume=resume, say=say) as store:
            results = evaluate(plans, store, pool, say)
        about = {"knife": study.knife.name, "draws": study.draws, "seed": study.seed, "device": pool.arch}
        about |= {"cutcal": __version__, "commit": git_commit(), "solver": code_key()[:KEY_LENGTH]}
        rows = _before(out)
        for one, runs in zip(plans, results, strict=True):
            columns, row = conclude(one, runs)
            name = one.food.name
            rows[name] = about | row
            write_csv(out / f"{name}.csv", columns, head=_head(name, rows[name]), digits=DIGITS)
        document = {
            "schema": tag("prior"),
            "passed": all(rows[one.food.name]["default_status"] == "ok" for one in plans),
            "foods": rows,
        }
        write_json(out / "prior.json", document)
        from reports.calibration.prior import write_figure

        write_figure(out)
        return document


def _before(out: Path) -> dict[str, Any]:
    """Rows of an earlier run in the folder."""
    path = out / "prior.json"
    if not path.exists():
        return {}
    try:
        return dict(json.loads(path.read_text(encoding="utf-8"))["foods"])
    except (ValueError, KeyError, TypeError):
        raise CurveError(f"--resume: {path} is damaged; move it away") from None


def evaluate(
    plans: Sequence[Plan], store: EvaluationStore, pool: Workers, say: Callable[[str], None]
) -> list[list[Evaluation]]:
    """Results of all candidates of all plans; what the store knows is not run again.

    Args:
        plans: The cuts of each food.
        store: Where results are kept.
        pool: Where the simulations run.
        say: Called with a line after each run.

    Returns:
        Results of each plan, in the order of its candidates.
    """
    code = code_key()
    places = [(i, k) for i, one in enumerate(plans) for k in range(len(one.candidates))]
    keys = {(i, k): content_key(plans[i].scene.as_dict(), plans[i].candidates[k], code) for i, k in places}
    found = {place: known for place in places if (known := store.get(keys[place]))}
    new = [place for place in places if place not in found]
    if found:
        say(f"{len(found)} of {len(places)} runs are known already")
    rest = Countdown(sum(plans[i].cost for i, _ in new))
    if new:
        for done in pool.run([of_specimen(plans[i].scene, plans[i].candidates[k]) for i, k in new]):
            place = new[done.index]
            store.append(keys[place], done, "coarse")
            found[place] = done
            one = plans[place[0]]
            what = "default values" if place[1] == 0 else f"draw {place[1]}"
            state = f"{done.scalars['peak_N']:.4g} N" if done.ok else f"{done.reason} at {done.fraction:.0%}"
            left = rest.left(one.cost)
            say(f"{one.food.name}, {what}: {state}; {len(found)} of {len(places)} runs, {left}")
    return [[found[i, k] for k in range(len(one.candidates))] for i, one in enumerate(plans)]


def conclude(one: Plan, runs: Sequence[Evaluation]) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """Columns of a food's CSV file (240,), and its row of prior.json.

    A run that broke down has no part in the quantiles; the row says how many there were and why. It is nearly always a
    food that is squashed before it is cut: soft, with a resistance of several millimetres times its stiffness.

    Args:
        one: The plan.
        runs: Results in the order of its candidates.

    Returns:
        The columns by name, and the row.
    """
    grid = one.stroke
    curves = [filter_simulated(grid, r.stroke, r.force) if r.ok else np.full_like(grid, np.nan) for r in runs]
    kept = np.array([c for c, r in zip(curves[1:], runs[1:], strict=True) if r.ok]).reshape(-1, grid.size)
    band = _quantiles(kept)
    columns = {"stroke_m": grid, "default_N": curves[0]} | {f"{name}_N": band[name] for name in QUANTILES}
    measures = {"peak_N": lambda c: c.max(axis=-1), "work_J": lambda c: np.trapezoid(c, grid, axis=-1)}
    row: dict[str, Any] = {
        "default_status": runs[0].status if runs[0].ok else runs[0].reason,
        "finished": len(kept),
        "failed": dict(Counter(r.reason for r in runs[1:] if not r.ok)),
        "pressed": sum(r.ok and r.completed < 1.0 for r in runs[1:]),
        "dynamic": sum(r.scalars["ke_over_ie"] > DYNAMIC for r in runs[1:] if r.ok),
        "parameters": list(one.parameters.names),
        "inputs": one.inputs,
        "dx_m": one.scene.numerics.dx,
    }
    for name, measure in measures.items():
        row[name] = {"default": float(measure(curves[0]))} | {k: float(v) for k, v in _quantiles(measure(kept)).items()}
    return columns, row


def _quantiles(values: FloatArray) -> dict[str, FloatArray]:
    """Quantiles along the first axis, by name; NaN where there is no value."""
    if len(values) == 0:
        return dict.fromkeys(QUANTILES, np.full(values.shape[1:], np.nan))
    return {name: np.quantile(values, q, axis=0) for name, q in QUANTILES.items()}


def _head(name: str, row: Mapping[str, Any]) -> list[str]:
    """Comments at the top of a food's CSV file."""
    failed = sum(row["failed"].values())
    reasons = ", ".join(f"{count} {reason}" for reason, count in row["failed"].items())
    left_out = f" ({reasons}: too soft for their resistance), left out of the quantiles" if failed else ""
    spans = []
    for key, unit in (("peak_N", "N"), ("work_J", "J")):
        x = row[key]
        spans.append(f"{key[:4]}: {x['default']:.4g} {unit}, draws {x['q025']:.4g} to {x['q975']:.4g} {unit} (95 %)")
    return [
        f"Prior predictive of {name}: simulated, not measured. "
        "Force on the knife over stroke before any trace is seen.",
        f"command: cutcal prior {name} --knife {row['knife']} --draws {row['draws']} --seed {row['seed']}",
        "scene: default specimen, cut through its whole height, "
        f"coarse grid ({row['dx_m'] * 1e3:.4g} mm), filtered as a fit does",
        "default_N: at the values of materials.yaml",
        "q025_N to q975_N: quantiles, at each stroke, of scrambled Sobol draws from the priors of "
        + ", ".join(row["parameters"]),
        "  (95 % ranges of materials.yaml; log-normal, mu normal; cut off at the bounds of a fit); "
        "all else as in materials.yaml",
        f"draws: {row['draws']}, broke down: {failed}{left_out}",
        f"  pressed away, not cut: {row['pressed']} of the others "
        f"(the edge takes less than {FULLY_PARTED:g} of R times the new area), in the quantiles",
        f"  not quasi-static: {row['dynamic']} of the others "
        f"(kinetic energy over {DYNAMIC * 100:g} % of the work: soft, and cut late)",
        *spans,
        f"cutcal {row['cutcal']}, solver {row['solver']}, commit {row['commit'] or 'unknown'}",
        f"inputs: {row['inputs']}",
    ]
