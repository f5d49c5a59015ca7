"""``cutcal compress``, and ``cutcal press compress``: Young's modulus from a compression test between two plates."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from calib.errors import CurveError
from calib.io.typed_document import to_document
from cutcal.options import (
    Group,
    add_run,
    number,
    print_json,
    say,
    whole,
)
from mpm.scene.shapes import Shape

if TYPE_CHECKING:
    from calib.compression.result import CompressionResult
    from calib.validation.acceptance import Verdict

HELP = "the same as press compress: Young's modulus from a compression test"
DESCRIPTION = """Calibrate Young's modulus on the force of a specimen that is compressed between
two plates. One simulation at a reference modulus gives the curve; each repeat
is fitted by scaling it. Strain is compression / height, stress force / first
area. The first sample of a repeat is its zero; no toe is corrected. Writes
compress.json, curves.csv, compress.svg, report.pdf and report.html to --out."""
STRAIN = 0.4  # that is fitted where none is given
EPILOG = """examples:
  cutcal compress --trace gel.csv --height 0.03 --diameter 0.05 --nu 0.49
  cutcal compress --trace a.csv b.csv --height 0.02 --width 0.02 --length 0.02 \\
      --nu 0.4 --strain 0.2 --bracket

A trace has a column of compression (compression_mm, displacement_mm, ...), one
of load (load_N, force_kN, ...) and may have one of repeats (replicate,
specimen). A machine that counts both negative is read with --sign -.

Exit codes: 0 passed, 1 error in input or run, 2 fitted but not within the
limits (curve error 5 %, slope over 0 to 5 % strain 10 %, solver 3 %)."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    add_specimens(p)
    add_modulus(p)
    add_run(p)


def add_specimens(p: argparse.ArgumentParser) -> None:
    """Options that say what was pressed, and how its records are read."""
    p.add_argument("--trace", required=True, nargs="+", metavar="FILE", help="CSV, JSON or HDF5 files of one material")
    p.add_argument("--height", type=number(1e-3, 1.0, "m"), metavar="M", help="height of the specimen [m]")
    p.add_argument("--diameter", type=number(1e-3, 1.0, "m"), metavar="M", help="diameter of an upright cylinder [m]")
    for name in ("width", "length"):
        p.add_argument(f"--{name}", type=number(1e-3, 1.0, "m"), metavar="M", help=f"{name} of a block [m]")
    p.add_argument("--compression-col", metavar="C", help="its column; metres without a unit")
    p.add_argument("--force-col", metavar="C", help="column of the load; newtons without a unit")
    p.add_argument("--sign", choices=("+", "-"), metavar="+|-", help="sign of the load that presses")


def add_modulus(p: Group) -> None:
    """Options of the modulus."""
    p.add_argument("--nu", type=float, metavar="NU", help="Poisson's ratio, which the test does not tell")
    p.add_argument(
        "--strain",
        type=number(0.0, 0.8, "-"),
        metavar="E",
        help=f"largest engineering strain to fit (default {STRAIN:g})",
    )
    p.add_argument("--bonded", action="store_true", help="the food sticks to the plates (default: it slides)")
    p.add_argument("--bracket", action="store_true", help="also the modulus if the plates were the other way")
    p.add_argument("--cells", type=whole(1), metavar="N", help="cells over the height (default 10, 15 if bonded)")


def run(args: argparse.Namespace) -> int:
    """Calibrate; prints the result, or compress.json."""
    from calib.compression.modulus_calibration import CompressionTest, PressOptions, calibrate_modulus

    shape = shape_of(args)
    if args.nu is None:
        raise CurveError(
            "--nu is missing: a compression force alone does not tell Young's modulus from Poisson's ratio; give it, "
            "for instance 0.49 for a gel or a rubber, 0.2 to 0.4 for a food with pores"
        )
    out = Path(args.out or f"cutcal-compress-{Path(args.trace[0]).stem}")
    strain = STRAIN if args.strain is None else args.strain
    columns = (args.compression_col, args.force_col, args.sign)
    test = CompressionTest(args.trace, shape, args.nu, strain, args.bonded, *columns)
    cells = args.cells if args.cells is not None else 15 if args.bonded else 10
    options = PressOptions(cells, args.bracket, args.seed, args.arch)
    command = command_of(args.command)
    result = calibrate_modulus(test, options, out, command=command, say=say)
    if args.json:
        print_json(to_document(result))
    else:
        print(f"{table(result)}\n  wrote {out}")
    return 0 if result.passed else 2


