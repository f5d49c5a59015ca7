"""A calibration as text for a terminal and as a table for a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Protocol

from calib.calibration.result_parts import Agreement, Posterior, SearchHistory, TraceSource
from calib.uncertainty.estimates import FittedParameter
from calib.validation.acceptance import Verdict, identified_words
from mpm.output.verdict_words import verdict_word

STRONG = 0.1
"""Correlations below this are left out of the text."""
STATES = {True: "passed", False: "FAILED", None: "not run"}
"""What a line of the verdict says."""


class Reported(Protocol):
    """What a calibration tells of itself; :class:`calib.calibration.result.CalibrationResult` does."""

    @property
    def food(self) -> str:
        """Name of the food."""

    @property
    def status(self) -> str:
        """Whether the run came to its end."""

    @property
    def passed(self) -> bool:
        """Whether no line of the verdict failed."""

    @property
    def trace(self) -> TraceSource:
        """The record that was fitted."""

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Lines of the verdict."""

    @property
    def fitted(self) -> Mapping[str, FittedParameter]:
        """Fitted parameters, by name."""

    @property
    def agreement(self) -> Agreement:
        """The simulated curve against the trace."""

    @property
    def posterior(self) -> Posterior:
        """What is known of all parameters together."""

    @property
    def history(self) -> SearchHistory:
        """The simulations of the search."""


def fit_report(result: Reported) -> str:
    """Statistics, verdicts, parameters and the strongest correlations of a calibration, as text.

    Args:
        result: The calibration.

    Returns:
        Lines of at most 120 columns, in the layout of lmfit's reports.
    """
    lines = [f"[[Calibration]] {_headline(result)}", "[[Fit statistics]]"]
    lines += [f"    {name:28s}= {text}" for name, text in _statistics(result)]
    lines.append(f"[[Verdicts]] {identified_words(result.fitted).partition(':')[0]}")
    for v in result.verdicts:
        limit = "" if v.limit is None else f"({relation(v)} {v.limit:.3g})"
        lines.append(f"    {STATES[v.passed]:8s}{v.name:44s}{_number(v.value):>10s}  {limit}".rstrip())
    lines.append("[[Parameters]] value, 95 % interval, 95 % range of the literature")
    for name, p in result.fitted.items():
        interval, prior = _range(p.low95, p.high95), _range(p.prior_low, p.prior_high)
        value = f"{p.value:.4g} {p.unit}"
        lines.append(f"    {name + ':':19s}{value:16s}{interval:24s}{prior:24s}{verdict_word(p.verdict)}".rstrip())
    lines.append(f"[[Correlations]] below {STRONG:g} left out")
    lines += [f"    C({pair.replace(',', ', ')}) = {c:+.3f}" for pair, c in strongest(result.posterior.correlations)]
    return "\n".join(lines)


def strongest(correlations: Mapping[str, float | None]) -> list[tuple[str, float]]:
    """The correlations of at least :data:`STRONG`, the strongest first.

    Args:
        correlations: By "one,other"; each pair may stand there in either order, or in both.
    """
    found: dict[frozenset[str], tuple[str, float]] = {}
    for pair, c in correlations.items():
        names = frozenset(pair.split(","))
        if c is not None and len(names) == 2 and abs(c) >= STRONG:
            found.setdefault(names, (pair, c))
    return sorted(found.values(), key=lambda item: -abs(item[1]))


def html_table(result: Reported) -> str:
    """The fitted parameters as a small HTML table, with a line about the fit above it."""
    rows = [
        "".join(
            f"<td>{escape(cell)}</td>"
            for cell in (name, f"{p.value:.4g}", p.unit, _range(p.low95, p.high95), verdict_word(p.verdict))
        )
        for name, p in result.fitted.items()
    ]
    head = "".join(f"<th>{word}</th>" for word in ("parameter", "value", "unit", "95 % interval", "verdict"))
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<p>{escape(_headline(result))}</p><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _headline(result: Reported) -> str:
    """Food, trace and outcome in a line."""
    state = "interrupted" if result.status == "interrupted" else "passed" if result.passed else "not passed"
    return f"{result.food}, {result.trace.source} ({result.trace.label}): {state}"


def _statistics(result: Reported) -> list[tuple[str, str]]:
    """What is known of the fit as a whole, by name."""
    agreement, posterior, history = result.agreement, result.posterior, result.history
    return [
        ("simulations", f"{history.every.simulations} ({history.every.failed} failed)"),
        ("fitted parameters", str(len(result.fitted))),
        ("peak, simulated", f"{agreement.peak_sim_N:.3g} N"),
        ("peak, of the trace", f"{agreement.peak_real_N:.3g} N"),
        ("NRMSE", _number(agreement.metrics.nrmse)),
        ("reduced chi-square", _number(posterior.reduced_chi2)),
        ("trace within the 95 % band", _number(posterior.predictive_inside)),
    ]


def relation(v: Verdict) -> str:
    """Whether the limit is the largest or the smallest value that passes: it follows from value and outcome.

    Args:
        v: A line with a limit.

    Returns:
        ``<=`` or ``>=``; the word limit where neither follows.
    """
    if v.relation or v.value is None or v.limit is None or v.passed is None:
        return v.relation or "limit"
    if abs(v.value) == v.limit:
        return "<=" if v.passed else "limit"
    return "<=" if (abs(v.value) < v.limit) == v.passed else ">="


def _number(x: float | None) -> str:
    """A number in three digits, a dash where it is not known."""
    return "-" if x is None else f"{x:.3g}"


def _range(low: float | None, high: float | None) -> str:
    """Two ends of an interval, a dash where they are not known."""
    return "-" if low is None or high is None else f"{low:.3g} to {high:.3g}"
