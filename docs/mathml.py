"""Sphinx: formulas become MathML when the pages are built, so that the site needs no script and no network."""

from __future__ import annotations

from typing import Any

from docutils.nodes import SkipNode, math, math_block
from latex2mathml.converter import convert
from sphinx.application import Sphinx

WIDE = "overflow: auto hidden; padding: 0.4em 0"
"""Style of a formula of its own: one that is wider than the page is moved sideways."""


def inline(writer: Any, node: math) -> None:
    """A formula in a line."""
    writer.body.append(convert(node.astext()))
    raise SkipNode


def block(writer: Any, node: math_block) -> None:
    """A formula of its own."""
    writer.body.append(f'<div style="{WIDE}">{convert(node.astext(), display="block")}</div>')
    raise SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True}
