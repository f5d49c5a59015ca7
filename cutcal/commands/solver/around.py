"""A fruit halved around its stone, pass by pass, as ``cutcal simulate --around`` does it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from calib.io.folder import write_csv
from calib.simulation.around_stone import TURNS, Around, cut_around
from cutcal.options import say
from mpm.scene import Scene


def halve(args: argparse.Namespace, scene: Scene, out: Path) -> Around:
    """Cut around the stone, and write the force of each pass after the first: ``force-2.csv`` and so on.

    Args:
        args: The options of ``cutcal simulate``.
        scene: The cut of the fruit as it lies.
        out: Output folder.

    Returns:
        What was done.

    Raises:
        SceneError: A fruit without a stone in the blade's plane.
    """
    from mpm.runtime import Runtime

    last: Around | None = None
    for last in cut_around(scene, args.around or TURNS, Runtime(args.arch, args.threads)):
        k, one = len(last.passes), last.passes[-1]
        if k > 1:
            write_csv(out / f"force-{k}.csv", one.record.columns())
        say(f"pass {k}: {one.record.peak:.1f} N, {last.severed_part:.0%} of the section's flesh is parted")
    assert last is not None  # there are three passes at least
    return last


def document(done: Around) -> dict[str, Any]:
    """What summary.json says of it."""
    return {
        "severed": done.severed,
        "severed_part": done.severed_part,
        "left_m2": done.left,
        "peak_N": done.peak,
        "work_J": done.work,
        "passes": [
            {
                "turn_rad": one.turn,
                "peak_N": one.record.peak,
                "work_J": one.record.work,
                "reached_m": one.reached,
                "ended": one.record.ended,
                "status": one.record.status,
            }
            for one in done.passes
        ],
    }
