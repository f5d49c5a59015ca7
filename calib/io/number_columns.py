"""Columns of numbers of a long CSV file, read a piece at a time.

As text a cell takes some sixty bytes: ten million rows of three columns took 7.4 GB. Here numbers are read as numbers,
and a column that has anything else somewhere is left out.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from calib.io.wording import quoted

SEPARATORS = ",;\t"
CHUNK_ROWS = 500_000


@dataclass(frozen=True, eq=False)
class NumberColumns:
    """What a long file holds.

    Attributes:
        columns: Numbers of each column that has nothing else, by name, shape (n,) each.
        left_out: The others, with their first cell that is no number.
        rows: Number of rows n.
    """

    columns: dict[str, np.ndarray]
    left_out: dict[str, str]
    rows: int


def number_columns(raw: bytes, first: int, names: Sequence[str]) -> NumberColumns:
    """Read the columns of a long CSV file.

    Args:
        raw: Its content.
        first: Line of the first row of numbers, from 1.
        names: Names of its columns.

    Returns:
        The columns of numbers.

    Raises:
        ValueError: Rows of another width, or no column of numbers; the message says where.
    """
    stream = io.BytesIO(raw)
    for _ in range(first - 1):
        stream.readline()
    separator, decimal = _layout(stream, len(names))
    pieces: dict[str, list[np.ndarray]] = {name: [] for name in names}
    left_out: dict[str, str] = {}
    count = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # rows that are too long
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)
        frames = pd.read_csv(
            stream,
            sep=separator,
            decimal=decimal,
            header=None,
            names=range(len(names)),
            index_col=False,
            chunksize=CHUNK_ROWS,
            comment="#",
            keep_default_na=False,
            na_values=[""],
            float_precision="round_trip",
            encoding_errors="replace",
        )
        try:
            for frame in frames:
                for k, name in enumerate(names):
                    if name in pieces and frame[k].dtype.kind in "iuf":
                        pieces[name].append(frame[k].to_numpy(float))
                    elif name in pieces:
                        del pieces[name]
                        left_out[name] = _first_word(frame[k], count + first)
                count += len(frame)
        except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
            raise ValueError(_widths(" ".join(str(error).split()), first, len(names))) from None
    if not pieces:
        raise ValueError(f"no column of numbers alone: {'; '.join(left_out.values())}")
    return NumberColumns({name: np.concatenate(pieces.pop(name)) for name in list(pieces)}, left_out, count)


def _layout(stream: io.BytesIO, width: int) -> tuple[str, str]:
    """What separates cells, and what the decimals, by the first row; the stream stays where it is.

    Raises:
        ValueError: It has another width than the header.
    """
    place = stream.tell()
    line = stream.readline().decode("utf-8", "replace")
    stream.seek(place)
    for separator in SEPARATORS:
        cells = next(csv.reader([line], delimiter=separator), [])
        if len(cells) == width:
            return separator, "," if separator != "," and "," in line else "."
    raise ValueError(f"the first row has not the {width} cells of the header")


def _widths(said: str, first: int, width: int) -> str:
    """What pandas says of a row that is too long, with the row as the file counts it."""
    found = re.search(r"in line (\d+), saw (\d+)", said)
    return said if found is None else f"row {int(found[1]) + first - 1}: {found[2]} cells, the header has {width}"


def _first_word(values: pd.Series, first: int) -> str:
    """The first cell of a column that is no number."""
    bad = pd.to_numeric(values, errors="coerce").isna().to_numpy() & values.notna().to_numpy()
    k = int(np.argmax(bad))
    return f"row {first + k}: {quoted(values.iloc[k])} is not a number" if bad.any() else "not numbers alone"
