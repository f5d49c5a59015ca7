"""Any fault in any format: the peak is right to 3 %, or a note says what was found, or one line refuses the record.

The inputs are the same in every run; ``-m long`` draws a thousand of them.
"""

from __future__ import annotations

import functools
import io
import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from calib.errors import TraceError
from calib.trace.conditioning import condition
from calib.trace.cuts import find_cuts
from calib.trace.trace import read_trace
from tests.calib.made_cuts import Cut, made_cut

OFF = 0.03
"""Part of the peak by which it may be off without a word."""
LONGEST = 500
"""Letters of an error that are still one sentence with its remedy."""
OF_THE_FORMAT = (
    "is in g",
    "is in lbf",
    "follow a comma",
    "above the header",
    "not UTF-8",
    "UTF-16",
    "negative downwards",
)
"""Words of notes about the format, which say nothing of a fault."""
Fault = Callable[[Cut, np.random.Generator], Cut]


def _index(rng: np.random.Generator, low: float = 0.1, high: float = 0.8) -> int:
    return int(rng.integers(int(low * 640), int(high * 640)))


def _kept(cut: Cut, keep: np.ndarray) -> Cut:
    return Cut(cut.time[keep], cut.force[keep], cut.height[keep])


def _nothing(cut: Cut, rng: np.random.Generator) -> Cut:
    return cut


def _spike(cut: Cut, rng: np.random.Generator) -> Cut:
    force = cut.force.copy()
    i, n = _index(rng), int(rng.integers(1, 4))
    force[i : i + n] = rng.choice([0.0, 9999.0, -9999.0, 1e3, 60.0])
    return cut.but(force=force)


def _gap(cut: Cut, rng: np.random.Generator) -> Cut:
    keep = np.ones(640, dtype=bool)
    i = _index(rng)
    keep[i : i + int(rng.integers(6, 120))] = False
    return _kept(cut, keep)


def _clipped(cut: Cut, rng: np.random.Generator) -> Cut:
    level = float(np.median(cut.force[:100]))
    return cut.but(force=np.minimum(cut.force, level + rng.uniform(0.3, 1.1) * (cut.force.max() - level)))


def _frozen(cut: Cut, rng: np.random.Generator) -> Cut:
    force, i = cut.force.copy(), _index(rng)
    force[i : i + int(rng.integers(8, 120))] = force[i]
    return cut.but(force=force)


def _tare(cut: Cut, rng: np.random.Generator) -> Cut:
    level = float(np.median(cut.force[:100]))
    return cut.but(force=np.where(np.arange(640) < rng.integers(30, 180), cut.force, cut.force - level))


def _shift(cut: Cut, rng: np.random.Generator) -> Cut:
    i = _index(rng, 0.35, 0.78)
    moved = cut.force - (cut.force[i] if rng.random() < 0.5 else rng.choice([-6.0, -3.0, 3.0, 6.0]))
    return cut.but(force=np.where(np.arange(640) < i, cut.force, moved))


def _lost_place(cut: Cut, rng: np.random.Generator) -> Cut:
    return cut.but(height=np.where(np.arange(640) == _index(rng), rng.choice([0.0, 1.0, -0.2]), cut.height))


def _fallen_out(cut: Cut, rng: np.random.Generator) -> Cut:
    i = _index(rng)
    return cut.but(force=np.where((np.arange(640) >= i) & (np.arange(640) < i + rng.integers(8, 80)), 0.0, cut.force))


def _drift(cut: Cut, rng: np.random.Generator) -> Cut:
    return cut.but(force=cut.force + rng.uniform(-1.0, 1.0) * cut.time)


def _coarse(cut: Cut, rng: np.random.Generator) -> Cut:
    step = float(rng.choice([0.1, 0.25, 0.5, 1.0]))
    return cut.but(force=np.round(cut.force / step) * step)


def _jump(cut: Cut, rng: np.random.Generator) -> Cut:
    return cut.but(time=cut.time + np.where(np.arange(640) > _index(rng), rng.uniform(0.1, 20.0), 0.0))


def _jump_back(cut: Cut, rng: np.random.Generator) -> Cut:
    return cut.but(time=cut.time - np.where(np.arange(640) > _index(rng, 0.4), rng.uniform(0.01, 0.5), 0.0))


def _slow_clock(cut: Cut, rng: np.random.Generator) -> Cut:
    tick = 0.005 * int(rng.integers(2, 6))
    return cut.but(time=np.floor(cut.time / tick + 1e-9) * tick)


def _twice(cut: Cut, rng: np.random.Generator) -> Cut:
    i = _index(rng)
    return _kept(cut, np.r_[0:i, i - 1 : 640])


def _again(cut: Cut, rng: np.random.Generator) -> Cut:
    other = made_cut(peak=float(rng.uniform(4.0, 20.0)), seed=7)
    late = other.time + (3.2 if rng.random() < 0.5 else 0.0)
    return Cut(*(np.r_[a, b] for a, b in ((cut.time, late), (cut.force, other.force), (cut.height, other.height))))


def _trigger(cut: Cut, rng: np.random.Generator) -> Cut:
    return _kept(cut, np.arange(640) >= int(rng.integers(190, 260)))


def _board(cut: Cut, rng: np.random.Generator) -> Cut:
    deep = np.where((cut.height < cut.height.min() + 5e-4) & (cut.time < 2.6), 1.0, 0.0)
    return cut.but(force=cut.force + deep * rng.uniform(5.0, 40.0) * (cut.height.min() + 5e-4 - cut.height) / 5e-4)


