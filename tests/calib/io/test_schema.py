"""Every JSON document has a published schema, which is one, explains itself, and refuses what is wrong."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, get_args

import pytest
from jsonschema import Draft202012Validator

from calib.io.folder import write_json
from calib.io.provenance import versions
from calib.io.schema import COMMON, FOLDER, names, schema, tag
from calib.material import properties
from calib.uncertainty import estimates, intervals
from cutcal.main import COMMANDS, main
from cutcal.options import print_json
from mpm.output.record import ADHESION, COHESION, ENERGIES
from mpm.runtime import ARCHES
from mpm.scene import CONTACTS
from mpm.scene.shapes import SHAPE_KINDS
from studies.convergence import gci
from studies.stability.result import REASONS
from tests.calib.documents import at, changed, faults, places, valid, validator
from tests.data_dir import ROOT
from tests.reports import sample, study_sample

PRIOR = "force_data/prior_predictive/prior.json"
LISTS = ("foods", "knives", "schemas")
WORDS = {"completion"}
"""Commands that print no document."""


def parts(whole: dict[str, Any], way: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every schema of a property within a schema, with its place."""
    for name, part in whole.get("properties", {}).items():
        yield f"{way}.{name}", part
        yield from parts(part, f"{way}.{name}")
    inner = [whole[key] for key in ("additionalProperties", "items") if isinstance(whole.get(key), dict)]
    inner += [part for key in ("anyOf", "allOf", "prefixItems") for part in whole.get(key, [])]
    for part in [*inner, *whole.get("$defs", {}).values()]:
        yield from parts(part, f"{way}.*")


def described(part: dict[str, Any], whole: dict[str, Any]) -> bool:
    """Whether a property says what it means, itself or where it points."""
    if "description" in part:
        return True
    *_, name = part["$ref"].split("/")
    home = whole["$defs"] if part["$ref"].startswith("#") and name in whole.get("$defs", {}) else common()["$defs"]
    return "description" in home[name]


def common() -> dict[str, Any]:
    """What the schemas share."""
    return json.loads((FOLDER / f"{COMMON}.json").read_text(encoding="utf-8"))


@pytest.fixture
def printed(capsys):
    """What a command prints with --json, which must be one document and no line of anything else."""

    def run(*argv: str) -> Any:
        main([*argv, "--json"])
        return json.loads(capsys.readouterr().out)

    return run


@pytest.mark.parametrize("name", [*names(), COMMON])
def test_schema_is_one_and_explains_every_key(name):
    """Each is valid against its own metaschema; every key has a description; its identity is its name."""
    own = common() if name == COMMON else schema(name)
    Draft202012Validator.check_schema(own)
    assert own["$id"] == f"urn:cutcal:schema:{name}:1"
    silent = [way for way, part in parts(own) if not described(part, own)]
    assert silent == []


@pytest.mark.parametrize("name", [n for n in names() if n not in LISTS])
def test_documents_say_what_they_are(name):
    """An object must name its schema, and the right one; it is closed, or says what its other keys are."""
    own = schema(name)
    assert own["properties"]["schema"]["const"] == tag(name) and "schema" in own["required"]
    whole = [part for _, part in parts({"properties": {name: own}}) if part.get("type") == "object"]
    assert all({"additionalProperties", "unevaluatedProperties", "description"} & set(part) for part in whole)
    assert own.get("additionalProperties") is not None


def test_every_command_has_a_document():
    """A new command comes with a schema, or says that it prints no document."""
    other = {"foods": "food", "knives": "knife", "schema": "schemas", "press": "tpa"}
    assert {other.get(n, n) for n in set(COMMANDS) - WORDS} <= set(names())


def test_words_are_those_of_the_code():
    """Closed choices list what the code can say, no more and no less."""
    parts = common()["$defs"]
    of = {name: part["enum"] for name, part in parts.items() if "enum" in part}
    assert set(of["intervalWord"]) == set(get_args(intervals.Identifiability))
    assert set(of["verdictWord"]) == set(of["intervalWord"]) | {"only_as_product", "at_limit", estimates.UNKNOWN}
    assert (of["shapeKind"], of["device"]) == (list(SHAPE_KINDS), list(ARCHES))
    assert set(of["status"]) == {*properties.LITERATURE_STATUSES, *properties.OTHER_STATUSES}
    assert list(parts["energy"]["properties"]) == [*ENERGIES[:-1], COHESION, ADHESION, ENERGIES[-1]]
    assert parts["energy"]["required"] == list(ENERGIES)
    assert schema("converge")["properties"]["verdict"]["enum"] == list(gci.TRENDS)
    assert schema("simulate")["properties"]["contact"]["enum"] == list(CONTACTS)
    assert set(of["runState"]) - {"done"} <= set(REASONS)
    assert set(schema("food")["$defs"]["common"]["$defs"]) == set(parts)
    assert list(schema("food")["additionalProperties"]["properties"]["properties"]["properties"]) == list(
        properties.PROPERTIES
    )


def calibrated(kind: str) -> dict[str, Any]:
    """The summary of the made-up calibration that the report is tested with, and what the report does not look at."""
    made = sample.summary(kind)
    more = {
        "schema": tag("calibrate"), "search": "interrupted" if kind == "interrupted" else "converged",
        "fine_simulations": 52, "repeatability": 0.004, "speed_real_m_s": None, "parted": 0.97, "fracture": None, "scene": {},
        "numerical_checks": [], "device": "cpu", "versions": versions(),
    }  # fmt: skip
    for line in made["verdicts"]:
        line.pop("relation", None)
        line["unit"] = line["unit"].replace("-", "")
    for p in [*made["parameters"].values(), *made["fixed_parameters"].values()]:
        p["verdict"] = p.get("verdict", "").replace("not_determined", "unknown")
    for p in made["fixed_parameters"].values():
        del p["verdict"]
    return made | more


