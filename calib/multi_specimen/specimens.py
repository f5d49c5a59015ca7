"""Several cuts of one food, fitted together and held out in turn: the test that a fit to one trace is not.

Flesh and blade are shared; skin, size and the one factor of width and sensor belong to each specimen.  A held-out cut is
predicted with the flesh of the others: only what its own specimen has for itself is fitted to it (:mod:`calib.multi_specimen.held_out`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib.compression.measured import area, read_repeats, strain_grid
from calib.compression.modulus import fit
from calib.compression.press import UnitCurve, homogeneous
from calib.fit.multistart import FitResult
from calib.fit.options import FitOptions
from calib.io.progress import Progress
from calib.io.provenance import code_key
from calib.multi_specimen.study_file import Press, Study
from calib.problem.joint_objective import JointEvaluator, JointObjective
from calib.problem.parameters import Z95, Parameter, ParameterSet, own, plain
from calib.problem.request import Setup
from calib.problem.setup import set_up
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore
from calib.simulation.workers import Workers
from calib.uncertainty.analysis import Doubt
from calib.uncertainty.global_search import infer
from calib.validation.numerical_checks import otherwise
from mpm.scene import Scene
from mpm.scene.shapes import Shape

FloatArray = np.ndarray

PRESS_STRAIN = 0.2
"""Strain up to which a compression test is fitted [-]: flesh yields beyond."""
PLATES = 0.13
"""Relative standard deviation of a modulus from plates whose friction is not known: half of what lies between frictionless plates
and bonded ones, which give 26 % less for thirteen silicones (docs/compression.md)."""


@dataclass(frozen=True)
class Pressed:
    """Young's modulus from a compression test.

    Attributes: name; E [Pa]; spread, its relative standard deviation [-], of the repeats and of what is not known of the plates;
    repeats; nu assumed; files.
    """

    name: str
    E: float
    spread: float
    repeats: int
    nu: float
    files: list[dict[str, str]]


def pressed(press: Press) -> Pressed:
    """Young's modulus of a compression test between frictionless plates, in closed form of the solver's law.

    Raises:
        CutcalError: The test cannot be used.
    """
    sizes = press.sizes
    wide = sizes.get("diameter", sizes.get("width", 0.0))
    kind = "upright_cylinder" if "diameter" in sizes else "block"
    shape = Shape(kind, sizes.get("length", wide), wide, sizes["height"])
    measured = read_repeats(press.traces, shape, PRESS_STRAIN)
    grid = strain_grid(PRESS_STRAIN)
    found = fit(measured, UnitCurve(grid, homogeneous(press.nu, grid), {"area_m2": area(shape)}))
    spread = float(np.hypot(found.sd / found.mean if len(found.E) > 1 else 0.0, PLATES))
    return Pressed(press.name, found.mean, spread, len(found.E), press.nu, measured.files)


def pinned(parameters: ParameterSet, tests: Sequence[Pressed]) -> ParameterSet:
    """The parameters with the prior of E sharpened by compression tests, as independent lognormal measurements."""
    if not tests or "E" not in parameters.names:
        return parameters
    old = parameters["E"]
    means = [old.prior_mean, *(float(np.log(t.E)) for t in tests)]
    precisions = np.array([old.prior_sd**-2, *(t.spread**-2 for t in tests)])
    mean = float(np.dot(means, precisions) / precisions.sum())
    half = Z95 / float(np.sqrt(precisions.sum()))
    low, high = float(np.exp(mean - half)), float(np.exp(mean + half))
    new = replace(
        old,
        value=float(np.exp(mean)),
        low=min(old.low, low / 2.0),
        high=max(old.high, high * 2.0),
        prior_low=low,
        prior_high=high,
    )
    return ParameterSet(tuple(new if p.name == "E" else p for p in parameters))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A joint fit.

    Attributes:
        names: Its traces.
        objective: What was fitted.
        result: How.
        doubt: What it does not know, None where it ended too early.
    """

    names: tuple[str, ...]
    objective: JointObjective
    result: FitResult
    doubt: Doubt | None

    def flesh(self, z: FloatArray | None = None) -> dict[str, float]:
        """Shared values [SI] by property: the best ones, or those at internal coordinates ``z`` (p,)."""
        values = self.result.best.evaluation.parameters if z is None else self.objective.parameters.to_dict(z)
        return {name: x for name, x in values.items() if name == plain(name)}

    def values(self, name: str) -> dict[str, float]:
        """All values [SI] of one trace by property."""
        values = self.result.best.evaluation.parameters
        return {plain(n): x for n, x in values.items() if n == plain(n) or n == own(plain(n), name)}


@dataclass
class Specimens:
    """The traces of a study and where their simulations run.

    Attributes:
        study: The study.
        pool: Where simulations run.
        store: Where they are kept.
        progress: Called after each simulation.
        say: Called with each stage, as one sentence.
        setups: What was decided for each trace.
        tests: Compression tests.
    """

    study: Study
    setups: Mapping[str, Setup]
    tests: tuple[Pressed, ...]
    pool: Workers
    store: EvaluationStore
    progress: Callable[[Progress], None] | None = None
    say: Callable[[str], None] = field(default=lambda text: None)

    def own_parameters(self, name: str) -> tuple[Parameter, ...]:
        """What the specimen of a trace has for itself."""
        return tuple(p for p in self.setups[name].objective.parameters if p.name in self.study.own)

    def evaluator(self, scene: Scene, name: str, fidelity: str) -> CachedEvaluator:
        """Evaluator of candidates of a trace's scene, through the store."""
        kept = self.setups[name].kept
        return CachedEvaluator(
            self.pool.evaluator(scene, kept),
            self.store,
            scene=scene.as_dict() | {"kept": kept},
            code=code_key(),
            fidelity=f"{name} {fidelity}",
        )

    def fit(self, names: Sequence[str]) -> Fitted:
        """Fit some traces together.

        Raises:
            CutcalError: A budget too small, or no simulation that ends its stroke.
            KeyboardInterrupt: Interrupted; every simulation made so far is stored.
        """
        setups = {name: self.setups[name] for name in names}
        objectives = {
            name: replace(s.objective, parameters=pinned(s.objective.parameters, self.tests))
            for name, s in setups.items()
        }
        present = {p.name for o in objectives.values() for p in o.parameters}
        joint = JointObjective.of(objectives, sorted(present - set(self.study.own)))
        fine, coarse, again = (
            JointEvaluator(joint, [self.evaluator(scene(s), name, fidelity) for name, s in setups.items()])
            for fidelity, scene in (
                ("fine", lambda s: s.fine),
                ("coarse", lambda s: s.coarse),
                ("again", lambda s: otherwise(s.fine)),
            )
        )
        options = FitOptions(budget=self.study.budget, batch=self.pool.batch, seed=self.study.seed)
        words = f"fit of {', '.join(names)}"
        staged = self.staged(words)
        result, doubt = infer(joint, fine, coarse=coarse, again=again, options=options, progress=staged, say=self.say)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        return Fitted(tuple(names), joint, result, doubt)

    def staged(self, words: str) -> Callable[[Progress], None] | None:
        """The progress callback with what is being fitted before each stage."""
        call = self.progress
        return None if call is None else lambda p: call(replace(p, stage=f"{words}: {p.stage}"))


def set_ups(study: Study) -> dict[str, Setup]:
    """What is decided for each trace before the first simulation.

    Raises:
        CutcalError: Anything wrong with a trace; the message names it.
    """
    return {name: set_up(request) for name, request in study.requests.items()}
