"""Colours of surfaces as functions of the place on them: grain, tiles, skins and cut faces of foods (Taichi)."""

import taichi as ti

PLAIN, WOOD, TILES, SPECKLED, SKIN, SPOTTED, STRIPED, FLESH, CITRUS, SEEDED = range(10)
"""Kinds of surface. A paint is one of them with two colours and five numbers, see :class:`intsim.render.mesh.Paint`."""


@ti.func
def hashed(x: ti.i32, y: ti.i32, z: ti.i32) -> ti.f32:
    """A number from 0 to 1 for a corner of a lattice, always the same."""
    h = ti.cast(x, ti.u32) * ti.u32(374761393) + ti.cast(y, ti.u32) * ti.u32(668265263)
    h += ti.cast(z, ti.u32) * ti.u32(2147483647)
    h = (h ^ (h >> 13)) * ti.u32(1274126177)
    return ti.cast((h ^ (h >> 16)) & ti.u32(0xFFFF), ti.f32) / 65535.0


@ti.func
def noise(p) -> ti.f32:
    """Smooth noise from 0 to 1, its lattice of unit width (value noise, Perlin 1985)."""
    i = ti.floor(p, ti.i32)
    f = p - ti.floor(p)
    f = f * f * (3 - 2 * f)
    out = 0.0
    for k in ti.static(range(8)):
        dx, dy, dz = ti.static(k & 1, (k >> 1) & 1, k >> 2)
        part = (f.x if ti.static(dx == 1) else 1 - f.x) * (f.y if ti.static(dy == 1) else 1 - f.y)
        part *= f.z if ti.static(dz == 1) else 1 - f.z
        out += part * hashed(i.x + dx, i.y + dy, i.z + dz)
    return out


@ti.func
def step(low: ti.f32, high: ti.f32, x: ti.f32) -> ti.f32:
    """From 0 at ``low`` to 1 at ``high``, straight."""
    return ti.min(ti.max((x - low) / (high - low), 0.0), 1.0)


@ti.func
def dotted(p, share: ti.f32) -> ti.f32:
    """1 in dots, one in a part of the cells of unit width, 0 elsewhere."""
    i = ti.floor(p, ti.i32)
    off = p - ti.floor(p) - 0.5
    there = hashed(i.x, i.y, i.z)
    return ti.select(there < share, 1 - step(0.12, 0.3, off.norm()), 0.0)


@ti.func
def part_of_second(kind: ti.i32, ref, section, a: ti.f32, b: ti.f32, c: ti.f32) -> ti.f32:
    """How much of a paint's second colour is seen at a place [-].

    ``ref`` is the place on the body [m], of a food from its middle: along the blade, along its axis, up. ``section`` is
    the place on a cut face over half its width and half its height. ``a`` is the paint's scale [1/m] or count, ``b``
    and ``c`` are parts.
    """
    out = 0.0
    if kind == WOOD:  # long grains along y, in planks b wide
        plank = ti.floor(ref.x * b)
        out = noise(ti.Vector([ref.x * a, ref.y * a * 0.06 + 7 * plank, ref.z * a])) * 0.75
        out += 0.25 * hashed(ti.cast(plank, ti.i32), 3, 5)
        seam = ref.x * b - plank
        out = ti.select(ti.min(seam, 1 - seam) < c, 1.0, out)
    elif kind == TILES:  # squares with joints
        u = ref * a + 0.01
        cell = u - ti.floor(u)
        gap = ti.min(ti.min(ti.min(cell.x, 1 - cell.x), ti.min(cell.y, 1 - cell.y)), ti.min(cell.z, 1 - cell.z))
        out = ti.select(gap < b, 1.0, c * hashed(*ti.floor(u, ti.i32)))
    elif kind == SPECKLED:
        out = b * noise(ref * a) + c * noise(ref * (a * 7))
    elif kind == SKIN:
        out = b * noise(ref * a) + c * step(0.55, 0.75, noise(ref * (a * 0.3) + 11))
    elif kind == SPOTTED:
        out = ti.max(dotted(ref * a, b), c * noise(ref * (a * 0.35)))
    elif kind == STRIPED:  # from end to end, a of them
        angle = ti.atan2(section.y, section.x)
        wave = ti.sin(angle * a + 2.5 * noise(ref * 60))
        out = step(b - 0.25, b + 0.25, wave) * 0.9 + c * noise(ref * 150)
    else:  # a cut face
        r = section.norm()
        angle = ti.atan2(section.y, section.x) * 0.15915494
        out = 0.25 * noise(ref * 350)
        if kind == CITRUS:  # segments between walls, and a white rim
            part = angle * a - ti.floor(angle * a)
            wall = ti.min(part, 1 - part) * r
            out = ti.max(ti.max(1 - step(0.02, 0.05, wall), step(b, b + 0.05, r)), out * 0.6)
            out = ti.max(out, 1 - step(0.06, 0.1, r))
        elif kind == SEEDED:  # a ring of seeds at radius b, c of it wide
            part = angle * a - ti.floor(angle * a) - 0.5
            away = ti.sqrt((part / a * 6.28 * b) ** 2 + ((r - b) * 0.6) ** 2)
            out = ti.max(1 - step(c * 0.7, c, away), out)
        elif kind == FLESH:  # paler to a core of radius b
            out = ti.max(out, c * (1 - step(b * 0.8, b, r)))
    return ti.min(ti.max(out, 0.0), 1.0)
