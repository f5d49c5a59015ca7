"""The stability map: which values are varied together, and over which ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from studies.stability.map_cell import BASE_MATERIAL, MapCell, StartState, forced, map_cell, material_values, stepped

STIFFNESSES = (1e3, 1e4, 1e5, 1e6, 1e7, 1e8)
RATIOS = (0.0, 0.2, 0.4, 0.45, 0.49, 0.495)
STEP_FACTORS = (0.1, 0.4, 0.7, 0.79, 0.9, 1.0, 1.1, 1.2)


def _stiffness_and_ratio(seed: int) -> Iterator[MapCell]:
    for E in STIFFNESSES:
        for nu in RATIOS:
            values = {"E_Pa": E, "nu": nu}
            yield map_cell("E and nu", values, material=material_values(E, nu=nu), numerics={"seed": seed})
            if nu > 0.49:
                base = map_cell("E and nu", values, material=material_values(E, nu=0.49), numerics={"seed": seed})
                yield forced(base, nu=nu)


def _stiffness_and_resistance(seed: int) -> Iterator[MapCell]:
    for E in STIFFNESSES:
        for length in (0.0, 1e-6, 1e-4, 1e-3, 2e-3, 1e-2, 1.0):
            material = material_values(E, R=length * E)
            yield map_cell("E and R", {"E_Pa": E, "R_over_E_m": length}, material=material, numerics={"seed": seed})


def _step_and_cell(seed: int) -> Iterator[MapCell]:
    for dx in (1e-3, 1.5e-3, 2e-3, 3e-3, 4e-3, 5e-3):
        for safety in STEP_FACTORS if dx > 1e-3 else (0.7, 1.2):
            values = {"dx_m": dx, "dt_over_limit": safety}
            yield from stepped("dt and dx", values, safety, numerics={"dx": dx, "seed": seed})


def _step_and_ratio(seed: int) -> Iterator[MapCell]:
    for nu in (0.0, 0.3, 0.45, 0.49):
        for safety in (*STEP_FACTORS, 1.5, 2.0, 3.0):
            values = {"nu": nu, "dt_over_limit": safety}
            yield from stepped("dt and nu", values, safety, material={"nu": nu}, numerics={"seed": seed})


def _real_speed(seed: int) -> Iterator[MapCell]:
    numerics = {"seed": seed}
    for relaxation in (1e-2, 1.0, 100.0):
        for speed in (1e-3, 1e-2, 0.1, 1.0):
            yield map_cell(
                "speed",
                {"speed_m_s": speed, "relaxation_s": relaxation},
                material={"prony": ((0.5, relaxation),)},
                motion={"speed": speed},
                numerics=numerics,
            )
    yield map_cell("speed", {"speed_m_s": "not given"}, material={"prony": ((0.5, 1.0),)}, numerics=numerics)
    pause = {"speed": 1.0, "dwell": 9e4}
    yield map_cell("speed", {"dwell_s": 9e4}, material={"prony": ((0.5, 1.0),)}, motion=pause, numerics=numerics)
    for mach in (1e-3, 2e-3, 5e-3, 0.02, 0.05, 0.09):
        yield map_cell("mach", {"mach": mach}, motion={"mach": mach}, numerics=numerics)


def _foods(seed: int) -> Iterator[MapCell]:
    numerics = {"seed": seed}
    for rho in (100.0, 300.0, 2000.0):
        yield map_cell("density", {"rho_kg_m3": rho}, material={"rho": rho}, numerics=numerics)
        yield map_cell(
            "density", {"rho_kg_m3": rho, "E_Pa": 1e3}, material=material_values(1e3, rho=rho), numerics=numerics
        )
    for strain in (1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, math.inf):
        yield map_cell(
            "yield", {"yield_over_E": strain}, material={"yield_stress": strain * BASE_MATERIAL.E}, numerics=numerics
        )
    for mu in (0.0, 1.0, 5.0):
        yield map_cell("friction", {"mu": mu}, material={"mu": mu}, numerics=numerics)
    for loss in (0.02, 0.2, 2.0):
        yield map_cell("loss", {"loss_factor": loss}, material={"loss_factor": loss}, numerics=numerics)
    for pull in (1e2, 1e4):
        sticky = {"adhesion": pull, "adhesion_energy": 1.0}
        yield map_cell("adhesion", {"adhesion_Pa": pull}, material=sticky, numerics=numerics)
    for strength in (0.05, 0.2):
        broken = {"tensile_strength": strength * BASE_MATERIAL.E, "fracture_energy": BASE_MATERIAL.R}
        yield map_cell("damage", {"strength_over_E": strength}, material=broken, numerics=numerics)
    skin = {"skin_thickness": 1e-3, "R_skin": 2 * BASE_MATERIAL.R}
    yield map_cell("skin", {"R_skin_over_R": 2.0}, material=skin, numerics=numerics)


def _ways(seed: int) -> Iterator[MapCell]:
    def way(name: str, **parts: Any) -> MapCell:
        numerics = {"seed": seed, **parts.pop("numerics", {})}
        return map_cell("way", {"what": name}, numerics=numerics, **parts)

    yield way("single precision", numerics={"precision": "f32"})
    yield way("nodal contact", numerics={"contact": "nodal"})
    yield way("whole block", numerics={"mirror": False})
    yield way("turned", numerics={"grid_turn": 0.4})
    yield way("no gravity", numerics={"gravity": 0.0})
    yield way("27 particles a cell", numerics={"ppc": 3})
    yield way("sliced", motion={"slice_ratio": 3.0}, board={"mu": 5.0})
    yield way("sliced, pulled off the board", motion={"slice_ratio": 3.0}, board={"mu": 0.0})
    yield way("tilted", motion={"tilt": 0.2, "stroke": 0.015})
    yield way("retracted", motion={"stroke": 0.01, "retract": 0.02})
    yield way("soft arm", arm={"stiffness": 300.0})
    yield way("arm too weak", arm={"stiffness": 300.0, "force_limit": 0.5})
    yield way("thick blade", knife={"spine": 0.05, "angle": math.radians(80.0), "height": 0.05})


def _starts(seed: int) -> Iterator[MapCell]:
    whole = {"seed": seed, "mirror": False}
    floating = {**whole, "gravity": 0.0}

    def begin(name: str, start: StartState, numerics: Mapping[str, Any], **parts: Any) -> MapCell:
        return map_cell("start", {"what": name}, start=start, numerics=numerics, **parts)

    yield begin("blade beside the food", StartState(aside=0.5), whole)
    yield begin("blade shorter than a cell", StartState(), whole, knife={"length": 1.1e-3})
    yield begin("blade half off the food", StartState(aside=0.1), whole)
    yield begin("stroke of 0.11 mm", StartState(), whole, motion={"stroke": 1.1e-4})
    yield begin("food in the air, no gravity", StartState(lift=2e-3), floating)
    yield begin("food in the air, nothing near", StartState(lift=2e-3, aside=0.5), floating)
    yield begin("food falls 2 mm", StartState(lift=2e-3), whole)
    yield begin("food outside the grid", StartState(lift=0.1), whole)
    yield begin("edge 1 mm deep", StartState(depth=1e-3), whole, motion={"stroke": 0.01})
    yield begin("edge 10 mm deep", StartState(depth=0.01), whole, motion={"stroke": 0.009})
    thick = {"spine": 0.015, "angle": math.radians(80.0), "height": 0.05}
    yield begin("thick blade 10 mm deep", StartState(depth=0.01), whole, motion={"stroke": 0.009}, knife=thick)
    for times in (10.0, 100.0):
        side = times ** (-1 / 3)
        yield begin(f"{times:g} times overlap, unstrained", StartState(squeeze=side), whole)
        yield begin(f"{times:g} times overlap, strained", StartState(squeeze=side, strained=True), whole)


def _nonsense(seed: int) -> Iterator[MapCell]:
    for name, value in (("E", 0.0), ("E", math.nan), ("nu", 0.5), ("rho", -1.0), ("yield_stress", 0.0), ("R", -1.0)):
        yield map_cell("nonsense", {name: value}, material={name: value}, numerics={"seed": seed})
    for name, value in (("safety", 0.0), ("safety", math.inf), ("dx", 0.0), ("dx", 6e-3), ("ppc", 0), ("ppc", 1)):
        yield map_cell("nonsense", {name: value}, numerics={"seed": seed, name: value})
    for name, value in (("stroke", 0.03), ("mach", 1.0), ("speed", 0.0)):
        yield map_cell("nonsense", {name: value}, motion={name: value}, numerics={"seed": seed})


FAMILIES: tuple[Callable[[int], Iterator[MapCell]], ...] = (
    _stiffness_and_ratio,
    _stiffness_and_resistance,
    _step_and_cell,
    _step_and_ratio,
    _real_speed,
    _foods,
    _ways,
    _starts,
    _nonsense,
)


def map_cells(seed: int = 0) -> list[MapCell]:
    """The whole map; ``seed`` places the particles."""
    return [one for family in FAMILIES for one in family(seed)]


def quick_map_cells(seed: int = 0) -> list[MapCell]:
    """A dozen cells of coarse grids: each of them is stable, stopped or refused within a second or two."""
    coarse = {"dx": 5e-3, "seed": seed}
    far = map_cell("dt and dx", {"dx_m": 5e-3, "dt_over_limit": 3.0}, numerics=coarse)
    out = [
        map_cell("E and nu", {"E_Pa": E, "nu": 0.4}, material=material_values(E), numerics=coarse)
        for E in (1e3, 1e5, 1e8)
    ]
    out += [
        map_cell("E and R", {"E_Pa": 1e3, "R_over_E_m": 1.0}, material=material_values(1e3, R=1e3), numerics=coarse)
    ]
    out += stepped("dt and dx", {"dx_m": 5e-3, "dt_over_limit": 1.2}, 1.2, numerics=coarse)
    out += [forced(far, safety=3.0)]
    out += [map_cell("nonsense", {"nu": 0.5}, material={"nu": 0.5}, numerics=coarse)]
    for name, start in (
        ("blade beside the food", StartState(aside=0.5)),
        ("food outside the grid", StartState(lift=0.1)),
    ):
        out.append(map_cell("start", {"what": name}, start=start, numerics={**coarse, "mirror": False}))
    return out
