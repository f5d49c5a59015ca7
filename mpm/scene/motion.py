"""How the blade is moved, and by what."""

from __future__ import annotations

from dataclasses import dataclass

from mpm.scene.errors import SceneError, check_number

SLOWED_FROM = 0.6
"""Part of the food's height below which a blade slows down that does [-]."""
STEEPEST = 1.2
"""Largest angle of the edge to the board [rad]: at 69 degrees the ends of what lies over the food are 2.6 of its widths
apart in height."""


@dataclass(frozen=True)
class Motion:
    """The commanded motion of the blade: a stroke, a pause, a retraction.

    Attributes:
        stroke: Way of the edge's middle below the food's top [m].
        mach: Blade speed over the P-wave speed [-]. No law but relaxation follows the time, so the real speed is
            replaced by this one (docs/theory.md, "Measured choices").
        slice_ratio: Speed along the edge over the speed down (slice/push ratio xi) [-].
        tilt: Angle of the edge to the board, positive when the end at +x is higher [rad].
        dwell: Pause at the end of the stroke [s], in real time; needs ``speed``.
        retract: Withdrawal: way back up after it [m], at the first speed.
        speed: Real speed of the stroke [m/s]; needed by rate-dependent laws and by ``dwell``. Times of the material are
            then shortened by simulated over real speed, so that the laws see the real duration; the resistances of a
            food with a rate exponent are those at this speed, all the way.
        end_speed: Part of its first speed that the blade keeps at the end of the stroke [-]. Below :data:`SLOWED_FROM`
            of the food's height the speed falls in a line with what is left of the height. The halves of a food rock
            the more slowly the less holds them together, and a thick blade that opens them too fast rings. Not used
            where the food relaxes.
    """

    stroke: float
    mach: float = 0.01
    slice_ratio: float = 0.0
    tilt: float = 0.0
    dwell: float = 0.0
    retract: float = 0.0
    speed: float | None = None
    end_speed: float = 1.0

    def __post_init__(self) -> None:
        check_number("motion", "stroke", self.stroke, 1e-4, 1.0, "m")
        check_number("motion", "mach", self.mach, 1e-5, 0.1, "")
        check_number("motion", "slice_ratio", self.slice_ratio, -20.0, 20.0, "")
        check_number("motion", "tilt", self.tilt, -STEEPEST, STEEPEST, "rad")
        check_number("motion", "dwell", self.dwell, -1e-300, 1e5, "s")
        check_number("motion", "retract", self.retract, -1e-300, 2.0, "m")
        check_number("motion", "end_speed", self.end_speed, 0.0, 1.0 + 1e-9, "of the first speed")
        if self.speed is not None:
            check_number("motion", "speed", self.speed, 0.0, 100.0, "m/s")
        elif self.dwell > 0:
            raise SceneError("motion: a dwell in seconds needs the real speed of the stroke; give motion.speed")

    def pace(self, left: float) -> float:
        """Speed over that of the beginning [-].

        Args:
            left: Height of the edge over the food's [-].
        """
        return min(1.0, max(left / SLOWED_FROM, self.end_speed))


@dataclass(frozen=True)
class Arm:
    """What holds the knife: a spring between its commanded and its actual height, and the most force it can give.

    Attributes: stiffness [N/m], None = rigid (a Franka arm in impedance control has up to 3000 N/m); force_limit [N],
    None = none. With a stiffness the arm stalls at the limit, and a rigid one stops: the cut ends there.
    """

    stiffness: float | None = None
    force_limit: float | None = None

    def __post_init__(self) -> None:
        if self.stiffness is not None:
            check_number("arm", "stiffness", self.stiffness, 1.0, 1e9, "N/m")
        if self.force_limit is not None:
            check_number("arm", "force_limit", self.force_limit, 0.0, 1e6, "N")

    @property
    def rigid(self) -> bool:
        """Whether the knife is where it is commanded to be."""
        return self.stiffness is None
