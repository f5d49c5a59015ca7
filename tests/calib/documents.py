"""Documents against their published schemas, and what a document is that is wrong in one place."""

from __future__ import annotations

import json
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator
from referencing import Registry, Resource

from calib.io.schema import COMMON, FOLDER, schema

SHARED = json.loads((FOLDER / f"{COMMON}.json").read_text(encoding="utf-8"))
KNOWN = Registry().with_resource(SHARED["$id"], Resource.from_contents(SHARED)).crawl()
"""The shared parts, looked up once: a validator that finds them in each schema alone takes ten times as long."""


@cache
def validator(name: str) -> Draft202012Validator:
    """Of the schema as ``cutcal schema`` prints it."""
    return Draft202012Validator(schema(name), registry=KNOWN)


def faults(document: Any, name: str | None = None) -> list[str]:
    """What is wrong with a document of this name, or of the one that it says it has."""
    plain = json.loads(json.dumps(document, allow_nan=False))
    found = validator(name or document["schema"]).iter_errors(plain)
    return [f"{e.json_path}: {e.message[:300]}" for e in found]


def valid(document: Any, name: str | None = None) -> Any:
    """The document, which must fit its schema."""
    assert faults(document, name) == []
    return document


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Way to each part of a document; of a list, and of objects of one kind, to the first one."""
    if path:
        yield path
    inner = list(value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ())
    alike = isinstance(value, list) or all(isinstance(part, dict) for _, part in inner)
    for key, part in inner[: 1 if alike else None]:
        yield from places(part, (*path, key))


def at(document: Any, path: tuple[Any, ...]) -> Any:
    """The part of a document at the end of a way."""
    for key in path:
        document = document[key]
    return document


def changed(document: Any, path: tuple[Any, ...], value: Any = None, *, without: bool = False) -> Any:
    """A copy with another part at the end of a way, or ``without`` one."""
    copy = deepcopy(document)
    if without:
        del at(copy, path[:-1])[path[-1]]
    else:
        at(copy, path[:-1])[path[-1]] = value
    return copy
