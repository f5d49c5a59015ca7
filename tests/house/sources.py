"""The project's modules as text: what they import, and the functions that others may call."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.data_dir import ROOT

LAYERS = ("mpm", "fem_reference", "reports", "calib", "studies", "intsim", "cutcal")
"""The packages, lowest first."""


@cache
def modules() -> dict[str, Path]:
    """The file of each module, by its dotted name; a package stands for its ``__init__.py``."""
    files = [path for package in LAYERS for path in sorted((ROOT / package).rglob("*.py"))]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in files}


@cache
def tree(path: Path) -> ast.Module:
    """A module's syntax."""
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(name: str, *, loading: bool = False) -> set[str]:
    """Modules of the project that a module imports.

    Args:
        name: Dotted name.
        loading: Only those that are imported when it is loaded: not within functions, and not for annotations alone.
    """
    out: set[str] = set()
    waiting: list[ast.AST] = [tree(modules()[name])]
    while waiting:
        node = waiting.pop()
        if loading and isinstance(node, (ast.FunctionDef, ast.Lambda)):
            continue
        if loading and isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            out |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            out |= {one if one in modules() else node.module for one in whole}
        waiting += ast.iter_child_nodes(node)
    return {one for one in out if one in modules() and one != name}


def functions(helpers: tuple[str, ...] = ()) -> Iterator[tuple[str, ast.FunctionDef, list[ast.arg]]]:
    """Public functions and methods: place, syntax, and arguments without ``self``.

    Args:
        helpers: Packages and modules whose functions are wanted that are not public, in place of the public ones.
    """
    for name, path in modules().items():
        if helpers and not any(f"{name}.".startswith(f"{one}.") for one in helpers):
            continue
        found: list[tuple[ast.AST, bool]] = [(node, False) for node in tree(path).body]
        while found:
            node, method = found.pop()
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found += [(one, True) for one in node.body]
            elif isinstance(node, ast.FunctionDef) and node.name.startswith("_") == bool(helpers):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                own = method and bool(arguments) and arguments[0].arg in ("self", "cls")
                yield f"{name}.{node.name}", node, arguments[own:]
