"""Procedural kitchens: furniture, materials, clutter and lamps, drawn from a number; for the eye only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intsim.render.background import PLASTICS, STONES, WOODS, Background, beside
from intsim.render.background import WALLS as WALL_COLOURS
from intsim.render.mesh import Drawn, Paint, box, lathe
from intsim.render.texture import PLAIN, SPECKLED, TILES, WOOD
from intsim.task.targets import BOARD_SIZE, Item
from intsim.task.targets import BOARD_THICKNESS as THICKNESS

COUNTER = ((-0.85, -0.95), (0.45, 0.95))  # corners of the worktop, x and y [m]
FLOOR = -0.9  # height of the floor [m], the board's top being at 0
WALLS = (-1.5, 1.6)  # places of the wall behind the robot (x) and of that at its left (y) [m]
REACH = 3.0  # how far walls and floor go [m]
KEEP_CLEAR = (
    0.32,
    0.48,
)  # part of the worktop, from the middle of the board along x and y, on which nothing stands [m]
CLUTTER_TRIES = 60
MIN_CLEAR, MOST_ON_BOARD = 0.13, 4  # around the food that is cut [m], and things on the board at most


@dataclass(frozen=True, eq=False)
class Kitchen:
    """What is around robot and food before one background.

    Attributes:
        drawn: Board, worktop and what stands about, which cast shadows; where it is in the world [m].
        around: Walls and furniture, which are too far away for it.
        lamp: Direction in which the lamp shines, shape (3,).
        lamps: Colour of the lamp, and of the light from above and from below, shape (9,).
        standing: Places and radii x, y, r [m] of what stands on the worktop, shape (n, 3).
    """

    drawn: Drawn
    around: Drawn
    lamp: np.ndarray
    lamps: np.ndarray
    standing: np.ndarray

    @staticmethod
    def of(number: int) -> Kitchen:
        """The kitchen of a background.

        Raises:
            TaskError: There is none of this number.
        """
        look, rng = Background.of(number), np.random.default_rng([number, 0x6B17])
        parts = [*_board(look, rng), *_worktop(look, rng)]
        around = Drawn.all([*_walls(look, rng), *_cupboards(look, rng)])
        things, standing = _clutter(rng)
        warm = rng.uniform(-1.0, 1.0)
        tint = np.array([1.0 + 0.12 * warm, 1.0, 1.0 - 0.18 * warm])
        sky = np.array([1.0 - 0.06 * warm, 1.0, 1.0 + 0.08 * warm])
        lamps = np.concatenate([look.strength * tint, 1.3 * look.ambient * sky, 0.6 * look.ambient * look.table])
        lamp = look.direction / np.linalg.norm(look.direction)
        return Kitchen(Drawn.all([*parts, *things]), around, lamp, lamps, standing)


def _shade(colour: np.ndarray, by: float) -> tuple[float, float, float]:
    """A colour, darker or lighter."""
    r, g, b = np.clip(np.asarray(colour) * by, 0.02, 0.98)
    return float(r), float(g), float(b)


def _material(colour: np.ndarray, rng: np.random.Generator, kinds: tuple[int, ...], gloss: float) -> Paint:
    """Wood where the colour is one of wood; else stone, tiles or paint of that colour."""
    kind = WOOD if colour[0] > colour[1] > colour[2] > colour[0] - 0.45 and colour[0] - colour[2] > 0.15 else PLAIN
    if kind != WOOD:
        kind = int(kinds[rng.integers(len(kinds))])
    other = _shade(colour, float(rng.uniform(0.6, 0.85)))
    first = _shade(colour, 1.0)
    if kind == WOOD:
        return Paint(first, other, WOOD, float(rng.uniform(60, 140)), float(rng.uniform(6, 14)), 0.02, gloss)
    if kind == TILES:
        grout = _shade(np.full(3, 0.8), float(rng.uniform(0.5, 1.1)))
        return Paint(first, grout, TILES, float(rng.uniform(6, 14)), 0.05, float(rng.uniform(0.0, 0.3)), gloss)
    if kind == SPECKLED:
        return Paint(first, other, SPECKLED, float(rng.uniform(8, 40)), 0.6, 0.5, gloss)
    return Paint(first, gloss=gloss)


def _board(look: Background, rng: np.random.Generator) -> list[Drawn]:
    """The cutting board, its top at z = 0."""
    x, y = (s / 2 for s in BOARD_SIZE)
    paint = _material(look.board, rng, (PLAIN,), 0.15)
    return [box((-x, -y, -THICKNESS), (x, y, 0.0), paint)]


def _worktop(look: Background, rng: np.random.Generator) -> list[Drawn]:
    """The worktop that board and robot stand on, with the cupboards' fronts below."""
    (x0, y0), (x1, y1) = COUNTER
    kind = (PLAIN,) if look.number == 0 else (SPECKLED, SPECKLED, PLAIN, TILES)
    top = _material(look.table, rng, kind, float(rng.uniform(0.1, 0.6)))
    front = _material(_front(rng), rng, (PLAIN,), 0.2)
    foot = box((-0.76, -0.14, -THICKNESS), (-0.47, 0.14, 0.0), Paint((0.25, 0.25, 0.27), gloss=0.2))
    return [
        box((x0, y0, -THICKNESS - 0.04), (x1, y1, -THICKNESS), top),
        box((x0, y0 + 0.02, FLOOR), (x1 - 0.03, y1 - 0.02, -THICKNESS - 0.04), front),
        foot,
    ]