FAULTS: tuple[Fault, ...] = (
    _nothing, _spike, _gap, _clipped, _frozen, _tare, _drift, _coarse, _jump, _jump_back, _slow_clock, _twice, _again,
    _trigger, _board, _shift, _lost_place, _fallen_out,
)  # fmt: skip


def _frame(cut: Cut) -> pd.DataFrame:
    return pd.DataFrame({"time_s": cut.time.round(6), "force_N": cut.force.round(6), "position_m": cut.height.round(8)})


def _csv(folder: Path, cut: Cut, **how: str) -> Path:
    path = folder / "cut.csv"
    _frame(cut).to_csv(path, index=False, **how)
    return path


def _german(folder: Path, cut: Cut) -> Path:
    path = folder / "cut.csv"
    text = _frame(cut).to_csv(index=False, sep=";", decimal=",").partition("\n")[2]
    path.write_bytes(f"Pr\u00fcfer;M\u00fcller\nZeit time;Kraft force;Weg position\ns;N;m\n{text}".encode("cp1252"))
    return path


def _grams(folder: Path, cut: Cut) -> Path:
    path = folder / "cut.txt"
    frame = pd.DataFrame(
        {"Time (ms)": 1e3 * cut.time, "Load [gf]": cut.force / 9.80665e-3, "Extension(mm)": cut.depth_mm}
    )
    path.write_bytes(frame.to_csv(index=False, sep="\t").encode("utf-16"))
    return path


def _negative(folder: Path, cut: Cut) -> Path:
    path = folder / "cut.csv"
    rows = io.StringIO()
    np.savetxt(rows, np.column_stack([cut.time, cut.force, -cut.depth_mm]), delimiter=",", fmt="%.6f")
    path.write_text(f'"Specimen","1"\n"Time","Load","Extension"\n"(s)","(N)","(mm)"\n{rows.getvalue()}')
    return path


def _json(folder: Path, cut: Cut) -> Path:
    path = folder / "cut.json"
    lists = {"time": cut.time.tolist(), "force": (cut.force / 4.4482216152605).tolist(), "height": cut.height.tolist()}
    path.write_text(json.dumps({"log": lists, "units": {"time": "s", "force": "lbf", "height": "m"}}))
    return path


def _hdf5(folder: Path, cut: Cut) -> Path:
    path = folder / "cut.h5"
    with h5py.File(path, "w") as file:
        for name, x, unit in (("t", cut.time, "s"), ("load", 100.0 * cut.force, "cN"), ("z", 1e3 * cut.height, "mm")):
            file.create_dataset(name, data=x).attrs["unit"] = unit
    return path


def _matlab(folder: Path, cut: Cut) -> Path:
    savemat(folder / "cut.mat", {name: x.to_numpy() for name, x in _frame(cut).items()})
    return folder / "cut.mat"


FORMATS: tuple[Callable[[Path, Cut], Path], ...] = (_csv, _german, _grams, _negative, _json, _hdf5, _matlab)
NAMED = {"_german": {"time_col": "Zeit time", "force_col": "Kraft force", "position_col": "Weg position"}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for one file at a time."""
    return tmp_path_factory.mktemp("faults")


@functools.cache
def true_peak(level: float, peak: float, seed: int) -> float:
    """Peak [N] of a cut without faults."""
    return condition(made_cut(level=level, peak=peak, seed=seed).trace()).peak_N


def never_off_unsaid(folder: Path, data: st.DataObject) -> None:
    """One cut with up to two faults, written in one format."""
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    level, peak = data.draw(st.sampled_from((3.0, -4.0, 0.0))), data.draw(st.sampled_from((12.0, 5.0, 25.0)))
    seed = data.draw(st.integers(0, 50))
    cut, true = made_cut(level=level, peak=peak, seed=seed), true_peak(level, peak, seed)
    faults = data.draw(st.lists(st.sampled_from(FAULTS), min_size=1, max_size=1))
    for fault in faults:
        cut = fault(cut, rng)
    write = data.draw(st.sampled_from(FORMATS))
    plain = write is _csv
    named = dict(NAMED.get(write.__name__, {}))
    speed = None
    if plain and data.draw(st.booleans()):
        named["position_col"], speed = "none", 0.02
    path = write(folder, cut)
    try:
        done = condition(read_trace(path, **named), speed=speed)
    except TraceError as error:
        message = str(error)
        assert path.name in message and "\n" not in message and len(message) <= LONGEST, message
        return
    said = [note for note in done.warnings if not any(words in note for words in OF_THE_FORMAT)]
    names = [fault.__name__ for fault in faults]
    assert abs(done.peak_N / true - 1.0) <= OFF or said, (
        names,
        write.__name__,
        speed,
        done.peak_N,
        true,
        done.warnings,
    )
    assert len(find_cuts(done.trace)) == 1 or done.trace.whole


def _settings(count: int) -> settings:
    return settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        phases=(Phase.generate,),  # to shrink an example would take minutes
        suppress_health_check=list(HealthCheck),
    )


@_settings(15)
@given(st.data())
def test_no_peak_is_off_without_a_word(folder: Path, data: st.DataObject) -> None:
    """A few of them."""
    never_off_unsaid(folder, data)


@pytest.mark.long
@_settings(1000)
@given(st.data())
def test_no_peak_of_a_thousand_files_is_off_without_a_word(folder: Path, data: st.DataObject) -> None:
    """A thousand of them."""
    never_off_unsaid(folder, data)
