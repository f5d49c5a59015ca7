"""The page of files has all that is written: every file, column, data set and document, in the unit of its name."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.calibration.calibrated import Calibrated, FittedWithdrawal
from calib.compression import result as compression
from calib.io.folder import OWN_FILES, RUN_FILES
from calib.io.schema import names, schema, tag
from calib.multi_specimen.run import Finished
from calib.relaxation import relaxation_result as relaxation
from calib.texture import texture_result as texture
from calib.validation import prior_predictive
from calib.validation.interval_coverage import MadeUpSensor
from calib.validation.null_models import null_models
from studies.convergence import result as convergence
from studies.regression.reference_curves import COLUMNS as REGRESSED
from tests.calib.io.test_meaning import withdrawn
from tests.data_dir import ROOT

sys.path.append(str(ROOT / "docs"))
import document_keys
import file_tables

PAGE = file_tables.PAGE.read_text(encoding="utf-8")
PACKAGES = ("calib", "cutcal", "reports", "studies", "intsim")
END = re.compile(r"^[\w.*-]+\.(json|jsonl|csv|svg|pdf|html|yaml|h5|h5\.journal|mp4|png|npz|parquet)$")
S = np.linspace(1e-3, 0.03, 60)
NO_COMMANDS = (
    "studies/design/", "studies/discrimination/",  # studies of the project, which no command runs
    "reports/calibration/report.py", "reports/multi_specimen/report.py", "reports/base/",  # pictures in a PDF
    "calib/io/schema.py", "calib/formats/", "intsim/policy/", "intsim/data/lerobot.py", "intsim/data/rlds.py",
    "intsim/data/rdt.py",  # schemas, what is read, and the layouts of others
)  # fmt: skip
"""Where names of files are not those of files in the folder of a run."""
NO_OUTPUTS = {"materials.yaml", "knives.yaml", "reference.json", "-*.h5", "*.h5"}
"""What is read, and parts of names."""


def section(heading: str) -> str:
    """What the page has under a heading."""
    found = re.search(rf"^(#+) {re.escape(heading)}\n(.*?)(?=^#{{1,3}} |\Z)", PAGE, flags=re.MULTILINE | re.DOTALL)
    assert found is not None, heading
    return found[2]


def told(heading: str) -> dict[str, str]:
    """Columns that the page has under a heading, with their units."""
    return dict(re.findall(r"^\| `([^`]+)` \| ([^|]+?) \| [^|]+ \|$", section(heading), flags=re.MULTILINE))


def of_units(name: str) -> str:
    """The unit that the name of a column ends in."""
    head, _, end = name.rpartition("_")
    return {"Nm": "N m"}.get(end, end) if head else "-"


def written(module: Any, write: Callable[[], None], monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Names of the columns that a function of a module gives to its table."""
    kept: list[set[str]] = []
    monkeypatch.setattr(module, "write_csv", lambda path, columns, **_: kept.append(set(columns)))
    monkeypatch.setattr(module, "write_json", lambda *_: None)
    monkeypatch.setattr(module, "to_document", lambda _: {})
    write()
    (columns,) = kept
    return columns


def of_calibration() -> set[str]:
    """Columns of a calibration with a band and a low-pass."""
    curve = SimpleNamespace(stroke=S, curve=np.sin(100 * S), clock=S)
    band = SimpleNamespace(low=S, high=S)
    setup = SimpleNamespace(
        curve=curve,
        bandwidth=15.0,
        objective=SimpleNamespace(target=SimpleNamespace(smooth=lambda s, x, y: np.interp(s, x, y))),
    )
    done: Any = SimpleNamespace(
        setup=setup,
        best=SimpleNamespace(curve=S),
        record=withdrawn(),
        start=S,
        nulls=null_models(S, curve.curve),
        analysis=SimpleNamespace(bands=[band]),
    )
    return set(Calibrated.curves(done))


