"""The next test from Python, as ``cutcal design`` finds it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from pathlib import Path

from calib.api import script_hidden, workers_for
from calib.arguments import KINDS, listeners
from calib.calibration.result import CalibrationResult
from calib.design.result import ALL
from calib.design.result import DesignResult as DesignResult
from calib.design.start import Start, start_of_food, start_of_run
from calib.io.kinds import FLAG, FOLDER, NAMED, check_kind
from calib.io.wording import brief, in_arguments, speaking_of_arguments
from calib.material.food import FILES, FoodSpec
from calib.material.knife import load_knife
from mpm.runtime import ARCHES
from mpm.scene.errors import CutcalError, check_number

MINUTES = (0.0, 1e5, "min")
"""Numbers between which the minutes of a test lie, and their unit: those of the command line."""


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """Which test of a food to make next; :meth:`run` finds it. The names are those of the options of ``cutcal design``.

    Attributes:
        start: What is known: a finished calibration, as its result or its folder; or a food that nobody has cut, as a
            :class:`~calib.material.food.FoodSpec`, a name or a YAML file.
        asked: What is to be narrowed (``--for``): ``all``, a parameter such as ``R``, ``peak under knife NAME`` or
            ``work under knife NAME``.
        knife: Blade of the cut that would be made; for a food alone, None for ``kitchen``.
        set: Other values of properties [SI], by name; for a food alone.
        blade: Other knives that the lab has; None for those of ``knives.yaml``.
        minutes: Lab work [min] by kind of test, such as ``{"blade": 5.0}``, where it is known better.
        draws: Foods that the tests are judged about.
        workers: Simulations at a time; None for 2, of a cluster for all.
        scheduler: Address of a Dask cluster that runs the simulations, or None.
        seed: Seed of the draws.
        arch: Device of the simulations.

    Raises:
        CutcalError: An unknown food or knife, a folder without a finished calibration, or an impossible value.
    """

    start: str | Path | FoodSpec | CalibrationResult
    asked: str = ALL
    knife: str | Path | None = None
    set: Mapping[str, float] | None = None
    blade: Sequence[str | Path] | None = None
    minutes: Mapping[str, float] | None = None
    draws: int = 1
    workers: int | None = None
    scheduler: str | None = None
    seed: int = 0
    arch: str = "cpu"
    _start: Start = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with speaking_of_arguments():
            self._check()
            object.__setattr__(self, "_start", self._known())

    def __repr__(self) -> str:
        known = f"{self._start.food.name}" if self._start.run is None else str(self._start.run)
        words = [repr(known)]
        for item in fields(self)[1:]:
            if item.init and getattr(self, item.name) != item.default:
                words.append(f"{item.name}={getattr(self, item.name)!r}")
        return f"Design({', '.join(words)})"

    def _check(self) -> None:
        """Refuse impossible values.

        Raises:
            CutcalError: There is one.
        """
        for name in ("knife", "set", "scheduler"):
            if (given := getattr(self, name)) is not None:
                check_kind("Design", name, given, *KINDS[name])
        for name, lowest in (("draws", 1), ("workers", 1), ("seed", 0)):
            value = getattr(self, name)
            if name == "workers" and value is None:
                continue
            if not isinstance(value, int) or isinstance(value, bool) or value < lowest:
                raise CutcalError(f"Design: {name} = {brief(value)}; give a whole number of at least {lowest}")
        if self.arch not in ARCHES:
            raise CutcalError(f"Design: arch = {brief(self.arch)} is none of {', '.join(ARCHES)}")
        if not isinstance(self.asked, str):
            raise CutcalError(f"Design: asked = {brief(self.asked)}; give a text, such as 'R'")
        if not isinstance(self.start, (str, Path, FoodSpec, CalibrationResult)):
            raise CutcalError(f"Design: start = {brief(self.start)}; give a calibration's result or folder, or a food")
        if isinstance(self.blade, (str, Path)):
            raise CutcalError(f"Design: blade = {brief(str(self.blade))} is text; give a list, such as ['edc']")
        if self.blade is not None:
            check_kind("Design", "blade", self.blade, (Sequence,), "a list, such as ['edc']")
            for blade in self.blade:
                check_kind("Design", "a blade", blade, *NAMED)
        check_kind("Design", "minutes", {} if self.minutes is None else self.minutes, (Mapping,), "a dict by kind")
        for name, value in (self.minutes or {}).items():
            check_number("Design", f"minutes of {brief(name)}", value, *MINUTES)

    def _known(self) -> Start:
        """What is known before the test.

        Raises:
            CutcalError: There is no such food or calibration, or an argument does not go with it.
        """
        known = self.start.folder if isinstance(self.start, CalibrationResult) else self.start
        if isinstance(known, FoodSpec) or not self._is_folder(known):
            food = known if isinstance(known, FoodSpec) else FoodSpec.load(known)
            food = food.with_values(self.set) if self.set else food
            return start_of_food(food, load_knife("kitchen" if self.knife is None else str(self.knife)))
        for name in ("set", "knife"):
            if getattr(self, name):
                raise CutcalError(f"Design: {name}: the calibration has its food and knife; leave it out")
        return start_of_run(Path(known))

    def _is_folder(self, known: str | Path) -> bool:
        """Whether what is known lies in a folder, and not in the file of a food or under its name.

        Raises:
            CutcalError: It does by its form, but there is no such folder.
        """
        if Path(known).is_dir():
            return True
        named = isinstance(known, str) and Path(known).name == known
        if isinstance(self.start, CalibrationResult) or not (named or str(known).endswith(FILES)):
            raise CutcalError(f"Design: {known}: no such folder; give that of a finished calibration, or a food")
        return False

    def run(
        self, out: str | Path | None = None, *, resume: bool = False, say: Callable[[str], None] | None = None
    ) -> DesignResult:
        """Judge every test, and write ``design.json`` and ``design.svg``.

        Args:
            out: Output folder, which is made and never overwritten; None for ``cutcal-design-FOOD``.
            resume: Go on with the design in ``out``; nothing is simulated twice.
            say: Called with a sentence after each simulation.

        Returns:
            The ranked tests.

        Raises:
            CutcalError: Anything wrong with the input; nothing that was computed is lost.
        """
        from calib.design.run import DesignRequest, run

        check_kind("Design.run", "out", "" if out is None else out, *FOLDER)
        check_kind("Design.run", "resume", resume, *FLAG)
        listeners("Design.run", None, say, ExitStack())
        folder = Path(f"cutcal-design-{self._start.food.name}" if out is None else out)
        say = in_arguments(say) or (lambda _: None)
        with (
            speaking_of_arguments(),
            script_hidden(),
            workers_for(self.workers, self.arch, self.scheduler, say) as pool,
        ):
            blades = None if self.blade is None else tuple(load_knife(str(b)) for b in dict.fromkeys(self.blade))
            request = DesignRequest(
                self._start,
                self.asked.strip(),
                blades,
                dict(self.minutes or {}),
                self.draws,
                self.seed,
                (f"{self!r}.run({'' if out is None else repr(str(out))})",),
            )
            return run(request, folder, pool, resume=resume, say=say)
