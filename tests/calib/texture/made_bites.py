"""Made-up records of plates: bites and holds of bodies whose load is known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calib.texture.plate_record import PlateRecord, RecordedFile
from calib.texture.prony_series import PronySeries

HEIGHT = 0.01
DEPTH = 0.005


def record(time, way, load, name="made") -> PlateRecord:
    """A record of these columns, without a file."""
    file = RecordedFile(f"{name}.csv", "0" * 64, "time_s", "way_m", "load_N")
    return PlateRecord(name, np.asarray(time), np.asarray(way), np.asarray(load), HEIGHT, file)


def two_bites(descent: float = 1.0, *, rest: float = 0.2, samples: int = 400):
    """Time [s] and way [m] of a plate that goes down and back twice, with a rest before, between and behind."""
    d = descent
    corners = np.cumsum([0.0, rest * d, d, d, rest * d, d, d, rest * d])
    ways = DEPTH * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    time = np.unique(np.concatenate([np.linspace(0.0, corners[-1], int(samples * corners[-1] / d)), corners]))
    return time, np.interp(time, corners, ways)


def held(
    series: PronySeries, *, stiffness=2000.0, ramp=0.2, hold=60.0, step=0.02, noise=0.0, seed=0, rest=0.0
) -> PlateRecord:
    """A rest, a ramp and a hold of a body that relaxes."""
    time = np.arange(0.0, rest + ramp + hold, step)
    way = 0.3 * HEIGHT * np.clip((time - rest) / ramp, 0.0, 1.0)
    load = series.stress(time, stiffness * way) + noise * np.random.default_rng(seed).standard_normal(len(time))
    return record(time, way, load)


def write(path: Path, made: PlateRecord, *, lag: float = 0.0) -> Path:
    """A file as a rheometer writes it: tabs, a gap in micrometres that falls, load in newtons."""
    gap = 1e6 * (HEIGHT - np.interp(made.time - lag, made.time, made.way))
    rows = np.column_stack([made.time, made.load, gap])
    lines = ["time_s\tnormal_force_N\tgap_um", *("\t".join(f"{x:.7g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path
