"""Triangles to pixels, and the light on them (Taichi, on one core).

What is seen where depends on geometry alone. It is found once (:func:`see`) and then lit by each background's own lamp
(:func:`light`), with shadows from maps of what the lamp sees (Williams 1978). What does not move is lit once
(:func:`settle`), and again where a shadow of the scene falls on it.

Pictures are square, and their pixels are one row after the other, view after view, in arrays with one index. Numbers
of a view are read into local variables before a loop. The compiler cannot know that what a loop writes is elsewhere,
and would read shapes and views again for each pixel.
"""

import taichi as ti

from intsim.render.texture import part_of_second
from intsim.render.view import NEAR


def rows(size: int, kind: type = ti.f32) -> ti.types.ndarray:
    """An array of rows of so many numbers, shape (n, size): one index, and no product of shapes for each number."""
    return ti.types.ndarray(dtype=ti.types.vector(size, kind), ndim=1)


numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
array = ti.types.ndarray
GLOW = 2.0
"""Gloss from which on a surface shines by itself."""


@ti.func
def camera(views: ti.template(), c: ti.i32):
    """A view: where it is, its directions by rows, focal length, half the picture, and whether it is flat."""
    eye = ti.Vector([views[c, 0], views[c, 1], views[c, 2]], ti.f32)
    turn = ti.Matrix([[views[c, 3 + 3 * m + n] for n in ti.static(range(3))] for m in ti.static(range(3))], ti.f32)
    return eye, turn, views[c, 12], views[c, 13], views[c, 14] != 0


@ti.func
def seen(eye, turn, focal: ti.f32, half: ti.f32, flat, p):
    """A point in a view: column and row [px], and how near it is: one over the distance, or less the distance."""
    q = turn @ (p - eye)
    out = ti.Vector([focal * q.x + half, focal * q.y + half, -q.z], ti.f32)
    if not flat:
        near = 1 / ti.max(q.z, 1e-6)
        out = ti.Vector([focal * q.x * near + half, focal * q.y * near + half, near], ti.f32)
        if q.z < NEAR:
            out.z = -1.0
    return out


@ti.func
def cover(
    c: ti.i32,
    points: ti.template(),
    triangles: ti.template(),
    views: ti.template(),
    there: ti.template(),
    near: ti.template(),
    which: ti.template(),
):
    """Find how near what is seen in each pixel of view c is, and which triangle that is; those that turn their back are
    left out."""
    eye, turn, focal, half, flat = camera(views, c)
    for i in range(points.shape[0]):
        there[i] = seen(eye, turn, focal, half, flat, points[i])
    width, end = ti.cast(2 * half, ti.i32), 2 * half
    first = c * width * width
    floor = ti.select(flat, -1e9, 0.0)  # nothing behind a camera; a lamp far away has nothing behind it
    for t in range(triangles.shape[0]):
        own = triangles[t]
        a, b, d = there[own[0]], there[own[1]], there[own[2]]
        # the first and the last middle of a pixel between the ends of the triangle: most are smaller than a pixel
        x0 = ti.cast(ti.ceil(ti.max(ti.min(a.x, b.x, d.x), 0.0) - 0.5), ti.i32)
        x1 = ti.cast(ti.min(ti.max(a.x, b.x, d.x), end) + 0.5, ti.i32) - 1
        y0 = ti.cast(ti.ceil(ti.max(ti.min(a.y, b.y, d.y), 0.0) - 0.5), ti.i32)
        y1 = ti.cast(ti.min(ti.max(a.y, b.y, d.y), end) + 0.5, ti.i32) - 1
        area = (b.x - a.x) * (d.y - a.y) - (b.y - a.y) * (d.x - a.x)
        hidden = ti.cast(x0 > x1, ti.i32) | ti.cast(y0 > y1, ti.i32) | ti.cast(area >= 0, ti.i32)
        hidden |= ti.cast(ti.min(a.z, b.z, d.z) <= floor, ti.i32)
        if hidden == 0:
            over = 1 / area
            for y in range(y0, y1 + 1):
                py = ti.cast(y, ti.f32) + 0.5
                for x in range(x0, x1 + 1):
                    px = ti.cast(x, ti.f32) + 0.5
                    lb = ((px - a.x) * (d.y - a.y) - (py - a.y) * (d.x - a.x)) * over
                    ld = ((b.x - a.x) * (py - a.y) - (b.y - a.y) * (px - a.x)) * over
                    la = 1 - lb - ld
                    if la >= 0 and lb >= 0 and ld >= 0:
                        k = first + y * width + x
                        w = la * a.z + lb * b.z + ld * d.z
                        if w > near[k]:
                            near[k] = w
                            which[k] = t


