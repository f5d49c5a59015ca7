"""All simulations of a calibration on disk, so that nothing is computed twice and nothing is lost.

``evaluations.h5`` is an ordinary HDF5 file for h5py, pandas or MATLAB, one entry per run along axis 0 (n
runs):

    attributes      schema, trace_sha256, scene_key
    sha256          (n,) checksum of each run, see :mod:`calib.simulation.evaluation_file`
    key             (n,) SHA-256 of scene, parameters and code version, see :func:`content_key`
    status, reason, fidelity             (n,) text
    fraction [-], seconds [s]            (n,)
    parameters/NAME [SI], scalars/NAME   (n,) NaN where a run has no such number
    curves/stroke [m], curves/force [N]  (m,) all curves end to end
    curves/start    (n + 1,) run k owns stroke[start[k]:start[k + 1]] and the same part of force

Each data set says its ``unit`` and its ``description`` as attributes (:mod:`calib.simulation.evaluation_meanings`);
files of older versions do not, and are read all the same.

    with h5py.File("evaluations.h5") as f:
        table = pandas.DataFrame({name: column[()] for name, column in f["parameters"].items()})
        table["status"] = f["status"].asstr()[()]

HDF5 does not survive a process that is killed while it writes. Runs therefore go first into a journal beside
it, ``evaluations.h5.journal``: one line of checksum and JSON per run, forced to disk before :meth:`append`
returns; a kill can tear the last line only.  Closing and reopening the store write the HDF5 file as a whole
under another name and rename it, which is atomic, before the journal is removed.  One process at a time may
write: :func:`calib.io.folder.prepare` locks the folder.

A run whose checksum is wrong is left out and made again; the damaged file is kept as ``evaluations.h5.damaged``.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from calib.errors import OutputError
from calib.simulation.evaluation import Evaluation, Evaluator
from calib.simulation.evaluation_file import Header as Header
from calib.simulation.evaluation_file import StoredEvaluation, from_json, hdf5_of, read_hdf5, to_json
from mpm.files import write_atomic

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


class EvaluationStore:
    """Runs by content key, on disk as soon as they are appended; a context manager that closes itself.

    Args:
        path: The HDF5 file; its journal lies beside it.
        header: What the store belongs to.
        resume: Whether to go on with a store that exists.
        say: Called with a sentence where runs were damaged.

    Raises:
        OutputError: The store exists and ``resume`` is False, belongs to something else, or cannot be read or
            written.
    """

    def __init__(
        self,
        path: Path | str,
        header: Header,
        *,
        resume: bool = False,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.path = Path(path)
        self.journal = self.path.with_name(self.path.name + ".journal")
        self.header = header
        self._entries: dict[str, StoredEvaluation] = {}
        self._stream: BinaryIO | None = None
        self.torn = 0
        """Damaged lines found in the journal: runs that were being written when the process was killed."""
        self.damaged = 0
        """Damaged runs found in the HDF5 file."""
        present = [p for p in (self.path, self.journal) if p.exists()]
        if present and not resume:
            raise OutputError(
                f"{present[0]} exists already; add --resume to go on with it, or choose another --out folder."
            )
        if self.path.exists():
            self._read_file()
        if self.journal.exists():
            self._read_journal()
        if self.journal.exists() or self.damaged:
            self._compact()
        if self.damaged:
            say(
                f"{self.damaged} runs of {self.path} were damaged, are left out and simulated again; the file is kept "
                f"as {self.path.name}.damaged: check the disk"
            )

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
            _write_line(self._stream, to_json(entry))
        except OSError as error:
            raise OutputError(
                f"{self.journal} cannot be written: {error}; free space or choose another --out."
            ) from error
        self._entries[key] = entry

    def close(self) -> None:
        """Write the HDF5 file and remove the journal. A store without a run leaves no file.

        Raises:
            OutputError: The file cannot be written; the journal then still holds everything.
        """
        if self._stream is not None or (self._entries and not self.path.exists()):
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
                self.header.check(document, self.journal)
            else:
                entry = from_json(document)
                self._entries[entry.key] = entry

    def _read_file(self) -> None:
        """Take over the sound runs of the HDF5 file, and keep a copy of it where there are others."""
        entries, self.damaged = read_hdf5(self.path, self.header)
        for place, entry in enumerate(entries):
            self._entries[entry.key] = replace(entry, evaluation=replace(entry.evaluation, index=place))
        if self.damaged:
            self._set_aside()

    def _set_aside(self) -> None:
        """Keep a copy of the damaged HDF5 file."""
        aside = self.path.with_name(f"{self.path.name}.damaged")
        try:
            write_atomic(aside, self.path.read_bytes())
        except OSError as error:
            raise OutputError(f"{aside} cannot be written: {error}; free space, or move {self.path} away.") from error

    def _compact(self) -> None:
        """Write everything into the HDF5 file under another name, rename it, and remove the journal."""
        try:
            write_atomic(self.path, hdf5_of(self.header, list(self)), sync=True)
            if self._stream is not None:
                self._stream.close()
                self._stream = None
            self.journal.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{self.path} cannot be written: {error}; free space, then --resume goes on from its journal."
            ) from error


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
