"""The whole record of one cut in a file, so that it is simulated once.

An HDF5 file: what a :class:`mpm.record.ForceRecord` has over the stroke as datasets of its names and units, all else as
attributes, ``counters`` and ``pieces`` as JSON, and ``key``, the SHA-256 of scene and code.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import OutputError
from calib.provenance import code_key
from calib.store import content_key
from calib.workers import Workers
from mpm.record import ForceRecord
from mpm.scene import Scene
from mpm.section import Section
from mpm.topology import Topology

SECTION = "section"
JSON = ("counters", "pieces")  # parts of a record that are neither arrays nor numbers


def whole_record(scene: Scene, pool: Workers, path: Path, say: Callable[[str], None]) -> ForceRecord:
    """The record of a scene: from a file that holds it, else simulated and written there.

    Args:
        scene: The cut.
        pool: Where it is simulated.
        path: The file; a record of something else in it is replaced.
        say: Told when it is simulated.

    Raises:
        OutputError: The file cannot be written.
        SimulationError: The process of the simulation was killed twice.
    """
    key = content_key(scene.as_dict(), {}, code_key())
    record = _read(path, key)
    if record is None:
        say("simulating the best values once more for their full record")
        record = pool.record(scene)
        _write(path, key, record)
    return record


def _write(path: Path, key: str, record: ForceRecord) -> None:
    """Write a file under another name and rename it: a kill leaves the old one or none."""
    draft = path.with_name(path.name + ".draft")
    try:
        with h5py.File(draft, "w") as file:
            file.attrs["key"] = key
            for name, value in asdict(record).items():
                if isinstance(value, np.ndarray):
                    file[name] = value
                elif name == SECTION:
                    for part, content in (value or {}).items():
                        file[f"{SECTION}/{part}"] = content
                else:
                    file.attrs[name] = json.dumps(value) if name in JSON else value
        os.replace(draft, path)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e}); check the disk") from None


def _read(path: Path, key: str) -> ForceRecord | None:
    """The record of this key; None where the file is missing, damaged, or holds another one."""
    try:
        with h5py.File(path) as file:
            if file.attrs["key"] != key:
                return None
            section = {name: part[()] for name, part in file.get(SECTION, {}).items()}
            found = {name: values[()] for name, values in file.items() if name != SECTION}
            found |= {name: v.item() if isinstance(v, np.generic) else v for name, v in file.attrs.items()}
            found[SECTION] = Section(**section) if section else None
            values = {f.name: found[f.name] for f in fields(ForceRecord)}
            values |= {name: json.loads(values[name]) for name in JSON}
    except (OSError, KeyError, ValueError):
        return None
    if values["pieces"] is not None:
        pieces: dict[str, Any] = {n: tuple(v) if isinstance(v, list) else v for n, v in values["pieces"].items()}
        values["pieces"] = Topology(**pieces)
    return ForceRecord(**values)
