"""Several cuts side by side: on a GPU each launch does a step of them all, on CPUs a thread does each of them."""

from __future__ import annotations

from collections.abc import Sequence

from mpm.output.record import ForceRecord
from mpm.run import REST, CutRun
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.solver import Simulation, state_of
from mpm.state import host_transfer
from mpm.state.state import Configuration
from mpm.step.time_step import advance


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
        alike: dict[Configuration, dict[int, Simulation]] = {}
        for k, scene in enumerate(scenes):
            if scene.numerics.precision == precision:
                simulation = Simulation(scene, runtime, alone=False)
                alike.setdefault(simulation.setup.configuration(0), {})[k] = simulation
        for group in alike.values():
            found |= zip(group, _run(list(group.values())), strict=True)
    return [found[k] for k in range(len(scenes))]


def _run(cuts: Sequence[Simulation]) -> list[ForceRecord]:
    """Run cuts whose fields are of one configuration."""
    setup = cuts[0].setup
    state = state_of(setup.configuration(min(setup.threads(), 1), len(cuts)), cuts[0].serial)
    for place, cut in enumerate(cuts):
        cut.state, cut.place = state, place
    state.owner = cuts
    host_transfer.begin(state, [cut.setup.contents(cut.scene.food.material) for cut in cuts])
    runs = [CutRun(cut.setup, cut.scene) for cut in cuts]
    while any(orders := [run.order() for run in runs]):
        reports = advance(state, [order or REST for order in orders])
        for cut, run, order, report in zip(cuts, runs, orders, reports, strict=False):
            if order is not None:
                run.take(report[: -(-order.steps // order.steps_per_row)], cut.snapshot)
    return [run.record(cut.topology) for cut, run in zip(cuts, runs, strict=True)]
