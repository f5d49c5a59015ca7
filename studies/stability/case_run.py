"""One cell of the stability map, run within bounds and audited; lives in a worker process, where Taichi is."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene.material import Material
from mpm.solver import Simulation
from mpm.state.tables import COMMAND, EDGE_S, EDGE_Z
from studies.stability.audit import Audit, audit
from studies.stability.cases import Cell

ROUNDING = 1e-12  # energy over stiffness times volume that is nothing [-]


class TooLong(Exception):
    """A run that was ended for its length. Attributes: fraction of the steps done [-]."""

    def __init__(self, fraction: float) -> None:
        super().__init__(fraction)
        self.fraction = fraction


class Trial(Simulation):
    """A simulation that may start otherwise than a cut does, or take longer steps than are sound.

    Args:
        cell: What to simulate; its values may lie beyond the checks of a scene.
        runtime: Device.
    """

    def __init__(self, cell: Cell, runtime: Runtime) -> None:
        assert cell.scene is not None
        self.cell = cell
        super().__init__(cell.scene, runtime)
        self.setup.step_scale = cell.step

    @property
    def steps(self) -> float:
        """Time steps that the run takes [-]."""
        m, material = self.scene.motion, self.scene.food.material
        dt = self.setup.time_step(material)
        way = m.stroke + self.setup.gap + m.retract
        return way / (m.mach * material.p_wave * dt) + m.dwell / self.scene.time_scale / dt

    @property
    def stored(self) -> float:
        """Elastic energy of the food at the start [J]."""
        start, m = self.cell.start, self.scene.food.material
        s = start.squeeze if start.strained else 1.0
        density = 3 * m.shear * (s - 1) ** 2 + 0.5 * m.lame * (s**3 - 1) ** 2
        return self.setup.grid.images * self.setup.seeds.total * density

    def go(self, longest: float) -> tuple[ForceRecord, Audit]:
        """Run and audit.

        Raises:
            TooLong: The run took more than ``longest`` seconds.
        """
        began = time.monotonic()

        def watch(fraction: float, _: float) -> None:
            if time.monotonic() - began > longest:
                raise TooLong(fraction)

        record = self.run(progress=watch)
        n, volume = self.scene.numerics, self.setup.grid.images * self.setup.seeds.total
        return record, audit(
            record,
            precision=n.precision,
            stored=self.stored,
            least=ROUNDING * self.scene.food.material.E * volume,
        )

    def load(self, material: Material) -> None:
        """Fields of a cut, changed as the start says."""
        super().load(material)
        s, state = self.cell.start, self.state
        if s.lift or s.squeeze != 1:
            x = state.x.to_numpy()
            state.x.from_numpy(x * s.squeeze + np.array([0.0, 0.0, s.lift], x.dtype))
        if s.strained:
            f = state.F.to_numpy()
            f[0, :, [0, 4, 8]] = s.squeeze
            state.F.from_numpy(f)
        if s.depth or s.aside:
            pose = state.pose.to_numpy()
            if s.depth:
                pose[0, [EDGE_Z, COMMAND]] = self.scene.food.shape.height - s.depth
            pose[0, EDGE_S] = s.aside
            state.pose.from_numpy(pose)


def attempt(cell: Cell, most: float, longest: float, arch: str, threads: int) -> dict[str, Any]:
    """One run as plain data.

    Args:
        cell: What to run.
        most: Particle steps that are allowed.
        longest: Seconds that are allowed.
        arch: Device.
        threads: CPU threads.

    Returns:
        Fields of an Evaluation; reason ``too_long`` where it was not run to its end.
    """
    trial = Trial(cell, Runtime(arch, threads))
    scalars = {"particle_steps": trial.steps * len(trial.setup.seeds.x), "particles": float(len(trial.setup.seeds.x))}
    if scalars["particle_steps"] > most:
        return _result("too_long", 0.0, scalars, 0.0)
    try:
        record, found = trial.go(longest)
    except TooLong as stop:
        return _result("too_long", stop.fraction, scalars, longest)
    scalars |= {
        "peak_N": record.peak,
        "work_J": record.work,
        "energy_gain": found.energy_gain,
        "momentum_residual": found.momentum,
        "steps": float(record.steps),
        "dt_s": record.dt,
    }
    return _result(found.reason, record.fraction, scalars, record.wall)


def _result(reason: str, fraction: float, scalars: dict[str, float], seconds: float) -> dict[str, Any]:
    return {
        "status": "failed" if reason else "ok",
        "reason": reason,
        "fraction": fraction,
        "scalars": {name: value for name, value in scalars.items() if math.isfinite(value)},
        "seconds": seconds,
    }