DOCUMENTS = {
    "calibrate": lambda: calibrated("good"),
    "prior": lambda: json.loads((ROOT / PRIOR).read_text(encoding="utf-8")),
}


@pytest.mark.parametrize("kind", ["good", "reconstructed", "failed", "interrupted"])
def test_calibrations_of_every_end_are_documents(kind):
    """A calibration that passed, failed or was stopped by Ctrl-C has the same schema."""
    valid(calibrated(kind))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_is_wrong_in_one_place_is_refused(name):
    """No key may be missing or be another one's; a number is no text with a unit and no NaN, a word none that nobody
    knows."""
    document = valid(DOCUMENTS[name]())
    own, good = schema(name), validator(name).is_valid
    maps = {k for k, part in own["properties"].items() if isinstance(part.get("additionalProperties"), dict)}
    let = []
    for way in places(document):
        if way[0] == "scene" or (way[0] in maps and len(way) == 2):
            continue  # free, or a name that may be another one
        text = isinstance(at(document, way), str)
        wrong = (3,) if way[-1] in ("git", "commit") else (3, None) if text else ("12.5 N", [[]])
        let += [f"{way}: {other}" for other in wrong if good(changed(document, way, other))]
    assert let == []
    assert not [key for key in own["required"] if good(changed(document, (key,), without=True))]
    assert not good(document | {"peak_n": 1.0})


@pytest.mark.parametrize(
    ("way", "value"),
    [
        (("parameters", "E", "verdict"), "certain"),
        (("parameters", "E", "status"), "known"),
        (("parameters", "E", "extra"), 1.0),
        (("status",), "finished"),
        (("search",), "given up"),
        (("verdicts", 0, "passed"), "yes"),
        (("verdicts", 0, "unit"), "%"),
        (("peak_sim_N",), "12.5 N"),
        (("trace_sha256",), "3b5d"),
        (("created",), None),
        (("metrics", "iso18571", "R"), 1.2),
        (("schema",), "cutcal/simulate/1"),
        (("git",), "main"),
    ],
)
def test_unknown_words_and_units_are_refused(way, value):
    """A verdict, state, hash or commit that no calibration can have is not a document."""
    assert faults(changed(calibrated("good"), way, value), "calibrate")


def test_a_study_is_a_document():
    """The made-up study that the report is tested with, and what the report does not look at."""
    made = study_sample.summary()
    made |= {"schema": tag("study"), "search": "converged", "versions": versions()}
    for part in made["traces"].values():
        line = {"name": "NRMSE", "value": 0.02, "limit": 0.08, "unit": "fraction", "passed": True, "note": ""}
        part |= {"verdicts": [line], "scalars": {"peak_N": 12.0}, "values": {"E": 1e5}, "dx_m": 3e-3}
        for check in part["numerical_checks"]:
            check["unbooked_change"] = None
    for part in made["hold_out"].values():
        part |= {"verdicts": []}
    valid(made)
    assert faults(changed(made, ("hold_out", "third", "trained_on"), without=True))
    assert faults(changed(made, ("traces", "first", "in_sample"), False))


def test_lists_and_single_foods_and_knives(printed):
    """Every food and the knives that are shipped are documents, and so are the lists of their names."""
    foods = valid(printed("foods"), "foods")
    for name in foods:
        valid(printed("foods", name))
    for name in valid(printed("knives"), "knives"):
        valid(printed("knives", name))
    assert faults([*foods, "Bad Name"], "foods") and faults(changed(printed("foods", "banana"), ("warnings",), "none"))
    assert valid(printed("schema"), "schemas") == names()


def test_a_written_report_is_a_document(printed, tmp_path, monkeypatch):
    """``report --json`` names the file."""
    monkeypatch.setattr("studies.stability.report.write_report", lambda folder: folder / "report.pdf")
    (tmp_path / "stress.json").touch()
    assert valid(printed("report", str(tmp_path)))["report"] == str(tmp_path / "report.pdf")


def test_schemas_are_listed_and_printed(capsys):
    """``cutcal schema`` lists them; a name or the tag of a document prints one that needs no other file; a slip is
    named."""
    assert main(["schema"]) == 0
    assert capsys.readouterr().out.split() == names()
    for name in ("stress", tag("stress")):
        assert main(["schema", name]) == 0
        own = json.loads(capsys.readouterr().out)
        assert own == schema("stress") and own["$defs"][COMMON] == common()
    assert main(["schema", "calibrat"]) == 1
    assert "did you mean 'calibrate'" in capsys.readouterr().err


def test_no_number_in_a_document_is_infinite(tmp_path, capsys):
    """NaN and infinity are null in whatever is written and printed; JSON has no word for them."""
    odd = {"a": float("nan"), "b": [float("inf"), 1.0], "c": {"d": (-float("inf"),)}}
    write_json(tmp_path / "x.json", odd)
    print_json(odd)
    for text in ((tmp_path / "x.json").read_text(), capsys.readouterr().out):
        assert json.loads(text, parse_constant=pytest.fail) == {"a": None, "b": [None, 1.0], "c": {"d": [None]}}
