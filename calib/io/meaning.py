"""What stands in an HDF5 file, said in the file itself.

Each data set has the attributes ``unit`` and ``description``. An attribute of a file or group cannot have attributes of
its own: ``attribute_meanings`` beside it has unit and description of each, as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import h5py

UNIT, DESCRIPTION = "unit", "description"
ATTRIBUTE_MEANINGS = "attribute_meanings"
NO_UNIT = "-"
"""Unit of a number without one, and of text."""


@dataclass(frozen=True)
class Meaning:
    """What a data set, a column or an attribute is.

    Attributes:
        unit: SI unit, ``-`` where it has none.
        text: What it is, without a full stop.
        shape: Its shape, empty for a single value; the file itself has it.
    """

    unit: str
    text: str
    shape: str = ""


UNKNOWN = Meaning("unknown", "not described")


def describe_sets(file: h5py.Group, meaning: Callable[[str], Meaning]) -> None:
    """Say of each data set of a file or group what it is.

    Args:
        file: The file or group.
        meaning: Gives the meaning of a data set by its path within it, such as ``curves/force``.
    """

    def look(name: str, node: h5py.Group | h5py.Dataset) -> None:
        if isinstance(node, h5py.Dataset):
            found = meaning(name)
            node.attrs[UNIT], node.attrs[DESCRIPTION] = found.unit, found.text

    file.visititems(look)


def describe_attributes(group: h5py.Group, what: str, meanings: Mapping[str, Meaning]) -> None:
    """Say what a file or group is, and what its attributes are.

    Args:
        group: The file or group; its own attributes may be written before or after.
        what: What it is, in a sentence.
        meanings: Meaning of each of its attributes, by name.
    """
    group.attrs[DESCRIPTION] = what
    told = {name: {UNIT: one.unit, DESCRIPTION: one.text} for name, one in meanings.items()}
    group.attrs[ATTRIBUTE_MEANINGS] = json.dumps(told)
