"""A thousand malformed and odd files: each gives something usable or one clear error, and nothing else.

The inputs are the same in every run. ``CUTCAL_FUZZ=20`` draws twenty times as many, other ones each time.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from calib.material.food import FoodSpec, load_foods, load_material_file
from calib.material.knife import load_knife
from calib.trace.conditioning import Conditioned, condition
from calib.trace.filters import N_STROKE
from calib.trace.trace import MIN_SAMPLES, read_trace
from cutcal.main import main
from mpm.scene import Knife
from mpm.scene.errors import CutcalError
from tests.data_dir import ROOT

MORE = int(os.environ.get("CUTCAL_FUZZ", "0"))
LONGEST = 500
"""Letters of an error that are still one sentence with its remedy."""
SPEED = 0.02
Columns = dict[str, list[Any]]


def examples(count: int) -> Any:
    """Settings of a property with so many inputs."""
    return settings(
        max_examples=count * max(MORE, 1),
        derandomize=not MORE,
        database=None,
        deadline=None,
        phases=(Phase.generate,),  # to shrink an example would take minutes
        suppress_health_check=list(HealthCheck),
    )


def survives(name: str, call: Callable[[], Any], check: Callable[[Any], None]) -> str | None:
    """Call; what comes back must pass the check, else there must be one clear error, which is returned."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("default", DeprecationWarning)
        try:
            result = call()
        except CutcalError as error:
            message = str(error)
            assert name in message, message
            assert len(message.splitlines()) == 1 and message.isprintable(), message
            assert len(name) + 10 < len(message) <= LONGEST, message
            return message
    check(result)
    return None


# Traces


