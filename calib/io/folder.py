"""The output folder: made once, never overwritten, files written whole or not at all."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from calib.errors import OutputError
from mpm.files import write_atomic

RUN_FILES = (
    "summary.json",
    "material.yaml",
    "curves.csv",
    "converge.json",
    "stress.json",
    "verify.json",
    "compress.json",
    "coverage.json",
    "coverage.jsonl",
    "prior.json",
    "regress.json",
    "scalars.json",
    "evaluate.json",
    "evaluate.jsonl",
    "report.pdf",
    "force.csv",
    "evaluations.h5",
    "evaluations.h5.journal",
    "record.h5",
)
"""Files by which a folder is known to hold a run."""


def prepare(out: Path, *, resume: bool) -> None:
    """Make the folder, or accept an empty one; with ``resume`` also one that holds an unfinished run.

    Raises:
        OutputError: Another run's results are there, or the folder cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise OutputError(f"--out {out}: is a file, not a folder; choose another name")
    found = [m for m in RUN_FILES if (out / m).exists()]
    if found and not resume:
        raise OutputError(
            f"--out {out}: holds another run ({', '.join(found)}) and is never overwritten; choose another folder, "
            "or add --resume to continue that run"
        )
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".write-test"
        probe.write_text("")
        probe.unlink()
    except OSError as e:
        raise OutputError(f"--out {out}: cannot be written ({e.strerror}); choose another folder") from None


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a JSON document whole or not at all; NaN and infinity become null.

    Args:
        path: The file; an existing one is replaced.
        content: The document.

    Raises:
        OutputError: The file cannot be written.
    """
    _replace(path, json.dumps(finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_csv(path: Path, columns: Mapping[str, Any], *, head: Sequence[str] = (), digits: int = 9) -> None:
    """Write columns of equal length as a CSV file, whole or not at all.

    Args:
        path: The file; an existing one is replaced.
        columns: Columns of n values each, by name.
        head: Comments above the header, one line each.
        digits: Significant digits of a number.

    Raises:
        OutputError: The file cannot be written.
    """
    body = pd.DataFrame(columns).to_csv(index=False, float_format=f"%.{digits}g")
    _replace(path, "".join(f"# {line}\n" for line in head) + body)


def _replace(path: Path, text: str) -> None:
    try:
        write_atomic(path, text)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror})") from None


def finite(value: Any) -> Any:
    """Plain data that JSON can hold: numbers of NumPy become Python's, NaN and infinity None."""
    if isinstance(value, dict):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
