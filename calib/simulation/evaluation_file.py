"""Layout of ``evaluations.h5`` and of its journal: a run as HDF5 and as a line, each with a checksum.

Disks and transfers flip bits, and HDF5 does not notice. Each run therefore has a SHA-256 over all that is stored of it
and over the store's header; a run whose content does not give it is left out when the file is read. Both files are
bound to their header so: a run of one store is none of another.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.io.meaning import describe_attributes, describe_sets
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_meanings import ATTRIBUTES, WHAT, meaning_of

LAYOUT_VERSION = 2
"""Version of both layouts; a file with another one is refused."""
UNREADABLE = (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, AttributeError, MemoryError)
"""What h5py raises on a damaged file, and NumPy on what it then gives."""


@dataclass(frozen=True)
class Header:
    """What a store belongs to; a store with another header is refused.

    Attributes:
        trace_sha256: SHA-256 of the trace file.
        scene_key: Hash or name of the scene without the fitted parameters.
        schema: Version of the layout.
    """

    trace_sha256: str
    scene_key: str
    schema: int = LAYOUT_VERSION

    def check(self, found: Mapping[str, Any], where: Path) -> None:
        """Refuse a header other than this one.

        Args:
            found: The header that was found, as plain data.
            where: The file, for the error.

        Raises:
            OutputError: It is another one.
        """
        for name, expected in asdict(self).items():
            if found.get(name) != expected:
                raise OutputError(
                    f"{where} belongs to another calibration: its {name} is {found.get(name)!r}, not "
                    f"{expected!r}; choose another --out folder."
                )


@dataclass(frozen=True)
class StoredEvaluation:
    """One stored run.

    Attributes:
        key: Its content key.
        fidelity: Label of the resolution it was run at.
        evaluation: The run; ``index`` is its place in the store.
    """

    key: str
    fidelity: str
    evaluation: Evaluation

    def digest(self, header: Header) -> str:
        """SHA-256 of all of it but its place, and of the header of its store; hexadecimal."""
        document = to_json(self)
        del document["index"]
        for name in ("parameters", "scalars"):  # a number that is not known is no number of the file
            document[name] = {n: x for n, x in document[name].items() if not np.isnan(x)}
        text = json.dumps([asdict(header), document], sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def to_json(entry: StoredEvaluation) -> dict[str, Any]:
    """A run as plain JSON; curves as base64 of little-endian 64-bit floats."""
    document = {"key": entry.key, "fidelity": entry.fidelity, **vars(entry.evaluation)}
    for name in ("parameters", "scalars"):
        document[name] = {n: float(x) for n, x in document[name].items()}
    for name in ("stroke", "force"):
        document[name] = base64.b64encode(np.asarray(document[name], "<f8").tobytes()).decode()
    return document


def from_json(document: dict[str, Any]) -> StoredEvaluation:
    """Inverse of :func:`to_json`."""
    key, fidelity = document.pop("key"), document.pop("fidelity")
    for name in ("stroke", "force"):
        document[name] = np.frombuffer(base64.b64decode(document[name]), "<f8").astype(np.float64)
    return StoredEvaluation(key, fidelity, Evaluation(**document))


def hdf5_of(header: Header, entries: Sequence[StoredEvaluation]) -> bytes:
    """The whole HDF5 file, made in memory: a disk that is full while HDF5 writes to it can end the process.

    Args:
        header: What the store belongs to.
        entries: Its runs.
    """
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs.update(asdict(header))
        _write_entries(file, header, entries)
        describe_sets(file, meaning_of)
        describe_attributes(file, WHAT, ATTRIBUTES)
    return stream.getvalue()


def read_hdf5(path: Path, header: Header) -> tuple[list[StoredEvaluation], int]:
    """The sound runs of an HDF5 file, and how many others there are.

    Args:
        path: The file.
        header: What it must belong to.

    Raises:
        OutputError: It cannot be read, or belongs to something else.
    """
    try:
        raw = path.read_bytes()
        with h5py.File(io.BytesIO(raw), "r") as file:
            found = {name: _plain(file.attrs.get(name)) for name in asdict(header)}
            digests = list(file["sha256"].asstr(errors="replace")[()]) if "sha256" in file else []
            if not digests:
                header.check(found, path)
            _check_sizes(file, len(raw))
            entries = list(_read_entries(file))
            sound = [e for e, d in zip(entries, digests, strict=True) if _is_sound(e, header, d)]
    except UNREADABLE as error:
        why = " ".join(str(error).split())
        raise OutputError(f"{path} is no store of evaluations, or damaged: {why}; move it away.") from error
    if not sound:  # as long as runs belong to this store, a header that says otherwise is damaged
        header.check(found, path)
    return sound, len(entries) - len(sound)


def read_runs(path: Path) -> list[StoredEvaluation]:
    """The sound runs of an HDF5 file, whatever calibration they belong to.

    Args:
        path: The file.

    Returns:
        The runs.

    Raises:
        OSError: There is no such file.
        OutputError: It cannot be read.
    """
    try:
        with h5py.File(io.BytesIO(path.read_bytes()), "r") as file:
            header = Header(**{name: _plain(file.attrs[name]) for name in Header.__dataclass_fields__})
    except FileNotFoundError:
        raise
    except UNREADABLE as error:
        raise OutputError(f"{path} is no store of evaluations, or damaged: {' '.join(str(error).split())}") from error
    return read_hdf5(path, header)[0]


def _check_sizes(file: h5py.File, size: int) -> None:
    """Refuse a data set that is larger than the file, whose sets are not compressed; reading it might take all memory.

    Raises:
        ValueError: There is one.
    """

    def look(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.nbytes > size:
            raise ValueError(f"{name} has {node.nbytes} bytes in a file of {size}")

    file.visititems(look)


def _is_sound(entry: StoredEvaluation, header: Header, digest: str) -> bool:
    return entry.digest(header) == digest


def _plain(value: Any) -> Any:
    """An HDF5 attribute as int or str."""
    return value.item() if isinstance(value, np.generic) else value


def _write_entries(file: h5py.File, header: Header, entries: Sequence[StoredEvaluation]) -> None:
    """Write all runs in the layout of the module."""
    runs = [r.evaluation for r in entries]
    text = h5py.string_dtype()
    file.create_dataset("key", data=[r.key for r in entries], dtype=text)
    file.create_dataset("sha256", data=[r.digest(header) for r in entries], dtype=text)
    file.create_dataset("fidelity", data=[r.fidelity for r in entries], dtype=text)
    file.create_dataset("status", data=[e.status for e in runs], dtype=text)
    file.create_dataset("reason", data=[e.reason for e in runs], dtype=text)
    file.create_dataset("fraction", data=[e.fraction for e in runs], dtype="f8")
    file.create_dataset("seconds", data=[e.seconds for e in runs], dtype="f8")
    for group, columns in (
        ("parameters", [e.parameters for e in runs]),
        ("scalars", [e.scalars for e in runs]),
    ):
        file.create_group(group)
        for name in sorted({name for column in columns for name in column}):
            file[group].create_dataset(name, data=[column.get(name, np.nan) for column in columns], dtype="f8")
    start = np.cumsum([0] + [e.stroke.size for e in runs])
    file.create_dataset("curves/start", data=start, dtype="i8")
    for name, curves in (("stroke", [e.stroke for e in runs]), ("force", [e.force for e in runs])):
        file.create_dataset(f"curves/{name}", data=np.concatenate([*curves, np.empty(0)]), dtype="f8")


def _read_entries(file: h5py.File) -> Iterator[StoredEvaluation]:
    """Inverse of :func:`_write_entries`."""
    text = {name: file[name].asstr(errors="replace")[()] for name in ("key", "fidelity", "status", "reason")}
    number = {name: file[name][()] for name in ("fraction", "seconds")}
    named = {group: {n: c[()] for n, c in file[group].items()} for group in ("parameters", "scalars")}
    start, stroke, force = (file[f"curves/{name}"][()] for name in ("start", "stroke", "force"))
    for k, key in enumerate(text["key"]):
        own = {
            group: {n: float(c[k]) for n, c in columns.items() if not np.isnan(c[k])}
            for group, columns in named.items()
        }
        part = slice(start[k], start[k + 1])
        evaluation = Evaluation(
            index=k,
            parameters=own["parameters"],
            status=text["status"][k],
            reason=text["reason"][k],
            fraction=float(number["fraction"][k]),
            stroke=stroke[part],
            force=force[part],
            scalars=own["scalars"],
            seconds=float(number["seconds"][k]),
        )
        yield StoredEvaluation(key, text["fidelity"][k], evaluation)
