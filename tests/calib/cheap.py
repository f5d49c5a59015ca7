"""Studies without their physics: a formula in place of the solver, in real worker processes, which write down what they
do."""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from calib.io.provenance import key_of
from calib.simulation import workers
from calib.simulation.dask_cluster import Cluster
from calib.simulation.evaluation import Evaluation
from calib.simulation.process_pool import Pool
from mpm.output.record import ForceRecord
from mpm.scene import Scene

LOG = "CHEAP_LOG"  # file in which each run says that it begins and that it has ended
SECONDS = "CHEAP_SECONDS"  # how long each run takes
ROWS = 200


def cut(scene: Scene) -> ForceRecord:
    """A plateau for R, a ramp for E and a little that depends on everything else [N]; the knife is 1 m/s fast.

    A blade that is withdrawn is held back by friction, in proportion to what its faces felt, and by adhesion.
    """
    m, shape = scene.food.material, scene.food.shape
    stroke = np.linspace(scene.motion.stroke / ROWS, scene.motion.stroke, ROWS)
    noise = np.random.default_rng(int(key_of(scene.as_dict())[:8], 16)).normal(0, 0.02)
    edge = shape.width * m.R * (1 - np.exp(-stroke / 2e-3)) + noise
    face = 2e-4 * shape.width * m.E * stroke / shape.height
    path = stroke
    if scene.motion.retract > 0.0:
        way = np.linspace(stroke[0], scene.motion.retract, ROWS)
        path, stroke = np.append(path, path[-1] + way), np.append(stroke, stroke[-1] - way)
        edge = np.append(edge, -30.0 * shape.width * m.adhesion_energy * np.ones(ROWS))
        face = np.append(face, -m.mu * 2e-4 * shape.width * m.E * stroke[ROWS:] / shape.height)
    rows = len(stroke)
    zero, up, nothing = np.zeros(rows), np.array([0.0, 0.0, 1.0]), np.zeros((rows, 3))
    return ForceRecord(
        **{"stroke": stroke, "command": stroke, "time": path, "rows_down": ROWS if rows > ROWS else None},
        **{
            name: zero
            for name in ("slide", "kinetic", "elastic", "plastic", "damage", "viscous", "friction", "moment", "tilt")
        },
        **{name: nothing for name in ("board", "gravity", "momentum", "dampers", "residual")},
        edge=edge[:, None] * up,
        face=face[:, None] * up,
        parting=np.cumsum((edge + face) * path[0]),
        **{"mass": 0.1, "lagging": True, "cell": scene.numerics.dx, "speed": 1.0, "dt": 1e-5},
        **{"steps": 1000, "particles": 100, "images": 4, "cells": 1000, "severed_area": 0.0, "pieces": None},
        **{"counters": {"inverted": 0, "outside": 0}, "wall": float(os.environ.get(SECONDS, 0.0))},
    )


def run(scene: Scene, values: dict[str, Any], arch: str, threads: int) -> Evaluation:
    """In place of the candidate of a search."""
    return workers.evaluation_of(_noted("run", scene.with_material(**values)))


def whole(scene: Scene, arch: str, threads: int) -> ForceRecord:
    """In place of a whole record."""
    return _noted("whole", scene)


def _noted(kind: str, scene: Scene) -> ForceRecord:
    record = cut(scene)
    name = f"{kind}:{record.peak!r}"  # which no other scene has
    _note(f"begin {name} {os.getpid()}")
    time.sleep(record.wall)
    _note(f"end {name} {os.getpid()}")
    return record


def _note(text: str) -> None:
    """One line at the end of the log, in one piece."""
    log = os.open(os.environ[LOG], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(log, f"{text}\n".encode())
    os.close(log)


def noted(log: Path, what: str) -> Counter[str]:
    """How often each run is in a log: as ``begin`` or as ``end``."""
    lines = [line.split() for line in log.read_text().splitlines()] if log.exists() else []
    return Counter(line[1] for line in lines if line[0] == what)


MADE: dict[Any, Any] = {workers._run: run, workers._whole: whole}


def _cheap(job: tuple[Any, ...]) -> list[Any]:
    """The same with the formula."""
    return [MADE.get(part, part) if callable(part) else part for part in job]


class CheapPool(Pool):
    """Processes of this machine."""

    def _submit(self, work: Any, *args: Any) -> Any:
        return super()._submit(*_cheap((work, *args)))


class CheapCluster(Cluster):
    """Processes of a cluster."""

    def _submit(self, worker: str, work: Any, args: tuple[Any, ...]) -> Any:
        made, *rest = _cheap((work, *args))
        return super()._submit(worker, made, tuple(rest))
