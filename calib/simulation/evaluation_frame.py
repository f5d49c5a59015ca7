"""All simulations of a search as a table, read from the store that the run left."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import h5py

from calib.errors import OutputError
from calib.io.wording import brief
from calib.simulation.evaluation_file import UNREADABLE

if TYPE_CHECKING:
    import pandas as pd

STORE = "evaluations.h5"
"""Name of the store in the folder of a run."""
WORDS, NUMBERS = ("status", "reason", "fidelity"), ("fraction", "seconds")
"""Columns of text, and of numbers, that every run has."""


def evaluation_frame(folder: Path) -> pd.DataFrame:
    """The runs of a store, a row each.

    Args:
        folder: The output folder of a calibration.

    Returns:
        ``status``, ``reason``, ``fidelity``, ``fraction`` [-] and ``seconds`` [s], and each parameter by its name [SI].

    Raises:
        OutputError: The store is missing or damaged.
    """
    import pandas as pd  # takes long to import

    path = folder / STORE
    if not path.is_file():
        raise OutputError(f"{path}: no such file; name the folder of a calibration with its store")
    try:
        with h5py.File(path) as file:
            columns = {name: file[name].asstr()[()] for name in WORDS}
            columns |= {name: file[name][()] for name in NUMBERS}
            columns |= {name: column[()] for name, column in file["parameters"].items()}
    except UNREADABLE as e:
        raise OutputError(f"{path}: cannot be read ({brief(str(e))}); run the calibration with resume=True") from None
    return pd.DataFrame(columns).rename_axis("run")
