"""Results and their documents: what is written comes back, what is missing or of another type is named."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import pytest

from calib.errors import DocumentError
from calib.io.folder import write_json
from calib.io.typed_document import FLAT, from_document, read_document, to_document
from mpm.errors import SceneError


@dataclass(frozen=True)
class Part:
    """A part; its weight may be missing."""

    name: str
    size_m: float
    weight_N: float | None = None

    def __post_init__(self) -> None:
        if self.size_m < 0:
            raise SceneError(f"size_m = {self.size_m:g} is negative")


@dataclass(frozen=True, kw_only=True)
class Whole:
    """A result with parts, values of any name, and a key that follows from the others."""

    DOCUMENT: ClassVar[str] = "stress"
    KEYS: ClassVar[tuple[str, ...]] = ("parts", "count", "values", "best", "limit", "passed", "ends", "of")

    parts: tuple[Part, ...]
    values: Mapping[str, float | str] = field(metadata=FLAT)
    best: Part | None = None
    limit: float | None
    passed: bool
    ends: tuple[float, float]
    of: Mapping[str, int]

    @property
    def count(self) -> int:
        """How many parts there are."""
        return len(self.parts)


WHOLE = Whole(
    parts=(Part("a", 1.0), Part("b", 2.0, 3.0)), values={"E_Pa": 1e5, "what": "x"}, limit=None, passed=True,
    ends=(0.0, 0.4), of={"a": 1},
)  # fmt: skip
DOCUMENT = {
    "schema": "cutcal/stress/1",
    "parts": [{"name": "a", "size_m": 1.0}, {"name": "b", "size_m": 2.0, "weight_N": 3.0}],
    "count": 2, "E_Pa": 1e5, "what": "x", "limit": None, "passed": True, "ends": [0.0, 0.4], "of": {"a": 1},
}  # fmt: skip


def test_a_result_is_its_document_and_comes_back():
    """Keys in their order; one that may be missing is left out, one that follows is written and not read;
    the way back is exact.
    """
    assert to_document(WHOLE) == DOCUMENT and list(to_document(WHOLE)) == list(DOCUMENT)
    assert from_document(Whole, json.loads(json.dumps(DOCUMENT))) == WHOLE
    assert from_document(Whole, DOCUMENT | {"best": {"name": "c", "size_m": 0.0}}).best == Part("c", 0.0)


def test_numbers_that_are_not_finite_are_null_and_come_back(tmp_path):
    """NaN comes back as NaN, where None may stand as None, and where the key may be missing as NaN: it was there."""
    write_json(tmp_path / "x.json", to_document(Part("a", math.nan, math.inf)))
    assert json.loads((tmp_path / "x.json").read_text()) == {"name": "a", "size_m": None, "weight_N": None}
    part = read_document(tmp_path / "x.json", Part)
    assert math.isnan(part.size_m) and part.weight_N is not None and math.isnan(part.weight_N)
    assert from_document(Whole, DOCUMENT | {"limit": 0.5}).limit == 0.5


@dataclass(frozen=True)
class Pair:
    """A name and, beside it, a part that may be missing."""

    DOCUMENT: ClassVar[str] = "verify"

    title: str
    part: Part | None = field(default=None, metadata=FLAT)
    rest: Mapping[str, int] = field(default_factory=dict, metadata=FLAT)


def test_keys_beside_the_others_may_all_be_missing():
    """A part without any of its keys is None; with some of them, what misses is named."""
    whole = {"schema": "cutcal/verify/1", "title": "t", "name": "a", "size_m": 1.0, "x": 3}
    assert from_document(Pair, whole) == Pair("t", Part("a", 1.0), {"x": 3})
    assert to_document(from_document(Pair, whole)) == whole
    assert from_document(Pair, {"title": "t"}) == Pair("t")
    assert to_document(Pair("t")) == {"schema": "cutcal/verify/1", "title": "t"}
    with pytest.raises(DocumentError, match="^size_m is missing"):
        from_document(Pair, {"title": "t", "name": "a"})


def test_whole_numbers_stay_what_they_are():
    """A number that was written without a point is written so again."""
    assert json.dumps(to_document(from_document(Part, {"name": "a", "size_m": 2}))) == '{"name": "a", "size_m": 2}'


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parts": None}, "parts is not a list"),
        ({"parts": [{"name": "a"}]}, "parts[0].size_m is missing"),
        ({"parts": [{"name": 3, "size_m": 1.0}]}, "parts[0].name is 3, which it cannot be"),
        ({"parts": [{"name": "a", "size_m": True}]}, "parts[0].size_m is true"),
        ({"parts": [{"name": "a", "size_m": -1.0}]}, "parts[0]: size_m = -1 is negative"),
        ({"parts": ["a"]}, "parts[0] is not a mapping"),
        ({"passed": 1}, "passed is 1"),
        ({"best": 3}, "best is not a mapping"),
        ({"of": {"a": 1.5}}, "of.a is 1.5"),
        ({"of": []}, "of is not a mapping"),
        ({"E_Pa": [1e5]}, "E_Pa is [100000.0]"),
    ],
)
def test_what_is_missing_or_of_another_type_is_named(change, said, tmp_path):
    """The message begins with the file and the place, and says what to do."""
    path = tmp_path / "stress.json"
    path.write_text(json.dumps(DOCUMENT | change))
    with pytest.raises(DocumentError) as error:
        read_document(path, Whole)
    assert str(error.value).startswith(f"{path}: {said}") and "run the same command again" in str(error.value)


def test_files_that_are_no_documents_are_named(tmp_path):
    """None, no JSON, and a list."""
    path = tmp_path / "x.json"
    for text, said in ((None, "no such file"), ("{", "damaged, not JSON"), ("[]", "the top level is not a mapping")):
        if text is not None:
            path.write_text(text)
        with pytest.raises(DocumentError, match=said):
            read_document(path, Whole)
