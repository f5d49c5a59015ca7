"""The result of a calibration from what was computed: every figure that a report quotes, in SI units."""

from __future__ import annotations

import io
import math
import time
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import h5py
import numpy as np

from calib.calibration.calibrated import Calibrated, FittedWithdrawal
from calib.calibration.result import CalibrationResult
from calib.calibration.result_parts import (
    Agreement,
    AirSource,
    BrokenRun,
    Conditioning,
    FixedParameter,
    NullRating,
    Posterior,
    ProfileCurve,
    SearchHistory,
    SimulatedCut,
    SobolIndices,
    Tally,
    TraceSource,
)
from calib.calibration.withdrawal_result import FitWithout, WithdrawalAgreement
from calib.errors import OutputError
from calib.fit.multistart import FitResult
from calib.io.meaning import describe_sets
from calib.io.provenance import Invocation, Software
from calib.material.form import known_of
from calib.material.properties import property_of
from calib.posterior.estimates import summarised
from calib.problem.parameters import STRESS_LIKE
from calib.problem.request import Request
from calib.problem.setup import Setup
from calib.simulation.evaluation import doubts_of_the_crack
from calib.simulation.evaluation_frame import evaluation_frame
from calib.simulation.evaluation_meanings import meaning_of
from calib.trace.conditioning import Conditioned
from calib.uncertainty.analysis import UncertaintyAnalysis
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.uncertainty.intervals import Uncertainty
from calib.uncertainty.limiting import limiting
from calib.validation.acceptance import CURVE_LINE, FIT_NRMSE_LIMIT, Conservation, Verdict, judge
from calib.validation.bounds import bound_word
from calib.validation.not_shown import limits
from mpm.files import write_atomic
from mpm.output.number_text import quantity
from mpm.output.record import ForceRecord
from mpm.scene import Knife

WITHDRAWAL_LINE = "curve error of the withdrawal (NRMSE)"
WITH_WIDTH = 0.5
"""An interval that a measured width would make shorter than this part of it belongs to the product with the width."""


def summarise(done: Calibrated, folder: Path, began: float) -> CalibrationResult:
    """The result of a calibration: judged, and with all that a document says.

    Args:
        done: What was computed.
        folder: The output folder.
        began: When the calibration began, by ``time.monotonic`` [s].

    Returns:
        The result.
    """
    setup, fit, analysis, record = done.setup, done.fit, done.analysis, done.record
    request, curve = setup.request, setup.curve
    fitted, nuisances, verdicts = _fitted(request, fit, analysis), _nuisances(done), verdicts_of(done)
    stopped = fit.status == "interrupted"
    label, source, kind = curve.trace.label, curve.stroke_source, curve.baseline_kind
    scene = setup.scene(fit.best.evaluation.parameters)
    assumed = [*setup.assumptions, *doubts_of_the_crack(scene)]
    said = [*limits(label, source, kind, verdicts, fitted, assumed, request.food, record.fracture), *_no_better(done)]
    nulls = {name: NullRating.of(model.metrics) for name, model in done.nulls.items()}
    return CalibrationResult(
        folder=folder,
        food=request.food.name,
        created=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        status="interrupted" if stopped else "done",
        search=fit.status,
        passed=not stopped and all(v.passed is not False for v in verdicts),
        verdicts=tuple(verdicts),
        trace=_trace(curve),
        air=None if request.air is None else AirSource(request.air_source, setup.air_sha256),
        conditioning=Conditioning.of(curve, setup.bandwidth),
        agreement=Agreement(done.metrics, nulls, curve.peak_sd_N),
        fitted=fitted,
        nuisances=nuisances,
        posterior=_posterior(setup, fit, analysis),
        fixed_parameters=_fixed(request, fitted),
        history=_history(fit, _kept(folder)),
        cut=_cut(setup, record),
        software=Software.here(),
        invocation=Invocation(request.seed, request.arch, tuple(request.command)),
        numerical_checks=tuple(done.checks),
        warnings=tuple(setup.warnings),
        limits=(*(() if analysis is None else analysis.remarks), *_limiting(setup, analysis), *said),
        sensitivity=_sensitivity(done),
        sampled=None if done.posterior is None else summarised(done.posterior),
        withdrawal=_withdrawal(done),
        wall_s=time.monotonic() - began,
    )


