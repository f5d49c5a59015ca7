"""Foods between board and plate or under a wedge: particles against finite elements, force over stroke."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem_reference.indentation import Mesh, indent
from fem_reference.press import Curve, Elements, press
from mpm.arrays import FloatArray
from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.result import Comparison

PRESSED_MATERIAL = Material(E=1e5, nu=0.35, rho=1000.0, loss_factor=0.05)
"""The loss factor takes the ringing out and adds little to the force. See docs/theory.md, "Measured choices"."""
MACH = 0.003  # speed of the plate over that of the P-wave
PRESS_CELLS = (2e-3, 1e-3)
STICKS = 9.9  # friction with which nothing slides [-]
WINDOW = 0.12  # part of the last stroke, on either side, over which the particles' force is smoothed


@dataclass(frozen=True)
class PressTest:
    """A press of particles beside finite elements.

    Attributes:
        name: Its name.
        shape: Outline of the food.
        strokes: Strokes at which forces are compared [m].
        half_angle: Half the angle of the tool [rad]; a right angle is a plate.
        bonded: Whether tool and board stick to the food.
        yield_stress: Yield stress of the food [Pa].
        poisson: Its Poisson's ratio [-].
        core: Radius of its core over that of the section, and stiffness of it over the flesh's [-]; None: it has none.
        tolerance: Largest error of a force that passes [-].
        reference: Options of the finite elements.
        mesh: Elements of a wedge on a block that flows, which touches points between the nodes; None: ``reference``.
        sizes: Cell sizes of the particles [m].
        slow: Whether it is left out of the quick part.
        cost: About the time that it takes [s].
    """

    name: str
    shape: Shape
    strokes: tuple[float, ...]
    half_angle: float = math.pi / 2
    bonded: bool = False
    yield_stress: float = math.inf
    poisson: float = PRESSED_MATERIAL.nu
    core: tuple[float, float] | None = None
    tolerance: float = 0.02
    reference: tuple[tuple[str, Any], ...] = ()
    mesh: Mesh | None = None
    sizes: tuple[float, ...] = PRESS_CELLS
    slow: bool = True
    cost: float = 90.0

    @property
    def food(self) -> Material:
        """Constants of the food."""
        food = replace(PRESSED_MATERIAL, nu=self.poisson, yield_stress=self.yield_stress)
        if self.core is None:
            return food
        # nothing is cut: resistances are there because layers have some
        return replace(food, R=1.0, R_core=1.0, core_ratio=self.core[0], core_stiffness=self.core[1])

    def by_elements(self) -> Curve:
        """Force over stroke by finite elements of the particles' law."""
        # a law with a memory wants small steps; a wedge's first contact is one row of nodes
        strokes = sorted({*self.strokes, *(np.arange(1, 9) / 8 * self.strokes[-1])})
        if self.mesh is not None:
            return indent(self.shape, self.food, self.half_angle, strokes, self.mesh)
        elements = Elements(**dict(self.reference))
        return press(self.shape, self.food, strokes, half_angle=self.half_angle, bonded=self.bonded, elements=elements)


