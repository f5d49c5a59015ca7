"""The tests that a lab can make of a food, what each costs, and which were left out and why."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from calib.design.start import Start
from calib.errors import MaterialError
from calib.io.yaml_checks import suggest
from calib.material.knife import load_knives
from calib.material.properties import BOARD_SUCTION
from calib.material.scene import cut_scene
from mpm.scene import Knife, Scene
from mpm.scene.errors import CutcalError, SceneError
from mpm.scene.shapes import Shape

MINUTES: Mapping[str, float] = {
    "cut": 10.0,
    "blade": 15.0,
    "narrower": 15.0,
    "rack": 15.0,
    "slicing": 20.0,
    "compression": 30.0,
    "width": 2.0,
    "photograph": 5.0,
}
"""Assumed lab work of each kind of test [min]: preparing and measuring the specimen, the record, and for a blade its
change; for compression three cylinders. Nobody has measured them: give your own."""
OTHER_BLADE = 1.5
"""Least ratio of the angles of two blades that are another test."""
NARROWER = 0.6
"""Width of a narrower piece over that of the first [-]."""
SLICE_RATIO = 1.0
"""Speed along the edge over the speed down of a slicing cut [-]."""
WIDTH_SD, PHOTOGRAPH_WIDTH_SD = 0.02, 0.05
"""Relative standard deviations of a width by caliper or weight, and by a photograph with a scale [-]. Assumed."""
PHOTOGRAPH_SIZES_SD: Mapping[str, float] = {"height": 0.03, "aspect": PHOTOGRAPH_WIDTH_SD, "roundness": 0.05}
"""The same by a photograph: of height and aspect, relative [-], and of the roundness of an outline [-]. Assumed."""
CALIBRATE, STUDY, RANGES, NONE = "calibrate", "calibrate --config", "calibrate --material", "none"
"""What takes the record of a test: a calibration, a fit of several traces, a food with narrower ranges, nothing yet."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made next.

    Attributes:
        name: Its name.
        kind: One of :data:`MINUTES`.
        what: What is done, in words.
        taken_by: Which command takes its record, or ``none``.
        scene: The cut, at the present values on coarse cells; None where nothing is cut.
        same_model: Whether the model errs as in the first cut: the same blade moved in the same way.
    """

    name: str
    kind: str
    what: str
    taken_by: str
    scene: Scene | None = None
    same_model: bool = False


@dataclass(frozen=True)
class LeftOut:
    """A test that is not judged.

    Attributes:
        name: Its name.
        reason: Why not.
    """

    name: str
    reason: str


def coarse_cut(start: Start, knife: Knife, shape: Shape) -> Scene:
    """A cut of the food as a search screens it: one cell to the process zone, and twice as fast.

    Args:
        start: What is known.
        knife: The blade.
        shape: The specimen.

    Returns:
        The cut at the present values.
    """
    return cut_scene(start.food, shape, knife, stroke=start.stroke, coarse=True)


def candidates(start: Start, blades: Sequence[Knife] | None = None) -> tuple[list[Candidate], list[LeftOut]]:
    """Tests of a food, in the order of their kinds.

    Args:
        start: What is known of it.
        blades: Other blades that the lab has; None for those of ``knives.yaml`` with another angle.

    Returns:
        The tests, and those that were left out.
    """
    found: list[Candidate] = []
    out: list[LeftOut] = []
    joint = CALIBRATE if start.run is None else STUDY
    if start.run is None:
        what = f"cut a specimen of measured width with the {start.knife.name} knife"
        _add(found, out, start, Candidate("cut", "cut", what, joint), start.knife, start.shape)
    for knife in _blades(start, out) if blades is None else blades:
        what = f"cut a specimen of measured width with the {knife.name} knife"
        _add(found, out, start, Candidate(f"blade {knife.name}", "blade", what, joint), knife, start.shape)
    narrow = replace(start.shape, width=NARROWER * start.shape.width)
    what = f"cut a piece of {narrow.width * 1e3:.0f} mm, measured, with the {start.knife.name} knife"
    _add(found, out, start, Candidate("narrower", "narrower", what, joint, same_model=True), start.knife, narrow)
    _rack(start, found, out, joint)
    what = f"cut a specimen of measured width with the {start.knife.name} knife moved along its edge as fast as down"
    _add(found, out, start, Candidate("slicing", "slicing", what, NONE), start.knife, start.shape)
    what = "compress cylinders to 30 % between lubricated plates, three of them"
    found.append(Candidate("compression", "compression", what, RANGES))
    _sizes(start, found, out)
    out.append(LeftOut("speed", "no law with a rate is fitted yet, so the model has the same force at every speed"))
    return found, out


def _rack(start: Start, found: list[Candidate], out: list[LeftOut], taken_by: str) -> None:
    """The cut of a food whose wet face the board does not hold down, where it is not known how firmly it does."""
    if BOARD_SUCTION not in start.parameters.names:
        out.append(LeftOut("rack", "how firmly the board holds the food down is not among the parameters"))
        return
    food = start.food.with_values({BOARD_SUCTION: 0.0})
    what = f"cut a specimen of measured width with the {start.knife.name} knife on a rack that lets air under it"
    dry = replace(start, food=food)
    _add(found, out, dry, Candidate("rack", "rack", what, taken_by, same_model=True), start.knife, start.shape)


def _sizes(start: Start, found: list[Candidate], out: list[LeftOut]) -> None:
    """The tests that measure the specimen which was cut."""
    if start.run is None:
        out.append(LeftOut("width", "nothing was cut yet; every cut here is of a specimen of measured width"))
        out.append(LeftOut("photograph", "nothing was cut yet; every cut here is of a specimen of known shape"))
        return
    names = {"height": "height", "roundness": "shape"}
    fitted = [word for name, word in names.items() if name in start.parameters.names]
    open_width = start.width_sd > 0.0 or "aspect" in start.parameters.names
    if open_width:
        what = "measure the width of the specimen that was cut, by caliper or by weight"
        found.append(Candidate("width", "width", what, CALIBRATE))
    else:
        out.append(LeftOut("width", "the width of the specimen that was cut was given to the calibration"))
    together = " and ".join([", ".join(["width", *fitted[:-1]]), *fitted[-1:]])
    if open_width or fitted:
        what = f"photograph the specimen that was cut beside a scale, for its {together}"
        found.append(Candidate("photograph", "photograph", what, CALIBRATE))
    else:
        out.append(LeftOut("photograph", "width, height and shape of the specimen that was cut are known"))


def _blades(start: Start, out: list[LeftOut]) -> list[Knife]:
    """Knives of ``knives.yaml`` whose angle is another one."""
    chosen = []
    for knife in load_knives().values():
        ratio = max(knife.angle, start.knife.angle) / min(knife.angle, start.knife.angle)
        if ratio >= OTHER_BLADE:
            chosen.append(knife)
        elif knife.name != start.knife.name:
            out.append(LeftOut(f"blade {knife.name}", f"its angle is about that of the {start.knife.name} knife"))
    return chosen


def _add(
    found: list[Candidate], out: list[LeftOut], start: Start, candidate: Candidate, knife: Knife, shape: Shape
) -> None:
    """Add a cut, or why it cannot be simulated."""
    try:
        scene = coarse_cut(start, knife, shape)
        if candidate.kind == "slicing":
            scene = replace(scene, motion=replace(scene.motion, slice_ratio=SLICE_RATIO))
    except SceneError as e:
        out.append(LeftOut(candidate.name, str(e)))
        return
    found.append(replace(candidate, scene=scene))


def minutes_of(given: Mapping[str, float]) -> dict[str, float]:
    """Lab work of each kind [min], with what the user knows better.

    Args:
        given: Minutes [min] by kind.

    Returns:
        All of them.

    Raises:
        CutcalError: An unknown kind.
    """
    for name in given:
        if name not in MINUTES:
            raise CutcalError(f"--minutes {name}: no such test{_near(name, MINUTES)}")
    return {**MINUTES, **given}


def check_asked(start: Start, name: str) -> None:
    """Refuse a parameter that is not among those of the start.

    Args:
        start: What is known.
        name: The parameter that is asked for.

    Raises:
        MaterialError: There is no such parameter.
    """
    names = start.parameters.names
    if name not in names:
        raise MaterialError(f"--for {name}: no such parameter{_near(name, (*names, 'all', 'peak under knife NAME'))}")


def _near(word: str, known: Collection[str]) -> str:
    """What may have been meant, and all that there is."""
    near = suggest(word, known)
    return near if near.startswith(";") else f"{near}; known: {', '.join(known)}"
