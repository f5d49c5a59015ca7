"""Run time against error of one cut, what each economy brings, and the rate of the kernels beside the textbook's.

All ratios are of runs that take turns in one process, the least time of each: a machine that is slow for a while is slow
for both. Compilation is not counted; the time of the first run, with it, is given apart.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.io.folder import prepare, write_json
from calib.io.progress import clock
from calib.io.provenance import git_commit, versions
from calib.io.schema import tag
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.simulation.process_pool import Pool
from calib.trace.filters import filter_simulated
from calib.validation.metrics import compare
from mpm.batch import simulate_together
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from studies.speed.peers import PEERS, measure

POINTS = 240  # of a curve that is compared
# The published configuration: nodes along each axis, time step [s] (CulinaryCut, section 4.1). Its cell is the one with
# which the cube holds a whole banana, its speed that of the robot whose cuts are published with their forces (50 mm/s).
PAPER_NODES, PAPER_DT, PAPER_DX, PAPER_SPEED = 120, 2e-5, 2e-3, 0.05
BLOCK = Scene(
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
PEER_FLOOR = 4  # node that holds the block in a peer
# What a particle step has to move to and from memory in a scene that no cache holds, in numbers of eight bytes: to the
# grid F twice, C, stress, the last stretch, x, v, two indices (46); back x twice, v, C, two indices, height of contact,
# two stretches (29);
# the nodes, each for eight particles, cleared, added to, turned to velocities and read (3).
WORDS = 46 + 29 + 3
PARTS = 8  # of a cut that are timed by themselves
BATCHES = (1, 2, 4, 8)  # cuts side by side
COPY_WORDS = 1 << 23  # numbers that a thread copies to measure the bandwidth: 64 MiB

Say = Callable[[str], None]


@dataclass(frozen=True)
class Variant:
    """A way of simulating the same cut. Attributes: name; scene; runtime; physics: whether it is another food."""

    name: str
    scene: Scene
    runtime: Runtime
    physics: bool = False


def _clocked(pool: Pool, jobs: Sequence[tuple[Scene, dict[str, Any]]]) -> float:
    """Time that workers take for some cuts [s]."""
    began = time.perf_counter()
    list(pool.run(jobs))
    return time.perf_counter() - began


class Pace:
    """Rate of a simulation; each part of its cut counts with the least time of its turns.

    The other codes and the textbook are timed over ten steps, the least of some turns: a whole cut would have to find
    the machine undisturbed for as many seconds as those need tenths.

    Attributes:
        rate: Particle steps a second.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._least: np.ndarray | None = None
        self.rate = 0.0

    def run(self, turns: int = 1) -> float:
        """Take some turns; returns ``rate``."""
        for _ in range(turns):
            parts: list[float] = []
            ticks: list[float] = []

            def tick(part: float, _: float, parts: list[float] = parts, ticks: list[float] = ticks) -> None:
                parts.append(part)
                ticks.append(time.perf_counter())

            record = self._simulation.run(progress=tick)
            # even parts: small scenes come back less and less often, and not always at the same places
            shares = np.linspace(parts[0], parts[-1], PARTS + 1)
            spent = np.diff(np.interp(shares, parts, ticks))
            self._least = spent if self._least is None else np.minimum(self._least, spent)
            work = record.particles * record.steps * (parts[-1] - parts[0])
            self.rate = work / float(self._least.sum())
        return self.rate


