"""A study of several cuts from its specification to its results.

:func:`run` decides the problem of each trace, fits without each held-out one and predicts it, fits all together,
repeats the best values for their records and the numerical checks, judges, and writes.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

from calib.io.folder import prepare, write_csv
from calib.io.progress import Progress
from calib.io.provenance import Invocation, Software, key_of
from calib.io.wording import listed
from calib.material.food import FoodSpec
from calib.material.food_file import dump_material
from calib.material.form import known_of
from calib.material.properties import property_of
from calib.material.remarks import notes
from calib.multi_specimen.compression_modulus import CompressionModulus, compression_modulus
from calib.multi_specimen.fitted_cuts import FittedCut, fitted_cuts
from calib.multi_specimen.held_out import HeldOutPrediction, predict
from calib.multi_specimen.result import HeldOutCut, InSampleCut, StudyParameter, StudyResult, write_result
from calib.multi_specimen.spec import StudySpec
from calib.multi_specimen.specimens import JointFit, Specimens, own_of_knives, set_ups
from calib.problem.parameters import is_shared
from calib.problem.setup import Setup
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.workers import Workers
from mpm.arrays import FloatArray
from mpm.output.number_text import quantity


def run(
    study: StudySpec,
    out: Path,
    pool: Workers,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> StudyResult:
    """Run a study and write all outputs.

    These are summary.json, material.yaml, curves-NAME.csv, record-NAME.h5 of each fitted cut, and report.pdf.

    Args:
        study: What to fit and what to hold out.
        out: Output folder.
        pool: Where the simulations run.
        resume: Go on with the study in ``out``; nothing is simulated twice.
        progress: Called after each simulation.
        say: Called with each warning and stage, as one sentence.

    Returns:
        The content of ``summary.json``.

    Raises:
        CutcalError: Anything wrong with the input; nothing that was computed is lost.
    """
    say = say or (lambda text: None)
    began = time.monotonic()
    setups = set_ups(study)
    moduli = tuple(compression_modulus(spec) for spec in study.compressions)
    for text in _warnings(notes(study.food), setups):
        say(text)
    with prepare(out, "study", resume=resume):
        with EvaluationStore(out / "evaluations.h5", _header(setups), resume=resume, say=say) as store:
            specimens = Specimens(study, setups, moduli, pool, store, progress, say)
            held_out = {name: _held_out(specimens, name) for name in study.hold_out}
            say(f"fitting {', '.join(study.fitted)} together")
            fit = specimens.fit(study.fitted)
            done = Finished(study, setups, moduli, fit, fitted_cuts(specimens, fit, out), held_out, len(store))
        return _write(done, out, began)


@dataclass(frozen=True, eq=False)
class Finished:
    """What a study has found, before it is written.

    Attributes:
        study: The study.
        setups: What was decided for each trace.
        moduli: What compression tests say.
        fit: The final fit.
        cuts: Its cuts, by name.
        held_out: Predictions, by name of the trace.
        simulations: Number of simulations that are stored.
    """

    study: StudySpec
    setups: Mapping[str, Setup]
    moduli: tuple[CompressionModulus, ...]
    fit: JointFit
    cuts: Mapping[str, FittedCut]
    held_out: Mapping[str, HeldOutPrediction]
    simulations: int

    def result(self, wall_s: float) -> StudyResult:
        """The content of ``summary.json``, of a study that took so long [s]."""
        study, fit, analysis = self.study, self.fit, self.fit.analysis
        held_out = {name: HeldOutCut.of(p, self.setups[name]) for name, p in self.held_out.items()}
        traces = {name: InSampleCut.of(cut) for name, cut in self.cuts.items()}
        return StudyResult(
            food=study.food.name,
            study=study.source,
            created=datetime.now(timezone.utc).isoformat(timespec="seconds"),
            status="done",
            search=fit.result.status,
            passed=all(c.passed for c in self.cuts.values()) and all(p.passed for p in self.held_out.values()),
            held_out=tuple(held_out),
            scatter=study.scatter,
            hold_out=held_out,
            traces=traces,
            parameters=self._parameters(),
            reduced_chi2=None if analysis is None else analysis.uncertainty.reduced_chi2,
            failed_simulations=fit.result.failed,
            limits=(*(() if analysis is None else analysis.remarks), *self._limits()),
            presses={m.name: m for m in self.moduli},
            warnings=tuple(_warnings(self.study.food.warnings(), self.setups)),
            simulations=self.simulations,
            wall_s=wall_s,
            invocation=Invocation(study.seed, study.first.arch, study.first.command),
            software=Software.here(),
            correlations=self._correlations(),
            discrepancy=next(iter(self.setups.values())).request.errors.discrepancy,
        )

    def _parameters(self) -> dict[str, StudyParameter]:
        """Value, interval and verdict of each parameter, shared and own."""
        food, analysis = self.study.food, self.fit.analysis
        out = {}
        for k, p in enumerate(self.fit.result.parameters):
            found = p if analysis is None else analysis.uncertainty.intervals[k]
            known = known_of(food, property_of(p.name))
            if property_of(p.name) == "E" and self.moduli:
                known = replace(known, status="measured", source=_pressed(self.moduli, known.source))
            out[p.name] = StudyParameter.of_study(found, known, shared=is_shared(p.name))
        return out

    def _correlations(self) -> dict[str, float] | None:
        """Posterior correlation of each pair of parameters; None where the fit ended too early."""
        names, analysis = self.fit.result.parameters.names, self.fit.analysis
        if analysis is None:
            return None
        matrix = analysis.uncertainty.correlation
        return {f"{names[i]},{names[j]}": float(matrix[i, j]) for i in range(len(names)) for j in range(i)}

    def _limits(self) -> list[str]:
        """What the study does not show, one sentence each."""
        held, scatter = self.held_out, self.study.scatter
        said = [f"{name}: {p.metrics.iso18571.caveat}." for name, p in held.items() if p.metrics.iso18571.caveat]
        if held:
            said.append(
                f"The figures of {', '.join(held)} are predictions from the other cuts; all others are in-sample: of "
                "cuts that were fitted."
            )
        if held and scatter > 0.0:
            said.append(
                f"The band of a held-out cut lets each property of the flesh scatter by {100 * scatter:.0f} % among "
                "specimens, which these cuts did not show: it is the study's assumption, by default that of gripped "
                "fruit."
            )
        if not held:
            said.append("All figures are in-sample: nothing was held out, and nothing here is validated.")
        said.append(
            "Each specimen has one factor on its force, for its width and the gain of its sensor, and its own skin and "
            "size: the flesh is known in proportions, and absolutely only as well as the widths and the sensors are."
        )
        by_knife = own_of_knives(self.study, self.setups)
        fitted = sorted(by_knife & {property_of(p.name) for p in self.fit.result.parameters})
        if fitted:
            first = self.setups[self.fit.names[0]].fine.knife.name
            said.append(f"Each knife has its own {listed(fitted)}; material.yaml has that of the knife {first}.")
        said.append(f"{len(self.setups)} cuts say little of the scatter between specimens.")
        return said

    def curves(self, name: str) -> dict[str, FloatArray]:
        """Columns of curves-NAME.csv on the trace's stroke grid."""
        curve, cut, predicted = self.setups[name].curve, self.cuts.get(name), self.held_out.get(name)
        columns = {"stroke_m": curve.stroke, "real_N": curve.curve}
        if cut is not None:
            columns["sim_N"] = cut.curve
        if cut is not None and cut.band is not None:
            columns |= {"band_low_N": cut.band.low, "band_high_N": cut.band.high}
        if predicted is not None:
            band = predicted.band
            columns |= {"predicted_N": predicted.curve, "predicted_low_N": band.low, "predicted_high_N": band.high}
        return columns

    def food(self) -> FoodSpec:
        """The food with the flesh of the fit."""
        food = self.study.food
        knife = self.setups[self.fit.names[0]].fine.knife.name
        flesh = {n: x for n, x in self.fit.shared_values(knife).items() if n in food.properties}
        source = f"fitted to {', '.join(self.fit.names)} of {self.study.source}"
        return food.with_values(flesh, status="fitted", source=source)


