"""The part of a page in which one simulation of the fit after the other is picked, with its curve and its values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from reports.base.format import DASH, interval, quantity
from reports.web.markup import Markup, data, element, joined, table

if TYPE_CHECKING:
    from calib.calibration.members import Member, Members
    from calib.uncertainty.estimates import FittedParameter

Fitted = Mapping[str, "FittedParameter"]

WHAT = (
    "A member is one simulation that the fit made and stored: its force, filtered as the trace was, and the values "
    "that it was run with. Members are where the search looked, not draws from the posterior: how many lie somewhere "
    "says nothing of how probable it is there, and one whose values lie within all intervals can still be improbable. "
    "The draws behind the 95 % band are not stored."
)
NEAREST = "The best values need not be those nearest to the trace: the fit weighs its peak and the literature as well."
GRIDS = {"fine": "grid that counts", "coarse": "screening grid"}
"""What the grids of a store are called."""
SCREENED = (
    "A member on the screening grid has larger cells and a faster blade: its force is not that of the same values on "
    "the grid that counts."
)
NONE = "No curves of single simulations are stored in this folder, so there is no member to pick."


def picker(fitted: Fitted, members: Members | None) -> Markup | None:
    """The choice of a member and the values of the chosen one, to stand below the chart.

    Args:
        fitted: The fitted parameters, by name.
        members: Simulations to choose from; None where they were not read.

    Returns:
        Both; None where there is nothing to choose.
    """
    if members is None or not members.shown:
        return None
    shown = members.shown
    texts = {"values": [_values(m, fitted) for m in shown], "inside": [_inside(m, fitted) for m in shown]}
    return joined([
        element("div", _choice(shown), _chosen(fitted), hidden=True, id="choice"), data("texts", texts)
    ])  # fmt: skip


def members_section(fitted: Fitted, members: Members | None) -> Markup:
    """The section of the members: what they are, and all as a table.

    Args:
        fitted: The fitted parameters, by name.
        members: Simulations to choose from; None where they were not read.

    Returns:
        The section.
    """
    if members is None or not members.shown:
        return element("section", element("h2", "Members"), element("p", NONE), id="members")
    shown = members.shown
    first = f"those on the {GRIDS['fine']} and the nearest to the trace first"
    count = f"{len(shown)} of {members.stored} are here, {first}."
    screened = SCREENED if any(m.grid == "coarse" for m in shown) else ""
    return element(
        "section",
        element("h2", "Members"),
        element("p", WHAT),
        element("p", " ".join(filter(None, (count, NEAREST, screened)))),
        _all(shown, fitted),
        id="members",
    )


def named(member: Member) -> str:
    """What a member is called: its number, grid, agreement, and what it is known for."""
    text = f"{member.number}: {GRIDS[member.grid]}, NRMSE {_nrmse(member)}, peak {quantity(member.peak_N, 'N')}"
    known = ["the best values"] * member.best
    known += [f"best of mode {k}" for k in member.modes]
    return f"{text}; {', '.join(known)}" if known else text


def _choice(shown: tuple[Member, ...]) -> Markup:
    options = [element("option", "none", value="")]
    options += [element("option", named(m), value=str(k)) for k, m in enumerate(shown)]
    return element(
        "p",
        element("label", "Member ", element("select", *options, id="member")),
        element("button", "‹ previous", type="button", id="previous"),
        element("button", "next ›", type="button", id="next"),
        element("label", element("input", type="checkbox", id="every"), " all in the chart, to click on"),
        element("a", "what a member is", href="#members"),
        class_="choice",
    )


def _chosen(fitted: Fitted) -> Markup:
    """Values of the chosen member, which the script fills in, beside those of the fit."""
    head = ("Parameter", "Member", "Fitted value", "95 % interval", "Member in the interval")
    rows = [
        [
            element("code", name),
            None,
            quantity(p.value, p.unit),
            interval(p.low95, p.high95, p.unit, like=p.value),
            None,
        ]
        for name, p in fitted.items()
    ]
    return element("div", table(head, rows, (1, 2, 3), id="chosen", label="The chosen member"), hidden=True)


def _all(shown: tuple[Member, ...], fitted: Fitted) -> Markup:
    """All members as a table; the first cell of a row picks it."""
    rows = []
    for k, m in enumerate(shown):
        pick = element("button", str(m.number), type="button", data_member=str(k), aria_label=f"pick member {named(m)}")
        known = ", ".join([*(["best values"] * m.best), *(f"mode {i}" for i in m.modes)])
        rows.append([pick, GRIDS[m.grid], known, _nrmse(m), quantity(m.peak_N, "N"), *_values(m, fitted)])
    head = ("Member", "Grid", "Known as", "NRMSE", "Peak", *fitted)
    numbers = range(3, 5 + len(fitted))
    listed = table(head, rows, numbers, id="all", label="All members")
    return element("details", element("summary", "All members as a table"), listed)


def _nrmse(member: Member) -> str:
    return quantity(member.nrmse, "fraction")


def _values(member: Member, fitted: Fitted) -> list[str]:
    """Values of the fitted parameters."""
    return [quantity(member.parameters.get(name), p.unit) for name, p in fitted.items()]


def _inside(member: Member, fitted: Fitted) -> list[str]:
    """Whether each value lies in its interval: yes, no, or a dash where there is none."""
    said = []
    for name, p in fitted.items():
        x, low, high = member.parameters.get(name), p.low95, p.high95
        if x is None or (low is None and high is None):
            said.append(DASH)
        else:
            said.append("yes" if (low is None or low <= x) and (high is None or x <= high) else "no")
    return said
