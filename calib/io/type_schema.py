"""JSON Schema (draft 2020-12) of a document, made from the type of its result (:mod:`calib.io.typed_document`).

A field's type is the kind of its value. ``Annotated`` adds what a type cannot say: :func:`keywords` of JSON Schema, a
:class:`Shared` part of ``common.json``, or that the value is always known today. Descriptions are those of the
``Attributes`` in the class's docstring; that of a property is its docstring.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import Field, dataclass, fields, is_dataclass
from functools import reduce
from operator import or_
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from calib.io.schema import COMMON, VERSION, shared_part, tag
from calib.io.typed_document import document_key, left_out


@dataclass(frozen=True)
class Shared:
    """The part of ``common.json`` that describes a value."""

    name: str


@dataclass(frozen=True)
class Keywords:
    """Keywords of JSON Schema that a value has beside those of its type."""

    items: tuple[tuple[str, Any], ...]


def keywords(**items: Any) -> Keywords:
    """Keywords of JSON Schema, such as ``minimum=0``; None takes away what the type would say."""
    return Keywords(tuple(items.items()))


def one_of(*values: Any) -> Keywords:
    """Keyword of a field that has one of these values."""
    return keywords(enum=values)


ALWAYS = "always known"
"""Said of a field that is None in older documents alone."""
Positive = Annotated[float, keywords(exclusiveMinimum=0)]
NotNegative = Annotated[float, keywords(minimum=0)]
Fraction = Annotated[float, keywords(minimum=0, maximum=1)]
Count = Annotated[int, keywords(minimum=0)]
NumberOrNull = Annotated[float, keywords(type=("number", "null"))]
"""A number that is NaN in Python, and null in the document, where there is none."""


def document_schema(kind: Any) -> dict[str, Any]:
    """JSON Schema of the documents of a type.

    Args:
        kind: A dataclass with a ``DOCUMENT``. The first line of its docstring is the title, its second paragraph the
            description.

    Returns:
        The schema, without the shared parts to which it refers.
    """
    title, description = (inspect.getdoc(kind) or "").split("\n\n")[:2]
    whole = _object(kind)
    properties = {
        "schema": {"description": "Which schema the document has, and its version", "const": tag(kind.DOCUMENT)}
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:cutcal:schema:{kind.DOCUMENT}:{VERSION}",
        "title": title.rstrip("."),
        "description": " ".join(description.replace("``", "").split()),
        **whole,
        "properties": properties | whole["properties"],
        "required": ["schema", *whole["required"]],
    }


def _object(kind: Any) -> dict[str, Any]:
    """Schema of a dataclass, without a description."""
    properties, required = _properties(kind)
    others = [f for f in fields(kind) if f.metadata.get("flat") and get_origin(get_type_hints(kind)[f.name]) is Mapping]
    other: Any = False
    if others:
        (_, each) = get_args(get_type_hints(kind, include_extras=True)[others[0].name])
        other = {"description": attributes_of(kind)[others[0].name]} | _item(each)
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": other}


def _properties(kind: Any) -> tuple[dict[str, Any], list[str]]:
    """Schemas of the keys of a dataclass, and those that are always there."""
    hints, texts = get_type_hints(kind, include_extras=True), attributes_of(kind)
    known = {f.name: f for f in fields(kind)}
    properties: dict[str, Any] = {}
    required: list[str] = []
    for name in getattr(kind, "KEYS", tuple(known)):
        field = known.get(name)
        if field is None:
            own = getattr(kind, name)
            properties[name] = _key(None, get_type_hints(own.fget, include_extras=True)["return"], _first(own))
            required.append(name)
        elif field.metadata.get("flat"):
            inner, needed = _flat_properties(hints[name])
            properties |= inner
            required += needed
        elif not field.metadata.get("former"):
            properties[document_key(field)] = _key(field, hints[name], texts[name])
            required += [] if left_out(field) else [document_key(field)]
    return properties, required


def _flat_properties(hint: Any) -> tuple[dict[str, Any], list[str]]:
    """Schemas of the keys of a field that stand beside the others, and those that are always there."""
    kind, nullable, _ = _unwrapped(hint)
    if not is_dataclass(kind):
        return {}, []  # a mapping: its keys may have any name
    properties, required = _properties(kind)
    return properties, [] if nullable else required


def _key(field: Field[Any] | None, hint: Any, text: str) -> dict[str, Any]:
    """Schema of one key."""
    kind, nullable, said = _unwrapped(hint)
    nullable = nullable and ALWAYS not in said and not (field is not None and left_out(field))
    shared = next((one.name for one in said if isinstance(one, Shared)), None)
    part = {} if shared is None else shared_part(shared)
    if nullable and (is_dataclass(kind) or (shared is not None and "null" not in part.get("type", ()))):
        return {"description": text, "anyOf": [_value(kind, said, False), {"type": "null"}]}
    if shared is not None:
        said_twice = part.get("description") == text
        return ({} if said_twice else {"description": text}) | _value(kind, said, False)
    return _value(kind, said, nullable) | {"description": text}


def _item(hint: Any) -> dict[str, Any]:
    """Schema of an item of a list or a mapping."""
    kind, nullable, said = _unwrapped(hint)
    return _value(kind, said, nullable and ALWAYS not in said)


def _value(kind: Any, said: tuple[Any, ...], nullable: bool) -> dict[str, Any]:
    """Schema of a kind of value, with what was said of it."""
    shared = next((one.name for one in said if isinstance(one, Shared)), None)
    if shared is not None:
        return {"$ref": f"urn:cutcal:schema:{COMMON}:{VERSION}#/$defs/{shared}"}
    own = {name: value for one in said if isinstance(one, Keywords) for name, value in one.items}
    own = {name: list(value) if isinstance(value, tuple) else value for name, value in own.items()}
    whole = own if {"enum", "const"} & set(own) else _plain(kind, nullable) | own
    return {name: value for name, value in whole.items() if value is not None}


def _plain(kind: Any, nullable: bool) -> dict[str, Any]:
    """Schema of a kind of value."""
    container, inner = get_origin(kind), get_args(kind)
    if container in (Union, UnionType):
        parts = [_plain(one, False) for one in inner]
        if any(is_dataclass(one) for one in inner):
            return {"anyOf": parts}
        return {"type": [part["type"] for part in parts] + (["null"] if nullable else [])}
    if is_dataclass(kind):
        return {"description": _first(kind), **_object(kind)}
    if container is Mapping:
        return {"type": "object"} | ({} if inner[1] is Any else {"additionalProperties": _item(inner[1])})
    if container is tuple and inner[-1] is ...:
        return {"type": "array", "items": _item(inner[0])}
    if container is tuple:
        size = {"minItems": len(inner), "maxItems": len(inner)}
        return {"type": "array", "prefixItems": [_item(one) for one in inner], **size}
    name = {float: "number", int: "integer", bool: "boolean", str: "string"}[kind]
    return {"type": [name, "null"] if nullable else name}


def _unwrapped(hint: Any) -> tuple[Any, bool, tuple[Any, ...]]:
    """A type without ``Annotated`` and None, whether it may be None, and what was said of it."""
    nullable, said = False, []
    while True:
        if get_origin(hint) is Annotated:
            said += hint.__metadata__
            hint = hint.__origin__
        elif get_origin(hint) in (Union, UnionType):
            kinds = [one for one in get_args(hint) if one is not NoneType]
            nullable = nullable or NoneType in get_args(hint)
            hint = reduce(or_, kinds)
            if len(kinds) > 1:
                return hint, nullable, tuple(said)
        else:
            return hint, nullable, tuple(said)


def _first(documented: Any) -> str:
    """First paragraph of a docstring, without its full stop."""
    return " ".join((inspect.getdoc(documented) or "").split("\n\n")[0].split()).rstrip(".")


def attributes_of(kind: Any) -> dict[str, str]:
    """What the docstring of a class says of its attributes, each without its full stop."""
    _, _, listed = (inspect.getdoc(kind) or "").partition("Attributes:\n")
    entries = re.findall(r"^ {4}(\w+): (.*(?:\n {8,}.*)*)", listed, flags=re.MULTILINE)
    return {name: " ".join(text.split()).rstrip(".") for name, text in entries}
