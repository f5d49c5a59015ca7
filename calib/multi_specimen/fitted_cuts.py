"""The cuts of a joint fit, each repeated at its best values and checked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from calib.multi_specimen.specimens import JointFit, Specimens
from calib.problem.nuisance import NuisanceEstimate
from calib.problem.scored_run import ScoredRun
from calib.problem.setup import Setup
from calib.simulation.record_file import record_errands
from calib.uncertainty.predictive import Band
from calib.validation.acceptance import Conservation, Verdict, agreement, balances, changes
from calib.validation.metrics import Metrics, compare
from calib.validation.null_models import null_models
from calib.validation.numerical_checks import QUARTER_SPEED, VARIED, Check, check, check_errands, further_errands
from mpm.arrays import FloatArray
from mpm.scene import Scene


@dataclass(frozen=True, eq=False)
class FittedCut:
    """One cut of a joint fit, in-sample.

    Attributes:
        setup: What was decided for its trace.
        run: Its best run.
        values: All its values [SI] by property.
        scene: The fine cut at these values.
        band: Its posterior predictive band, None where the fit ended too early.
        checks: What numerical choices change.
    """

    setup: Setup
    run: ScoredRun
    values: dict[str, float]
    scene: Scene
    band: Band | None
    checks: list[Check]

    @cached_property
    def factor(self) -> float:
        """Factor of width and sensor on the simulated force [-]."""
        return self.setup.objective.factor(self.run.curve)

    @property
    def curve(self) -> FloatArray:
        """Simulated force with that factor [N] (n,)."""
        return self.factor * self.run.curve

    @cached_property
    def metrics(self) -> Metrics:
        """The simulated against the measured curve."""
        return compare(self.setup.curve.stroke, self.setup.curve.curve, self.curve)

    @cached_property
    def nulls(self) -> dict[str, Metrics]:
        """Curves that explain nothing against the measured one, by name."""
        return {n: m.metrics for n, m in null_models(self.setup.curve.stroke, self.setup.curve.curve).items()}

    @property
    def nuisances(self) -> tuple[NuisanceEstimate, ...]:
        """What the fit says of the measurement, the factor's logarithm with it."""
        objective = self.setup.objective
        return (*objective.nuisance_estimates(self.run.curve), *objective.factor_estimate(self.run.curve))

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Lines of its verdict: agreement with the trace, balances, numerical choices."""
        kept = balances(Conservation.of(self.run.evaluation))
        return (*agreement(self.metrics), *kept, *changes(self.checks))

    @property
    def passed(self) -> bool:
        """Whether no line of its verdict failed."""
        return all(v.passed is not False for v in self.verdicts)


def fitted_cuts(specimens: Specimens, fit: JointFit, out: Path) -> dict[str, FittedCut]:
    """Simulate the best values of each fitted cut once more, whole and otherwise, and check.

    Args:
        specimens: The traces and where their simulations run.
        fit: The fit.
        out: Output folder, in which ``record-NAME.h5`` of each cut is written.

    Returns:
        The cuts by name.
    """
    store, setups = specimens.store, specimens.setups
    scenes = {name: setups[name].scene(fit.values(name)) for name in fit.names}
    errands = [e for name, scene in scenes.items() for e in check_errands(scene, store, fit.values(name))]
    errands += [e for name, scene in scenes.items() for e in record_errands(scene, out / f"record-{name}.h5")]
    if errands:
        specimens.say(f"simulating the best values of {', '.join(fit.names)} once more: whole, and {VARIED}")
        specimens.pool.errands(errands)
    ways = {name: setups[name].curve.stroke_length_m for name in scenes}
    more = [e for n, scene in scenes.items() for e in further_errands(scene, fit.run(n).evaluation, store, ways[n])]
    if more:
        specimens.say(f"simulating the best values once more: {QUARTER_SPEED}, as half of it still changes the force")
        specimens.pool.errands(more)
    cuts = {}
    for name, scene in scenes.items():
        setup, run, values = setups[name], fit.run(name), fit.values(name)
        checks = check(scene, run.evaluation, store, ways[name], values)
        cuts[name] = FittedCut(setup, run, values, scene, fit.band(name), checks)
    return cuts
