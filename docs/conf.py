"""Sphinx: how the pages of this folder become a site. ``sphinx-build -W -b html docs docs/_build/html`` builds it."""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.application import Sphinx

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

import cutcal  # noqa: E402

project = "cutcal"
author = "the cutcal developers"
project_copyright = author
version = release = cutcal.__version__

extensions = ["commands", "documents", "mathml", "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # notebooks are shown as they are kept; the tests run them
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
napoleon_use_ivar = True  # attributes of data classes are listed once, with what their class says of them
html_theme = "furo"
html_title = f"cutcal {release}"

# Files outside this folder that are pages of the site: a link to one works in the repository, and on the site to its
# page.
PAGES = {
    "../CHANGELOG.md": "changes.md",
    "../CONTRIBUTING.md": "contributing.md",
    "../force_data/SOURCES.md": "sources.md",
}


def link_pages(app: Sphinx, name: str, source: list[str]) -> None:
    """Point links to these files to their pages."""
    for outside, page in PAGES.items():
        source[0] = source[0].replace(f"]({outside})", f"]({page})")


def keep_colon(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Keep napoleon from taking what stands before a colon in a property's first line for its type."""
    if what == "property":
        lines.insert(0, "\\")  # an escaped line end, which is nothing: napoleon looks at the first line alone


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", link_pages)
    app.connect("autodoc-process-docstring", keep_colon, priority=400)