@ti.func
def shade(
    c: ti.i32,
    width: ti.i32,
    triangles: ti.template(),
    there: ti.template(),
    near: ti.template(),
    which: ti.template(),
    looks: ti.template(),
    paints: ti.template(),
    seen_as: ti.template(),
):
    """Put colour, normal and gloss of what is seen in each pixel of view c into ``seen_as``, where a triangle is."""
    for y in range(width):
        for x in range(width):
            spot = (c * width + y) * width + x
            t = which[spot]
            if t >= 0:
                own = triangles[t]
                i, j, k = own[0], own[1], own[2]
                a, b, d = there[i], there[j], there[k]
                px, py = ti.cast(x, ti.f32) + 0.5, ti.cast(y, ti.f32) + 0.5
                over = 1 / ((b.x - a.x) * (d.y - a.y) - (b.y - a.y) * (d.x - a.x))
                lb = ((px - a.x) * (d.y - a.y) - (py - a.y) * (d.x - a.x)) * over
                ld = ((b.x - a.x) * (py - a.y) - (b.y - a.y) * (px - a.x)) * over
                la = 1 - lb - ld
                far = 1 / near[spot]  # in the picture one over the distance is linear, not the place
                at = la * a.z * far * looks[i] + lb * b.z * far * looks[j] + ld * d.z * far * looks[k]
                n = ti.Vector([at[0], at[1], at[2]], ti.f32)
                n = n / ti.max(n.norm(), 1e-12)
                paint = paints[own[3]]
                kind = ti.cast(paint[0], ti.i32)
                share = ti.cast(0.0, ti.f32)
                if kind > 0:
                    place, section = ti.Vector([at[3], at[4], at[5]], ti.f32), ti.Vector([at[6], at[7]], ti.f32)
                    share = part_of_second(kind, place, section, paint[7], paint[8], paint[9])
                out = ti.Vector([0.0 for m in ti.static(range(7))], ti.f32)
                for m in ti.static(range(3)):
                    out[m] = paint[1 + m] + share * (paint[4 + m] - paint[1 + m])
                    out[3 + m] = n[m]
                out[6] = paint[10]
                seen_as[spot] = out


@ti.kernel
def draw(
    points: rows(3),
    triangles: rows(4, ti.i32),
    views: array(ti.f32, 2),
    there: rows(3),
    near: numbers,
    which: array(ti.i32, 1),
):
    """Find which triangle is seen in each pixel of each of c views.

    ``points`` (n, 3) and ``triangles`` (t, 4) are the mesh, ``views`` (c, 16) as
    :attr:`intsim.render.view.View.row` has them, and ``there`` (n, 3) is room for as many points. ``near`` and
    ``which`` (c * h * w,) are updated: how near it is, and its number.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        cover(c, points, triangles, views, there, near, which)


@ti.kernel
def see(
    points: rows(3),
    triangles: rows(4, ti.i32),
    views: array(ti.f32, 2),
    there: rows(3),
    near: numbers,
    which: array(ti.i32, 1),
    looks: rows(8),
    paints: rows(11),
    seen_as: rows(7),
):
    """Find what is seen in each pixel of each view, as :func:`draw`, and how it looks.

    The last of a triangle's four numbers is its row of ``paints``; ``looks`` (n, 8) has normal, place on the body and
    place on the section of each vertex. Colour, normal and gloss are put into ``seen_as`` (c * h * w, 7) where a
    triangle is.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        cover(c, points, triangles, views, there, near, which)
        width = ti.cast(2 * views[c, 13], ti.i32)
        shade(c, width, triangles, there, near, which, looks, paints, seen_as)


@ti.kernel
def turn_normals(points: rows(3), triangles: rows(4, ti.i32), looks: rows(8)):
    """Normals at the vertices: those of the triangles around each, by their area. The first three of ``looks`` (n, 8)
    are filled."""
    ti.loop_config(serialize=True)
    for i in range(points.shape[0]):
        for m in ti.static(range(3)):
            looks[i][m] = 0.0
    ti.loop_config(serialize=True)
    for t in range(triangles.shape[0]):
        own = triangles[t]
        i, j, k = own[0], own[1], own[2]
        n = (points[j] - points[i]).cross(points[k] - points[i]) * 1e4
        for m in ti.static(range(3)):  # one thread: an addition need not be atomic
            looks[i][m] = looks[i][m] + n[m]
            looks[j][m] = looks[j][m] + n[m]
            looks[k][m] = looks[k][m] + n[m]


