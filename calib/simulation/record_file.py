"""The whole record of one cut in a file, so that it is simulated once.

An HDF5 file: what a :class:`mpm.output.record.ForceRecord` has over the stroke as datasets of its names and units, all
else as attributes, ``counters`` and ``pieces`` as JSON, ``key``, the SHA-256 of scene and code, and ``sha256``, that of
all the rest: a file in which a bit has flipped is no record. Unit and meaning of each data set are attributes of it,
and those of the file's attributes are in ``attribute_meanings``; files of older versions have neither, and are read all
the same.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.io.meaning import NO_UNIT, UNKNOWN, Meaning, describe_attributes, describe_sets
from calib.io.provenance import code_key
from calib.io.type_schema import attributes_of
from calib.simulation.evaluation_file import UNREADABLE
from calib.simulation.evaluation_store import content_key
from calib.simulation.workers import Errand
from mpm.files import write_atomic
from mpm.output.record import ADHESION, COHESION, ENDINGS, SUCTION, ForceRecord
from mpm.output.section import Section
from mpm.output.topology import Topology
from mpm.scene import Scene

SECTION_GROUP = "section"
CHECKSUM = "sha256"  # attribute
JSON_FIELDS = ("counters", "pieces")  # parts of a record that are neither arrays nor numbers
WHAT = "All forces, momenta and energies of one simulated cut, a row for each interval of its output"


def record_errands(scene: Scene, path: Path) -> list[Errand]:
    """The simulation that brings the whole record of a scene into a file; none where the file holds it.

    A record of something else in the file is replaced. The errand raises OutputError where the file cannot be written.
    """
    if _read(path, _key(scene)) is not None:
        return []
    return [Errand(scene, lambda record: _write(path, _key(scene), record), whole=True)]


def read_record(scene: Scene, path: Path) -> ForceRecord:
    """The whole record of a scene, from the file that an errand has written.

    Raises:
        OutputError: The file does not hold it.
    """
    record = _read(path, _key(scene))
    if record is None:
        raise OutputError(f"{path}: changed since it was written; add --resume to simulate it again")
    return record


def _key(scene: Scene) -> str:
    return content_key(scene.as_dict(), {}, code_key())


def _write(path: Path, key: str, record: ForceRecord) -> None:
    """Write the file of a record; a kill leaves the old one or none."""
    stream = io.BytesIO()  # HDF5 itself may end the process on a full disk
    with h5py.File(stream, "w") as file:
        file.attrs["key"] = key
        for name, value in asdict(record).items():
            if isinstance(value, np.ndarray):
                file[name] = value
            elif name == SECTION_GROUP:
                for part, content in (value or {}).items():
                    file[f"{SECTION_GROUP}/{part}"] = content
            elif value is not None or name in JSON_FIELDS:
                file.attrs[name] = json.dumps(value) if name in JSON_FIELDS else value
        told = record_meanings()
        describe_sets(file, lambda path: told.get(path, UNKNOWN))
        describe_attributes(file, WHAT, {name: told.get(name, UNKNOWN) for name in sorted({*file.attrs, CHECKSUM})})
        file.attrs[CHECKSUM] = _digest(file)
    try:
        write_atomic(path, stream.getvalue())
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e}); check the disk") from None


def record_meanings() -> dict[str, Meaning]:
    """What each data set and attribute of the file is, by its path: what the docstrings of the record say of it."""
    texts = attributes_of(ForceRecord)
    texts |= {f"{SECTION_GROUP}/{name}": text for name, text in attributes_of(Section).items()}
    out = {name: _meaning(text) for name, text in texts.items()}
    out |= {name: replace(out[name], text=f"{out[name].text}; as JSON") for name in JSON_FIELDS if name in out}
    if "ended" in out:  # whose docstring names a constant
        out["ended"] = replace(out["ended"], text=out["ended"].text.replace("ENDINGS", ", ".join(ENDINGS)))
    out["key"] = Meaning(NO_UNIT, "SHA-256 of scene and version of the code")
    out[CHECKSUM] = Meaning(NO_UNIT, "checksum of all data sets and all other attributes of the file")
    return out


def _meaning(text: str) -> Meaning:
    """Unit, text and shape of an attribute, as its docstring has them."""
    plain = re.sub(r":\w+:`([^`]*)`", r"\1", text).replace("``", "")
    unit = re.search(r" \[([^\]]*)\]", plain)
    shape = re.search(r", shape (\([^)]*\))", plain)
    for part in (unit, shape):
        plain = plain if part is None else plain.replace(part[0], "", 1)
    return Meaning(NO_UNIT if unit is None else unit[1], plain, "" if shape is None else shape[1])


def _digest(file: h5py.File) -> str:
    """SHA-256 of all data sets and attributes by name, but of its own."""
    found = hashlib.sha256()

    def take(name: str, value: Any) -> None:
        content = np.asarray(value)
        text = content.item() if content.dtype.kind in "OSU" else content.tobytes()
        found.update(repr((name, content.shape, text)).encode())

    for name in sorted(file.attrs):
        if name != CHECKSUM:
            take(name, file.attrs[name])
    sets: dict[str, h5py.Dataset] = {}
    file.visititems(lambda name, node: sets.update({name: node}) if isinstance(node, h5py.Dataset) else None)
    for name in sorted(sets):
        take(name, sets[name][()])
    return found.hexdigest()


def _read(path: Path, key: str) -> ForceRecord | None:
    """The record of this key; None where the file is missing, damaged, or holds another one."""
    try:
        with h5py.File(io.BytesIO(path.read_bytes())) as file:
            if file.attrs["key"] != key or file.attrs[CHECKSUM] != _digest(file):
                return None
            section = {name: part[()] for name, part in file.get(SECTION_GROUP, {}).items()}
            found = {name: values[()] for name, values in file.items() if name != SECTION_GROUP}
            found |= {name: v.item() if isinstance(v, np.generic) else v for name, v in file.attrs.items()}
            found[SECTION_GROUP] = Section(**section) if section else None
            for name in (COHESION, ADHESION, SUCTION):
                found.setdefault(name, None)
            found.setdefault("slowed", False)
            found.setdefault("dampers", np.zeros_like(found["momentum"]))
            found.setdefault("rows_down", None)
            values = {f.name: found[f.name] for f in fields(ForceRecord)}
            values |= {name: json.loads(values[name]) for name in JSON_FIELDS}
    except UNREADABLE:
        return None
    if values["pieces"] is not None:
        pieces: dict[str, Any] = {n: tuple(v) if isinstance(v, list) else v for n, v in values["pieces"].items()}
        values["pieces"] = Topology(**pieces)
    return ForceRecord(**values)
