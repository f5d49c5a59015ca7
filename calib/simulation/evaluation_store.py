"""All simulations of a calibration on disk, so that nothing is computed twice and nothing is lost.

``evaluations.h5`` is an ordinary HDF5 file for h5py, pandas or MATLAB, one entry per run along axis 0 (n
runs):

    attributes      schema, trace_sha256, scene_key
    key             (n,) SHA-256 of scene, parameters and code version, see :func:`content_key`
    status, reason, fidelity             (n,) text
    fraction [-], seconds [s]            (n,)
    parameters/NAME [SI], scalars/NAME   (n,) NaN where a run has no such number
    curves/stroke [m], curves/force [N]  (m,) all curves end to end
    curves/start    (n + 1,) run k owns stroke[start[k]:start[k + 1]] and the same part of force

    with h5py.File("evaluations.h5") as f:
        table = pandas.DataFrame({name: column[()] for name, column in f["parameters"].items()})
        table["status"] = f["status"].asstr()[()]

HDF5 does not survive a process that is killed while it writes. Runs therefore go first into a journal beside
it, ``evaluations.h5.journal``: one line of checksum and JSON per run, forced to disk before :meth:`append`
returns; a kill can tear the last line only.  Closing and reopening the store write the HDF5 file as a whole
under another name and rename it, which is atomic, before the journal is removed.  One process at a time may
write.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import h5py
import numpy as np

from calib.errors import OutputError
from calib.simulation.evaluation import Evaluation, Evaluator
from mpm.files import replacing

LAYOUT_VERSION = 1
"""Version of both layouts; a file with another one is refused."""
KEY_DIGITS = 12
"""Significant digits of a parameter in a key: what survives any arithmetic on its logarithm."""
REPEATABLE_STATUS = ("ok", "failed")
"""Outcomes that would come out the same again; of other runs (timeout, stopped by the user) nothing was learnt."""
TRANSIENT_REASONS = ("worker_died",)
"""Reasons of a failure that say nothing of the material, so that the run is made again: a worker process was killed."""


def content_key(scene: Mapping[str, Any], parameters: Mapping[str, float], code: str) -> str:
    """Key of a run: the same for the same scene, parameters (12 digits) and code version.

    Args:
        scene: Everything else that determines the simulation, as plain JSON types.
        parameters: Values [SI] by name.
        code: Version of the simulating code.

    Returns:
        SHA-256 of the canonical JSON of the three, hexadecimal.

    Raises:
        ValueError: A number that is not finite.
        TypeError: Something that is not plain JSON.
    """
    rounded = {name: float(f"{value:.{KEY_DIGITS - 1}e}") for name, value in parameters.items()}
    document = {"scene": scene, "parameters": rounded, "code": code}
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


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


class EvaluationStore:
    """Runs by content key, on disk as soon as they are appended; a context manager that closes itself.

    Args:
        path: The HDF5 file; its journal lies beside it.
        header: What the store belongs to.
        resume: Whether to go on with a store that exists.

    Raises:
        OutputError: The store exists and ``resume`` is False, belongs to something else, or cannot be read or
            written.
    """

    def __init__(self, path: Path | str, header: Header, *, resume: bool = False) -> None:
        self.path = Path(path)
        self.journal = self.path.with_name(self.path.name + ".journal")
        self.header = header
        self._entries: dict[str, StoredEvaluation] = {}
        self._stream: BinaryIO | None = None
        self.torn = 0
        """Damaged lines found in the journal: runs that were being written when the process was killed."""
        present = [p for p in (self.path, self.journal) if p.exists()]
        if present and not resume:
            raise OutputError(
                f"{present[0]} exists already; add --resume to go on with it, or choose another --out folder."
            )
        if self.path.exists():
            self._read_file()
        if self.journal.exists():
            self._read_journal()
            self._compact()

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[StoredEvaluation]:
        return iter(self._entries.values())

    def __enter__(self) -> EvaluationStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def get(self, key: str) -> Evaluation | None:
        """The run with this content key; None where there is none, or where it may come out otherwise next time."""
        entry = self._entries.get(key)
        if entry is None:
            return None
        run = entry.evaluation
        return run if run.status in REPEATABLE_STATUS and run.reason not in TRANSIENT_REASONS else None

    def last(self, key: str) -> Evaluation:
        """The run with this content key as it came out the last time.

        Raises:
            KeyError: There is none.
        """
        return self._entries[key].evaluation

    def append(self, key: str, evaluation: Evaluation, fidelity: str) -> None:
        """Store a run; it is on disk when this returns. A run with a known key takes the place of that one.

        Args:
            key: Its content key.
            evaluation: The run; its ``index`` becomes its place in the store.
            fidelity: Label of the resolution it was run at.

        Raises:
            OutputError: The journal cannot be written.
        """
        known = self._entries.get(key)
        place = len(self) if known is None else known.evaluation.index
        entry = StoredEvaluation(key, fidelity, replace(evaluation, index=place))
        try:
            if self._stream is None:
                self._stream = self._begin()
            _write_line(self._stream, _to_json(entry))
        except OSError as error:
            raise OutputError(
                f"{self.journal} cannot be written: {error}; free space or choose another --out."
            ) from error
        self._entries[key] = entry

    def close(self) -> None:
        """Write the HDF5 file and remove the journal.

        Raises:
            OutputError: The file cannot be written; the journal then still holds everything.
        """
        if self._stream is not None or not self.path.exists():
            self._compact()

    def _begin(self) -> BinaryIO:
        """Open the journal and write its header."""
        stream = self.journal.open("ab")
        try:
            _write_line(stream, asdict(self.header))
        except OSError:
            stream.close()
            raise
        return stream

    def _check(self, found: Mapping[str, Any], where: Path) -> None:
        """Refuse a header other than this store's."""
        for name, expected in asdict(self.header).items():
            if found.get(name) != expected:
                raise OutputError(
                    f"{where} belongs to another calibration: its {name} is {found.get(name)!r}, not "
                    f"{expected!r}; choose another --out folder."
                )

    def _read_journal(self) -> None:
        """Take over the runs of the journal, leaving out damaged lines."""
        documents = []
        for line in self.journal.read_bytes().split(b"\n"):
            if line:
                try:
                    if int(line[:8], 16) != zlib.crc32(line[9:]):
                        raise ValueError("checksum")
                    documents.append(json.loads(line[9:]))
                except ValueError:
                    self.torn += 1
        for document in documents:
            if "schema" in document:
                self._check(document, self.journal)
            else:
                entry = _from_json(document)
                self._entries[entry.key] = entry

    def _read_file(self) -> None:
        """Take over the runs of the HDF5 file."""
        try:
            with h5py.File(self.path, "r") as file:
                self._check({name: _plain(value) for name, value in file.attrs.items()}, self.path)
                for entry in _read_entries(file):
                    self._entries[entry.key] = entry
        except (OSError, KeyError) as error:
            raise OutputError(f"{self.path} is no store of evaluations: {error}; move it away.") from error

    def _compact(self) -> None:
        """Write everything into the HDF5 file under another name, rename it, and remove the journal."""
        try:
            with replacing(self.path, sync=True) as draft, h5py.File(draft, "w") as file:
                file.attrs.update(asdict(self.header))
                _write_entries(file, list(self))
            if self._stream is not None:
                self._stream.close()
                self._stream = None
            self.journal.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"{self.path} cannot be written: {error}; its journal holds all runs.") from error