@ti.func
def lamp_light(lamp: ti.template()):
    """Colours of a lamp, of the light from above and of that from below (rows), and the tolerance of its shadows."""
    colours = ti.Matrix([[lamp[1, 3 * k + m] for m in ti.static(range(3))] for k in ti.static(range(3))], ti.f32)
    return colours, lamp[1, 9]


@ti.func
def lit_parts(
    eye, turn, focal: ti.f32, half: ti.f32, to, colours, tolerance: ti.f32, y: ti.i32, x: ti.i32, w: ti.f32, look
):
    """Light of a surface in a pixel of a camera: what the lamp does not give and what it gives, three colours each;
    and a place (3,) beside it, in front of it by the tolerance. ``to`` is the direction to the lamp, ``look`` (7,) its
    colour, normal and gloss."""
    n = ti.Vector([look[3], look[4], look[5]], ti.f32)
    u = (ti.cast(x, ti.f32) + 0.5 - half) / focal
    v = (ti.cast(y, ti.f32) + 0.5 - half) / focal
    ray = ti.Vector([turn[0, m] * u + turn[1, m] * v + turn[2, m] for m in ti.static(range(3))], ti.f32)
    place = eye + ray * (1 / ti.max(w, 1e-6)) + n * tolerance
    ray = ray / ray.norm()
    face = ti.max(n.dot(to), 0.0)
    up = 0.5 + 0.5 * n.z
    rim = 0.75 + 0.25 * ti.max(-n.dot(ray), 0.0)
    bisector = to - ray
    shine = ti.max(n.dot(bisector), 0.0)
    shine = shine * shine / bisector.norm_sqr()  # Blinn (1977), to the 32nd power
    shine = shine * shine
    shine = shine * shine
    shine = shine * shine
    shine = shine * shine * look[6] * 0.5
    rest, given = ti.Vector([0.0, 0.0, 0.0], ti.f32), ti.Vector([0.0, 0.0, 0.0], ti.f32)
    for m in ti.static(range(3)):
        base = look[m] * look[m]  # the eye's scale to light, and back in the picture
        rest[m] = base * rim * (up * colours[1, m] + (1 - up) * colours[2, m])
        given[m] = (base * rim * face + shine * ti.min(face * 8, 1.0)) * colours[0, m]
        if look[6] >= GLOW:
            rest[m], given[m] = base, 0.0
    return rest, given, place


@ti.func
def colour(rest, given, lit: ti.f32):
    """The colour of a pixel, 8 bits: light as a screen shows it."""
    out = ti.Vector([0, 0, 0], ti.u8)
    for m in ti.static(range(3)):
        out[m] = ti.cast(ti.sqrt(ti.min(rest[m] + lit * given[m], 1.0)) * 255.0 + 0.5, ti.u8)
    return out


