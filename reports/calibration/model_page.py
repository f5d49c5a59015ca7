"""The page of the model: method, laws, conditions, what is minimised, where the limits come from, references."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from mpm.scene.material import REFERENCE_SPEED
from reports.base.format import breakable, count, quantity
from reports.base.run_folder import Data
from reports.calibration import model_sketch

if TYPE_CHECKING:
    from calib.calibration.result import CalibrationResult

#: What is cited by its number on the page.
REFERENCES = (
    "Hu, Y., et al. (2018). A moving least squares material point method with displacement discontinuity and two-way "
    "rigid body coupling. ACM Trans. Graph. 37(4):150. doi:10.1145/3197517.3201293",
    "Stomakhin, A., Howes, R., Schroeder, C., Teran, J. M. (2012). Energetically consistent invertible elasticity. "
    "Proc. Symp. Computer Animation, 25-32.",
    "Nairn, J. A. (2003). Material point method calculations with explicit cracks. Comput. Model. Eng. Sci. 4:649-663.",
    "Hillerborg, A., Modéer, M., Petersson, P.-E. (1976). Analysis of crack formation and crack growth in concrete. "
    "Cem. Concr. Res. 6:773-781. doi:10.1016/0008-8846(76)90007-7",
    "Atkins, T. (2009). The Science and Engineering of Cutting. Butterworth-Heinemann.",
    "Chouly, F., Hild, P. (2013). A Nitsche-based method for unilateral contact problems. SIAM J. Numer. Anal. "
    "51:1295-1307. doi:10.1137/12088344X",
    "Kennedy, M. C., O'Hagan, A. (2001). Bayesian calibration of computer models. J. R. Statist. Soc. B 63:425-464. "
    "doi:10.1111/1467-9868.00294",
    "Raue, A., et al. (2009). Structural and practical identifiability analysis of partially observed dynamical models "
    "by exploiting the profile likelihood. Bioinformatics 25:1923-1929. doi:10.1093/bioinformatics/btp358",
    "ISO/TS 18571. Road vehicles: objective rating metric for non-ambiguous signals.",
    "Schwer, L. E. (2007). Validation metrics for response histories. Eng. Comput. 23:295-309. "
    "doi:10.1007/s00366-007-0070-1",
    "Gneiting, T., Raftery, A. E. (2007). Strictly proper scoring rules, prediction, and estimation. "
    "J. Am. Stat. Assoc. 102:359-378. doi:10.1198/016214506000001437",
    "Sobol, I. M. (2001). Global sensitivity indices for nonlinear mathematical models. "
    "Math. Comput. Simul. 55:271-280. doi:10.1016/S0378-4754(00)00270-6",
)
#: Where the limit of each line of the verdict comes from.
LIMIT_SOURCES = {
    "peak force error": "what published work on simulated cutting quotes as agreement",
    "curve error (NRMSE)": "sensors of such traces are uncertain by 10 % and more",
    "normalised-shape error": "sensors of such traces are uncertain by 10 % and more",
    "shape better than ramp and half sine": "the better of two curves without physics [11]",
    "curve explained by the food": "a right food fails once in a hundred cuts",
    "width of the 95 % band": "a band wider than a quarter of the peak either way predicts nothing of use",
    "interval score better than null models": "the better of two curves without physics [11]",
    "food pressed away, not parted": "measured: below, the force follows the width of the process zone, not R",
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
ABBREVIATIONS = (
    ("NRMSE", "root mean square difference of two curves over the measured peak"),
    ("Shape error", "the same with each curve over its own peak"),
    (
        "ISO rating",
        "overall rating after [9]: mean of Z (corridor, twice), EP (phase), EM (magnitude), ES (slope); 1 is best",
    ),
    ("Sprague–Geers M, P, C", "errors of magnitude and phase, and both combined [10]"),
    ("95 % band, interval", "of the posterior: literature's ranges and trace together, unless *trace alone* is said"),
    ("±", "one standard uncertainty"),
)


def model(result: CalibrationResult) -> Data:
    """What the template prints of the model.

    Args:
        result: The calibration.

    Returns:
        Rows and sentences by name.
    """
    names = {v.name for v in result.verdicts if v.limit is not None}
    return {
        "method": _method(result),
        "laws": _laws(result),
        "conditions": _conditions(result),
        "objective": _objective(result),
        "limit_sources": _limit_sources(names),
        "abbreviations": [list(pair) for pair in ABBREVIATIONS],
        "references": list(REFERENCES),
        "food_references": [[breakable(name), breakable(text)] for name, text in result.references.items()],
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
    """Whether x = 0 and y = 0 are planes of symmetry."""
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
        f"cells of {quantity(cut.dx_m, 'm')} (moving least squares material point method [1], quadratic kernels): "
        f"{count(cut.particles)} particles{lattice}.{steps} There is no artificial damping, no scaling of mass, and no "
        "clamp on a force or a strain."
    )


def _laws(result: CalibrationResult) -> list[list[str]]:
    """Part, law, and the values that it takes."""
    mu = _part(result, "board", "mu")
    zone, slip = (_part(result, "edge", key) for key in ("zone", "slip"))
    loss = _known(result, "loss_factor")
    rows = [
        ["Elasticity", "fixed-corotated, isotropic [2]", "E, nu, rho"],
        ["Flow", "von Mises, no hardening, return to the yield surface of that law", "yield_stress"],
        ["Loss", f"Kelvin–Voigt, loss factor {loss} at the first axial mode; else rate-independent", "loss_factor"],
        ["Crack", "on the blade's plane alone [3]: ties that soften linearly [4]; their work per area is part of R",
         "tensile_strength, R"],
        ["Edge", "line force: starts at the resistance of skin or flesh, then needs what the opening has left of R [5]",
         "R_skin, R_initiation, initiation_depth, R"],
        ["Faces", "contact without adhesion (Nitsche [6]), Coulomb friction up to the shear yield stress", "mu"],
    ]  # fmt: skip
    if power := _known(result, "rate_exponent"):
        at = quantity(REFERENCE_SPEED, "m/s", digits=None)
        rows[4][1] += f"; resistances follow the real speed over {at} to the power {power}"
    if zone is not None and slip is not None:
        rows[4][1] += f"; acts over {quantity(zone, 'm')}, slip {quantity(slip, 'm')}"
    if mu is not None:
        rows.append(["Board", f"contact without adhesion, Coulomb friction {quantity(mu, '-', digits=None)}", "–"])
    return rows


def _known(result: CalibrationResult, name: str) -> str:
    """The value of a property, fitted or not."""
    p = result.fitted.get(name) or result.fixed_parameters.get(name)
    return "" if p is None or p.value is None else quantity(p.value, p.unit)


def _conditions(result: CalibrationResult) -> list[list[str]]:
    """Letter of the sketch, and what holds there."""
    cut = result.cut
    mach, real = quantity(cut.mach, "-"), cut.speed_real_m_s
    speed = "" if real is None else f" (the real one: {quantity(real, 'm/s')})"
    gravity = _part(result, "numerics", "gravity")
    weight = "" if gravity is None else f", gravity of {quantity(gravity, '-')} m/s²"
    rows = [
        ["A", f"blade: rigid, goes down at one speed, {mach} of that of pressure waves in the food{speed}"],
        ["B", "faces of the blade: contact and friction; their force is the *face part*"],
        ["C", "edge: its line force is the *edge part*"],
        ["D", "plane of the cut, whole at first: the crack runs here and nowhere else"],
        ["E", f"board: rigid; the food lies on it free of stress{weight}"],
    ]
    symmetric = sum(_symmetric(result))
    if symmetric:
        planes = "plane of symmetry" if symmetric == 1 else "planes of symmetry"
        rows.append(["F", f"{planes}: normal velocity zero, no friction; {cut.mirror_images} parts from one"])
    return [*rows, ["G", "the grid, at its size; all other surfaces are free"]]


def _objective(result: CalibrationResult) -> str:
    words = "Tare, drift and lag are integrated out of the curve; gain and width widen the intervals."
    open_ = f" {words}" if result.nuisances else ""
    tied = {"E", "yield_stress"} <= set(result.fitted)
    ratio = " Yield stress over E is known to a factor of 3." if tied else ""
    return (
        "The fit minimises the sum of squared residuals of curve and peak, whitened, and of the parameters against the "
        "literature's ranges (central 95 % of normal priors, of the logarithm for stresses and resistances)."
        f"{ratio} "
        "A residual's variance is noise plus 3 % of the peak for what the model leaves out, unless another "
        f"--discrepancy is in the command [7].{open_} Intervals are profile likelihoods whose ends were simulated [8]."
    )
