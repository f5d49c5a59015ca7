"""What a benchmark ends with: ``bench.json``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from calib.io.provenance import CommandLine, Commit, DeviceName, Versions
from calib.io.type_schema import Count, NotNegative, Positive, Shared, keywords
from calib.io.typed_document import FLAT

RESULT_FILE = "bench.json"


@dataclass(frozen=True)
class CutErrors:
    """Errors of a cut against the same on finer cells.

    Attributes:
        peak_error: Peak over that of the reference less 1.
        work_error: Work over that of the reference less 1.
        nrmse: Root mean square difference from the reference over its peak.
    """

    peak_error: float
    work_error: float
    nrmse: NotNegative


@dataclass(frozen=True, kw_only=True)
class Throughput:
    """Rates of the kernels on a block, and of the default cut.

    Attributes:
        particles: Particles of the block.
        bandwidth_GBps: Bytes that the memory reads and writes a second [1e9/s].
        bytes_per_particle_step: Bytes that a particle step has to move.
        memory_bound_Mps: Particle steps a second that the memory would bear [1e6/s].
        full_physics_Mps: Particle steps a second [1e6/s].
        single_Mps: Ours in single precision [1e6/s].
        textbook_Mps: Those of a textbook kernel with the same physics [1e6/s].
        ratio: Ours over the textbook's.
        cut_Mps: Ours inside the default cut [1e6/s].
    """

    particles: Count
    bandwidth_GBps: Positive
    bytes_per_particle_step: Count
    memory_bound_Mps: Positive
    full_physics_Mps: Positive
    single_Mps: Positive | None = None
    textbook_Mps: Positive
    ratio: Positive
    cut_Mps: Positive


@dataclass(frozen=True)
class PublishedConfiguration:
    """The published configuration on this machine.

    Attributes:
        nodes: Nodes along each axis.
        dx_m: Cell [m].
        dt_s: Time step [s].
        particles: Particles.
        steps: Steps of the whole cut.
        step_s: Time of a step [s].
        wall_s_extrapolated: Time of the whole cut, from a few of its steps [s].
    """

    nodes: Count
    dx_m: Positive
    dt_s: Positive
    particles: Count
    steps: Count
    step_s: Positive
    wall_s_extrapolated: Positive


@dataclass(frozen=True)
class DefaultCut:
    """The default cut against the same on finer cells.

    Attributes:
        wall_s: Least run time [s].
        first_run_s: Time of the first run, with compilation [s].
        particles: Particles.
        steps: Time steps.
        nodes: Nodes of the grid.
        reference_dx_m: Cell of the reference [m].
        reference_wall_s: Run time of the reference [s].
        errors: Its errors.
    """

    wall_s: Positive
    first_run_s: Positive
    particles: Count
    steps: Count
    nodes: Count
    reference_dx_m: Positive
    reference_wall_s: Positive
    errors: CutErrors = field(metadata=FLAT)


@dataclass(frozen=True)
class ProcessScaling:
    """Several processes against one.

    Attributes:
        processes: Processes.
        speed_up: Cuts in the time of one.
        cut_Mps: Particle steps a second of all together [1e6/s].
        start_up_s: What the first cut of a further process takes longer than its next, the kernels compiled before [s].
    """

    processes: Count
    speed_up: Positive
    cut_Mps: Positive | None = None
    start_up_s: float | None = None


@dataclass(frozen=True)
class BatchTime:
    """Cuts side by side: how many, least run time of them all [s], time of each over that of one alone [-].

    Attributes:
        cuts: How many.
        wall_s: Least run time of them all [s].
        per_cut: Time of each over that of one alone.
    """

    cuts: Annotated[int, keywords(minimum=1)]
    wall_s: Positive
    per_cut: Positive


@dataclass(frozen=True)
class Ablation:
    """The default cut with one thing changed.

    Attributes:
        name: What was changed.
        status: How a simulation ended: done, or why it broke down: a force or position is no number, food left the
            grid, a particle was turned inside out.
        wall_s: Least run time [s].
        first_run_s: Time of the first run, with compilation [s].
        time_ratio: Run time over that of the default cut, in turns.
        particles: Particles.
        steps: Time steps.
        nodes: Nodes of the grid.
        errors: Its errors; None for another food, for which the reference is none.
    """

    name: str
    status: Annotated[str, Shared("runState")]
    wall_s: Positive
    first_run_s: Positive
    time_ratio: Positive
    particles: Count
    steps: Count
    nodes: Count
    errors: CutErrors | None = field(default=None, metadata=FLAT)


@dataclass(frozen=True)
class MeasuredPeer:
    """A peer that was measured.

    Attributes:
        name: Its name.
        seconds: Time of a step [s].
        version: Its version.
        particles: Particles.
        Mps: Particle steps a second [1e6/s].
        ours_Mps: Those of cutcal [1e6/s].
        ratio: Its time for the same motion over ours.
        force_error: Its error of the force on the floor, root mean square over the peak, against the closed form.
        ours_force_error: That of cutcal.
    """

    name: str
    seconds: Positive
    version: str
    particles: Count
    Mps: Positive
    ours_Mps: Positive
    ratio: Positive
    force_error: NotNegative
    ours_force_error: NotNegative


@dataclass(frozen=True)
class UnmeasuredPeer:
    """A peer that could not be measured.

    Attributes:
        name: Its name.
        error: Why not.
    """

    name: str
    error: str


PeerResult = MeasuredPeer | UnmeasuredPeer


@dataclass(frozen=True, kw_only=True)
class BenchmarkResult:
    """Run time against error.

    ``bench.json`` of ``cutcal bench``, and what ``cutcal bench --json`` prints.

    Attributes:
        food: Food of materials.yaml, or of the file given.
        knife: Knife of knives.yaml, or of the file given.
        command: Command line, or the call from Python, that made the document.
        complete: Whether everything was measured; the later keys are missing before.
        device: Device of the simulations.
        threads: Threads of the CPU.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
        peers: The standing block in other simulators, with --peers.
        throughput: Rate of the kernels on a block.
        paper_config: The published configuration on this machine.
        default_cut: The default cut against finer cells.
        processes: Several processes against one.
        batches: Several cuts side by side in one process, on a GPU in one launch.
        ratio_to_paper: Run time of the published configuration over that of the default cut.
        ablations: The default cut with one thing changed.
        exponent: Power with which the time grows with particles times steps.
    """

    DOCUMENT: ClassVar[str] = "bench"

    food: str
    knife: str
    command: CommandLine
    complete: bool
    device: DeviceName
    threads: Annotated[int, keywords(minimum=1)]
    versions: Versions
    git: Commit
    peers: tuple[MeasuredPeer | UnmeasuredPeer, ...] = ()
    throughput: Throughput | None = None
    paper_config: PublishedConfiguration | None = None
    default_cut: DefaultCut | None = None
    processes: ProcessScaling | None = None
    batches: tuple[Annotated[BatchTime, keywords(description="Cuts at a time")], ...] | None = None
    ratio_to_paper: Positive | None = None
    ablations: tuple[Annotated[Ablation, keywords(description="One of them")], ...] | None = None
    exponent: float | None = None
