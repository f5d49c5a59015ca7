"""Several cuts side by side: on a GPU each launch does a step of them all, on CPUs a thread does each of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpm.motion import REST, Course
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.solver import Simulation, kernels


def simulate_together(scenes: Sequence[Scene], *, runtime: Runtime | None = None) -> list[ForceRecord]:
    """Simulate cuts side by side; each is what it would be alone, but for the order of sums on a GPU.

    Those of about the same size share fields; others run after one another. On CPUs no cut has more than one thread.

    Returns:
        A record of each. One that breaks down has what it had, with its reason in ``status``; the others go on.

    Raises:
        SceneError: The device is missing or a scene does not fit into memory.
    """
    found: dict[int, ForceRecord] = {}
    for precision in dict.fromkeys(scene.numerics.precision for scene in scenes):
        alike: dict[tuple[Any, ...], dict[int, Simulation]] = {}
        for k, scene in enumerate(scenes):
            if scene.numerics.precision == precision:
                simulation = Simulation(scene, runtime, alone=False)
                alike.setdefault(simulation.kind(0), {})[k] = simulation
        for group in alike.values():
            found |= zip(group, _run(list(group.values())), strict=True)
    return [found[k] for k in range(len(scenes))]


def _run(cuts: Sequence[Simulation]) -> list[ForceRecord]:
    """Run cuts whose fields are of one kind."""
    k: Any = kernels(cuts[0].kind(min(cuts[0].threads(), 1), len(cuts)), cuts[0].serial)
    for place, cut in enumerate(cuts):
        cut.k, cut.place = k, place
    k.user = cuts
    k.begin([cut.contents(cut.scene.food.material) for cut in cuts])
    courses = [Course(cut, cut.scene) for cut in cuts]
    while any(orders := [course.order() for course in courses]):
        reports = k.go([order or REST for order in orders])
        for course, order, report in zip(courses, orders, reports, strict=False):
            if order is not None:
                course.take(report[: -(-order[0] // order[1])])
    return [course.record() for course in courses]