def _walls(look: Background, rng: np.random.Generator) -> list[Drawn]:
    """Floor and walls, their lower part tiled in some kitchens."""
    x, y = WALLS
    floor = _material(beside(rng, (*WOODS, *STONES)), rng, (TILES, SPECKLED), 0.1)
    wall = Paint(_shade(look.wall, 1.0))
    low = _material(look.wall * 0.95, rng, (TILES, TILES, PLAIN), 0.4)
    out = [
        box((x - 0.1, -REACH, FLOOR - 0.05), (REACH, y + 0.1, FLOOR), floor),
        box((x - 0.1, -REACH, FLOOR), (x, y + 0.1, 2.2), wall),
        box((x, y, FLOOR), (REACH, y + 0.1, 2.2), wall),
        box((REACH, -REACH, FLOOR), (REACH + 0.1, y + 0.1, 2.2), wall),
        box((x, -REACH - 0.1, FLOOR), (REACH, -REACH, 2.2), wall),
        box((x, -REACH, FLOOR), (x + 0.01, y, 0.55), low),
    ]
    if rng.random() < 0.6:  # a window
        at = float(rng.uniform(-0.8, 0.6))
        out.append(box((x, at - 0.45, 0.25), (x + 0.03, at + 0.45, 1.2), Paint((0.95, 0.96, 0.94))))
        out.append(box((x + 0.02, at - 0.41, 0.29), (x + 0.035, at - 0.01, 1.16), Paint((0.86, 0.93, 1.0), gloss=2.0)))
        out.append(box((x + 0.02, at + 0.01, 0.29), (x + 0.035, at + 0.41, 1.16), Paint((0.86, 0.93, 1.0), gloss=2.0)))
    return out


def _cupboards(look: Background, rng: np.random.Generator) -> list[Drawn]:
    """Cupboards along both walls, with doors and handles, a refrigerator or a shelf among them."""
    x, y = WALLS
    paint = _material(_front(rng), rng, (PLAIN,), 0.25)
    top = _material(look.table, rng, (SPECKLED, PLAIN), 0.3)
    steel = Paint((0.75, 0.76, 0.78), gloss=0.8)
    out = []
    wide = float(rng.uniform(0.4, 0.7))
    for k, at in enumerate(np.arange(-2.4, y - wide, wide)):
        out.append(box((x, at + 0.005, FLOOR), (x + 0.45, at + wide - 0.005, -0.06), paint))
        hold = at + (0.06 if k % 2 else wide - 0.08)
        out.append(box((x + 0.45, hold, -0.3), (x + 0.47, hold + 0.02, -0.16), steel))
    out.append(box((x, -2.4, -0.06), (x + 0.48, y, -0.02), top))
    tall = float(rng.uniform(0.7, 1.1))
    if rng.random() < 0.6:
        at = float(rng.uniform(0.5, 1.6))
        white = Paint(_shade(np.array([0.9, 0.9, 0.88]), float(rng.uniform(0.5, 1.05))), gloss=0.4)
        out.append(box((at, y - 0.6, FLOOR), (at + 0.6, y, tall), white))
        out.append(box((at + 0.05, y - 0.63, FLOOR + 0.9), (at + 0.08, y - 0.6, tall - 0.1), steel))
    for k in range(int(rng.integers(2, 6))):  # along the wall at the robot's left
        at = -1.4 + 0.6 * k
        out.append(box((at + 0.005, y - 0.45, FLOOR), (at + 0.595, y, -0.06), paint))
        out.append(box((at + 0.04, y - 0.47, -0.2), (at + 0.2, y - 0.45, -0.18), steel))
    return out


