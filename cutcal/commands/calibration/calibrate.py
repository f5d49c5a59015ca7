"""``calibrate`` (also ``cutcal calibrate``): fit a food to a knife-force trace and report."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.io.progress import ProgressBar
from calib.multi_specimen.spec import StudySpec, study_of_cuts
from calib.problem.request import Request
from calib.problem.target import ErrorModel
from calib.trace.baselines import BASELINES, CONSTANT
from calib.trace.cuts import WHOLE
from cutcal.options import (
    RESUME_HELP,
    RUN,
    add_food,
    add_run,
    add_workers,
    food_of,
    note,
    number,
    print_json,
    sizing_of,
    titled,
    whole,
    workers_of,
)
from cutcal.surroundings import interrupted
from mpm.output.number_text import terminal_rung
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from calib.calibration.result import CalibrationResult
    from calib.multi_specimen.result import HeldOutCut, InSampleCut, StudyParameter, StudyResult
    from calib.uncertainty.estimates import FittedParameter

MEASUREMENT = "measurement"  # title of the group of options that say what was measured
HEIGHT_HELP = "column of the knife's height ('none'), or --depth-col"
RATE_HELP = "rows a second without a clock; --decimal is , or ."
CHECK_HELP = "say how the trace is read (and draw it), then end"
BASELINE_HELP = f"of a force without --air: {', '.join(BASELINES)}"
HELP = "fit a food to a measured knife-force trace, and report"
DESCRIPTION = """Fit a food to a knife-force trace. Exit: 0 passed, 1 error, 2 did not pass."""
EPILOG = """example:
  calibrate --food potato --trace cut.csv --air air.csv --check"""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.usage = "%(prog)s --food NAME --trace FILE [options]"
    add_trace(p, required=False)
    add_food(p, required=False)
    titled(p, MEASUREMENT).add_argument(
        "--all", action="store_true", help="all cuts in the file, as specimens of one food"
    )
    fit = titled(p, RUN)
    fit.add_argument("--config", metavar="YAML", help="fit the cuts of this study, in place of --trace")
    fit.add_argument("--fit", metavar="NAMES", help="properties, e.g. E,nu,R,mu (default: those a cut sees)")
    fit.add_argument("--budget", type=number(0, 1e6, ""), metavar="N", help="most simulations of a trace (default 100)")
    fit.add_argument(
        "--discrepancy",
        type=number(0, 1, "-"),
        metavar="PART",
        help="how far a right model may be, of the peak (0.03)",
    )
    fit.add_argument("--withdrawal", action="store_true", help="fit the way up too: it tells R, friction and adhesion")
    fit.add_argument("--sample", action="store_true", help="sample all plausible foods (needs dynesty)")
    fit.add_argument("--u-num", metavar="DIR", help="a converge study whose uncertainty the fit heeds")
    fit.add_argument("--start-from", metavar="DIR", help="begin at the foods of earlier calibrations there")
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--check", nargs="?", const="", metavar="PNG", help=CHECK_HELP)
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def add_trace(p: argparse.ArgumentParser, *, required: bool = True) -> None:
    """Options that say what was measured."""
    g = p.add_argument_group(MEASUREMENT)
    g.add_argument("--trace", required=required, metavar="FILE", help="record of the cut, or the name of a bundled one")
    g.add_argument("--air", metavar="FILE", help="the same motion without food, to be subtracted")
    g.add_argument("--time-col", metavar="NAME", help="column of the time; NAME=UNIT says its unit")
    g.add_argument("--force-col", metavar="NAME", help="column of the force on the knife")
    g.add_argument("--position-col", metavar="NAME", help=HEIGHT_HELP)
    g.add_argument("--depth-col", metavar="NAME", help=argparse.SUPPRESS)
    g.add_argument("--sign", choices=("+", "-"), metavar="+|-", help="sign that makes resistance positive")
    g.add_argument("--rate", type=number(0, 1e6, "/s"), metavar="HZ", help=RATE_HELP)
    g.add_argument("--decimal", choices=(".", ","), metavar="MARK", help=argparse.SUPPRESS)
    g.add_argument("--speed", type=number(0, 10, "m/s"), metavar="M/S", help="of the knife, where there is no position")
    height = number(-100, 100, "m")
    g.add_argument("--board-z", type=height, metavar="M", help="what its height reads with the edge on the board [m]")
    doubt = "doubt of the sensor's gain (0.02), --lag-sd of delay"
    g.add_argument("--gain-sd", type=number(0, 1, "-"), metavar="PART", help=doubt)
    g.add_argument("--lag-sd", type=number(0, 1, "s"), metavar="S", help=argparse.SUPPRESS)
    g.add_argument(
        "--bandwidth",
        type=number(1, 1e5, "/s"),
        metavar="HZ",
        help="cut-off of the sensor's low-pass, if any",
    )
    g.add_argument("--baseline", choices=BASELINES, default=CONSTANT, metavar="KIND", help=BASELINE_HELP)
    g.add_argument("--cut", type=cut_number, metavar="N", help="which of several cuts in the file ('whole': it is one)")
    time = number(-math.inf, math.inf, "s")
    g.add_argument("--t-end", type=time, metavar="S", help="leave out what is later [s] (board contact)")


def cut_number(text: str) -> int | str:
    """The number of a cut, or the word that says there is one.

    Raises:
        ArgumentTypeError: It is neither.
    """
    return text if text == WHOLE else whole(1)(text)


BUDGET = 100.0
"""Simulations that a calibration on one trace may take."""


def request_of(args: argparse.Namespace, command: Sequence[str]) -> Request:
    """The request that the options make.

    Raises:
        CutcalError: An impossible value, an unknown name, a missing file.
    """
    named = None if args.fit is None else tuple(n.strip() for n in args.fit.split(",") if n.strip())
    if named == ():
        raise CutcalError(f"--fit {args.fit!r} names no property; give for instance --fit E,R, or leave it out")
    u_num = None if args.u_num is None else Path(args.u_num)
    errors = ErrorModel() if args.discrepancy is None else ErrorModel(discrepancy=args.discrepancy)
    return replace(
        measured(args, command),
        errors=errors,
        fit=named,
        budget=args.budget or BUDGET,
        u_num=u_num,
        start_from=None if args.start_from is None else Path(args.start_from),
        sample=args.sample,
        withdrawal=args.withdrawal,
    )


def measured(args: argparse.Namespace, command: Sequence[str]) -> Request:
    """The part of a request that says what was cut and measured.

    Raises:
        CutcalError: An impossible value, an unknown name, a missing file.
    """
    how = ("time_col", "force_col", "position_col", "depth_col", "sign", "rate", "decimal")
    columns: dict[str, Any] = {name: getattr(args, name) for name in how}
    return Request(
        food=food_of(args),
        trace=Path(args.trace),
        air=None if args.air is None else Path(args.air),
        columns=columns,
        knife=args.knife,
        speed=args.speed,
        board_z=args.board_z,
        t_end=args.t_end,
        baseline=args.baseline,
        cut=args.cut,
        gain_sd=args.gain_sd,
        lag_sd=args.lag_sd,
        bandwidth=args.bandwidth,
        sizing=sizing_of(args),
        dx=args.dx,
        seed=args.seed,
        arch=args.arch,
        command=tuple(command),
    )


def run(args: argparse.Namespace) -> int:
    """Calibrate; prints the verdict, or the summary as JSON."""
    from calib.calibration.description import description
    from calib.calibration.result import to_document
    from calib.calibration.run import run as calibrate

    command = ["calibrate", *(a for a in sys.argv[1:] if a != "calibrate")]
    of_one = [name.replace("_", "-") for name in ("sample", "withdrawal", "start_from") if getattr(args, name)]
    if of_one and (args.all or args.config is not None):
        raise CutcalError(f"--{of_one[0]} is for one trace; leave it out of a fit of several, or name one with --cut")
    if args.sample and len(of_one) > 1:
        raise CutcalError(f"--sample beside --{of_one[1]}, which is for a search of one food; give one of them")
    if args.config is not None:
        return run_study(args, command)
    missing = [f"--{name}" for name in ("food", "trace") if getattr(args, name) is None]
    if missing:
        raise CutcalError(f"{' and '.join(missing)} missing: name the food and its trace, or a study with --config")
    request = request_of(args, command)
    if args.all:
        if args.cut is not None:
            raise CutcalError("--all beside --cut; give one of them")
        return run_cuts(args, study_of_cuts(request))
    if args.check is not None:
        print(description(request, Path(args.check) if args.check else None))
        return 0
    out = Path(args.out or f"cutcal-{request.food.name}-{request.stem}")

    with workers_of(args, note) as pool, ProgressBar() as bar:
        result = calibrate(request, out, pool, resume=args.resume, progress=bar, say=partial(bar.note, note))
    if args.json:
        print_json(to_document(result))
    else:
        print(verdict_text(result))
    if result.status == "interrupted":
        return interrupted(resumable=True)
    return 0 if result.passed else 2


def run_study(args: argparse.Namespace, command: Sequence[str]) -> int:
    """Fit and predict the cuts of a study; prints its table, or the summary as JSON."""
    from calib.multi_specimen.study_file import read_study

    if args.check is not None:
        raise CutcalError("--check is for one trace: give --food and --trace, and leave --config out")
    taken = beside_study(args)
    if taken in NOT_IN_A_FILE:
        raise CutcalError(f"--{taken} beside --config, which does not take it; leave it out")
    if taken:
        raise CutcalError(f"--{taken} beside --config: write it into {args.config}, for all cuts or for one")
    study = read_study(args.config).run_with(budget=args.budget, arch=args.arch, command=tuple(command))
    return fit_study(args, study, Path(args.out or f"cutcal-{Path(args.config).stem}"))


OF_A_STUDY = ("config", "out", "budget", "arch", "workers", "scheduler", "resume", "json", "check")
"""Options that ``--config`` goes with."""
NOT_IN_A_FILE = ("all", "discrepancy", "u-num")
"""Options that are neither for a study nor for a trace of one."""


def beside_study(args: argparse.Namespace) -> str:
    """The first option that was given beside ``--config`` and would not be heeded, without its dashes; none: empty."""
    parser = argparse.ArgumentParser()
    add_args(parser)
    usual = vars(parser.parse_args([]))
    others = (name for name, value in usual.items() if name not in OF_A_STUDY and getattr(args, name) != value)
    return next((name.replace("_", "-") for name in others), "")


def run_cuts(args: argparse.Namespace, study: StudySpec) -> int:
    """Fit all cuts of one record together, or say how each of them is read."""
    from calib.calibration.description import check_picture, description

    if args.check is not None:
        png = Path(args.check) if args.check else None
        if png is not None:
            check_picture(png)
        pictures = {name: png and png.with_stem(f"{png.stem}-{name}") for name in study.requests}
        said = {name: description(request, pictures[name]) for name, request in study.requests.items()}
        print("\n\n".join(f"{name}\n{text}" for name, text in said.items()))
        return 0
    return fit_study(args, study, Path(args.out or f"cutcal-{study.food.name}-{study.first.stem}"))


def fit_study(args: argparse.Namespace, study: StudySpec, out: Path) -> int:
    """Fit a study and predict what it holds out; prints its table, or the summary as JSON.

    Args:
        args: The options.
        study: The study.
        out: Output folder.

    Returns:
        The exit code.
    """
    from calib.io.typed_document import to_document
    from calib.multi_specimen.run import run as study_run

    with workers_of(args, note) as pool, ProgressBar() as bar:
        result = study_run(study, out, pool, resume=args.resume, progress=bar, say=note)
    if args.json:
        print_json(to_document(result))
    else:
        print(study_text(result, out))
    return 0 if result.passed else 2


def study_text(result: StudyResult, out: Path) -> str:
    """What the terminal shows at the end of a study."""
    lines = [f"  {'':24s}{'peak':>8s}{'NRMSE':>8s}{'shape':>8s}{'ISO':>7s}{'in band':>9s}{'width':>7s}{'factor':>8s}"]
    rows: list[tuple[str, InSampleCut | HeldOutCut]] = [(f"{n}, in-sample", cut) for n, cut in result.traces.items()]
    rows += [(f"{n}, held out", cut) for n, cut in result.hold_out.items()]
    for name, cut in rows:
        m, inside = cut.metrics, cut.predictive_inside
        within = "" if inside is None else f"{inside:.0%}"
        width = "" if cut.predictive_width is None else f"{cut.predictive_width:.0%}"
        lines.append(
            f"  {'pass' if cut.passed else 'FAIL'}  {name:18s}{m.peak_error:+8.1%}{m.nrmse:8.3f}{m.shape_error:8.3f}"
            f"{m.iso18571.R:7.3f}{within:>9s}{width:>7s}{cut.factor:8.3g}"
        )
        lines += [f"        {m.iso18571.caveat}"] if m.iso18571.caveat else []
    lines.append(f"  {'fitted':24s}{'value':>10s} {'':6s}{'95 % interval':>24s}")
    lines += [f"  {name:24s}{_fitted(p)}" for name, p in result.parameters.items()]
    head = (
        f"{result.food}, {result.study}: {'passed' if result.passed else 'not passed'}; "
        f"{result.simulations} simulations in {result.wall_s:.0f} s"
    )
    return "\n".join([head, *lines, f"  wrote {out}"])


def _fitted(p: FittedParameter | StudyParameter) -> str:
    """Value, interval and verdict of a parameter, in the unit that people use for it."""
    from mpm.output.verdict_words import verdict_word

    factor, unit = terminal_rung(p.unit, abs(p.value))
    known = None if p.low95 is None or p.high95 is None else (p.low95 / factor, p.high95 / factor)
    interval = "" if known is None else f"{_end(known[0])} to {_end(known[1])}"
    return f"{p.value / factor:>10.4g} {unit:6s}{interval:>24s}  {verdict_word(p.verdict)}"


def _end(x: float) -> str:
    """An end of an interval in three digits: 1750, and no power of ten below a million."""
    return f"{float(f'{x:.3g}'):g}"


def verdict_text(result: CalibrationResult) -> str:
    """What the terminal shows at the end."""
    from calib.calibration.fit_report import relation
    from calib.validation.acceptance import identified_words
    from calib.validation.not_shown import remedied

    lines = []
    for v in result.verdicts:
        mark = {True: "pass", False: "FAIL", None: "not run"}[v.passed]
        value = "" if v.value is None else f"{v.value:.3g}"
        limit = "" if v.limit is None else f"{relation(v)} {v.limit:.3g}"
        lines.append(f"  {mark:8s}{v.name:42s}{value:>10s}  {limit}")
        remedy = remedied(v)
        lines += [f"  {'':8s}{remedy}"] if remedy else []
    lines.append(f"  {'fitted':8s}{'95 % interval':>42s}")
    lines += [f"  {'':8s}{name:18s}{_fitted(p)}" for name, p in result.fitted.items()]
    lines.insert(0, f"  {identified_words(result.fitted)}")
    state = "interrupted" if result.status == "interrupted" else "passed" if result.passed else "not passed"
    peak, real = result.agreement.peak_sim_N, result.agreement.peak_real_N
    head = (
        f"{result.food}: {state}; peak {peak:.2f} N against {real:.2f} N ({result.trace.label}), "
        f"{result.history.every.simulations} simulations in {result.wall_s:.0f} s"
    )
    return "\n".join([head, *lines, f"  wrote {result.folder}"])
