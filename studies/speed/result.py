"""What a benchmark ends with: ``bench.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from calib.io.typed_document import FLAT

RESULT_FILE = "bench.json"


@dataclass(frozen=True)
class CutErrors:
    """Errors of a cut against the same on finer cells.

    Attributes:
        peak_error: Peak over that of the reference, less 1 [-].
        work_error: Work over that of the reference, less 1 [-].
        nrmse: Root mean square difference from the reference over its peak [-].
    """

    peak_error: float
    work_error: float
    nrmse: float


@dataclass(frozen=True, kw_only=True)
class Throughput:
    """Rates of the kernels on a block, and of the default cut.

    Attributes:
        particles: Particles of the block.
        bandwidth_GBps: Bytes that the memory reads and writes a second [1e9/s].
        bytes_per_particle_step: Bytes that a particle step has to move.
        memory_bound_Mps: Particle steps a second that the memory would bear [1e6/s].
        full_physics_Mps: Ours [1e6/s].
        single_Mps: Ours in single precision [1e6/s]; older documents have none.
        textbook_Mps: Those of the textbook's kernel with the same physics [1e6/s].
        ratio: Ours over the textbook's [-].
        cut_Mps: Ours inside the default cut [1e6/s].
    """

    particles: int
    bandwidth_GBps: float
    bytes_per_particle_step: int
    memory_bound_Mps: float
    full_physics_Mps: float
    single_Mps: float | None = None
    textbook_Mps: float
    ratio: float
    cut_Mps: float


@dataclass(frozen=True)
class PublishedConfiguration:
    """The published configuration on this machine.

    Attributes:
        nodes: Nodes along each axis.
        dx_m: Cell size [m].
        dt_s: Time step [s].
        particles: Particles.
        steps: Steps of the whole cut.
        step_s: Run time of a step [s].
        wall_s_extrapolated: Run time of the whole cut, from a few of its steps [s].
    """

    nodes: int
    dx_m: float
    dt_s: float
    particles: int
    steps: int
    step_s: float
    wall_s_extrapolated: float


@dataclass(frozen=True)
class DefaultCut:
    """The default cut against the same on finer cells.

    Attributes:
        wall_s: Least run time [s].
        first_run_s: Time of the first run, with compilation [s].
        particles: Particles.
        steps: Time steps.
        nodes: Nodes of the grid.
        reference_dx_m: Cell size of the reference [m].
        reference_wall_s: Run time of the reference [s].
        errors: Its errors.
    """

    wall_s: float
    first_run_s: float
    particles: int
    steps: int
    nodes: int
    reference_dx_m: float
    reference_wall_s: float
    errors: CutErrors = field(metadata=FLAT)


@dataclass(frozen=True)
class ProcessScaling:
    """Several processes against one.

    Attributes:
        processes: Processes.
        speed_up: Cuts in the time of one [-].
        cut_Mps: Particle steps a second of all together [1e6/s]; older documents have none.
        start_up_s: What the first cut of a further process takes longer than its next [s]; older documents have none.
    """

    processes: int
    speed_up: float
    cut_Mps: float | None = None
    start_up_s: float | None = None


@dataclass(frozen=True)
class BatchTime:
    """Cuts side by side: how many, least run time of them all [s], time of each over that of one alone [-]."""

    cuts: int
    wall_s: float
    per_cut: float


@dataclass(frozen=True)
class Ablation:
    """The default cut with one thing changed.

    Attributes:
        name: What was changed.
        status: How the run ended.
        wall_s: Least run time [s].
        first_run_s: Time of the first run, with compilation [s].
        time_ratio: Run time over that of the default cut, in turns [-].
        particles: Particles.
        steps: Time steps.
        nodes: Nodes of the grid.
        errors: Its errors; None for another food, for which the reference is none.
    """

    name: str
    status: str
    wall_s: float
    first_run_s: float
    time_ratio: float
    particles: int
    steps: int
    nodes: int
    errors: CutErrors | None = field(default=None, metadata=FLAT)


@dataclass(frozen=True)
class PeerResult:
    """The elastic block in another simulator.

    Attributes:
        name: Its name.
        seconds: Run time of a step [s]; this and the next are None where it could not be measured.
        version: Its version.
        particles: Particles.
        Mps: Its particle steps a second [1e6/s].
        ours_Mps: Those of cutcal [1e6/s].
        ratio: Ours over its [-].
        error: Why it could not be measured, None where it was.
    """

    name: str
    seconds: float | None = None
    version: str | None = None
    particles: int | None = None
    Mps: float | None = None
    ours_Mps: float | None = None
    ratio: float | None = None
    error: str | None = None


@dataclass(frozen=True, kw_only=True)
class BenchmarkResult:
    """A benchmark, finished or not: what was not measured is None.

    Attributes:
        food: Name of the food.
        knife: Name of the knife.
        command: Words of the command line.
        complete: Whether everything was measured.
        device: Device of the default cut.
        threads: CPU threads.
        versions: Versions of cutcal, Python and packages.
        git: Commit of the checkout.
        peers: The elastic block in other simulators.
        throughput: Rates of the kernels.
        paper_config: The published configuration.
        default_cut: The default cut.
        processes: Several processes against one.
        batches: Several cuts side by side in one process.
        ratio_to_paper: Run time of the published configuration over that of the default cut [-].
        ablations: The default cut with one thing changed.
        exponent: Power with which the time grows with particles times steps [-].
    """

    DOCUMENT: ClassVar[str] = "bench"

    food: str
    knife: str
    command: tuple[str, ...]
    complete: bool
    device: str
    threads: int
    versions: Mapping[str, str]
    git: str | None
    peers: tuple[PeerResult, ...] = ()
    throughput: Throughput | None = None
    paper_config: PublishedConfiguration | None = None
    default_cut: DefaultCut | None = None
    processes: ProcessScaling | None = None
    batches: tuple[BatchTime, ...] | None = None
    ratio_to_paper: float | None = None
    ablations: tuple[Ablation, ...] | None = None
    exponent: float | None = None
