"""Pictures and meshes of foods whose form is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
from PIL import Image

BACKGROUND, FOOD = np.array([230.0, 225.0, 220.0]), np.array([170.0, 75.0, 30.0])
Within = Callable[[np.ndarray, np.ndarray], np.ndarray]


def picture(path: Path, within: Within, *, size: tuple[int, int] = (240, 160), noise: float = 0.0) -> Path:
    """A photograph of what lies where ``within`` says, at x to the right and z upwards in pixels from the middle."""
    fine = 4
    z, x = (np.mgrid[0 : size[1] * fine, 0 : size[0] * fine] + 0.5) / fine
    part = within(x - size[0] / 2, size[1] / 2 - z).reshape(size[1], fine, size[0], fine).mean(axis=(1, 3))
    image = BACKGROUND + part[..., None] * (FOOD - BACKGROUND)
    image += np.random.default_rng(0).normal(0.0, noise, (*image.shape[:2], 1))
    Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)).save(path)
    return path


def ellipse(a: float, b: float, turned: float = 0.0) -> Within:
    """An ellipse with these half axes in pixels, turned against the clock [rad]."""
    c, s = np.cos(turned), np.sin(turned)
    return lambda x, z: ((c * x + s * z) / a) ** 2 + ((c * z - s * x) / b) ** 2 <= 1


def half(a: float, b: float, turned: float = 0.0) -> Within:
    """The upper half of an ellipse on its flat side, which is turned against the clock [rad]."""
    c, s, whole = np.cos(turned), np.sin(turned), ellipse(a, b, turned)
    return lambda x, z: whole(x, z) & (c * z - s * x >= 0)


def half_ellipsoid(a: float, b: float, c: float, rings: int = 24, around: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the upper half of an ellipsoid with its flat face, seen from outside."""
    t = np.linspace(0.0, np.pi / 2, rings + 1)[1:, None]
    p = 2 * np.pi * np.arange(around) / around
    shell = np.stack(np.broadcast_arrays(a * np.sin(t) * np.cos(p), b * np.sin(t) * np.sin(p), c * np.cos(t)), -1)
    points = np.concatenate([[[0.0, 0.0, c]], shell.reshape(-1, 3), [[0.0, 0.0, 0.0]]])
    k, after = np.arange(around), np.roll(np.arange(around), -1)
    faces = [np.stack([0 * k, 1 + k, 1 + after], 1)]
    for ring in range(rings - 1):
        i, j = 1 + ring * around + k, 1 + ring * around + after
        faces += [np.stack([i, i + around, j + around], 1), np.stack([i, j + around, j], 1)]
    faces.append(np.stack([0 * k + len(points) - 1, len(points) - 1 - around + after, len(points) - 1 - around + k], 1))
    return points, np.concatenate(faces)


def mesh(path: Path, points: np.ndarray, faces: np.ndarray) -> Path:
    """A file of a surface."""
    meshio.write_points_cells(path, points, [("triangle", faces)])
    return path


def tilted(points: np.ndarray, degrees: float) -> np.ndarray:
    """The points turned about x."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return points @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
