"""Where the optional measured traces lie; they are not in this repository (force_data/SOURCES.md)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def data_file(*parts: str) -> Path:
    """Path of a file in the data folder; skips the calling test, with the reason, where it is absent.

    The folder is named by the environment variable CUTCAL_DATA, else ``shared/data`` beside the repository.
    """
    folder = Path(os.environ.get("CUTCAL_DATA") or ROOT.parent / "shared" / "data")
    path = folder.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"measured data {'/'.join(parts)} is not here; set CUTCAL_DATA to its folder")
    return path
