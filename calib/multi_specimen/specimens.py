"""The specimens of a study: cuts of one food, fitted together.

Flesh is shared, and friction by the cuts of a knife; skin, size and the one factor of width and sensor belong to each
specimen. A fit to one trace is no test: a held-out cut is predicted with the flesh of the others
(:mod:`calib.multi_specimen.held_out`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from calib.errors import TraceError
from calib.fit.multistart import FitResult
from calib.fit.options import FitOptions
from calib.io.progress import Progress
from calib.material.properties import property_of
from calib.multi_specimen.compression_modulus import CompressionModulus, with_measured_modulus
from calib.multi_specimen.spec import StudySpec
from calib.problem.joint_objective import JointEvaluator, JointObjective
from calib.problem.nuisance import real_speed
from calib.problem.parameters import is_shared, parameter_of
from calib.problem.rate_exponent import check_speeds
from calib.problem.scored_run import ScoredRun
from calib.problem.setup import Setup, set_up
from calib.simulation.evaluation import Evaluators
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore
from calib.simulation.workers import Workers
from calib.uncertainty.analysis import UncertaintyAnalysis
from calib.uncertainty.global_search import Listener, fit_with_uncertainty
from calib.uncertainty.predictive import Band
from mpm.arrays import FloatArray
from mpm.scene import Scene


@dataclass(frozen=True, eq=False)
class JointFit:
    """A fit of several traces.

    Attributes:
        names: The traces.
        objective: What was fitted.
        result: How.
        analysis: Its uncertainty, None where it ended too early.
    """

    names: tuple[str, ...]
    objective: JointObjective
    result: FitResult
    analysis: UncertaintyAnalysis | None

    def run(self, name: str) -> ScoredRun:
        """The best run of one trace."""
        return self.result.best.each[self.names.index(name)]

    def band(self, name: str) -> Band | None:
        """Posterior predictive band of one trace, None where the fit ended too early."""
        return None if self.analysis is None else self.analysis.bands[self.names.index(name)]

    def shared_values(self, knife: str, z: FloatArray | None = None) -> dict[str, float]:
        """Values [SI] of the flesh by property, and of what a knife has of its own where it made one of the cuts.

        Args:
            knife: Name of the knife.
            z: Internal coordinates (p,); the best ones by default.

        Returns:
            The values.
        """
        values = self.result.best.evaluation.parameters if z is None else self.objective.parameters.to_dict(z)
        return {
            property_of(n): x for n, x in values.items() if is_shared(n) or n == parameter_of(property_of(n), knife)
        }

    def values(self, name: str) -> dict[str, float]:
        """All values [SI] of one trace by property."""
        parameters, values = self.objective.parameters.names, self.result.best.evaluation.parameters
        own = (parameters[k] for k in self.objective.terms[self.names.index(name)].index)
        return {property_of(n): values[n] for n in own}


@dataclass(frozen=True, eq=False)
class Specimens:
    """The traces of a study and where their simulations run.

    Attributes:
        study: The study.
        setups: What was decided for each trace.
        moduli: What compression tests say.
        pool: Where simulations run.
        store: Where they are kept.
        progress: Called after each simulation of a search.
        say: Called with each stage, as one sentence.
    """

    study: StudySpec
    setups: Mapping[str, Setup]
    moduli: tuple[CompressionModulus, ...]
    pool: Workers
    store: EvaluationStore
    progress: Callable[[Progress], None] | None = None
    say: Callable[[str], None] = field(default=lambda text: None)

    @property
    def knives(self) -> dict[str, str]:
        """Names of the knives by trace."""
        return {name: setup.fine.knife.name for name, setup in self.setups.items()}

    def own_parameters(self, name: str, known: Collection[str]) -> tuple[str, ...]:
        """Names of the parameters that a held-out trace has of its own.

        Args:
            name: The trace.
            known: Properties that the fit of the others knows for it.

        Returns:
            The specimen's, and those of a knife that made none of the other cuts.
        """
        chosen = {*self.study.specimen_properties, *(set(self.study.knife_properties) - set(known))}
        return tuple(p for p in self.setups[name].objective.parameters.names if p in chosen)

    def evaluator(self, scene: Scene, name: str, fidelity: str) -> CachedEvaluator:
        """What runs candidates of a scene of one trace.

        Args:
            scene: The scene.
            name: The trace.
            fidelity: What its simulations are called in the store, beside the trace.

        Returns:
            The evaluator.
        """
        return self.setups[name].evaluator(scene, self.pool, self.store, f"{name} {fidelity}")

    def fit(self, names: Sequence[str]) -> JointFit:
        """Fit some traces together.

        Raises:
            CutcalError: A budget too small, or no simulation that ends its stroke.
            KeyboardInterrupt: Interrupted; every simulation made so far is stored.
        """
        objective = self._joint_objective(names)
        each = [self.setups[name].evaluators(self.pool, self.store, f"{name} ") for name in names]
        evaluators = Evaluators(
            JointEvaluator(objective, [e.fine for e in each]),
            JointEvaluator(objective, [e.coarse for e in each]),
            JointEvaluator(objective, [e.replicate for e in each]),
        )
        options = FitOptions(budget=self.study.budget, batch=self.pool.batch, seed=self.study.seed)
        listener = Listener(self.staged(f"fit of {', '.join(names)}"), self.say)
        result, analysis = fit_with_uncertainty(objective, evaluators, options, listener=listener)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        return JointFit(tuple(names), objective, result, analysis)

    def _joint_objective(self, names: Sequence[str]) -> JointObjective:
        """The objectives of some traces in one, with what the compression tests say."""
        objectives = {}
        for name in names:
            own = self.setups[name].objective
            food = self.setups[name].request.food
            objectives[name] = replace(own, parameters=with_measured_modulus(own.parameters, self.moduli, food))
        properties = {p.name for o in objectives.values() for p in o.parameters}
        by_knife = own_of_knives(self.study, self.setups)
        groups = {name: dict.fromkeys(sorted(by_knife), self.knives[name]) for name in names}
        return JointObjective.of(objectives, sorted(properties - {*self.study.specimen_properties, *by_knife}), groups)

    def staged(self, stage: str) -> Callable[[Progress], None] | None:
        """The progress callback with what is being fitted before each stage."""
        call = self.progress
        return None if call is None else lambda p: call(replace(p, stage=f"{stage}: {p.stage}"))


def own_of_knives(study: StudySpec, setups: Mapping[str, Setup]) -> set[str]:
    """Properties that each knife has of its own in a study; none where there is one knife."""
    several = len({setup.fine.knife.name for setup in setups.values()}) > 1
    return set(study.knife_properties) - set(study.specimen_properties) if several else set()


def set_ups(study: StudySpec) -> dict[str, Setup]:
    """What is decided for each trace before the first simulation.

    Raises:
        CutcalError: Anything wrong with a trace; the message names it. Or a fit of the study, be it one that predicts
            a cut from the others, is asked for a rate exponent that its cuts cannot tell.
    """
    setups = {name: set_up(request) for name, request in study.requests.items()}
    for name in sorted({setup.fine.knife.name for setup in setups.values()} & set(setups)):
        raise TraceError(f"{study.source}: a trace has the name of the knife {name}; give it another one")
    fits = [study.fitted, *(tuple(n for n in study.fitted if n != held) for held in study.hold_out)]
    for names in fits:
        fitted = {p for n in names for p in setups[n].objective.parameters.names}
        speeds = {n: real_speed(setups[n].curve) for n in names}
        check_speeds(fitted, speeds, study.specimen_properties, "fit" if names == study.fitted else "hold_out:")
    return setups
