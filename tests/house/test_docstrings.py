"""Docstrings of public functions with three arguments and more say what goes in, in which shape and unit, what comes
out, and what fails."""

from __future__ import annotations

import ast
import re

from tests.house.sources import functions

MANY = 3
ARRAY = re.compile(r"ndarray|FloatArray|NDArray|ArrayLike")
SHAPE, UNIT = re.compile(r"\(\w[^)]*\)|shape|scalar"), re.compile(r"\[[^\]]+\]")
HELPERS = ("reports.multi_specimen", "calib.multi_specimen.held_out")
"""Where functions that are not public say it too."""
COMPILED = {"ti.func", "ti.kernel"}
"""Decorators of functions in Taichi's language: their arguments are said in words where the step is described."""


def missing(node: ast.FunctionDef, arguments: list[ast.arg]) -> list[str]:
    """What a docstring does not say."""
    doc = ast.get_docstring(node) or ""
    found = re.search(r"^Args:\n((?:[ \t]+.*\n?|\n)*)", doc, re.MULTILINE)
    out = []
    for argument in arguments:
        # the line that names the argument, alone or with others, and what is indented below it
        entry = rf"^[ ]+[^\n:]*\b{re.escape(argument.arg)}\b[^\n:]*:(.*(?:\n[ ]{{8,}}.*)*)"
        said = re.search(entry, found[1] if found else "", re.MULTILINE)
        if said is None:
            out.append(argument.arg)
        elif argument.annotation is not None and ARRAY.search(ast.unparse(argument.annotation)):
            out += [] if SHAPE.search(said[0]) else [f"shape of {argument.arg}"]
            out += [] if UNIT.search(said[0]) else [f"unit of {argument.arg}"]
    if node.returns is not None and ast.unparse(node.returns) != "None":
        out += [] if re.search(r"^(Returns|Yields):", doc, re.MULTILINE) else ["what it returns"]
    fails = any(isinstance(one, ast.Raise) and one.exc is not None for one in ast.walk(node))
    out += [] if not fails or re.search(r"^Raises:", doc, re.MULTILINE) else ["what it raises"]
    return out


def test_public_functions_say_what_they_take_give_and_raise():
    """Each argument; shape and unit of arrays; what is returned; errors, where it raises any itself."""
    silent = {}
    for name, node, arguments in (*functions(), *functions(HELPERS)):
        if len(arguments) < MANY or COMPILED & {ast.unparse(one) for one in node.decorator_list}:
            continue
        if out := missing(node, arguments):
            silent[name] = ", ".join(out)
    assert silent == {}


def test_what_is_missing_is_seen():
    """A function that says nothing of an argument, a shape, a unit, its result or its error."""
    told = '''
def f(a: FloatArray, b: int, c: str) -> float:
    """A function.

    Args:
        a: Force, shape (n,) [N].
        b, c: Two more.

    Returns:
        A number.

    Raises:
        ValueError: When it must.
    """
    raise ValueError("no")
'''

    def gaps(text: str) -> list[str]:
        (node,) = ast.parse(text).body
        assert isinstance(node, ast.FunctionDef)
        return missing(node, node.args.args)

    assert gaps(told) == []
    assert gaps(told.replace("b, c:", "b:")) == ["c"]
    assert gaps(told.replace("shape (n,) ", "")) == ["shape of a"]
    assert gaps(told.replace(" [N]", "")) == ["unit of a"]
    assert gaps(told.replace("Returns:", "Gives:")) == ["what it returns"]
    assert gaps(told.replace("Raises:", "Errors:")) == ["what it raises"]