def _pressed(moduli: Sequence[CompressionModulus], before: str) -> str:
    """Where the range of E comes from, where compression tests have narrowed it.

    Args:
        moduli: The tests.
        before: Where the range was from without them.
    """
    tests = "; ".join(f"{m.name}, {quantity(m.E, 'Pa')} to {quantity(m.spread, 'fraction', digits=2)}" for m in moduli)
    return f"compression: {tests}. Before: {before}".replace("\u00a0", " ")


def _write(done: Finished, out: Path, began: float) -> StudyResult:
    """Write curves-NAME.csv, material.yaml, summary.json and report.pdf; returns what summary.json holds."""
    from calib.multi_specimen.report import write_report

    for name in done.setups:
        write_csv(out / f"curves-{name}.csv", done.curves(name))
    result = done.result(time.monotonic() - began)
    hashes = {name: cut.trace.sha256 for name, cut in result.traces.items()}
    software = result.software
    provenance = {"passed": result.passed, "git": software.git, "versions": software.versions}
    dump_material(done.food(), out / "material.yaml", {"study": result.study, "traces": hashes, **provenance})
    write_result(result, out)
    write_report(out)
    return result


def _warnings(of_food: Sequence[str], setups: Mapping[str, Setup]) -> list[str]:
    """Warnings of the food and of each trace, each once."""
    found = list(of_food)
    for name, setup in setups.items():
        found += [f"{name}: {text}" for text in (*setup.curve.warnings, *setup.assumptions)]
    return found


def _header(setups: Mapping[str, Setup]) -> Header:
    """What the store belongs to: all traces in their order, and their scenes."""
    sha256 = hashlib.sha256("".join(s.curve.trace.sha256 for s in setups.values()).encode()).hexdigest()
    return Header(sha256, key_of({name: s.fine.as_dict() for name, s in setups.items()}))


def _held_out(specimens: Specimens, name: str) -> HeldOutPrediction:
    """Fit the other traces and predict this one."""
    others = [other for other in specimens.study.fitted if other != name]
    specimens.say(f"holding out {name}: fitting {', '.join(others)}")
    return predict(specimens, specimens.fit(others), name)
