"""A run folder with stored simulations, and the page of one, read as a browser reads it."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_file import Header
from calib.simulation.evaluation_store import EvaluationStore
from tests.reports import sample

VOID = {"br", "img", "input", "link", "meta", "wbr", "hr", "source"}
BEST = {name: row[0] for name, row in sample.FITTED.items()}


def add_members(folder: Path, count: int = 12) -> Path:
    """Put a store of simulations into a folder of the sample: the best values, and others on both grids."""
    path = folder / "evaluations.h5"
    time, raw, tared = sample.record()
    path.unlink()
    stroke, best = sample.curves()["stroke_m"], sample.curves()["sim_N"]
    with EvaluationStore(path, Header(sample.SHA256, "sample")) as store:
        store.append("best", run(BEST, stroke, best), "fine")
        store.append("again", run(BEST, stroke, 1.01 * best), "again")
        store.append("broken", run(BEST, stroke, best, status="failed"), "fine")
        for k in range(1, count):
            values = {name: x * (1.0 + 0.05 * k) for name, x in BEST.items()}
            store.append(f"run{k}", run(values, stroke, (1.0 + 0.03 * k) * best), "fine" if k % 3 else "coarse")
    with h5py.File(path, "a") as file:
        for name, values in (("time_s", time), ("raw_N", raw), ("tared_N", tared)):
            file.create_dataset(f"conditioning/{name}", data=values)
    return folder


def run(values: dict[str, float], stroke: np.ndarray, force: np.ndarray, status: str = "ok") -> Evaluation:
    """A simulation with these values, a stroke [m] and a force [N], each (n,)."""
    reason, part = ("", 1.0) if status == "ok" else ("inverted", 0.9)
    return Evaluation(0, values, status, reason, part, stroke, force)


class Page(HTMLParser):
    """What stands in a page: elements with their attributes, texts, tables, data; faults of its structure."""

    def __init__(self, path: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.source = path.read_text(encoding="utf-8")
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.faults: list[str] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.headings: list[str] = []
        self.scripts: list[str] = []
        self.styles: list[str] = []
        self.data: dict[str, Any] = {}
        self.text = ""
        self._open: list[tuple[str, dict[str, str | None]]] = []
        self.feed(self.source)
        self.close()
        self.faults += [f"{name} is not closed" for name, _ in self._open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        self.elements.append((tag, known))
        if len(known) != len(attrs):
            self.faults.append(f"{tag} has an attribute twice")
        if tag not in VOID:
            self._open.append((tag, known))
        if tag == "table":
            self.tables[known.get("id") or f"table {len(self.tables)}"] = []
        elif tag == "tr":
            self._rows().append([])
        elif tag in ("td", "th"):
            self._rows()[-1].append("")
        elif tag in ("h1", "h2"):
            self.headings.append("")
        elif tag == "small":
            self.handle_data(" ")

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open[-1][0] != tag:
            self.faults.append(f"</{tag}> ends {self._open[-1][0] if self._open else 'nothing'}")
            return
        self._open.pop()

    def handle_data(self, data: str) -> None:
        inside = [name for name, _ in self._open]
        if inside and inside[-1] in ("script", "style"):
            attributes = self._open[-1][1]
            if attributes.get("type") == "application/json":
                self.data[str(attributes["id"])] = json.loads(data)
            else:
                (self.scripts if inside[-1] == "script" else self.styles).append(data)
            return
        self.text += data
        if "td" in inside or "th" in inside:
            self._rows()[-1][-1] += data
        if {"h1", "h2"} & set(inside):
            self.headings[-1] += data

    def _rows(self) -> list[list[str]]:
        return self.tables[list(self.tables)[-1]]

    def values(self, attribute: str) -> list[str]:
        """What an attribute is, wherever it stands."""
        return [str(known[attribute]) for _, known in self.elements if attribute in known]
