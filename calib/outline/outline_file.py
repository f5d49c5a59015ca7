"""Which file says what a specimen's outline is, how it is read, and the specimen that it makes."""

from __future__ import annotations

import hashlib
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
UP, ACROSS = "z", "y"
"""Axes of a mesh that point up and lie across the blade where nothing else is said."""
MOST_BYTES = 500_000_000
"""Bytes of a file of an outline."""
SMALLEST, LARGEST = 1e-7, 1e-2
"""A pixel between these is one of a photograph of food [m]."""


@dataclass(frozen=True)
class OutlineFile:
    """The file of an outline, and how it is read. The names are those of the options.

    Attributes:
        outline: Photograph of a silhouette (PNG, JPEG), or numbers (CSV, YAML); None without one.
        scale: Size of a pixel of it, such as ``0.1mm/px``.
        outline_as: How it becomes a food, one of ``calib.outline.silhouette.WAYS``.
        mesh: Closed surface mesh, None without one.
        mesh_unit: Unit of its coordinates, such as ``mm``.
        mesh_up: Its axis that points up, one of :data:`AXES`.
        mesh_across: Its axis that lies across the blade.

    Raises:
        ShapeError: Something is missing, or there twice.
    """

    outline: str | Path | None = None
    scale: str | None = None
    outline_as: str | None = None
    mesh: str | Path | None = None
    mesh_unit: str | None = None
    mesh_up: str = UP
    mesh_across: str = ACROSS

    def __post_init__(self) -> None:
        if self.outline is not None and self.mesh is not None:
            raise ShapeError("--outline beside --mesh: a specimen has one outline; leave one of them out")
        if self.outline is None and (self.scale is not None or self.outline_as is not None):
            raise ShapeError("--scale and --outline-as say how an outline is read; give its file with --outline")
        turned = (self.mesh_up, self.mesh_across) != (UP, ACROSS)
        if self.mesh is None and (self.mesh_unit is not None or turned):
            raise ShapeError(
                "--mesh-unit, --mesh-up and --mesh-across say how a mesh is read; give its file with --mesh"
            )
        for name in ("mesh_up", "mesh_across"):
            if getattr(self, name) not in AXES:
                raise ShapeError(
                    f"--{name.replace('_', '-')} {getattr(self, name)}: no axis of a mesh; one of {', '.join(AXES)}"
                )
        if self.outline_as is not None and self.outline_as not in WAYS:
            raise ShapeError(f"--outline-as {self.outline_as}: is none of {', '.join(WAYS)}")

    def sizing(self, given: Sizing) -> Sizing:
        """What is known of the specimen, with the outline of the file where there is one.

        Args:
            given: What is known beside it.

        Returns:
            The same where there is no file; else its sizes are those of the outline.

        Raises:
            ShapeError: The file gives no outline, or a size is given that the outline has.
        """
        path = self.outline if self.mesh is None else self.mesh
        if path is None:
            return given
        option = "--outline" if self.mesh is None else "--mesh"
        if given.shape is not None:
            raise ShapeError(f"--shape {given.shape} beside {option}: the file says the shape; leave one of them out")
        path = Path(path)
        try:
            content = read_regular(path, most=MOST_BYTES)
        except OSError as e:
            raise ShapeError(f"{path}: cannot be read ({e.strerror or e}); name the file of the outline") from None
        sized, how = self._of_mesh(path) if self.mesh is not None else self._of_outline(path, content)
        for name in ("height", "width", "length"):
            if getattr(given, name) is not None and getattr(sized, name) is not None:
                raise ShapeError(f"--{name} beside {option}: {path.name} says how large the food is; leave it out")
        outline = Outline(path.name, hashlib.sha256(content).hexdigest(), how, sized.sections)
        length = given.length if sized.length is None else sized.length
        return replace(given, height=sized.height, width=sized.width, length=length, outline=outline, said=sized.said)

    def _of_outline(self, path: Path, content: bytes) -> tuple[Sized, str]:
        """The food of a photograph or of numbers, and how it was read."""
        if self.outline_as is None:
            raise ShapeError(f"{path}: how does the outline become a food? say --outline-as {', '.join(WAYS)}")
        if path.suffix.lower() in profile.SUFFIXES:
            if self.scale is not None:
                raise ShapeError(f"{path}: numbers have their unit in their names; leave --scale out")
            return profile.food_of(path, self.outline_as), self.outline_as
        if path.suffix.lower() in MESHES:
            raise ShapeError(f"{path}: is a mesh; give it with --mesh")
        if self.scale is None:
            raise ShapeError(f"{path}: a picture has no scale; say how large a pixel is, such as --scale 0.1mm/px")
        from calib.outline.photograph import silhouette as outline_in  # the readers are loaded where they are needed

        points, pixel = outline_in(path, content, scale_of(self.scale))
        return silhouette.food_of(path, points, pixel, self.outline_as), f"{self.outline_as}, {self.scale}"

    def _of_mesh(self, path: Path) -> tuple[Sized, str]:
        """The food of a mesh, and how it was read."""
        from calib.outline import mesh

        if self.mesh_unit is None:
            raise ShapeError(f"{path}: a mesh has no unit; say what one of its coordinates is, such as --mesh-unit mm")
        unit = unit_of(self.mesh_unit)
        if unit is None or unit.quantity is not Quantity.LENGTH:
            raise ShapeError(f"--mesh-unit {self.mesh_unit}: is no unit of length; m, cm, mm or inch")
        how = f"mesh, {self.mesh_unit}, {self.mesh_up} up, {self.mesh_across} across"
        return mesh.food_of(path, unit.factor, self.mesh_up, self.mesh_across), how


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
