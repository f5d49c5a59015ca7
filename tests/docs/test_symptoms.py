"""The page of symptoms: each has a reason, a command that exists, a line that it does print, and a page that says
more. That the commands can be typed and the links lead to files is tested with all pages."""

from __future__ import annotations

import re
import shlex

import pytest

from cutcal.main import COMMANDS
from studies.verification.suite import cases
from tests.data_dir import ROOT
from tests.docs.test_pages import DOCS, commands, lines_of_a_report, read

PAGE = read(DOCS / "symptoms.md")
SYMPTOMS = dict(re.findall(r"^### ([^\n]+)\n(.*?)(?=^#{2,3} |\Z)", PAGE, flags=re.MULTILINE | re.DOTALL))
PARTS = ("**Why.**", "**Check.**", "```bash", "**Look at**", "**More:**")
LINES = {line.name for line in lines_of_a_report()}
SOURCES = "".join(
    read(path) for package in ("calib", "cutcal", "mpm", "studies") for path in sorted((ROOT / package).rglob("*.py"))
)


def anchors(page: str) -> set[str]:
    """Places of a page that a link may lead to."""
    headings = re.findall(r"^#{1,3} (.+)$", read(DOCS / page), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", SYMPTOMS)
def test_a_symptom_leads_somewhere(name: str) -> None:
    """It has all its parts, once and in order; its links lead to headings."""
    text = SYMPTOMS[name]
    places = [text.index(part) for part in PARTS]
    assert places == sorted(places) and all(text.count(part) == 1 for part in PARTS)
    links = re.findall(r"\]\(([\w-]+\.md)(?:#([\w-]+))?\)", text[places[-1] :])
    assert links and [(page, place) for page, place in links if place and place not in anchors(page)] == []


@pytest.mark.parametrize("name", SYMPTOMS)
def test_the_line_to_look_at_is_printed(name: str) -> None:
    """What stands first behind *Look at* is in the code that prints it, or a line of the verdict."""
    first = re.search(r"\*\*Look at\*\* `([^`]+)`", SYMPTOMS[name])
    assert first is not None
    head, sign, tail = first[1].partition(": work within")  # whose beginning is the name of what was varied
    varied = bool(sign) and not tail and f'"{head}"' in SOURCES and sign in SOURCES
    assert varied or first[1] in LINES or first[1] in SOURCES


def test_the_page_is_about_many_things() -> None:
    """Thirty symptoms and more, with most of the commands that check a simulation, a trace or a fit."""
    used = {shlex.split(line)[1 if line.startswith("cutcal") else 0] for line in commands(PAGE)}
    assert len(SYMPTOMS) >= 30 and used <= set(COMMANDS)
    assert used >= {"calibrate", "simulate", "converge", "verify", "stress", "regress", "predict", "coverage", "bench"}


def test_cases_that_are_asked_for_exist() -> None:
    """Each ``verify --only`` finds a case, also among the quick ones where it says so."""
    asked = [line for line in commands(PAGE) if "--only" in line]
    assert asked
    for line in asked:
        words = shlex.split(line)
        text = words[words.index("--only") + 1]
        assert [c for c in cases() if text in c.name and (c.fast or "--quick" not in words)], line
