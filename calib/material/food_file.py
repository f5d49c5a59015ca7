"""The file of a food, as a calibration writes it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import yaml

from calib.errors import OutputError
from calib.io.yaml_checks import Dumper
from mpm.files import write_atomic


class Written(Protocol):
    """What a file is made of: a :class:`calib.material.food.FoodSpec`."""

    @property
    def name(self) -> str:
        """Name of the food."""

    def as_dict(self) -> dict[str, Any]:
        """Plain data in the layout of ``materials.yaml``."""


def dump_material(food: Written, path: Path | str, provenance: Mapping[str, Any]) -> None:
    """Write a food and where its values come from; :func:`calib.material.food.load_material_file` reads it back.

    Args:
        food: The calibrated food.
        path: The file to write; an existing one is replaced as a whole or not at all.
        provenance: Plain data (text, numbers, lists, mappings), for instance trace hash, versions, intervals.

    Raises:
        OutputError: The file cannot be written, or ``provenance`` holds something that is not plain data.
    """
    path = Path(path)
    document = {food.name: food.as_dict(), "calibration": dict(provenance)}
    try:
        body = yaml.dump(document, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110)
    except yaml.representer.RepresenterError as e:
        raise OutputError(f"{path}: the provenance holds {e.args[-1]!r}; give plain data only") from None
    head = "# One calibrated food in the layout of materials.yaml. All values in SI units.\n"
    try:
        write_atomic(path, head + body)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror}); choose another folder") from None
