"""The published schema of a study is that of the type whose document it describes."""

from __future__ import annotations

import json
from typing import Any

from calib.io.schema import FOLDER
from calib.io.type_schema import document_schema
from calib.multi_specimen.result import StudyResult

LOCAL = "#/$defs/"


def whole(schema: Any, parts: dict[str, Any]) -> Any:
    """The schema with its own parts where they are referred to, and the keys that are required in alphabetical order."""
    if isinstance(schema, dict):
        if schema.get("$ref", "").startswith(LOCAL):
            return whole(parts[schema["$ref"].removeprefix(LOCAL)], parts)
        return {k: sorted(v) if k == "required" else whole(v, parts) for k, v in schema.items() if k != "$defs"}
    return [whole(part, parts) for part in schema] if isinstance(schema, list) else schema


def test_the_published_schema_of_a_study_is_that_of_its_type() -> None:
    """Keys, kinds, limits, words and descriptions: where one of both changes, this says so."""
    published = json.loads((FOLDER / "study.json").read_text(encoding="utf-8"))
    assert whole(document_schema(StudyResult), {}) == whole(published, published["$defs"])
