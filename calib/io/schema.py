"""The JSON documents of the command line: which there are, and the schema of each.

A document that is an object says in ``schema`` which one it is, as ``cutcal/NAME/VERSION``; the lists of names cannot. The version
rises when a key is taken away or comes to mean something else, not when one is added. The schemas are closed: an object whose keys
are listed has no others.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from calib.io.yaml_checks import suggest
from mpm.scene.errors import CutcalError

FOLDER = Path(__file__).with_name("schemas")
COMMON = "common"  # parts that several schemas share
VERSION = 1


def names() -> list[str]:
    """All documents, in the order of the alphabet."""
    return sorted(path.stem for path in FOLDER.glob("*.json") if path.stem != COMMON)


def tag(name: str) -> str:
    """What a document of this name has under ``schema``."""
    return f"cutcal/{name}/{VERSION}"


def schema(name: str) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a document, with the shared parts in it, so that it can be used alone.

    Args:
        name: One of :func:`names`, or the tag of a document.

    Raises:
        CutcalError: There is no such document.
    """
    known = names()
    plain = next((n for n in known if name in (n, tag(n))), None)
    if plain is None:
        raise CutcalError(f"there is no document {name!r}{suggest(name, known)}")
    own = _read(plain)
    if f":{COMMON}:" in json.dumps(own):
        own["$defs"] = own.get("$defs", {}) | {COMMON: _read(COMMON)}
    return own


def _read(name: str) -> dict[str, Any]:
    return dict(json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8")))