def command_of(name: str) -> tuple[str, ...]:
    """Words of the command line, the command's name first."""
    return (name, *(a for a in sys.argv[1:] if a != name))


def shape_of(args: argparse.Namespace) -> Shape:
    """The specimen that the options give.

    Raises:
        CurveError: Sizes are missing, or of two shapes.
    """
    if args.height is None:
        raise CurveError("--height is missing: strain is compression over the height of the specimen [m]")
    return Shape(*outline_of(args), args.height)


def outline_of(args: argparse.Namespace) -> tuple[str, float, float]:
    """Kind, length and width of the specimen under the plate [m].

    Raises:
        CurveError: Sizes are missing, or of two shapes.
    """
    if args.diameter is not None:
        if args.width is not None or args.length is not None:
            raise CurveError(
                "--diameter is of an upright cylinder, --width and --length are of a block; give one shape"
            )
        return ("upright_cylinder", args.diameter, args.diameter)
    if args.width is None or args.length is None:
        raise CurveError(
            "the area under the plate is missing: give --diameter of an upright cylinder, or --width and --length of a "
            "block [m]"
        )
    return ("block", args.length, args.width)


def table(result: CompressionResult) -> str:
    """What the terminal shows at the end."""
    modulus, small, force = result.E, result.slope, result.force_error
    window = f"over 0 to {100 * modulus.window[1]:g} % strain"
    spread = "one repeat, no interval"
    if modulus.repeats > 1:
        spread = (
            f"sd {modulus.sd_Pa / 1e3:.3g} kPa, 95 % interval {modulus.low_Pa / 1e3:.4g} to "
            f"{modulus.high_Pa / 1e3:.4g} kPa, {modulus.repeats} repeats"
        )
    lines = [
        f"E = {modulus.mean_Pa / 1e3:.4g} kPa {window} ({spread})",
        f"  slope over 0 to 5 % strain: measured {small.measured_Pa / 1e3:.4g} kPa, "
        f"fitted {small.fitted_Pa / 1e3:.4g} kPa ({small.error:+.1%})",
        f"  largest force error beyond {force.from_strain:.0%} strain: {force.value:+.1%} at {force.strain:.1%}",
    ]
    for other in result.sensitivity or ():
        lines.append(f"  at nu {other.nu:.3g} the same force is E = {other.E_Pa / 1e3:.4g} kPa {window}")
    if result.bracket is not None:
        plates = result.bracket
        lines.append(f"  with {plates.plates} plates it is E = {plates.E_Pa / 1e3:.4g} kPa {window}")
    lines += verdict_lines(result.verdicts)
    lines += [f"  note: {text}" for text in result.not_shown]
    return "\n".join(lines)


def verdict_lines(verdicts: Sequence[Verdict]) -> list[str]:
    """The lines of a verdict as the terminal shows them."""
    out = []
    for line in verdicts:
        note = f": {line.note}" if line.note else ""
        if line.passed is None:
            out.append(f"  --   not judged  {line.name}{note}")
            continue
        word = "ok  " if line.passed else "FAIL"
        value, limit = (f"{x:6.1%}" if line.unit == "fraction" else f"{x:6g}" for x in (line.value or 0.0, line.limit))
        limit = f"{line.limit:.0%}" if line.unit == "fraction" else limit.strip()
        out.append(f"  {word} {value} (limit {limit})  {line.name}{note}")
    return out
