"""The arm in a picture: its meshes, coarser than those it comes with, where its joints have brought them."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from intsim.render import raster
from intsim.render.mesh import Drawn, Paint, clustered
from intsim.render.view import View
from mpm.scene.errors import CutcalError

GLOSS = 0.25  # of its paint [-]
NEAR_LINKS = ("panda_hand", "panda_leftfinger", "panda_rightfinger")  # links that cameras come close to
FAR_CELLS = 2.5  # cells of the other links over those of these [-]
SIDES = [d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]  # directions from which a link is looked at
PROBE_PIXELS = 320  # of the pictures that tell which of its triangles can be seen
BASE_POSITION = (-0.615, 0.0, 0.0)  # where ManiSkill's table scenes put the arm [m]
BLADE_OFFSET = 0.12  # from the hand to the back of the blade [m]: beyond the fingertips
DESCRIPTION = "assets/robots/panda/panda_v2.urdf"  # in ManiSkill's package


def panda_description() -> Path:
    """The file that describes ManiSkill's Panda; nothing of ManiSkill is imported for it.

    Raises:
        CutcalError: ManiSkill is not installed.
    """
    found = find_spec("mani_skill")
    if found is None or found.origin is None:
        raise CutcalError("pictures: ManiSkill, whose arm is shown, is not installed; pip install 'cutcal[robot]'")
    return Path(found.origin).parent / DESCRIPTION


class Arm:
    """An arm with the meshes of its description (URDF).

    Args:
        description: The file; names of meshes in it are relative to its folder.
        base: Where its first link is [m], shape (3,).
        cell: Width of the cells in which vertices become one [m].
        beside: Further bodies that go with a link, by its name.

    Attributes:
        drawn: All of it, each link's vertices in the frame of the link.
    """

    def __init__(
        self, description: Path, base: tuple[float, float, float], cell: float, beside: dict[str, Drawn]
    ) -> None:
        root = ElementTree.parse(description).getroot()
        self._base = np.eye(4)
        self._base[:3, 3] = base
        self._root, self._joints = _in_order([_Joint(joint) for joint in root.iter("joint")])
        parts, self._spans, first = [], [], 0
        for link in root.iter("link"):
            name = link.get("name", "")
            own = [
                *_meshes(link, description.parent, cell * (1.0 if name in NEAR_LINKS else FAR_CELLS)),
                *([beside[name]] if name in beside else []),
            ]
            for mesh in [_outside(Drawn.all(own))] if own else []:
                parts.append(mesh)
                self._spans.append((name, first, first + len(mesh.points)))
                first += len(mesh.points)
        self.drawn = Drawn.all(parts)
        self._rest = np.column_stack([self.drawn.points, np.ones(first)])

    def links(self, qpos: np.ndarray) -> dict[str, np.ndarray]:
        """Pose of each link in the world (4, 4), by name, where the joints (9,) are [rad, m]."""
        found, moved = {self._root: self._base}, 0
        for joint in self._joints:
            value = 0.0
            if joint.moves:
                value, moved = float(qpos[moved]), moved + 1
            found[joint.child] = found[joint.parent] @ joint.pose(value)
        return found

    def points(self, links: dict[str, np.ndarray], out: np.ndarray) -> None:
        """Put the vertices in the world [m] into ``out``, shape (n, 3)."""
        for name, a, b in self._spans:
            out[a:b] = self._rest[a:b] @ links[name][:3].T


class _Joint:
    """A joint of a description."""

    def __init__(self, joint: ElementTree.Element) -> None:
        parent, child, axis = joint.find("parent"), joint.find("child"), joint.find("axis")
        assert parent is not None and child is not None
        self.parent, self.child = parent.get("link", ""), child.get("link", "")
        self.kind = joint.get("type", "fixed")
        self.axis = np.array(_numbers(axis.get("xyz", "1 0 0"))) if axis is not None else np.array([1.0, 0.0, 0.0])
        self._origin = _pose(joint.find("origin"))
        x, y, z = self.axis / np.linalg.norm(self.axis)
        self._cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        self._cross_twice = self._cross @ self._cross

    @property
    def moves(self) -> bool:
        """Whether it does."""
        return self.kind != "fixed"

    def pose(self, value: float) -> np.ndarray:
        """Of the child in the parent's frame."""
        own = np.eye(4)
        if self.kind == "prismatic":
            own[:3, 3] = value * self.axis
        elif self.moves:
            own[:3, :3] += (
                math.sin(value) * self._cross + (1 - math.cos(value)) * self._cross @ self._cross
            )  # Rodrigues
        return self._origin @ own


def _in_order(joints: list[_Joint]) -> tuple[str, list[_Joint]]:
    """The first link, and the joints so that each comes after the one that its parent hangs on."""
    children = {joint.child for joint in joints}
    first = next(joint.parent for joint in joints if joint.parent not in children)
    known = {first}
    out: list[_Joint] = []
    while len(out) < len(joints):
        for joint in joints:
            if joint.parent in known and joint.child not in known:
                known.add(joint.child)
                out.append(joint)
    return first, out


def _numbers(words: str) -> list[float]:
    return [float(word) for word in words.split()]


def _pose(origin: ElementTree.Element | None) -> np.ndarray:
    """The pose that an ``origin`` gives."""
    out = np.eye(4)
    if origin is not None:
        out[:3, :3] = Rotation.from_euler("xyz", _numbers(origin.get("rpy", "0 0 0"))).as_matrix()
        out[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return out


def _outside(mesh: Drawn) -> Drawn:
    """What can be seen of a link from any side: its inner parts are never drawn."""
    points = np.ascontiguousarray(mesh.points - (mesh.points.min(0) + mesh.points.max(0)) / 2, np.float32)
    triangles = np.ascontiguousarray(np.column_stack([mesh.triangles, mesh.paint_of]), np.int32)
    reach = float(np.linalg.norm(points, axis=1).max())
    views = np.array([View.lamp(np.array(direction), reach, PROBE_PIXELS).row for direction in SIDES])
    count = len(SIDES) * PROBE_PIXELS**2
    near, which = np.full(count, np.float32(-1e9)), np.full(count, np.int32(-1))
    raster.draw(points, triangles, views, np.empty_like(points), near, which)
    seen = np.zeros(len(triangles), bool)
    seen[which[which >= 0]] = True
    used = np.unique(mesh.triangles[seen])
    index = np.full(len(mesh.points), -1)
    index[used] = np.arange(len(used))
    triangles, paint_of = index[mesh.triangles[seen]], mesh.paint_of[seen]
    return replace(mesh, points=mesh.points[used], triangles=triangles, paint_of=paint_of, ref=mesh.ref[used])


def _meshes(link: ElementTree.Element, folder: Path, cell: float) -> list[Drawn]:
    """The visible meshes of a link, coarser."""
    import trimesh

    out = []
    for visual in link.iter("visual"):
        mesh = visual.find("geometry/mesh")
        if mesh is None:
            continue
        pose = _pose(visual.find("origin"))
        scene = trimesh.load(folder / mesh.get("filename", ""), force="scene")
        for node in scene.graph.nodes_geometry:
            place, name = scene.graph[node]
            geometry = scene.geometry[name]
            points = trimesh.transform_points(geometry.vertices, pose @ place)
            colour = np.asarray(geometry.visual.material.baseColorFactor)[:3] / 255
            kept, triangles = clustered(points, geometry.faces, np.zeros(len(points), int), cell)
            out.append(Drawn.of(points[kept], triangles, Paint(tuple(colour), gloss=GLOSS)))
    return out