@ti.kernel
def settle(
    views: array(ti.f32, 2),
    near: numbers,
    looks: rows(7),
    lamp: array(ti.f32, 2),
    shadow: numbers,
    place: rows(3),
    fixed: rows(3, ti.u8),
):
    """The light on what does not move, for cameras that do not: the first views, as many as ``fixed`` has room for.

    Args as those of :func:`light`. The first six of ``looks`` (c * h * w, 7) are replaced by what the lamp does not
    give and what it gives; ``place`` (., 3) is filled with the place in the lamp's view, ``fixed`` (., 3) with the
    colour of a pixel on which no shadow of the scene falls.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        eye, turn, focal, half, _ = camera(views, c)
        from_lamp, to_lamp, scale, middle, flat = camera(lamp, 0)
        colours, tolerance = lamp_light(lamp)
        to = -ti.Vector([to_lamp[2, 0], to_lamp[2, 1], to_lamp[2, 2]], ti.f32)
        width, wide = ti.cast(2 * half, ti.i32), ti.cast(2 * middle, ti.i32)
        if (c + 1) * width * width <= fixed.shape[0]:
            for y in range(width):
                for x in range(width):
                    k = (c * width + y) * width + x
                    rest, given, beside = lit_parts(
                        eye, turn, focal, half, to, colours, tolerance, y, x, near[k], looks[k]
                    )
                    there = seen(from_lamp, to_lamp, scale, middle, flat, beside)
                    for m in ti.static(range(3)):
                        looks[k][m], looks[k][3 + m] = rest[m], given[m]
                    place[k] = there
                    fixed[k] = colour(rest, given, lit_at(there, shadow, wide, tolerance))


@ti.kernel
def light(
    views: array(ti.f32, 2),
    near: numbers,
    seen_as: rows(7),
    room_near: numbers,
    room_looks: rows(7),
    place: rows(3),
    fixed: rows(3, ti.u8),
    lamp: array(ti.f32, 2),
    shadow: numbers,
    out: rows(3, ti.u8),
):
    """Light what is seen: the nearer of scene and room.

    ``near`` and ``seen_as`` are as :func:`see` has filled them for c views, of the scene and of the room; for the
    cameras that stand, which come first, :func:`settle` has filled ``room_looks``, ``place`` and ``fixed``. ``lamp``
    (2, 16) is the lamp as a view, and in the second row its colour, the colour from above and from below, and the
    tolerance of a shadow [m]. ``shadow`` is how near to it is what it sees, first of the room, then of the scene.
    ``out`` (c * h * w, 3) is filled, 8 bits.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        eye, turn, focal, half, _ = camera(views, c)
        from_lamp, to_lamp, scale, middle, flat = camera(lamp, 0)
        colours, tolerance = lamp_light(lamp)
        to = -ti.Vector([to_lamp[2, 0], to_lamp[2, 1], to_lamp[2, 2]], ti.f32)
        width, wide = ti.cast(2 * half, ti.i32), ti.cast(2 * middle, ti.i32)
        stands = (c + 1) * width * width <= fixed.shape[0]
        for y in range(width):
            for x in range(width):
                k = (c * width + y) * width + x
                w, behind = near[k], room_near[k]
                own = w >= behind
                if stands and not own:
                    there = place[k]
                    if is_shaded(there, shadow, wide, tolerance):
                        look = room_looks[k]
                        rest = ti.Vector([look[0], look[1], look[2]], ti.f32)
                        given = ti.Vector([look[3], look[4], look[5]], ti.f32)
                        out[k] = colour(rest, given, lit_at(there, shadow, wide, tolerance))
                    else:
                        out[k] = fixed[k]
                else:
                    look = room_looks[k]
                    if own:
                        look = seen_as[k]
                    w = ti.max(w, behind)
                    rest, given, beside = lit_parts(eye, turn, focal, half, to, colours, tolerance, y, x, w, look)
                    there = seen(from_lamp, to_lamp, scale, middle, flat, beside)
                    out[k] = colour(rest, given, lit_at(there, shadow, wide, tolerance))


@ti.func
def is_shaded(there, shadow: ti.template(), wide: ti.i32, tolerance: ti.f32):
    """Whether a shadow of the scene falls on a place in the lamp's view, wholly or in part."""
    near = there.z + tolerance
    i, j = ti.cast(ti.floor(there.x - 0.5), ti.i32), ti.cast(ti.floor(there.y - 0.5), ti.i32)
    out = False
    if 0 <= i < wide - 1 and 0 <= j < wide - 1:
        k = (wide + j) * wide + i
        out = ti.max(ti.max(shadow[k], shadow[k + 1]), ti.max(shadow[k + wide], shadow[k + wide + 1])) > near
    return out


@ti.func
def lit_at(there, shadow: ti.template(), wide: ti.i32, tolerance: ti.f32) -> ti.f32:
    """Which part of a lamp reaches a place in its view, from 0 to 1: over four pixels of what it sees."""
    x, y, near = there.x - 0.5, there.y - 0.5, there.z + tolerance
    i, j = ti.cast(ti.floor(x), ti.i32), ti.cast(ti.floor(y), ti.i32)
    out = ti.cast(1.0, ti.f32)
    if 0 <= i < wide - 1 and 0 <= j < wide - 1:
        fx, fy = x - ti.floor(x), y - ti.floor(y)
        k, own = j * wide + i, (wide + j) * wide + i  # of the room, of the scene
        a = ti.select(ti.max(shadow[k], shadow[own]) <= near, 1.0, 0.0)
        b = ti.select(ti.max(shadow[k + 1], shadow[own + 1]) <= near, 1.0, 0.0)
        c = ti.select(ti.max(shadow[k + wide], shadow[own + wide]) <= near, 1.0, 0.0)
        d = ti.select(ti.max(shadow[k + wide + 1], shadow[own + wide + 1]) <= near, 1.0, 0.0)
        out = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
    return out
