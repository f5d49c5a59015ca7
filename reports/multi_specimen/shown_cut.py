"""One fitted cut of a study, as the model page of a calibration reads it: so both reports say the same of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import yaml

from mpm.scene import Knife
from mpm.scene.shapes import Shape
from reports.base.run_folder import Data

MATERIAL = "material.yaml"
Cited = Callable[[Iterable[str | None]], Mapping[str, str]]
"""What gives the references, in full, that some sources name."""


@dataclass(frozen=True)
class StoredCut:
    """What the record of a fitted cut says of its simulation.

    Attributes:
        images: Parts that the simulated one stands for.
        dt: Time step [s].
        steps: Number of time steps.
    """

    images: int
    dt: float
    steps: int


@dataclass(frozen=True)
class Known:
    """What a study knows of its food.

    Attributes:
        properties: Values of the calibrated food [SI] with unit, range, status and source, by name.
        stored: What the record of each fitted cut says, by cut.
    """

    properties: Mapping[str, Data] = field(default_factory=dict)
    stored: Mapping[str, StoredCut] = field(default_factory=dict)


def read_known(folder: Path, names: Iterable[str]) -> Known:
    """Read the food and the records of a study's folder.

    Args:
        folder: The folder.
        names: The fitted cuts.

    Returns:
        What is there; of a file that is missing or damaged, nothing.
    """
    try:
        document = yaml.safe_load((folder / MATERIAL).read_text(encoding="utf-8"))
        (food,) = (one for key, one in document.items() if key != "calibration")
        properties = {name: p for name, p in food["properties"].items() if isinstance(p, dict)}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError):
        properties = {}
    stored = {name: one for name in names if (one := _stored(folder / f"record-{name}.h5")) is not None}
    return Known(properties, stored)


def _stored(path: Path) -> StoredCut | None:
    try:
        with h5py.File(path, "r") as file:
            return StoredCut(int(file.attrs["images"]), float(file.attrs["dt"]), int(file.attrs["steps"]))
    except (OSError, KeyError, TypeError, ValueError):
        return None


def not_fitted(s: Data, known: Known) -> dict[str, Data]:
    """The properties that no cut was fitted in, but for what starts a cut in bare flesh where a skin starts it."""
    fitted = {name.partition("@")[0] for name in s["parameters"]}
    skin = "skin_thickness" in fitted or bool((known.properties.get("skin_thickness") or {}).get("value"))
    unused = {"R_initiation"} if skin else set()
    return {name: p for name, p in known.properties.items() if name not in fitted | unused}


def as_calibration(s: Data, name: str, known: Known, cited: Cited) -> Any:
    """A fitted cut in the place of a calibration's result.

    Args:
        s: ``summary.json``.
        name: The cut.
        known: What the folder says of food and records.
        cited: What gives the references that sources name.

    Returns:
        An object with those attributes of a calibration's result that its model page reads.
    """
    cut, stored = s["traces"][name], known.stored.get(name)
    parameters = {n.partition("@")[0]: p for n, p in s["parameters"].items() if n.partition("@")[2] in ("", name)}
    fixed = not_fitted(s, known)
    sources = [p.get("source") for p in (*s["parameters"].values(), *fixed.values())]
    return SimpleNamespace(
        cut=SimpleNamespace(
            dx_m=cut["dx_m"],
            particles=int((cut.get("scalars") or {}).get("particles", 0)) or None,
            mirror_images=None if stored is None else stored.images,
            mach=cut.get("mach"),
            speed_real_m_s=cut.get("speed_real_m_s"),
            shape=Shape(**cut["shape"]),
            knife=Knife(**cut["knife"]),
            scene=cut.get("scene") or {},
        ),
        fitted={n: SimpleNamespace(**p) for n, p in parameters.items()},
        fixed_parameters={n: SimpleNamespace(**p) for n, p in fixed.items()},
        conditioning=SimpleNamespace(**cut["conditioning"]) if cut.get("conditioning") else None,
        verdicts=(),
        withdrawal=None,
        nuisances={},
        posterior=SimpleNamespace(discrepancy=s.get("discrepancy")),
        references=dict(cited(sources)),
    )
