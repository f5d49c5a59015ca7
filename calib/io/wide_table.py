"""Tables that are printed with every column, however narrow the terminal is."""

from __future__ import annotations

from collections.abc import Mapping
from shutil import get_terminal_size
from typing import Any

import pandas as pd


class WideTable(pd.DataFrame):
    """A DataFrame whose text has every column: those that do not fit into a line stand below the others.

    Of more rows than pandas shows (``display.max_rows``) it has the first and the last.
    """

    @property
    def _constructor(self) -> type[WideTable]:
        return WideTable

    def __repr__(self) -> str:
        most, least = pd.get_option("display.max_rows"), pd.get_option("display.min_rows")
        text = self.to_string(line_width=get_terminal_size().columns, max_rows=most, min_rows=least)
        left_out = f"\n\n[{len(self)} rows x {len(self.columns)} columns]" if most and len(self) > most else ""
        return f"{text}{left_out}"


def table_of_rows(rows: Mapping[str, Any]) -> WideTable:
    """The table of a document's entries.

    Args:
        rows: What the document says of each, by name.

    Returns:
        A row for each.
    """
    return WideTable(pd.DataFrame.from_dict(rows, orient="index"))
