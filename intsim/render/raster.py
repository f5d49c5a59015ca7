"""Triangles to pixels, and the light on them (Taichi, on one core).

What is seen where depends on geometry alone. It is found once (:func:`see`) and then lit by each
background's own lamp (:func:`light`), with shadows from a map of what the lamp sees (Williams 1978).
"""

import taichi as ti

from intsim.render.texture import part_of_second
from intsim.render.view import NEAR

array = ti.types.ndarray
GLOW = 2.0
"""Gloss from which on a surface shines by itself."""


@ti.func
def seen(views: ti.template(), c: ti.i32, p):
    """A point in view c: column and row [px], and how near it is: one over the distance, or less the distance."""
    d = p - ti.Vector([views[c, 0], views[c, 1], views[c, 2]], ti.f32)
    u = views[c, 3] * d.x + views[c, 4] * d.y + views[c, 5] * d.z
    v = views[c, 6] * d.x + views[c, 7] * d.y + views[c, 8] * d.z
    z = views[c, 9] * d.x + views[c, 10] * d.y + views[c, 11] * d.z
    out = ti.Vector([views[c, 12] * u + views[c, 13], views[c, 12] * v + views[c, 13], -z], ti.f32)
    if views[c, 14] == 0:
        near = 1 / ti.max(z, 1e-6)
        out = ti.Vector([views[c, 12] * u * near + views[c, 13], views[c, 12] * v * near + views[c, 13], near], ti.f32)
        if z < NEAR:
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
    """Find which triangle is seen in each pixel of view c; those that turn their back are left out."""
    flat = views[c, 14] != 0
    for i in range(points.shape[0]):
        s = seen(views, c, ti.Vector([points[i, 0], points[i, 1], points[i, 2]], ti.f32))
        for k in ti.static(range(3)):
            there[c, i, k] = s[k]
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = there[c, i, 0], there[c, i, 1], there[c, i, 2]
        bx, by, bz = there[c, j, 0], there[c, j, 1], there[c, j, 2]
        cx, cy, cz = there[c, k, 0], there[c, k, 1], there[c, k, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area < 0 and (flat or ti.min(az, bz, cz) > 0):
            x0 = ti.max(ti.cast(ti.ceil(ti.min(ax, bx, cx) - 0.5), ti.i32), 0)
            x1 = ti.min(ti.cast(ti.floor(ti.max(ax, bx, cx) - 0.5), ti.i32), near.shape[2] - 1)
            y0 = ti.max(ti.cast(ti.ceil(ti.min(ay, by, cy) - 0.5), ti.i32), 0)
            y1 = ti.min(ti.cast(ti.floor(ti.max(ay, by, cy) - 0.5), ti.i32), near.shape[1] - 1)
            over = 1 / area
            for y in range(y0, y1 + 1):
                py = ti.cast(y, ti.f32) + 0.5
                for x in range(x0, x1 + 1):
                    px = ti.cast(x, ti.f32) + 0.5
                    lb = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * over
                    lc = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * over
                    la = 1 - lb - lc
                    if la >= 0 and lb >= 0 and lc >= 0:
                        w = la * az + lb * bz + lc * cz
                        if w > near[c, y, x]:
                            near[c, y, x] = w
                            which[c, y, x] = t


@ti.kernel
def draw(
    points: array(ti.f32, 2),
    triangles: array(ti.i32, 2),
    views: array(ti.f32, 2),
    there: array(ti.f32, 3),
    near: array(ti.f32, 3),
    which: array(ti.i32, 3),
):
    """Find which triangle is seen in each pixel of each of c views.

    ``points`` (n, 3) and ``triangles`` (t, 3) are the mesh, ``views`` (c, 16) as
    :attr:`intsim.render.view.View.row` has them, and ``there`` (c, n, 3) is room for as many points. ``near`` and
    ``which`` (c, h, w) are updated: how near it
    is, and its number.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        cover(c, points, triangles, views, there, near, which)


@ti.kernel
def see(
    points: array(ti.f32, 2),
    triangles: array(ti.i32, 2),
    views: array(ti.f32, 2),
    there: array(ti.f32, 3),
    near: array(ti.f32, 3),
    which: array(ti.i32, 3),
    paint_of: array(ti.i32, 1),
    normals: array(ti.f32, 2),
    ref: array(ti.f32, 2),
    paints: array(ti.f32, 2),
    seen_as: array(ti.f32, 4),
):
    """Find what is seen in each pixel of each view, as :func:`draw`, and how it looks.

    ``paint_of`` (t,) is each triangle's row of ``paints``, ``normals`` (n, 3), ``ref`` (n, 5) the place on the body and
    on the section. Colour, normal and gloss are put into ``seen_as`` (c, h, w, 7 or more) where a triangle is.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        cover(c, points, triangles, views, there, near, which)
        for y in range(which.shape[1]):
            for x in range(which.shape[2]):
                t = which[c, y, x]
                if t >= 0:
                    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                    ax, ay, bx, by = there[c, i, 0], there[c, i, 1], there[c, j, 0], there[c, j, 1]
                    cx, cy = there[c, k, 0], there[c, k, 1]
                    px, py = ti.cast(x, ti.f32) + 0.5, ti.cast(y, ti.f32) + 0.5
                    over = 1 / ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
                    lb = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * over
                    lc = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * over
                    la = 1 - lb - lc
                    far = 1 / near[c, y, x]  # in the picture one over the distance is linear, not the place
                    la, lb, lc = la * there[c, i, 2] * far, lb * there[c, j, 2] * far, lc * there[c, k, 2] * far
                    at = ti.Vector(
                        [la * ref[i, m] + lb * ref[j, m] + lc * ref[k, m] for m in ti.static(range(5))], ti.f32
                    )
                    n = ti.Vector(
                        [la * normals[i, m] + lb * normals[j, m] + lc * normals[k, m] for m in ti.static(range(3))],
                        ti.f32,
                    )
                    n = n / ti.max(n.norm(), 1e-12)
                    p = paint_of[t]
                    kind = ti.cast(paints[p, 0], ti.i32)
                    share = ti.cast(0.0, ti.f32)
                    if kind > 0:
                        place, section = ti.Vector([at[0], at[1], at[2]], ti.f32), ti.Vector([at[3], at[4]], ti.f32)
                        share = part_of_second(kind, place, section, paints[p, 7], paints[p, 8], paints[p, 9])
                    for m in ti.static(range(3)):
                        seen_as[c, y, x, m] = paints[p, 1 + m] + share * (paints[p, 4 + m] - paints[p, 1 + m])
                        seen_as[c, y, x, 3 + m] = n[m]
                    seen_as[c, y, x, 6] = paints[p, 10]


@ti.kernel
def turn_normals(points: array(ti.f32, 2), triangles: array(ti.i32, 2), normals: array(ti.f32, 2)):
    """Normals at the vertices: those of the triangles around each, by their area. ``normals`` (n, 3) is filled."""
    ti.loop_config(serialize=True)
    for i in range(points.shape[0]):
        for k in ti.static(range(3)):
            normals[i, k] = 0.0
    ti.loop_config(serialize=True)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        a = ti.Vector([points[i, 0], points[i, 1], points[i, 2]], ti.f32)
        b = ti.Vector([points[j, 0], points[j, 1], points[j, 2]], ti.f32)
        c = ti.Vector([points[k, 0], points[k, 1], points[k, 2]], ti.f32)
        n = (b - a).cross(c - a) * 1e4
        for m in ti.static(range(3)):
            normals[i, m] += n[m]
            normals[j, m] += n[m]
            normals[k, m] += n[m]


@ti.func
def lit_parts(
    views: ti.template(), c: ti.i32, lamp: ti.template(), lamps: ti.template(), y: ti.i32, x: ti.i32, w: ti.f32, look
):
    """Light of a surface: what the lamp does not give and what it gives, three colours each; and its place in the
    lamp's view (3,). ``look`` (7,) is its colour, normal and gloss."""
    n = ti.Vector([look[3], look[4], look[5]], ti.f32)
    to = -ti.Vector([lamp[0, 9], lamp[0, 10], lamp[0, 11]], ti.f32)
    u = (ti.cast(x, ti.f32) + 0.5 - views[c, 13]) / views[c, 12]
    v = (ti.cast(y, ti.f32) + 0.5 - views[c, 13]) / views[c, 12]
    ray = ti.Vector([views[c, 3 + m] * u + views[c, 6 + m] * v + views[c, 9 + m] for m in ti.static(range(3))], ti.f32)
    far = 1 / ti.max(w, 1e-6)
    place = ti.Vector([views[c, 0], views[c, 1], views[c, 2]], ti.f32) + ray * far + n * lamps[9]
    there = seen(lamp, 0, place)
    ray = ray / ray.norm()
    face = ti.max(n.dot(to), 0.0)
    up = 0.5 + 0.5 * n.z
    rim = 0.75 + 0.25 * ti.max(-n.dot(ray), 0.0)
    half = to - ray
    shine = ti.max(n.dot(half), 0.0) ** 2 / half.norm_sqr()  # Blinn (1977), to the 32nd power
    shine = shine * shine
    shine = shine * shine
    shine = shine * shine
    shine = shine * shine * look[6] * 0.5
    rest, given = ti.Vector([0.0, 0.0, 0.0], ti.f32), ti.Vector([0.0, 0.0, 0.0], ti.f32)
    for m in ti.static(range(3)):
        base = look[m] * look[m]  # the eye's scale to light, and back in the picture
        rest[m] = base * rim * (up * lamps[3 + m] + (1 - up) * lamps[6 + m])
        given[m] = (base * rim * face + shine * ti.min(face * 8, 1.0)) * lamps[m]
        if look[6] >= GLOW:
            rest[m], given[m] = base, 0.0
    return rest, given, there


@ti.kernel
def settle(
    views: array(ti.f32, 2),
    near: array(ti.f32, 3),
    room: array(ti.f32, 4),
    lamp: array(ti.f32, 2),
    lamps: array(ti.f32, 1),
):
    """The light on what does not move, for cameras that do not.

    Args as those of :func:`light`; colour, normal and gloss in ``room`` (c, h, w, 9) are replaced by what the lamp does
    not give, what it gives, and the place in its view.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        for y in range(near.shape[1]):
            for x in range(near.shape[2]):
                if views[c, 15] != 0:
                    look = ti.Vector([room[c, y, x, m] for m in ti.static(range(7))], ti.f32)
                    rest, given, there = lit_parts(views, c, lamp, lamps, y, x, near[c, y, x], look)
                    for m in ti.static(range(3)):
                        room[c, y, x, m] = rest[m]
                        room[c, y, x, 3 + m] = given[m]
                        room[c, y, x, 6 + m] = there[m]


@ti.kernel
def light(
    views: array(ti.f32, 2),
    near: array(ti.f32, 3),
    seen_as: array(ti.f32, 4),
    room_near: array(ti.f32, 3),
    room: array(ti.f32, 4),
    lamp: array(ti.f32, 2),
    shadow: array(ti.f32, 3),
    lamps: array(ti.f32, 1),
    out: array(ti.u8, 4),
):
    """Light what is seen: the nearer of scene and room.

    ``near`` and ``seen_as`` are as :func:`see` has filled them for c views, of scene and room; for a camera that stands
    ``room`` is what :func:`settle` has made of that. ``lamp`` (1, 16) is the lamp as a view and ``shadow`` (1, ., .)
    how near to it what it sees is; ``lamps`` (10,) its colour, the colour from above and from below, and the tolerance
    of a shadow [m]. ``out`` (c, h, w, 3) is filled, 8 bits.
    """
    ti.loop_config(serialize=True)
    for c in range(views.shape[0]):
        for y in range(near.shape[1]):
            for x in range(near.shape[2]):
                rest, given = ti.Vector([0.0, 0.0, 0.0], ti.f32), ti.Vector([0.0, 0.0, 0.0], ti.f32)
                there = ti.Vector([0.0, 0.0, 0.0], ti.f32)
                own = near[c, y, x] >= room_near[c, y, x]
                if not own and views[c, 15] != 0:
                    rest = ti.Vector([room[c, y, x, m] for m in ti.static(range(3))], ti.f32)
                    given = ti.Vector([room[c, y, x, 3 + m] for m in ti.static(range(3))], ti.f32)
                    there = ti.Vector([room[c, y, x, 6 + m] for m in ti.static(range(3))], ti.f32)
                else:
                    look = ti.Vector([room[c, y, x, m] for m in ti.static(range(7))], ti.f32)
                    if own:
                        look = ti.Vector([seen_as[c, y, x, m] for m in ti.static(range(7))], ti.f32)
                    w = ti.max(near[c, y, x], room_near[c, y, x])
                    rest, given, there = lit_parts(views, c, lamp, lamps, y, x, w, look)
                lit = lit_at(there, shadow, lamps[9])
                for m in ti.static(range(3)):
                    shade = ti.sqrt(ti.min(rest[m] + lit * given[m], 1.0))
                    out[c, y, x, m] = ti.cast(shade * 255.0 + 0.5, ti.u8)


@ti.func
def lit_at(there, shadow: ti.template(), tolerance: ti.f32) -> ti.f32:
    """Which part of a lamp reaches a place in its view, from 0 to 1: over four pixels of what it sees."""
    x, y, near = there.x - 0.5, there.y - 0.5, there.z + tolerance
    i, j = ti.cast(ti.floor(x), ti.i32), ti.cast(ti.floor(y), ti.i32)
    out = ti.cast(1.0, ti.f32)
    if 0 <= i < shadow.shape[2] - 1 and 0 <= j < shadow.shape[1] - 1:
        fx, fy = x - ti.floor(x), y - ti.floor(y)
        a = ti.select(shadow[0, j, i] <= near, 1.0, 0.0)
        b = ti.select(shadow[0, j, i + 1] <= near, 1.0, 0.0)
        c = ti.select(shadow[0, j + 1, i] <= near, 1.0, 0.0)
        d = ti.select(shadow[0, j + 1, i + 1] <= near, 1.0, 0.0)
        out = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
    return out
