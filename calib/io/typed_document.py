"""Results as frozen dataclasses, and the JSON documents that they are written to and read back from.

The fields of a result have the names of the document's keys, units included. Two rules say what a missing number is:

* A field whose default is None stands for a key that may be missing: while it is None the key is left out. With the
  metadata :data:`NULL` it is missing in older documents alone: today it is written as null.
* NaN and infinity are written as null, because JSON has no word for them. A null is read back as None where the type
  allows None and the key may not be missing, else as NaN.

A class may say more about its document in two class variables:

* ``DOCUMENT`` is the name of the document. It becomes the first key, ``schema``.
* ``KEYS`` lists the keys in their order, where these are not just the fields: properties may be among them.

A field with the metadata :data:`FLAT` is a mapping or another dataclass. Its keys stand beside those of the result;
where it may be None, they may all be missing. :func:`renamed` gives a field another name in the document; a field with
the metadata :data:`ANY` may be of any kind in older documents. The JSON Schema of a document is made from the same type
(:mod:`calib.io.type_schema`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from calib.errors import DocumentError
from calib.io.schema import tag
from mpm.scene.errors import CutcalError

FLAT: Mapping[str, Any] = {"flat": True}
"""Metadata of a field whose keys stand beside those of the result that has it."""
NULL: Mapping[str, Any] = {"null": True}
"""Metadata of a field whose default is None and which is written all the same, as null."""
ANY: Mapping[str, Any] = {"any": True}
"""Metadata of a field that may be of any kind in older documents."""
REMEDY = "run the same command again"

Result = TypeVar("Result")
FORMER: Mapping[str, Any] = {"former": True}
"""Metadata of a field whose default is None and that only documents of other versions have: it is read, not written."""


def renamed(name: str) -> Mapping[str, Any]:
    """Metadata of a field with another name in the document."""
    return {"key": name}


def document_key(field: Field[Any]) -> str:
    """Name of a field in the document."""
    return str(field.metadata.get("key", field.name))


def left_out(field: Field[Any]) -> bool:
    """Whether the key of a field is left out while it is None."""
    return field.default is None and not field.metadata.get("null")


def to_document(result: Any) -> dict[str, Any]:
    """The document of a result, as plain data.

    Args:
        result: A dataclass as the module says.

    Returns:
        Its keys in the order of the document; tuples have become lists.
    """
    kind = type(result)
    out: dict[str, Any] = {"schema": tag(kind.DOCUMENT)} if hasattr(kind, "DOCUMENT") else {}
    known = {f.name: f for f in fields(result)}
    for key in getattr(kind, "KEYS", tuple(known)):
        value = getattr(result, key)
        if key in known and (known[key].metadata.get("former") or (value is None and left_out(known[key]))):
            continue
        if key in known and known[key].metadata.get("flat"):
            out |= _plain(value)
        else:
            out[document_key(known[key]) if key in known else key] = _plain(value)
    return out


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return to_document(value)
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value


def read_document(path: Path, kind: type[Result]) -> Result:
    """Read the document of a result.

    Args:
        path: The JSON file.
        kind: The class of the result.

    Returns:
        The result.

    Raises:
        DocumentError: The file is missing, is no JSON, or holds something else than such a result.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as e:
        what = "no such file" if isinstance(e, FileNotFoundError) else f"cannot be read ({e.strerror})"
        raise DocumentError(f"{path}: {what}; {REMEDY}") from None
    except ValueError as e:
        raise DocumentError(f"{path}: damaged, not JSON ({e}); {REMEDY}") from None
    try:
        return from_document(kind, content)
    except DocumentError as e:
        raise DocumentError(f"{path}: {e}; the file is incomplete or of another version of cutcal: {REMEDY}") from None


