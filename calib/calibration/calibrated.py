"""What a calibration has computed when its last simulation has ended, before it is judged and written."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from calib.calibration.members import nrmse
from calib.fit.multistart import FitResult
from calib.material.food import FoodSpec
from calib.material.form import ROUNDNESS, with_roundness
from calib.posterior.posterior import SampledPosterior
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective
from calib.problem.scored_run import ScoredRun
from calib.problem.setup import Setup
from calib.problem.withdrawal import BothWays, Withdrawal
from calib.uncertainty.analysis import UncertaintyAnalysis
from calib.uncertainty.nested_models import NestedModel
from calib.uncertainty.predictive import Band
from calib.uncertainty.sobol import Indices, sensitivity
from calib.validation.metrics import Metrics, compare
from calib.validation.null_models import NullModel, null_models
from calib.validation.numerical_checks import Check
from calib.validation.predictive_score import PredictiveScore, predictive_score
from calib.validation.prior_conflict import PriorConflict, prior_conflict, probability_of_size
from mpm.arrays import FloatArray
from mpm.output.record import ForceRecord


@dataclass(frozen=True, eq=False)
class FittedWithdrawal:
    """The way up of the best run.

    Attributes:
        measured: That of the trace.
        curve: Simulated pull on its grid, filtered as it was [N], shape (n,).
        band: Its 95 % band; None where the fit ended too early.
    """

    measured: Withdrawal
    curve: FloatArray
    band: Band | None

    @property
    def nrmse(self) -> float:
        """Root mean square difference over the largest measured pull [-]."""
        return nrmse(self.measured.way, self.measured.pull, self.curve)

    def columns(self) -> dict[str, FloatArray]:
        """Columns of withdrawal.csv, all on the way up."""
        way, pull = self.measured.way, self.measured.pull
        found = {"way_m": way, "real_N": pull, "sim_N": self.curve, "residual_N": self.curve - pull}
        return found if self.band is None else {**found, "band_low_N": self.band.low, "band_high_N": self.band.high}


@dataclass(frozen=True, eq=False)
class Calibrated:
    """What a calibration has found, before it is written.

    Attributes:
        setup: What was decided before; its fine cut has the fitted sizes and roundness.
        fit: The search and its best run.
        analysis: Its uncertainty; None where it ended too early for that.
        record: Whole record of the best values.
        checks: What numerical choices change; none where the search was interrupted.
        start: Smoothed curve of the literature's values [N] (n,), NaN where that run broke down or was not made.
        posterior: The posterior over all plausible foods, where it was sampled.
        both: The way up that was fitted beside the way down, if it was.
        nested: The fit of both ways without R, without friction and without adhesion, where these were fitted.
    """

    setup: Setup
    fit: FitResult
    analysis: UncertaintyAnalysis | None
    record: ForceRecord
    checks: list[Check]
    start: FloatArray
    posterior: SampledPosterior | None = None
    both: BothWays | None = None
    nested: tuple[NestedModel, ...] = ()

    @property
    def objective(self) -> Objective | JointObjective:
        """What was fitted: the way down, or both ways."""
        return self.setup.objective if self.both is None else self.both.objective

    @property
    def best(self) -> ScoredRun:
        """The best run, its way down."""
        return self.fit.best.each[0]

    @property
    def withdrawal(self) -> FittedWithdrawal | None:
        """The way up, where it was fitted."""
        if self.both is None:
            return None
        bands = () if self.analysis is None else self.analysis.bands
        return FittedWithdrawal(self.both.withdrawal, self.fit.best.each[1].curve, bands[1] if bands else None)

    @cached_property
    def metrics(self) -> Metrics:
        """The best curve against the trace."""
        curve = self.setup.curve
        return compare(curve.stroke, curve.curve, self.best.curve)

    @cached_property
    def nulls(self) -> dict[str, NullModel]:
        """Curves that explain nothing, against the trace."""
        return null_models(self.setup.curve.stroke, self.setup.curve.curve)

    @cached_property
    def predictive(self) -> PredictiveScore | None:
        """How good the predictive band is; None where the fit ended too early for one."""
        if self.analysis is None:
            return None
        band = self.analysis.bands[0]
        score = predictive_score(self._explained, (band.low, band.high), self.setup.curve.curve, self.nulls)
        size = probability_of_size(self.setup.request.food, self.setup.fine.food.shape)
        return replace(score, conflict=self._conflict, size=size)

    @property
    def _conflict(self) -> PriorConflict:
        """How far the values are from what was known of the food: those of the posterior, or the best ones."""
        if self.posterior is not None:
            drawn = self.posterior.z
            spread = np.atleast_2d(np.cov(drawn, rowvar=False))  # a number where one property is fitted
            return prior_conflict(self.fit.parameters, np.mean(drawn, axis=0), spread)
        assert self.analysis is not None
        return prior_conflict(self.fit.parameters, self.fit.best.z, self.analysis.uncertainty.covariance)

    @property
    def _explained(self) -> float:
        """Posterior predictive p-value [-]: of the sampled posterior, or of the best curve by chi-square."""
        if self.posterior is not None:
            return self.posterior.explained
        assert self.analysis is not None
        return min(
            self.analysis.uncertainty.probability,
            float(chi2.sf(self.fit.best.misfit, self.objective.effective_rows)),
        )

    @cached_property
    def sensitivity(self) -> Indices:
        """Sobol indices of the curve; empty where the fit ended too early."""
        return sensitivity(self.setup.objective, self.fit, seed=self.setup.request.seed)

    def curves(self) -> dict[str, FloatArray]:
        """Columns of curves.csv, all on the trace's stroke grid."""
        curve, best, record = self.setup.curve, self.best.curve, self.record
        columns = {"stroke_m": curve.stroke, "real_N": curve.curve, "sim_N": best, "residual_N": best - curve.curve}
        smooth = self.setup.objective.target.smooth
        columns["edge_N"] = smooth(curve.stroke, record.stroke, record.edge[:, 2])
        columns["face_N"] = smooth(curve.stroke, record.stroke, record.resolved_face)
        columns["start_N"] = self.start
        columns |= {f"{name}_N": null.curve for name, null in self.nulls.items()}
        if self.analysis is not None:
            columns |= {"band_low_N": self.analysis.bands[0].low, "band_high_N": self.analysis.bands[0].high}
        if math.isfinite(self.setup.bandwidth):  # whoever filters another simulation needs it
            columns["after_contact_s"] = curve.clock
        return columns

    def food(self) -> FoodSpec:
        """The food with the fitted values, and the specimen's sizes and roundness where these were fitted."""
        setup, values = self.setup, dict(self.fit.best.evaluation.parameters)
        fitted = {"status": "fitted", "source": f"fitted to {setup.curve.trace.source}"}
        height, aspect = (values.pop(name, None) for name in ("height", "aspect"))
        roundness = values.pop(ROUNDNESS, None)
        food = setup.request.food.with_values(values, **fitted)
        if roundness is not None:
            food = with_roundness(food, roundness, **fitted)
        shape = setup.fine.food.shape
        if aspect is not None and height is None:  # or the fitted width would be that of another height
            source = f"of the specimen of {setup.curve.trace.source}"
            food = food.with_sizes({"height": shape.height}, status="given", source=source)
        new = set() if height is None else {"height", "width"} - set(setup.kept)
        if aspect is not None:
            new.add("width")
        return food.with_sizes({name: getattr(shape, name) for name in sorted(new)}, **fitted)