def of_withdrawal() -> set[str]:
    """Columns of a way up with a band."""
    measured: Any = SimpleNamespace(way=S, pull=S)
    band: Any = SimpleNamespace(low=S, high=S)
    return set(FittedWithdrawal(measured, S, band).columns())


def of_study() -> set[str]:
    """Columns of a cut that was fitted and of one that was held out."""
    band = SimpleNamespace(low=S, high=S)
    setups = {name: SimpleNamespace(curve=SimpleNamespace(stroke=S, curve=S)) for name in "ab"}
    one = SimpleNamespace(curve=S, band=band)
    done: Any = SimpleNamespace(setups=setups, cuts={"a": one}, held_out={"b": one})
    return set(Finished.curves(done, "a")) | set(Finished.curves(done, "b"))


def of_prior() -> set[str]:
    """Columns of one food's forces."""
    run = SimpleNamespace(
        ok=True, stroke=S, force=S, status="ok", reason="", completed=1.0, scalars={"ke_over_ie": 0.0}
    )
    plan: Any = SimpleNamespace(
        stroke=S,
        inputs="",
        parameters=SimpleNamespace(names=()),
        scene=SimpleNamespace(numerics=SimpleNamespace(dx=1e-3)),
    )
    runs: Any = [run, run]
    return set(prior_predictive.conclude(plan, runs)[0])


def of_prediction() -> set[str]:
    """Columns that ``predict`` names where it writes them."""
    tree = ast.parse((ROOT / "calib/validation/prediction.py").read_text(encoding="utf-8"))
    (call,) = calls_of_write_csv(tree)
    table = call.args[1]
    assert isinstance(table, ast.Dict)
    return {str(key.value) for key in table.keys if isinstance(key, ast.Constant)}


def calls_of_write_csv(tree: ast.AST) -> list[ast.Call]:
    """Places where a table is written."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "write_csv"]


PLAIN: dict[str, Callable[[], set[str]]] = {
    "curves.csv of calibrate": of_calibration,
    "withdrawal.csv of calibrate": of_withdrawal,
    "curves-NAME.csv of a study": of_study,
    "curves.csv of predict": of_prediction,
    "force.csv of simulate": lambda: set(withdrawn().columns()),
    "FOOD.csv of prior": of_prior,
    "trace-NUMBER.csv of coverage": lambda: set(MadeUpSensor().measure(S, S, np.random.default_rng(0))),
    "FOOD-CONTACT.csv of regress": lambda: set(REGRESSED),
}
"""Columns of a table, by the heading of the page that tells them."""


@pytest.mark.parametrize("heading", PLAIN)
def test_every_column_is_on_the_page(heading: str) -> None:
    """All that are written and no others, in the unit that their name ends in."""
    found = told(heading)
    assert set(found) == PLAIN[heading]()
    assert {name: of_units(name) for name in found} == found


def test_columns_of_presses_and_grids_are_on_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same of tables that have a column for each repeat or grid."""
    none: Any = None
    stress = compression.StressCurves(S, S, S, S, {"NAME": S})
    hold, bites = relaxation.HoldCurve("a", S, S, S), texture.BiteCurves("a", S, np.vstack([S, S]), S)
    forces = convergence.ForceCurves(S, {2e-3: S}, S, S)
    made = {
        "compress": written(compression, lambda: compression.write_result(none, stress, tmp_path), monkeypatch),
        "press relax": written(relaxation, lambda: relaxation.write_result(none, [hold], tmp_path), monkeypatch),
        "press tpa": written(texture, lambda: texture.write_result(none, [bites], tmp_path), monkeypatch),
        "converge": written(convergence, lambda: convergence.write_result(none, forces, tmp_path), monkeypatch),
    }
    for command, columns in made.items():
        found = told(f"curves.csv of {command}")
        assert {name.replace("0.002", "CELL") for name in columns} == set(found), command
        wanted = {name: "-" if name in ("strain", "specimen", "group") else of_units(name) for name in found}
        assert wanted == found


