"""The food under a robot's knife: the edge's pose goes in, the food's force comes back, step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.material.food import FoodSpec
from intsim.sim.lateral import face_area, lateral_force
from intsim.sim.piece_mesh import Ends, Mesh, item_mesh
from intsim.sim.severing import cut_scene_at
from intsim.task.kinematic_table import axis_crossing
from intsim.task.motion import RELEASE_CLEARANCE
from intsim.task.pieces import cut_ends, piece_shape
from intsim.task.planner import DESCENT_SPEED
from intsim.task.targets import Item
from mpm.live import LiveCut
from mpm.output.record import ForceRecord
from mpm.scene import Scene
from mpm.scene.errors import SceneError, SimulationError

GRID_MARGIN = 2.0  # empty grid around the food, over half its size: a knife that comes back takes pieces along
ON_BOARD_HEIGHT = 1e-4  # height at which the edge is on the board [m]
STALL_SPEED = 1e-3
"""Speed of the edge below which it stands [m/s], a fortieth of that of a press.

It stands above the board where one end of the blade, say, is on the board and the middle hangs.
"""
READY_CLEARANCE = RELEASE_CLEARANCE  # height of the edge above the food at which its cut is made ready [m]
TOUCH_FORCE = 1e-3  # force from which on the knife touches the food, over the weight of the food [-]
MAX_CELLS = 14
"""Cells over height and width of a food at most: large foods have larger cells, which save much time.

