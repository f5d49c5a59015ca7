"""Calibrating from Python on several cuts, as from the command line with ``--config``."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.api import Calibration, script_hidden, workers_for
from calib.arguments import LIMITS, listeners
from calib.calibration.run_folder import RunFolder
from calib.io.folder import finite
from calib.io.kinds import FILE, FLAG, FOLDER, TEXT, check_kind
from calib.io.progress import Progress
from calib.io.typed_document import to_document
from calib.io.wide_table import WideTable, table_of_rows
from calib.io.wording import brief, in_arguments, speaking_of_arguments
from mpm.runtime import ARCHES
from mpm.scene.errors import CutcalError, check_number

if TYPE_CHECKING:
    from calib.multi_specimen.result import StudyResult
    from calib.multi_specimen.spec import StudySpec

FOR_ONE_CUT = ("cut", "sample", "withdrawal", "start_from")
"""Arguments of a calibration that a fit of several cuts does not take."""


@dataclass(frozen=True, eq=False)
class StudyRun(RunFolder):
    """A finished study and its folder.

    Attributes:
        folder: The output folder.
        result: What was found: the content of ``summary.json``, typed.
    """

    folder: Path
    result: StudyResult

    def __repr__(self) -> str:
        return f"StudyRun({str(self.folder)!r}, food={self.result.food!r}, passed={self.passed})"

    @property
    def passed(self) -> bool:
        """Whether every fitted and every held-out cut passed."""
        return self.result.passed

    @property
    def summary(self) -> dict[str, Any]:
        """Content of ``summary.json``: SI units, errors as fractions."""
        return dict(finite(to_document(self.result)))

    @property
    def parameters(self) -> WideTable:
        """Fitted values by name: value, unit, 95 % interval, literature range, verdict; one of a specimen's own is
        NAME@CUT."""
        return table_of_rows(self.summary["parameters"])


@dataclass(frozen=True, eq=False)
class Study:
    """Several cuts of one food, with what they share and what is held out; :meth:`run` fits and predicts them.

    Attributes:
        spec: What the file of the study says.
        call: How it was made, for the command that the summary states.
        folder: Output folder where :meth:`run` is given none.

    Raises:
        CutcalError: Something of a wrong kind.
    """

    spec: StudySpec
    call: str = field(default="Study", repr=False)
    folder: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        from calib.multi_specimen.spec import StudySpec

        check_kind("Study", "spec", self.spec, (StudySpec,), "what Study.read reads of a file")
        for name in ("call", "folder"):
            check_kind("Study", name, getattr(self, name), *TEXT)

    @staticmethod
    def read(path: str | Path) -> Study:
        """The study of a YAML file, as ``calibrate --config`` takes it.

        Raises:
            CutcalError: Anything wrong with the file; the message names the place in it.
        """
        from calib.multi_specimen.study_file import read_study

        check_kind("Study.read", "path", path, *FILE)
        with speaking_of_arguments():
            return Study(read_study(path), f"Study.read({str(path)!r})", f"cutcal-{Path(path).stem}")

    @staticmethod
    def of_cuts(calibration: Calibration) -> Study:
        """All cuts of the record of a calibration as specimens of one food, as ``calibrate --all`` takes them.

        Raises:
            CutcalError: The record holds one cut, or the calibration says what is for one.
        """
        from calib.multi_specimen.spec import study_of_cuts

        check_kind("Study.of_cuts", "calibration", calibration, (Calibration,), "a Calibration")
        with speaking_of_arguments():
            of_one = next((name for name in FOR_ONE_CUT if getattr(calibration, name)), None)
            if of_one is not None:
                raise CutcalError(f"Study.of_cuts: --{of_one.replace('_', '-')} is for one cut; leave it out")
            request = calibration.request()
            call = f"Study.of_cuts({calibration!r})"
            return Study(study_of_cuts(request), call, f"cutcal-{request.food.name}-{request.stem}")

    @staticmethod
    def load(out: str | Path) -> StudyRun:
        """The finished study in a folder that :meth:`run` or ``calibrate --config`` has written.

        Raises:
            CutcalError: It is no path.
            DocumentError: There is no finished study in it.
        """
        from calib.multi_specimen.result import read_result

        check_kind("Study.load", "out", out, *FOLDER)
        return StudyRun(Path(out), read_result(Path(out)))

    def run(
        self,
        out: str | Path | None = None,
        *,
        workers: int | None = None,
        scheduler: str | None = None,
        budget: float | None = None,
        arch: str | None = None,
        resume: bool = False,
        progress: Callable[[Progress], None] | bool | None = None,
        say: Callable[[str], None] | None = None,
    ) -> StudyRun:
        """Fit and predict, and write what ``calibrate --config`` writes.

        Args:
            out: Output folder, which is made and never overwritten; None for the one that ``calibrate`` takes, in the
                current folder.
            workers: Simulations at a time; None for 2, of a cluster for all.
            scheduler: Address of a Dask cluster that runs the simulations, such as ``tcp://host:8786``, or None.
            budget: Largest number of simulations of each trace, in each fit; None for the study's own.
            arch: Device of the simulations; None for the study's own, which is ``cpu`` in a file.
            resume: Go on with the study in ``out``; nothing is simulated twice.
            progress: Called after each simulation; True for a bar on standard error.
            say: Called with each warning and stage, as one sentence.

        Returns:
            What was found, and its folder.

        Raises:
            CutcalError: Anything wrong with the input; nothing that was computed is lost.
        """
        from calib.multi_specimen.run import run

        check_kind("Study.run", "out", "" if out is None else out, *FOLDER)
        check_kind("Study.run", "scheduler", "" if scheduler is None else scheduler, *TEXT)
        call = ", ".join(
            ([] if out is None else [repr(str(out))])
            + [f"{name}={value!r}" for name, value in (("budget", budget), ("arch", arch)) if value is not None]
        )
        folder = Path((self.folder or f"cutcal-{self.spec.food.name}") if out is None else out)
        with speaking_of_arguments(), script_hidden(), ExitStack() as shown:
            told = listeners("Study.run", progress, say, shown)
            check_kind("Study.run", "resume", resume, *FLAG)
            say = in_arguments(say)
            device = self._device(workers, budget, arch)
            study = self.spec.run_with(budget=budget, arch=device, command=(f"{self.call}.run({call})",))
            pool = shown.enter_context(workers_for(workers, device, scheduler, say))
            result = run(study, folder, pool, resume=resume, progress=told, say=say)
        return StudyRun(folder, result)

    def _device(self, workers: int | None, budget: float | None, arch: str | None) -> str:
        """The device of the simulations.

        Raises:
            CutcalError: An impossible argument of :meth:`run`.
        """
        if not (workers is None or (type(workers) is int and workers > 0)):
            raise CutcalError(f"Study.run: workers = {brief(workers)}; give a whole number of at least 1")
        if budget is not None:
            check_number("Study.run", "budget", budget, *LIMITS["budget"])
        if not (arch is None or arch in ARCHES):
            raise CutcalError(f"Study.run: arch = {brief(arch)} is none of {', '.join(ARCHES)}")
        return self.spec.first.arch if arch is None else arch
