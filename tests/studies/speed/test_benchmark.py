"""The benchmark's bookkeeping with a solver and a yardstick whose times are known."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

import studies.speed.kernel_rates
import studies.speed.peers
import studies.speed.side_by_side
import studies.speed.textbook
import studies.speed.timing
from calib.io.typed_document import from_document
from calib.material.food import load_food
from cutcal.commands.solver.bench import table
from cutcal.main import main
from mpm.runtime import Runtime
from mpm.scene import Scene
from studies.speed.benchmark import BenchmarkSettings, run_benchmark
from studies.speed.result import BenchmarkResult, UnmeasuredPeer
from studies.speed.standing_block import Standing, StandingBlock
from tests.calib.documents import valid


class Solver:
    """Takes 1 us a particle step, 100 s more to compile, and finds a force too high in proportion to the cell."""

    def __init__(self, scene: Scene, runtime: Runtime) -> None:
        self.scene, self.runtime = scene, runtime
        self.compile = 100.0
        nodes = (round(0.08 * (1 + scene.numerics.room) / scene.numerics.dx),) * 3
        self.setup = SimpleNamespace(grid=SimpleNamespace(nodes=nodes))

    def run(self, progress: Callable[[float, float], None] | None = None) -> SimpleNamespace:
        """A record with the columns that are looked at; tells its progress at a fifth, two thirds and the end."""
        num, motion = self.scene.numerics, self.scene.motion
        particles = round(1e-5 / num.dx**3) * num.ppc**3 * (1 if num.mirror else 4)
        steps = round(1e-2 / (motion.mach * num.safety * num.dx))
        stroke = np.linspace(0.0, 0.03, 200)
        force = 10.0 * (1.0 + 10.0 * num.dx) * np.sin(np.pi * stroke / 0.03)
        for before, part in ((0.0, 0.2), (0.2, 2 / 3), (2 / 3, 1.0)):
            Workers.now += 1e-6 * particles * steps * (part - before)
            if progress is not None:
                progress(part, 0.0)
        wall, self.compile = 1e-6 * particles * steps + self.compile, 0.0
        return SimpleNamespace(
            status="done",
            particles=particles,
            steps=steps,
            wall=wall,
            dt=1e-5,
            stroke=stroke,
            resolved=force,
            work=float(np.trapezoid(force, stroke)),
        )


class Yardstick:
    """Takes 10 us a particle step."""

    def __init__(self, scene: Scene, **_: object) -> None:
        self.n = 1000

    def run(self, steps: int) -> SimpleNamespace:
        """The time of these steps."""
        return SimpleNamespace(seconds=0.01, particles=self.n, rate=1e5)


class Workers:
    """Processes that divide eight seconds' work among them, after a minute for the first,
    or two seconds for a further one.
    """

    now = 0.0
    compiled: set[int] = set()

    def __init__(self, workers: int, arch: str) -> None:
        self.workers, self.start = workers, 60.0

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def run(self, jobs: list[object]) -> list[object]:
        """All done at once, but later."""
        Workers.now += self.start + 2.0 * len(jobs) / self.workers
        self.start = 0.0
        return jobs

    def renew(self) -> None:
        """What was compiled is kept."""
        self.start = 2.0


def side_by_side(scenes: list[Scene], runtime: object) -> None:
    """A minute to compile for the first of each size, then a second and half a second for each cut."""
    Workers.now += 1.0 + 0.5 * len(scenes) + (0.0 if len(scenes) in Workers.compiled else 60.0)
    Workers.compiled.add(len(scenes))


BLOCK = StandingBlock((0.04, 0.08, 0.04), 2e-3, 2, 3e-5)


def fallen(block: dict) -> list[float]:
    """Velocities of a block that no floor holds."""
    return [-block["gravity"] * block["dt"] * block["steps"] * (n + 1) for n in range(block["windows"])]


def peer(python: str, name: str, block: dict, threads: int) -> dict:
    """Peers that take 0.5 s a step, whatever its length, and fall; one that is not there."""
    assert np.prod(block["counts"]) == 128000 and np.all(np.array(block["low"]) > 0) and threads == 2
    if name == "Genesis":
        return {"name": name, "error": "No module named 'genesis'"}
    longer = 10 if "10" in name else 1
    moved = {"particles": 128000, "version": "1", "velocity": fallen(block)}
    return {"name": name, "longer": longer, "seconds": 0.5, **moved}


def stand(shape: object, numerics: object, runtime: object) -> tuple[StandingBlock, Standing]:
    """The solver takes 0.128 s a step."""
    return BLOCK, Standing(0.128, 128000, 0.01)


@pytest.fixture
def document(monkeypatch, tmp_path) -> dict:
    """What the benchmark writes."""
    clock = SimpleNamespace(perf_counter=lambda: Workers.now, monotonic=time.monotonic)
    for module, name, fake in (
        (studies.speed.side_by_side, "Pool", Workers),
        (studies.speed.side_by_side, "time", clock),
        (studies.speed.side_by_side, "simulate_together", side_by_side),
        (studies.speed.timing, "time", clock),
        (studies.speed.timing, "Simulation", Solver),
        (studies.speed.kernel_rates, "measure", peer),
        (studies.speed.kernel_rates, "stand", stand),
        (studies.speed.kernel_rates, "bandwidth", lambda threads: 2e10),
        (studies.speed.textbook, "Textbook", Yardstick),
    ):
        monkeypatch.setattr(module, name, fake)
    said: list[str] = []
    banana = load_food("banana")
    settings = BenchmarkSettings(
        banana, "kitchen", Runtime(threads=2), repeats=2, finest=1.5e-3, seed=0, peers="python"
    )
    run_benchmark(settings, tmp_path, said.append)
    assert "published configuration" in "\n".join(said) and (tmp_path / "bench.svg").stat().st_size > 2000
    assert "mathdefault" not in (tmp_path / "bench.svg").read_text()  # powers of ten would be shown as source text
    return valid(json.loads((tmp_path / "bench.json").read_text()))


def test_ratios_are_those_of_the_times(document):
    """Rates, the ratio to the published configuration, errors and the exponent follow from the known times."""
    d = document
    assert d["complete"]
    assert d["throughput"]["full_physics_Mps"] == pytest.approx(1.0)
    t = d["throughput"]
    assert t["single_Mps"] == pytest.approx(1.0)
    assert t["memory_bound_Mps"] == pytest.approx(1e3 * t["bandwidth_GBps"] / t["bytes_per_particle_step"])
    assert d["throughput"]["ratio"] == pytest.approx(10.0)
    assert d["paper_config"]["wall_s_extrapolated"] == pytest.approx(0.01 * d["paper_config"]["steps"], rel=1e-3)
    assert d["ratio_to_paper"] == pytest.approx(d["paper_config"]["wall_s_extrapolated"] / d["default_cut"]["wall_s"])
    assert d["default_cut"]["work_error"] == pytest.approx(1.03 / 1.015 - 1, rel=1e-6)
    rows = {row["name"]: row for row in d["ablations"]}
    assert rows["whole instead of a quarter"]["time_ratio"] == pytest.approx(4.0)
    assert rows["half the time step"]["time_ratio"] == pytest.approx(2.0, rel=0.01)
    assert rows["single precision"]["time_ratio"] == pytest.approx(1.0)  # neither compiles while it is timed
    assert "nrmse" not in rows["ten times as stiff"]
    assert [row["cuts"] for row in d["batches"]] == [1, 2, 4, 8]
    assert [row["per_cut"] for row in d["batches"]] == pytest.approx([1.0, 2 / 3, 0.5, 5 / 12])
    assert d["processes"].pop("cut_Mps") > 0
    assert d["processes"] == {
        "processes": 2,
        "speed_up": pytest.approx(2.0),
        "start_up_s": pytest.approx(2.0),
    }
    empty = next(row for name, row in rows.items() if "empty grid" in name)
    assert empty["time_ratio"] == pytest.approx(1.0) and empty["nodes"] > 2 * d["default_cut"]["nodes"]
    assert d["exponent"] == pytest.approx(1.0, abs=0.01)


def test_peers_are_compared_or_said_to_be_absent(document):
    """The ratio is that of the times of the same motion, the error that of a block that falls freely; a peer that is
    not installed says so.
    """
    warp, genesis, longer = document["peers"]
    assert warp["ours_Mps"] == pytest.approx(1.0) and warp["Mps"] == pytest.approx(0.256)
    assert warp["ratio"] == pytest.approx(1.0 / 0.256)
    assert longer["ratio"] == pytest.approx(0.1 / 0.256)
    assert warp["force_error"] == pytest.approx(3**-0.5, rel=0.05) and warp["ours_force_error"] == 0.01
    assert "ratio" not in genesis and "genesis" in genesis["error"]


def test_a_peer_whose_block_breaks_down_has_no_rate():
    """A block that flies apart may be fast; no NaN gets into a document."""
    broken = [*fallen(BLOCK.task("cpu"))[:-1], float("nan")]
    answer = {"name": "Warp", "longer": 1, "seconds": 0.5, "particles": 128000, "version": "1", "velocity": broken}
    found = studies.speed.kernel_rates._peer_result(answer, BLOCK, Standing(0.128, 128000, 0.01))
    assert isinstance(found, UnmeasuredPeer) and "broken down" in found.error


def test_a_peer_is_not_asked_for_a_device_that_it_lacks():
    """It says so, and nothing is started."""
    row = studies.speed.peers.measure("no-such-python", "Warp", BLOCK.task("vulkan"), 1)
    assert row["error"] == "it does not run on vulkan"


@pytest.mark.parametrize("name", list(studies.speed.peers.PEERS))
def test_peer_that_is_not_installed(name):
    """An interpreter without the package, or no interpreter at all, gives its last line and no traceback."""
    row = studies.speed.peers.measure(sys.executable, name, {}, 1)
    assert set(row) == {"name", "error"} and "No module named" in row["error"]
    assert "no-such-python" in studies.speed.peers.measure("no-such-python", name, {}, 1)["error"]


def test_missing_interpreter_is_said_before_anything_is_measured(capsys, tmp_path):
    """A mistyped path costs no minutes of measuring."""
    assert main(["bench", "--peers", "no-such-python", "--out", str(tmp_path / "out")]) == 1
    assert "--peers no-such-python" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_table_names_every_row(document):
    """The terminal shows each variant with its time and errors."""
    text = table(from_document(BenchmarkResult, document))
    assert all(row["name"] in text for row in document["ablations"]) and "to the power 1.00" in text
    assert "in Genesis: not measured, No module named" in text
    assert "Warp 1 takes 3.9 times our time" in text and "2 processes do 2.00 times" in text
