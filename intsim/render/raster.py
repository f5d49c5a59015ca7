"""Triangles to pixels, and the light on them (Taichi, on one core).

What is seen where depends on geometry alone. It is found once (:func:`draw`, :func:`resolve`) and then lit by each
background's own lamp (:func:`light`), with shadows from a map of what the lamp sees (Williams 1978).
"""

import taichi as ti

from intsim.render.texture import part_of_second
from intsim.render.view import NEAR

array = ti.types.ndarray
GLOW = 2.0
"""Gloss from which on a surface shines by itself."""


@ti.func
def seen(view: ti.template(), p):
    """A point in a view: column and row [px], and how near it is: one over the distance, or less the distance."""
    d = p - ti.Vector([view[0], view[1], view[2]], ti.f32)
    q = ti.Vector([view[3] * d.x + view[4] * d.y + view[5] * d.z, view[6] * d.x + view[7] * d.y + view[8] * d.z], ti.f32)
    z = view[9] * d.x + view[10] * d.y + view[11] * d.z
    out = ti.Vector([view[12] * q.x + view[13], view[12] * q.y + view[13], -z], ti.f32)
    if view[14] == 0:
        near = 1 / ti.max(z, 1e-6)
        out = ti.Vector([view[12] * q.x * near + view[13], view[12] * q.y * near + view[13], near], ti.f32)
        if z < NEAR:
            out.z = -1.0
    return out


@ti.kernel
def draw(
    points: array(ti.f32, 2),
    triangles: array(ti.i32, 2),
    view: array(ti.f32, 1),
    there: array(ti.f32, 2),
    near: array(ti.f32, 2),
    which: array(ti.i32, 2),
):
    """Find which triangle is seen in each pixel.

    ``there`` is room for as many rows as points; ``near`` and ``which`` (h, w) are updated: how near it is, and its
    number. Triangles that turn their back are left out.
    """
    flat = view[14] != 0
    ti.loop_config(serialize=True)
    for i in range(points.shape[0]):
        s = seen(view, ti.Vector([points[i, 0], points[i, 1], points[i, 2]], ti.f32))
        for k in ti.static(range(3)):
            there[i, k] = s[k]
    ti.loop_config(serialize=True)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = there[i, 0], there[i, 1], there[i, 2]
        bx, by, bz = there[j, 0], there[j, 1], there[j, 2]
        cx, cy, cz = there[k, 0], there[k, 1], there[k, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area < 0 and (flat or ti.min(az, bz, cz) > 0):
            x0 = ti.max(ti.cast(ti.ceil(ti.min(ax, bx, cx) - 0.5), ti.i32), 0)
            x1 = ti.min(ti.cast(ti.floor(ti.max(ax, bx, cx) - 0.5), ti.i32), near.shape[1] - 1)
            y0 = ti.max(ti.cast(ti.ceil(ti.min(ay, by, cy) - 0.5), ti.i32), 0)
            y1 = ti.min(ti.cast(ti.floor(ti.max(ay, by, cy) - 0.5), ti.i32), near.shape[0] - 1)
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
                        if w > near[y, x]:
                            near[y, x] = w
                            which[y, x] = t


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


@ti.kernel
def resolve(
    which: array(ti.i32, 2),
    near: array(ti.f32, 2),
    view: array(ti.f32, 1),
    there: array(ti.f32, 2),
    triangles: array(ti.i32, 2),
    paint_of: array(ti.i32, 1),
    normals: array(ti.f32, 2),
    ref: array(ti.f32, 2),
    paints: array(ti.f32, 2),
    seen_as: array(ti.f32, 3),
):
    """Colour, normal and gloss of what is seen in each pixel; ``seen_as`` (h, w, 7) is filled where a triangle is.

    ``paint_of`` (t,) is each triangle's row of ``paints``, ``normals`` (n, 3), ``ref`` (n, 5) the place on the body and
    on the section. A triangle whose paint has its last number set is flat: it has a normal of its own.
    """
    ti.loop_config(serialize=True)
    for y in range(which.shape[0]):
        for x in range(which.shape[1]):
            t = which[y, x]
            if t >= 0:
                i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                ax, ay, bx, by = there[i, 0], there[i, 1], there[j, 0], there[j, 1]
                cx, cy = there[k, 0], there[k, 1]
                px, py = ti.cast(x, ti.f32) + 0.5, ti.cast(y, ti.f32) + 0.5
                over = 1 / ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
                lb = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * over
                lc = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * over
                la = 1 - lb - lc
                if view[14] == 0:  # in the picture one over the distance is linear
                    la *= there[i, 2] / near[y, x]
                    lb *= there[j, 2] / near[y, x]
                    lc *= there[k, 2] / near[y, x]
                place = ti.Vector([la * ref[i, m] + lb * ref[j, m] + lc * ref[k, m] for m in ti.static(range(3))], ti.f32)
                section = ti.Vector([la * ref[i, m] + lb * ref[j, m] + lc * ref[k, m] for m in ti.static((3, 4))], ti.f32)
                n = ti.Vector([la * normals[i, m] + lb * normals[j, m] + lc * normals[k, m] for m in ti.static(range(3))], ti.f32)
                n = n / ti.max(n.norm(), 1e-12)
                p = paint_of[t]
                kind = ti.cast(paints[p, 0], ti.i32)
                share = 0.0
                if kind > 0:
                    share = part_of_second(kind, place, section, paints[p, 7], paints[p, 8], paints[p, 9])
                for m in ti.static(range(3)):
                    seen_as[y, x, m] = paints[p, 1 + m] + share * (paints[p, 4 + m] - paints[p, 1 + m])
                    seen_as[y, x, 3 + m] = n[m]
                seen_as[y, x, 6] = paints[p, 10]


@ti.func
def lit_parts(view: ti.template(), lamp: ti.template(), lamps: ti.template(), y: ti.i32, x: ti.i32, w: ti.f32, look):
    """Light of a surface: what the lamp does not give and what it gives, three colours each; and its place in the lamp's
    view (3,). ``look`` (7,) is its colour, normal and gloss."""
    n = ti.Vector([look[3], look[4], look[5]], ti.f32)
    to = -ti.Vector([lamp[9], lamp[10], lamp[11]], ti.f32)
    u = (ti.cast(x, ti.f32) + 0.5 - view[13]) / view[12]
    v = (ti.cast(y, ti.f32) + 0.5 - view[13]) / view[12]
    ray = ti.Vector([view[3 + m] * u + view[6 + m] * v + view[9 + m] for m in ti.static(range(3))], ti.f32)
    far = 1 / ti.max(w, 1e-6)
    place = ti.Vector([view[0], view[1], view[2]], ti.f32) + ray * far + n * lamps[9]
    there = seen(lamp, place)
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
    view: array(ti.f32, 1),
    near: array(ti.f32, 2),
    seen_as: array(ti.f32, 3),
    lamp: array(ti.f32, 1),
    lamps: array(ti.f32, 1),
    settled: array(ti.f32, 3),
):
    """The light on what does not move, for a camera that does not.

    Args as those of :func:`light`; ``settled`` (h, w, 9) is filled with what the lamp does not give, what it gives, and
    the place in its view.
    """
    ti.loop_config(serialize=True)
    for y in range(near.shape[0]):
        for x in range(near.shape[1]):
            look = ti.Vector([seen_as[y, x, m] for m in ti.static(range(7))], ti.f32)
            rest, given, there = lit_parts(view, lamp, lamps, y, x, near[y, x], look)
            for m in ti.static(range(3)):
                settled[y, x, m] = rest[m]
                settled[y, x, 3 + m] = given[m]
                settled[y, x, 6 + m] = there[m]


