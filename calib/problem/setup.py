"""What is decided before the first simulation: the conditioned trace, the scenes, the parameters and the objective."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from calib.errors import CurveError, MaterialError, OutputError
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.properties import rule_of
from calib.material.scene import cut_scene, height_range, specimen, windowed
from calib.problem.nuisance import nuisances, sensor_of
from calib.problem.objective import Objective
from calib.problem.parameters import Z95, Parameter, ParameterSet
from calib.problem.request import Request, Setup
from calib.problem.target import Target
from calib.trace.conditioning import Conditioned, condition
from calib.trace.filters import filter_simulated
from mpm.scene import Scene

# Hard bounds reach this factor beyond the literature's range, so that a trace may contradict the literature.
BOUND_FACTOR = 5.0
SCOUTS_HASTE = 2.0
"""Speed of a search's coarse simulations over that of a screening run [-]. The process takes their common offset from the default ones away, and
what is left of the difference, over the 16 best runs of five calibrations, is 1.2, 0.6, 0.4, 1.2 and 3.6 % of the peak at 1 and 1.3, 0.5, 0.5, 1.8
and 5.5 % at 2 (apple, two cucumbers, two potatoes; the noise of the coarse runs in the process is 2 %), in half the time."""
LINEAR = {"nu": (0.0, 0.49), "mu": (0.0, 1.2)}  # fitted on a linear scale, with their hard bounds


def fit_parameters(
    food: FoodSpec, names: tuple[str, ...], heights: tuple[float, float, float] | None = None
) -> ParameterSet:
    """The fitted properties with start value, hard bounds and literature prior.

    Args:
        food: The food.
        names: Properties, and ``height`` for the specimen's.
        heights: Lowest, likely and largest height of the specimen [m]; None where it is known.

    Raises:
        MaterialError: An unknown or repeated name, a property without a literature range, or a height that is known.
    """
    chosen = []
    for name in names:
        if name == "height":
            if heights is None:
                raise MaterialError(
                    "--fit height: the height is known (given, or the trace ends released); leave one of both out"
                )
            low, likely, high = heights
            chosen.append(Parameter(name, likely, low, high, "m", low, high))
            continue
        rule, (low, high) = rule_of(name), food.prior(name)
        value = food.value(name)
        assert value is not None  # prior() has a range only where there is a value
        if name in LINEAR:
            bottom, top = LINEAR[name]
            chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high, scale="linear"))
            continue
        if low <= 0:
            raise MaterialError(f"{food.name}: {name} cannot be fitted from a range that starts at {low:g} {rule.unit}")
        bottom, top = max(rule.low, low / BOUND_FACTOR), min(rule.high, high * BOUND_FACTOR)
        chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high))
    return ParameterSet(tuple(chosen))


def conditioned(request: Request) -> tuple[Conditioned, str | None]:
    """The trace of a request, conditioned, and the SHA-256 of its air run (None without one).

    Raises:
        CutcalError: Anything wrong with the records.
    """
    trace, air = request.records()
    known = request.sizing.height or request.food.dims["height"].value
    curve = condition(
        trace, air=air, speed=request.speed, height=known, t_end=request.t_end, board=request.sizing.height
    )
    return curve, None if air is None else air.sha256


def set_up(request: Request) -> Setup:
    """Condition the trace, and make the scenes and the objective of a calibration.

    Raises:
        CutcalError: Anything wrong with the input.
    """
    food = request.food
    curve, air_sha256 = conditioned(request)
    shape, assumed = specimen(food, curve, request.sizing)
    knife = load_knife(request.knife)
    heights = height_range(food, curve, request.sizing)
    fine, screening = (
        windowed(
            cut_scene(
                food, shape, knife, stroke=curve.stroke_length_m, dx=request.dx, seed=request.seed, coarse=coarse
            ),
            heights,
        )
        for coarse in (False, True)
    )
    coarse = replace(screening, motion=replace(screening.motion, mach=SCOUTS_HASTE * screening.motion.mach))
    sensor, said = sensor_of(curve, request.gain_sd, request.lag_sd)
    if said is not None:
        assumed.append(said)
    width_sd = 0.0 if request.sizing.width is not None else spread(food, "width")
    u_num = 0.0 if request.u_num is None else numerical(request.u_num, food.name, fine, curve)
    target = Target(curve.stroke, curve.curve, curve.curve_noise_sd_N, curve.peak_sd_N, filter_simulated, u_num)
    given = nuisances(curve, sensor, width_sd=width_sd, scaled=request.scaled)
    scale_sd = math.hypot(width_sd, sensor.gain_sd) if request.scaled else 0.0
    names = request.fit or (food.default_fit if heights is None else (*food.default_fit, "height"))
    objective = Objective(target, fit_parameters(food, names, heights), request.errors, given, scale_sd)
    return Setup(curve, fine, coarse, objective, assumed, request.sizing.kept, air_sha256)


def numerical(folder: Path, food: str, scene: Scene, curve: Conditioned) -> np.ndarray:
    """Numerical standard uncertainty of a simulated curve on the stroke of a trace [N] (240,), from ``cutcal converge``.

    It is that of the study's coarsest grid as a part of its peak, at equal parts of the stroke.

    Raises:
        OutputError: There is no such study in the folder.
        CurveError: It is of another food, knife or cell.
    """
    try:
        document = json.loads((folder / "converge.json").read_text(encoding="utf-8"))
        table = pd.read_csv(folder / "curves.csv", comment="#")
        coarsest = max(row["dx_m"] for row in document["grids"])
        stroke, u_num = table["stroke_m"].to_numpy(), table["u_num_coarsest_N"].to_numpy()
        peak = float(table[f"force_dx_{coarsest:g}_N"].max())
    except (OSError, ValueError, KeyError) as e:
        raise OutputError(f"--u-num {folder}: no finished study of cutcal converge there ({e})") from None
    for what, own, theirs in (
        ("food", food, document["food"]),
        ("knife", scene.knife.name, document["knife"]),
        ("cell", f"{scene.numerics.dx * 1e3:.3g} mm", f"{coarsest * 1e3:.3g} mm"),
    ):
        if own != theirs:
            raise CurveError(
                f"--u-num {folder}: its {what} is {theirs}, that of this calibration {own}; repeat cutcal converge with the same, "
                "its coarsest --dx the cell of the calibration"
            )
    parts = curve.stroke / curve.stroke[-1]
    out: np.ndarray = np.interp(parts, stroke / stroke[-1], u_num) / peak * float(curve.curve.max())
    return out


def spread(food: FoodSpec, size: str) -> float:
    """Relative standard deviation of a size of the food, whose 95 % range is that of the literature [-]."""
    known = food.dims[size]
    return math.log(known.high / known.low) / (2.0 * Z95)
