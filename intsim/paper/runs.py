"""Finished evaluations from which a figure is made, each episode counted once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calib.errors import OutputError
from intsim.evaluate import RESULT_FILE, ROWS_FILE, read_evaluation
from intsim.outcomes import EpisodeOutcome, EvaluationSettings, SuccessRate

MET, MET_AND_SEVERED = "criteria met", "met, in pieces"
"""Columns of ours: the four published criteria, and these and a food in pieces in the solver."""


@dataclass(frozen=True)
class PaperRun:
    """Episodes of one policy in one world.

    Attributes:
        settings: What was evaluated.
        rows: Its episodes.
    """

    settings: EvaluationSettings
    rows: Sequence[EpisodeOutcome]

    def chosen(
        self,
        *,
        suite: str | None = None,
        foods: Sequence[str] | None = None,
        pieces: int = 0,
    ) -> list[EpisodeOutcome]:
        """Its episodes of a suite and of some foods, for one cut or for so many pieces.

        Args:
            suite: Name of the suite; None for any.
            foods: Names of foods; None for any.
            pieces: Equal pieces that were asked for; 0 for one cut.

        Returns:
            The episodes.
        """
        return [
            row
            for row in self.rows
            if suite in (None, row.suite) and row.pieces == pieces and (foods is None or row.food in foods)
        ]


def read_runs(folders: Sequence[Path]) -> list[PaperRun]:
    """The evaluations in some folders, and in the folders in them, each episode once.

    Args:
        folders: Folders of ``cutcal evaluate``.

    Returns:
        A run for each of them.

    Raises:
        OutputError: A folder holds no finished evaluation.
    """
    seen: set[tuple[str, ...]] = set()
    out = []
    for folder in (one for given in folders for one in _evaluations(given)):
        settings, rows = read_evaluation(folder)
        same = repr(replace(settings, paper=None, seed=0, foods={}))
        own = {(same, settings.foods.get(r.food, ""), r.suite, str(r.seed), r.food, r.instruction): r for r in rows}
        out.append(PaperRun(settings, [row for key, row in own.items() if key not in seen]))
        seen |= set(own)
    return out


def _evaluations(folder: Path) -> Iterator[Path]:
    """The folder itself, or those in it, that hold an evaluation."""
    if not folder.is_dir():
        raise OutputError(f"--from {folder}: there is no such folder; name one of cutcal evaluate")
    inner = sorted(path.parent for path in folder.glob(f"*/{ROWS_FILE}"))
    if (folder / ROWS_FILE).exists() or (folder / RESULT_FILE).exists() or not inner:
        yield folder
    yield from inner


def rates(rows: Sequence[EpisodeOutcome]) -> dict[str, SuccessRate]:
    """How often the criteria are met, and met with the food in pieces where that was simulated; empty without episodes.

    A cut that the solver could not make, or did not end, is no success and stays in the denominator.
    """
    if not rows:
        return {}
    out = {MET: SuccessRate.of([row.published for row in rows])}
    if any(row.severing is not None for row in rows):
        parted = [row.published and row.severing is not None and bool(row.severing.severed) for row in rows]
        out[MET_AND_SEVERED] = SuccessRate.of(parted)
    return out