def _front(rng: np.random.Generator) -> np.ndarray:
    """A colour of cupboards."""
    return beside(rng, (*WOODS, *PLASTICS, *WALL_COLOURS))


def _colour(rng: np.random.Generator) -> np.ndarray:
    """A colour of a thing."""
    base = rng.uniform(0.25, 0.9)
    return np.clip(base + rng.uniform(-0.18, 0.18, 3) * np.array([1.0, 0.6, 1.2]), 0.08, 0.95)


def _clutter(rng: np.random.Generator) -> tuple[list[Drawn], np.ndarray]:
    """What stands about: on the worktop beside the board, and along the wall behind the robot."""
    out: list[Drawn] = []
    standing: list[list[float]] = []
    makers = (_bottle, _bowl, _pot, _jar, _cloth, _mug)
    count = int(rng.integers(4, 9))
    for _ in range(CLUTTER_TRIES):
        if len(standing) == count:
            break
        thing, radius = makers[rng.integers(len(makers))](rng)
        (x0, y0), (x1, y1) = COUNTER
        at = np.array([rng.uniform(x0 + radius, x1 - radius), rng.uniform(y0 + radius, y1 - radius)])
        beside = any(abs(place) > keep + radius for place, keep in zip(at, KEEP_CLEAR, strict=True))
        arm = at[0] < 0.1 and abs(at[1]) < 0.3 + radius  # where the arm reaches over
        view = (at[0] > 0.1 and abs(at[1]) < 0.3 + radius) or (at[1] < 0 and abs(at[0]) < 0.3)  # before a camera
        apart = all(np.hypot(*(at - other[:2])) > radius + other[2] + 0.02 for other in standing)
        if beside and apart and not arm and not view:
            out.append(thing.moved((float(at[0]), float(at[1]), -THICKNESS), float(rng.uniform(0, 2 * np.pi))))
            standing.append([*at, radius])
    for place in np.arange(-1.2, 1.2, 0.3):
        if rng.random() < 0.6:
            thing, _ = makers[rng.integers(4)](rng)
            out.append(thing.moved((WALLS[0] + 0.2, float(place + rng.uniform(-0.08, 0.08)), -0.02)))
    return out, np.array(standing).reshape(-1, 3)


def board_clutter(items: Sequence[Item], seed: int) -> list[Drawn]:
    """What lies on the board beside the foods of an episode: crumbs, leaves, a spoon or a small bowl; or nothing.

    Args:
        items: The foods, the first of which is cut: nothing lies where blade and arm come.
        seed: Of the episode.
    """
    rng, out = np.random.default_rng([seed, 0xC1A7]), []
    reach = [
        max(math.hypot(item.shape.length, item.shape.width) / 2, MIN_CLEAR * (k == 0)) for k, item in enumerate(items)
    ]
    taken = [(item.x, item.y, r) for item, r in zip(items, reach, strict=True)]
    for _ in range(int(rng.integers(0, MOST_ON_BOARD + 1))):
        thing, radius = (_leaf, _crumb, _spoon, _dish)[rng.integers(4)](rng)
        x0, y0 = (float(rng.uniform(-size / 2 + radius, size / 2 - radius)) for size in BOARD_SIZE)
        if all(math.hypot(x0 - x, y0 - y) > radius + r for x, y, r in taken):
            out.append(thing.moved((x0, y0, 0.0), float(rng.uniform(0, 2 * np.pi))))
            taken.append((x0, y0, radius))
    return out


def _leaf(rng: np.random.Generator) -> tuple[Drawn, float]:
    r = float(rng.uniform(0.008, 0.018))
    green = _shade(np.array([0.25, 0.5, 0.18]), float(rng.uniform(0.7, 1.3)))
    return lathe([(r, 0.0), (0.7 * r, 0.004), (0.0, 0.005)], Paint(green), 7), r


def _crumb(rng: np.random.Generator) -> tuple[Drawn, float]:
    r = float(rng.uniform(0.004, 0.01))
    return lathe([(r, 0.0), (0.8 * r, r), (0.0, 1.3 * r)], Paint(_shade(_colour(rng), 1.0)), 6), r


