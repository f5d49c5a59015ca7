"""A study of several cuts from its file to its results: fit without each held-out one, predict it, fit all, judge, write."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from calib.io.folder import prepare, write_csv, write_json
from calib.io.progress import Progress
from calib.io.provenance import git_commit, key_of, versions
from calib.io.schema import tag
from calib.material.food import FoodSpec, dump_material
from calib.material.properties import MEANINGS
from calib.material.scene import place
from calib.multi_specimen.held_out import Prediction, predict
from calib.multi_specimen.specimens import Fitted, Specimens, pressed, set_ups
from calib.multi_specimen.study_file import Study
from calib.problem.parameters import property_of
from calib.problem.setup import Setup
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.record_file import record_errands
from calib.simulation.workers import Workers
from calib.trace.conditioning import Conditioned
from calib.validation.acceptance import agreement, balances, changes
from calib.validation.metrics import compare
from calib.validation.null_models import null_models
from calib.validation.numerical_checks import VARIED, Check, check, check_errands
from mpm.scene import Scene


def run(
    study: Study,
    out: Path,
    pool: Workers,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run a study and write summary.json, material.yaml, curves-NAME.csv, record-NAME.h5 of each fitted cut, and report.pdf.

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
    from reports.study import write_report

    say = say or (lambda text: None)
    began = time.monotonic()
    setups = set_ups(study)
    tests = tuple(pressed(p) for p in study.presses)
    for text in _said(study, setups):
        say(text)
    prepare(out, resume=resume)
    header = Header(_sha256(setups), key_of({n: s.fine.as_dict() for n, s in setups.items()}))
    first = next(iter(study.requests.values()))
    with EvaluationStore(out / "evaluations.h5", header, resume=resume) as store:
        specimens = Specimens(study, setups, tests, pool, store, progress, say)
        held = {name: _held_out(specimens, name) for name in study.hold_out}
        kept = [n for n in setups if n not in study.hold_out] or list(setups)
        say(f"fitting {', '.join(kept)} together")
        fitted = specimens.fit(kept)
        scenes = {name: _scene(specimens, fitted, name) for name in kept}
        errands = [e for scene in scenes.values() for e in check_errands(scene, store)]
        errands += [e for name, scene in scenes.items() for e in record_errands(scene, out / f"record-{name}.h5")]
        if errands:
            say(f"simulating the best values of {', '.join(kept)} once more: whole, and {VARIED}")
            pool.errands(errands)
        checks = {n: check(s, _own(fitted, n), store, setups[n].curve.stroke_length_m) for n, s in scenes.items()}
        runs = len(store)
    for name, setup in setups.items():
        write_csv(out / f"curves-{name}.csv", _curves(setup, fitted, held.get(name), name))
    summary = _summary(study, setups, fitted, held, checks, scenes)
    summary |= {
        "presses": {t.name: vars(t) for t in tests},
        "warnings": _said(study, setups),
        "simulations": runs,
        "wall_s": time.monotonic() - began,
        "seed": study.seed,
        "device": first.arch,
        "command": list(first.command),
        "versions": versions(),
        "git": git_commit(),
    }
    dump_material(_food(study, fitted), out / "material.yaml", _provenance(study, summary))
    write_json(out / "summary.json", summary)
    write_report(out, MEANINGS)
    return summary


def _said(study: Study, setups: Mapping[str, Setup]) -> list[str]:
    """Warnings of the food and of each trace, each once."""
    found = list(study.food.warnings())
    for name, setup in setups.items():
        found += [f"{name}: {text}" for text in (*setup.curve.warnings, *setup.assumed)]
    return found


def _sha256(setups: Mapping[str, Setup]) -> str:
    """One hash of all traces in their order."""
    return hashlib.sha256("".join(s.curve.trace.sha256 for s in setups.values()).encode()).hexdigest()


def _held_out(specimens: Specimens, name: str) -> Prediction:
    """Fit the other traces and predict this one."""
    others = [n for n in specimens.setups if n != name and n not in _always_out(specimens)]
    specimens.say(f"holding out {name}: fitting {', '.join(others)}")
    return predict(specimens, specimens.fit(others), name)


def _always_out(specimens: Specimens) -> tuple[str, ...]:
    """Traces that are in no fit: those held out by name, but not all of them in turn."""
    out = specimens.study.hold_out
    return () if set(out) == set(specimens.setups) else out


def _scene(specimens: Specimens, fitted: Fitted, name: str) -> Scene:
    """One fitted cut at the values of the fit."""
    setup = specimens.setups[name]
    scene, values = place(setup.fine, fitted.values(name), setup.kept)
    return scene.with_material(**values)


def _own(fitted: Fitted, name: str) -> Evaluation:
    """The best simulation of one trace."""
    return fitted.result.best.evaluation.parts[fitted.names.index(name)]


def _summary(
    study: Study,
    setups: Mapping[str, Setup],
    fitted: Fitted,
    held: Mapping[str, Prediction],
    checks: Mapping[str, list[Check]],
    scenes: Mapping[str, Scene],
) -> dict[str, Any]:
    """Everything but the provenance."""
    traces = {name: _trace(setups[name], fitted, name, checks[name], scenes[name]) for name in fitted.names}
    predicted = {name: {"trace": _source(setups[name])} | p.as_dict() for name, p in held.items()}
    passed = [t["passed"] for t in traces.values()] + [p.passed for p in held.values()]
    return {
        "schema": tag("study"),
        "food": study.food.name,
        "study": study.source,
        "created": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "status": "done",
        "search": fitted.result.status,
        "passed": all(passed),
        "held_out": list(held),
        "scatter": study.scatter,
        "hold_out": predicted,
        "traces": traces,
        "parameters": _parameters(study, fitted),
        "reduced_chi2": None if fitted.analysis is None else fitted.analysis.uncertainty.reduced_chi2,
        "failed_simulations": fitted.result.failed,
        "limits": [
            *(() if fitted.analysis is None else fitted.analysis.remarks),
            *_limits(held, setups, study.scatter),
        ],
    }


def _trace(setup: Setup, fitted: Fitted, name: str, checks: list[Check], scene: Scene) -> dict[str, Any]:
    """One fitted trace: in-sample figures with the specimen's factor, what the measurement left open, numerical checks."""
    k = fitted.names.index(name)
    trial, curve = fitted.result.best.each[k], setup.curve
    scale = setup.objective.factor(trial.curve)
    metrics = compare(curve.stroke, curve.curve, scale * trial.curve)
    scalars = trial.evaluation.scalars
    kept = balances(scalars["momentum_residual"], scalars["ke_over_ie"], trial.evaluation.parted)
    lines = [*agreement(metrics), *kept, *changes(checks)]
    return {
        "trace": _source(setup),
        "in_sample": True,
        "passed": all(v.passed is not False for v in lines),
        "verdicts": [v.as_dict() for v in lines],
        "metrics": metrics.as_dict(),
        "factor": scale,
        "nuisances": {e.name: e.as_dict() for e in setup.objective.nuisance_estimates(trial.curve)},
        "predictive_inside": None if fitted.analysis is None else fitted.analysis.bands[k].inside,
        "null_models": {n: {"R": m.metrics.iso18571.R, "nrmse": m.metrics.nrmse} for n, m in _nulls(curve).items()},
        "numerical_checks": [c.as_dict() for c in checks],
        "scalars": scalars,
        "values": fitted.values(name),
        "dx_m": setup.fine.numerics.dx,
        "shape": vars(scene.food.shape),
        "knife": vars(scene.knife),
    }