def verdicts_of(done: Calibrated) -> list[Verdict]:
    """The verdict table of what was computed.

    Args:
        done: What was computed.

    Returns:
        All lines; those with ``passed`` None were not run and decide nothing.
    """
    record = done.record
    lines = judge(
        done.metrics,
        {name: model.metrics for name, model in done.nulls.items()},
        conservation=Conservation(record.momentum_residual, record.ke_over_ie, record.parted, record.lost),
        fitted=_fitted(done.setup.request, done.fit, done.analysis),
        checks=done.checks,
        nuisances=_nuisances(done),
        predictive=done.predictive,
    )
    if done.withdrawal is not None:
        lines.insert(1 + [line.name for line in lines].index(CURVE_LINE), _withdrawal_line(done.withdrawal))
    return lines


def _withdrawal_line(up: FittedWithdrawal) -> Verdict:
    """The line of the way up. A pull is small, so what its level leaves open is a part of the limit."""
    level, largest = up.measured.level_sd_N, float(up.measured.pull.max())
    limit = math.hypot(FIT_NRMSE_LIMIT, level / largest)
    note = f"of the largest pull, {quantity(largest, 'N')}; its level is known to {quantity(level, 'N', digits=2)}"
    return Verdict(WITHDRAWAL_LINE, up.nrmse, limit, "fraction", bool(up.nrmse <= limit), note)


def _nuisances(done: Calibrated, way: int = 0) -> dict[str, FittedNuisance]:
    """What the fit says of the measurement, by name: on the way down (0), or on the way up (1)."""
    if done.analysis is None:
        return {}
    counts = [len(term.objective.nuisances) for term in done.objective.terms]
    first = sum(counts[:way])
    return {e.name: FittedNuisance.of(e) for e in done.analysis.nuisances[first : first + counts[way]]}


def _withdrawal(done: Calibrated) -> WithdrawalAgreement | None:
    """The way up against the trace."""
    found = done.withdrawal
    if found is None:
        return None
    way, pull = found.measured.way, found.measured.pull
    return WithdrawalAgreement(
        from_m=float(way[0]),
        to_m=float(way[-1]),
        speed_m_s=found.measured.speed,
        peak_real_N=float(pull.max()),
        peak_sim_N=float(found.curve.max()),
        nrmse=found.nrmse,
        work_real_J=float(np.trapezoid(pull, way)),
        work_sim_J=float(np.trapezoid(found.curve, way)),
        predictive_inside=None if found.band is None else found.band.inside,
        nuisances=_nuisances(done, 1),
        without={m.name: FitWithout(m.value, m.chi_square, m.whole, m.evidence) for m in done.nested},
    )


def _no_better(done: Calibrated) -> list[str]:
    """A sentence on curves with a few free numbers that have the better band."""
    better = () if done.predictive is None else done.predictive.better
    if not better:
        return []
    named = " and ".join(name.replace("_", " ") for name in better)
    return [f"A curve without physics has the better band, by its interval score: {named}."]


def _limiting(setup: Setup, analysis: UncertaintyAnalysis | None) -> list[str]:
    """A sentence on what widens the interval of R most of what nobody measured."""
    found = None if analysis is None else limiting(setup.objective, analysis.uncertainty)
    said = None if found is None else found.sentence
    return [] if said is None else [said]


def _sensitivity(done: Calibrated) -> dict[str, dict[str, SobolIndices]]:
    return {
        quantity: {name: SobolIndices(**row) for name, row in rows.items()}
        for quantity, rows in done.sensitivity.items()
    }


def _trace(curve: Conditioned) -> TraceSource:
    trace = curve.trace
    duration = float(trace.time[-1] - trace.time[0])
    return TraceSource(trace.source, trace.label, trace.sha256, len(trace.time), duration, dict(trace.columns))


def _fitted(request: Request, fit: FitResult, analysis: UncertaintyAnalysis | None) -> dict[str, FittedParameter]:
    """The fitted parameters; those that are only known as a product are called so."""
    found = None if analysis is None else analysis.uncertainty
    sampled = {} if analysis is None else analysis.sampled
    products = set() if found is None else _products(found)
    out = {}
    for k, p in enumerate(fit.parameters):
        known = known_of(request.food, p.name)
        one = FittedParameter.of(p if found is None else found.intervals[k], known, sampled.get(p.name))
        product = p.name in products and one.verdict in ("identified", "weak")
        out[p.name] = replace(one, verdict="only_as_product" if product else bound_word(p.name, one))
    return out


