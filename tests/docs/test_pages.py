"""The pages of the documentation say nothing that the code does not have: names, commands, limits, files, links."""

from __future__ import annotations

import importlib
import inspect
import re
import shlex
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

import cutcal
import mpm
from calib.io.folder import prepare
from calib.material.food import load_material_file
from calib.material.knife import load_knife
from calib.multi_specimen.study_file import read_study
from calib.problem.request import Request
from calib.simulation.workers import Workers
from calib.uncertainty.estimates import FittedNuisance
from calib.validation.acceptance import NUISANCE_LINES, Conservation, Verdict, judge
from calib.validation.metrics import compare
from calib.validation.null_models import null_models
from calib.validation.numerical_checks import VARIANTS, Check
from calib.validation.predictive_score import PredictiveScore
from calib.validation.prior_conflict import PriorConflict
from cutcal.main import COMMANDS, parser
from tests.data_dir import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TEXTS = [*PAGES, ROOT / "README.md"]
LINKED = [*TEXTS, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", ROOT / "force_data" / "SOURCES.md"]
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
"""A link of a page: its file, and the heading in it."""


def read(path: Path) -> str:
    """Text of a page."""
    return path.read_text(encoding="utf-8")


def name_of(path: Path) -> str:
    """Name of a page in the list of tests."""
    return path.name


def rows(page: str) -> list[list[str]]:
    """Cells of the tables of a page, without their heads."""
    lines = [line for line in read(DOCS / page).splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def thing(name: str) -> Any:
    """What a dotted name stands for."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            out: Any = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            out = getattr(out, part)
        return out
    raise AssertionError(f"{name} cannot be imported")


DOCUMENTED = re.findall(r"^\.\. auto\w+:: (\S+)", read(DOCS / "api.md"), flags=re.MULTILINE)


def test_every_public_name_is_documented() -> None:
    """What ``cutcal`` and ``mpm`` offer is on the page of the interface."""
    offered = {f"{package.__name__}.{name}" for package in (cutcal, mpm) for name in package.__all__}
    assert offered - set(DOCUMENTED) == set()


@pytest.mark.parametrize("name", DOCUMENTED)
def test_documented_name_has_docstrings(name: str) -> None:
    """A name on that page exists, and it and its public methods and properties say what they are."""
    found = thing(name)
    members = {n: m for n, m in vars(found).items() if not n.startswith("_")} if inspect.isclass(found) else {}
    told = {n: m for n, m in members.items() if callable(m) or isinstance(m, (property, classmethod, staticmethod))}
    silent = [n for n, m in {name: found, **told}.items() if not (inspect.getdoc(m) or "").strip()]
    assert silent == []


def test_every_command_is_listed() -> None:
    """The table of commands has each command once, and no other."""
    listed = [cells[0].strip("`") for cells in rows("cli.md") if cells[0].startswith("`")]
    assert sorted(listed) == sorted(COMMANDS)


def commands(text: str) -> list[str]:
    """Lines of a text's shell blocks that call cutcal or calibrate."""
    blocks = re.findall(r"^```bash\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    lines = [line.removeprefix(".venv/bin/") for line in lines]
    return [line.partition(" #")[0].partition(" > ")[0] for line in lines if re.match(r"(cutcal|calibrate) ", line)]


@pytest.mark.parametrize("path", [p for p in TEXTS if commands(read(p))], ids=name_of)
def test_commands_can_be_typed(path: Path) -> None:
    """The parsers take every command of a page: its options exist and their values have the right form."""
    for line in commands(read(path)):
        words = shlex.split(line)
        try:
            parser().parse_args(words[1:] if words[0] == "cutcal" else words)
        except SystemExit:
            pytest.fail(f"{path.name}: {line}")


def anchors(path: Path) -> set[str]:
    """Places of a page that a link may lead to, as the repository and the site name them."""
    found: list[str] = []
    for heading in re.findall(r"^#{1,6} (.+)$", re.sub(r"^```.*?^```", "", read(path), flags=re.M | re.S), flags=re.M):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        found.append(re.sub(r"[^\w -]", "", words).replace(" ", "-"))
    made = {f"cutcal-{name}" for name in COMMANDS} if path == DOCS / "cli.md" else set()  # by the directive there
    return {f"{name}-{found[:k].count(name)}" if name in found[:k] else name for k, name in enumerate(found)} | made


def broken(path: Path, text: str) -> list[str]:
    """Links of a page to files and headings that are not there, as the page is read in the repository."""
    out = []
    for link, heading in LINK.findall(text):
        target = path.parent / link if link else path
        if "://" in link or link.startswith("mailto:"):
            continue
        if not target.exists() or (heading and target.suffix == ".md" and heading not in anchors(target)):
            out.append(f"{link}#{heading}")
    return out


@pytest.mark.parametrize("path", LINKED, ids=name_of)
def test_links_lead_to_files_and_headings(path: Path) -> None:
    """A link to a file of the repository leads to one, and one to a heading to one that is there."""
    assert broken(path, read(path)) == []


def test_a_broken_link_would_be_found() -> None:
    """A file that is not there, a heading that is not, here and on another page."""
    text = "[a](docs/none.md) [b](#none) [c](docs/theory.md#none) [d](docs/cli.md#cutcal-press) [e](#try-it)"
    assert broken(ROOT / "README.md", text) == ["docs/none.md#", "#none", "docs/theory.md#none"]


@pytest.mark.parametrize("page", ["theory.md", "converge.md"])
def test_named_modules_exist(page: str) -> None:
    """A module or function that a page names by its full path exists."""
    named = sorted(set(re.findall(r"`((?:calib|mpm|fem_reference|studies)\.[\w.]+)`", read(DOCS / page))))
    assert named
    for name in named:
        thing(name)


def lines_of_a_report() -> list[Verdict]:
    """Every line that a verdict table can have."""
    s = np.linspace(0.0, 0.03, 100)
    real = np.sin(np.pi * s / 0.03)
    nulls = {name: model.metrics for name, model in null_models(s, real).items()}
    nuisance = FittedNuisance(0.0, 1.0, 1.0, "-", False)
    return judge(
        compare(s, real, real),
        nulls,
        conservation=Conservation(0.0, 0.0, 1.0, 0.0),
        fitted={},
        checks=[Check(name, None, 0.0, 0.0, 0.0) for name in (*VARIANTS, "twice the process zone")],
        nuisances=dict.fromkeys(NUISANCE_LINES, nuisance),
        predictive=PredictiveScore(0.5, 0.1, 0.1, {"ramp": 0.5}, PriorConflict(0.5, 1, "R", 0.1), 0.5),
    )


def test_every_line_of_the_report_is_explained() -> None:
    """The page of the report has each line of the verdict table, with its limit."""
    table = {cells[0]: cells[1] for cells in rows("report.md")}
    not_run = next(names for names in table if "held-out" in names).split(", ")
    for line in lines_of_a_report():
        if line.passed is None:
            assert line.name.startswith(tuple(not_run))
            continue
        said = re.match(r"([\d.]+)( %)?", table[line.name])
        if said is not None:
            assert float(said[1]) * (0.01 if said[2] else 1.0) == line.limit


def test_own_files_can_be_read(tmp_path: Path) -> None:
    """The food, the knife and the studies of the page on own data are taken as they stand there."""
    blocks = re.findall(r"^```yaml\n(.*?)^```", read(DOCS / "own-data.md"), flags=re.MULTILINE | re.DOTALL)
    files = [tmp_path / f"{k}.yaml" for k in range(len(blocks))]
    for file, block in zip(files, blocks, strict=True):
        file.write_text(block, encoding="utf-8")
    food, knife, study, speeds = files
    assert load_material_file(food).to_scene_food().material.E == 5e4
    assert load_knife(food.with_name(knife.name)).spine == 1.8e-3
    assert read_study(study).hold_out == ("first", "second")
    assert read_study(speeds).food.value("rate_exponent") == 0.1


README = ROOT / "README.md"
MOST_LINES, MOST_WORDS, MOST_IN_A_SENTENCE = 120, 1000, 30


def sentences(text: str) -> list[str]:
    """Sentences of a page: without code, tables and pictures; a link counts by its words."""
    plain = re.sub(r"^```.*?^```|^\|.*?$|^!\[.*?$|<!--.*?-->|^#.*?$", "", text, flags=re.MULTILINE | re.DOTALL)
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", plain)
    parts = re.split(r"\n\s*\n|\n- |(?<=[.:;?!])\s+(?=[A-Z*`])", plain)
    return [" ".join(part.split()) for part in parts if part.strip()]


def test_the_readme_is_short() -> None:
    """At most 120 lines and 1,000 words, and no sentence of more than 30 words."""
    text = read(README)
    assert len(text.splitlines()) <= MOST_LINES and len(text.split()) <= MOST_WORDS
    long = [s for s in sentences(text) if len(s.split()) > MOST_IN_A_SENTENCE and "·" not in s]
    assert long == []


def test_a_long_sentence_would_be_found() -> None:
    """The measure of sentences sees one of 31 words, also over two lines, and does not add up two short ones."""
    words = "word " * 29
    assert [len(s.split()) for s in sentences(f"It {words}\nends. Then more.")] == [31, 2]


def test_what_the_readme_shows_in_python_can_be_called() -> None:
    """The snippet compiles, and what it takes from the package is there."""
    blocks = re.findall(r"^```python\n(.*?)^```", read(README), flags=re.MULTILINE | re.DOTALL)
    assert len(blocks) == 1
    compile(blocks[0], "README.md", "exec")
    for module, names in re.findall(r"^from (\w+) import (.+)$", blocks[0], flags=re.MULTILINE):
        assert all(hasattr(importlib.import_module(module), name.strip()) for name in names.split(","))


def test_a_shell_finds_the_commands_of_the_readme() -> None:
    """What is installed into a folder is called by it, until the folder is on the PATH."""
    blocks = re.findall(r"^```bash\n(.*?)^```", read(README), flags=re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).splitlines()
    active = lines.index("source .venv/bin/activate")
    assert not [line for line in lines[:active] if re.match(r"(cutcal|calibrate|pip|pytest) ", line)]
    assert [line for line in lines[active:] if line.startswith("calibrate ")]
    before = read(README).partition("source .venv/bin/activate")[0]
    assert "`cutcal doctor`" not in before and "`.venv/bin/python`" in before


@pytest.mark.parametrize("path", [README, DOCS / "python.md"], ids=name_of)
def test_the_first_python_of_a_page_runs_after_the_commands_of_the_readme(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes no folder that one of them has written; a folder that is checked stands for the calibration."""

    def only_prepared(request: Request, out: Path, pool: Workers, **how: Any) -> MagicMock:
        with prepare(out, "calibrate", resume=False):
            return MagicMock()  # the result, of any values

    written = [tmp_path / folder for folder in re.findall(r" --out (\S+)", "\n".join(commands(read(README))))]
    if path != README:  # whose own Python may have been tried before
        written += [tmp_path / folder for folder in re.findall(r'\.run\("(\S+)"\)', read(README))]
    assert tmp_path / "runs" / "banana" in written
    for folder in written:
        folder.mkdir(parents=True)
        (folder / "summary.json").write_text("{}")
    (tmp_path / "force_data").symlink_to(ROOT / "force_data")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("calib.calibration.run.run", only_prepared)
    exec(re.findall(r"^```python\n(.*?)^```", read(path), flags=re.MULTILINE | re.DOTALL)[0], {})
    made = {folder for folder in (tmp_path / "runs").iterdir()} | set(tmp_path.glob("cutcal-*"))
    assert len(made) == len(written) + 1


@pytest.mark.parametrize("path", TEXTS, ids=name_of)
def test_terms_lead_into_the_glossary(path: Path) -> None:
    """A link to a term of the glossary leads to one."""
    headings = re.findall(r"^#+ (.+)$", read(DOCS / "glossary.md"), flags=re.MULTILINE)
    terms = {re.sub(r"[^a-z0-9 -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    assert set(re.findall(r"glossary\.md#([\w-]+)\)", read(path))) <= terms
