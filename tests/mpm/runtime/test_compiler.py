"""What Taichi's front end does once: it finds the same source, and a function read twice means what it meant the first
time."""

import inspect

import numpy as np
import pytest
import taichi as ti
from taichi.lang import kernel_impl

from mpm.kernels.constitutive import laws
from mpm.kernels.p2g import p2g_particle
from mpm.runtime import Runtime, compiler, start
from mpm.step.time_step import time_step


@pytest.fixture(autouse=True, scope="module")
def running():
    """Taichi, started as for a scene."""
    start(Runtime(threads=1), "f64")


class Known:
    """Something of Python with a method of the name of a vector's."""

    def sum(self) -> float:
        """A number that is known when the kernel is read."""
        return 10.0


KNOWN = Known()


@ti.func
def total(a: ti.template()):
    """Sum of a vector, of a matrix, or of something of Python."""
    return a.sum()


@ti.func
def product(a, n: ti.template()):
    """n! a: a function that is read while it is being read."""
    out = a
    if ti.static(n > 1):
        out = n * product(a, n - 1)
    return out


@ti.data_oriented
class Scaled:
    """Numbers times a factor."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    @ti.func
    def times(self, a):
        """A number times the factor."""
        return self.factor * a

    @ti.kernel
    def square(self) -> ti.f64:
        """The factor times itself."""
        return self.times(self.factor)


@ti.kernel
def totals() -> ti.types.vector(3, ti.f64):
    """Of a vector, of something of Python, and of a matrix."""
    v, m = ti.Vector([2.0, 4.0]), ti.Matrix([[6.0, 8.0], [1.0, 3.0]])
    return ti.Vector([total(v), total(KNOWN), total(m)])


@ti.kernel
def products(a: ti.f64) -> ti.types.vector(2, ti.f64):
    """5! a and 3! a."""
    return ti.Vector([product(a, 5), product(a, 3)])


@ti.kernel
def wrong() -> ti.f64:
    """With a name that nobody knows."""
    return total(
        ti.Vector([1.0, nowhere])  # noqa: F821
    )


@pytest.mark.filterwarnings("ignore:.*non-taichi function")
def test_a_function_that_is_read_again_means_the_same():
    """With arguments of other kinds, and inside itself."""
    for _ in range(2):
        np.testing.assert_array_equal(totals().to_numpy(), [6.0, 10.0, 18.0])
        np.testing.assert_array_equal(products(3.0).to_numpy(), [360.0, 18.0])


def test_what_is_declared_in_a_class_takes_its_object():
    """Functions and kernels of a class are told from those of a module, and each object has its own."""
    assert (Scaled(3.0).square(), Scaled(5.0).square()) == (9.0, 25.0)


def test_a_tree_is_read_anew_only_while_it_is_in_use():
    """A function is parsed once, and once more for each reading inside another."""
    text = "def f():\n    return 1\n"
    parse = kernel_impl.ast.parse
    one, other = parse(text), parse(text)
    assert one is not other
    one.kept.append(one)
    assert parse(text) is one


@pytest.mark.parametrize("function", [p2g_particle, time_step, laws.unit, total, totals])
def test_the_source_is_that_of_inspect(function):
    """Lines and number of the first, decorators included."""
    plain = inspect.unwrap(function)
    assert compiler._lines(plain, None) == inspect.getsourcelines(plain)


def test_a_function_without_a_file_is_found_as_before():
    """What is not in a file is left to who finds it otherwise."""
    function = eval("lambda: 1")
    assert compiler._lines(function, lambda f: (["found"], 7)) == (["found"], 7)


def test_an_error_names_its_statement():
    """File, line and function of the statement in which a name is not known."""
    line = inspect.getsourcelines(inspect.unwrap(wrong))[1] + 3
    with pytest.raises(ti.TaichiCompilationError, match=rf'test_compiler.py", line {line}, in wrong:\n.*\n.*nowhere'):
        wrong()
