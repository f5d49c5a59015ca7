"""Fields and tables of the cuts that are simulated side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti

from mpm.discretisation.grid import MIRROR
from mpm.runtime import adds_doubles
from mpm.state.tables import (
    N_LOSSES,
    N_ORDER,
    N_PARAMETERS,
    N_PARTICLE_SUMS,
    N_POSE,
    N_SIZES,
    N_STONE,
    N_STONE_SUMS,
    N_STRESS,
    N_SUMS,
    TIE_WORK,
)

BEYOND_GRID = 1 << 20  # a node that no grid has
SECOND_FIELD_CELLS = 3  # cells on either side of the cut plane whose nodes may carry both halves
REGISTER = 32  # bytes of a register of a CPU: as many particles as fill it have their elastic stress found at once
SUM_COPIES = 64  # copies of a sum over particles on a GPU, where additions to one number wait for each other
CPU_BLOCK = 512  # Taichi runs CPU loops shorter than this on one thread, so one iteration in 512 works for a thread
FACE_POINTS = 4  # of a particle's face, one above another, at which it meets the blade and the other half
IN_STONE = -2  # of State.adhering, where a particle is in a stone
# What a loop goes over: each cut, rows of nodes in reach, lines of nodes across the mirror, parts of the particles,
# slices along the edge, rows of nodes about what could be damaged, ties across the cut plane, points of the skin, lines
# of nodes across the cut plane.
CUTS, NODE_ROWS, NODE_LINES, PARTS, SLICES, DAMAGE_ROWS, TIES, SKIN, NODE_ACROSS = range(9)


@dataclass(frozen=True)
class Configuration:
    """What is compiled into the kernels; scenes of one configuration share fields and compiled code.

    Attributes:
        room: Most particles.
        nodes: Most grid nodes along x, y, z.
        mirrors: Whether there are mirror planes (x, y).
        stations: Most slices along the edge.
        threads: CPU threads, 0 on a GPU.
        nodal: Plain nodal projection instead of the cohesive edge and particle contact.
        press: The tool presses on the food's surface instead of cutting.
        damage: Bulk damage on.
        turned: The grid is turned against the blade.
        branches: Number of Prony branches.
        batch: Most cuts side by side; more than one on a GPU or with one thread a cut.
        ties: Most ties across the cut plane, 0 without a cohesive crack.
        skin: Most points of a skin that bears tension, 0 without.
        stone: There is a rigid stone in the food.
        hollow: The cut plane meets a stone or a cavity, so that what the edge cuts is what the ties say.
        rows: Rows of a tie, each with a toughness of its own.
    """

    room: int
    nodes: tuple[int, ...]
    mirrors: tuple[bool, bool]
    stations: int
    threads: int
    nodal: bool
    press: bool
    damage: bool
    turned: bool = False
    branches: int = 0
    batch: int = 1
    ties: int = 0
    skin: int = 0
    stone: bool = False
    hollow: bool = False
    rows: int = 1


@ti.data_oriented
class State:
    """Particles, grid, edge and tables with room for a class of scenes.

    :mod:`mpm.state.host_transfer` fits them to some. They hold one cut or a batch of them side by side, each with
    scene, material, time step and blade of its own; the first index of every field says which. On a GPU one launch does
    a loop of all cuts, on CPUs a thread does all loops of a cut (:func:`mpm.state.loops.locate`).

    Matrices of the particles are stored entry by entry for ``lanes`` particles, [block, entry, lane], so that the same
    operation on all of them is one instruction; velocity gradients column by column, each filled up to four.

    The grid stores two velocity fields: the first at ``[i, j, k]``, the second, which only nodes beside the cut plane
    have, at ``[i, second + j, k]`` of each cut.

    Args:
        configuration: What is compiled into the kernels.

    Attributes:
        x: Positions of the particles in the grid's axes [m], (cut, particle).
        v: Velocities [m/s], (cut, particle).
        damper_v: Velocities of their dampers [m/s], (cut, particle).
        C: Velocity gradients [1/s], (cut, particle, column).
        F: Deformation gradients [-], (cut, block, 3 row + column) of lanes.
        tau: Kirchhoff stress [Pa], losses and stretch (:mod:`mpm.state.tables`), (cut, block, entry) of lanes.
        side: 0 where the cut has not passed a particle, else 1 or 2 for its half, (cut, particle).
        tool_gap: Distance at which a particle meets the tool [m], (cut, particle).
        board_gap: Distance at which it meets the board [m], (cut, particle).
        volume_ratio: Its volume over that of a particle beside the cut [-], (cut, particle).
        surface_volume: Reference volume between a particle of the first layer and board and tool [m^3], 0 behind the
            first layer, (cut, particle) of two.
        contact_moment: Moment of the contact's last impulse as a gradient of the velocity, upwards and across the blade
            [1/s]; the fourth entry upwards is the kinetic energy per mass that this impulse gave [J/kg],
            (cut, particle, 2).
        stick: Stretch of the friction's spring on board and tool [m], (cut, 2, particle).
        face_rise: Way along the face of a particle beside the cut plane from its lower end to its upper, in the scene's
            axes, over the spacing of the particles [-], (cut, particle).
        adhering: Which points of its face stick to the blade, a bit each, 0 where they may, -1 where not, -2 in a
            stone, (cut, particle).
        visibility: What :func:`mpm.kernels.crack.visible_columns` found in the last step, with ``IN_CONTACT`` where
            ``contact_moment`` is of this step; elsewhere it means nothing, (cut, particle).
        kappa: Largest strain that has acted on bulk damage [-], (cut, particle).
        driving_strain: Smoothed strain of the last step [-], (cut, particle).
        prony_stress: Stress of the Prony branches [Pa], (cut, branch, particle).
        prony_before: Deviator of the last step [Pa], (cut, particle).
        prony_share: Share of a branch [-], (cut, branch).
        prony_rate: Time step over its time [-], (cut, branch).
        skin_x: Positions of the points of the skin in the grid's axes [m], (cut, point).
        skin_sides: Two vectors in the skin at a point, at first units at right angles [-], (cut, point, 2).
        skin_area: Area of the skin that a point stands for, at first [m^2], (cut, point).
        skin_half: Half of the food that it belongs to, 0 left, 1 right, (cut, point).
        skin_visibility: As ``visibility``, (cut, point).
        skin_tie: Tie that bears its tension across the cut plane, -1 for none, (cut, point).
        skin_length: Length over which it does [m], (cut, point).
        skin_pull: Tension of the skin across the cut plane at a tie, in the scene's axes [N], (cut, tie).
        g: Momentum [N s] and mass [kg] of the nodes, a grid for each thread.
        u: Velocity [m/s] and mass [kg] of the nodes.
        planes: Sums over the planes of nodes of the particle that a thread moves, (cut, thread, 16).
        damage_box: Lowest and highest lowest node of particles whose strain could damage something, (cut, 6).
        slip: Elastic slip of the edge in a slice, along the edge and forward [m], (cut, slice).
        line: Line force that the edge carries in a slice [N/m], (cut, slice).
        zone: Width over which it is spread [m], (cut, slice).
        dent_over_width: How much less the material has gone with the edge, before the start, per e-fold of that width
            [m], (cut, slice).
        reaction: Change of velocity that the edge gives in this step, along the cut and upwards [m/s], (cut, slice).
        zone_velocity: Mean velocity of the material at the edge, in the scene's axes [m/s], (cut, slice).
        crack_front: Height of the crack front [m], far up where nothing is cut, (cut, slice).
        front_drift: Way of the front with the material in this step [m], (cut, slice).
        cut_depth: Way that has been cut since the start [m], (cut, slice).
        softening: Way over which the resistance falls after the start, that through the skin [m], (cut, slice).
        top_power: Power of the way through the upper surface of a slice that is the part of it that the edge has
            reached [-], (cut, slice); ``floor_power`` the same for the lower one.
        top_toughness: Toughness of the food below its upper surface [J/m^2], (cut, slice).
        start_force: Force at which the cut has started [N/m], 0 before, (cut, slice).
        contact_part: Part of the slice that the edge was in before [-], (cut, slice).
        started_beside: Neighbours in which the cut has started, (cut, slice).
        top_high: Highest height of the upper surface over a slice [m], (cut, slice); ``top_low`` the lowest.
        width: Part of the slice that has food [-], (cut, slice).
        floor_high: Highest height of the lower surface over a slice [m], (cut, slice); ``floor_low`` the lowest.
        half: Half of the food that a particle belongs to, 0 left, 1 right, (cut, particle). This and what follows down
            to ``start_excess`` is there only where ``cuts``.
        tie_ends: Left and right particle of a tie, (cut, tie).
        tie_toughness: Its work of fracture over its area [J/m^2], (cut, tie).
        tie_share: Its part of the section over a square of the spacing, where toughness differs [-], (cut, tie).
        largest_opening: Largest half opening of its two faces so far at a point of them [m], (cut, tie, point).
        cut_part: Part of that point that the edge has cut [-], (cut, tie, point).
        face_shear: Half of the shear of the two faces against their centres, along the cut and upwards [m], (cut, tie).
        passing: Sums over the ties that the edge passes, with their weights: what is left of their toughness, toughness
            [J/m^2], and the weights [-], (cut, slice).
        row_toughness: Toughness of the rows of a tie, from below [J/m^2], (cut, tie, row); ``row_share`` their parts of
            the section over those of a whole row [-].
        at_edge: Sums over the rows that the edge is in, with their weights: toughness [J/m^2], and the weights [-]; and
            those of the shares of the ties at the edge [-], (cut, slice).
        passed_mean: Their last means: what is left, and toughness [J/m^2], (cut, slice).
        part_left: Part of their toughness that the ties that the edge passes have left, where it differs [-],
            (cut, slice).
        most_passed: Largest sum of their weights so far [-], (cut, slice).
        start_excess: Line force beyond the toughness at which a cut has started [N/m], (cut, slice).
        sums, pose, order, par, size: Tables whose rows are in :mod:`mpm.state.tables`, (cut, row).
        losses, particle_sums: Sums over particles, of which different particles add to different copies,
            (cut, copy, row); ``losses`` are the rows of the table of sums from ``PLASTIC`` on.
        window: Nodes that particles can reach before it is renewed: first, last + 1, (cut, 6).
        stone_pose, stone_sums: Of a stone, and of the nodes that move with it; rows in :mod:`mpm.state.tables`,
            (cut, row).
        steps_left: Steps that a cut has yet to do before the next row of the report, on a GPU, (cut,).
        extents: Most places that a loop of a kind may go over in a cut. It is compiled in: to read a length a GPU needs
            a launch more, and then starts more threads than there are places.
        n: Particles of each cut, shape (cuts,).
        owner: Whose cuts the fields hold.
    """

    def __init__(self, configuration: Configuration) -> None:
        own = configuration
        self.mirror_x, self.mirror_y = own.mirrors
        self.plane_x = MIRROR if self.mirror_x else -1  # node plane of the mirror across x
        self.first_slice = max(self.plane_x, 0)  # that is no mirror image
        self.threads, self.nodal, self.damage, self.turned = max(own.threads, 1), own.nodal, own.damage, own.turned
        self.press, self.cuts = own.press, not (own.nodal or own.press)
        self.stone, self.hollow, self.rows = own.stone, own.hollow and self.cuts, own.rows
        self.atomic = own.threads == 0
        self.serial = not self.atomic  # short loops run where the kernel was launched
        self.parts = 1 if self.threads == 1 else self.threads * CPU_BLOCK
        self.branches, self.second_fields, self.membrane = own.branches, not own.nodal, own.skin > 0
        self.owner: Any = None
        self.n = np.zeros(own.batch, np.int32)
        real = ti.lang.impl.get_runtime().default_fp
        self.lanes = 1 if self.atomic else REGISTER // (8 if real == ti.f64 else 4)
        self.blocks = -(-own.room // self.lanes)
        self.batch, self.room, self.slices = own.batch, self.blocks * self.lanes, own.stations
        # What is double on every device is laid out by itself: beside fields of four bytes Taichi's Vulkan puts it
        # where it may not begin at a multiple of eight, and then writes the end of its neighbour.
        self.pose, self.order = ti.field(ti.f64, (own.batch, N_POSE)), ti.field(ti.f64, (own.batch, N_ORDER))
        ti.sync()
        booked = ti.f64 if adds_doubles() else ti.f32
        self.booked_sums = N_SUMS if self.cuts else TIE_WORK  # the last are of ties and sticky faces
        self.copies = SUM_COPIES if self.atomic else 1
        self.sums = ti.field(booked, (own.batch, self.booked_sums))
        self.losses = ti.field(booked, (own.batch, self.copies, N_LOSSES))
        self.particle_sums = ti.field(booked, (own.batch, self.copies, N_PARTICLE_SUMS))
        self.extents = self._extents(own)
        self._add_particles(real, own.damage)
        self._add_grid(real, own.nodes)
        self._add_edge(real)
        self._add_tables(real)
        if self.cuts:
            self._add_ties(real, max(own.ties, 1))
        if self.membrane:
            self._add_skin(real, own.skin, max(own.ties, 1))
        if self.stone:
            ti.sync()  # as above
            self.stone_pose = ti.field(ti.f64, (own.batch, N_STONE))
            self.stone_sums = ti.field(booked, (own.batch, N_STONE_SUMS))
        ti.sync()  # lays these fields out by themselves; Taichi does not manage those of eight scenes at once

    def _extents(self, own: Configuration) -> dict[int, int]:
        """Most places that the loops of a GPU go over, by their kind."""
        nodes, lines = math.prod(own.nodes), math.prod(own.nodes[1:])
        return {
            CUTS: 1,
            NODE_ROWS: nodes,
            NODE_LINES: lines,
            PARTS: self.blocks,
            SLICES: self.slices,
            DAMAGE_ROWS: nodes,
            TIES: max(own.ties, 1),
            SKIN: max(own.skin, 1),
            NODE_ACROSS: own.nodes[0] * own.nodes[2],
        }

    def _add_particles(self, real: Any, damage: bool) -> None:
        """Fields of the particles."""
        vec3, vec4, mat3 = ti.types.vector(3, real), ti.types.vector(4, real), ti.types.matrix(3, 3, real)
        batch, room, branches = self.batch, self.room, max(self.branches, 1)
        worn, aged = room if damage else 1, room if self.branches else 1
        self.x, self.v, self.damper_v = (vec3.field(shape=(batch, room)) for _ in range(3))
        self.C, self.F = vec4.field(shape=(batch, room, 3)), ti.Vector.field(self.lanes, real, (batch, self.blocks, 9))
        self.tau = ti.Vector.field(self.lanes, real, (batch, self.blocks, N_STRESS))
        self.side, self.tool_gap = ti.field(ti.i32, (batch, room)), ti.field(real, (batch, room))
        self.board_gap = ti.field(real, (batch, room))
        self.volume_ratio = ti.field(real, (batch, room))
        self.surface_volume = ti.Vector.field(2, real, (batch, room))
        self.contact_moment = vec4.field(shape=(batch, room, 2))
        self.kappa, self.driving_strain = (ti.field(real, (batch, worn)) for _ in range(2))
        self.stick = vec3.field(shape=(batch, 2, room))
        self.face_rise = vec3.field(shape=(batch, room))
        self.adhering, self.visibility = (ti.field(ti.i32, (batch, room)) for _ in range(2))
        self.prony_stress = mat3.field(shape=(batch, branches, aged))
        self.prony_before = mat3.field(shape=(batch, aged))
        self.prony_share, self.prony_rate = (ti.field(real, (batch, branches)) for _ in range(2))

    def _add_skin(self, real: Any, points: int, ties: int) -> None:
        """Fields of the points of the skin."""
        vec3, shape = ti.types.vector(3, real), (self.batch, points)
        self.skin_x, self.skin_sides = vec3.field(shape=shape), vec3.field(shape=(*shape, 2))
        self.skin_area, self.skin_length = (ti.field(real, shape) for _ in range(2))
        self.skin_half, self.skin_visibility, self.skin_tie = (ti.field(ti.i32, shape) for _ in range(3))
        self.skin_pull = vec3.field(shape=(self.batch, ties))

    def _add_grid(self, real: Any, nodes: tuple[int, ...]) -> None:
        """Fields of the grid, one for each thread to add to."""
        vec4, batch = ti.types.vector(4, real), self.batch
        more = 0 if self.nodal else nodes[1] if self.turned else 2 * SECOND_FIELD_CELLS + 1
        self.stride_y, self.stride_x = nodes[2], (nodes[1] + more) * nodes[2]  # to the next node along y and along x
        self.nodes_per_grid = nodes[0] * self.stride_x
        grids = batch * self.threads
        self.index_mask = (1 << (grids * self.nodes_per_grid).bit_length()) - 1
        self.g = vec4.field(shape=grids * self.nodes_per_grid)
        self.u = vec4.field(shape=batch * self.nodes_per_grid)
        self.planes = vec4.field(shape=(batch, self.threads, 16))
        self.damage_box = ti.field(ti.i32, (batch, 6))

    def _add_edge(self, real: Any) -> None:
        """Fields of the slices along the cutting edge."""
        vec2, vec3, shape = ti.types.vector(2, real), ti.types.vector(3, real), (self.batch, self.slices)
        self.slip, self.reaction = (vec2.field(shape=shape) for _ in range(2))
        self.zone_velocity = vec3.field(shape=shape)
        self.crack_front, self.front_drift, self.cut_depth = (ti.field(real, shape) for _ in range(3))
        self.line, self.zone, self.dent_over_width = (ti.field(real, shape) for _ in range(3))
        self.softening, self.start_force, self.contact_part = (ti.field(real, shape) for _ in range(3))
        self.top_toughness, self.top_power, self.floor_power = (ti.field(real, shape) for _ in range(3))
        self.started_beside = ti.field(ti.i32, shape)
        self.top_high, self.top_low, self.width = (ti.field(real, shape) for _ in range(3))
        self.floor_high, self.floor_low = (ti.field(real, shape) for _ in range(2))

    def _add_ties(self, real: Any, ties: int) -> None:
        """Fields of the ties across the cut plane, and of what they leave to the edge."""
        vec2, batch, slices = ti.types.vector(2, real), self.batch, (self.batch, self.slices)
        self.half = ti.field(ti.i32, (batch, self.room))
        self.tie_ends = ti.Vector.field(2, ti.i32, (batch, ties))
        self.tie_toughness, self.tie_share = (ti.field(real, (batch, ties)) for _ in range(2))
        self.largest_opening, self.cut_part = (ti.field(real, (batch, ties, FACE_POINTS)) for _ in range(2))
        self.row_toughness, self.row_share = (ti.field(real, (batch, ties, self.rows)) for _ in range(2))
        self.face_shear = vec2.field(shape=(batch, ties))
        self.passing, self.passed_mean = ti.types.vector(3, real).field(shape=slices), vec2.field(shape=slices)
        self.start_excess, self.part_left, self.most_passed = (ti.field(real, slices) for _ in range(3))
        self.at_edge = ti.types.vector(3, real).field(shape=slices)

    def _add_tables(self, real: Any) -> None:
        """Tables of numbers that the host sets, and of what the loops go over."""
        self.par = ti.field(real, (self.batch, N_PARAMETERS))
        self.size = ti.field(ti.i32, (self.batch, N_SIZES))
        self.window = ti.field(ti.i32, (self.batch, 6))
        self.steps_left = ti.field(ti.i32, self.batch)
