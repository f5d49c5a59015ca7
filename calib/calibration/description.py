"""How a trace is read and what would be fitted to it, in words, before anything is simulated."""

from __future__ import annotations

from pathlib import Path

from calib.errors import OutputError
from calib.material.remarks import notes
from calib.problem.request import Request
from calib.problem.setup import set_up
from calib.problem.withdrawal import BothWays
from calib.trace.conditioning import Conditioned
from mpm.scene import Knife

SOURCES = {
    "position": "the position column",
    "speed": "the given speed",
    "height": "the food's height, at one speed from contact to release",
}
"""What the stroke is taken from, in words."""


def description(request: Request, png: Path | None = None) -> str:
    """What a calibration would start from: columns, tare, contact, stroke, specimen, cells, parameters and warnings.

    Args:
        request: What would be calibrated.
        png: File into which the record is drawn as it was read, or None.

    Returns:
        A line for each of them.

    Raises:
        CutcalError: Anything wrong with the input, or a picture that is no PNG or cannot be written.
    """
    if png is not None:
        check_picture(png)
    setup = set_up(request)
    c, scene = setup.curve, setup.fine
    trace, shape, knife = c.trace, scene.food.shape, scene.knife
    blade = f", spine {knife.spine * 1e3:g} mm" if isinstance(knife, Knife) else ""
    named = ", ".join(f"{role} from {name}" for role, name in trace.columns.items())
    sizes = " x ".join(f"{1e3 * size:.3g}" for size in (shape.length, shape.width, shape.height))
    start = f"level before contact {c.baseline_N:.4g} N +- {c.baseline_sd_N:.2g}"
    lines = [
        ("trace", f"{trace.source}, {trace.label}; {named}"),
        ("record", f"{len(trace.time)} samples in {trace.time[-1] - trace.time[0]:.4g} s, {1 / trace.dt:.4g} a second"),
        ("subtracted", f"{'air run, then the ' if c.baseline_kind == 'air' else ''}{start}"),
        ("contact", f"at {c.onset_s:.4g} s +- {c.onset_sd_s:.2g}; the stroke ends at {c.end_s:.4g} s"),
        ("stroke", f"{1e3 * c.stroke_length_m:.4g} mm, from {SOURCES[c.stroke_source]}"),
        ("peak", f"{c.peak_N:.4g} N +- {c.peak_sd_N:.2g}, noise {c.noise_sd_N:.2g} N a sample"),
        ("specimen", f"{shape.words}, {sizes} mm (across the blade, along it, height)"),
        ("knife", f"{knife.name}{blade}"),
        ("cells", f"{1e3 * scene.numerics.dx:.3g} mm, screening on {1e3 * setup.coarse.numerics.dx:.3g} mm"),
        ("fitted", ", ".join(p.name for p in setup.objective.parameters)),
        ("budget", f"{request.budget:g} simulations at most, one of screening is a quarter"),
    ]
    if request.withdrawal:
        up = BothWays.of(setup).withdrawal
        way = f"from {1e3 * up.way[0]:.3g} to {1e3 * up.way[-1]:.3g} mm above the lowest point"
        lines.append(("withdrawal", f"{way}, largest pull {up.pull.max():.4g} N, level known to {up.level_sd_N:.2g} N"))
    if png is not None:
        draw_record(request, c, png)
        lines.append(("picture", f"{png}, the record as it was read"))
    words = [f"{name:12s}{text}" for name, text in lines]
    warned = [*c.warnings, *setup.assumptions, *notes(request.food)]
    return "\n".join([*words, *(f"note: {text}" for text in warned)])


def check_picture(png: Path) -> None:
    """Refuse a file for the picture of a record that is no PNG.

    Raises:
        OutputError: It is none.
    """
    if png.suffix.lower() != ".png":
        raise OutputError(f"--check {png}: the picture of the record is a PNG; name a file such as record.png")


def draw_record(request: Request, done: Conditioned, png: Path) -> None:
    """Draw a record as it was read into a file, with what was made of it.

    Args:
        request: What would be calibrated.
        done: Its trace, conditioned.
        png: The file, which is written anew.

    Raises:
        OutputError: It cannot be written.
    """
    from reports.calibration.record_picture import RecordPicture, record_png

    read, _ = request.records()
    named = ", ".join(f"{role} from {name}" for role, name in read.columns.items())
    picture = RecordPicture(
        title=f"{read.source}: {named}",
        time=read.time,
        force=read.force,
        height=read.position,
        used_time=done.time,
        baseline=done.trace.force - done.force,
        repaired=done.trace.force,
        onset=done.onset_s,
        onset_sd=done.onset_sd_s,
        end=done.end_s,
    )
    try:
        png.write_bytes(record_png(picture))
    except OSError as error:
        raise OutputError(
            f"{png}: the picture cannot be written ({error.strerror}); name another with --check"
        ) from None
