"""Calibrating from Python as from the command line: one trace, and what a finished folder holds."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import pandas as pd

from calib.arguments import KINDS, LIMITS, as_number, listeners
from calib.calibration.result import SUMMARY, read_result, read_summary
from calib.calibration.result import CalibrationResult as CalibrationResult
from calib.errors import OutputError
from calib.io.kinds import FILE, FLAG, FOLDER, check_kind
from calib.io.progress import Progress
from calib.io.wording import as_arguments, brief, in_arguments, speaking_of_arguments
from calib.material.food import FoodSpec
from calib.material.scene import MID_LENGTH, Sizing
from calib.outline.outline_file import OutlineFile
from calib.problem.request import Request
from calib.problem.target import ErrorModel
from calib.simulation.workers import Workers
from calib.trace.baselines import BASELINES, CONSTANT
from calib.trace.cuts import WHOLE
from calib.trace.recorded import Reading
from calib.trace.trace import Trace, read_trace
from mpm.runtime import ARCHES
from mpm.scene.errors import CutcalError
from mpm.scene.shapes import SHAPE_KINDS

LOCAL_WORKERS = 2
"""Simulations at a time on this machine, a process each."""
READING = ("time_col", "force_col", "position_col", "depth_col", "sign", "rate", "decimal")
"""Arguments that say how files and DataFrames are read."""
KEYS = ("food", "created", "status", "passed", "trace", "parameters", "versions")
"""What tells the summary of a calibration from that of a cut."""
RESUME = "run it again with resume=True"
"""What to do about a folder that is not whole."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """What to calibrate; :meth:`run` does it. The names are those of the options of ``calibrate``.

    A size, speed, time or part may be text with a unit, such as ``45mm``, ``20 mm/s`` or ``5%``.

    Attributes:
        food: Name in ``materials.yaml``, path of a material's YAML file, or a :class:`~calib.material.food.FoodSpec`.
        trace: The cut: a :class:`~calib.trace.trace.Trace`, a pandas DataFrame, or the path of a file.
        air: The same motion without food, in any of these forms, or None.
        knife: Name in ``knives.yaml``, or path of a YAML file.
        speed: Knife speed [m/s], where the trace has no position.
        board_z: What the trace's height, or depth, reads with the edge on the board [m]: it says how high the food is.
        t_end: Time after which the record is ignored [s], or None.
        shape: Outline of the specimen, as ``mpm.scene.shapes.named`` reads it; None for the food's.
        height, width, length: Sizes of the specimen [m], None where they were not measured.
        at: Where the blade cuts, as the part of the length on one side [-].
        outline: Picture, radii or mesh of the specimen, in place of ``shape``; None without one.
        scale: Size of a pixel, such as ``0.1mm/px``, or of a unit of a mesh.
        outline_as: How it becomes a food, as :class:`calib.outline.outline_file.OutlineFile` has it.
        fit: Names of the fitted properties; None for those that cutting sees.
        dx: Cell size [m], or None.
        budget: Largest number of simulations.
        sample: Whether all plausible foods are sampled, in place of a search for one; the budget does not bound it.
        withdrawal: Whether the way up is fitted beside the way down: it tells R, friction and adhesion apart.
        workers: Simulations at a time; None for 2, of a cluster for all.
        seed: Seed of the particles and of the search.
        arch: Device of the simulations.
        columns: How files and DataFrames are read: attributes of :class:`calib.trace.recorded.Reading` by name, such as
            ``{"force_col": "Fz=N", "sign": "-", "rate": 200.0}``; None for what their names say.
        baseline: What is subtracted without an air run, one of ``calib.trace.baselines.BASELINES``.
        cut: Number of the cut in a record of several, from 1; ``whole`` for a record that is one; None for its only.
        set: Other values of properties [SI], by name, such as ``{"E": 2e5}``.
        time_col, force_col, position_col, depth_col, sign, rate, decimal: How files and DataFrames are read, as in
            ``columns``.
        gain_sd: Relative standard deviation of the sensor's gain [-]; None for what its kind suggests.
        lag_sd: Standard deviation of the sensor's delay [s], or None.
        bandwidth: Cut-off of the low-pass that the force went through [Hz]; None for what its kind suggests.
        discrepancy: How far a right model may be from the trace, part of the peak [-]; None for the usual 0.03.
        u_num: Folder of a ``converge`` study whose numerical uncertainty the fit heeds, or None.
        start_from: Folder of an earlier calibration of the same food and knife, or of several, at whose closest foods
            the search begins, or None.
        scheduler: Address of a Dask cluster that runs the simulations, such as ``tcp://host:8786``, or None.

    Raises:
        CutcalError: An unknown food, a trace that cannot be read, or an impossible value.
    """

    food: str | Path | FoodSpec
    trace: str | Path | Trace | pd.DataFrame
    air: str | Path | Trace | pd.DataFrame | None = None
    knife: str | Path = "kitchen"
    speed: float | str | None = None
    board_z: float | str | None = None
    t_end: float | str | None = None
    shape: str | None = None
    height: float | str | None = None
    width: float | str | None = None
    length: float | str | None = None
    at: float = MID_LENGTH
    outline: str | Path | None = None
    scale: str | None = None
    outline_as: str | None = None
    fit: Sequence[str] | None = None
    dx: float | str | None = None
    budget: float = 100
    sample: bool = False
    withdrawal: bool = False
    workers: int | None = None
    seed: int = 0
    arch: str = "cpu"
    columns: Mapping[str, Any] | None = None
    baseline: str = CONSTANT
    cut: int | str | None = None
    set: Mapping[str, float] | None = None
    time_col: str | None = None
    force_col: str | None = None
    position_col: str | None = None
    depth_col: str | None = None
    sign: str | int | None = None
    rate: float | None = None
    decimal: str | None = None
    gain_sd: float | str | None = None
    lag_sd: float | str | None = None
    bandwidth: float | str | None = None
    discrepancy: float | str | None = None
    u_num: str | Path | None = None
    start_from: str | Path | None = None
    scheduler: str | None = None
    _food: FoodSpec = field(init=False, repr=False)
    _records: tuple[Trace, Trace | None] = field(init=False, repr=False)
    _sizing: Sizing = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with speaking_of_arguments():
            self._check()
            food = self.food if isinstance(self.food, FoodSpec) else FoodSpec.load(self.food)
            records = self._record(self.trace), None if self.air is None else self._record(self.air)
            object.__setattr__(self, "_food", food.with_values(self.set) if self.set else food)
            object.__setattr__(self, "_records", records)
            height, width, length = (self._number(name) for name in ("height", "width", "length"))
            given = Sizing(self.shape, height, width, length, self.at)
            file = OutlineFile(self.outline, self.scale, self.outline_as)
            object.__setattr__(self, "_sizing", file.sizing(given))

    def __repr__(self) -> str:
        return self._call()

    def _check(self) -> None:
        """Refuse impossible values.

        Raises:
            CutcalError: There is one.
        """
        for item in fields(self):
            if item.name in KINDS and (value := getattr(self, item.name)) is not item.default:
                check_kind("Calibration", item.name, value, *KINDS[item.name])
        for name in LIMITS:
            self._number(name)
        for name, lowest in (("workers", 1), ("seed", 0)):
            value = getattr(self, name)
            if name == "workers" and value is None:
                continue
            if not isinstance(value, int) or isinstance(value, bool) or value < lowest:
                raise CutcalError(f"Calibration: {name} = {brief(value)}; give a whole number of at least {lowest}")
        kind = self.shape.partition(":")[0] if isinstance(self.shape, str) else self.shape
        for name, value, options in (("shape", kind, (None, *SHAPE_KINDS)), ("arch", self.arch, ARCHES)):
            if value not in options:
                listed = ", ".join(one for one in options if one)
                raise CutcalError(f"Calibration: {name} = {brief(getattr(self, name))} is none of {listed}")
        if isinstance(self.fit, str):
            raise CutcalError(f"Calibration: fit = {brief(self.fit)} is text; give a list of names, such as ['E', 'R']")
        for name in (*(self.fit or ()), *(self.set or ())):
            check_kind("Calibration", "a name of a property", name, (str,), "text, such as 'E'")
        if self.baseline not in BASELINES:
            raise CutcalError(f"Calibration: baseline = {brief(self.baseline)} is none of {', '.join(BASELINES)}")
        if not (self.cut is None or self.cut == WHOLE or (type(self.cut) is int and self.cut > 0)):
            raise CutcalError(f"Calibration: cut = {brief(self.cut)}; give a number from 1, or '{WHOLE}'")
        names = [item.name for item in fields(Reading)]
        unknown = next((name for name in self.columns or {} if name not in names), None)
        if unknown is not None:
            raise CutcalError(f"Calibration: columns has {brief(unknown)}, which is none of {', '.join(names)}")
        twice = next(
            (name for name in READING if name in (self.columns or {}) and getattr(self, name) is not None), None
        )
        if twice is not None:
            raise CutcalError(f"Calibration: {twice} is an argument and in columns; give it once")
        if self._reading and isinstance(self.trace, Trace):
            said = "columns say" if self.columns else f"{next(iter(self._reading))} says"
            raise CutcalError(f"Calibration: {said} how a file is read, but the trace is a Trace, which has been")

    def _number(self, name: str) -> float | None:
        """A number that was given [SI], also as text with a unit.

        Raises:
            CutcalError: It is none, or not between its limits.
        """
        return as_number("Calibration", name, getattr(self, name))

    @property
    def _reading(self) -> dict[str, Any]:
        """How files and DataFrames are read: what differs from the usual."""
        own = {name: getattr(self, name) for name in READING if getattr(self, name) is not None}
        return dict(self.columns or {}) | own

    def request(self, out: str | Path = "") -> Request:
        """The same for :func:`calib.calibration.run.run`.

        Args:
            out: Output folder, for the command that the summary states.

        Raises:
            CutcalError: It is no path.
        """
        check_kind("Calibration.request", "out", out, *FOLDER)
        trace, air = self._records
        discrepancy = self._number("discrepancy")
        return Request(
            food=self._food,
            trace=trace,
            air=air,
            knife=str(self.knife),
            speed=self._number("speed"),
            board_z=self._number("board_z"),
            t_end=self._number("t_end"),
            baseline=self.baseline,
            cut=self.cut,
            sizing=self._sizing,
            fit=None if self.fit is None else tuple(self.fit),
            dx=self._number("dx"),
            budget=self.budget,
            sample=self.sample,
            withdrawal=self.withdrawal,
            gain_sd=self._number("gain_sd"),
            lag_sd=self._number("lag_sd"),
            bandwidth=self._number("bandwidth"),
            errors=ErrorModel() if discrepancy is None else ErrorModel(discrepancy=discrepancy),
            u_num=None if self.u_num is None else Path(self.u_num),
            start_from=None if self.start_from is None else Path(self.start_from),
            seed=self.seed,
            arch=self.arch,
            command=(f"{self._call()}.run({str(out)!r})" if str(out) else f"{self._call()}.run()",),
        )

    def run(
        self,
        out: str | Path | None = None,
        *,
        resume: bool = False,
        progress: Callable[[Progress], None] | bool | None = None,
        say: Callable[[str], None] | None = None,
    ) -> CalibrationResult:
        """Calibrate, and write what ``calibrate`` writes.

        Args:
            out: Output folder, which is made and never overwritten; None for ``cutcal-FOOD-TRACE`` in the current one.
            resume: Go on with the run in ``out``; nothing is simulated twice.
            progress: Called after each simulation; True for a bar on standard error.
            say: Called with each warning and stage, as one sentence.

        Returns:
            What the folder holds.

        Raises:
            CutcalError: Anything wrong with the input; nothing that was computed is lost.
        """
        from calib.calibration.run import run

        check_kind("Calibration.run", "out", "" if out is None else out, *FOLDER)
        request = self.request("" if out is None else out)
        folder = Path(f"cutcal-{request.food.name}-{request.stem}" if out is None else out)
        with speaking_of_arguments(), script_hidden(), ExitStack() as shown:
            told = listeners("Calibration.run", progress, say, shown)
            check_kind("Calibration.run", "resume", resume, *FLAG)
            say = in_arguments(say)
            pool = shown.enter_context(workers_for(self.workers, self.arch, self.scheduler, say))
            return run(request, folder, pool, resume=resume, progress=told, say=say)

    def check(self, png: str | Path | None = None) -> str:
        """How the trace is read and what would be fitted, as ``calibrate --check`` says it; nothing is simulated.

        Args:
            png: File into which the record is drawn as it was read, or None.

        Returns:
            A line for each of columns, tare, contact, stroke, specimen, cells and parameters, and the warnings.

        Raises:
            CutcalError: Anything wrong with the input, or a picture that cannot be written.
        """
        from calib.calibration.description import description

        check_kind("Calibration.check", "png", "" if png is None else png, *FILE)
        with speaking_of_arguments():
            return as_arguments(description(self.request(), None if png is None else Path(png)))

    @staticmethod
    def load(out: str | Path) -> CalibrationResult:
        """The result in a folder that :meth:`run` or ``calibrate --out`` has written.

        Raises:
            CutcalError: It is no path.
            OutputError: There is no finished calibration in it.
        """
        check_kind("Calibration.load", "out", out, *FOLDER)
        folder = Path(out)
        path = folder / SUMMARY
        if not path.is_file():
            raise OutputError(
                f"{path}: cannot be read (no such file); name the folder of a finished calibration, or {RESUME}"
            )
        summary = read_summary(path, RESUME)
        missing = [key for key in KEYS if key not in summary] if isinstance(summary, dict) else list(KEYS)
        if missing:
            raise OutputError(f"{path}: not of a calibration ({', '.join(missing)} missing); name another folder")
        return read_result(folder, RESUME)

    def _record(self, given: str | Path | Trace | pd.DataFrame) -> Trace:
        """A record in any of its forms."""
        return given if isinstance(given, Trace) else read_trace(given, **self._reading)

    def _call(self) -> str:
        """This object as it would be written, without what is as usual."""
        words = [f"Food({self.food.name!r})" if isinstance(self.food, FoodSpec) else repr(str(self.food))]
        for item in fields(self)[1:]:
            value = getattr(self, item.name) if item.init else item.default
            if isinstance(value, (Trace, pd.DataFrame)):
                record = self._records[item.name == "air"]
                assert record is not None  # because the value is not
                words.append(f"{item.name}={type(value).__name__}({record.source!r})")
            elif value != item.default:
                words.append(f"{item.name}={str(value) if isinstance(value, Path) else value!r}")
        return f"Calibration({', '.join(words)})"


def workers_for(workers: int | None, arch: str, scheduler: str | None, say: Callable[[str], None] | None) -> Workers:
    """What runs the simulations: processes of this machine, or a cluster.

    Args:
        workers: Simulations at a time; None for 2, of a cluster for all.
        arch: Device of the simulations.
        scheduler: Address of a Dask cluster, or None.
        say: Called with a sentence about the workers of a cluster, or None.

    Returns:
        The workers; nothing is started before it has to do.
    """
    if scheduler is not None:
        from calib.simulation.dask_cluster import Cluster

        return Cluster(scheduler, workers, arch, say=say or (lambda _: None))
    from calib.simulation.process_pool import Pool

    return Pool(LOCAL_WORKERS if workers is None else workers, arch)


@contextmanager
def script_hidden() -> Iterator[None]:
    """Keep worker processes from running the caller's script, of which they need nothing.

    Each would import it again, and without ``if __name__ == "__main__"`` in it start a calibration of its own.
    """
    main = sys.modules["__main__"]
    hidden: dict[str, Any] = {name: main.__dict__[name] for name in ("__file__", "__spec__") if name in main.__dict__}
    main.__dict__.pop("__file__", None)
    main.__spec__ = None
    try:
        yield
    finally:
        main.__dict__.update(hidden)
