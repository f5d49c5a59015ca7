"""What is decided before the first simulation: the conditioned trace, the scenes, the parameters and the objective."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from calib.errors import MaterialError, TraceError
from calib.io.provenance import code_key, key_of
from calib.material.food import FoodSpec
from calib.material.form import ROUNDNESS
from calib.material.knife import load_knife
from calib.material.properties import BOARD_SUCTION, BOW
from calib.material.remarks import notes
from calib.material.scene import (
    SizeRange,
    aspect_range,
    blade_warnings,
    cut_scene,
    form_is_open,
    height_range,
    of_specimen,
    specimen,
    windowed,
    with_other_particles,
)
from calib.problem.earlier_calibration import earlier_guesses
from calib.problem.food_parameters import STICKS, fit_parameters, size_relative_sd, sticking
from calib.problem.nuisance import Sensor, nuisances, real_speed, sensor_of
from calib.problem.numerical_uncertainty import numerical_uncertainty
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.problem.rate_exponent import check_speeds
from calib.problem.request import Request
from calib.problem.target import Target
from calib.problem.trace_guess import trace_guesses
from calib.simulation.evaluation import Evaluators
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore, Header
from calib.simulation.workers import Workers
from calib.trace.conditioning import Conditioned, condition
from calib.trace.cuts import single_cut
from calib.trace.filters import BandLimited
from calib.trace.stroke import board_stroke
from mpm.scene import Knife, Motion, Scene
from mpm.scene.errors import SceneError
from mpm.scene.shapes import Shape

FINE, COARSE, REPLICATED = "fine", "coarse", "again"
"""What the fidelities of a search are called in its store; a replicate is called ``again``."""
REPLICATE = 2
"""Which of the shifted grids, with its own particles, a replicate has; the numerical checks take another one."""


@dataclass(frozen=True, eq=False)
class Setup:
    """What is decided for a trace before its first simulation.

    Attributes:
        request: What was asked.
        curve: The conditioned trace.
        fine: The cut at the resolution that counts, with the food's values.
        coarse: The same on coarser cells and faster.
        objective: Target, parameters and error model.
        assumed: What was assumed of specimen and sensor, one sentence each.
        air_sha256: SHA-256 of the air run, None without one.
        bandwidth: Cut-off of the sensor's low-pass [Hz]; infinite for none.
    """

    request: Request
    curve: Conditioned
    fine: Scene
    coarse: Scene
    objective: Objective
    assumed: tuple[str, ...]
    air_sha256: str | None = None
    bandwidth: float = math.inf

    @property
    def kept(self) -> tuple[str, ...]:
        """Which of width and length were measured, and so do not follow a fitted height."""
        return self.request.sizing.kept

    @property
    def start_values(self) -> dict[str, float]:
        """The values that a fit begins with, by name [SI]: those of the literature."""
        return {p.name: p.value for p in self.objective.parameters}

    @property
    def notes(self) -> list[str]:
        """The same as a run says it, and what is assumed of the specimen."""
        return [*notes(self.request.food), *self.curve.warnings, *self.assumptions]

    @property
    def assumptions(self) -> list[str]:
        """What was assumed of specimen and sensor, and what the blade leaves uncut of a specimen of this size."""
        assert isinstance(self.fine.knife, Knife)  # a press has no trace of a cut
        return [*self.assumed, *blade_warnings(self.fine.food.shape, self.fine.knife)]

    @property
    def warnings(self) -> list[str]:
        """What is doubtful of the food's values and of the trace, one sentence each."""
        return [*self.request.food.warnings(), *self.curve.warnings]

    @property
    def header(self) -> Header:
        """What the store of its simulations belongs to."""
        return Header(self.curve.trace.sha256, key_of(self.fine.as_dict()))

    def sized(self, values: Mapping[str, float]) -> Setup:
        """The set-up with the specimen of its fine cut as large and as round as ``values`` say, if they do."""
        scene, _ = of_specimen(self.fine, values, self.kept)
        return replace(self, fine=scene)

    def scene(self, values: Mapping[str, float]) -> Scene:
        """The fine cut at some values [SI] by name: the material's, and the specimen's where that is fitted."""
        scene, material = of_specimen(self.fine, values, self.kept)
        return scene.with_material(**material)

    def evaluators(self, pool: Workers, store: EvaluationStore, label: str = "") -> Evaluators:
        """What runs the simulations of a search for this trace.

        Args:
            pool: Where they run.
            store: Where they are kept.
            label: What their fidelity begins with in the store; of several traces, the name of this one and a blank.

        Returns:
            An evaluator for each fidelity.
        """
        return Evaluators(
            self.evaluator(self.fine, pool, store, label + FINE),
            self.evaluator(self.coarse, pool, store, label + COARSE),
            self.evaluator(replicated(self.fine), pool, store, label + REPLICATED),
        )

    def evaluator(self, scene: Scene, pool: Workers, store: EvaluationStore, fidelity: str) -> CachedEvaluator:
        """What runs candidates of one scene of this trace, and each of them once.

        Args:
            scene: The scene, with any values of what is fitted.
            pool: Where the simulations run.
            store: Where they are kept.
            fidelity: What they are called in the store.

        Returns:
            The evaluator.
        """
        inner = pool.evaluator(scene, self.kept)
        content = scene.as_dict() | {"kept": self.kept}
        return CachedEvaluator(inner, store, scene=content, code=code_key(), fidelity=fidelity)


