"""Constants of one food, validated, in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from mpm.scene.errors import SceneError, check_number

MAX_POISSON = 0.49  # above it a single-field quadratic MPM locks volumetrically and dt falls as sqrt(1 - 2 nu)
COHESIVE_ZONE = 10e-3  # of the process zone of a food whose tensile strength is not known, at least [m]
PARTS_BEFORE_IT_FLOWS = 0.8  # strength of such a food over its yield stress: that of apple (materials.yaml, remark 5)
SKIN_POISSON = 0.5  # of a skin in its plane [-]: tomato skin has about a half (Int. Agrophys. 26:39, 2012)
PUNCH = (2 + math.pi) / math.sqrt(3)
"""Pressure that a flat punch needs to flow into a rigid-plastic solid in plane strain, over its yield stress [-]
(Prandtl 1920)."""
RESISTANCES = ("R", "R_rind", "R_core", "R_initiation", "R_skin")
"""Properties with the dimension of a force per length: what the edge works against."""
REFERENCE_SPEED = 10e-3
"""Real speed of the knife at which the resistances of a food are what its values say [m/s]: in the middle of the 5, 10
and 30 mm/s at which blades cut a starch-based food (Skamniotis et al. 2016, Interface Focus 6:20160005)."""
LARGEST_RATE_EXPONENT = 1.0
"""Of the power of the speed in a resistance [-]: in proportion to it. Assumed, five times what blades in a starch-based
food have told (docs/theory.md, "Speed of the cut")."""
LEAST_OPENING = 1e-9  # half opening at which a food without resistance has parted [m]; the ties divide by it


@dataclass(frozen=True)
class Material:
    """Constants of one food.

    Attributes:
        E: Young's modulus [Pa].
        nu: Poisson's ratio [-].
        rho: Density [kg/m^3].
        yield_stress: von Mises yield stress (Kirchhoff) [Pa]; ``inf`` keeps the food elastic.
        R: Cutting (propagation) resistance of the flesh [J/m^2 = N/m] (Atkins 2009, "The Science of Cutting").
        R_initiation: Force per width at which a cut starts in bare flesh [N/m]; at least R.
        R_skin: Force per width at which the edge goes through the skin [N/m].
        skin_thickness: Thickness of the skin [m]; 0 = no skin.
        skin_stiffness: Young's modulus of the skin times its thickness [N/m]: it bears tension in its plane, all round
            the food; 0 = it bears none. Across the cut plane the ties of the flesh hold it.
        R_rind: Cutting resistance of the rind [J/m^2], the layer all round the food; needed with ``rind_thickness``.
        rind_thickness: Thickness of the rind [m]; 0 = no rind. It is there when the edge comes out below, too, while
            the skin is what it takes to start a cut.
        rind_stiffness: Young's modulus and yield stress of the rind over those of the flesh [-]; both yield at the same
            strain.
        R_core: Cutting resistance of the core [J/m^2]; needed with ``core_ratio``.
        core_ratio: Radius of the core over that of the food's section [-]; 0 = no core.
        core_stiffness: Young's modulus and yield stress of the core over those of the flesh [-]; both yield at the same
            strain. Below 1 where seeds lie in gel: the wall about it then gives way under the blade as a ring does.
        initiation_depth: Indentation under the edge at which a cut starts [m]; soft solids go deep before a cut
            nucleates (Reyssat et al. 2012, Phys. Rev. Lett. 109:244301).
        mu: Coulomb friction of food on the blade's faces [-].
        tensile_strength: Tension at which the food parts [Pa], or None. Across the plane of a cohesive crack the
            tension falls from there to nothing while the food opens, and the work is R; None: see :attr:`cohesion`.
            Bulk damage, where there is any, starts at it. Nothing else uses it.
        strength_ratio: That tension over the yield stress [-], at most 1, in place of ``tensile_strength``; not used
            where that is given.
        cohesive_zone: Least length E R / strength^2 of the process zone of a food without one of these [m]; nothing
            else uses it.
        fracture_energy: Energy per crack area of bulk damage [J/m^2], or None for a food without bulk damage. It needs
            a strength.
        loss_factor: Mechanical loss factor tan(delta) [-] at the first axial mode of the specimen, Kelvin-Voigt. Apple
            tissue loses 0.13-0.4 of the energy of a cycle (J. Texture Stud. 14:155, 1983), i.e. about 0.04-0.13.
        prony: Relaxation of the shear stiffness as pairs (share [-], time [s]); E is then the instantaneous modulus and
            the shares add up to less than 1 (Simo 1987). Empty = rate-independent, the default.
        relaxing_share: Share [-] of one branch beside those of ``prony``: what a fit moves. 0 = none, the default.
        relaxation_time: Its time [s]; nothing uses it without a share.
        relaxing_bulk: Relaxing share of the bulk stiffness over that of the shear stiffness, in every branch [-]: 0 =
            the volume does not relax, the default; 1 = Poisson's ratio stays as it is.
        rate_exponent: Power n [-] of the real speed v of the knife in all resistances of the edge, those of layers,
            skin and start too: each is its value times (v / :data:`REFERENCE_SPEED`)^n. 0 = none, the default.
        adhesion: Largest normal traction of the food on the blade's faces [Pa]; 0 = none, the default. A face that has
            been pressed on the blade sticks, and one that is held by this alone does not rub (Raous et al. 1999).
        adhesion_energy: Work of adhesion [J/m^2], needed with ``adhesion``.
    """

    E: float
    nu: float
    rho: float
    yield_stress: float = math.inf
    R: float = 0.0
    R_initiation: float | None = None
    R_skin: float | None = None
    skin_thickness: float = 0.0
    skin_stiffness: float = 0.0
    R_rind: float | None = None
    rind_thickness: float = 0.0
    rind_stiffness: float = 1.0
    R_core: float | None = None
    core_ratio: float = 0.0
    core_stiffness: float = 1.0
    initiation_depth: float = 1e-3
    mu: float = 0.0
    tensile_strength: float | None = None
    strength_ratio: float | None = None
    cohesive_zone: float = COHESIVE_ZONE
    fracture_energy: float | None = None
    loss_factor: float = 0.0
    prony: tuple[tuple[float, float], ...] = ()
    relaxing_share: float = 0.0
    relaxation_time: float = 1.0
    relaxing_bulk: float = 0.0
    rate_exponent: float = 0.0
    adhesion: float = 0.0
    adhesion_energy: float = 0.0

    def __post_init__(self) -> None:
        w = "material"
        check_number(w, "E", self.E, 0.0, 1e12, "Pa")
        if not (isinstance(self.nu, (int, float)) and -1.0 < self.nu <= MAX_POISSON):
            raise SceneError(
                f"material: nu = {self.nu!r} must lie in (-1, {MAX_POISSON}]; an isotropic solid has nu < 0.5 and the "
                f"solver locks above {MAX_POISSON}"
            )
        check_number(w, "rho", self.rho, 0.0, 1e5, "kg/m^3")
        if self.yield_stress != math.inf:
            check_number(w, "yield_stress", self.yield_stress, 0.0, 1e12, "Pa")
        for name, unit in (
            ("R", "J/m^2"),
            ("skin_thickness", "m"),
            ("skin_stiffness", "N/m"),
            ("rind_thickness", "m"),
            ("mu", ""),
            ("loss_factor", ""),
            ("relaxing_bulk", ""),
            ("adhesion", "Pa"),
            ("adhesion_energy", "J/m^2"),
        ):
            check_number(w, name, getattr(self, name), -1e-300, 1e6, unit)
        check_number(w, "initiation_depth", self.initiation_depth, 1e-5, 0.1, "m")
        for name in ("R_initiation", "R_skin"):
            if getattr(self, name) is not None:
                check_number(w, name, getattr(self, name), -1e-300, 1e6, "N/m")
        if self.tensile_strength is not None:
            check_number(w, "tensile_strength", self.tensile_strength, 0.0, 1e12, "Pa")
        if self.strength_ratio is not None:
            if not 0.0 < self.strength_ratio <= 1.0:
                raise SceneError(
                    f"material: strength_ratio = {self.strength_ratio!r} must lie in (0, 1]; give a food that flows "
                    "before it parts a tensile_strength [Pa] in place of it"
                )
            if self.yield_stress == math.inf:
                raise SceneError(
                    "material: strength_ratio is a part of yield_stress, and this food does not yield; give "
                    "tensile_strength [Pa] in place of it"
                )
        check_number(w, "cohesive_zone", self.cohesive_zone, 1e-6, 10.0, "m")
        if self.fracture_energy is not None:
            check_number(w, "fracture_energy", self.fracture_energy, 0.0, 1e9, "J/m^2")
            if self.strength is None:
                raise SceneError(
                    "material: fracture_energy makes bulk damage, which starts at tensile_strength; give both, or "
                    "leave out fracture_energy"
                )
        if self.skin_thickness > 0 and self.R_skin is None:
            raise SceneError(
                "material: skin_thickness > 0 needs R_skin, the force per width that goes through the skin"
            )
        if self.relaxing_bulk > 1.0:
            raise SceneError(
                f"material: relaxing_bulk = {self.relaxing_bulk!r} must lie in [0, 1]; at 1 the volume relaxes as much "
                "as the shape"
            )
        self._check_layers(w)
        beyond = LARGEST_RATE_EXPONENT * (1 + 1e-9)
        check_number(w, "rate_exponent", self.rate_exponent, -beyond, beyond, "")
        if (self.adhesion > 0) != (self.adhesion_energy > 0):
            raise SceneError(
                "material: adhesion [Pa] and adhesion_energy [J/m^2] make sticky faces together; give both"
            )
        for share, time in self.branches:
            check_number(w, "share of a prony branch", share, 0.0, 1.0, "")
            check_number(w, "time of a prony branch", time, 0.0, 1e9, "s")
        if self.relaxing_share < 0.0 or sum(share for share, _ in self.branches) >= 1.0:
            raise SceneError(
                "material: the shares of the prony branches must not be below 0 and add up to less than 1, or a "
                "solid flows"
            )

    def _check_layers(self, where: str) -> None:
        """Refuse layers without a resistance or of no stiffness, and a core as large as the food."""
        for name in ("rind_stiffness", "core_stiffness"):
            check_number(where, name, getattr(self, name), 0.0, 1e3, "of the flesh's")
        for resistance, size, what in (
            ("R_rind", "rind_thickness", "the rind"),
            ("R_core", "core_ratio", "the core"),
        ):
            if getattr(self, resistance) is not None:
                check_number(where, resistance, getattr(self, resistance), 0.0, 1e6, "J/m^2")
            elif getattr(self, size) > 0:
                raise SceneError(f"material: {size} > 0 needs {resistance}, the cutting resistance of {what}")
        check_number(where, "core_ratio", self.core_ratio, -1e-300, 1.0, "of the food's radius")
        if self.layered and self.R == 0:
            raise SceneError("material: a rind or a core needs flesh with a resistance; give R > 0")

    @property
    def layered(self) -> bool:
        """Whether the food has a rind or a core."""
        return self.rind_thickness > 0 or self.core_ratio > 0

    @property
    def graded(self) -> bool:
        """Whether rind or core is stiffer or softer than the flesh."""
        return (self.rind_thickness > 0 and self.rind_stiffness != 1.0) or (
            self.core_ratio > 0 and self.core_stiffness != 1.0
        )

    @property
    def toughest_for_mass(self) -> float:
        """Largest cutting resistance of flesh, rind and core, each over its stiffness, which it weighs by [J/m^2]."""
        rind = (self.R_rind or 0.0) / self.rind_stiffness if self.rind_thickness > 0 else 0.0
        core = (self.R_core or 0.0) / self.core_stiffness if self.core_ratio > 0 else 0.0
        return max(self.R, rind, core)

    @property
    def shear(self) -> float:
        """Shear modulus mu = E / (2 (1 + nu)) [Pa]."""
        return self.E / (2 * (1 + self.nu))

    @property
    def lame(self) -> float:
        """First Lame constant [Pa]."""
        return self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))

    @property
    def start(self) -> float:
        """Force per width at which a cut starts: that of the skin where there is one, never below R [N/m]."""
        threshold = self.R_skin if self.skin_thickness > 0 else self.R_initiation
        return max(self.R, threshold or 0.0)

    @property
    def punch_width(self) -> float:
        """Width of a flat punch that just bears a line force, over that force [m^2/N]; 0 for what never flows."""
        return 1 / (PUNCH * self.yield_stress)

    @property
    def strength(self) -> float | None:
        """Tension at which the food parts [Pa]: ``tensile_strength``, or ``strength_ratio`` of the yield stress."""
        if self.tensile_strength is not None or self.strength_ratio is None:
            return self.tensile_strength
        return self.strength_ratio * self.yield_stress

    @property
    def cohesion(self) -> float:
        """Strength of a cohesive crack [Pa]: :attr:`strength`; where that is None :data:`PARTS_BEFORE_IT_FLOWS` of
        the yield stress, and no more than makes a process zone E R / strength^2 of :attr:`cohesive_zone`.

        A crack that is stronger than the yield stress flows at its tip, by which work of fracture grows (Tvergaard and
        Hutchinson 1992). Cells of 3 mm do not resolve that: at twice the yield stress they miss a quarter of the work.
        """
        if self.strength is not None:
            return self.strength
        return min(PARTS_BEFORE_IT_FLOWS * self.yield_stress, math.sqrt(self.E * self.R / self.cohesive_zone))

    def tie_strength(self, spacing: float, ties: float) -> float:
        """Strength of ties across the cut plane [Pa]: the cohesive strength, and no more than their grid resolves.

        The process zone of a crack is E R / strength^2 long. Where it spans fewer than some ties, they part one by one:
        the crack is trapped between them and costs more than R. So the food is made weaker until its zone spans that
        many, at the same work R (Turon et al. 2007, Eng. Fract. Mech. 74:1665). Where the zone is short against the
        food, strength has no part in the force. A tougher rind or core is stronger in
        proportion, so that all layers end at the same opening. The toughest softens over the shortest length; under
        half a spacing its ties would snap back.

        Args:
            spacing: Distance of the ties [m].
            ties: How many of them the zone of the flesh spans at least [-].
        """
        if not self.R > 0:
            return 0.0
        shortest = self.R / self.toughest_for_mass  # of the softening lengths, over that of the flesh
        zone = max(ties * spacing, spacing / 2 / shortest)
        return min(self.cohesion, math.sqrt(self.E * self.R / zone))

    def sticking_strength(self, spacing: float) -> float:
        """Largest normal traction of sticky faces on a grid [Pa]: ``adhesion``, and no more than the grid resolves.

        As a tie does, a face that gives way over less than the food beside it stretches would snap off. It is made
        weaker until it does not, at the same work of adhesion (Turon et al. 2007, as :meth:`tie_strength`).

        Args:
            spacing: Distance of the particles [m].
        """
        return min(self.adhesion, math.sqrt(self.E * self.adhesion_energy / (spacing / 2)))

    def tie_opening(self, spacing: float, ties: float) -> float:
        """Half opening at which ties across the cut plane hold nothing any more [m] (:meth:`tie_strength`)."""
        return self.R / self.tie_strength(spacing, ties) if self.R > 0 else LEAST_OPENING

    @property
    def damaged(self) -> bool:
        """Whether the food has bulk damage."""
        return self.fracture_energy is not None

    @property
    def relaxes(self) -> bool:
        """Whether a part of the stiffness relaxes in time."""
        return bool(self.branches)

    @property
    def rate_dependent(self) -> bool:
        """Whether the force depends on the real speed of the knife."""
        return self.relaxes or self.rate_exponent != 0

    def rate_factor(self, speed: float | None) -> float:
        """Resistances at a real speed of the knife [m/s] over those at :data:`REFERENCE_SPEED` [-]; 1 where no speed is
        known."""
        return 1.0 if speed is None else float((speed / REFERENCE_SPEED) ** self.rate_exponent)

    def at_speed(self, speed: float | None) -> Material:
        """The food with the resistances that it has at a real speed of the knife [m/s], and no rate exponent: what a
        cut at that one speed sees."""
        factor = self.rate_factor(speed)
        have = {name: getattr(self, name) for name in RESISTANCES}
        scaled = {name: factor * value for name, value in have.items() if value is not None}
        return replace(self, rate_exponent=0.0, **scaled)

    @property
    def branches(self) -> tuple[tuple[float, float], ...]:
        """Share [-] and time [s] of each branch of the relaxation."""
        one = ((self.relaxing_share, self.relaxation_time),) if self.relaxing_share > 0.0 else ()
        return (*self.prony, *one)

    @property
    def p_wave(self) -> float:
        """Speed of longitudinal waves sqrt((lambda + 2 mu) / rho) [m/s]."""
        return math.sqrt((self.lame + 2 * self.shear) / self.rho)

    @property
    def stability_speed(self) -> float:
        """Speed that bounds dt [m/s]: sqrt(max(3 K, lambda + 2 mu) / rho).

        A lone particle of quadratic MLS-MPM has the highest frequency (2/dx) sqrt(3 K / rho), above that of the bulk.
        """
        bulk3 = 3 * self.lame + 2 * self.shear
        return math.sqrt(max(bulk3, self.lame + 2 * self.shear) / self.rho)