def _spoon(rng: np.random.Generator) -> tuple[Drawn, float]:
    steel = Paint((0.75, 0.76, 0.78), gloss=1.0) if rng.random() < 0.5 else Paint((0.55, 0.38, 0.22), gloss=0.1)
    head = lathe([(0.014, 0.0), (0.017, 0.004), (0.0, 0.006)], steel, 12).moved((0.05, 0.0, 0.0))
    return Drawn.all([head, box((-0.06, -0.004, 0.002), (0.05, 0.004, 0.006), steel)]), 0.068


def _dish(rng: np.random.Generator) -> tuple[Drawn, float]:
    r = float(rng.uniform(0.022, 0.032))
    paint = Paint(_shade(_colour(rng), 1.15), gloss=0.6)
    return lathe([(0.6 * r, 0.0), (r, 0.02), (0.9 * r, 0.02), (0.0, 0.006)], paint), r


def _bottle(rng: np.random.Generator) -> tuple[Drawn, float]:
    r, h = float(rng.uniform(0.025, 0.042)), float(rng.uniform(0.16, 0.3))
    paint = Paint(_shade(_colour(rng), 0.8), gloss=1.0)
    profile = [(0.0, 0.0), (r, 0.0), (r, 0.6 * h), (0.35 * r, 0.78 * h), (0.32 * r, h), (0.0, h)]
    return lathe(profile, paint), r


def _bowl(rng: np.random.Generator) -> tuple[Drawn, float]:
    r, h = float(rng.uniform(0.05, 0.085)), float(rng.uniform(0.04, 0.065))
    paint = Paint(_shade(_colour(rng), 1.1), gloss=0.6)
    profile = [
        (0.0, 0.0),
        (0.5 * r, 0.0),
        (0.9 * r, 0.6 * h),
        (r, h),
        (0.93 * r, h),
        (0.8 * r, 0.5 * h),
        (0.0, 0.2 * h),
    ]
    return lathe(profile, paint, 20), r


def _pot(rng: np.random.Generator) -> tuple[Drawn, float]:
    r, h = float(rng.uniform(0.07, 0.11)), float(rng.uniform(0.09, 0.16))
    shade = float(rng.uniform(0.15, 0.8))
    metal = Paint((shade, shade, shade * 1.02), gloss=0.9)
    lid = lathe([(0.0, h), (1.02 * r, h), (0.9 * r, h + 0.012), (0.12 * r, h + 0.02), (0.0, h + 0.045)], metal, 20)
    ears = box((-r - 0.03, -0.02, 0.8 * h), (r + 0.03, 0.02, 0.8 * h + 0.012), metal)
    return Drawn.all([lathe([(0.0, 0.0), (r, 0.0), (r, h), (0.0, h)], metal, 20), lid, ears]), r + 0.03


def _jar(rng: np.random.Generator) -> tuple[Drawn, float]:
    r, h = float(rng.uniform(0.03, 0.05)), float(rng.uniform(0.07, 0.14))
    body = lathe([(0.0, 0.0), (r, 0.0), (r, 0.8 * h), (0.0, 0.8 * h)], Paint(_shade(_colour(rng), 1.0), gloss=0.6))
    lid = lathe([(1.03 * r, 0.8 * h), (1.03 * r, h), (0.0, h)], Paint(_shade(_colour(rng), 0.7), gloss=0.4))
    return Drawn.all([body, lid]), r * 1.03


def _mug(rng: np.random.Generator) -> tuple[Drawn, float]:
    r, h = float(rng.uniform(0.035, 0.045)), float(rng.uniform(0.08, 0.1))
    paint = Paint(_shade(_colour(rng), 1.1), gloss=0.6)
    cup = lathe([(0.0, 0.0), (r, 0.0), (r, h), (0.9 * r, h), (0.88 * r, 0.1 * h), (0.0, 0.1 * h)], paint)
    return Drawn.all([cup, box((r * 0.9, -0.006, 0.25 * h), (r + 0.025, 0.006, 0.8 * h), paint)]), r + 0.025


def _cloth(rng: np.random.Generator) -> tuple[Drawn, float]:
    a, b = float(rng.uniform(0.06, 0.1)), float(rng.uniform(0.05, 0.09))
    first, second = _shade(_colour(rng), 1.1), _shade(_colour(rng), 0.9)
    cloth = box((-a, -b, 0.0), (a, b, 0.006), Paint(first, second, TILES, float(rng.uniform(25, 60)), 0.2, 0.1))
    return cloth, float(np.hypot(a, b))
