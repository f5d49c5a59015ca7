"""The directive ``documents``: the keys of every JSON document, written from its schema."""

from __future__ import annotations

from typing import Any

from document_keys import section
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from calib.io.schema import names


class Documents(SphinxDirective):
    """A section for each document, with its keys."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        return self.parse_text_to_nodes("\n".join(map(section, names())), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, Any]:
    """Make the directive known."""
    app.add_directive("documents", Documents)
    return {"parallel_read_safe": True, "env_version": 1}
