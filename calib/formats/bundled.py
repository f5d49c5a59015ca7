"""Traces that come with cutcal, by name: they are there without a checkout too."""

from __future__ import annotations

from pathlib import Path

from calib.io.yaml_checks import data_path

BUNDLED = ("banana_reconstructed",)
"""Names of the traces; each is a CSV in ``force_data``."""


def bundled_or_same(path: Path) -> Path:
    """The file of a bundled trace where a path is no more than its name; else the path as it is.

    A file of that name in the current folder comes first.

    Args:
        path: A path, or a name with or without ``.csv``.
    """
    if path.parent != Path() or path.is_file() or path.name.removesuffix(".csv") not in BUNDLED:
        return path
    return data_path("force_data") / f"{path.name.removesuffix('.csv')}.csv"
