"""Which file says what a specimen's outline is, how it is read, and the specimen that it makes."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

from calib.errors import ShapeError
from calib.material.scene import Sizing
from calib.outline import profile, silhouette
from calib.outline.silhouette import WAYS, Sized
from calib.table.units import Quantity, metres, unit_of
from mpm.files import read_regular
from mpm.scene.outline import Outline

AXES = ("x", "y", "z", "-x", "-y", "-z")
"""Axes of a mesh that can point up or across the blade."""
MESHES = (".stl", ".obj", ".vtk", ".vtu", ".ply", ".off", ".msh")
"""Files that are read as meshes."""
POSE = "z,y"
"""Axes of a mesh that point up and lie across the blade where nothing else is said."""
MOST_BYTES = 500_000_000
"""Bytes of a file of an outline."""
SMALLEST, LARGEST = 1e-7, 1e-2
"""A pixel between these is one of a photograph of food [m]."""


@dataclass(frozen=True)
class OutlineFile:
    """The file of an outline, and how it is read. The names are those of the options.

    Attributes:
        outline: Photograph of a silhouette (PNG, JPEG), radii (CSV, YAML), or closed surface mesh (STL, OBJ, VTK, MSH);
            None without one.
        scale: Size of a pixel, such as ``0.1mm/px``, or of the unit of a mesh, such as ``1mm``.
        outline_as: How a silhouette or radii become a food, one of ``calib.outline.silhouette.WAYS``; of a mesh, its
            axes that point up and lie across the blade, such as ``z,y``.

    Raises:
        ShapeError: There is no file that they belong to.
    """

    outline: str | Path | None = None
    scale: str | None = None
    outline_as: str | None = None

    def __post_init__(self) -> None:
        if self.outline is None and (self.scale is not None or self.outline_as is not None):
            raise ShapeError("--scale and --outline-as say how an outline is read; give its file with --outline")

    def sizing(self, given: Sizing) -> Sizing:
        """What is known of the specimen, with the outline of the file where there is one.

        Args:
            given: What is known beside it.

        Returns:
            The same where there is no file; else its sizes are those of the outline.

        Raises:
            ShapeError: The file gives no outline, or a size is given that the outline has.
        """
        if self.outline is None:
            return given
        if given.shape is not None:
            raise ShapeError(f"--shape {given.shape} beside --outline: the file says the shape; leave one of them out")
        path = Path(self.outline)
        try:
            content = read_regular(path, most=MOST_BYTES)
        except OSError as e:
            raise ShapeError(f"{path}: cannot be read ({e.strerror or e}); name the file of the outline") from None
        kind = path.suffix.lower()
        read = self._mesh if kind in MESHES else self._profile if kind in profile.SUFFIXES else self._photograph
        sized, how = read(path, content)
        for name in ("height", "width", "length"):
            if getattr(given, name) is not None and getattr(sized, name) is not None:
                raise ShapeError(f"--{name} beside --outline: {path.name} says how large the food is; leave it out")
        outline = Outline(path.name, hashlib.sha256(content).hexdigest(), how, sized.sections)
        length = given.length if sized.length is None else sized.length
        return replace(given, height=sized.height, width=sized.width, length=length, outline=outline, said=sized.said)

    def _way(self, path: Path) -> str:
        """How a silhouette or radii become a food."""
        if self.outline_as not in WAYS:
            said = "" if self.outline_as is None else f" {self.outline_as!r} is no way;"
            raise ShapeError(f"{path}: how does the outline become a food?{said} say --outline-as {', '.join(WAYS)}")
        return self.outline_as

    def _profile(self, path: Path, content: bytes) -> tuple[Sized, str]:
        """The food of some radii, and how it was read."""
        way = self._way(path)
        if self.scale is not None:
            raise ShapeError(f"{path}: numbers have their unit in their names; leave --scale out")
        return profile.food_of(path, way), way

    def _photograph(self, path: Path, content: bytes) -> tuple[Sized, str]:
        """The food of a photograph, and how it was read."""
        from calib.outline.photograph import silhouette as outline_in  # readers are loaded where they are needed

        way = self._way(path)
        if self.scale is None:
            raise ShapeError(f"{path}: a picture has no scale; say how large a pixel is, such as --scale 0.1mm/px")
        seen = outline_in(path, content, scale_of(self.scale))
        sized = silhouette.food_of(path, seen.points, seen.pixel, way)
        return replace(sized, said=(*seen.said, *sized.said)), f"{way}, {self.scale}"

    def _mesh(self, path: Path, content: bytes) -> tuple[Sized, str]:
        """The food of a mesh, and how it was read."""
        from calib.outline import mesh

        pose = self.outline_as or POSE
        up, _, across = (word.strip() for word in pose.partition(","))
        if up not in AXES or across not in AXES or up[-1] == across[-1]:
            raise ShapeError(
                f"{path}: --outline-as {pose}: name two axes of the mesh, that which points up and that which lies "
                f"across the blade, such as {POSE}"
            )
        if self.scale is None:
            raise ShapeError(f"{path}: a mesh has no unit; say how large one of its units is, such as --scale 1mm")
        return mesh.food_of(path, unit_size(self.scale), up, across), f"mesh, {self.scale}, {up} up, {across} across"


def unit_size(text: str) -> float:
    """Size of a mesh's unit.

    >>> unit_size("mm"), unit_size("1 inch")
    (0.001, 0.0254)

    Args:
        text: Such as ``1mm`` or ``mm``.

    Returns:
        The size [m].

    Raises:
        ShapeError: It is no such size.
    """
    found = unit_of(re.sub(r"^[\s0-9.eE+-]*", "", text).strip())
    try:
        if found is None or found.quantity is not Quantity.LENGTH:
            raise ValueError
        size = metres(text if any(c.isdigit() for c in text) else f"1{text.strip()}")
    except ValueError:
        raise ShapeError(f"--scale {text}: is no length; write the size of a unit of the mesh, such as 1mm") from None
    if not 0.0 < size < math.inf:
        raise ShapeError(f"--scale {text}: a unit of the mesh has a size above 0")
    return size


def scale_of(text: str) -> float:
    """Size of a pixel.

    >>> scale_of("0.1mm/px"), scale_of("10 px/mm")
    (0.0001, 0.0001)

    Args:
        text: Such as ``0.1mm/px`` or ``10px/mm``.

    Returns:
        The size [m].

    Raises:
        ShapeError: It is no such scale, or not one of a photograph of food.
    """
    length, _, per = (part.strip() for part in text.partition("/"))
    found = re.fullmatch(r"(.*?)\s*(px|pixels?)", length)
    try:
        if found is not None:
            size = metres(f"1{per}") / float(found[1])
        elif re.fullmatch(r"px|pixels?", per) and unit_of(re.sub(r"^[\s0-9.eE+-]*", "", length)) is not None:
            size = metres(length)
        else:
            raise ValueError
    except (ValueError, ZeroDivisionError):
        raise ShapeError(f"--scale {text}: is no scale; write the size of a pixel, such as 0.1mm/px") from None
    if not SMALLEST < size < LARGEST:
        raise ShapeError(f"--scale {text}: a pixel of {size * 1e3:g} mm is none of a photograph of food")
    return size
