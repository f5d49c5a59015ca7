"""Calibrating from Python on several cuts, as from the command line with ``--config``."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.api import script_hidden
from calib.calibration.parameter_table import ParameterTable, parameter_table
from calib.calibration.run_folder import RunFolder
from calib.io.folder import finite
from calib.io.progress import Progress, ProgressBar
from calib.io.typed_document import to_document
from calib.io.wording import in_arguments, speaking_of_arguments

if TYPE_CHECKING:
    from calib.multi_specimen.result import StudyResult
    from calib.multi_specimen.spec import StudySpec


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
    def parameters(self) -> ParameterTable:
        """Fitted values by name: value, unit, 95 % interval, literature range, verdict; one of a specimen's own is
        NAME@CUT."""
        return parameter_table(self.summary["parameters"])


@dataclass(frozen=True, eq=False)
class Study:
    """Several cuts of one food, with what they share and what is held out; :meth:`run` fits and predicts them.

    Attributes:
        spec: What the file of the study says.
    """

    spec: StudySpec

    @staticmethod
    def read(path: str | Path) -> Study:
        """The study of a YAML file, as ``calibrate --config`` takes it.

        Raises:
            CutcalError: Anything wrong with the file; the message names the place in it.
        """
        from calib.multi_specimen.study_file import read_study

        with speaking_of_arguments():
            return Study(read_study(path))

    @staticmethod
    def load(out: str | Path) -> StudyRun:
        """The finished study in a folder that :meth:`run` or ``calibrate --config`` has written.

        Raises:
            DocumentError: There is no finished study in it.
        """
        from calib.multi_specimen.result import read_result

        return StudyRun(Path(out), read_result(Path(out)))

    def run(
        self,
        out: str | Path | None = None,
        *,
        workers: int = 2,
        resume: bool = False,
        progress: Callable[[Progress], None] | bool | None = None,
        say: Callable[[str], None] | None = None,
    ) -> StudyRun:
        """Fit and predict, and write what ``calibrate --config`` writes.

        Args:
            out: Output folder, which is made and never overwritten; None for ``cutcal-`` and the name of the study's
                file, in the current folder.
            workers: Simulations at a time.
            resume: Go on with the study in ``out``; nothing is simulated twice.
            progress: Called after each simulation; True for a bar on standard error.
            say: Called with each warning and stage, as one sentence.

        Returns:
            What was found, and its folder.

        Raises:
            CutcalError: Anything wrong with the input; nothing that was computed is lost.
        """
        from calib.multi_specimen.run import run
        from calib.simulation.process_pool import Pool

        folder = Path(f"cutcal-{Path(self.spec.source).stem}" if out is None else out)
        with speaking_of_arguments(), script_hidden(), ExitStack() as shown:
            pool = shown.enter_context(Pool(workers, self.spec.first.arch))
            if isinstance(progress, bool):
                progress = shown.enter_context(ProgressBar()) if progress else None
            result = run(self.spec, folder, pool, resume=resume, progress=progress, say=in_arguments(say))
        return StudyRun(folder, result)
