"""The scripts of the gallery draw the pictures that the page shows."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.data_dir import ROOT

GALLERY = ROOT / "docs" / "gallery"
SCRIPTS = sorted(path.name for path in GALLERY.glob("*.py"))
PICTURES = [f"{name[3:-3]}.png" for name in SCRIPTS]
"""What each of them draws."""
QUICK = ("01_trace.py", "02_food.py", "03_prior.py")
"""Those that simulate nothing."""
LONG = ("06_compare.py", "07_next_test.py", "09_section.py", "11_slicing.py", "13_grids.py")
"""Those that take half a minute each."""
LONGEST = 40
"""Lines of a script."""
MOST_BYTES, MOST_BYTES_IN_ALL = 100_000, 600_000
SAME_INK = 0.03
"""Largest change of a picture's ink [-]: the same numbers and fewer colours make 0.001, one line less 0.036 and more.
Where the ink is does not count, for a machine that rounds otherwise moves a curve."""


def marks(name: str) -> list[pytest.MarkDecorator]:
    """How long a script takes."""
    return [] if name in QUICK else [pytest.mark.long if name in LONG else pytest.mark.slow]


def ink(path: Path) -> np.ndarray:
    """How far each pixel of a picture is from white [-], 0 to 1, shape (rows, columns)."""
    return 1.0 - np.asarray(Image.open(path).convert("L"), dtype=float) / 255.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the scripts run, so that a calibration that several of them show is made once."""
    return tmp_path_factory.mktemp("gallery")


@pytest.mark.parametrize("name", [pytest.param(n, marks=marks(n)) for n in SCRIPTS])
def test_script_draws_its_picture(name: str, folder: Path) -> None:
    """The script runs as a user would run it, and draws as much as there is in the picture that is kept."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, str(GALLERY / name)],
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    picture = PICTURES[SCRIPTS.index(name)]
    drawn, kept = ink(folder / picture), ink(GALLERY / picture)
    assert drawn.shape == kept.shape
    assert drawn.sum() == pytest.approx(kept.sum(), rel=SAME_INK)


def test_page_shows_each_script_below_its_picture() -> None:
    """In their order, and nothing else; no script is longer than may be read at a glance."""
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"^!\[[^\]]+\]\(gallery/(.*)\)$|^```{literalinclude} gallery/(.*)$", page, flags=re.MULTILINE)
    assert [a or b for a, b in shown] == [one for pair in zip(PICTURES, SCRIPTS, strict=True) for one in pair]
    lengths = {name: len((GALLERY / name).read_text(encoding="utf-8").splitlines()) for name in SCRIPTS}
    assert {name: n for name, n in lengths.items() if n > LONGEST} == {}


def test_pictures_are_small_and_drawn() -> None:
    """Each script has one and there is no other; none is large, and none is blank."""
    assert sorted(path.name for path in GALLERY.glob("*.png")) == sorted(PICTURES)
    sizes = [(GALLERY / name).stat().st_size for name in PICTURES]
    assert max(sizes) < MOST_BYTES and sum(sizes) < MOST_BYTES_IN_ALL
    assert all(ink(GALLERY / name).max() > 0.5 for name in PICTURES)
