"""A table of fitted parameters that is printed whole, however narrow the terminal is."""

from __future__ import annotations

from collections.abc import Mapping
from shutil import get_terminal_size
from typing import Any

import pandas as pd


class ParameterTable(pd.DataFrame):
    """A DataFrame whose text has every column and row: those that do not fit into a line stand below the others."""

    @property
    def _constructor(self) -> type[ParameterTable]:
        return ParameterTable

    def __repr__(self) -> str:
        return str(self.to_string(line_width=get_terminal_size().columns))


def parameter_table(parameters: Mapping[str, Any]) -> ParameterTable:
    """The table of the parameters of a document.

    Args:
        parameters: What the document says of each [SI], by name.

    Returns:
        A row for each.
    """
    return ParameterTable(pd.DataFrame.from_dict(parameters, orient="index"))
