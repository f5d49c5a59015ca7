"""Triangles to pixels against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from intsim.render.mesh import Drawn, Paint, box, clustered, lathe
from intsim.render.view import View
from mpm.runtime.device import Runtime, running, start

PIXELS = 64


@pytest.fixture(autouse=True)
def taichi():
    """Kernels run on one core."""
    if not running():
        start(Runtime("cpu", 1), "f32")


def seen(mesh: Drawn, view: View):
    """How near what a view sees is, which triangle, and its colour."""
    from intsim.render.studio import Geometry

    near, which = np.zeros((1, PIXELS, PIXELS), np.float32), np.zeros((1, PIXELS, PIXELS), np.int32)
    look = np.zeros((1, PIXELS, PIXELS, 7), np.float32)
    Geometry(mesh).see(view.row[None], near, which, look)
    return near[0], which[0], look[0]


def test_a_square_is_where_the_pinhole_puts_it_as_far_as_it_is():
    """A face of a metre at two metres, seen by a camera of 90 degrees whose picture is four metres wide
    there: a quarter
    of it, and every pixel of that one over two near."""
    view = View.towards(np.array([0.0, -2.5, 0.0]), np.zeros(3), np.pi / 2, PIXELS)
    near, which, look = seen(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), Paint((0.2, 0.4, 0.6))), view)
    rows, columns = np.nonzero(which >= 0)
    free = 3 * PIXELS // 8
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (free, PIXELS - free - 1, free, PIXELS - free - 1)
    assert near[which >= 0] == pytest.approx(0.5, rel=1e-5) and (near[which < 0] == 0).all()
    assert look[PIXELS // 2, PIXELS // 2] == pytest.approx([0.2, 0.4, 0.6, 0.0, -1.0, 0.0, 0.0], abs=1e-5)


def test_the_nearer_of_two_hides_the_other_in_whatever_order():
    """A small box before a large one."""
    view = View.towards(np.array([0.0, -3.0, 0.0]), np.zeros(3), 1.0, PIXELS)
    front, back = (
        box((-0.2, -1, -0.2), (0.2, -0.8, 0.2), Paint((1, 0, 0))),
        box((-1, 0, -1), (1, 0.2, 1), Paint((0, 1, 0))),
    )
    for parts in ([front, back], [back, front]):
        look = seen(Drawn.all(parts), view)[2]
        assert look[PIXELS // 2, PIXELS // 2, 0] == 1 and look[PIXELS // 2, 12, 1] == 1


@pytest.mark.parametrize(("moves", "stands"), [(False, False), (True, False), (False, True), (True, True)])
def test_nothing_is_seen_through_the_shadow_of_a_lamp_but_beside_it(moves, stands):
    """The room that a lamp from above does not reach under a plate is as wide as the plate: whether the plate moves,
    or stands as the room does, and whether the floor is lit anew or was lit once."""
    from intsim.render import raster
    from intsim.render.studio import FAR, Geometry

    floor, plate = (
        box((-1, -1, -0.1), (1, 1, 0.0), Paint((1, 1, 1))),
        box((-0.25, -0.25, 0.5), (0.25, 0.25, 0.55), Paint((1, 0, 0))),
    )
    lamp = np.zeros((2, 16), np.float32)
    lamp[0] = View.lamp(np.array([0.0, 0.0, -1.0]), 1.5, 256).row
    lamp[1, :10] = [0.8] * 3 + [0.1] * 6 + [0.01]
    shadow = np.full((2, 256, 256), np.float32(FAR))  # of the room, of the scene
    part = slice(int(moves), int(moves) + 1)
    Geometry(Drawn.all([floor, plate])).draw(lamp[:1], shadow[part], np.zeros((1, 256, 256), np.int32))
    view = View.towards(np.array([0.0, 0.0, 0.4]), np.zeros(3), 2.0, PIXELS)  # from below the plate
    near, _, look = seen(floor, view)
    near, look, count = near.reshape(-1), look.reshape(-1, 7), PIXELS**2
    none, out = np.zeros_like(near), np.zeros((count, 3), np.uint8)
    place, fixed = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.uint8)
    if stands:  # the floor is what does not move
        raster.settle(view.row[None], near, look, lamp, shadow.reshape(-1), place, fixed)
        near, none = none, near
    else:
        place, fixed = place[:0], fixed[:0]
    raster.light(view.row[None], near, look, none, look, place, fixed, lamp, shadow.reshape(-1), out)
    dark = out.reshape(PIXELS, PIXELS, 3)[PIXELS // 2, :, 0] < 120
    wide = dark.sum() / view.focal * 0.4
    assert wide == pytest.approx(0.5, abs=2 * 0.4 / view.focal) and not dark[0] and not dark[-1]


def test_bodies_are_closed_and_turned_outwards():
    """Their volume by the divergence theorem is that of the body: a box and a cylinder of 16 sides."""
    for mesh, wanted in (
        (box((0, 0, 0), (0.5, 1, 2), Paint((1, 1, 1))), 1.0),
        (lathe([(0, 0), (1, 0), (1, 2), (0, 2)], Paint((1, 1, 1))), 16 * np.sin(np.pi / 8)),
    ):
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(wanted)


def test_a_coarser_mesh_keeps_its_parts_apart_and_its_shape():
    """A sphere has far fewer triangles and nearly the same volume; two parts in one cell stay two."""
    profile = [(np.sin(t), -np.cos(t)) for t in np.linspace(0, np.pi, 60)]
    ball = lathe([(abs(r), z) for r, z in profile], Paint((1, 1, 1)), 60)
    kept, triangles = clustered(ball.points, ball.triangles, np.zeros(len(ball.points), int), 0.2)
    points = ball.points[kept]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    assert len(triangles) < len(ball.triangles) / 4
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(4 / 3 * np.pi, rel=0.05)
    two = clustered(np.array([[0.01, 0, 0], [0.02, 0, 0]]), np.zeros((0, 3), int), np.array([0, 1]), 1.0)[0]
    assert len(two) == 2