@st.composite
def cuts(draw: st.DrawFn) -> Columns:
    """A cut that could be real: a flat start, a rise, a plateau, with noise; a position or not; sometimes odd as a whole."""
    odd = draw(st.integers(0, 3)) == 0
    n = draw(st.sampled_from((120, 400, 60, MIN_SAMPLES) if odd else (120, 400, 60)))
    before = draw(st.sampled_from((6, 2, 0, n - 2, n) if odd else (n // 4, n // 3, n // 2)))
    dt = draw(st.sampled_from((0.005, 0.01, 0.02)))
    noise = draw(st.sampled_from((0.0, 1e-6, 3.0) if odd else (0.05, 0.01)))
    peak = draw(st.sampled_from((0.2, -15.0, 2e4) if odd else (15.0, 40.0, 300.0)))
    rise = np.clip((np.arange(n) - before) / (n // 3), 0.0, 1.0)
    force = 5.0 + peak * rise + noise * np.random.default_rng(n).normal(size=n)
    columns = {"time_s": (dt * np.arange(n)).tolist(), "force_N": force.tolist()}
    axis = draw(st.sampled_from((None, "ee_z_m", "stroke_m", "position_mm", "z_m" if odd else None)))
    if axis is not None:
        way = 0.03 * np.arange(n) / n
        columns[axis] = {"ee_z_m": 0.1 - way, "stroke_m": way, "position_mm": -1e3 * way, "z_m": way}[axis].tolist()
    return columns


CELLS = st.one_of(
    st.sampled_from(
        ("", " ", "nan", "inf", "-inf", "oops", "1,5", "0x10", "1e400", "1_0", "--", '"', "'", "\u0661", "NULL")
    ),
    st.sampled_from((None, True, float("nan"), float("inf"), 1e308, -1e308, 1e-320, 1e18, 0, -1, 2**70, 10**400)),
    st.lists(st.just(1.0), max_size=3),
    st.text(max_size=5),
)
FACTORS = (1e3, 1e-3, 1e6, 1e-6, 1e9, 1e300, 1e-300, 0.0, -1.0)
NAMES = ("", "time_s", "force_N", "t", "force_kN", "Force [N]", "fz_N", "base_Fz_N", "ee_z_m", "%time", "__time", "field.header.stamp",
         "a,b", "a\nb", "x" * 300, "\u00e9\u2028", "O_F_ext_hat_K", "time_ms", "\x07")  # fmt: skip


def _set_cell(draw: st.DrawFn, columns: Columns) -> None:
    name = draw(st.sampled_from(list(columns)))
    rows = len(columns[name])
    for _ in range(draw(st.integers(1, 3))):
        if rows:
            columns[name][draw(st.integers(0, rows - 1))] = draw(CELLS)


def _scale(draw: st.DrawFn, columns: Columns) -> None:
    name, factor = draw(st.sampled_from(list(columns))), draw(st.sampled_from(FACTORS))
    columns[name] = [x * factor if isinstance(x, float) else x for x in columns[name]]


def _shift(draw: st.DrawFn, columns: Columns) -> None:
    name, shift = draw(st.sampled_from(list(columns))), draw(st.sampled_from((12460.0, 1.62e9, -5.0, 1e15, 1e5)))
    columns[name] = [x + shift if isinstance(x, float) else x for x in columns[name]]


def _rows(draw: st.DrawFn, columns: Columns) -> None:
    how = draw(st.sampled_from(("repeat", "reverse", "drop", "few", "restart", "gap")))
    for name, x in columns.items():
        k = len(x) // 2
        columns[name] = {
            "repeat": x[:k] + x[k - 1 :],
            "reverse": x[::-1],
            "drop": x[: k // 2],
            "few": x[:2],
            "restart": x + x,
            "gap": x[: k // 2] + x[k:],
        }[how]


def _force(draw: st.DrawFn, columns: Columns) -> None:
    name = list(columns)[min(1, len(columns) - 1)]
    x = np.array([v if isinstance(v, float) else 0.0 for v in columns[name]])
    n = len(x)
    how = draw(
        st.sampled_from(("constant", "noise", "steps", "spike", "alternate", "clock", "zero", "tiny", "late", "wave"))
    )
    noise = np.random.default_rng(3).normal(size=n)
    with np.errstate(all="ignore"):
        made = {
            "constant": np.full(n, 7.0),
            "noise": noise,
            "steps": np.round(x / 5.0) * 5.0,
            "spike": np.where(np.arange(n) == n // 2, 50.0, 0.0),
            "alternate": np.where(np.arange(n) % 2, 20.0, -20.0),
            "clock": 0.01 * np.arange(n),
            "zero": np.zeros(n),
            "tiny": 1e-12 * np.nan_to_num(x),
            "late": np.where(np.arange(n) > n - 3, 20.0, 0.0),
            "wave": 10.0 * np.sin(np.arange(n)),
        }[how]
    columns[name] = made.tolist()


def _header(draw: st.DrawFn, columns: Columns) -> None:
    old = draw(st.sampled_from(list(columns)))
    new = draw(st.one_of(st.sampled_from(NAMES), st.text(max_size=8)))
    items = [(new if name == old else name, x) for name, x in columns.items()]
    columns.clear()
    columns |= items


def _swap(draw: st.DrawFn, columns: Columns) -> None:
    names = draw(st.permutations(list(columns)))
    items = list(zip(names, columns.values(), strict=True))
    columns.clear()
    columns |= items


def _lose(draw: st.DrawFn, columns: Columns) -> None:
    if len(columns) > 1:
        del columns[draw(st.sampled_from(list(columns)))]


def _uneven(draw: st.DrawFn, columns: Columns) -> None:
    name = draw(st.sampled_from(list(columns)))
    columns[name] = columns[name][: -draw(st.integers(1, 3))]


CHANGES = (_set_cell, _set_cell, _scale, _shift, _rows, _force, _header, _swap, _lose)


@st.composite
def changed(draw: st.DrawFn, *more: Callable[[st.DrawFn, Columns], None]) -> Columns:
    """A cut with up to three things changed."""
    columns = draw(cuts())
    for change in draw(st.lists(st.sampled_from((*CHANGES, *more)), max_size=2)):
        change(draw, columns)
    return columns


@st.composite
def noisy(draw: st.DrawFn, raw: bytes) -> bytes:
    """A file that is cut off, or in which bytes were changed, doubled or lost."""
    how = draw(st.sampled_from(("nothing",) * 12 + ("truncate", "replace", "replace", "insert", "double", "lines")))
    at = draw(st.integers(0, len(raw)))
    if how == "truncate":
        return raw[:at]
    if how == "insert":
        return raw[:at] + draw(st.binary(min_size=1, max_size=8)) + raw[at:]
    if how == "double":
        return raw[:at] + raw[at // 2 :]
    if how == "replace":
        old, new = draw(st.sampled_from(((b",", b";"), (b",", b"\t"), (b",", b" "), (b".", b","), (b"\n", b"\r\n"), (b"\n", b"\r"),
                                         (b"\n", b"\n\n"), (b"1", b'"'), (b"\n", b",\n"), (b"0", b"\0"), (b"-", b"\xff"),
                                         (b"_", b" "), (b"\n", b"\x0c"), (b"e", b"E"), (b"5", b"'"))))  # fmt: skip
        return raw.replace(old, new, draw(st.sampled_from((-1, 1, 5))))
    if how == "lines":
        lines = raw.split(b"\n")
        return b"\n".join(
            [*lines[: at % 3], draw(st.sampled_from((b"# label: odd", b"#", b"", b"# label: reconstructed"))), *lines]
        )
    return raw


def usable(done: Conditioned) -> None:
    """What a conditioned cut must be, whatever it was made from."""
    trace = done.trace
    assert len(trace.time) == len(trace.force) >= MIN_SAMPLES
    assert len(trace.sha256) == 64 and trace.source
    assert done.stroke.shape == done.curve.shape == (N_STROKE,)
    assert done.stroke[0] == 0.0 and np.all(np.diff(done.stroke) > 0.0)
    for values in (trace.time, trace.force, done.force, done.stroke, done.curve):
        assert np.all(np.isfinite(values))
    assert trace.time[0] <= done.onset_s <= done.end_s <= trace.time[-1]
    assert done.stroke_length_m == pytest.approx(done.stroke[-1])
    assert 0.0 < done.peak_N < 1e4
    for spread in (done.baseline_sd_N, done.onset_sd_s, done.noise_sd_N, done.peak_sd_N):
        assert np.isfinite(spread) and spread >= 0.0
    assert np.isfinite(done.baseline_N) and np.isfinite(done.drift_N_per_s)
    for text in done.warnings:
        assert len(text.splitlines()) == 1 and len(text) <= LONGEST


def try_trace(source: Any, name: str) -> str | None:
    """Read and condition."""
    return survives(name, lambda: condition(read_trace(source), speed=SPEED), usable)


def csv_of(columns: Columns) -> bytes:
    """The columns as CSV, as they would be written without a thought."""
    rows = zip(*columns.values(), strict=False)
    text = "\n".join([",".join(columns), *(",".join("" if x is None else str(x) for x in row) for row in rows)])
    return text.encode("utf-8", "replace")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for one file at a time."""
    return tmp_path_factory.mktemp("malformed")


@examples(400)
@given(st.data())
def test_csv_traces(folder: Path, data: st.DataObject) -> None:
    """Changed cells, rows, headers, units and bytes of CSV files."""
    path = folder / "cut.csv"
    path.write_bytes(data.draw(noisy(csv_of(data.draw(changed())))))
    try_trace(path, "cut.csv")


@examples(150)
@given(st.data())
def test_json_traces(folder: Path, data: st.DataObject) -> None:
    """The same in JSON, as lists, as records, as a record a line."""
    columns = data.draw(changed(_uneven))
    records = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=False)]
    layout = data.draw(st.sampled_from(("lists", "records", "lines", "group")))
    text = {
        "lists": json.dumps(columns),
        "records": json.dumps(records),
        "lines": "\n".join(json.dumps(record) for record in records),
        "group": json.dumps({"log": columns, "rate": 200, "robot": ["a", "b"]}),
    }[layout]
    path = folder / data.draw(st.sampled_from(("cut.json", "cut.txt")))
    path.write_bytes(data.draw(noisy(text.encode())))
    try_trace(path, path.name)


@examples(150)
@given(st.data())
def test_hdf5_traces(folder: Path, data: st.DataObject) -> None:
    """The same in HDF5: columns or a structured data set, any type of number or text, at any address, cut off."""
    columns = data.draw(changed(_uneven))
    path = folder / "cut.h5"
    path.unlink(missing_ok=True)
    group = data.draw(st.sampled_from(("", "", "log", "a/b")))
    with h5py.File(path, "w") as file:
        place = file.require_group(group) if group else file
        for name, cells in columns.items():
            _write_set(place, name, cells, data)
    if data.draw(st.integers(0, 9)) == 0:
        raw = path.read_bytes()
        path.write_bytes(raw[: data.draw(st.integers(0, len(raw)))])
    address = data.draw(st.sampled_from(("", "", "", f":/{group}", ":/nowhere", ":/force_N")))
    try_trace(f"{path}{address}", "cut.h5")


def _write_set(place: h5py.Group, name: str, cells: list[Any], data: st.DataObject) -> None:
    """A data set with the cells as numbers if they are, else as text; sometimes of an odd type, with an odd unit."""
    name = name.replace("/", "_").replace("\0", "_") or "_"
    if name in place or name == ".":
        return
    try:
        values = np.array(cells, dtype=float)
    except (TypeError, ValueError, OverflowError):
        values = np.array([str(x).replace("\0", "").encode("utf-8", "replace") for x in cells], dtype=object)
    kind = data.draw(st.sampled_from(("",) * 20 + ("f2", "i4", "c8", "bool", "twice", "scalar")))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if values.dtype != object:
            if kind in ("f2", "i4", "c8", "bool"):
                values = np.nan_to_num(values).astype(kind)
            elif kind == "twice":
                values = np.column_stack([values, values, values])
            elif kind == "scalar":
                values = np.float64(values[0] if len(values) else 0.0)
            item = place.create_dataset(name, data=values)
        else:
            item = place.create_dataset(name, data=values, dtype=h5py.string_dtype())
    unit = data.draw(st.sampled_from((None,) * 20 + ("s", "N", "mm", "lbf", "", 3.0, b"ms", "x" * 400)))
    if unit is not None:
        item.attrs[data.draw(st.sampled_from(("unit", "units")))] = unit


@examples(100)
@given(st.data())
def test_frames(data: st.DataObject) -> None:
    """The same in DataFrames of any type, with any index."""
    columns = data.draw(changed())
    large = any(isinstance(x, int) and abs(x) > 2**63 for cells in columns.values() for x in cells)
    frame = pd.DataFrame(columns, dtype=object if large else None)  # pandas 2 has no numbers that large
    how = data.draw(st.sampled_from(("", "object", "str", "index", "dates", "named", "twice", "numbers")))
    if how in ("object", "str"):
        frame = frame.astype(how)
    elif how == "index":
        frame.index = pd.Index([f"r{i}" for i in frame.index])
    elif how == "dates":
        frame.index = pd.date_range("2024-01-01", periods=len(frame), freq="10ms", name="time")
    elif how == "named":
        frame = frame.set_index(frame.columns[0])
    elif how == "twice":
        frame = pd.concat([frame, frame], axis=1)
    elif how == "numbers":
        frame.columns = range(len(frame.columns))
    try_trace(frame, "DataFrame")


@examples(100)
@given(st.data())
def test_files_that_are_no_traces(folder: Path, data: st.DataObject) -> None:
    """Any bytes, any text and any document, under any of the suffixes."""
    plain = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5))
    tree = st.recursive(plain, lambda x: st.lists(x, max_size=4) | st.dictionaries(st.text(max_size=4), x, max_size=4))
    content = data.draw(
        st.one_of(
            st.binary(max_size=60),
            st.text(max_size=60).map(lambda t: t.encode("utf-8", "replace")),
            tree.map(lambda x: json.dumps(x).encode()),
            st.integers(1, 100_000).map(lambda n: b"[" * n),
            st.integers(1, 100_000).map(lambda n: b'{"a":' * n),
            st.binary(max_size=40).map(lambda b: b"\x89HDF\r\n\x1a\n" + b),
            st.integers(1, 200_000).map(lambda n: b"time_s,force_N\n" + b"1" * n),
            st.integers(2, 3000).map(lambda n: b",".join(b"c%d" % i for i in range(n)) + b"\n1,2\n"),
        )
    )
    path = folder / data.draw(st.sampled_from(("odd.csv", "odd.json", "odd.jsonl", "odd.h5", "odd", "odd.tsv")))
    path.write_bytes(content)
    try_trace(path, path.name)


# Foods and knives


VALUES = st.one_of(
    st.sampled_from((None, True, "", "soft", "3e5", "-1", float("nan"), float("inf"), -1.0, 0.0, 0.5, 0.7, 1e30, 10**400, [], {}, [1.0, 2.0])),
    st.sampled_from(("Pa", "kPa", "MPa", "m", "mm", "kg/m^3", "J/m^2", "-", "deg", "psi")),
    st.floats(),
    st.text(max_size=6),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)  # fmt: skip
KEYS = (
    "E",
    "youngs_modulus",
    "nu",
    "value",
    "low",
    "unit",
    "source",
    "calibration",
    "sources",
    "",
    "a\nb",
    "x" * 500,
    "no",
    "1",
)
LINES = ("\t- tab", "  bad: indent: here", "&a [*a, *a]", "x: *nowhere", "? [a, b]\n: c", "- list", "E: 1\nE: 2", "a: &a {b: *a}", "%YAML 9",
         "d: 2001-99-99", "d: !!int x", "d: !!float ''", "d: !!bool perhaps", "d: !!python/object:os.system {}", "d: !!timestamp now",
         "'unclosed", "...", "---", "\u0000", "\ufeff", "<<: 3", "k: !!binary '@'", "1: 2", "null: 3", "t: 1:99:99", "f: .inf")  # fmt: skip


@st.composite
def mutated(draw: st.DrawFn, document: dict[str, Any]) -> bytes:
    """A YAML file with keys dropped, renamed, doubled and values replaced, and then lines or bytes changed."""
    tree = json.loads(json.dumps(document))
    for _ in range(draw(st.integers(0, 3))):
        node = tree
        for _ in range(draw(st.integers(0, 3))):
            inner = [v for v in node.values() if isinstance(v, dict) and v]
            node = draw(st.sampled_from(inner)) if inner else node
        if not node:
            continue
        key = draw(st.sampled_from(list(node)))
        how = draw(st.sampled_from(("drop", "rename", "value", "value", "value", "add")))
        if how in ("drop", "rename"):
            value = node.pop(key)
        if how in ("rename", "add"):
            node[draw(st.sampled_from(KEYS))] = value if how == "rename" else draw(VALUES)
        if how == "value":
            node[key] = draw(VALUES)
    text = yaml.safe_dump(tree, allow_unicode=True, sort_keys=False)
    return draw(noisy(draw(lines_changed(text)).encode("utf-8", "replace")))


@st.composite
def lines_changed(draw: st.DrawFn, text: str) -> str:
    """Lines lost, doubled, moved to the right, replaced; anchors that grow without end, and deep nesting."""
    how = draw(
        st.sampled_from(
            ("nothing", "nothing", "nothing", "lose", "double", "indent", "line", "deep", "laughs", "replace")
        )
    )
    lines = text.split("\n")
    at = draw(st.integers(0, len(lines) - 1))
    if how == "lose":
        del lines[at]
    elif how == "double":
        lines.insert(at, lines[at])
    elif how == "indent":
        lines[at] = draw(st.sampled_from((" ", "\t", "    "))) + lines[at]
    elif how == "line":
        lines.insert(at, draw(st.sampled_from(LINES)))
    elif how == "deep":
        depth = draw(st.sampled_from((50, 400, 1000)))
        lines.append("deep: " + draw(st.sampled_from(("[" * depth, "{a: " * depth, "[" * depth + "]" * depth))))
    elif how == "laughs":
        grown = "\n".join(f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 9)}]" for i in range(1, 12))
        lines = ["calibration:", "  l0: &l0 ha", *(f"  {line}" for line in grown.split("\n")), *lines]
        old = draw(st.sampled_from(("unit: Pa", "unit: m", "kind: cylinder", "value: 0.033", "status: assumed")))
        lines = [line.replace(old, f"{old.partition(':')[0]}: *l11") for line in lines]
    elif how == "replace":
        old, new = draw(
            st.sampled_from(((": ", ":"), (": ", " "), ("'", ""), ("Pa", "kPa"), ("unit", "units"), (" m\n", " mm\n")))
        )
        return text.replace(old, new, draw(st.sampled_from((-1, 1))))
    return "\n".join(lines)


BANANA = {"banana": yaml.safe_load((ROOT / "materials.yaml").read_text(encoding="utf-8"))["banana"]}
KITCHEN = {"kitchen": yaml.safe_load((ROOT / "knives.yaml").read_text(encoding="utf-8"))["kitchen"]}


def sound(food: FoodSpec) -> None:
    """What a food must be, whatever file it comes from."""
    assert food.name and set(food.dims) == {"length", "width", "height"}
    for item in (*food.dims.values(), *food.properties.values()):
        assert np.all(np.isfinite([item.value, item.low, item.high])) and item.low <= item.high
        assert item.unit and item.source
    assert -1.0 < food.properties["nu"].value < 0.5
    for text in food.warnings():
        assert text
    scene = food.to_scene_food()
    assert scene.material.p_wave > 0.0 and scene.shape.height > 0.0


@examples(100)
@given(st.data())
def test_food_files(folder: Path, data: st.DataObject) -> None:
    """Foods of a calibrated material's file and of a list of foods."""
    path = folder / "food.yaml"
    path.write_bytes(data.draw(mutated(BANANA)))
    survives("food.yaml", lambda: load_material_file(path), sound)
    survives("food.yaml", lambda: load_foods(path), lambda foods: [sound(food) for food in foods.values()] and None)


def sharp(knife: Knife) -> None:
    """What a knife must be."""
    assert knife.name and 0.0 < knife.angle < 1.1
    for size in (knife.spine, knife.height, knife.length):
        assert 0.0 < size < 1.0


@examples(100)
@given(st.data())
def test_knife_files(folder: Path, data: st.DataObject) -> None:
    """A knife of one's own."""
    path = folder / "knife.yaml"
    path.write_bytes(data.draw(mutated(KITCHEN)))
    survives("knife.yaml", lambda: load_knife(path), sharp)


# The command line


@examples(20)
@given(st.data())
def test_command_line(folder: Path, capsys: pytest.CaptureFixture[str], data: st.DataObject) -> None:
    """A file that is refused ends ``cutcal calibrate`` with exit code 1 and one line, and leaves no folder."""
    trace, food, knife, out = (folder / name for name in ("c.csv", "f.yaml", "k.yaml", "out"))
    trace.write_bytes(csv_of(data.draw(cuts())))
    argv = ["calibrate", "--food", "banana", "--trace", str(trace), "--speed", "0.02", "--out", str(out)]
    what = data.draw(st.sampled_from(("trace", "trace", "food", "knife")))
    if what == "trace":
        trace.write_bytes(data.draw(noisy(csv_of(data.draw(changed())))))
        bad = try_trace(trace, "c.csv")
    elif what == "food":
        food.write_bytes(data.draw(mutated(BANANA)))
        bad = survives("f.yaml", lambda: load_material_file(food), sound)
        argv += ["--material", str(food)]
    else:
        trace.write_bytes((ROOT / "force_data" / "banana_reconstructed.csv").read_bytes())
        knife.write_bytes(data.draw(mutated(KITCHEN)))
        bad = survives("k.yaml", lambda: load_knife(knife), sharp)
        argv += ["--knife", str(knife)]
    assume(bad is not None)
    capsys.readouterr()
    assert main(argv) == 1
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line == f"cutcal: {bad}"
    assert not out.exists()