def _products(found: Uncertainty) -> set[str]:
    """Names of the parameters that are known only times another one, or times a width that nobody measured."""
    tied = {name for tie in found.only_as_product for name in tie.combination.split()}
    width = {n for n, part in found.known_width().items() if part < WITH_WIDTH and property_of(n) in STRESS_LIKE}
    return tied | width


def _posterior(setup: Setup, fit: FitResult, analysis: UncertaintyAnalysis | None) -> Posterior:
    """Profiles, the size and correlation of the errors, and how much of the trace lies in the predictive band."""
    if analysis is None:
        return Posterior(correlations={}, discrepancy=setup.request.errors.discrepancy)
    found, chosen, names = analysis.uncertainty, setup.objective.parameters, fit.parameters.names
    profiles = {
        p.name: ProfileCurve(
            tuple(chosen[p.name].from_internal(z) for z in p.z),
            tuple(float(x) for x in p.rise),
            tuple(float(x) for x in p.data),
        )
        for p in analysis.profiles
    }
    open_ended = limiting(setup.objective, found)
    pairs = [(i, j) for i in range(len(names)) for j in range(i)]
    return Posterior(
        profiles=profiles,
        reduced_chi2=found.reduced_chi2,
        correlation_length_m=found.data.lengths[0] * setup.curve.stroke_length_m,
        predictive_inside=analysis.bands[0].inside,
        correlations={f"{names[i]},{names[j]}": float(found.correlation[i, j]) for i, j in pairs},
        R_if_known=None if open_ended is None else open_ended.parts,
        discrepancy=setup.request.errors.discrepancy,
    )


def _fixed(request: Request, fitted: Mapping[str, FittedParameter]) -> dict[str, FixedParameter]:
    return {
        name: FixedParameter(p.value, p.unit, p.status, p.source)
        for name, p in request.food.properties.items()
        if name not in fitted
    }


def _history(fit: FitResult, kept: Mapping[str, Tally]) -> SearchHistory:
    history, best = [], math.inf
    for number, trial in enumerate(fit.history, 1):
        if trial.ok and not trial.coarse and trial.misfit < best:
            best = trial.misfit
        if math.isfinite(best):
            history.append((number, best))
    failed = [t.evaluation for t in (*fit.history, *fit.replicates) if not t.ok]
    return SearchHistory(
        simulations=fit.simulations + fit.coarse_simulations,
        fine_simulations=fit.simulations,
        coarse_simulations=fit.coarse_simulations,
        failed_simulations=len(failed),
        failures=tuple(BrokenRun(e.reason, e.fraction, e.parameters) for e in failed),
        misfit_history=tuple(history),
        repeatability=None if math.isnan(fit.repeatability) else fit.repeatability,
        kept=kept,
    )


def _kept(folder: Path) -> dict[str, Tally]:
    """How many simulations the store of a run holds, by what they were made for, and how many of them failed."""
    table = evaluation_frame(folder)
    groups = table["status"].groupby(table["fidelity"])
    return {str(kind): Tally(len(status), int((status != "ok").sum())) for kind, status in groups}


def _cut(setup: Setup, record: ForceRecord) -> SimulatedCut:
    scene = setup.fine
    assert isinstance(scene.knife, Knife)  # a press has no trace of a cut
    return SimulatedCut(
        dx_m=scene.numerics.dx,
        particles=record.particles,
        mirror_images=record.images,
        mach=scene.motion.mach,
        speed_real_m_s=setup.request.speed,
        momentum_residual=record.momentum_residual,
        ke_over_ie=record.ke_over_ie,
        ripple_N=record.ripple,
        energy_J=record.budget,
        fracture=record.fracture,
        parted=None if math.isnan(record.parted) else record.parted,
        counters=dict(record.counters),
        shape=scene.food.shape,
        knife=scene.knife,
        scene=scene.as_dict(),
    )


def add_conditioning(path: Path, curve: Conditioned) -> None:
    """Write the whole record into ``/conditioning`` of a closed store: time [s], raw and tared force [N].

    A copy is changed and put in place of the store, so that a kill on the way leaves the store as it was.

    Raises:
        OutputError: The file cannot be written.
    """
    columns = {"time_s": curve.time, "raw_N": curve.trace.force, "tared_N": curve.force}
    try:
        stream = io.BytesIO(path.read_bytes())
        with h5py.File(stream, "r+") as file:
            if "conditioning" in file:
                del file["conditioning"]
            group = file.create_group("conditioning")
            for name, values in columns.items():
                group[name] = values
            describe_sets(file, meaning_of)
        write_atomic(path, stream.getvalue(), sync=True)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e}); check the disk") from None
