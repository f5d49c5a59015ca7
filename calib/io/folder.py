"""The output folder: made once, one run at a time in it, never overwritten, files written whole or not at all."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from calib.errors import OutputError
from calib.io.schema import tag
from mpm.files import write_atomic

RUN_FILES = (
    "summary.json",
    "material.yaml",
    "curves.csv",
    "withdrawal.csv",
    "converge.json",
    "stress.json",
    "verify.json",
    "compress.json",
    "relax.json",
    "tpa.json",
    "coverage.json",
    "coverage.jsonl",
    "prior.json",
    "design.json",
    "regress.json",
    "scalars.json",
    "evaluate.json",
    "evaluate.jsonl",
    "bench.json",
    "report.pdf",
    "report.html",
    "force.csv",
    "evaluations.h5",
    "evaluations.h5.journal",
    "record.h5",
)
"""Files by which a folder is known to hold a run."""


SUMMARY = "summary.json"  # which several commands write; its schema says whose it is
STORE_FILES = ("evaluations.h5", "evaluations.h5.journal")
OWN_FILES: Mapping[str, tuple[str, ...]] = {
    "calibrate": (
        SUMMARY,
        "material.yaml",
        "curves.csv",
        "withdrawal.csv",
        "report.pdf",
        "report.html",
        "record.h5",
        *STORE_FILES,
    ),
    "study": (SUMMARY, "material.yaml", "report.pdf", "report.html", *STORE_FILES),
    "converge": ("converge.json", "curves.csv", "report.pdf", "report.html", *STORE_FILES),
    "stress": ("stress.json", "report.pdf", "report.html", *STORE_FILES),
    "verify": ("verify.json", "report.pdf", "report.html"),
    "coverage": ("coverage.json", "coverage.jsonl", *STORE_FILES),
    "prior": ("prior.json", *STORE_FILES),
    "design": ("design.json", *STORE_FILES),
    "scalars": ("scalars.json", *STORE_FILES),
    "evaluate": ("evaluate.json", "evaluate.jsonl"),
}
"""Which of :data:`RUN_FILES` each run that can be gone on with may find of its own, by name of its document."""
LOCK = ".lock"  # in the folder; the operating system frees it when its process ends, however it ends
LEAST_FREE = 20_000_000  # bytes that a run needs: a store, its copy, a record and a report


@contextmanager
def prepare(out: Path, document: str, *, resume: bool) -> Iterator[None]:
    """Make the folder, or accept an empty one, and keep every other run out of it while the block runs.

    Args:
        out: The folder.
        document: Document that the run writes, such as ``calibrate``.
        resume: Whether it may hold an unfinished run of the same kind.

    Yields:
        Nothing.

    Raises:
        OutputError: Another run's results are there, another run is at work there, the folder cannot be written, or
            the disk is full.
    """
    if out.exists() and not out.is_dir():
        raise OutputError(f"--out {out}: is a file, not a folder; choose another name")
    _check_content(out, document, resume)
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".write-test"
        probe.write_text("")
        probe.unlink()
        free = shutil.disk_usage(out).free
    except OSError as e:
        raise OutputError(f"--out {out}: cannot be written ({e.strerror}); choose another folder") from None
    if free < LEAST_FREE:
        raise OutputError(
            f"--out {out}: {free / 1e6:.0f} MB are free on its disk and {LEAST_FREE / 1e6:.0f} MB are needed; free "
            "space, or choose another folder"
        )
    lock = FileLock(out / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise OutputError(
            f"--out {out}: another run is at work there; wait until it ends, or choose another folder"
        ) from None
    except (OSError, NotImplementedError) as e:
        raise OutputError(f"--out {out}: cannot be locked ({e}); choose a folder on another disk") from None
    try:
        _check_content(out, document, resume)  # what another run may have written until it was locked
        yield
    finally:
        with suppress(OSError):  # while it is locked: who waits for it sees that the file has gone, and makes another
            (out / LOCK).unlink()
        lock.release()


def _check_content(out: Path, document: str, resume: bool) -> None:
    """Refuse a folder that holds a run; with ``resume`` one that holds a run of another command.

    Raises:
        OutputError: It does.
    """
    found = [name for name in RUN_FILES if (out / name).exists()]
    if found and not resume:
        more = ", or add --resume to continue that run" if document in OWN_FILES else ""
        raise OutputError(
            f"--out {out}: holds another run ({', '.join(found)}) and is never overwritten; choose another folder{more}"
        )
    foreign = [name for name in found if name not in OWN_FILES[document]]
    if SUMMARY in found and _schema_of(out / SUMMARY) not in ("", tag(document)):
        foreign.append(SUMMARY)
    if foreign:
        raise OutputError(
            f"--out {out}: {', '.join(foreign)} there is of another command, and --resume goes on with runs of the "
            "same one; choose another folder"
        )


def _schema_of(path: Path) -> str:
    """What a document says it is; empty where it is damaged."""
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["schema"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


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
    import pandas as pd  # takes long to import

    body = pd.DataFrame(columns).to_csv(index=False, float_format=f"%.{digits}g")
    _replace(path, "".join(f"# {line}\n" for line in head) + body)


def _replace(path: Path, text: str) -> None:
    try:
        write_atomic(path, text)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror})") from None


def printable(text: str) -> str:
    """A text that UTF-8 can hold: bytes of a path that are none become escapes such as ``\\xff``."""
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:  # half of a letter, as JSON may have it
        return text.encode("utf-8", "backslashreplace").decode("utf-8")


def finite(value: Any) -> Any:
    """Plain data that JSON can hold: numbers of NumPy become Python's, NaN and infinity None, and bytes of a path that
    are no UTF-8 escapes such as ``\\xff``.
    """
    if isinstance(value, dict):
        return {printable(str(k)): finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if isinstance(value, str):
        return printable(value)
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
