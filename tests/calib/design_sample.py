"""A made-up result of a design."""

from __future__ import annotations

from calib.design.candidates import CALIBRATE, NONE, STUDY, LeftOut
from calib.design.result import DesignedTest, DesignResult, Expected, Known
from calib.io.provenance import Invocation, Software


def _test(name: str, kind: str, what: str, taken_by: str, minutes: float, part: float) -> DesignedTest:
    expected = Expected(700.0 - 200.0 * part, 700.0 + 400.0 * part, part)
    return DesignedTest(name, kind, what, taken_by, minutes, 1.0 - part, expected, {"R": expected}, 1)


RESULT = DesignResult(
    food="banana",
    run="runs/x",
    knife="kitchen",
    asked="R",
    known={"R": Known(700.0, "J/m^2", 500.0, 1100.0, (450.0, 1000.0))},
    tests=(
        _test("slicing", "slicing", "slice", NONE, 20.0, 0.5),
        _test("blade edc", "blade", "cut with the edc knife", STUDY, 15.0, 0.6),
        _test("width", "width", "measure the width", CALIBRATE, 2.0, 0.7),
    ),
    left_out=(LeftOut("speed", "no law with a rate"),),
    simulations=72,
    failed_simulations=0,
    invocation=Invocation(0, "cpu", ("design", "--run", "runs/x")),
    software=Software({"cutcal": "0.1.0", "python": "3.11.9"}, None),
    warnings=(),
    limits=("A normal approximation.",),
    wall_s=40.0,
)