PRESS_TESTS = (
    PressTest(
        "block, sliding", Shape("block", 0.02, 0.02, 0.02), (0.001, 0.002, 0.004), reference=(("cells", 2),), slow=False
    ),
    PressTest(
        "block, bonded",
        Shape("block", 0.02, 0.02, 0.02),
        (0.001, 0.002, 0.004),
        bonded=True,
        reference=(("cells", 4), ("order", 2)),
    ),
    PressTest(
        "upright cylinder, bonded",
        Shape("upright_cylinder", 0.024, 0.024, 0.02),
        (0.001, 0.002, 0.004),
        bonded=True,
        reference=(("cells", 4), ("order", 2)),
    ),
    PressTest(
        "cylinder of 50 x 30 mm to 40 %, sliding",
        Shape("upright_cylinder", 0.05, 0.05, 0.03),
        (0.003, 0.006, 0.009, 0.012),
        reference=(("cells", 3),),
        sizes=(3e-3, 2e-3),
    ),
    PressTest(
        "cylinder of 50 x 30 mm to 40 %, bonded",
        Shape("upright_cylinder", 0.05, 0.05, 0.03),
        (0.003, 0.006, 0.009, 0.012),
        bonded=True,
        reference=(("cells", 4), ("order", 2)),
        sizes=(3e-3, 2e-3),
    ),
    PressTest(
        "sphere",
        Shape("sphere", 0.03, 0.03, 0.03),
        (0.004, 0.005, 0.006),  # below, few elements touch and references differ (docs/theory.md, "Measured choices")
        reference=(("cells", 4), ("order", 2), ("grade", 1.2)),
        cost=300.0,
    ),
    PressTest(
        "lying cylinder",
        Shape("cylinder", 0.016, 0.03, 0.03),
        (0.002, 0.004, 0.006),
        reference=(("cells", 4), ("order", 2), ("grade", 1.2)),
        cost=300.0,
    ),
    PressTest(
        "lying cylinder with a soft core",
        Shape("cylinder", 0.016, 0.03, 0.03),
        (0.002, 0.004, 0.006),
        core=(0.6, 0.1),
        reference=(("cells", 4), ("order", 2)),
        sizes=(1.5e-3, 1e-3),  # on 2 mm three cells lie across the wall about the core (docs/theory.md, "Layers")
        cost=300.0,
    ),
    PressTest(
        "wedge of 140 degrees on a block",
        Shape("block", 0.03, 0.016, 0.02),
        (0.002, 0.003, 0.004),  # below, one row of elements is not enough (docs/theory.md, "Measured choices")
        half_angle=math.radians(70),
        reference=(("cells", 5), ("order", 2), ("grade", 1.3)),
        cost=300.0,
    ),
    PressTest(
        "wedge of 140 degrees on a lying cylinder",
        Shape("cylinder", 0.016, 0.03, 0.03),
        (0.002, 0.004, 0.006),
        half_angle=math.radians(70),
        reference=(("cells", 7), ("grade", 1.2)),
        cost=300.0,
    ),
    PressTest(
        "block, sliding, J2",
        Shape("block", 0.02, 0.02, 0.02),
        (0.001, 0.002, 0.004),
        yield_stress=8e3,
        tolerance=0.03,
        reference=(("cells", 2),),
    ),
    PressTest(
        "block, bonded, J2",
        Shape("block", 0.02, 0.02, 0.02),
        (0.001, 0.002, 0.004),
        bonded=True,
        yield_stress=8e3,
        tolerance=0.03,
        reference=(("cells", 4), ("order", 2), ("mixed", True)),  # without it they lock: 2.6 % more at 4 mm
    ),
    *(
        PressTest(
            f"cylinder of 50 x 30 mm to 30 %, bonded, nu {poisson:g}",
            Shape("upright_cylinder", 0.05, 0.05, 0.03),
            (0.003, 0.006, 0.009),
            bonded=True,
            poisson=poisson,
            reference=(("cells", 4), ("order", 2), ("mixed", True)),
            sizes=(3e-3, 2e-3),
            cost=250.0,
        )
        for poisson in (0.45, 0.49)
    ),
    PressTest(
        "wedge of 90 degrees on a block, J2",
        Shape("block", 0.03, 0.016, 0.02),
        (0.002, 0.003),
        half_angle=math.radians(45),
        yield_stress=8e3,
        tolerance=0.03,
        mesh=Mesh(1.5e-3, layers=2),
        sizes=PRESS_CELLS[1:],  # on the coarser ones it touches one cell at 2 mm
        cost=150.0,
    ),
    PressTest(
        "wedge of 140 degrees on a block, J2",
        Shape("block", 0.03, 0.016, 0.02),
        (0.002, 0.003),
        half_angle=math.radians(70),
        yield_stress=8e3,
        tolerance=0.03,
        mesh=Mesh(1.5e-3, layers=2),
        cost=200.0,
    ),
)


def particles(options: SuiteOptions, test: PressTest, dx: float, *, mach: float = MACH) -> FloatArray:
    """Force of the particles at the strokes of a press.

    Args:
        options: Seed and device.
        test: The press.
        dx: Cell size [m].
        mach: Speed of the plate over that of the P-wave [-].

    Returns:
        The forces [N], shape (n,); NaN where the run broke down.
    """
    friction = STICKS if test.bonded else 0.0
    end = test.strokes[-1] * (1 + WINDOW)
    scene = Scene(
        Food(test.shape, test.food),
        Press(half_angle=test.half_angle, mu=friction),
        Motion(end, mach),
        Board(friction),
        numerics=Numerics(dx=dx, gravity=0.0, output=end / 400),
    )
    record = options.simulate(scene)
    if record.status != "done":
        return np.full(len(test.strokes), math.nan)
    near = WINDOW * test.strokes[-1]
    middle = 0.5 * (record.stroke[1:] + record.stroke[:-1])  # a force is the mean of its interval
    return np.array([_at(middle, record.face[1:, 2], s, near) for s in test.strokes])


def _at(stroke: FloatArray, force: FloatArray, s: float, near: float) -> float:
    """Force at a stroke from a parabola through what is near it, without the ringing of the body [N]."""
    on = np.abs(stroke - s) < near
    return float(np.polyfit(stroke[on] - s, force[on], 2)[2])


def compare(options: SuiteOptions, test: PressTest, sizes: Sequence[float]) -> Iterator[Comparison]:
    """Comparisons of one press: the largest error over the strokes, on each grid.

    Args:
        options: Quick or whole, seed, device.
        test: The press.
        sizes: Cell sizes [m].

    Yields:
        A comparison for each grid.
    """
    curve = test.by_elements()
    want = np.interp(test.strokes, curve.stroke, curve.force)
    misses = []
    for dx in sizes:
        got = particles(options, test, dx)
        k = int(np.argmax(np.abs(got / want - 1))) if np.isfinite(got).all() else 0
        misses.append(float(got[k] / want[k] - 1))
        name = f"{test.name}, dx {dx * 1e3:g} mm"
        source = f"finite elements of the same law, {curve.unknowns} unknowns"
        yield Comparison(
            name, f"force at {test.strokes[k] * 1e3:g} mm [N]", float(want[k]), float(got[k]), test.tolerance, source
        )


def _case(test: PressTest) -> VerificationCase:
    def run(options: SuiteOptions) -> Iterator[Comparison]:
        yield from compare(options, test, test.sizes[:1] if options.quick else test.sizes)

    return VerificationCase(f"press: {test.name}", run, fast=not test.slow, cost=test.cost)


CASES = [_case(test) for test in PRESS_TESTS]
