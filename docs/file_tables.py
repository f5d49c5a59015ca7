"""Write the tables of docs/files.md that tell what is in an HDF5 file: python docs/file_tables.py

The words are those that the files themselves carry, so that page and file say the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from calib.io.meaning import Meaning
from calib.material.properties import DIMENSIONS, FORM, PROPERTIES, SPECIMEN
from calib.simulation.evaluation_meanings import ATTRIBUTES, FIXED, SCALARS
from calib.simulation.record_file import CHECKSUM, record_meanings
from intsim.data.shard_meanings import COLUMNS, GROUP_ATTRIBUTES, SURFACE
from mpm.output.record import ForceRecord

PAGE = Path(__file__).with_name("files.md")
BEGIN, END = "<!-- table: {} -->\n", "<!-- end -->\n"
SETS = "| data set | shape | unit | meaning |\n|---|---|---|---|\n"
PLAIN = "| attribute | unit | meaning |\n|---|---|---|\n"


def data_sets(meanings: Mapping[str, Meaning], group: str = "") -> str:
    """A table of data sets, whose paths begin with the group."""
    lines = [f"| `{group}{name}` | {one.shape} | {one.unit} | {one.text} |\n" for name, one in meanings.items()]
    return SETS + "".join(lines)


def attributes(meanings: Mapping[str, Meaning]) -> str:
    """A table of attributes."""
    return PLAIN + "".join(f"| `{name}` | {one.unit} | {one.text} |\n" for name, one in meanings.items())


def tables() -> dict[str, str]:
    """Every table of the page by its name."""
    known = {
        name: Meaning(rule.unit, rule.meaning, "(n,)")
        for name, rule in (PROPERTIES | DIMENSIONS | FORM | SPECIMEN).items()
    }
    record = record_meanings()
    arrays = {f.name for f in fields(ForceRecord) if "ndarray" in str(f.type)}
    whole = {name: one for name, one in record.items() if name in arrays or name.startswith("section/")}
    rest = {name: one for name, one in record.items() if name not in whole and name != "section"}
    rest = {name: one for name, one in rest.items() if name != CHECKSUM} | {CHECKSUM: rest[CHECKSUM]}
    return {
        "evaluations": data_sets(FIXED),
        "scalars": data_sets(SCALARS, "scalars/"),
        "parameters": data_sets(known, "parameters/"),
        "store attributes": attributes(ATTRIBUTES),
        "record": data_sets(whole),
        "record attributes": attributes(rest),
        "shard": data_sets(COLUMNS),
        "surface": data_sets(SURFACE, "mpm/surface/C/"),
        "shard attributes": attributes(GROUP_ATTRIBUTES),
    }


def with_tables(text: str) -> str:
    """The page with its tables anew.

    Args:
        text: The page.

    Returns:
        The page; the same where nothing has changed.
    """
    for name, table in tables().items():
        before, begin, rest = text.partition(BEGIN.format(name))
        _, end, after = rest.partition(END)
        assert begin and end, name
        text = f"{before}{begin}\n{table}\n{end}{after}"
    return text


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
