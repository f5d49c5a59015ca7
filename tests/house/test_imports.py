"""The house: packages in layers, imports that run down, no circle, and folders and modules that one can overlook."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping

import pytest

from tests.house.sources import LAYERS, imports, modules

BELOW = {
    "mpm": set(),
    "fem_reference": {"mpm"},
    "reports": {"mpm"},
    "calib": {"mpm", "fem_reference"},
    "studies": {"mpm", "fem_reference", "calib"},
    "intsim": {"mpm", "calib"},
    "cutcal": set(LAYERS),
}
"""What a package may import when it is loaded."""
WRITES = {"calib", "studies"}
"""Packages whose functions may load ``reports``, to write the report of what they have done."""
MODULES, LINES = 15, 400


def package(name: str) -> str:
    """The package of a module."""
    return name.partition(".")[0]


def room(name: str) -> str:
    """The folder of a module."""
    return name if modules()[name].name == "__init__.py" else name.rpartition(".")[0]


def circles(arrows: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Groups of names each of which leads to each other one (Tarjan 1972)."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    out: list[list[str]] = []

    def visit(v: str) -> None:
        number[v] = low[v] = len(number)
        stack.append(v)
        for w in sorted(arrows.get(v, ())):
            if w not in number:
                visit(w)
                low[v] = min(low[v], low[w])
            elif w in stack:
                low[v] = min(low[v], number[w])
        if low[v] == number[v]:
            group = [stack.pop()]
            while group[-1] != v:
                group.append(stack.pop())
            if len(group) > 1:
                out.append(sorted(group))

    for v in arrows:
        if v not in number:
            visit(v)
    return out


@pytest.mark.parametrize("name", LAYERS)
def test_loading_a_package_loads_only_what_is_below_it(name):
    """A module imports its own package and those below, at its top."""
    up = {
        f"{one} imports {other}"
        for one in modules()
        if package(one) == name
        for other in imports(one, loading=True)
        if package(other) not in BELOW[name] | {name}
    }
    assert up == set()


def test_a_function_imports_upwards_only_to_write_its_report():
    """``calib`` and ``studies`` load ``reports`` when there is something to report, and ``reports`` names ``calib`` in
    annotations alone."""
    up = {
        (package(one), package(other))
        for one in modules()
        for other in imports(one)
        if package(other) not in BELOW[package(one)] | {package(one)}
    }
    assert up <= {(name, "reports") for name in WRITES} | {("reports", name) for name in WRITES}


def test_no_circle_of_modules():
    """Wherever the import stands: at the top, within a function, or for annotations."""
    assert circles({name: imports(name) for name in modules()}) == []


def test_no_circle_of_rooms():
    """Within a package the folders are in an order too; what lies beside them is below all, as errors, or above all, as
    the face."""
    arrows: dict[str, set[str]] = {}
    for name in modules():
        inside = {room(other) for other in imports(name) if package(other) == package(name)}
        arrows.setdefault(room(name), set()).update(inside - {room(name), package(name)})
    arrows = {name: others for name, others in arrows.items() if name not in LAYERS}
    assert circles(arrows) == []


def test_circles_are_found():
    """The search for circles finds those that are there, and no other."""
    assert circles({"a": ["b"], "b": ["c"], "c": ["b"], "d": ["a"]}) == [["b", "c"]]
    assert circles({"a": ["b", "c"], "b": ["c"], "c": []}) == []


def test_folders_and_modules_can_be_overlooked():
    """At most fifteen modules in a folder, and 400 lines in a module."""
    held = Counter(room(name) for name, path in modules().items() if path.name != "__init__.py")
    assert {name: n for name, n in held.items() if n > MODULES} == {}
    lines = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in modules().items()}
    assert {name: n for name, n in lines.items() if n > LINES} == {}


def test_the_face_loads_nothing_heavy():
    """``from cutcal import ...`` knows the five names, and has loaded neither Taichi nor pandas nor matplotlib before
    they are used."""
    code = (
        "import sys, cutcal; assert not {'taichi', 'pandas', 'matplotlib', 'scipy'} & set(sys.modules); "
        "from cutcal import Calibration, Design, Food, Study, Trace; "
        "assert not {'taichi', 'matplotlib'} & set(sys.modules); "
        "print(Calibration.__name__, cutcal.__version__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()[:1]) == (0, ["Calibration"]), done.stderr


@pytest.mark.parametrize(
    ("code", "spared"),
    [
        (
            "from cutcal.main import parser; parser()",
            "taichi pandas matplotlib h5py scipy.interpolate scipy.stats scipy.signal scipy.spatial scipy.optimize",
        ),
        (
            "import calib.simulation.process_pool, mpm.solver",
            "pandas matplotlib scipy.interpolate scipy.stats scipy.signal scipy.spatial scipy.ndimage",
        ),
    ],
    ids=["the help", "a worker"],
)
def test_a_process_loads_what_it_needs(code, spared):
    """The help of all commands, and a further worker process, start without what takes long to import."""
    found = f"import sys; {code}; print(*sorted(set(sys.modules) & set({spared.split()})))"
    done = subprocess.run([sys.executable, "-c", found], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr
