"""Validators shared by the loaders of YAML files: each error says file, place in it, and what to write.

YAML numbers are decimal as in YAML 1.2 (``3e5`` is a number, ``1:30`` text), and a key given twice is an error; PyYAML
alone reads ``3e5`` as text and ``1:30`` as 90, and keeps the last of two keys without a word. What makes a small file
large, merge keys and aliases of lists and mappings, is refused.
"""

from __future__ import annotations

import copy
import difflib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from calib.errors import MaterialError
from calib.io.wording import brief, quoted
from mpm.files import read_regular
from mpm.scene.errors import CutcalError

PACKAGE = Path(__file__).resolve().parents[1]
"""Folder of the package ``calib``; an installed one has the data in it, a checkout beside it."""

MULTIPLES: dict[str, dict[str, float]] = {
    "Pa": {"kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/m^2": 1.0, "N/mm^2": 1e6},
    "m": {"mm": 1e-3, "cm": 1e-2, "um": 1e-6},
    "kg/m^3": {"kg/m3": 1.0, "g/cm^3": 1e3, "g/cm3": 1e3},
    "J/m^2": {"J/m2": 1.0, "kJ/m^2": 1e3, "N/m": 1.0, "N/mm": 1e3, "kN/m": 1e3},
    "N/m": {"J/m^2": 1.0, "J/m2": 1.0, "kJ/m^2": 1e3, "N/mm": 1e3, "kN/m": 1e3},
    "-": {"": 1.0, "1": 1.0, "%": 1e-2},
    "deg": {"rad": 180.0 / math.pi, "degree": 1.0, "degrees": 1.0},
}
"""Units that a value may have been meant in, by SI unit, and what one of them is in the SI unit."""

_FLOAT_TAG, _INT_TAG, _MERGE_TAG = (f"tag:yaml.org,2002:{name}" for name in ("float", "int", "merge"))
_EXPONENT = re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$")
_FLOAT = re.compile(
    r"^(?:[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$"
)
_INT = re.compile(r"^[-+]?[0-9]{1,30}$")
_FLOAT_START = list("-+.0123456789")
# What PyYAML lets through from Python where a date, a number or a tagged value is none: 2024-13-01 or "!!int x".
_UNCONSTRUCTED = (ValueError, KeyError, IndexError, AttributeError, TypeError, OverflowError)
MOST_BYTES = 1_000_000
"""Bytes of a YAML file from which on it is no list of foods: the largest that comes with cutcal has a tenth of that."""
KEPT_FILES = 8
"""Contents of YAML files that a process parses once."""
LONGEST_KEY = 60
"""Letters of a key from which on it is the name of nothing."""


class _Loader(yaml.SafeLoader):
    """SafeLoader of decimal numbers that refuses a key given twice, and what unpacks to more than is there."""

    yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in known if tag not in (_FLOAT_TAG, _INT_TAG)]
        for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """The next node; an alias of a list or mapping is refused."""
        event = self.peek_event()
        node = super().compose_node(parent, index)
        if isinstance(event, yaml.AliasEvent) and not isinstance(node, yaml.ScalarNode):
            raise yaml.composer.ComposerError(
                None,
                None,
                f"*{event.anchor} stands for a list or mapping; write it out",
                event.start_mark,  # type: ignore[arg-type]
            )
        return node

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Refuse a merge key."""
        for key, _ in node.value:
            if key.tag == _MERGE_TAG:
                raise yaml.constructor.ConstructorError(
                    None, None, "<< takes keys from elsewhere; write them out", key.start_mark
                )

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """A whole number, in decimal."""
        if not _INT.match(node.value):
            raise yaml.constructor.ConstructorError(
                None, None, f"{quoted(node.value)} is no whole number in decimal", node.start_mark
            )
        return int(node.value)

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float:
        """A number."""
        if not (_FLOAT.match(node.value) or _INT.match(node.value)):
            raise yaml.constructor.ConstructorError(
                None, None, f"{quoted(node.value)} is no number such as 3.0e5", node.start_mark
            )
        return float(re.sub(r"\.(?=[in])", "", node.value.lower()))

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"the key {key.value!r} is given twice; keep one of them", key.start_mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


class Dumper(yaml.SafeDumper):
    """SafeDumper that quotes whatever the loader would take for a number, so that text comes back as text."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write equal objects out in full: anchors are hard to read."""
        return True