class Bench:
    """Measures, and writes bench.json after each measurement.

    Args:
        food: What is cut.
        knife: Name of the knife.
        out: Folder of bench.json and bench.svg.
        runtime: Device and threads of the default cut.
        repeats: Turns that each of two runs takes.
        finest: Cell of the reference [m].
        seed: Seed of the particles.
        say: Called with a line after each measurement.
        peers: Interpreter that has the packages of the peers, if they are to be measured.
        command: Command line, for provenance.
    """

    def __init__(
        self,
        food: FoodSpec,
        knife: str,
        out: Path,
        *,
        runtime: Runtime,
        repeats: int,
        finest: float,
        seed: int,
        say: Say,
        peers: str | None = None,
        command: Sequence[str] = (),
    ) -> None:
        shape, _ = specimen(food, None, Sizing())
        self.scene = cut_scene(food, shape, load_knife(knife), seed=seed)
        self.screening = cut_scene(food, shape, load_knife(knife), seed=seed, coarse=True)
        self.whole = cut_scene(
            food, replace(shape, length=food.dims["length"].value or shape.length), load_knife(knife)
        )
        self.out, self.runtime, self.repeats, self.finest, self.say = out, runtime, repeats, finest, say
        self.peers = peers
        self.document: dict[str, Any] = {
            "schema": tag("bench"),
            "food": food.name,
            "knife": knife,
            "command": list(command),
            "complete": False,
            "device": runtime.arch,
            "threads": runtime.cpu_threads,
            "versions": versions(),
            "git": git_commit(),
            "peers": [],
        }
        self._kept: dict[tuple[Scene, Runtime], Simulation] = {}

    def run(self) -> dict[str, Any]:
        """Measure everything; returns the content of bench.json."""
        prepare(self.out, resume=False)
        for name, part in (
            ("throughput", self.throughput),
            ("paper_config", self.paper),
            ("default_cut", self.default_cut),
            ("processes", self.processes),
            ("batches", self.batches),
        ):
            self._keep(**{name: part()})
        if self.peers:
            self._keep(peers=self.others(self.peers))
        slow, fast = self.document["paper_config"]["wall_s_extrapolated"], self.document["default_cut"]["wall_s"]
        self._keep(ratio_to_paper=slow / fast, ablations=[])
        todo = self.variants()
        began = time.monotonic()
        for done, variant in enumerate(todo, 1):
            row = self.compare(variant)
            self._keep(ablations=[*self.document["ablations"], row])
            left = (time.monotonic() - began) / done * (len(todo) - done)
            self.say(f"{variant.name}: {row['time_ratio']:.2f} times the time; about {clock(left)} left")
        self._keep(exponent=self._exponent(), complete=True)
        return self.document

    def throughput(self) -> dict[str, Any]:
        """Particle steps a second of the block, ours and the textbook's in turns, and inside the default cut [1e6/s]."""
        from studies.speed.textbook import Textbook

        ours = self._simulation(BLOCK, self.runtime)
        dt, dx = ours.run().dt, BLOCK.numerics.dx
        text = Textbook(BLOCK, dx=dx, dt=dt, speed=PAPER_SPEED, nodes=PAPER_NODES, runtime=self.runtime)
        text.run(1)
        pace, yardstick = Pace(ours), 0.0
        for _ in range(self.repeats):
            pace.run()
            yardstick = max(yardstick, text.run(TEXTBOOK_STEPS).rate)
        best = [pace.rate, yardstick]
        self._kept.clear()
        one = self._simulation(replace(BLOCK, numerics=replace(BLOCK.numerics, precision="f32")), self.runtime)
        one.run()
        single = Pace(one).run(self.repeats)
        self._kept.clear()
        cut = self._simulation(self.scene, self.runtime)
        cut.run()
        inside = Pace(cut).run(self.repeats)
        speed = bandwidth(self.runtime.cpu_threads)
        row = {
            "particles": text.n,
            "bandwidth_GBps": speed / 1e9,
            "bytes_per_particle_step": 8 * WORDS,
            "memory_bound_Mps": speed / (8 * WORDS) / 1e6,
            "full_physics_Mps": best[0] / 1e6,
            "single_Mps": single / 1e6,
            "textbook_Mps": best[1] / 1e6,
            "ratio": best[0] / best[1],
            "cut_Mps": inside / 1e6,
        }
        self.say(
            f"{text.n} particles: {row['full_physics_Mps']:.2f} million particle steps a second, textbook "
            f"{row['textbook_Mps']:.2f} ({row['ratio']:.1f} times); in single precision {row['single_Mps']:.2f}; "
            f"inside the cut {row['cut_Mps']:.2f}; the memory would "
            f"bear {row['memory_bound_Mps']:.0f}"
        )
        return row

    def paper(self) -> dict[str, Any]:
        """Time that the published configuration needs for the same stroke, from a few of its steps [s]."""
        from studies.speed.textbook import Textbook

        text = Textbook(
            self.whole, dx=PAPER_DX, dt=PAPER_DT, speed=PAPER_SPEED, nodes=PAPER_NODES, runtime=self.runtime
        )
        text.run(1)
        step = min(text.run(TEXTBOOK_STEPS).seconds for _ in range(self.repeats))
        steps = self.scene.motion.stroke / (PAPER_SPEED * PAPER_DT)
        row = {
            "nodes": PAPER_NODES,
            "dx_m": PAPER_DX,
            "dt_s": PAPER_DT,
            "particles": text.n,
            "steps": round(steps),
            "step_s": step,
            "wall_s_extrapolated": step * steps,
        }
        self.say(
            f"published configuration: {step * 1e3:.1f} ms a step, {clock(row['wall_s_extrapolated'])} for the cut"
        )
        return row

    def default_cut(self) -> dict[str, Any]:
        """Least run time of the default cut, and its errors against the finest cells."""
        self.say(f"reference with cells of {self.finest * 1e3:g} mm")
        fine = replace(self.scene, numerics=replace(self.scene.numerics, dx=self.finest))
        self.reference = Simulation(fine, self.runtime).run()
        self._kept.clear()
        began = time.monotonic()
        cut = self._simulation(self.scene, self.runtime)
        cut.run()
        first = time.monotonic() - began
        records = [cut.run() for _ in range(self.repeats)]
        self.record = min(records, key=lambda r: r.wall)
        row = {
            "wall_s": self.record.wall,
            "first_run_s": first,
            "particles": self.record.particles,
            "steps": self.record.steps,
            "nodes": math.prod(cut.setup.grid.nodes),
            "reference_dx_m": self.finest,
            "reference_wall_s": self.reference.wall,
            **self._errors(self.record),
        }
        self.say(f"default cut: {row['wall_s']:.2f} s, work {row['work_error']:+.1%}, NRMSE {row['nrmse']:.3f}")
        return row

    def processes(self) -> dict[str, Any]:
        """What a calibration gains from a process for each core: the same cuts in one process and in several, in turns."""
        count = self.runtime.cpu_threads
        spent: dict[int, list[float]] = {1: [], count: []}
        afresh: list[float] = []
        jobs: list[tuple[Scene, dict[str, Any]]] = [(self.scene, {})]
        with ExitStack() as stack:
            pools = {n: stack.enter_context(Pool(n, self.runtime.arch)) for n in spent}
            for turn in range(self.repeats + 1):  # every process compiles in the first turn, which does not count
                for n, pool in pools.items():
                    took = _clocked(pool, jobs * (2 * count))
                    if turn > 0:
                        spent[n].append(took)
            for _ in range(self.repeats):  # what it compiled is kept: a further process has only to start
                pools[1].renew()
                first = _clocked(pools[1], jobs)
                afresh.append(first - _clocked(pools[1], jobs))
        done = 2 * count * self.record.particles * self.record.steps
        row = {
            "processes": count,
            "speed_up": min(spent[1]) / min(spent[count]),
            "cut_Mps": done / min(spent[count]) / 1e6,
            "start_up_s": min(afresh),
        }
        self.say(
            f"{count} processes: {row['speed_up']:.2f} times as many cuts as one, {row['cut_Mps']:.2f} million particle "
            f"steps a second; a further process starts in {row['start_up_s']:.2f} s"
        )
        return row

    def batches(self) -> list[dict[str, Any]]:
        """Time of several cuts side by side (:mod:`mpm.batch`), and that of each over the time of one alone."""
        spent: dict[int, list[float]] = {}
        for n in BATCHES:
            spent[n] = []
            for turn in range(self.repeats + 1):  # every size compiles in its first turn, which does not count
                began = time.perf_counter()
                simulate_together([self.scene] * n, runtime=self.runtime)
                if turn > 0:
                    spent[n].append(time.perf_counter() - began)
        least = {n: min(times) for n, times in spent.items()}
        rows = [{"cuts": n, "wall_s": wall, "per_cut": wall / n / least[1]} for n, wall in least.items()]
        self.say(
            "side by side: "
            + ", ".join(f"{r['cuts']} cuts {r['per_cut']:.2f} of the time of one each" for r in rows[1:])
        )
        return rows

    def others(self, python: str) -> list[dict[str, Any]]:
        """Particle steps a second of the elastic block, ours and each peer's [1e6/s]; ours before and after it.

        All in single precision, which is the peers' default.
        """
        scene = BLOCK.with_material(yield_stress=math.inf, tensile_strength=None, fracture_energy=None)
        scene = replace(scene, numerics=replace(scene.numerics, precision="f32"))
        ours = self._simulation(scene, self.runtime)
        shape, dx, law = scene.food.shape, BLOCK.numerics.dx, scene.food.material
        size = np.array([shape.width, shape.length, shape.height])
        room = np.array(ours.setup.grid.nodes) * dx - size
        block = {
            "dx": dx,
            "nodes": [int(n) for n in ours.setup.grid.nodes],
            "low": [float(room[0]) / 2, float(room[1]) / 2, PEER_FLOOR * dx],
            "counts": [round(s / dx * BLOCK.numerics.ppc) for s in size],
            "dt": ours.run().dt,
            "rho": law.rho,
            "mu": law.shear,
            "lam": law.lame,
            "floor": PEER_FLOOR,
            "steps": TEXTBOOK_STEPS,
            "repeats": self.repeats,
        }
        rows = []
        for name in PEERS:
            pace = Pace(ours)
            pace.run(self.repeats)
            row = measure(python, name, block, self.runtime.cpu_threads)
            best = pace.run(self.repeats)
            if "seconds" in row:
                theirs = row["particles"] / row["seconds"]
                row |= {"Mps": theirs / 1e6, "ours_Mps": best / 1e6, "ratio": best / theirs}
                self.say(
                    f"{name} {row['version']}: {row['Mps']:.2f} million particle steps a second, {row['ratio']:.1f}"
                )
            else:
                self.say(f"{name}: not measured, {row['error']}")
            rows.append(row)
        return rows

    def variants(self) -> list[Variant]:
        """The default cut with one thing changed."""
        scene, run, num = self.scene, self.runtime, self.scene.numerics
        motion, food = scene.motion, scene.food.material

        def numerics(name: str, **change: Any) -> Variant:
            return Variant(name, replace(scene, numerics=replace(num, **change)), run)

        def stiffness(name: str, k: float) -> Variant:
            names = ("E", "yield_stress", "R", "R_initiation", "R_skin")
            values = {n: k * v for n in names if (v := getattr(food, n)) is not None}
            return Variant(name, scene.with_material(**values), run, physics=True)

        return [
            Variant("screening: one cell to the zone, twice the speed", self.screening, run),
            numerics("cells of two thirds", dx=num.dx * 2 / 3),
            numerics("single precision", precision="f32"),
            numerics("whole instead of a quarter", mirror=False),
            numerics("27 particles a cell", ppc=3),
            numerics("its own size of empty grid on either side", room=2.0),
            numerics("half the time step", safety=num.safety / 2),
            Variant("half the speed", replace(scene, motion=replace(motion, mach=motion.mach / 2)), run),
            Variant("twice the speed", replace(scene, motion=replace(motion, mach=motion.mach * 2)), run),
            stiffness("ten times as stiff", 10.0),
            stiffness("a tenth as stiff", 0.1),
        ]

    def compare(self, variant: Variant) -> dict[str, Any]:
        """A variant and the default cut in turns."""
        began = time.monotonic()
        simulation = self._simulation(variant.scene, variant.runtime)
        simulation.run()
        first = time.monotonic() - began
        same = variant.runtime == self.runtime and variant.scene.numerics.precision == self.scene.numerics.precision
        ours: list[ForceRecord] = []
        other: list[ForceRecord] = []
        for _ in range(self.repeats):
            for records, scene, runtime in (
                (other, variant.scene, variant.runtime),
                (ours, self.scene, self.runtime),
            ):
                if not same:  # the other one has stopped the runtime: the first run compiles and does not count
                    self._kept.clear()
                    self._simulation(scene, runtime).run()
                records.append(self._simulation(scene, runtime).run())
        record = min(other, key=lambda r: r.wall)
        row = {
            "name": variant.name,
            "status": record.status,
            "wall_s": record.wall,
            "first_run_s": first,
            "time_ratio": record.wall / min(r.wall for r in ours),
            "particles": record.particles,
            "steps": record.steps,
            "nodes": math.prod(simulation.setup.grid.nodes),
        }
        return row if variant.physics else row | self._errors(record)

    def _simulation(self, scene: Scene, runtime: Runtime) -> Simulation:
        """A simulation that is kept, with its kernels, until the runtime changes."""
        key = (scene, runtime)
        if key not in self._kept:
            self._kept[key] = Simulation(scene, runtime)
        return self._kept[key]

    def _errors(self, record: ForceRecord) -> dict[str, float]:
        """Errors of peak, work and curve against the reference, fractions."""
        end = min(record.stroke[-1], self.reference.stroke[-1])
        grid = np.linspace(0.0, end, POINTS)
        fine, ours = (filter_simulated(grid, r.stroke, r.resolved) for r in (self.reference, record))
        return {
            "peak_error": float(ours.max() / fine.max() - 1),
            "work_error": record.work / self.reference.work - 1,
            "nrmse": compare(grid, fine, ours).nrmse,
        }

    def _exponent(self) -> float:
        """Exponent with which the time grows with particles times steps, over cells and particles a cell."""
        names = ("cells of two thirds", "27 particles a cell", "whole instead of a quarter")
        rows = [self.document["default_cut"], *(r for r in self.document["ablations"] if r["name"] in names)]
        size = np.log([r["particles"] * r["steps"] for r in rows])
        spent = np.log([1.0, *(r["time_ratio"] for r in rows[1:])])
        return float(np.polyfit(size, spent, 1)[0])

    def _keep(self, **parts: Any) -> None:
        self.document |= parts
        write_json(self.out / "bench.json", self.document)


def bandwidth(threads: int) -> float:
    """Bytes a second that so many threads read and write together when each copies an array that no cache holds."""
    arrays = [(np.ones(COPY_WORDS), np.empty(COPY_WORDS)) for _ in range(threads)]

    def copy(pair: tuple[np.ndarray, np.ndarray]) -> None:
        np.copyto(pair[1], pair[0])  # lets other threads run meanwhile

    best = np.inf
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(5):
            began = time.perf_counter()
            list(pool.map(copy, arrays))
            best = min(best, time.perf_counter() - began)
    return 2 * 8 * COPY_WORDS * threads / best


def run(food: FoodSpec, knife: str, out: Path, **options: Any) -> dict[str, Any]:
    """Measure, and write bench.json, bench.svg and report.pdf; the options are those of :class:`Bench`."""
    document = Bench(food, knife, out, **options).run()
    from reports.bench import write_figure, write_report

    write_figure(out)
    write_report(out)
    return document
