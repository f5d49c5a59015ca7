"""The examples of the documentation run as they stand there, and give the numbers that they are about."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.data_dir import ROOT

EXAMPLES = ROOT / "docs" / "examples"
LONGEST = 40
"""Lines of an example."""
NUMBER = r"([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)"


def number(said: str, pattern: str) -> float:
    """The number in the first place where the output has the pattern, which marks it with {}."""
    found = re.search(pattern.replace("{}", NUMBER), said)
    assert found is not None, f"{pattern!r} is not in:\n{said}"
    return float(found[1])


def calibrate(said: str) -> None:
    """R is the one that a chord of 30 mm and a peak of 12.5 N ask for, less what friction takes: 416 J/m^2 at most."""
    assert 250 < number(said, r"R = {} J") < 416


def condition(said: str) -> None:
    """The reconstruction has a baseline of 25 N, contact at 1 s and a peak of 12.5 N (its header)."""
    assert number(said, r"baseline {}") == pytest.approx(25.0, abs=0.15)
    assert number(said, r"contact at {}") == pytest.approx(1.0, abs=0.03)
    assert number(said, r"peak {}") == pytest.approx(12.5, abs=0.2)


def simulate(said: str) -> None:
    """A thin blade needs R times the width (2 %), and momentum balances to rounding."""
    assert number(said, r"plateau {}") == pytest.approx(number(said, r"width {}"), rel=0.02)
    assert number(said, r"closes to {}") < 1e-10


def metrics(said: str) -> None:
    """A curve 10 % too strong has a peak error of 0.1, and beats what explains nothing."""
    assert number(said, r"simulation +{}") == pytest.approx(0.1, abs=0.005)
    assert "in shape: True" in said


def offset(said: str) -> None:
    """Half a cell changes the work by under 5 % with contact of particles, by more than half with that of nodes."""
    assert abs(number(said, r"cohesive: half a cell changes the work by {}%")) < 5.0
    assert abs(number(said, r"nodal: half a cell changes the work by {}%")) > 50.0


def converge(said: str) -> None:
    """The published example (Celik et al. 2008): order 1.53, 6.1685, 2.2 %; noise makes a trend that no longer
    counts."""
    assert number(said, r"order {}, extrapolated") == pytest.approx(1.53, abs=0.01)
    assert number(said, r"extrapolated {}") == pytest.approx(6.1685, abs=1e-3)
    assert "0.0: monotone" in said and "0.0012: noise-limited" in said


def prior(said: str) -> None:
    """The recorded band of a banana holds the published 12.5 N."""
    assert number(said, r"banana .*draws {} to") < 12.5 < number(said, r"banana .* to {} N")
    assert "in the band: True" in said


def food(said: str) -> None:
    """The value that was written is read back, and the prior stays that of the literature."""
    assert number(said, r"E = {} Pa") == 1.5e5
    assert number(said, r"prior \({},") > 1.5e5


def elements(said: str) -> None:
    """Between frictionless plates the state is uniform, so that elements of any size give the closed form."""
    assert number(said, r"relative error {}") < 1e-4


PROVED: dict[str, Callable[[str], None]] = {
    "01_calibrate.py": calibrate,
    "02_condition.py": condition,
    "03_simulate.py": simulate,
    "04_metrics.py": metrics,
    "05_offset.py": offset,
    "06_converge.py": converge,
    "07_prior.py": prior,
    "08_food.py": food,
    "09_elements.py": elements,
}
"""What the output of each example shows."""


def test_every_example_is_proved_and_shown() -> None:
    """No example without a number that is checked, none longer than it may be, none that the page of examples leaves
    out."""
    there = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert there == sorted(PROVED)
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    assert re.findall(r"{literalinclude} examples/(.*)", page) == there
    lengths = {name: len((EXAMPLES / name).read_text(encoding="utf-8").splitlines()) for name in there}
    assert {name: n for name, n in lengths.items() if n > LONGEST} == {}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.long if n == "01_calibrate.py" else ()) for n in PROVED]
)
def test_example(name: str, tmp_path: Path) -> None:
    """The example runs as a user would run it, in a folder of its own, and its number is right."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    PROVED[name](done.stdout)
