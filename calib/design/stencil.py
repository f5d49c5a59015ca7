"""Simulations about a point: the curve there, beside it along each parameter, and once more with other particles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.io.progress import Countdown
from calib.io.provenance import code_key
from calib.material.properties import BOARD_SUCTION, BOW
from calib.material.scene import FITTED_SIZES, of_specimen, with_other_particles
from calib.problem.parameters import LOG_STEP, ParameterSet
from calib.problem.setup import REPLICATE
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, content_key
from calib.simulation.workers import Workers
from mpm.arrays import FloatArray
from mpm.scene import Scene

LARGEST_STEP = 0.5
"""Longest step of a difference on a log scale [-]: a factor of 1.65 either way."""
CENTRE, AGAIN = -1, -2  # in place of the number of a parameter
HALVINGS = 2
"""Times that a step is halved where the food breaks down or is pressed away there."""


@dataclass(frozen=True, eq=False)
class CutScene:
    """A cut of which sensitivities are wanted.

    Attributes:
        scene: The cut at any values.
        fitted: Whether its specimen is the one whose sizes, roundness and bow are fitted; else they are known and no
            parameters of it.
        kept: Sizes that do not follow a fitted height.
    """

    scene: Scene
    fitted: bool = False
    kept: tuple[str, ...] = ()

    def at(self, values: Mapping[str, float]) -> tuple[Scene, dict[str, float]]:
        """The scene and the material's values, at values of all parameters. A board that lets air under the food goes
        on to do so."""
        foreign = set() if self.fitted else {*FITTED_SIZES, BOW}
        if not self.scene.suction > 0:
            foreign.add(BOARD_SUCTION)
        values = {name: x for name, x in values.items() if name not in foreign}
        return of_specimen(self.scene, values, self.kept if self.fitted else ())


@dataclass(eq=False)
class Stencil:
    """What was simulated about a point.

    Attributes:
        centre: The cut at the point.
        again: The same with other particles and the grid elsewhere.
        sides: Step in internal coordinates (signed) and cut beside the point, by parameter; those that were cut.
    """

    centre: Evaluation
    again: Evaluation
    sides: list[list[tuple[float, Evaluation]]] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """Whether the food is cut at the point, in both runs."""
        return self.centre.completed == 1.0 and self.again.completed == 1.0

    @property
    def fault(self) -> str:
        """Why it is not, in words."""
        run = self.again if self.centre.completed == 1.0 else self.centre
        if run.ok:
            return f"the edge takes {run.parted:.0%} of R times the new area, so the food is pressed away there"
        return f"it breaks down at {run.fraction:.0%} of its stroke ({run.reason})"


class Simulator:
    """Runs cuts of a design; what the store knows is not run again.

    Args:
        pool: Where they run.
        store: Where they are kept.
        say: Called with a line after each run.
    """

    def __init__(self, pool: Workers, store: EvaluationStore, say: Callable[[str], None]) -> None:
        self.pool, self.store, self.say = pool, store, say
        self.runs = self.failed = 0
        self._code = code_key()

    def run(self, jobs: Sequence[tuple[Scene, dict[str, float]]]) -> list[Evaluation]:
        """Results of jobs, in their order; each different one is made once."""
        keys = [content_key(scene.as_dict(), values, self._code) for scene, values in jobs]
        found = {key: known for key in dict.fromkeys(keys) if (known := self.store.get(key)) is not None}
        wanted = list({key: job for key, job in zip(keys, jobs, strict=True) if key not in found}.items())
        rest = Countdown(sum(cost(scene) for _, (scene, _) in wanted))
        for done, result in enumerate(self.pool.run([job for _, job in wanted]), 1):
            key, (scene, _) = wanted[result.index]
            self.store.append(key, result, "design")
            found[key] = result
            self.runs += 1
            self.failed += not result.ok
            self.say(f"{done} of {len(wanted)} simulations, {rest.left(cost(scene))}")
        return [found[key] for key in keys]


def cost(scene: Scene) -> float:
    """What a run takes, in any unit: cells of the food times steps."""
    shape, dx = scene.food.shape, scene.numerics.dx
    way = scene.motion.stroke / (dx * scene.motion.mach)
    return shape.length * shape.width * shape.height / dx**3 * way * (2.0 if scene.motion.slice_ratio else 1.0)


def steps_of(parameters: ParameterSet, sd: FloatArray) -> FloatArray:
    """Steps of the differences: one standard deviation of what is known, within what a straight line can stand.

    Args:
        parameters: The parameters.
        sd: Present standard deviations in internal coordinates [-], (p,).

    Returns:
        Steps in internal coordinates [-], (p,).
    """
    high = [LARGEST_STEP if p.log else p.prior_sd for p in parameters]
    low = [LOG_STEP if p.log else p.step for p in parameters]
    return np.clip(sd, low, high)


def stencils(
    simulator: Simulator, cuts: Mapping[str, CutScene], parameters: ParameterSet, z: FloatArray, steps: FloatArray
) -> dict[str, Stencil]:
    """Simulate cuts about a point, all of them as one batch; steps at which no food is cut are halved.

    Args:
        simulator: Runs them.
        cuts: The cuts, by name.
        parameters: The parameters.
        z: Internal coordinates of the point [-], (p,).
        steps: Steps along each parameter [-], (p,).

    Returns:
        What was simulated, by name.
    """
    jobs: list[tuple[Scene, dict[str, float]]] = []
    places: list[tuple[str, int, float]] = []
    for name, cut in cuts.items():
        scene, values = cut.at(parameters.to_dict(z))
        jobs += [(scene, values), (with_other_particles(scene, REPLICATE), values)]
        places += [(name, CENTRE, 0.0), (name, AGAIN, 0.0)]
        for k, step in enumerate(steps):
            for signed in _within(parameters, z, k, float(step)):
                jobs.append(cut.at(parameters.to_dict(_moved(z, k, signed))))
                places.append((name, k, signed))
    found = list(zip(places, simulator.run(jobs), strict=True))
    whole = {(name, k): run for (name, k, _), run in found if k < 0}
    out = {name: Stencil(whole[name, CENTRE], whole[name, AGAIN], [[] for _ in steps]) for name in cuts}
    missing = _sorted_in(out, [one for one in found if one[0][1] >= 0])
    for _ in range(HALVINGS):
        wanted = [(name, k, signed / 2.0) for name, k, signed in missing if out[name].sound]
        if not wanted:
            break
        shorter = [cuts[n].at(parameters.to_dict(_moved(z, k, signed))) for n, k, signed in wanted]
        missing = _sorted_in(out, list(zip(wanted, simulator.run(shorter), strict=True)))
    return out


def _sorted_in(
    out: dict[str, Stencil], found: Sequence[tuple[tuple[str, int, float], Evaluation]]
) -> list[tuple[str, int, float]]:
    """Add the runs beside the point to their stencils; returns the places at which no food was cut."""
    missing = []
    for place, run in found:
        name, k, signed = place
        if run.completed == 1.0:
            out[name].sides[k].append((signed, run))
        else:
            missing.append(place)
    return missing


def _moved(z: FloatArray, k: int, step: float) -> FloatArray:
    out = z.copy()
    out[k] += step
    return out


def _within(parameters: ParameterSet, z: FloatArray, k: int, step: float) -> list[float]:
    """Steps along a parameter in both directions that stay within its bounds, shorter ones where need be."""
    up, down = float(parameters.upper[k] - z[k]), float(z[k] - parameters.lower[k])
    return [signed for signed in (min(step, up), -min(step, down)) if abs(signed) > 0.2 * step]
