"""Bags of ROS 1 and 2 as tables: a column for each number of each topic, a row for each message."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.formats.extras import needed
from calib.io.wording import brief
from calib.table.table import Table
from calib.table.vector_fields import LONGEST_VECTOR

TIME = "__time"
"""Name of the time, as PlotJuggler writes it, in seconds."""
DEEPEST, MOST_MESSAGES = 6, 2_000_000
"""Levels of a message, and messages of a bag, that are read."""


def table_of_bag(path: Path) -> Table:
    """The table in a bag: a .bag or .mcap file, a .db3 file, or the folder of a ROS 2 bag.

    Each message is a row with the numbers of its topic; the cells of other topics are empty. Its time is that in its
    header, or that of its recording where it has none. Names are those of PlotJuggler: ``/topic/wrench/force/z``.

    Args:
        path: The file or folder.

    Returns:
        The table.

    Raises:
        TraceError: It is damaged, or holds nothing with numbers.
    """
    highlevel = needed(path.name, "rosbags.highlevel", "a bag of ROS")
    typesys = needed(path.name, "rosbags.typesys", "a bag of ROS")
    store = typesys.get_typestore(typesys.Stores.LATEST)
    rows: list[tuple[float, dict[str, float]]] = []
    left_out: dict[str, str] = {}
    try:
        with highlevel.AnyReader([path], default_typestore=store) as reader:
            for connection, recorded, raw in reader.messages():
                if connection.topic in left_out:
                    continue
                if len(rows) >= MOST_MESSAGES:
                    raise TraceError(f"{path.name}: more than {MOST_MESSAGES} messages; filter the topics of the cut")
                try:
                    message = reader.deserialize(raw, connection.msgtype)
                except (KeyError, ValueError, TypeError, AssertionError) as error:
                    left_out[connection.topic] = f"its type {connection.msgtype} is not known ({brief(str(error))})"
                    continue
                values = dict(_numbers(connection.topic, message, 0))
                if values:
                    rows.append((_stamp(message) or 1e-9 * recorded, values))
    except TraceError:
        raise
    except Exception as error:  # noqa: BLE001 - the reader raises whatever the damaged bytes make of it
        raise TraceError(f"{path.name}: damaged, or not a bag of ROS ({brief(str(error))})") from None
    if not rows:
        raise TraceError(f"{path.name}: no messages with numbers; record the topics of force and position")
    rows.sort(key=lambda row: row[0])
    names = list(dict.fromkeys(name for _, values in rows for name in values))
    columns = {name: np.array([values.get(name, np.nan) for _, values in rows]) for name in names}
    return Table(
        source=path.name,
        columns={TIME: np.array([time for time, _ in rows]), **columns},
        rows=range(len(rows)),
        row="message",
        sha256=_sha256(path),
        left_out=left_out,
    )


def _numbers(name: str, value: Any, depth: int) -> Iterator[tuple[str, float]]:
    """Every number of a message with its name; headers and long lists are left out."""
    if isinstance(value, (bool, int, float, np.number)):
        yield name, float(value)
    elif isinstance(value, (np.ndarray, list, tuple)):
        if 0 < len(value) <= LONGEST_VECTOR:
            for i, item in enumerate(value):
                yield from _numbers(f"{name}[{i}]", item, depth + 1)
    elif hasattr(value, "__dataclass_fields__") and depth < DEEPEST:
        for field in value.__dataclass_fields__:
            if field not in ("header", "covariance", "__msgtype__"):
                yield from _numbers(f"{name}/{field}", getattr(value, field), depth + 1)


def _stamp(message: Any) -> float:
    """The time in a message's header [s], zero where it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec) if stamp is not None else 0.0


def _sha256(path: Path) -> str:
    """SHA-256 of a file, or of all files of a folder in the order of their names."""
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        if file.is_file():
            digest.update(file.read_bytes())
    return digest.hexdigest()
