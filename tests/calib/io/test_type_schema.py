"""The published schemas are those of the types whose documents they describe."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_type_hints

import pytest

from calib.calibration.credibility import Credibility
from calib.calibration.result import CalibrationResult, from_document, to_document
from calib.calibration.result_parts import FixedParameter
from calib.compression.result import CompressionResult
from calib.design.result import DesignResult
from calib.errors import DocumentError
from calib.io import typed_document
from calib.io.folder import finite
from calib.io.schema import FOLDER, shared_part, tag
from calib.io.type_schema import ALWAYS, Positive, Shared, document_schema, keywords, one_of
from calib.io.typed_document import ANY, FORMER, NULL, document_key, left_out, renamed
from calib.relaxation.relaxation_result import RelaxationResult
from calib.scalars.result import ScalarFitResult
from calib.texture.texture_result import TextureResult
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.validation.acceptance import Verdict
from calib.validation.metrics import IsoRating, Metrics, Russell, SpragueGeers
from calib.validation.numerical_checks import Check
from calib.validation.prediction import PredictionResult
from mpm.scene import Knife
from mpm.scene.shapes import Shape
from studies.regression.result import RegressionResult
from studies.speed.result import BenchmarkResult
from studies.stability.result import StabilityMap
from studies.verification.result import Verification
from tests.calib.documents import valid
from tests.reports import sample

RESULTS = {
    "calibrate": CalibrationResult, "predict": PredictionResult, "compress": CompressionResult,
    "scalars": ScalarFitResult, "verify": Verification, "stress": StabilityMap, "regress": RegressionResult,
    "bench": BenchmarkResult, "design": DesignResult,
    "credibility": Credibility, "relax": RelaxationResult, "tpa": TextureResult,
}  # fmt: skip
BEYOND_TYPES = ("if", "then")
"""What no type says: which keys a benchmark has when it is complete."""
SHARED = {
    "metrics": Metrics, "spragueGeers": SpragueGeers, "russell": Russell, "iso18571": IsoRating, "verdict": Verdict,
    "parameter": FittedParameter, "nuisance": FittedNuisance, "value": FixedParameter, "check": Check, "shape": Shape,
    "knife": Knife,
}  # fmt: skip
OF_STUDIES = {"shared"}
"""Keys of a shared part that a calibration on one trace does not have."""


def ordered(schema: Any) -> Any:
    """The same with the keys that are required in the order of the alphabet."""
    if isinstance(schema, dict):
        return {k: sorted(v) if k == "required" else ordered(v) for k, v in schema.items()}
    return [ordered(part) for part in schema] if isinstance(schema, list) else schema


def inlined(part: Any, local: dict[str, Any]) -> Any:
    """The same with each reference to a part of its own in place."""
    if isinstance(part, list):
        return [inlined(inner, local) for inner in part]
    if not isinstance(part, dict):
        return part
    own = local.get(part.get("$ref", "").removeprefix("#/$defs/"), {})
    rest = {key: inner for key, inner in part.items() if key != "$defs" and not (own and key == "$ref")}
    return {key: inlined(inner, local) for key, inner in (own | rest).items()}


@pytest.mark.parametrize("name", RESULTS)
def test_the_published_schema_is_made_from_the_type(name: str) -> None:
    """Keys, kinds, limits, words and descriptions: where one of both changes, this says so."""
    published = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    whole = {k: part for k, part in inlined(published, published.get("$defs", {})).items() if k not in BEYOND_TYPES}
    assert ordered(document_schema(RESULTS[name])) == ordered(whole)


@pytest.mark.parametrize("name", SHARED)
def test_shared_parts_have_the_keys_of_their_types(name: str) -> None:
    """A part of ``common.json`` has each key that its type writes, and demands none that the type leaves out."""
    kind, part = SHARED[name], shared_part(name)
    parts = [part, *(shared_part("interval") for _ in part.get("allOf", []))]
    described = {key for one in parts for key in one["properties"]} - OF_STUDIES
    written = [f for f in fields(kind) if not f.metadata.get("former")]
    assert {document_key(f) for f in written} == described
    needed = {key for one in parts for key in one["required"]}
    assert needed <= {document_key(f) for f in written if not left_out(f)}


@pytest.mark.parametrize("kind", ["good", "reconstructed", "failed", "interrupted"])
def test_a_calibration_comes_back_from_its_document(kind: str) -> None:
    """Written again it is the same document, key by key and in the same order, and a valid one."""
    older = sample.summary(kind)
    result = from_document(older, Path("runs"))
    document = finite(to_document(result))
    assert {key: document[key] for key in older if key not in ("verdicts", "shape")} == {
        key: part for key, part in older.items() if key not in ("verdicts", "shape")
    }
    again = from_document(json.loads(json.dumps(document)), Path("runs"))
    assert json.dumps(finite(to_document(again))) == json.dumps(document)
    assert result.folder == Path("runs") and result.summary == document and result.passed is older["passed"]
    assert list(result.parameters.index) == list(older["parameters"])
    today = document | {"search": "converged", "fine_simulations": 52, "scene": {}, "device": "cpu"}
    for line in today["verdicts"]:
        line["unit"] = line["unit"].replace("-", "")
    for p in today["parameters"].values():
        p["verdict"] = p["verdict"].replace("not_determined", "unknown")
    valid(today)


@dataclass(frozen=True, kw_only=True)
class Sized:
    """A thing with a size.

    What it is for.

    Attributes:
        name: What it is called
            by people.
        size_m: How large it is [m].
        since: When it was measured; null where nobody knows.
        colour: Of its skin.
        weight_N: What it weighs [N]; missing where it was not weighed.
        note: In words.
    """

    DOCUMENT: ClassVar[str] = "stress"

    name: str
    size_m: Annotated[Positive | None, ALWAYS]
    since: str | None = field(default=None, metadata=NULL)
    colour: Annotated[str, one_of("red", "green")] = field(metadata=ANY)
    weight_N: float | None = None
    note: Annotated[str, keywords(maxLength=9)] = field(metadata=renamed("words"))
    before: str | None = field(default=None, metadata=FORMER)


def test_a_schema_says_what_the_type_says() -> None:
    """Descriptions over several lines, null where the type allows it today, limits, words and other names of keys."""
    own = document_schema(Sized)
    assert (own["title"], own["description"]) == ("A thing with a size", "What it is for.")
    assert own["properties"] == {
        "schema": {"description": "Which schema the document has, and its version", "const": tag("stress")},
        "name": {"description": "What it is called by people", "type": "string"},
        "size_m": {"description": "How large it is [m]", "type": "number", "exclusiveMinimum": 0},
        "since": {"description": "When it was measured; null where nobody knows", "type": ["string", "null"]},
        "colour": {"description": "Of its skin", "enum": ["red", "green"]},
        "weight_N": {"description": "What it weighs [N]; missing where it was not weighed", "type": "number"},
        "words": {"description": "In words", "type": "string", "maxLength": 9},
    }
    assert own["required"] == ["schema", "name", "size_m", "since", "colour", "words"]


def test_fields_are_read_as_they_are_described() -> None:
    """Null where a key may be null, nothing where it may be missing; another name; any kind; what is only read."""
    content = {"name": "a", "size_m": 1.5, "since": None, "colour": "red", "words": "b"}
    own = typed_document.from_document(Sized, content)
    assert own == Sized(name="a", size_m=1.5, colour="red", note="b")
    assert typed_document.to_document(own) == {"schema": tag("stress")} | content
    older = {"name": "a", "size_m": None, "colour": ["red", 3], "words": "b", "before": "c"}
    read = typed_document.from_document(Sized, older)
    assert (read.size_m, read.since, read.weight_N, read.before) == (None, None, None, "c")
    assert read.colour == ["red", 3] and "before" not in typed_document.to_document(read)
    with pytest.raises(DocumentError, match="^words is missing"):
        typed_document.from_document(Sized, {"name": "a", "size_m": 1.0, "colour": "red", "note": "b"})


def test_a_pair_has_two_items() -> None:
    """A list of another length, or of other kinds, is no pair."""
    history = sample.summary() | {"misfit_history": [[1, 2.5], [3, 2.0]]}
    assert from_document(history, Path()).history.misfit_history == ((1, 2.5), (3, 2.0))
    for wrong, said in (
        ([1, 2.5, 3.0], r"misfit_history\[0\] is not a list of 2"),
        ([1.5, 2.5], r"misfit_history\[0\]\[0\] is 1.5"),
    ):
        with pytest.raises(DocumentError, match=said):
            from_document(history | {"misfit_history": [wrong]}, Path())


def test_shared_parts_exist() -> None:
    """Every part that a result refers to is one of ``common.json``."""
    for kind in RESULTS.values():
        hints = get_type_hints(kind, include_extras=True).values()
        names = [said.name for hint in hints for said in getattr(hint, "__metadata__", ()) if isinstance(said, Shared)]
        assert names and all(shared_part(name) for name in names)


def test_a_calibration_without_a_number_that_it_needs_is_refused() -> None:
    """A peak, a value or a profile that is null is named; what only older versions did not know is not."""
    for change, place in (
        ({"peak_real_N": None}, "peak_real_N"),
        ({"onset_s": None}, "onset_s"),
        ({"parameters": {"E": sample.summary()["parameters"]["E"] | {"value": None}}}, "parameters.E.value"),
        ({"profiles": {"E": {"value": [1.0, 2.0], "rise": [0.0, None], "trace_alone": [0.0, 1.0]}}}, "profiles.E.rise"),
    ):
        with pytest.raises(DocumentError, match=rf"summary.json: {place} is null"):
            from_document(sample.summary() | change, Path())
    assert from_document(sample.summary() | {"onset_sd_s": None, "wall_s": None}, Path()).wall_s is None
