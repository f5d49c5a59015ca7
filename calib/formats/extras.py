"""What the readers of formats need that not everybody has installed, and errors that say so."""

from __future__ import annotations

import importlib
from typing import Any

from calib.errors import TraceError

EXTRA = "pip install 'cutcal[formats]'"
"""What installs the packages that read further formats."""


def needed(source: str, module: str, what: str) -> Any:
    """A module that reads a format.

    Args:
        source: What errors call the file.
        module: Its name.
        what: What it reads, for the error.

    Returns:
        The module.

    Raises:
        TraceError: It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise TraceError(f"{source}: {what} needs {module.partition('.')[0]}; install it with {EXTRA}") from None
