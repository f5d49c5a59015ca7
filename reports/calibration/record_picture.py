"""A record as it was read, drawn for a person to look at before anything is fitted."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from reports.base.figures import BLACK, BLUE, GREEN, RED, STYLE, envelope

SIZE_IN, DPI = (8.0, 5.5), 110
"""Size of the picture [inch], and dots an inch."""


@dataclass(frozen=True)
class RecordPicture:
    """What the picture of a record shows.

    Attributes:
        title: Name of the record, and its columns.
        time: Time of each sample as read [s], shape (n,).
        force: Force as read, resistance positive [N], shape (n,).
        height: Height of the knife as read [m], shape (n,), or None.
        used_time: Times of the samples that are used [s], shape (m,).
        baseline: What is subtracted from them [N], shape (m,).
        repaired: Force of those samples after repairs [N], shape (m,).
        onset: Time of contact [s].
        onset_sd: Its standard uncertainty [s].
        end: Time at which the stroke ends [s].
    """

    title: str
    time: np.ndarray
    force: np.ndarray
    height: np.ndarray | None
    used_time: np.ndarray
    baseline: np.ndarray
    repaired: np.ndarray
    onset: float
    onset_sd: float
    end: float


def record_png(picture: RecordPicture) -> bytes:
    """The picture: force over time, and the knife's height below it where that is known.

    Args:
        picture: What it shows.

    Returns:
        A PNG.
    """
    rows = 1 if picture.height is None else 2
    with style.context(["default", STYLE]):
        figure = Figure(figsize=SIZE_IN, layout="constrained", dpi=DPI)
        FigureCanvasAgg(figure)
        axes = np.atleast_1d(figure.subplots(rows, 1, sharex=True, height_ratios=(2, 1)[:rows]))
        _force(axes[0], picture)
        if picture.height is not None:
            axes[1].plot(*envelope(picture.time, 1e3 * picture.height), color=BLACK, lw=0.9)
            axes[1].set_ylabel("height of the knife [mm]")
            _moments(axes[1], picture)
        axes[-1].set_xlabel("time [s]")
        out = io.BytesIO()
        figure.savefig(out, format="png")
    return out.getvalue()


def _force(axes: Axes, p: RecordPicture) -> None:
    """The force as read and as it is used, with what is subtracted."""
    axes.plot(*envelope(p.time, p.force), color=BLACK, lw=0.8, label="force as read")
    if len(p.used_time) != len(p.time) or np.any(p.repaired != p.force):
        axes.plot(*envelope(p.used_time, p.repaired), color=GREEN, lw=1.1, dashes=(4.0, 2.0), label="as it is used")
        low, high = float(p.repaired.min()), float(p.repaired.max())
        room = 0.3 * max(high - low, 1e-9)
        axes.set_ylim(low - room, high + room)  # a code of an error would hide the cut
    axes.plot(*envelope(p.used_time, p.baseline), color=RED, lw=1.1, label="baseline")
    _moments(axes, p)
    axes.set_ylabel("force [N]")
    axes.set_title(p.title, fontsize=8)
    axes.legend(fontsize=7)


def _moments(axes: Axes, p: RecordPicture) -> None:
    """Contact with its uncertainty, and the end of the stroke."""
    axes.axvspan(p.onset - p.onset_sd, p.onset + p.onset_sd, color=BLUE, alpha=0.3, lw=0)
    axes.axvline(p.onset, color=BLUE, lw=0.9, label="contact")
    axes.axvline(p.end, color=BLUE, lw=0.9, dashes=(4.0, 2.0), label="end of the stroke")
