"""TDMS files of LabVIEW as tables: the channels of one group, their units and the waveform's own clock."""

from __future__ import annotations

import hashlib
import io
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.formats.extras import needed
from calib.io.wording import brief, listed
from calib.table.table import Cells, Table
from calib.table.vector_fields import table_of_fields

WAVEFORM_TIME = "time_s"
"""Name of the time that the increment of a waveform gives."""


def table_of_tdms(source: str, raw: bytes, address: str) -> Table:
    """The table in a TDMS file.

    Args:
        source: What errors call the file.
        raw: Its content.
        address: Name of the group, empty for the only one.

    Returns:
        The table. Where no channel holds the time, it has that of the waveform.

    Raises:
        TraceError: It is damaged, or holds several groups.
    """
    nptdms = needed(source, "nptdms", "a TDMS file")
    try:
        groups = {group.name: group.channels() for group in nptdms.TdmsFile.read(io.BytesIO(raw)).groups()}
    except Exception as error:  # noqa: BLE001 - the reader raises whatever the damaged bytes make of it
        raise TraceError(f"{source}: damaged, or not a TDMS file ({brief(str(error))})") from None
    groups = {name: channels for name, channels in groups.items() if any(len(channel) > 1 for channel in channels)}
    wanted = address.strip("/")
    if wanted and wanted not in groups:
        raise TraceError(f"{source}: no group {brief(wanted)}; it holds {listed(list(groups))}")
    if not groups:
        raise TraceError(f"{source}: damaged, or not a TDMS file (no group holds a channel with samples)")
    if not wanted and len(groups) != 1:
        raise TraceError(
            f"{source}: {len(groups)} groups hold channels ({listed(list(groups))}); name one as {source}:GROUP"
        )
    channels = groups[wanted or next(iter(groups))]
    fields: dict[str, Cells] = {channel.name: _values(channel[:]) for channel in channels}
    units = {c.name: str(c.properties["unit_string"]) for c in channels if c.properties.get("unit_string")}
    clock = next((c for c in channels if c.properties.get("wf_increment")), None)
    if clock is not None and WAVEFORM_TIME not in fields:
        fields[WAVEFORM_TIME] = np.asarray(clock.time_track(), dtype=float)
    digest = hashlib.sha256(raw + wanted.encode()).hexdigest()
    return table_of_fields(source, fields, digest, stated=units)


def _values(values: Any) -> Cells:
    """Numbers and times as they are, anything else as a list."""
    array = np.asarray(values)
    return array if array.dtype.kind in "iufM" else [str(item) for item in array.tolist()]
