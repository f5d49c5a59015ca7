"""Conservation in a finished run: is every number finite, does momentum balance, was energy made from nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpm.output.record import ForceRecord

MOMENTUM_LIMIT = {"f64": 1e-9, "f32": 1e-3}
"""Largest momentum residual over the largest force [-]; rounding gives 1e-14 and 1e-5."""
GAIN_LIMIT = 0.1
"""Largest energy from nothing over the energy put in so far [-]; see :func:`energy_gain`."""
EARLY = 0.1
"""Part of all energy that is added to what was put in so far: before contact nothing has been put in."""
LASTING = 5
"""Outputs in a row that must show a gain: the work of gravity is summed between outputs, and is off while the food
bounces faster than that; instability stays."""


@dataclass(frozen=True)
class Conservation:
    """Attributes: reason, empty for a sound run; energy_gain [-]; momentum residual over the largest force [-]."""

    reason: str
    energy_gain: float
    momentum: float


def check_conservation(record: ForceRecord, *, precision: str, stored: float = 0.0, least: float = 0.0) -> Conservation:
    """Check a record.

    Args:
        record: Of a run that reached its end or not.
        precision: ``f64`` or ``f32``.
        stored: Energy of the food at the start [J].
        least: Energy below which everything is rounding [J].

    Returns:
        The solver's own reason where it stopped; else ``not_finite``, ``momentum`` or ``energy_growth``.
    """
    columns = (*record.columns().values(), record.momentum, record.gravity)
    if not all(np.isfinite(c).all() for c in columns):
        own = record.status if record.status != "done" else "not_finite"
        return Conservation(own, float("nan"), float("nan"))
    momentum = _momentum(record)
    gain = energy_gain(record, stored=stored, least=least)
    reason = ""
    if record.status != "done":
        reason = record.status
    elif not momentum <= MOMENTUM_LIMIT[precision]:
        reason = "momentum"
    elif not gain <= GAIN_LIMIT:
        reason = "energy_growth"
    return Conservation(reason, gain, momentum)


def energy_gain(record: ForceRecord, *, stored: float = 0.0, least: float = 0.0) -> float:
    """Largest lasting energy that nothing has put in, over what was put in so far [-]; negative where there is none.

    Put in: work of the knife and of gravity, and what was stored at the start. Found: kinetic and elastic energy, and
    what flow, damage, the loss factor, friction and the edge have taken. The transfers only take energy, so more than
    was put in is never there.

    Args:
        record: Of a run that reached its end or not.
        stored: Energy of the food at the start [J].
        least: Energy below which everything is rounding [J].

    Returns:
        The gain [-].
    """
    weight = float(np.abs(record.gravity).max())
    put = stored + record.work_done + record.weighing
    most = float(np.abs(put).max()) + weight * float(np.ptp(record.stroke))
    so_far = np.maximum.accumulate(np.abs(put)) + EARLY * most + least
    gain = -(record.unbooked + stored) / np.maximum(so_far, np.finfo(float).tiny)
    rows = min(LASTING, len(gain))
    return float(np.lib.stride_tricks.sliding_window_view(gain, rows).min(axis=1).max())


def _momentum(record: ForceRecord) -> float:
    """Largest part of the momentum balance that does not close over the largest force that acts [-]."""
    forces = (record.edge, record.face, record.board, record.gravity)
    largest = max(float(np.abs(f).max()) for f in forces)
    worst = float(np.abs(record.residual).max())
    if largest > 0:
        return worst / largest
    return 0.0 if worst == 0 else float("inf")
