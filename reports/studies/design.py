"""The figure of a design: what is left of each interval after each test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.base.figures import BLACK, GREY, RED, WIDTH, svg

ROW = 11.0  # height of a test [mm]
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*")


class Expected(Protocol):
    """What would be known after a test."""

    @property
    def part(self) -> float:
        """Width of the expected interval over the present one [-]."""


class Test(Protocol):
    """A test that could be made next."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def minutes(self) -> float:
        """Lab work [min]."""

    @property
    def asked(self) -> Expected | None:
        """What would be known of what was asked for."""

    @property
    def parameters(self) -> Mapping[str, Expected]:
        """What would be known of the parameters, by name."""


class Ranked(Protocol):
    """Ranked tests; :class:`calib.design.result.DesignResult` has them."""

    @property
    def asked(self) -> str:
        """What is to be narrowed."""

    @property
    def known(self) -> Mapping[str, Any]:
        """What is known before, by parameter."""

    @property
    def quantity(self) -> Any:
        """What is known before of the peak or work that was asked for, or None."""

    @property
    def tests(self) -> Sequence[Test]:
        """The tests, the one that narrows most first."""


def write_figure(result: Ranked, out: Path) -> None:
    """Draw ``design.svg`` into a folder.

    Args:
        result: The design.
        out: The folder.
    """
    (out / "design.svg").write_bytes(svg(lambda figure: draw(figure, result), _height(result)))


def design_axes(result: Ranked) -> Axes:
    """The same on a new figure of pyplot, for scripts and notebooks.

    Args:
        result: The design.

    Returns:
        The axes.
    """
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=(7.0, 7.0 * _height(result) / WIDTH), layout="constrained")
    return draw(figure, result)


def _height(result: Ranked) -> float:
    """Height of the figure [mm]."""
    return 24.0 + ROW * (len(result.tests) + 1)


def draw(figure: Figure, result: Ranked) -> Axes:
    """Fill a figure: a row for each test, a mark for each parameter, and a cross for what was asked for.

    Args:
        figure: The figure.
        result: The design.

    Returns:
        Its axes.
    """
    axes = figure.subplots()
    names = list(result.known)
    rows = np.arange(len(result.tests))
    for k, name in enumerate(names):
        parts = [test.parameters[name].part for test in result.tests]
        marked: dict[str, Any] = {
            "color": RED if name == result.asked else GREY,
            "marker": MARKS[k % len(MARKS)],
            "ls": "none",
        }
        axes.plot(parts, rows, ms=4.5, label=name, **marked)
    if result.quantity is not None:
        parts = [1.0 if test.asked is None else test.asked.part for test in result.tests]
        axes.plot(parts, rows, color=RED, marker="x", ms=6.0, ls="none", label=result.asked)
    axes.axvline(1.0, color=BLACK, lw=0.6)
    axes.set_yticks(rows, [f"{test.name}, {test.minutes:g} min" for test in result.tests])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.05)
    axes.set_xlabel("expected width of the 95 % interval over the present one")
    figure.legend(loc="outside upper left", ncols=5)
    return axes