def set_up(request: Request) -> Setup:
    """Condition the trace, and make the scenes and the objective of a calibration.

    Raises:
        CutcalError: Anything wrong with the input.
    """
    curve, air_sha256 = conditioned(request)
    request, sticks = _with_adhesion(with_height(request, curve))
    fine, coarse, sizes, assumed = _scenes(request, curve)
    names = _held_down(request, _names(request, sizes), fine.food.shape)
    if BOARD_SUCTION in names:
        assumed.append(
            "how firmly the board holds the food's wet face is not known: it is fitted; give --set board_suction=0 if "
            "it lay on a rack or on grooves that let air under it"
        )
    if BOW in names:
        assumed.append(
            "how the food lies on the board is not known: its underside may be bowed, so that it rests on its ends or "
            "on its middle; the bow is fitted; give --set bow=0 if it touched the board all along"
        )
    if not request.scaled:  # several are judged together
        check_speeds(names, {curve.trace.source: real_speed(curve)})
    sensor, said = sensor_of(curve, request.gain_sd, request.lag_sd, request.bandwidth)
    objective = _objective(request, curve, fine, sensor, fit_parameters(request.food, names, sizes))
    return Setup(request, curve, fine, coarse, objective, (*assumed, *said, *sticks), air_sha256, sensor.bandwidth)


def conditioned(request: Request) -> tuple[Conditioned, str | None]:
    """The trace of a request, conditioned, and the SHA-256 of its air run (None without one).

    Raises:
        CutcalError: Anything wrong with the records.
    """
    if request.board_z is not None and request.sizing.height is not None:
        raise TraceError("--board-z beside --height, which it is there to find; give one of them")
    trace, air = request.records()
    known = request.sizing.height or request.food.dims["height"].value
    curve = condition(
        single_cut(trace, request.cut) if request.cut is not None else trace,
        air=air,
        speed=request.speed,
        height=known,
        t_end=request.t_end,
        board=request.sizing.height,
        board_z=request.board_z,
        baseline=request.baseline,
    )
    return curve, None if air is None else air.sha256


def with_height(request: Request, curve: Conditioned) -> Request:
    """The request with the specimen's height, where the height of the board says it."""
    if request.board_z is None:
        return request
    height = board_stroke(curve.trace, curve.onset_s, request.board_z)
    return replace(request, sizing=replace(request.sizing, height=height))


def _with_adhesion(request: Request) -> tuple[Request, tuple[str, ...]]:
    """The request with a food that may stick to the blade, where a withdrawal is fitted and adhesion with it, and what
    was assumed."""
    held = request.fit is not None and not set(STICKS) & set(request.fit)
    if not request.withdrawal or held:
        return request, ()
    food, said = sticking(request.food)
    return replace(request, food=food), said