class CachedEvaluator:
    """Evaluator before which a store stands: known runs are read, new ones run and stored.

    Args:
        evaluator: Runs what is not known.
        store: Where runs are kept.
        scene: Everything that determines a simulation besides its parameters, as plain JSON types.
        code: Version of the simulating code.
        fidelity: Label of the resolution.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        store: EvaluationStore,
        *,
        scene: Mapping[str, Any],
        code: str,
        fidelity: str = "fine",
    ) -> None:
        self._evaluator, self._store = evaluator, store
        self._scene, self._code, self._fidelity = scene, code, fidelity
        self.computed = 0
        """Runs that were not in the store."""

    def keeper(self, parameters: Mapping[str, float]) -> Callable[[Evaluation], None] | None:
        """What stores the run of these values, whoever makes it; None where it is known."""
        key = content_key(self._scene, parameters, self._code)
        if self._store.get(key) is not None:
            return None
        return lambda run: self._store.append(key, replace(run, parameters=dict(parameters)), self._fidelity)

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Known runs at once, then new ones in order of completion, each stored before it is handed on."""
        keys = [content_key(self._scene, parameters, self._code) for parameters in batch]
        new = []
        for index, key in enumerate(keys):
            known = self._store.get(key)
            if known is not None:
                yield replace(known, index=index)
            else:
                new.append(index)
        if not new:
            return
        for evaluation in self._evaluator.evaluate([batch[index] for index in new]):
            index = new[evaluation.index]
            self._store.append(keys[index], evaluation, self._fidelity)
            self.computed += 1
            yield replace(evaluation, index=index)


def _write_line(stream: BinaryIO, document: Mapping[str, Any]) -> None:
    """Append one line to a journal, after a line end in case the last one is torn, and force it to disk."""
    text = json.dumps(document).encode()
    stream.write(b"\n%08x %s\n" % (zlib.crc32(text), text))
    stream.flush()
    os.fsync(stream.fileno())


def _to_json(entry: StoredEvaluation) -> dict[str, Any]:
    """An entry as plain JSON; curves as base64 of little-endian 64-bit floats."""
    document = {"key": entry.key, "fidelity": entry.fidelity, **vars(entry.evaluation)}
    for name in ("parameters", "scalars"):
        document[name] = {n: float(x) for n, x in document[name].items()}
    for name in ("stroke", "force"):
        document[name] = base64.b64encode(np.asarray(document[name], "<f8").tobytes()).decode()
    return document


def _from_json(document: dict[str, Any]) -> StoredEvaluation:
    """Inverse of :func:`_to_json`."""
    key, fidelity = document.pop("key"), document.pop("fidelity")
    for name in ("stroke", "force"):
        document[name] = np.frombuffer(base64.b64decode(document[name]), "<f8").astype(np.float64)
    return StoredEvaluation(key, fidelity, Evaluation(**document))


def _plain(value: Any) -> Any:
    """An HDF5 attribute as int or str."""
    return value.item() if isinstance(value, np.generic) else value


def _write_entries(file: h5py.File, entries: Sequence[StoredEvaluation]) -> None:
    """Write all runs in the layout of the module."""
    runs = [r.evaluation for r in entries]
    text = h5py.string_dtype()
    file.create_dataset("key", data=[r.key for r in entries], dtype=text)
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
    text = {name: file[name].asstr()[()] for name in ("key", "fidelity", "status", "reason")}
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
