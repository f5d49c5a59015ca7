"""Calibrating from Python on several cuts, as from the command line with ``--config``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calib.api import script_hidden
from calib.io.folder import finite
from calib.io.progress import Progress
from calib.io.typed_document import to_document
from calib.io.wording import in_arguments, speaking_of_arguments
from calib.multi_specimen.spec import StudySpec
from calib.multi_specimen.study_file import read_study


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
        with speaking_of_arguments():
            return Study(read_study(path))

    def run(
        self,
        out: str | Path,
        *,
        workers: int = 2,
        resume: bool = False,
        progress: Callable[[Progress], None] | None = None,
        say: Callable[[str], None] | None = None,
    ) -> dict[str, Any]:
        """Fit and predict, and write what ``calibrate --config`` writes.

        Args:
            out: Output folder, which is made and never overwritten.
            workers: Simulations at a time.
            resume: Go on with the study in ``out``; nothing is simulated twice.
            progress: Called after each simulation.
            say: Called with each warning and stage, as one sentence.

        Returns:
            The content of ``summary.json``.

        Raises:
            CutcalError: Anything wrong with the input; nothing that was computed is lost.
        """
        from calib.multi_specimen.run import run
        from calib.simulation.process_pool import Pool

        with speaking_of_arguments(), script_hidden(), Pool(workers, self.spec.first.arch) as pool:
            result = run(self.spec, Path(out), pool, resume=resume, progress=progress, say=in_arguments(say))
        return dict(finite(to_document(result)))