def test_no_table_is_written_elsewhere() -> None:
    """A new table comes with a section of the page, and a row above."""
    places = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if calls_of_write_csv(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert places == {
        "calib/calibration/run.py", "calib/compression/result.py", "calib/multi_specimen/run.py",
        "calib/relaxation/relaxation_result.py", "calib/texture/texture_result.py", "calib/validation/prediction.py",
        "calib/validation/prior_predictive.py",
        "cutcal/commands/solver/around.py", "cutcal/commands/solver/simulate.py",
        "studies/convergence/result.py", "studies/regression/reference_curves.py", "studies/regression/result.py",
    }  # fmt: skip


def test_tables_of_hdf5_are_those_of_the_code() -> None:
    """``python docs/file_tables.py`` changes nothing; what the files themselves say is tested with them."""
    assert file_tables.with_tables(PAGE) == PAGE
    rows = set(re.findall(r"^\| `([^`]+)`", PAGE, flags=re.MULTILINE))
    assert {"curves/force", "parameters/E", "scalars/peak_N", "section/mises", "mpm/force", "severed_area"} <= rows


def texts(path: Path) -> set[str]:
    """Texts of a module that are names of files, ``*`` for what is put in; without docstrings."""
    tree, found = ast.parse(path.read_text(encoding="utf-8")), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            found.add("".join(str(v.value) if isinstance(v, ast.Constant) else "*" for v in node.values))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(re.sub(r"\{[^}]*\}", "*", node.value))
    return {text for text in found if END.match(text)}


def test_every_file_is_on_the_page() -> None:
    """Names of files in the code, and those by which a folder is known to hold a run."""
    known = set(RUN_FILES)
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            place = path.relative_to(ROOT).as_posix()
            known |= set() if place.startswith(NO_COMMANDS) else texts(path)
    listed = re.findall(r"`([\w.-]+\.\w+)`", PAGE)
    missing = [
        name
        for name in sorted(known - NO_OUTPUTS)
        if not any(re.fullmatch(re.escape(name).replace(r"\*", "[A-Z]+"), one) for one in listed)
    ]
    assert len(known) > 40 and missing == []


def test_files_stand_beside_their_command() -> None:
    """Those that a command takes for its own when it goes on, and no command twice."""
    rows = re.findall(r"^\| (`[^|]+`) \| ([^|]+) \|$", section("Which command writes what"), flags=re.MULTILINE)
    table = {name: files for names, files in rows for name in re.findall(r"`([^`]+)`", names)}
    for name, files in OWN_FILES.items():
        own = table[{"study": "calibrate --config"}.get(name, name)]
        assert [one for one in files if f"`{one}`" not in own and not one.endswith(".journal")] == [], name


def test_every_document_is_on_the_page() -> None:
    """Each schema is named once, beside the file that has it or among those that are printed alone."""
    listed = re.findall(r"`(cutcal/\w+/\d+)`", PAGE)
    assert sorted(listed) == sorted(map(tag, names()))
    for file, name in re.findall(r"^\| `([\w.]+)`[^|]* \| `cutcal/(\w+)/1` \|$", PAGE, flags=re.MULTILINE):
        assert file in schema(name)["description"], name


@pytest.mark.parametrize("name", [n for n in names() if n not in document_keys.LISTS])
def test_every_key_of_a_document_is_on_the_site(name: str) -> None:
    """The section of a document has all its keys, each with a meaning, and units where the schema has one."""
    text, whole = document_keys.section(name), schema(name)
    for key in whole["properties"]:
        assert f"| `{key}` | " in text
    assert re.findall(r"^\| `[^`]+` \| [^|]* \|  \|$", text, flags=re.MULTILINE) == []


def test_units_and_inner_keys_are_told() -> None:
    """Those of a calibration: a force, and a name within each line of the verdict."""
    text = document_keys.section("calibrate")
    assert "| `baseline_N` | N | Force before contact that was subtracted |" in text
    assert "| `verdicts[].name` | - | " in text and "| `parameters.*.value` | " in text
