"""The result of one cut: forces over stroke, momentum and energy, and what went wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ForceRecord:
    """Forces, momenta and energies of one cut, one row per output interval; forces act on the tool.

    Every force is an impulse accumulated over the interval and divided by its length.

    Attributes:
        stroke: Stroke at the end of each interval [m], shape (n,).
        time: Simulated time at the end of each interval [s], shape (n,).
        edge: Force of the food on the cutting edge [N], shape (n, 3).
        face: Force of the food on the blade's faces [N], shape (n, 3).
        board: Force of the food on the board [N], shape (n, 3).
        gravity: Weight [N], shape (n, 3).
        momentum: Momentum of the food at the end of each interval [N s], shape (n, 3).
        residual: Momentum balance that does not close [N], shape (n, 3).
        kinetic: Kinetic energy [J], shape (n,).
        elastic: Elastic energy [J], shape (n,).
        plastic: Energy dissipated by J2 flow so far [J], shape (n,).
        damage: Energy dissipated by bulk damage so far [J], shape (n,).
        viscous: Energy dissipated by the loss factor so far [J], shape (n,).
        speed: Simulated blade speed [m/s].
        dt: Time step [s].
        steps: Number of time steps.
        particles: Number of particles simulated (mirror images not counted).
        images: Mirror images that each particle stands for (1, 2 or 4).
        cells: Number of grid nodes.
        severed_area: Area of the section that the edge has passed [m^2].
        counters: How often each exceptional branch was taken, e.g. ``inverted``; all zero in a sound run.
        wall: Run time of the time loop [s].
        status: ``done``, or the reason why the run stopped early.
        fraction: Part of the stroke completed [-].
    """

    stroke: np.ndarray
    time: np.ndarray
    edge: np.ndarray
    face: np.ndarray
    board: np.ndarray
    gravity: np.ndarray
    momentum: np.ndarray
    residual: np.ndarray
    kinetic: np.ndarray
    elastic: np.ndarray
    plastic: np.ndarray
    damage: np.ndarray
    viscous: np.ndarray
    speed: float
    dt: float
    steps: int
    particles: int
    images: int
    cells: int
    severed_area: float
    counters: dict[str, int]
    wall: float
    status: str = "done"
    fraction: float = 1.0

    @property
    def knife(self) -> np.ndarray:
        """Force of the food on the knife, edge and faces [N], shape (n, 3)."""
        return self.edge + self.face

    @property
    def peak(self) -> float:
        """Largest upward force on the knife in any output interval [N]."""
        return float(self.knife[:, 2].max()) if len(self.stroke) else 0.0

    @property
    def work(self) -> float:
        """Work of the knife on the food [J]: vertical force times stroke, summed over the intervals."""
        return float(np.sum(self.knife[:, 2] * np.diff(self.stroke, prepend=0.0)))

    @property
    def momentum_residual(self) -> float:
        """Largest part of the momentum balance that does not close, over the peak force [-]."""
        return float(np.abs(self.residual).max() / self.peak) if self.peak > 0 else 0.0

    @property
    def ke_over_ie(self) -> float:
        """Kinetic over internal energy, worst of the second half of the cut [-]; quasi-static below 0.05."""
        internal = self.elastic + self.plastic + self.damage + self.viscous
        tail = slice(len(self.stroke) // 2, None)
        ok = internal[tail] > 0
        return float((self.kinetic[tail][ok] / internal[tail][ok]).max()) if ok.any() else 0.0

    def columns(self) -> dict[str, np.ndarray]:
        """The record as named columns with units, ready for a CSV file."""
        out = {"stroke_m": self.stroke, "time_s": self.time}
        for name in ("knife", "edge", "face", "board"):
            values = getattr(self, name)
            out |= {f"{name}_f{axis}_N": values[:, k] for k, axis in enumerate("xyz")}
        out |= {f"balance_{axis}_N": self.residual[:, k] for k, axis in enumerate("xyz")}
        for name in ("kinetic", "elastic", "plastic", "damage", "viscous"):
            out[f"{name}_J"] = getattr(self, name)
        return out

    def summary(self) -> dict[str, Any]:
        """The scalars that a report quotes."""
        area = self.severed_area
        return {
            "peak_N": self.peak,
            "work_J": self.work,
            "work_per_area_J_m2": self.work / area if area > 0 else None,
            "particles": self.particles,
            "mirror_images": self.images,
            "grid_nodes": self.cells,
            "steps": self.steps,
            "dt_s": self.dt,
            "speed_m_s": self.speed,
            "wall_s": self.wall,
            "momentum_residual": self.momentum_residual,
            "ke_over_ie": self.ke_over_ie,
            "counters": dict(self.counters),
            "status": self.status,
            "fraction": self.fraction,
        }