_Loader.add_implicit_resolver(_FLOAT_TAG, _FLOAT, _FLOAT_START)
_Loader.add_implicit_resolver(_INT_TAG, _INT, list("-+0123456789"))
_Loader.add_constructor(_INT_TAG, _Loader.construct_yaml_int)
_Loader.add_constructor(_FLOAT_TAG, _Loader.construct_yaml_float)
Dumper.add_implicit_resolver(_FLOAT_TAG, _EXPONENT, _FLOAT_START)


def data_path(name: str) -> Path:
    """Path of a file or folder shipped with cutcal: in the installed package or at the top of the checkout.

    Args:
        name: For instance ``materials.yaml`` or ``force_data``.

    Raises:
        MaterialError: It is in neither place, so the installation is incomplete.
    """
    places = (PACKAGE / "data" / name, PACKAGE.parent / name)
    for place in places:
        if place.exists():
            return place
    looked = " and ".join(str(place) for place in places)
    raise MaterialError(f"{name}: not part of this installation (looked for {looked}); reinstall cutcal")


def suggest(word: str, known: Iterable[str], synonyms: Mapping[str, str] | None = None) -> str:
    """End of an error message for an unknown word: the nearest known word, or all of them.

    Args:
        word: What was written.
        known: What may be written.
        synonyms: Lower-case everyday names of known words, for instance ``density`` of ``rho``.

    Returns:
        The end of the message, from its comma or semicolon on.
    """
    names = list(known)
    plain = {n.casefold(): n for n in names} | {k: v for k, v in (synonyms or {}).items() if v in names}
    near = difflib.get_close_matches(word.strip().casefold(), plain, n=1, cutoff=0.65)
    return f", did you mean {plain[near[0]]!r}?" if near else f"; known: {', '.join(names)}"


@dataclass(frozen=True)
class Place:
    """A place in a file, as it is named in errors: ``materials.yaml: banana.properties.E``.

    Attributes:
        file: Name of the file, empty for a value that comes from no file.
        path: Keys from the top of the file to here.
        kind: Exception class of :meth:`error`.
    """

    file: str
    path: tuple[str, ...] = ()
    kind: type[CutcalError] = MaterialError

    def at(self, key: str) -> Place:
        """The place one key deeper."""
        return replace(self, path=(*self.path, key))

    def error(self, message: str) -> CutcalError:
        """An error at this place."""
        return self.kind(": ".join(part for part in (self.file, ".".join(self.path), message) if part))

    def wrap(self, error: CutcalError) -> CutcalError:
        """The error of something read here, whose message starts with keys below this place."""
        return self.kind(f"{self.file}: {'.'.join((*self.path, str(error)))}")


@lru_cache(maxsize=KEPT_FILES)
def _parsed(content: bytes) -> Any:
    """What a file of this content says. A file of all foods takes a fifth of a second, and is asked for often."""
    return yaml.load(content.decode("utf-8"), Loader=_Loader)


def read_yaml(path: Path | str, *, kind: type[CutcalError] = MaterialError) -> tuple[Place, dict[str, Any]]:
    """Read a YAML file whose top level is a mapping.

    Returns:
        The place of the top level, for errors about its content, and the content.

    Raises:
        CutcalError: Of class ``kind``: no such file, not text, a syntax error, a key given twice, no mapping.
    """
    path = Path(path)
    top = Place(path.name, (), kind)
    try:
        content = copy.deepcopy(_parsed(read_regular(path, MOST_BYTES)))
    except FileNotFoundError:
        raise kind(f"{path}: no such file; check the path") from None
    except OSError as e:
        raise kind(f"{path}: cannot be read ({e.strerror}); give a readable YAML file") from None
    except UnicodeDecodeError as e:
        raise top.error(f"byte {e.start} is not UTF-8 text; save the file as UTF-8") from None
    except yaml.MarkedYAMLError as e:
        mark = e.problem_mark or e.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise top.error(f"{where}{brief(e.problem or e.context, 200)}") from None
    except yaml.YAMLError as e:
        raise top.error(f"not YAML: {' '.join(str(e).split())}") from None
    except RecursionError:
        raise top.error("is nested too deeply; three levels are needed") from None
    except _UNCONSTRUCTED as e:
        raise top.error(f"holds a value that YAML does not have ({brief(str(e))}); put it in quotes") from None
    return top, mapping(top, content)


