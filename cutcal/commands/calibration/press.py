"""``cutcal press``: tests between two plates: a modulus, a relaxation, a texture profile."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calib.errors import CurveError
from calib.io.typed_document import to_document
from cutcal.commands.calibration import compress
from cutcal.options import add_run, number, print_json, say, whole
from mpm.scene.shapes import Shape

if TYPE_CHECKING:
    from calib.relaxation.relaxation_result import RelaxationResult
    from calib.texture.plate_record import PlateColumns
    from calib.texture.texture_result import TextureResult

HELP = "tests between two plates: modulus, relaxation, texture profile"
COMPRESS, RELAX, TPA = "compress", "relax", "tpa"
MODES = (COMPRESS, RELAX, TPA)
DESCRIPTION = """Evaluate tests between two plates. MODE is compress: Young's modulus of one
loading (the command compress is the same); relax: Prony series of a hold; tpa:
texture profile of two bites. A trace of relax and tpa is one specimen and has
columns of time, load and compression, or of a gap that closes, whose first
value is then the height, unless --height says another. Writes MODE.json,
curves.csv, report.pdf and report.html to --out."""
EPILOG = """examples:
  cutcal press compress --trace gel.csv --height 0.03 --diameter 0.05 --nu 0.49
  cutcal press relax --trace a.csv b.csv --diameter 0.02 --height 0.01
  cutcal press tpa --trace along/*.csv --across across/*.csv

Exit codes: 0 passed or nothing to judge, 1 error in input or run, 2 not within
the limits."""
OF_MODE = {
    "nu": (COMPRESS,), "strain": (COMPRESS,), "bonded": (COMPRESS,), "bracket": (COMPRESS,), "cells": (COMPRESS,),
    "branches": (RELAX,), "across": (TPA,), "law": (TPA,), "trigger": (RELAX, TPA), "time_col": (RELAX, TPA),
}  # fmt: skip
"""Modes of the options that not all have."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.usage = f"{p.prog} MODE --trace FILE [options]"
    p.add_argument("mode", choices=MODES, metavar="MODE", help=", ".join(MODES))
    compress.add_specimens(p)
    p.add_argument("--time-col", metavar="C", help="column of the time; seconds without a unit")
    compress.add_modulus(p.add_argument_group(COMPRESS))
    own = p.add_argument_group(f"{RELAX} and {TPA}")
    own.add_argument(
        "--trigger", type=number(0.0, 1e5, "N"), metavar="N", help="load at contact (default 5 %% of peak)"
    )
    own.add_argument("--branches", type=whole(0), metavar="N", help="of the Prony series (default: by evidence)")
    own.add_argument("--across", nargs="+", metavar="FILE", help="across the fibres; --trace is along them")
    own.add_argument("--law", action="store_true", help="law of rate by direction, each speed by the others")
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Evaluate; prints the result, or its document."""
    for name, modes in OF_MODE.items():
        if getattr(args, name) not in (None, False) and args.mode not in modes:
            raise CurveError(
                f"--{name.replace('_', '-')} is an option of press {' and '.join(modes)}, not of {args.mode}"
            )
    if args.mode == COMPRESS:
        return compress.run(args)
    if args.arch != "cpu":
        raise CurveError(f"--arch {args.arch}: press {args.mode} simulates nothing; leave it out")
    out = Path(args.out or f"cutcal-{args.mode}-{Path(args.trace[0]).stem}")
    return _relax(args, out) if args.mode == RELAX else _texture(args, out)


def _columns(args: argparse.Namespace) -> PlateColumns:
    from calib.texture.plate_record import PlateColumns

    return PlateColumns(args.time_col, args.compression_col, args.force_col, args.sign)


def _relax(args: argparse.Namespace, out: Path) -> int:
    """Evaluate holds."""
    from calib.relaxation.relaxation_evaluation import RelaxationTest, evaluate_relaxation

    outline = compress.outline_of(args)
    test = RelaxationTest(args.trace, outline, _columns(args), args.height, args.branches, args.trigger)
    result = evaluate_relaxation(test, out, command=compress.command_of("press"), say=say)
    if args.json:
        print_json(to_document(result))
    else:
        print(f"{relaxation_table(result)}\n  wrote {out}")
    return 0 if result.passed else 2


def _texture(args: argparse.Namespace, out: Path) -> int:
    """Evaluate two bites."""
    from calib.compression.measured import area as area_of
    from calib.texture.texture_evaluation import TextureTest, evaluate_texture

    area = None
    if args.law:
        kind, length, width = compress.outline_of(args)
        area = area_of(Shape(kind, length, width, length))
    test = TextureTest(args.trace, args.across or (), _columns(args), args.trigger, args.seed, area, args.height)
    result = evaluate_texture(test, out, command=compress.command_of("press"), say=say)
    if args.json:
        print_json(to_document(result))
    else:
        print(f"{texture_table(result)}\n  wrote {out}")
    return 0 if result.passed else 2


def relaxation_table(result: RelaxationResult) -> str:
    """What the terminal shows at the end of a relaxation."""
    n = len(result.repeats)
    lines = [
        f"E0 = {result.E0_Pa.mean / 1e3:.4g} kPa (instantaneous, {n} {'repeat' if n == 1 else 'repeats'}), "
        f"{result.equilibrium.mean:.3f} of it remains"
    ]
    for one in result.series:
        told = "" if one.identified else "  (not told by every hold)"
        lines.append(f"  share {one.share.mean:.3f} relaxes in {one.time_s:.3g} s{told}")
    lines += compress.verdict_lines(result.verdicts)
    return "\n".join(lines + [f"  note: {text}" for text in result.not_shown])


def texture_table(result: TextureResult) -> str:
    """What the terminal shows at the end of a texture profile."""
    from calib.texture.texture_profile import in_words

    lines = [f"{'group':<16}{'n':>3}  hardness [N]  cohesiveness  springiness    resilience"]
    for group in result.groups:
        cells = (group.hardness_N, group.cohesiveness, group.springiness, group.resilience)
        texts = [f"{one.mean:.3g}" + (f" ±{one.sd:.2g}" if one.repeats > 1 else "") for one in cells]
        lines.append(f"{group.name:<16}{len(group.repeats):>3}  " + "".join(f"{text:<14}" for text in texts).rstrip())
    for one in result.ratios:
        if one.descent_s != one.descent_s:  # of all speeds
            r = one.ratio
            lines.append(
                f"  along / across, {in_words(one.quantity)}: {r.value:.3g} (95 % interval {r.low:.3g} to {r.high:.3g})"
            )
    for law in result.laws:
        values = ", ".join(
            f"E {one.value / 1e3:.3g} kPa" if one.name == "E_Pa" else f"{one.name} {one.value:.3g}"
            for one in law.parameters
        )
        lines.append(f"  law ({law.direction}): {values}")
    lines += compress.verdict_lines(result.verdicts)
    return "\n".join(lines + [f"  note: {text}" for text in result.not_shown])
