"""The notebooks of the documentation run in a new kernel, show what they are about, and are kept small."""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path
from types import ModuleType

import nbformat
import pytest

from tests.data_dir import ROOT

NOTEBOOKS = ROOT / "docs" / "notebooks"
MOST_BYTES = 100_000
FIRST, NEXT = "first_calibration.ipynb", "next_test.ipynb"


def maker() -> ModuleType:
    """The script that runs the notebooks and keeps their outputs."""
    spec = importlib.util.spec_from_file_location("notebooks", ROOT / "docs" / "notebooks.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def shown(notebook: nbformat.NotebookNode) -> str:
    """All that the cells print or give back as text or table, and a line for each picture."""
    lines = []
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            lines += [output.get("text", ""), data.get("text/html", data.get("text/plain", ""))]
            lines += ["PICTURE"] if "image/png" in data else []
    return "\n".join(lines)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the notebooks run one after the other, as a reader would: the second finds the calibration of the first."""
    return tmp_path_factory.mktemp("notebooks")


def run(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """What a notebook shows in a new kernel, with folders of its own for what Jupyter keeps."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # which pictures of other tests are drawn with
    for variable in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_DATA_DIR"):
        monkeypatch.setenv(variable, str(folder / "jupyter"))
    return shown(maker().executed(NOTEBOOKS / name, folder))


@pytest.mark.slow
def test_a_first_calibration(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends with a folder; record and fit are drawn; R is the one that a chord of 30 mm and a peak of 12.5 N ask for,
    less what friction takes: 416 J/m^2 at most."""
    said = run(FIRST, folder, monkeypatch)
    assert (folder / "runs" / "first-calibration" / "report.pdf").is_file()
    found = re.search(r"R = (\d+) J/m\^2", said)
    assert found is not None and 250 < float(found[1]) < 416
    assert said.count("PICTURE") == 2 and "only_as_product" in said and "[[Verdicts]]" in said
    assert "not a measurement" in said and "Warning" not in said and "[Taichi]" not in said


@pytest.mark.long
def test_which_test_next(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an R that only the width limits the width is asked for, and it narrows by half or more."""
    said = run(NEXT, folder, monkeypatch)
    assert (folder / "runs" / "next-test" / "design.json").is_file()
    now, after = re.search(r"now: (\d+) to (\d+)", said), re.search(r"after width \(2 min\): (\d+) to (\d+)", said)
    assert now is not None and after is not None
    assert float(after[2]) - float(after[1]) < 0.5 * (float(now[2]) - float(now[1]))
    assert said.count("PICTURE") == 1 and "Graphical python shell" not in said


def test_two_intervals_of_one_number_are_told_apart_where_they_stand() -> None:
    """The one that tests are judged from is not the calibration's: the line says so, and gives that one too."""
    said = shown(nbformat.read(NOTEBOOKS / NEXT, as_version=4))
    lines = said.splitlines()
    (k,) = [k for k, line in enumerate(lines) if line.startswith("now: ")]
    own = re.search(r"own interval, which needs no such approximation: (\d+) to (\d+)", lines[k + 1])
    assert "normal approximation" in lines[k] and own is not None
    assert f"<td>{own[1]} to {own[2]}</td>" in said  # as the table of the result has it


def test_each_is_run_and_shown() -> None:
    """No notebook without a test, none that the documentation does not have."""
    assert sorted(path.name for path in NOTEBOOKS.glob("*.ipynb")) == [FIRST, NEXT]
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert all(f"notebooks/{Path(name).stem}" in index for name in (FIRST, NEXT))


@pytest.mark.parametrize("name", [FIRST, NEXT])
def test_kept_outputs_are_small_and_of_a_whole_run(name: str) -> None:
    """Under 100 kB, each cell run once and in order, no error, and no path of the machine that ran it."""
    path = NOTEBOOKS / name
    text = path.read_text(encoding="utf-8")
    assert path.stat().st_size < MOST_BYTES
    assert (
        re.findall(r'"/(?:tmp|home|root|work|Users)\b|\b\w:\\\\', text) == [] and os.sep + "site-packages" not in text
    )
    cells = [cell for cell in nbformat.reads(text, as_version=4).cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    outputs = [output for cell in cells for output in cell.outputs]
    assert outputs and not [o for o in outputs if o.output_type == "error" or o.get("name") == "stderr"]


@pytest.mark.parametrize("name", [FIRST, NEXT])
def test_links_lead_to_files(name: str) -> None:
    """As a notebook is read in the repository."""
    cells = nbformat.read(NOTEBOOKS / name, as_version=4).cells
    links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", "\n".join(c.source for c in cells if c.cell_type == "markdown"))
    assert links and [link for link in links if not (NOTEBOOKS / link).exists()] == []