def mapping(place: Place, value: Any) -> dict[str, Any]:
    """The value as a mapping with text keys.

    Raises:
        CutcalError: It is something else, or a key is not text (YAML reads ``no`` as false).
    """
    if value is None:
        raise place.error("is empty; a mapping of names to values is needed here")
    if not isinstance(value, dict):
        raise place.error(f"is {_kind(value)}, but a mapping of names to values is needed here")
    for key in value:
        if not isinstance(key, str):
            raise place.error(f"the key {brief(key)} is {_kind(key)}, not text; put it in quotes")
        if not key.isprintable() or len(key) > LONGEST_KEY:
            raise place.error(f"the key {quoted(key)} is no name: use one line of at most {LONGEST_KEY} letters")
    return value


def check_keys(
    place: Place,
    given: Mapping[str, Any],
    required: Iterable[str],
    optional: Iterable[str] = (),
    synonyms: Mapping[str, str] | None = None,
) -> None:
    """Check that a mapping has the required keys and no unknown one.

    Args:
        place: Where the mapping is, for errors.
        given: The mapping.
        required: Keys that it must have.
        optional: Keys that it may have; required ones may be among them.
        synonyms: As in :func:`suggest`.

    Raises:
        CutcalError: An unknown key (with the nearest known one) or the missing keys.
    """
    required = list(required)
    known = list(dict.fromkeys([*required, *optional]))
    for key in given:
        if key not in known:
            raise place.at(str(key)).error(f"unknown key{suggest(str(key), known, synonyms)}")
    missing = [key for key in required if key not in given]
    if missing:
        raise place.error(f"misses {', '.join(missing)}; add {'it' if len(missing) == 1 else 'them'}")


def finite_number(place: Place, value: Any) -> float:
    """The value as a finite number.

    Raises:
        CutcalError: It is text, true or false, empty, a list, infinite or not a number.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        shown = f" {quoted(value)}" if isinstance(value, (str, bool)) else ""
        raise place.error(f"is {_kind(value)}{shown}, but a plain number such as 3.0e5 is needed here")
    try:
        plain = float(value)
    except OverflowError:
        plain = math.inf
    if not math.isfinite(plain):
        raise place.error(f"is {brief(value)}; a finite number is needed here")
    return plain


def text(place: Place, value: Any) -> str:
    """The value as text that is not empty.

    Raises:
        CutcalError: It is empty or not text.
    """
    if not isinstance(value, str) or not value.strip():
        raise place.error(f"is {_kind(value)}, but text is needed here; put it in quotes")
    return value


def choice(place: Place, value: Any, options: Iterable[str]) -> str:
    """The value as one of the options.

    Args:
        place: Where the value is, for errors.
        value: What YAML has there.
        options: What may be there.

    Returns:
        The value, as text.

    Raises:
        CutcalError: It is none of them.
    """
    options = list(options)
    if value not in options:
        hint = suggest(value, options) if isinstance(value, str) else f"; known: {', '.join(options)}"
        raise place.error(f"unknown value {quoted(value)}{hint}")
    return str(value)


def check_unit(place: Place, unit: Any, expected: str, value: float) -> None:
    """Check that a value is in the expected unit, which is never converted behind the reader's back.

    Args:
        place: Where the value is, for errors.
        unit: What YAML has as its unit.
        expected: The SI unit that it must be.
        value: The value, in the unit that was written.

    Raises:
        CutcalError: Another unit; where it is a known multiple, with the converted value to write.
    """
    if unit == expected:
        return
    known = MULTIPLES.get(expected, {})
    factor = known.get(str(unit)) if isinstance(unit, (str, int)) else None
    if factor is None:
        raise place.error(f"has unit {quoted(unit)}, but its unit is {expected!r}")
    si = f"value: {value * factor:.6g}, unit: {expected!r}"
    raise place.error(f"has unit {unit!r}; write it in {expected!r}: {si}")


def _kind(value: Any) -> str:
    """What a YAML value is, for an error message."""
    if value is None or value == "":
        return "empty"
    names = {bool: "true/false", int: "a number", float: "a number", str: "text", list: "a list"}
    return names.get(type(value), f"a {type(value).__name__}")
