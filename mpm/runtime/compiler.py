"""What Taichi's front end, which reads the Python of a kernel, does once instead of for each call of a function.

It reads a kernel in every process, also one whose machine code is in the cache, because the code's key is what it has
read. That is most of the time before the first step. Nothing here changes what is read.
"""

from __future__ import annotations

import ast
import functools
import linecache
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

Lines = tuple[list[str], int]


def quicken_front_end() -> None:
    """Let Taichi declare functions without a look at the source, read each once, and name a statement by its line.

    For each call and each copy of an unrolled loop Taichi 1.7 reads the function's source again, wraps its lines,
    parses them and draws a caret under each expression, for messages that nobody sees. For each function that is
    declared it looks for the source of the line from which the declaration was called, to see whether that begins a
    class; here the frame tells. Where Taichi is not as it was in 1.7 nothing is done.
    """
    try:
        import taichi as ti
        from taichi.lang import kernel_impl
        from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext as Context
        from taichi.lang.ast.ast_transformer_utils import Builder

        if ti.__version__[:2] != (1, 7) or hasattr(kernel_impl.getsourcelines, "cache_info"):
            return
        lines, file = kernel_impl.getsourcelines, kernel_impl.getsourcefile
        transform, parse, build = kernel_impl.transform_tree, kernel_impl.ast.parse, Builder.__call__
        fill, dedent, _ = kernel_impl.textwrap.fill, kernel_impl.textwrap.dedent, kernel_impl._inside_class
    except (ImportError, AttributeError):
        return
    spare: dict[str, list[ast.Module]] = {}  # trees that are not being transformed, by their source

    def parse_once(text: str) -> ast.Module:
        kept = spare.setdefault(text, [])
        if kept:
            return kept.pop()
        tree: Any = parse(text)
        tree.kept, tree.attributes = kept, [node for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
        return tree

    def transform_and_keep(tree: Any, context: Any) -> Any:
        out = transform(tree, context)
        if not context.is_kernel:  # a kernel's tree loses its arguments
            for node in tree.attributes:  # the one thing on a node that is set in one pass and asked for in another
                node.__dict__.pop("caller", None)
            tree.kept.append(tree)
        return out

    def build_at_statement(self: Any, context: Any, node: ast.AST) -> Any:
        method = getattr(self, f"build_{type(node).__name__}", None) if isinstance(node, ast.expr) else None
        return build(self, context, node) if method is None else method(context, node)

    def get_pos_info(self: Any, node: Any) -> str:
        where = f'File "{self.file}", line {node.lineno + self.lineno_offset}, in {self.func.func.__name__}:'
        return f"{where}\n{self.src[node.lineno - 1].rstrip()}\n"

    def inside_class(level_of_class_stackframe: int) -> bool:
        return "__qualname__" in sys._getframe(level_of_class_stackframe - 1).f_locals  # set in the body of a class

    kernel_impl._inside_class = inside_class
    kernel_impl.getsourcelines = functools.cache(lambda function: _lines(function, lines))
    kernel_impl.getsourcefile = functools.cache(file)
    kernel_impl.textwrap = SimpleNamespace(fill=functools.cache(fill), dedent=dedent)
    kernel_impl.ast = SimpleNamespace(parse=parse_once)
    kernel_impl.transform_tree = transform_and_keep
    Builder.__call__ = build_at_statement
    Context.get_pos_info = get_pos_info


def _lines(function: Any, otherwise: Callable[[Any], Lines]) -> Lines:
    """Lines of a function and the number of the first; those of a file are found all at once."""
    code = function.__code__
    last = _ends(code.co_filename).get(code.co_firstlineno)
    if last is None:
        return otherwise(function)
    return linecache.getlines(code.co_filename)[code.co_firstlineno - 1 : last], code.co_firstlineno


@functools.cache
def _ends(file: str) -> dict[int, int]:
    """Last line of each function of a file by the line of its first decorator, empty where there is no such file."""
    try:
        tree = ast.parse("".join(linecache.getlines(file)))
    except (SyntaxError, ValueError):
        return {}
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
            found[first] = node.end_lineno or node.lineno
    return found