def _scenes(request: Request, curve: Conditioned) -> tuple[Scene, Scene, dict[str, SizeRange], list[str]]:
    """The fine and the coarse cut of a request, the sizes that nobody knows, and what was assumed of the specimen."""
    food, sizing = request.food, request.sizing
    knife = load_knife(request.knife)
    shape, assumed = specimen(food, curve, sizing, open_form=ROUNDNESS in _names(request, ()), knife=knife)
    heights = height_range(food, curve, sizing)
    ranges = {"height": heights, "aspect": aspect_range(shape, knife, sizing)}
    sizes = {name: size for name, size in ranges.items() if size is not None}
    stroke, dx, seed = way_of(food, curve), request.dx, request.seed
    fine = windowed(cut_scene(food, shape, knife, stroke=stroke, dx=dx, seed=seed), heights)
    try:
        screening = windowed(cut_scene(food, shape, knife, stroke=stroke, dx=dx, seed=seed, coarse=True), heights)
    except SceneError as error:
        if dx is None:
            raise
        raise MaterialError(f"dx = {1e3 * dx:g} mm: a calibration screens on larger cells, and {error}") from None
    return fine, screening, sizes, assumed


def way_of(food: FoodSpec, curve: Conditioned) -> float | Motion:
    """Way of the edge [m]; where the force depends on the real speed the motion with the mean one of the trace."""
    length = curve.stroke_length_m
    return Motion(length, speed=real_speed(curve)) if food.rate_dependent else length


def _names(request: Request, sizes: Collection[str]) -> tuple[str, ...]:
    """Names of what is fitted: what was asked for, else the food's, and of its specimen what nobody said.

    Args:
        request: What was asked.
        sizes: Names of the sizes that nobody knows.

    Raises:
        MaterialError: The roundness of a specimen whose shape is said.
    """
    food, sizing = request.food, request.sizing
    if request.fit is not None:
        said = sizing.shape is not None or sizing.outline is not None
        if ROUNDNESS in request.fit and said:
            raise MaterialError("--fit roundness beside --shape or --outline, which says it; leave one of both out")
        return request.fit
    sticks = ("adhesion_energy",) if request.withdrawal else ()
    return (*food.default_fit, *sticks, *sizes, *((ROUNDNESS,) if form_is_open(food, sizing) else ()))


def _held_down(request: Request, names: tuple[str, ...], shape: Shape) -> tuple[str, ...]:
    """The names without the suction of the board, where the specimen stands on no flat face.

    Raises:
        MaterialError: It was asked for there.
    """
    if shape.stands or BOARD_SUCTION not in names:
        return names
    if request.fit is not None:
        raise MaterialError(
            f"--fit {BOARD_SUCTION}: this {shape.words} touches the board in a line or a point, and is not held down; "
            "leave it out, or give the specimen a --shape with a flat face"
        )
    return tuple(name for name in names if name != BOARD_SUCTION)


def _objective(
    request: Request, curve: Conditioned, scene: Scene, sensor: Sensor, parameters: ParameterSet
) -> Objective:
    """Target, error model and nuisances of a request, with its parameters."""
    food = request.food
    known = request.sizing.width is not None or "aspect" in parameters.names
    width_sd = 0.0 if known else size_relative_sd(food, "width")
    u_num = 0.0 if request.u_num is None else numerical_uncertainty(request.u_num, food.name, scene, curve)
    smooth = BandLimited(sensor.bandwidth, curve.stroke, curve.clock)
    target = Target(curve.stroke, curve.curve, curve.curve_noise_sd_N, curve.peak_sd_N, smooth, u_num)
    objective = Objective(
        target,
        parameters,
        request.errors,
        nuisances(curve, sensor, width_sd=width_sd, scaled=request.scaled),
        scale_sd=math.hypot(width_sd, sensor.gain_sd) if request.scaled else 0.0,
    )
    if request.start_from is not None:
        guesses = earlier_guesses(request.start_from, objective, food.name, scene.knife.name)
    else:
        guesses = trace_guesses(scene, parameters, curve.stroke, curve.curve, curve.curve_noise_sd_N)
    return replace(objective, guesses=guesses)


def slower(scene: Scene) -> Scene:
    """The scene at half the simulated speed."""
    return replace(scene, motion=replace(scene.motion, mach=scene.motion.mach / 2))


def replicated(scene: Scene) -> Scene:
    """The scene at half the speed, with other particles and the grid elsewhere: what an answer should not depend on."""
    return with_other_particles(slower(scene), REPLICATE)
