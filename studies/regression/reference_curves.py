"""Recorded force curves: a file of columns for each food and contact mode, and one that says where they come from.

``FOOD-CONTACT.csv`` holds the columns :data:`COLUMNS`; ``reference.json`` holds the origin of each, the scatter between
seeds, the tolerances and the hash of its columns. Replacing one is a single step, the renaming of ``reference.json``:
the new columns lie whole beside the old ones before it, and whoever is killed after it has them put in place by the
next reader who may write.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calib.errors import RegressionError
from calib.io.folder import write_csv, write_json
from calib.io.yaml_checks import PACKAGE, data_path
from mpm.arrays import FloatArray

COLUMNS = ("stroke_m", "knife_N", "edge_N", "face_N", "work_J")
CHECKED = COLUMNS[1:]
"""Columns with a tolerance; the stroke is given."""
INDEX = "reference.json"
SCHEMA = 1  # layout of that file
DIGITS = 8  # of a recorded number: a hundredth of what keeps a record (comparison.UNCHANGED)
ABOUT = (
    "Recorded cuts of this project's own solver: a reference for changes of its code, no measurement.",
    "results: peak of the force on the knife [N], its stroke [m], work [J]; tolerances by column of the CSV file of "
    "the same name.",
    "s_r: repeatability standard deviation (ISO 5725-2) between runs with these seeds of the particles, the largest "
    "over the stroke;",
    "s_r_results: that of the results. limits and tolerances: 3.34 s_r, the repeatability limit (ISO 5725-6: 2.8 s_r) "
    "of eight runs,",
    "and at least a thousandth of the largest force or work, which is what the same seed may differ by between "
    "machines.",
    "Written by cutcal regress --update alone: it keeps hash and columns together.",
)
ENTRY: Mapping[str, type] = {
    "inputs": str,
    "columns_sha256": str,
    "repeatability": dict,
    "tolerances": dict,
    "scene": dict,
    "solver": str,
    "versions": dict,
}
"""What each entry of that file must have, and as what."""


@dataclass(frozen=True, eq=False)
class Reference:
    """One recorded cut.

    Attributes:
        columns: By the names of :data:`COLUMNS`, (60,) each.
        origin: Its entry in ``reference.json``.
    """

    columns: Mapping[str, FloatArray]
    origin: Mapping[str, Any]

    @property
    def tolerances(self) -> dict[str, float]:
        """Largest difference that each of :data:`CHECKED` may have [its unit]."""
        return {name: float(self.origin["tolerances"][name]) for name in CHECKED}

    @property
    def limits(self) -> dict[str, float]:
        """Repeatability limits of ``peak_N``, ``work_J`` and ``peak_stroke_m``:
        95 of 100 pairs of seeds differ by less.
        """
        return {name: float(x) for name, x in self.origin["repeatability"]["limits"].items()}


class References:
    """The folder of recorded cuts.

    Args:
        folder: By default the one that is shipped with cutcal.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = data_path("force_data") / "reference" if folder is None else folder

    def path(self, name: str) -> Path:
        """The file of a case such as ``banana-cohesive``."""
        return self.folder / f"{name}.csv"

    def read(self, name: str) -> Reference:
        """One recorded cut.

        Raises:
            RegressionError: There is none, or its file or its entry is damaged.
        """
        entry = self._entries().get(name)
        path = self.path(name)
        if entry is None or not (path.exists() or _draft(path).exists()):
            raise RegressionError(f"{name}: no reference is recorded in {self.folder}; record it: {_command(name)}")
        here = f"{INDEX}: {name}"
        if missing := _missing(entry):
            raise RegressionError(f"{here}: misses {missing}, or has something else there; {_remedy(name)}")
        path = self._current(path, entry["columns_sha256"])
        columns = _columns(path, name)
        if sha256(path) != entry["columns_sha256"]:
            raise RegressionError(f"{path.name}: not the columns that {INDEX} was written with; {_remedy(name)}")
        reference = Reference(columns, entry)
        try:
            numbers = [*reference.tolerances.values(), *reference.limits.values()]
        except (KeyError, TypeError, ValueError, AttributeError):
            numbers = [math.nan]
        if not all(math.isfinite(x) and x > 0 for x in numbers):
            raise RegressionError(
                f"{here}: tolerances or limits are missing, or no numbers above zero; {_remedy(name)}"
            )
        return reference

    def write(
        self, name: str, columns: Mapping[str, FloatArray], origin: Mapping[str, Any], order: Iterable[str]
    ) -> None:
        """Replace one recorded cut as a whole; a process that is killed leaves the old one or the new one.

        Args:
            name: The case.
            columns: By the names of :data:`COLUMNS`, which end in their units [m, N or J], shape (60,) each.
            origin: Its entry, without ``columns_sha256``.
            order: Names of all cases, in which order the entries are written.

        Raises:
            RegressionError: The other entries cannot be read.
            OutputError: A file cannot be written.
        """
        path = self.path(name)
        write_csv(_draft(path), {c: columns[c] for c in COLUMNS}, digits=DIGITS)
        entries = self._entries() | {name: {**origin, "columns_sha256": sha256(_draft(path))}}
        known = [n for n in order if n in entries]
        ordered = {n: entries[n] for n in [*known, *(n for n in entries if n not in known)]}
        write_json(self.folder / INDEX, {"schema": SCHEMA, "about": list(ABOUT), "references": ordered})
        os.replace(_draft(path), path)

    def settle(self) -> None:
        """Make the folder ready to be written: finish what a killed process began.

        Raises:
            RegressionError: It is that of an installed package, it cannot be written, or ``reference.json`` is damaged.
        """
        if (PACKAGE / "data") in self.folder.resolve().parents:
            raise RegressionError(
                "--update: the references belong to a checkout, and this cutcal is an installed copy; run it from a "
                "checkout that is installed with pip install -e"
            )
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            probe = self.folder / ".write-test"
            probe.write_text("")
            probe.unlink()
            entries = self._entries()
            for draft in self.folder.glob("*.csv.new"):
                entry = entries.get(draft.name.removesuffix(".csv.new"))
                if isinstance(entry, dict) and entry.get("columns_sha256") == sha256(draft):
                    os.replace(draft, draft.with_suffix(""))
                else:
                    draft.unlink()
        except OSError as e:
            raise RegressionError(
                f"--update: {self.folder} cannot be written ({e.strerror}); make it writable"
            ) from None

    def _entries(self) -> dict[str, Any]:
        """Entries of ``reference.json`` by case; none where there is no such file."""
        path = self.folder / INDEX
        if not path.exists():
            return {}
        remedy = "restore it from git, or delete it and record all: cutcal regress --update"
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except OSError as e:
            raise RegressionError(f"{path}: cannot be read ({e.strerror})") from None
        except ValueError as e:
            raise RegressionError(f"{path}: damaged ({e}); {remedy}") from None
        if not isinstance(content, dict) or not isinstance(content.get("references"), dict):
            raise RegressionError(f"{path}: damaged (holds no references); {remedy}")
        if content.get("schema") != SCHEMA:
            raise RegressionError(f"{path}: its layout is {content.get('schema')!r}, not {SCHEMA}; {remedy}")
        return dict(content["references"])

    @staticmethod
    def _current(path: Path, expected: str) -> Path:
        """The file with these columns: its draft, where the process was killed before the draft was put in place."""
        draft = _draft(path)
        if draft.exists() and (not path.exists() or sha256(path) != expected) and sha256(draft) == expected:
            return draft
        return path