def from_document(kind: type[Result], content: Any, place: str = "") -> Result:
    """The result that a document is of. Keys that are no field are not looked at: they follow from the others.

    Args:
        kind: The class of the result.
        content: The document, as plain data.
        place: Where in the file it stands, for the message of an error.

    Returns:
        The result.

    Raises:
        DocumentError: A key is missing, or something has another type; the message begins with its place.
    """
    if not isinstance(content, dict):
        raise DocumentError(f"{place or 'the top level'} is not a mapping of names to values")
    own: Any = kind
    hints, values = _hints(own), {}
    for one in fields(own):
        if one.metadata.get("flat"):
            values[one.name] = _flat(hints[one.name], content, place, _keys(own))
        elif document_key(one) in content:
            values[one.name] = _field(one, hints[one.name], content[document_key(one)], _at(place, document_key(one)))
        elif one.default is MISSING and one.default_factory is MISSING:
            raise DocumentError(f"{_at(place, document_key(one))} is missing")
    try:
        return kind(**values)
    except CutcalError as e:  # a class that checks its values
        raise DocumentError(f"{place or 'the top level'}: {e}") from None


def _at(place: str, name: str | int) -> str:
    if isinstance(name, int):
        return f"{place}[{name}]"
    return f"{place}.{name}" if place else name


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


@cache
def _keys(kind: Any) -> frozenset[str]:
    """Keys of a document that are not of a flat mapping in it."""
    own = {"schema", *getattr(kind, "KEYS", ()), *map(document_key, fields(kind))}
    for one in fields(kind):
        if one.metadata.get("flat"):
            hint: Any = _hints(kind)[one.name]
            inner: list[Any] = [part for part in (hint, *get_args(hint)) if is_dataclass(part)]
            own |= {key for part in inner for key in _keys(part)}
    return frozenset(own)


def _flat(hint: Any, content: dict[str, Any], place: str, known: frozenset[str]) -> Any:
    """The part of a document whose keys stand beside the others; None where it may be missing and has no key."""
    kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    kind = next((one for one in kinds if isinstance(one, type) and is_dataclass(one)), None)
    if kind is not None:
        absent = NoneType in kinds and not any(document_key(f) in content for f in fields(kind))
        return None if absent else from_document(kind, content, place)
    each = get_args(hint)[1]
    return {name: _typed(each, value, _at(place, name)) for name, value in content.items() if name not in known}


def _field(of: Field[Any], hint: Any, value: Any, place: str) -> Any:
    """The value of a field."""
    if of.metadata.get("any"):
        return value
    if value is None and left_out(of) and not of.metadata.get("former") and float in get_args(hint):
        return math.nan
    return _typed(hint, value, place)


def _typed(hint: Any, value: Any, place: str) -> Any:
    """A value of the type that a hint says."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _optional(inner, value, place)
    if hint is Any:
        return value
    if isinstance(hint, type) and is_dataclass(hint):
        return from_document(hint, value, place)
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            raise DocumentError(f"{place} is not a mapping of names to values")
        return {name: _typed(inner[1], part, _at(place, name)) for name, part in value.items()}
    if origin is not None and issubclass(origin, Sequence):
        return _list(inner, value, place)
    return _scalar(hint, value, place)


def _list(kinds: tuple[Any, ...], value: Any, place: str) -> tuple[Any, ...]:
    """A list whose items are all of one type, or as many as there are types."""
    if not isinstance(value, list):
        raise DocumentError(f"{place} is not a list")
    each = [kinds[0]] * len(value) if len(kinds) == 1 or kinds[-1] is ... else list(kinds)
    if len(each) != len(value):
        raise DocumentError(f"{place} is not a list of {len(each)}")
    return tuple(_typed(one, part, _at(place, k)) for k, (one, part) in enumerate(zip(each, value, strict=True)))


def _optional(kinds: tuple[Any, ...], value: Any, place: str) -> Any:
    """A value that may be one of several types; the first that fits."""
    if value is None and NoneType in kinds:
        return None
    wrong: list[DocumentError] = []
    for one in kinds:
        try:
            return _typed(one, value, place)
        except DocumentError as e:
            wrong.append(e)
    raise wrong[0]


def _scalar(hint: Any, value: Any, place: str) -> Any:
    """A number, text or truth value; a truth value is no number."""
    if hint is float and value is None:
        return math.nan
    allowed = (int, float) if hint is float else hint
    if not isinstance(value, allowed) or (isinstance(value, bool) and hint is not bool):
        raise DocumentError(f"{place} is {json.dumps(value)[:60]}, which it cannot be")
    return value
