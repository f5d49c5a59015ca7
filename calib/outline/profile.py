"""A profile in numbers: the radius of a food along its axis."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import ShapeError
from calib.io.yaml_checks import mapping, read_yaml
from calib.outline.silhouette import HALF, REVOLVED, Sized
from calib.table.units import Quantity, unit_of
from mpm.arrays import FloatArray
from mpm.scene.outline import ALONG, places, revolved

POSITIONS, RADII = ("y", "position", "along"), ("radius", "r")
"""Names of the two columns; each ends in its unit, as in ``radius_mm``."""
SUFFIXES = (".csv", ".yaml", ".yml")
"""Files that are read as numbers."""
FEWEST = 3  # points of a profile


def food_of(path: Path, way: str) -> Sized:
    """The food of a profile. Between its points the square of the radius is monotone, so that round ends stay round.

    Args:
        path: A CSV file with two columns, or a YAML file with two lists, such as ``y_mm`` and ``radius_mm``.
        way: ``revolved``, or ``half`` for one that was halved along its axis.

    Returns:
        The food.

    Raises:
        ShapeError: The file is no such profile.
    """
    from scipy.interpolate import PchipInterpolator  # takes long to import

    if way not in (REVOLVED, HALF):
        raise ShapeError(f"{path}: numbers are a radius along the axis; say --outline-as {REVOLVED} or {HALF}")
    columns = _of_csv(path) if path.suffix.lower() == ".csv" else _of_yaml(path)
    y, radius = (_column(path, columns, names) for names in (POSITIONS, RADII))
    if len(y) != len(radius) or len(y) < FEWEST:
        raise ShapeError(f"{path}: {len(y)} positions and {len(radius)} radii; give as many, and at least {FEWEST}")
    back = np.flatnonzero(np.diff(y) <= 0)
    if len(back):
        raise ShapeError(
            f"{path}: point {back[0] + 2}: its position does not lie beyond the one before; sort the points"
        )
    if (radius < 0).any() or not radius.any():
        k = int(np.argmin(radius))
        raise ShapeError(f"{path}: point {k + 1}: a radius of {radius[k] * 1e3:g} mm; give radii that are not negative")
    at = (y[0] + y[-1]) / 2 + (y[-1] - y[0]) / 2 * places(ALONG)
    found = np.sqrt(np.maximum(PchipInterpolator(y, radius**2)(np.clip(at, y[0], y[-1])), 0.0))
    largest, length = float(found.max()), float(y[-1] - y[0])
    height = largest if way == HALF else 2 * largest
    return Sized(revolved(found / largest, halved=way == HALF), length, 2 * largest, height)


def _of_csv(path: Path) -> dict[str, list[Any]]:
    """Columns of a CSV file by their names."""
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as e:
        raise ShapeError(f"{path}: cannot be read as CSV ({type(e).__name__}); give two columns of numbers") from None
    rows = [row for row in rows if row and not row[0].lstrip().startswith("#")]
    if not rows:
        raise ShapeError(f"{path}: is empty; give two columns, such as y_mm and radius_mm")
    short = next((k for k, row in enumerate(rows, 1) if len(row) != len(rows[0])), None)
    if short is not None:
        raise ShapeError(f"{path}: row {short} has {len(rows[short - 1])} cells, and the first has {len(rows[0])}")
    return {name.strip(): list(column) for name, *column in zip(*rows, strict=True)}


def _of_yaml(path: Path) -> dict[str, list[Any]]:
    """Lists of a YAML file by their names."""
    top, content = read_yaml(path, kind=ShapeError)
    given = mapping(top, content)
    return {str(name): values if isinstance(values, list) else [values] for name, values in given.items()}


def _column(path: Path, columns: dict[str, list[Any]], names: tuple[str, ...]) -> FloatArray:
    """One of the two columns [m]."""
    for name, cells in columns.items():
        word, _, unit = name.rpartition("_")
        if word.lower() not in names:
            continue
        known = unit_of(unit)
        if known is None or known.quantity is not Quantity.LENGTH:
            raise ShapeError(f"{path}: column {name}: {unit!r} is no unit of length; write {names[0]}_mm")
        return np.array([_number(path, name, k, cell) for k, cell in enumerate(cells, 1)]) * known.factor
    have = ", ".join(columns) or "nothing"
    raise ShapeError(f"{path}: no column {names[0]} with its unit, such as {names[0]}_mm; it has {have}")


def _number(path: Path, name: str, k: int, cell: Any) -> float:
    try:
        value = float(cell)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value) or isinstance(cell, bool):
        raise ShapeError(f"{path}: point {k} of {name}: {str(cell)[:40]!r} is no number")
    return value