What that does to the force: docs/robot.md, "The dataset".
"""
READY_SLICE_RATIO = 1.0  # way along the edge over the way down that a scene is made ready for [-]


@dataclass(frozen=True, eq=False)
class FinishedCut:
    """A cut that has ended.

    Attributes:
        item: The food before it.
        along: Where along its axis the edge came down [m].
        severed: Whether it is in pieces; None where the simulation broke down.
        uncut: Part of the section that still holds [-].
        record: What the solver recorded; None where the edge did not reach it.
        why: The finding, or why there is none, in words.
    """

    item: Item
    along: float
    severed: bool | None
    uncut: float
    record: ForceRecord | None
    why: str


class Coupling:
    """Foods on a table and one knife; each cut in its turn is followed by the cutting solver.

    The solver's blade stays in the plane in which it came down, across the food's axis. The way of the knife down is
    passed on, and where it ``draws`` its way along the edge and its tilt are too. Its way across the blade is not, nor
    the tilt elsewhere: both are recorded as ``aside`` and ``pitch``. A blade that leaves its plane is held by the sides
    of the cut, by a closed form beside the solver (:mod:`intsim.sim.lateral`): that is the force across it. A second
    cut is one of the piece that is there, with its ends, its place and what it still has of its skin
    (:mod:`intsim.task.pieces`), at rest.

    A cut begins only from above: a food that is met from its side is not cut. It ends

    * when nothing holds any more and the edge rests on the board or turns back,
    * when nothing holds any more, the edge stands, and the food is in pieces: those that lie free are no longer
      followed, because a knife that goes on being pressed or drawn would take them off the grid,
    * when the knife is above the food again,
    * or when the simulation breaks down.

    Args:
        items: The foods.
        foods: Their properties, by name.
        knife: Name of the knife.
        coarse: Cells of a screening run, of a large food larger ones (:data:`MAX_CELLS`).
        draws: Whether the knife is drawn along its edge or rocks; without it the food has a mirror plane more and costs
            half.
        speed: Usual speed of the descent [m/s].

    Attributes:
        items: The foods as they are now.
        live: The cut that goes on, or None.
        done: Cuts that have ended.
        force: Force of the food on the knife, world axes [N], shape (3,).
        torque: Of the food on the knife about :meth:`point`, world axes [N m], shape (3,): what tilts the edge, where
            it ``draws``, and of the force across the blade, which acts half-way up its face in the food.
        impulse: Impulse of the food on the knife so far [N s], shape (3,).
        touching: Whether the food presses on the knife.
        aside, pitch: Largest way across the blade [m] and tilt [rad] of the knife since a cut began.
    """

    def __init__(
        self,
        items: Sequence[Item],
        foods: Mapping[str, FoodSpec],
        *,
        knife: str = "kitchen",
        coarse: bool = True,
        draws: bool = False,
        speed: float = DESCENT_SPEED,
    ) -> None:
        self.items, self.foods = list(items), foods
        self.knife, self.coarse, self.draws, self.speed = knife, coarse, draws, speed
        self.live: LiveCut | None = None
        self.done: list[FinishedCut] = []
        self.force, self.torque, self.impulse, self.touching = np.zeros(3), np.zeros(3), np.zeros(3), False
        self.aside = self.pitch = 0.0
        self._which, self._along, self._begin = 0, 0.0, np.zeros(5)
        self._plane: np.ndarray | None = None
        self._ends: Ends | None = None
        self._others = Mesh.of([])
        self._ready: set[int] = set()  # foods that the edge has been above since it was last down

    @property
    def severed(self) -> bool:
        """Whether every cut so far has left pieces, and there was one."""
        return bool(self.done) and all(d.severed for d in self.done)

    @property
    def broken(self) -> str:
        """Why a cut was not simulated to its end, in words; empty where all were."""
        return next((d.why for d in self.done if d.severed is None), "")

    def count(self) -> int:
        """Pieces of the first food, as it lies there now: those of a cut that goes on as soon as nothing holds."""
        here = self.live if self.live is not None and self._which == 0 and self.live.begun else None
        parted = here is not None and here.status == "done" and here.uncut == 0 and here.pieces().complete
        return len(self.items[0].pieces) + parted

    def move(self, pose: np.ndarray, span: float) -> np.ndarray:
        """The knife has moved to a pose in a span of time.

        Args:
            pose: Middle of the edge x, y, z [m], direction of the edge and its angle to the board [rad], shape (5,).
            span: Time [s].

        Returns:
            Force of the food on the knife, world axes [N], shape (3,): the mean of the span.
        """
        self.force, self.torque = np.zeros(3), np.zeros(3)
        if self.live is None:
            self._approach(pose)
        if self.live is not None:
            self._follow(pose, span)
        self.impulse = self.impulse + span * self.force
        return self.force

    def point(self, pose: np.ndarray) -> np.ndarray:
        """Where the food's force acts on the knife, beside :attr:`torque` [m], shape (3,).

        It is on the edge, above the food's axis; where the knife ``draws`` the point of the edge that was above the
        axis when the cut began.
        """
        if not self.draws:
            return np.array([*self.items[self._which].at(self._along), pose[2]])
        edge, tilt = self._lying(pose)
        off = self._off
        return np.array([*(pose[:2] + off * np.cos(tilt) * edge), pose[2] + off * np.sin(tilt)])

    def mesh(self) -> tuple[int, np.ndarray, np.ndarray, np.ndarray] | None:
        """The food under the knife, all of it; None while no cut goes on.

        Beside what is simulated these are the ends of a long piece, which go with the simulated part, and the other
        pieces, which lie still.

        Returns:
            Its place in ``items``, vertices in the world [m] (m, 3), triangles (t, 3), and which vertices lie on the
            face of the cut (m,).
        """
        if self.live is None or not self.live.begun:
            return None
        item = self.items[self._which]
        own = Mesh(*self.live.surface())
        if self._ends is None:
            self._ends, self._others = self._beside(item)
        parts = [own, *self._ends.now(own.points)]
        whole = Mesh.of([*(replace(m, points=item.placed(m.points, self._along)) for m in parts), self._others])
        return self._which, whole.points, whole.triangles, whole.flesh

    def _beside(self, item: Item) -> tuple[Ends, Mesh]:
        """What is drawn beside the simulated part of the piece that is cut."""
        assert self.live is not None
        which = item.piece_at(self._along)
        assert which is not None
        place = self._along - item.pieces[which].shift
        faces = cut_ends(item, which)
        own = self.live.scene.food.shape
        return Ends(own, piece_shape(item, which, place), faces, self.live.rest), item_mesh(item, which)

    def uncut(self) -> float:
        """Part of the section of the present cut that still holds [-], 1 where there is none."""
        if self.live is None:
            return self.done[-1].uncut if self.done else 1.0
        return self.live.uncut

    def end(self) -> None:
        """End the present cut where it is."""
        if self.live is None:
            return
        live, self.live = self.live, None
        item = self.items[self._which]
        if not live.begun:
            return
        record = live.record()
        if live.status != "done" or record.pieces is None:
            found = FinishedCut(item, self._along, None, 1.0, record, f"the simulation stopped: {live.status}")
        else:
            found = FinishedCut(item, self._along, record.pieces.complete, live.uncut, record, record.pieces.words())
        self.done.append(found)
        if found.severed:
            self.items[self._which] = item.cut_at(self._along)
        self.touching = False

    def _approach(self, pose: np.ndarray) -> None:
        """Make a cut ready where the edge is about to come down on a food."""
        over = {
            k: pose[2] - item.shape.height - item.shape.width / 2 * abs(np.tan(pose[4]))
            for k, item in enumerate(self.items)
        }
        self._ready |= {k for k in over if over[k] > READY_CLEARANCE}
        down = [k for k in sorted(self._ready) if over[k] <= READY_CLEARANCE]
        met = [(k, along) for k in down if (along := axis_crossing(self.items[k], pose)) is not None]
        self._ready -= {k for k in down if over[k] < 0}
        if met:
            self._which, self._along = met[0]
            self._ready.discard(self._which)
            self._begin, self.aside, self.pitch, self._ends = np.array(pose, float), 0.0, 0.0, None
            self._plane = None
            item = self.items[self._which]
            try:
                self.live = LiveCut(self._scene(item, self._along))
            except SceneError as e:
                self.done.append(FinishedCut(item, self._along, None, 1.0, None, str(e)))

    def _scene(self, item: Item, along: float) -> Scene:
        """The cut of a food there."""
        cells = MAX_CELLS if self.coarse else None
        scene = cut_scene_at(item, along, self.foods[item.name], knife=self.knife, coarse=self.coarse, cells=cells)
        motion = replace(scene.motion, speed=self.speed, slice_ratio=READY_SLICE_RATIO if self.draws else 0.0)
        return replace(scene, motion=motion, numerics=replace(scene.numerics, room=GRID_MARGIN))

    def _lying(self, pose: np.ndarray) -> tuple[np.ndarray, float]:
        """How the edge lies in the cut's scene.

        Returns:
            Its direction as the cut began, along x of the scene, shape (2,), and how much its end there is risen [rad].
        """
        edge = np.array([np.cos(self._begin[3]), np.sin(self._begin[3])])
        edge *= np.sign(edge @ self.items[self._which].across)
        same = edge @ [np.cos(pose[3]), np.sin(pose[3])] > 0  # an edge has two directions
        return edge, float(pose[4] if same else -pose[4])

    @property
    def _off(self) -> float:
        """How far along the edge from its middle the food's axis was when the cut began [m]."""
        edge, _ = self._lying(self._begin)
        return float((self.items[self._which].at(self._along) - self._begin[:2]) @ edge)

    def _follow(self, pose: np.ndarray, span: float) -> None:
        """Pass a pose on to the solver, and its force back."""
        assert self.live is not None
        item = self.items[self._which]
        edge, tilt = self._lying(pose)
        way = pose[:2] - self._begin[:2]
        self.aside = max(self.aside, abs(float(way @ [-edge[1], edge[0]])))
        self.pitch = max(self.pitch, abs(float(pose[4])))
        before = self.live.height
        try:
            if self.draws:
                along, _, up = self.live.move(float(self.point(pose)[2]), float(way @ edge), span, tilt)
            else:
                along, _, up = self.live.move(float(pose[2]), 0.0, span)
        except SimulationError:
            self.end()
            return
        self.force = np.array([*(along * edge), up])
        self.torque = self.live.moment * np.array([edge[1], -edge[0], 0.0])
        weight = self.live.weight
        self.touching = bool(np.linalg.norm(self.force) > TOUCH_FORCE * weight)
        self._hold(pose, edge)
        above = pose[2] > item.shape.height + READY_CLEARANCE and (
            self.live.begun or pose[2] > self._begin[2] + READY_CLEARANCE
        )
        if above or (
            self.live.begun and self.live.uncut == 0 and self._through(before - self.live.height, pose[2], span)
        ):
            self.end()

    def _hold(self, pose: np.ndarray, edge: np.ndarray) -> None:
        """Add the force of the sides of the cut on a blade that has left the plane in which it met the food."""
        assert self.live is not None
        if self._plane is None:
            if self.touching:
                self._plane = np.array(pose[:2], float)
            return
        across, scene = np.array([-edge[1], edge[0]]), self.live.scene
        area = face_area(scene, float(pose[2]))
        force = lateral_force(scene.food.material, area, float((pose[:2] - self._plane) @ across))
        push = np.array([*(force * across), 0.0])
        arm = np.array([0.0, 0.0, max(scene.food.shape.height - float(pose[2]), 0.0) / 2])
        self.force, self.torque = self.force + push, self.torque + np.cross(arm, push)

    def _through(self, down: float, height: float, span: float) -> bool:
        """Whether an edge that has passed the whole section is done.

        In a span of time [s] it went ``down`` as far as the board let it, to ``height`` [m].
        """
        assert self.live is not None
        if height < ON_BOARD_HEIGHT or down < 0:
            return True
        return down < STALL_SPEED * span and self.live.pieces().complete
