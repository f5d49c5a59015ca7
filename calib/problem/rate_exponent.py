"""Whether the cuts of a fit tell how resistances depend on the speed: they must have been made at different ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from calib.errors import MaterialError
from calib.material.properties import RATE_EXPONENT
from mpm.output.number_text import interval
from mpm.scene.material import REFERENCE_SPEED

LEAST_SPEED_RATIO = 1.5
"""Largest over smallest speed from which a fit may be asked for the exponent [-]. Two cuts whose resistances scatter by
10 % tell it to 0.35 there (standard deviation), the prior of one given by hand to 0.26."""


def check_speeds(
    fitted: Collection[str], speeds: Mapping[str, float], own: Collection[str] = (), where: str = "--fit"
) -> None:
    """Refuse a fit of the rate exponent to cuts that cannot tell it.

    At one speed the edge feels R (v / 10 mm/s)^n and nothing of its parts. Where R is held it counts as known at the
    reference speed.

    Args:
        fitted: Names of what is fitted.
        speeds: Real speed of each cut [m/s], by name.
        own: Which of the fitted each cut has for itself.
        where: What asks for it, for the message.

    Raises:
        MaterialError: The speeds are alike, or each cut has an exponent or an R of its own.
    """
    if RATE_EXPONENT not in fitted:
        return
    for name in (RATE_EXPONENT, "R"):
        if name in own and name in fitted:
            raise MaterialError(
                f"own {name}: a cut with {name} of its own tells nothing of how R depends on the speed; leave "
                f"{name} out of own, or {RATE_EXPONENT} out of fit"
            )
    known = list(speeds.values())
    told = known if "R" in fitted else [*known, REFERENCE_SPEED]
    if max(told) >= LEAST_SPEED_RATIO * min(told):
        return
    cuts = f"the speed of one cut ({', '.join(speeds)})" if len(speeds) == 1 else f"the speeds of {', '.join(speeds)}"
    raise MaterialError(
        f"{where} {RATE_EXPONENT}: {cuts}, {interval(min(known), max(known), 'm/s', digits=None)}, cannot tell it from "
        f"R; fit cuts whose speeds are a factor of {LEAST_SPEED_RATIO:g} or more apart in one study (--config), or "
        f"leave {RATE_EXPONENT} out"
    )
