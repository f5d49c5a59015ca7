"""Whether the packages of cutcal are still its own.

Two distributions may install files of one name: the later one overwrites the earlier, and pip says nothing of it.
"""

from __future__ import annotations

import base64
import csv
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from calib.io.yaml_checks import PACKAGE

NAME = "cutcal"
PACKAGES = ("cutcal", "calib", "mpm", "reports", "fem_reference", "studies", "intsim")
"""What a wheel of cutcal installs side by side."""
SHOWN = 3  # files that a sentence names


@dataclass(frozen=True)
class Overwritten:
    """What is not as cutcal installed it.

    Attributes:
        elsewhere: Packages that Python finds in another place than the rest of cutcal, each with its folder.
        altered: Installed files whose content is not cutcal's.
        claimed: Other distributions that list files in cutcal's packages, each with these files.
    """

    elsewhere: dict[str, str]
    altered: tuple[str, ...]
    claimed: dict[str, tuple[str, ...]]

    def __bool__(self) -> bool:
        """Whether anything is wrong."""
        return bool(self.elsewhere or self.altered or self.claimed)

    def sentence(self) -> str:
        """What is wrong and what to do."""
        said = [f"Python finds {name} in {place}, which is not cutcal's" for name, place in self.elsewhere.items()]
        said += [f"{name} installs {_some(files)} as well" for name, files in self.claimed.items()]
        said += [f"{_some(self.altered)} is not what cutcal installed"] if self.altered else []
        return "; ".join(said) + "; install cutcal in an environment of its own"


def overwritten(
    distributions: Iterable[metadata.Distribution] | None = None, home: Path = PACKAGE.parent
) -> Overwritten:
    """Compare what lies in cutcal's packages with what cutcal installed.

    Args:
        distributions: Those that are installed; None for those of this Python.
        home: Folder in which cutcal's packages lie side by side.

    Returns:
        What is not cutcal's; it is false where all is well. In a checkout only places and claims can be looked at.
    """
    altered: list[str] = []
    claimed: dict[str, tuple[str, ...]] = {}
    for distribution in metadata.distributions() if distributions is None else distributions:
        if Path(str(distribution.locate_file(""))).resolve() != home.resolve():
            continue
        rows = csv.reader((distribution.read_text("RECORD") or "").splitlines())
        ours = [row for row in rows if row and row[0].split("/")[0] in PACKAGES and row[0].endswith(".py")]
        if distribution.metadata["Name"] == NAME:
            altered += [row[0] for row in ours if len(row) > 1 and row[1] and not _same(home / row[0], row[1])]
        elif ours:
            claimed[str(distribution.metadata["Name"])] = tuple(row[0] for row in ours)
    places = {name: _place(name) for name in PACKAGES}
    elsewhere = {name: str(place) for name, place in places.items() if place is None or place != home.resolve()}
    return Overwritten(elsewhere if home == PACKAGE.parent else {}, tuple(altered), claimed)


def _same(path: Path, recorded: str) -> bool:
    """Whether a file has the digest that its RECORD gives, such as ``sha256=47DEQpj8...``."""
    kind, _, digest = recorded.partition("=")
    if not path.is_file():
        return False
    found = hashlib.new(kind, path.read_bytes()).digest()
    return base64.urlsafe_b64encode(found).rstrip(b"=").decode() == digest


def _place(name: str) -> Path | None:
    """Folder that holds a package."""
    spec = find_spec(name)
    return None if spec is None or spec.origin is None else Path(spec.origin).resolve().parents[1]


def _some(files: tuple[str, ...]) -> str:
    """The first of some files, and how many more there are."""
    more = len(files) - SHOWN
    return ", ".join(files[:SHOWN]) + (f" and {more} more" if more > 0 else "")
