"""Rate of the kernels on a block, beside that of the textbook's, of other codes, and of what the memory would bear."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from calib.io.progress import clock
from mpm.arrays import FloatArray
from mpm.scene import EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.speed.peers import PEERS, measure
from studies.speed.result import MeasuredPeer, PeerResult, PublishedConfiguration, Throughput, UnmeasuredPeer
from studies.speed.standing_block import GRAVITY, Standing, StandingBlock, stand
from studies.speed.timing import RateMeter, Session

# The published configuration: nodes along each axis, time step [s] (CulinaryCut, section 4.1). Its cell is the one with
# which the cube holds a whole banana, its speed that of the robot whose cuts are published with their forces (50 mm/s).
PAPER_NODES, PAPER_DT, PAPER_DX, PAPER_SPEED = 120, 2e-5, 2e-3, 0.05
BENCHMARK_BLOCK = Scene(
    Food(
        Shape("block", 0.04, 0.08, 0.04),
        Material(E=1e6, nu=0.35, rho=1000, yield_stress=1e5, R=200, mu=0.3, tensile_strength=2e5, fracture_energy=200),
    ),
    Knife("wedge", 2e-3, 0.19, 0.0104, 0.2),
    Motion(2e-3, 0.01),
    edge=EdgeLaw(zone=3e-3),
    numerics=Numerics(dx=2e-3, mirror=False),
)
TEXTBOOK_STEPS = 10
NUMBERS_TO_GRID = 46  # F twice, C, stress, the last stretch, x, v, two indices
NUMBERS_TO_PARTICLES = 29  # x twice, v, C, two indices, height of contact, two stretches
NUMBERS_OF_NODES = 3  # the nodes, each for eight particles, cleared, added to, turned to velocities and read
NUMBERS_PER_PARTICLE_STEP = NUMBERS_TO_GRID + NUMBERS_TO_PARTICLES + NUMBERS_OF_NODES
"""What a particle step has to move to and from memory in a scene that no cache holds, in numbers of eight bytes."""
COPIED_NUMBERS = 1 << 23  # numbers that a thread copies to measure the bandwidth: 64 MiB
COPIES = 5  # of which the fastest counts


def throughput(session: Session, cut: Scene) -> Throughput:
    """Particle steps a second of the block, ours and the textbook's in turns, and inside the default cut.

    Args:
        session: What all measurements share.
        cut: The default cut.

    Returns:
        The rates.
    """
    from studies.speed.textbook import Textbook

    kept, runtime, block = session.kept, session.runtime, BENCHMARK_BLOCK
    ours = kept.get(block, runtime)
    dt, dx = ours.run().dt, block.numerics.dx
    textbook = Textbook(block, dx=dx, dt=dt, speed=PAPER_SPEED, nodes=PAPER_NODES, runtime=runtime)
    textbook.run(1)
    meter, yardstick = RateMeter(ours), 0.0
    for _ in range(session.repeats):
        meter.run()
        yardstick = max(yardstick, textbook.run(TEXTBOOK_STEPS).rate)
    kept.drop()
    one = kept.get(replace(block, numerics=replace(block.numerics, precision="f32")), runtime)
    one.run()
    single = RateMeter(one).run(session.repeats)
    kept.drop()
    whole = kept.get(cut, runtime)
    whole.run()
    inside = RateMeter(whole).run(session.repeats)
    speed = bandwidth(runtime.cpu_threads)
    found = Throughput(
        particles=textbook.n,
        bandwidth_GBps=speed / 1e9,
        bytes_per_particle_step=8 * NUMBERS_PER_PARTICLE_STEP,
        memory_bound_Mps=speed / (8 * NUMBERS_PER_PARTICLE_STEP) / 1e6,
        full_physics_Mps=meter.rate / 1e6,
        single_Mps=single / 1e6,
        textbook_Mps=yardstick / 1e6,
        ratio=meter.rate / yardstick,
        cut_Mps=inside / 1e6,
    )
    session.say(
        f"{found.particles} particles: {found.full_physics_Mps:.2f} million particle steps a second, textbook "
        f"{found.textbook_Mps:.2f} ({found.ratio:.1f} times); in single precision {found.single_Mps:.2f}; "
        f"inside the cut {found.cut_Mps:.2f}; the memory would bear {found.memory_bound_Mps:.0f}"
    )
    return found


def published_configuration(session: Session, whole: Scene, stroke: float) -> PublishedConfiguration:
    """Time that the published configuration needs for the same stroke, from a few of its steps.

    Args:
        session: What all measurements share.
        whole: The cut of the whole food.
        stroke: Stroke of the default cut [m].

    Returns:
        The configuration with its times.
    """
    from studies.speed.textbook import Textbook

    textbook = Textbook(whole, dx=PAPER_DX, dt=PAPER_DT, speed=PAPER_SPEED, nodes=PAPER_NODES, runtime=session.runtime)
    textbook.run(1)
    step = min(textbook.run(TEXTBOOK_STEPS).seconds for _ in range(session.repeats))
    steps = stroke / (PAPER_SPEED * PAPER_DT)
    found = PublishedConfiguration(
        nodes=PAPER_NODES,
        dx_m=PAPER_DX,
        dt_s=PAPER_DT,
        particles=textbook.n,
        steps=round(steps),
        step_s=step,
        wall_s_extrapolated=step * steps,
    )
    took = clock(found.wall_s_extrapolated)
    session.say(f"published configuration: {step * 1e3:.1f} ms a step, {took} for the cut")
    return found


def peers(session: Session, python: str) -> tuple[PeerResult, ...]:
    """A block on which its weight is put at once, ours before and after each peer.

    All in single precision, which is the peers' default, with the same cells, particles and, where they are explicit,
    time steps.

    Args:
        session: What all measurements share.
        python: Interpreter that has the packages of the peers.

    Returns:
        A result for each peer.
    """
    numerics = replace(BENCHMARK_BLOCK.numerics, precision="f32", gravity=GRAVITY)
    session.kept.drop()
    results = []
    for name in PEERS:
        block, before = stand(BENCHMARK_BLOCK.food.shape, numerics, session.runtime)
        answer = measure(python, name, block.task(session.runtime.arch), session.runtime.cpu_threads)
        _, after = stand(BENCHMARK_BLOCK.food.shape, numerics, session.runtime)
        results.append(_peer_result(answer, block, min(before, after, key=lambda one: one.seconds)))
        session.say(_peer_words(results[-1]))
    return tuple(results)


def _peer_result(answer: Mapping[str, Any], block: StandingBlock, ours: Standing) -> PeerResult:
    """What a peer answered, beside ours."""
    if "seconds" not in answer:
        return UnmeasuredPeer(answer["name"], answer["error"])
    if not np.isfinite(answer["velocity"]).all():
        return UnmeasuredPeer(answer["name"], "its block has broken down: velocities that are no numbers")
    rate = answer["particles"] / answer["seconds"]
    return MeasuredPeer(
        name=answer["name"],
        seconds=answer["seconds"],
        version=answer["version"],
        particles=answer["particles"],
        Mps=rate / 1e6,
        ours_Mps=ours.rate / 1e6,
        ratio=ours.rate / rate / answer["longer"],
        force_error=block.force_error(answer["velocity"]),
        ours_force_error=ours.force_error,
    )


def _peer_words(peer: PeerResult) -> str:
    if isinstance(peer, UnmeasuredPeer):
        return f"{peer.name}: not measured, {peer.error}"
    return (
        f"{peer.name} {peer.version}: {peer.Mps:.2f} million particle steps a second (ours {peer.ours_Mps:.2f}), "
        f"{peer.ratio:.1f} times our time; error of the force {peer.force_error:.1%} (ours {peer.ours_force_error:.1%})"
    )


def bandwidth(threads: int) -> float:
    """Bytes a second that so many threads read and write together when each copies an array that no cache holds."""
    arrays = [(np.ones(COPIED_NUMBERS), np.empty(COPIED_NUMBERS)) for _ in range(threads)]

    def copy(pair: tuple[FloatArray, FloatArray]) -> None:
        np.copyto(pair[1], pair[0])  # lets other threads run meanwhile

    best = np.inf
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(COPIES):
            began = time.perf_counter()
            list(pool.map(copy, arrays))
            best = min(best, time.perf_counter() - began)
    return 2 * 8 * COPIED_NUMBERS * threads / best
