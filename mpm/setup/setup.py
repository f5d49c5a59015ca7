"""A scene made ready: its particles, its grid, and the tables that its fields begin with."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from mpm.discretisation.capacity import batch_capacity, node_capacity, particle_capacity
from mpm.discretisation.grid import lay_out
from mpm.discretisation.particles import seed
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.scene.layers import in_whole, layer_stiffness, layer_ties
from mpm.scene.material import Material
from mpm.scene.shapes import skin_path, slice_powers, surface
from mpm.scene.shapes import slices as outline
from mpm.scene.skin import SkinPoints, skin_points, tangents
from mpm.setup.parameters import parameters, pose
from mpm.setup.stable_step import stable_step
from mpm.setup.stone import half_of_stone, stone_table
from mpm.state import contents as column
from mpm.state.contents import Contents
from mpm.state.state import IN_STONE, Configuration
from mpm.state.tables import GRAVITY

PARTICLES_PER_THREAD = 20_000  # for which another thread pays (docs/theory.md, "Measured choices")
STARTED_BEFORE = 1e-9  # line force at which a cut has started that was there before [N/m]
CLEARANCE = 0.1  # way of the blade above the food before contact, in cells


class Setup:
    """A scene made ready to run.

    Args:
        scene: What to simulate.
        runtime: Device.

    Attributes:
        seeds: Particles at rest.
        grid: Where the grid lies.
        step_scale: Time step over the largest sound one [-].

    Raises:
        SceneError: The scene does not fit into memory.
    """

    def __init__(self, scene: Scene, runtime: Runtime) -> None:
        self.scene, self.runtime, self.step_scale = scene, runtime, 1.0
        self.seeds, self.grid = seed(scene), lay_out(scene)

    def threads(self) -> int:
        """CPU threads that pay for a scene of this size, 0 on a GPU."""
        if self.runtime.arch != "cpu":
            return 0
        return min(self.runtime.cpu_threads, 1 + len(self.seeds.x) // PARTICLES_PER_THREAD)

    def configuration(self, threads: int, batch: int = 1) -> Configuration:
        """What the fields must be for so many CPU threads, 0 for a GPU, and cuts side by side: alike for scenes of
        about this size."""
        scene = self.scene
        return Configuration(
            room=particle_capacity(len(self.seeds.x)),
            nodes=tuple(node_capacity(n) for n in self.grid.nodes),
            mirrors=scene.mirrors,
            stations=node_capacity(len(self.grid.stations)),
            threads=threads,
            nodal=scene.numerics.contact == "nodal",
            press=not scene.cuts,
            damage=scene.food.material.damaged,
            turned=scene.numerics.grid_turn != 0,
            branches=len(scene.food.material.branches),
            batch=batch_capacity(batch),
            ties=particle_capacity(len(self.ties())) if scene.tied else 0,
            skin=particle_capacity(len(self.skin)) if scene.food.material.skin_stiffness > 0 else 0,
            stone=scene.food.stone is not None,
            hollow=scene.tied and len(scene.food.crossed + scene.food.parted) > 0,
            rows=scene.numerics.layer_rows,
        )

    def ties(self) -> np.ndarray:
        """Particles that hold the food together across the plane of a cohesive crack, left and right, shape (k, 2); in
        a stone there are none."""
        ties = self.seeds.ties(self.scene.mirrors[1]) if self.scene.tied else np.zeros((0, 2), int)
        return ties[~self.scene.food.stony(self.seeds.x[ties[:, 0]])]

    @property
    def gap(self) -> float:
        """Way of the edge's middle above the food before contact [m]."""
        return CLEARANCE * self.scene.numerics.dx + self.scene.drop

    def time_step(self, material: Material) -> float:
        """Time step [s]."""
        return self.step_scale * stable_step(self.scene, material, self.seeds.spacing)

    def to_grid_axes(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors of the scene's axes, shape (n, 3), in the grid's."""
        return self._turned(vectors, self.scene.numerics.grid_turn)

    def to_scene_axes(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors of the grid's axes, shape (n, 3), in the scene's."""
        return self._turned(vectors, -self.scene.numerics.grid_turn)

    @staticmethod
    def _turned(vectors: np.ndarray, angle: float) -> np.ndarray:
        """Vectors (n, 3) turned about the vertical by an angle [rad]."""
        c, s = math.cos(angle), math.sin(angle)
        return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def contents(self, material: Material) -> Contents:
        """What the fields begin with."""
        scene = self.scene
        return Contents(
            nodes=self.grid.nodes,
            plane=round(-self.grid.origin[1] / scene.numerics.dx),
            between=scene.mirrored_between,
            particles=self._particles(material),
            slices=self._slices(material),
            parameters=self._parameters(material),
            pose=pose(scene.food.shape.height + self.gap, 0.0, scene.motion.tilt),
            relaxation=self._relaxation(material),
            ties=self._ties(material),
            tie_rows=self._rows(material),
            skin=self._skin(material),
            half=self._half() if scene.tied else np.zeros(0),
            stone=stone_table(scene.food, scene.numerics.dx),
        )

    def _parameters(self, material: Material) -> np.ndarray:
        """The table of parameters, with the gravity that gives the food its weight."""
        out = parameters(self.scene, material, self.seeds, self.grid)
        out[GRAVITY] /= self.heavier(material)
        return out

    def _half(self) -> np.ndarray:
        """Half of the food that each particle belongs to, shape (n,); a stone off the middle is of one."""
        right: np.ndarray = self.seeds.x[:, 1] >= 0
        half = half_of_stone(self.scene.food)
        if half >= 0:
            right[self.scene.food.stony(self.seeds.x)] = half > 0
        return right

    def _ties(self, material: Material) -> np.ndarray:
        """The table of ties (k, N_TIE)."""
        ties, (toughness, share) = self.ties(), in_whole(*self._layers(material))
        open_before = self.scene.food.open(self.seeds.x[ties[:, 0]])
        return np.column_stack([ties, toughness, np.where(open_before, 0.0, share), open_before])

    def _skin_at_plane(self) -> tuple[SkinPoints, np.ndarray, np.ndarray]:
        """Points of the skin, the tie that bears the tension of each across the cut plane, -1 for none, and over what
        length [m]; of two halves each bears half."""
        from scipy.spatial import cKDTree  # takes long to import

        skin, ties, h = self.skin, self.ties(), self.seeds.spacing
        tie = np.full(len(skin), -1)
        beside = (np.abs(skin.x[:, 1]) < h) & (len(ties) > 0)
        if beside.any():
            places = self.seeds.x[ties[:, 0]][:, [0, 2]]
            tie[beside] = cKDTree(places).query(skin.x[beside][:, [0, 2]])[1]
        return skin, tie, skin.areas / h / (1 if self.scene.mirrors[1] else 2)

    def _rows(self, material: Material) -> np.ndarray:
        """The table of the rows of ties (k, 2 rows); what was parted before has no share."""
        toughness, share = self._layers(material)
        open_before = self.scene.food.open(self.seeds.x[self.ties()[:, 0]])
        return np.hstack([toughness, np.where(open_before[:, None], 0.0, share)])

    def _layers(self, material: Material) -> tuple[np.ndarray, np.ndarray]:
        """Toughness of the rows of each tie [J/m^2] and their part of the section over a row [-], shape (k, rows)."""
        places = self.seeds.x[self.ties()[:, 0]][:, [0, 2]]
        food, rows = self.scene.food, self.scene.numerics.layer_rows
        return layer_ties(food.shape, material, self.seeds.spacing, places, rows, food.crossed)

    def _top_toughness(self, material: Material) -> np.ndarray:
        """Toughness of the food within a cell below its upper surface, in each slice [J/m^2], shape (m,)."""
        out = np.full(len(self.grid.stations), float(material.R))
        if not (self.scene.tied and material.layered):
            return out
        dx = self.scene.numerics.dx
        x, _, z = self.seeds.x[self.ties()[:, 0]].T
        depth = surface(self.scene.food.shape, x, np.zeros_like(x))[1] - z
        place = np.abs(self.grid.stations) if self.scene.mirrors[0] else self.grid.stations
        toughness, share = in_whole(*self._layers(material))
        weight = share * np.maximum(1.0 - np.abs(place[:, None] - x) / dx, 0.0) * (depth < dx)
        total = weight.sum(axis=1)
        np.divide(weight @ toughness, total, out=out, where=total > 0)
        return out

    def _particles(self, material: Material) -> np.ndarray:
        """The table of particles (n, N_PARTICLE)."""
        seeds, cuts = self.seeds, self.scene.cuts
        gap, outer = (seeds.blade_gap, seeds.beside) if cuts else (seeds.top_gap, seeds.top)
        out = np.empty((len(seeds.x), column.N_PARTICLE))
        out[:, column.POSITION : column.BOARD_GAP] = self.to_grid_axes(seeds.x)
        out[:, column.BOARD_GAP], out[:, column.TOOL_GAP], out[:, column.VOLUME_RATIO] = (
            seeds.board_gap,
            gap,
            seeds.volume_ratio,
        )
        out[:, column.SURFACE_VOLUME] = seeds.areas * seeds.board_gap * seeds.bottom
        out[:, column.SURFACE_VOLUME + 1] = seeds.areas * gap * outer
        out[:, column.ADHERING] = np.where(seeds.beside & (material.adhesion > 0), 0, -1)
        out[self.scene.food.stony(seeds.x), column.ADHERING] = IN_STONE
        if material.graded:
            out[:, column.VOLUME_RATIO : column.ADHERING] *= self.layer_weights(material)[:, None]
        return out

    def layer_weights(self, material: Material) -> np.ndarray:
        """Stiffness, strength and mass of each particle over those of flesh, shape (n,).

        A stiffer particle is simulated as so much more of the flesh: its mass grows with its stiffness, so that waves
        are no faster in it and the time step stays. Gravity is less by what the food is heavier for it. Both ends of a
        tie have the same weight, for the tie gives both the same change of velocity.
        """
        if material in self._weights:
            return self._weights[material]
        out = layer_stiffness(self.scene.food.shape, material, self.seeds.spacing, self.seeds.x)
        ties = self.ties()
        ties = ties[(ties >= 0).all(axis=1)]
        out[ties] = out[ties].mean(axis=1, keepdims=True)
        self._weights[material] = out
        return out

    @cached_property
    def _weights(self) -> dict[Material, np.ndarray]:
        """What :meth:`layer_weights` has found."""
        return {}

    def heavier(self, material: Material) -> float:
        """Mass of the simulated food over that of the real one [-]: 1 without a layer of another stiffness."""
        if not material.graded:
            return 1.0
        ratio = self.seeds.volume_ratio
        return float((self.layer_weights(material) * ratio).sum() / ratio.sum())

    @cached_property
    def skin(self) -> SkinPoints:
        """Points of the skin all round the food, those of the modelled half or quarter."""
        return skin_points(self.scene.food.shape, self.seeds.spacing, self.scene.mirrors)

    def _skin(self, material: Material) -> np.ndarray:
        """The table of the skin's points (m, N_SKIN)."""
        if not material.skin_stiffness > 0:
            return np.zeros((0, column.N_SKIN))
        skin, tie, length = self._skin_at_plane()
        axes = (skin.x, *tangents(skin.normals))
        half = (skin.x[:, 1] >= 0) & (not self.scene.mirrors[1])
        return np.column_stack([*(self.to_grid_axes(a) for a in axes), skin.areas, half, tie, length])

    def _slices(self, material: Material) -> np.ndarray:
        """The table of slices (m, N_SLICE)."""
        scene, xs = self.scene, self.grid.stations
        path = skin_path(scene.food.shape, xs, material.skin_thickness) if material.skin_thickness > 0 else 0 * xs
        out = np.empty((len(xs), column.N_SLICE))
        out[:, : column.SOFTENING] = np.transpose(outline(scene.food.shape, xs, scene.numerics.dx))
        powers = slice(column.TOP_POWER, column.STARTED)
        out[:, powers] = 1.0
        if material.layered:
            out[:, powers] = np.transpose(slice_powers(scene.food.shape, xs, scene.numerics.dx))
        out[:, column.STARTED] = self._started()
        out[:, column.SOFTENING], out[:, column.TOP_TOUGHNESS] = path, self._top_toughness(material)
        return out

    def _started(self) -> np.ndarray:
        """Line force at which a cut has started before in each slice, shape (m,): next to none where an earlier cut has
        opened the top of the food, else 0."""
        food, x = self.scene.food, self.grid.stations
        top = surface(food.shape, x, np.zeros_like(x))[1]
        return np.where(food.open(np.column_stack([x, np.zeros_like(x), np.nan_to_num(top)])), STARTED_BEFORE, 0.0)

    def _relaxation(self, material: Material) -> np.ndarray:
        """Share of each Prony branch, and time step over its time (2, branches)."""
        if not material.branches:
            return np.zeros((2, 0))
        # the blade is faster in a stiffer food: the time scale is that of this material
        scene = replace(self.scene, food=replace(self.scene.food, material=material))
        step = self.time_step(material) * scene.time_scale
        return np.array([[share, step / time] for share, time in material.branches]).T
