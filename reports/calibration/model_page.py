"""The page of the model: method, laws, conditions, what is minimised, where the limits come from, references."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from mpm.scene.material import PARTS_BEFORE_IT_FLOWS, REFERENCE_SPEED, Material
from mpm.scene.motion import SLOWED_FROM
from reports.base.format import count, listed, plain, quantity
from reports.base.references import of_foods
from reports.base.run_folder import Data
from reports.calibration import model_sketch

if TYPE_CHECKING:
    from calib.calibration.result import CalibrationResult

#: Where the limit of each line of the verdict comes from.
LIMIT_SOURCES = {
    "peak force error": "what published work on simulated cutting quotes as agreement [@Koh 2026]",
    "curve error (NRMSE)": "chosen: less than sensors of such traces are uncertain by, which is 10 % and more",
    "normalised-shape error": "chosen: less than sensors of such traces are uncertain by, which is 10 % and more",
    "curve error of the withdrawal (NRMSE)": "root of the sum of two squares: the limit of the curve error, and the "
    "uncertainty of the pull's level over the largest pull",
    "shape better than ramp and half sine": "the better of two curves without physics",
    "curve explained by the food": "a right food fails once in a hundred cuts",
    "values those of the food": "the right food has values as far out once in a hundred cuts; an sd is that of what "
    "its literature and such a trace lead to, and what the trace does not tell does not count",
    "specimen no larger than the food": "one whole food in a hundred is larger",
    "width of the 95 % band": "a band wider than a quarter of the peak either way predicts nothing of use",
    "interval score better than null models": "the better of two curves without physics [@Gneiting 2007]",
    "food pressed away, not parted": "measured: where more is pressed away, the force follows the width of the process "
    "zone, not R",
    "momentum balance residual": "rounding in a sound run; more is a defect of the program",
    "kinetic over internal energy": "practice of explicit quasi-static analysis: 5 to 10 %",
    "energy lost by the discretisation": "as much as the peak may miss the trace",
    "half the simulated speed": "as much as the peak may miss the trace",
    "grid and particles elsewhere": "as much as the peak may miss the trace",
    "cells of two thirds": "as much as the peak may miss the trace",
    "constants of the method halved and doubled": "as much as the peak may miss the trace",
    "delay of the trace within its uncertainty": "three standard deviations of what the sensor leaves open",
    "sensor's gain within its uncertainty": "three standard deviations of what the sensor leaves open",
    "parameters at a bound": "an answer at the end of what was allowed is none",
}
#: Nuisances of the way down, and those of them that the search leaves alone.
OPEN, WIDENING = ("tare", "drift", "lag", "bandwidth", "gain", "width"), ("gain", "width")
ABBREVIATIONS = (
    ("NRMSE", "root mean square difference of two curves over the measured peak"),
    ("Shape error", "the same with each curve over its own peak"),
    (
        "ISO rating",
        "overall rating after [@ISO 18571]: mean of Z (corridor, twice), EP (phase), EM (magnitude), ES (slope); 1 is "
        "best",
    ),
    ("Sprague–Geers M, P, C", "errors of magnitude and phase, and both combined [@Schwer 2007]"),
    ("95 % band, interval", "of the posterior: literature's ranges and trace together, unless *trace alone* is said"),
    ("±", "one standard uncertainty"),
    (
        "Kind of source",
        "of a literature value, not of a fitted one: *measured*, on this food in a test of the kind that is meant; "
        "*proxy*, another food, another test, a derived or a second-hand value; *assumed*, nobody's measurement; "
        "*paper, Table 2*, of the CulinaryCut paper [@Koh 2026], no better value found",
    ),
)


def model(result: CalibrationResult) -> Data:
    """What the template prints of the model, in the order in which it is read; citations are names yet
    (:class:`reports.base.references.Citations`).

    Args:
        result: The calibration.

    Returns:
        Rows and sentences by name.
    """
    names = {v.name for v in result.verdicts if v.limit is not None}
    more = {} if result.withdrawal is None else {"NRMSE": "; on the way up over the largest measured pull"}
    return {
        "method": _method(result),
        "laws": _laws(result),
        "conditions": _conditions(result),
        "objective": _objective(result),
        "limit_sources": _limit_sources(names),
        "abbreviations": [[name, text + more.get(name, "")] for name, text in ABBREVIATIONS],
        "food_references": of_foods(result.references),
    }


def _limit_sources(names: Collection[str]) -> list[list[str]]:
    """Lines of the verdict that share a reason for their limit, and the reason."""
    grouped: dict[str, list[str]] = {}
    for name, why in LIMIT_SOURCES.items():
        if name in names:
            grouped.setdefault(why, []).append(name)
    return [["; ".join(lines), why] for why, lines in grouped.items()]


def sketch(result: CalibrationResult) -> bytes:
    """The sketch of the cut."""
    cut = result.cut
    return model_sketch.sketch(cut.shape, cut.knife, cut.dx_m, _symmetric(result))


def _symmetric(result: CalibrationResult) -> tuple[bool, bool]:
    """Whether x = 0 and y = 0 are planes of symmetry; neither where nothing is recorded, as in a study without the
    record of its cut."""
    images = result.cut.mirror_images
    return (images == 4, images in (2, 4))


def _part(result: CalibrationResult, *names: str) -> Any:
    """A value of the scene; None where the document does not say it."""
    found: Any = result.cut.scene
    for name in names:
        found = found.get(name) if isinstance(found, Mapping) else None
    return found


def _method(result: CalibrationResult) -> str:
    cut = result.cut
    per = _part(result, "numerics", "ppc")
    lattice = f", {per**3} in a cell within the food" if isinstance(per, int) else ""
    step = _part(result, "numerics", "safety")
    steps = (
        "" if step is None else f" Explicit time steps are {quantity(step, '-', digits=None)} of the stability limit."
    )
    return (
        "The food is a three-dimensional continuum. Particles carry it and exchange momentum through a regular grid of "
        f"cells of {quantity(cut.dx_m, 'm')} (moving least squares material point method [@Hu 2018], quadratic "
        f"kernels): {count(cut.particles)} particles{lattice}.{steps} There is no artificial damping, no scaling of "
        "mass, and no clamp on a force or a strain."
    )


def _laws(result: CalibrationResult) -> list[list[str]]:
    """Part, law, and those of its properties that the tables of values have."""
    rows = [
        ("Elasticity", "fixed-corotated, isotropic [@Stomakhin 2012]", "E nu rho"),
        ("Flow", "von Mises, no hardening, return to the yield surface of that law", "yield_stress"),
        _loss(result),
        *_layers(result),
        _crack(result),
        _edge(result),
        _faces(result),
    ]
    mu = _value(result, "board_friction")
    mu = _part(result, "board", "mu") if mu is None else mu
    if mu is not None:
        rows.append(("Board", _board(result, mu), "board_friction board_suction bow"))
    return [[part, law, ", ".join(n for n in names.split() if _known(result, n)) or "–"] for part, law, names in rows]


def _board(result: CalibrationResult, mu: float) -> str:
    """Contact, friction and suction of the board, and where the food touches it."""
    fitted = result.fitted.get("board_suction")
    held = _part(result, "board", "suction") if fitted is None else fitted.value
    pull = f"that holds a wet face [@Stefan 1874] by up to {quantity(held, 'Pa')}" if held else "without adhesion"
    bow = _value(result, "bow") or _part(result, "board", "bow") or 0.0
    rests = f"; the food's underside has a bow of {quantity(bow, 'm')}" if bow else ""
    return f"contact {pull}, Coulomb friction {quantity(mu, '-')}{rests}"


def _loss(result: CalibrationResult) -> tuple[str, str, str]:
    """Loss factor, and relaxation where there is any."""
    factor = _known(result, "loss_factor")
    law = f"Kelvin–Voigt, loss factor {factor} at the first axial mode" if factor else "Kelvin–Voigt"
    if _value(result, "relaxing_share"):
        law += "; part of the stiffness relaxes (one Prony branch [@Simo 1987])"
        return "Loss", law, "loss_factor relaxing_share relaxation_time relaxing_bulk"
    return "Loss", f"{law}; else rate-independent", "loss_factor"


def _layers(result: CalibrationResult) -> list[tuple[str, str, str]]:
    """Rind, core and skin, where the food has them."""
    rows = []
    own = "laws of the flesh, with {} times its E and yield stress and a resistance of its own"
    for name, part, factor, size in (
        ("Rind", "layer of one thickness all round", "rind_stiffness", "rind_thickness"),
        ("Core", "the section's outline shrunk in proportion", "core_stiffness", "core_ratio"),
    ):
        if _value(result, size):
            times = own.format(_known(result, factor) or "1")
            rows.append((name, f"{part}: {times}", f"R_{name.lower()} {size} {factor}"))
    if _value(result, "skin_thickness"):
        law = "what the edge has to go through first: a line force, then what the layer below needs"
        law += "; bears tension in its plane" if _value(result, "skin_stiffness") else "; bears nothing else"
        rows.append(("Skin", law, "R_skin skin_thickness skin_stiffness"))
    return rows


def _crack(result: CalibrationResult) -> tuple[str, str, str]:
    """The law of opening, and the tensile strength that it starts from."""
    strength, ratio, stress = (_value(result, name) for name in ("tensile_strength", "strength_ratio", "yield_stress"))
    if strength is not None:
        start, names = quantity(strength, "Pa"), "tensile_strength R"
    elif ratio is not None and stress is not None:
        start, names = f"strength_ratio × yield_stress = {quantity(ratio * stress, 'Pa')}", "strength_ratio R"
    else:
        start, names = f"{quantity(PARTS_BEFORE_IT_FLOWS, '-', digits=None)} of the yield stress", "yield_stress R"
        zone = _part(result, "food", "material", "cohesive_zone")
        if zone is not None:
            start += f", less where the process zone would be shorter than {quantity(zone, 'm', digits=None)}"
    ties = _part(result, "numerics", "crack_ties")
    least = "" if ties is None else f"{plain(ties, None)} ties"
    less = f" (less where its process zone would be shorter than {least} [@Turon 2007])" if least else ""
    law = (
        "on the blade's plane alone [@Nairn 2003]: ties that soften linearly [@Hillerborg 1976] from the tensile "
        f"strength, {start}{less}; their work per area is part of R"
    )
    return "Crack", law, names


def _edge(result: CalibrationResult) -> tuple[str, str, str]:
    """The line force at the edge."""
    zone, slip = (_part(result, "edge", key) for key in ("zone", "slip"))
    first = "skin" if _value(result, "skin_thickness") else "flesh"
    law = (
        f"line force: starts at the resistance of the {first}, then needs what the opening has left of R [@Atkins 2009]"
    )
    if power := _known(result, "rate_exponent"):
        at = quantity(REFERENCE_SPEED, "m/s", digits=None)
        law += f"; resistances follow the real speed over {at} to the power {power}"
    if zone is not None and slip is not None:
        law += f"; acts over {quantity(zone, 'm')}, slip {quantity(slip, 'm')}"
    start = "R_skin" if first == "skin" else "R_initiation"
    return "Edge", law, f"{start} initiation_depth R rate_exponent"


def _faces(result: CalibrationResult) -> tuple[str, str, str]:
    """Contact, friction and adhesion on the faces of the blade."""
    rubs = "contact (Nitsche [@Chouly 2013]), Coulomb friction up to the shear yield stress"
    traction = _known(result, "adhesion")
    if not (_value(result, "adhesion_energy") and traction):
        return "Faces", f"{rubs}; no adhesion", "mu"
    law = (
        f"{rubs}; what has been pressed on a face sticks, with a traction of {traction} at most, until adhesion_energy "
        "per area is spent [@Raous 1999]"
    )
    return "Faces", law, "mu adhesion adhesion_energy"


def _value(result: CalibrationResult, name: str) -> float | None:
    """The value of a property [SI], fitted or not; None where the food has none."""
    p = result.fitted.get(name) or result.fixed_parameters.get(name)
    return None if p is None else p.value


def _known(result: CalibrationResult, name: str) -> str:
    """The value of a property as text; empty where the food has none."""
    p = result.fitted.get(name) or result.fixed_parameters.get(name)
    return "" if p is None or p.value is None else quantity(p.value, p.unit)


def _conditions(result: CalibrationResult) -> list[list[str]]:
    """Letter of the sketch, and what holds there."""
    cut = result.cut
    speed = _speed(result)
    up = "" if result.withdrawal is None else "; then up again at the first speed"
    gravity = _part(result, "numerics", "gravity")
    weight = "" if gravity is None else f", gravity of {quantity(gravity, '-')} m/s²"
    rows = [
        ["A", f"blade: rigid, goes down at {speed}{up}"],
        ["B", "faces of the blade: contact and friction; their force is the *face part*"],
        ["C", "edge: its line force is the *edge part*"],
        ["D", "plane of the cut, whole at first: the crack runs here and nowhere else"],
        ["E", f"board: rigid; the food lies on it free of stress{weight}"],
    ]
    symmetric = sum(_symmetric(result))
    images: int | None = cut.mirror_images
    if images is None:
        rows.append(["F", "planes of symmetry: not recorded, and not drawn"])
    elif symmetric:
        planes = "plane of symmetry" if symmetric == 1 else "planes of symmetry"
        rows.append(["F", f"{planes}: normal velocity zero, no friction; {images} parts from one"])
    return [*rows, ["G", "the grid, at its size; all other surfaces are free"]]


def _speed(result: CalibrationResult) -> str:
    """The simulated speed, and that of the trace."""
    cut, trace = result.cut, result.conditioning
    if cut.mach is None:
        return "a speed that its older files do not say"
    said = f"{quantity(cut.mach, '-')} of the speed of pressure waves in the food"
    E, nu, rho = (_value(result, name) for name in ("E", "nu", "rho"))
    if E is not None and nu is not None and rho is not None:
        at = cut.mach * Material(E=E, nu=nu, rho=rho).p_wave
        said += f", {quantity(at, 'm/s', digits=2)}"
        if cut.speed_real_m_s is not None:
            said += f", where the real one is {quantity(cut.speed_real_m_s, 'm/s', digits=2)}"
        elif trace is not None:
            real = trace.stroke_m / (trace.end_s - trace.onset_s)
            said += f", where the trace has {quantity(real, 'm/s', digits=2)} on average"
    end = _part(result, "motion", "end_speed")
    if end is not None and end < 1.0:
        below, least = (quantity(x, "fraction", digits=None) for x in (SLOWED_FROM, end))
        said += f"; with less than {below} of the height left it goes down with what is left, to {least} at the end"
    return said


def _left_out(result: CalibrationResult) -> str:
    """How far a right model may be from the trace, part of its peak."""
    said = result.posterior.discrepancy
    return "3 % (unless its command says another one)" if said is None else quantity(said, "fraction", digits=None)


def _some(names: list[str], what: str, one: str, many: str) -> str:
    """A sentence about some nuisances."""
    return f"{listed(names).capitalize()} {one if len(names) == 1 else many} {what}."


def _objective(result: CalibrationResult) -> str:
    known = [n for n in result.nuisances if n in OPEN]
    out, wide = ([n for n in known if (n in WIDENING) is kind] for kind in (False, True))
    open_ = f" {_some(out, 'integrated out of the curve', 'is', 'are')}" if out else ""
    open_ += f" {_some(wide, 'the intervals', 'widens', 'widen')}" if wide else ""
    tied = {"E", "yield_stress"} <= set(result.fitted)
    ratio = " Yield stress over E is known to a factor of 3." if tied else ""
    up = result.withdrawal is not None
    what = "the force on the way down and the pull on the way up, each with its peak," if up else "curve and peak,"
    pull = (
        " On the way up it is 10 % of the largest pull at least, and the pull has a correlation length, a tare and a "
        "gain of its own."
    )
    return (
        f"The fit minimises the sum of squared residuals of {what} whitened, and of the parameters against the "
        "literature's ranges (central 95 % of normal priors, of the logarithm for stresses and resistances)."
        f"{ratio} "
        f"The standard deviation of a residual is that of the noise and {_left_out(result)} of the peak, for what the "
        f"model leaves out, in squares [@Kennedy 2001].{pull if up else ''}{open_} Intervals are profile "
        "likelihoods whose ends were simulated [@Raue 2009]."
    )