@ti.kernel
def light(
    view: array(ti.f32, 1),
    near: array(ti.f32, 2),
    seen_as: array(ti.f32, 3),
    room_near: array(ti.f32, 2),
    room: array(ti.f32, 3),
    lamp: array(ti.f32, 1),
    shadow: array(ti.f32, 2),
    lamps: array(ti.f32, 1),
    standing: ti.i32,
    out: array(ti.u8, 3),
):
    """Light what is seen: the nearer of scene and room.

    ``near`` and ``seen_as`` are as :func:`resolve` has filled them, of scene and room; for a camera that is ``standing``
    ``room`` is what :func:`settle` has made of that. ``lamp`` is the lamp as a view and ``shadow`` how near to it what
    it sees is; ``lamps`` (10,) its colour, the colour from above and from below, and the tolerance of a shadow [m].
    ``out`` (h, w, 3) is filled, 8 bits.
    """
    ti.loop_config(serialize=True)
    for y in range(near.shape[0]):
        for x in range(near.shape[1]):
            rest, given = ti.Vector([0.0, 0.0, 0.0], ti.f32), ti.Vector([0.0, 0.0, 0.0], ti.f32)
            there = ti.Vector([0.0, 0.0, 0.0], ti.f32)
            if near[y, x] >= room_near[y, x]:
                look = ti.Vector([seen_as[y, x, m] for m in ti.static(range(7))], ti.f32)
                rest, given, there = lit_parts(view, lamp, lamps, y, x, near[y, x], look)
            elif standing == 1:
                rest = ti.Vector([room[y, x, m] for m in ti.static(range(3))], ti.f32)
                given = ti.Vector([room[y, x, 3 + m] for m in ti.static(range(3))], ti.f32)
                there = ti.Vector([room[y, x, 6 + m] for m in ti.static(range(3))], ti.f32)
            else:
                look = ti.Vector([room[y, x, m] for m in ti.static(range(7))], ti.f32)
                rest, given, there = lit_parts(view, lamp, lamps, y, x, room_near[y, x], look)
            lit = lit_at(there, shadow, lamps[9])
            for m in ti.static(range(3)):
                c = ti.sqrt(ti.min(rest[m] + lit * given[m], 1.0))
                out[y, x, m] = ti.cast(c * 255.0 + 0.5, ti.u8)


@ti.func
def lit_at(there, shadow: ti.template(), tolerance: ti.f32) -> ti.f32:
    """Which part of a lamp reaches a place in its view, from 0 to 1: over four pixels of what it sees."""
    x, y, near = there.x - 0.5, there.y - 0.5, there.z + tolerance
    i, j = ti.cast(ti.floor(x), ti.i32), ti.cast(ti.floor(y), ti.i32)
    out = ti.cast(1.0, ti.f32)
    if 0 <= i < shadow.shape[1] - 1 and 0 <= j < shadow.shape[0] - 1:
        fx, fy = x - ti.floor(x), y - ti.floor(y)
        a = ti.select(shadow[j, i] <= near, 1.0, 0.0)
        b = ti.select(shadow[j, i + 1] <= near, 1.0, 0.0)
        c = ti.select(shadow[j + 1, i] <= near, 1.0, 0.0)
        d = ti.select(shadow[j + 1, i + 1] <= near, 1.0, 0.0)
        out = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
    return out