def sha256(path: Path) -> str:
    """SHA-256 of a text file, the same whatever its line ends are."""
    return hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()


def _draft(path: Path) -> Path:
    return path.with_name(path.name + ".new")


def _columns(path: Path, name: str) -> dict[str, FloatArray]:
    """The columns of a file.

    Raises:
        RegressionError: It cannot be read, misses a column, or holds something that is no number.
    """
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except (OSError, UnicodeDecodeError, pd.errors.ParserError, pd.errors.EmptyDataError) as e:
        raise RegressionError(f"{path.name}: cannot be read ({str(e).strip()}); {_remedy(name)}") from None
    missing = [c for c in COLUMNS if c not in table.columns]
    if missing:
        raise RegressionError(f"{path.name}: misses {', '.join(missing)}; {_remedy(name)}")
    out = {}
    for column in COLUMNS:
        values = pd.to_numeric(table[column], errors="coerce").to_numpy(float)
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            cell = table[column].iloc[bad[0]]
            raise RegressionError(f"{path.name}, row {bad[0] + 2}: {column} is {cell!r}, not a number; {_remedy(name)}")
        out[column] = values
    if len(table) < 2 or (np.diff(out["stroke_m"]) <= 0).any():
        raise RegressionError(f"{path.name}: stroke_m does not increase; {_remedy(name)}")
    return out


def _missing(entry: Any) -> str:
    """Names of what an entry has not, or not as what it must be."""
    known = entry if isinstance(entry, dict) else {}
    return ", ".join(key for key, kind in ENTRY.items() if not isinstance(known.get(key), kind))


def _remedy(name: str) -> str:
    return f"restore it from git, or record it again: {_command(name)}"


def _command(name: str) -> str:
    food, _, contact = name.rpartition("-")
    return f"cutcal regress {food} --contact {contact} --update"
