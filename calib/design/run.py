"""The design of the next test: simulate each candidate about what is known, judge, write."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from calib.design.candidates import Candidate, LeftOut, candidates, coarse_cut, minutes_of
from calib.design.expectation import FIRST, Expectation, Judged, Outlook, judge
from calib.design.quantity import Quantity, asked_quantity
from calib.design.result import ALL, DesignedTest, DesignResult, Expected, Known, to_document
from calib.design.start import Start
from calib.design.stencil import CutScene, Simulator, Stencil, stencils, steps_of
from calib.errors import OutputError
from calib.io.folder import prepare, write_json
from calib.io.provenance import Invocation, Software, key_of
from calib.material.remarks import notes
from calib.problem.parameters import Z95, Parameter
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.workers import Workers
from mpm.arrays import FloatArray
from mpm.scene import Knife

ASKED = "what is asked for"
APART = 1.5
"""Ratio of the normal approximation's interval to the calibration's own from which on it is said [-]."""


@dataclass(frozen=True, eq=False)
class DesignRequest:
    """What is asked of a design.

    Attributes:
        start: What is known.
        asked: What is to be narrowed: ``all``, a parameter, ``peak under knife NAME`` or ``work under knife NAME``.
        blades: Other blades that the lab has; None for those of ``knives.yaml``.
        minutes: Lab work [min] by kind of test, where it is known better.
        draws: Foods about which the tests are judged: the present values, and draws from what is known.
        seed: Seed of the draws.
        command: Command line, for provenance.
    """

    start: Start
    asked: str = ALL
    blades: tuple[Knife, ...] | None = None
    minutes: dict[str, float] = field(default_factory=dict)
    draws: int = 1
    seed: int = 0
    command: tuple[str, ...] = ()


def run(request: DesignRequest, out: Path, pool: Workers, *, resume: bool, say: Callable[[str], None]) -> DesignResult:
    """Judge every test, and write design.json and design.svg.

    Args:
        request: What is asked.
        out: Output folder.
        pool: Where the simulations run.
        resume: Go on with the design in ``out``.
        say: Called with a line after each simulation.

    Returns:
        The result.

    Raises:
        CutcalError: Anything wrong with the input, or a food that is not cut at its present values.
    """
    start = request.start
    minutes = minutes_of(request.minutes)
    quantity = asked_quantity(start, request.asked)
    tests, left_out = candidates(start, request.blades)
    for text in notes(start.food):
        say(f"note: {text}")
    with prepare(out, "design", resume=resume), threadpool_limits(1, "blas"):
        began = time.monotonic()
        header = Header(
            "", key_of({"food": start.food.name, "values": start.parameters.to_dict(start.parameters.start)})
        )
        with EvaluationStore(out / "evaluations.h5", header, resume=resume, say=say) as store:
            simulator = Simulator(pool, store, say)
            found = _Design(request, tests, quantity, simulator, say).expected()
        result = _result(request, found, tests, left_out, minutes, simulator, began)
        write_json(out / "design.json", to_document(result))
        from reports.studies.design import write_figure

        write_figure(result, out)
        return result


@dataclass(frozen=True, eq=False)
class _Found:
    """What was expected, the value of the quantity that was asked for, and why cuts of tests are none."""

    expectation: Expectation
    quantity: Quantity | None
    value: float
    broken: dict[str, str]


@dataclass(eq=False)
class _Design:
    """A design while its simulations run."""

    request: DesignRequest
    tests: list[Candidate]
    quantity: Quantity | None
    simulator: Simulator
    say: Callable[[str], None]

    def expected(self) -> _Found:
        """Judge the tests about the present values, then about draws."""
        start = self.request.start
        random = np.random.default_rng(self.request.seed)
        expectation, value, reasons = Expectation(), math.nan, dict[str, str]()
        for draw in range(self.request.draws):
            z = start.parameters.start
            if draw > 0:
                root = np.linalg.cholesky(expectation.foods[0].now)
                z = start.parameters.clip(z + root @ random.standard_normal(len(z)))
                self.say(f"food {draw + 1} of {self.request.draws}, drawn from what is known")
            about = self._about(z)
            unsound = {name: one.fault for name, one in about.items() if not one.sound}
            reasons = unsound | reasons
            broken = [name for name in (FIRST, ASKED) if name in unsound]
            if broken and draw == 0:
                raise OutputError(_broken(start, broken[0], unsound[broken[0]]))
            if broken:
                self.say(f"left out: {broken[0]} does not cut this food")
                continue
            expectation.foods.append(self._judged(about, z))
            if draw == 0 and self.quantity is not None:
                value = self.quantity.value(about[ASKED].centre, self._stroke)
        return _Found(expectation, self.quantity, value, reasons)

    @property
    def _stroke(self) -> float:
        return min(self.request.start.stroke, self.request.start.shape.height)

    def _about(self, z: FloatArray) -> dict[str, Stencil]:
        """Simulate every cut about a food."""
        start = self.request.start
        cuts = {t.name: CutScene(t.scene) for t in self.tests if t.scene is not None}
        if start.run is not None:
            cuts[FIRST] = CutScene(coarse_cut(start, start.knife, start.shape), True, start.kept)
        if self.quantity is not None:
            cuts[ASKED] = CutScene(coarse_cut(start, self.quantity.knife, start.shape))
        return stencils(self.simulator, cuts, start.parameters, z, steps_of(start.parameters, start.present_sd))

    def _judged(self, about: dict[str, Stencil], z: FloatArray) -> Judged:
        gradient = None if self.quantity is None else self.quantity.gradient(about[ASKED], self._stroke)
        return judge(self.request.start, self.tests, about, z, gradient)


def _broken(start: Start, name: str, fault: str) -> str:
    which = "the cut of the calibration" if name == FIRST else "the cut that is asked for"
    return f"{which} is none on coarse cells at the present values of {start.food.name}: {fault}; no test can be judged"


def _result(
    request: DesignRequest,
    found: _Found,
    tests: list[Candidate],
    left_out: list[LeftOut],
    minutes: dict[str, float],
    simulator: Simulator,
    began: float,
) -> DesignResult:
    """The typed result."""
    start = request.start
    sd = found.expectation.sd_now()
    designed, broken = [], []
    for test in tests:
        outlook = found.expectation.of(test.name)
        if outlook is None:
            broken.append(LeftOut(test.name, found.broken[test.name]))
        else:
            designed.append(_designed(request, found, test, outlook, minutes[test.kind]))
    return DesignResult(
        food=start.food.name,
        run=None if start.run is None else str(start.run),
        knife=start.knife.name,
        asked=request.asked,
        known={p.name: _known(start, p, float(s)) for p, s in zip(start.parameters, sd, strict=True)},
        quantity=_quantity(found),
        tests=tuple(sorted(designed, key=lambda t: _order(request.asked, t))),
        left_out=(*left_out, *broken),
        simulations=simulator.runs,
        failed_simulations=simulator.failed,
        invocation=Invocation(request.seed, simulator.pool.arch, request.command),
        software=Software.here(),
        warnings=tuple(start.food.warnings()),
        limits=tuple(_limits(start, sd, request.draws)),
        wall_s=time.monotonic() - began,
    )


def _order(asked: str, test: DesignedTest) -> tuple[float, float]:
    """What tests are sorted by: what is left of what was asked for, then the minutes."""
    if test.asked is not None:
        return round(test.asked.part, 3), test.minutes
    return (
        (-round(test.bits, 3), test.minutes) if asked == ALL else (round(test.parameters[asked].part, 3), test.minutes)
    )


def _designed(request: DesignRequest, found: _Found, test: Candidate, outlook: Outlook, minutes: float) -> DesignedTest:
    """A test as the document has it."""
    start = request.start
    sd = found.expectation.sd_now()
    after = {
        p.name: _expected(p, float(part), float(part * s))
        for p, part, s in zip(start.parameters, outlook.parts, sd, strict=True)
    }
    asked = after.get(request.asked)
    if outlook.asked is not None:
        low, high = _ends(found.value, outlook.asked * found.expectation.asked_now())
        asked = Expected(low, high, min(outlook.asked, 1.0))
    return DesignedTest(
        test.name, test.kind, test.what, test.taken_by, minutes, outlook.bits, asked, after, outlook.foods
    )


def _expected(p: Parameter, part: float, sd: float) -> Expected:
    low, high = _interval(p, sd)
    return Expected(low, high, min(part, 1.0))


def _interval(p: Parameter, sd: float) -> tuple[float, float]:
    """95 % interval about the present value [unit], within the bounds."""
    z = p.to_internal(p.value)
    return p.from_internal(z - Z95 * sd), p.from_internal(z + Z95 * sd)


def _ends(value: float, sd: float) -> tuple[float, float]:
    """95 % interval of a quantity whose logarithm has this standard deviation."""
    return value * math.exp(-Z95 * sd), value * math.exp(Z95 * sd)


def _known(start: Start, p: Parameter, sd: float) -> Known:
    low, high = _interval(p, sd)
    return Known(p.value, p.unit, low, high, start.reported.get(p.name))


def _quantity(found: _Found) -> Known | None:
    if found.quantity is None:
        return None
    low, high = _ends(found.value, found.expectation.asked_now())
    return Known(found.value, found.quantity.unit, low, high)


def _limits(start: Start, sd: FloatArray, draws: int) -> list[str]:
    """What the result does not show."""
    out = [
        "Intervals are those of a normal approximation on coarse cells: a second valley is not seen, and a test that "
        "would tell two valleys apart is worth more than is said here.",
        f"The tests are judged about {draws} food{'s' if draws > 1 else ''}: the present values"
        + (" and draws from what is known." if draws > 1 else " alone."),
        "Minutes of lab work are assumed, and so are the errors of caliper, photograph and compression.",
    ]
    if start.run is not None:
        out.append(
            "Another specimen is taken to have the same flesh as the first, and a skin and a start of its own; foods "
            "of one kind scatter by a quarter."
        )
    for p, s in zip(start.parameters, sd, strict=True):
        if p.name in start.reported:
            low, high = (p.to_internal(x) for x in start.reported[p.name])
            ratio = 2.0 * Z95 * float(s) / max(high - low, 1e-12)
            if not 1.0 / APART < ratio < APART:
                out.append(
                    f"The calibration's interval of {p.name} is {1.0 / ratio:.2g} times as wide as the normal "
                    "approximation, so the widths after a test are of that order only; the parts hold better."
                )
    return out