def _source(setup: Setup) -> dict[str, str]:
    trace = setup.curve.trace
    return {"source": trace.source, "sha256": trace.sha256, "label": trace.label}


def _nulls(curve: Conditioned) -> dict[str, Any]:
    return dict(null_models(curve.stroke, curve.curve))


def _parameters(study: Study, fitted: Fitted) -> dict[str, Any]:
    """Value, interval and verdict of each parameter, shared and own."""
    out: dict[str, Any] = {}
    for k, p in enumerate(fitted.result.parameters):
        if fitted.analysis is not None:
            entry: dict[str, Any] = dict(fitted.analysis.uncertainty.intervals[k].as_dict())
        else:
            entry = {"value": p.value, "unit": p.unit, "low95": None, "high95": None}
            entry |= {"prior_low": p.prior_low, "prior_high": p.prior_high, "verdict": "unknown"}
        known = (
            study.food.dims["height"] if property_of(p.name) == "height" else study.food.properties[property_of(p.name)]
        )
        out[p.name] = entry | {"status": known.status, "source": known.source, "shared": p.name == property_of(p.name)}
    return out


def _limits(held: Mapping[str, Prediction], setups: Mapping[str, Setup], scatter: float) -> list[str]:
    """What the study does not show, one sentence each."""
    said = [f"{name}: {p.metrics.iso18571.caveat}." for name, p in held.items() if p.metrics.iso18571.caveat]
    if held:
        said.append(
            f"The figures of {', '.join(held)} under hold_out are predictions; those under traces are in-sample."
        )
        if scatter > 0.0:
            said.append(
                f"The band of a held-out cut lets each property of the flesh scatter by {100 * scatter:.0f} % among specimens, which these cuts "
                "did not show: it is the study's assumption, by default that of gripped fruit."
            )
    else:
        said.append("All figures are in-sample: nothing was held out, and nothing here is validated.")
    said.append(
        "Each specimen has one factor on its force, for its width and the gain of its sensor, and its own skin and size: the flesh "
        "is known in proportions, and absolutely only as well as the widths and the sensors are."
    )
    said.append(f"{len(setups)} cuts say little of the scatter between specimens.")
    return said


def _curves(setup: Setup, fitted: Fitted, held: Prediction | None, name: str) -> dict[str, Any]:
    """Columns of curves-NAME.csv on the trace's stroke grid."""
    columns: dict[str, Any] = {"stroke_m": setup.curve.stroke, "real_N": setup.curve.curve}
    if name in fitted.names:
        k = fitted.names.index(name)
        curve = fitted.result.best.each[k].curve
        columns["sim_N"] = setup.objective.factor(curve) * curve
        if fitted.analysis is not None:
            columns |= {"band_low_N": fitted.analysis.bands[k].low, "band_high_N": fitted.analysis.bands[k].high}
    if held is not None:
        columns |= {
            "predicted_N": held.curve,
            "predicted_low_N": held.band.low,
            "predicted_high_N": held.band.high,
        }
    return columns


def _food(study: Study, fitted: Fitted) -> FoodSpec:
    """The food with the flesh of the fit."""
    names = ", ".join(fitted.names)
    flesh = {n: x for n, x in fitted.flesh().items() if n != "height"}
    return study.food.with_values(flesh, status="fitted", source=f"fitted to {names} of {study.source}")


def _provenance(study: Study, summary: Mapping[str, Any]) -> dict[str, Any]:
    hashes = {n: t["trace"]["sha256"] for n, t in summary["traces"].items()}
    return {"study": study.source, "traces": hashes, **{k: summary[k] for k in ("passed", "git", "versions")}}
