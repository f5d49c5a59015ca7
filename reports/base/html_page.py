"""A cut as one HTML file that needs no network: the food to turn around, a slider over the stroke, and the forces.

The food has its own colours at first; a button shows the stress in their place.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps

from mpm.files import write_atomic
from mpm.output.food_colours import Colour, food_colours
from mpm.scene.errors import OutputError
from reports.base.film import COLOURS, EYE, Film, blade_at, board, corners
from reports.base.scene_render import INK, STEEL, WOOD
from reports.base.scene_sheet import bar_ends, bar_length, numbers

TEMPLATE = Path(__file__).resolve().parents[1] / "templates" / "cut.html"
PER_METRE = 2e4  # whole numbers of the file in a metre: a twentieth of a millimetre, less than a pixel
SHADES = 100  # of a page: more steps of the stress than colours would only make it larger
WRAPPER = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>A simulated cut</title></head>
<body><p>Unpacking. This needs a browser of 2023 or later, with scripts.</p>
<script>
const packed = "PACKED";
const bytes = Uint8Array.from(atob(packed), (one) => one.charCodeAt(0));
const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
new Response(stream).text().then((page) => { document.open(); document.write(page); document.close(); });
</script></body></html>
"""
HOVER = "%{x:.1f} mm, %{y:.2f} N<extra></extra>"
LIGHT = {"ambient": 0.5, "diffuse": 0.6, "specular": 0.15}
EVEN = {"ambient": 0.9, "diffuse": 0.1, "specular": 0.0}  # light on the flesh: its colour is seen from all sides
LAMP = {"x": 60000, "y": -30000, "z": 90000}  # where light comes from, far beyond the scene
SOLID = {"lighting": LIGHT, "lightposition": LAMP, "flatshading": True, "hoverinfo": "skip"}
MOVING, OF_FOOD = (0, 1, 2), (0, 1)  # traces of the scene: skin, flesh and blade; those that are the food
TITLES = ("von Mises stress [kPa]", "stroke [mm]", "force on the knife [N]")
SAMPLES = 9  # of the scale of the stress
MARKS = 5  # steps between the round numbers below the slider, at most
STEPS = (1.0, 2.0, 5.0, 10.0)  # what such a step may be, times a power of ten
THICK = 0.012  # of the scale bar and over the board, in lengths of the board


def page(film: Film, path: Path, title: str) -> None:
    """Write a self-contained page of a cut.

    Args:
        film: What to show; each of its looks makes the file some 0.05 MB larger.
        path: The file.
        title: Its heading.

    Raises:
        OutputError: plotly is not installed, or the file cannot be written.
    """
    try:
        import plotly.graph_objects as go
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise OutputError("a page needs plotly: pip install 'cutcal[view]', or leave the option out") from None
    parts = {
        "TITLE": escape(title),
        "CUT": json.dumps(content(film, go), separators=(",", ":")).replace("<", "\\u003c"),
        "PLOTLY": get_plotlyjs(),
    }
    text = re.sub("@(TITLE|CUT|PLOTLY)@", lambda found: parts[found[1]], TEMPLATE.read_text(encoding="utf-8"))
    try:
        write_atomic(path, packed(text))
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror or e})") from None


def packed(text: str) -> str:
    """A page that unpacks another one in the browser: a third of its size, and still one file without a network.

    Args:
        text: The HTML document.

    Returns:
        The HTML document that holds it.
    """
    return WRAPPER.replace("PACKED", base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode())


def content(film: Film, go: Any) -> dict[str, Any]:
    """What the page's script draws.

    Args:
        film: What to show.
        go: ``plotly.graph_objects``.

    Returns:
        Plain data: scene with a frame for each look, forces, words of each look and where the food's halves are one,
        marks of the slider, colours, and the corners of all that there is, in the lengths of the scene's camera.
    """
    box = _boxes(film)
    low, high = box.min(axis=0), box.max(axis=0)
    size = float((high - low).max())
    bar, length = _bar(film, go)
    layout = _scene_layout(low, high, size)
    layout["scene"]["annotations"] = [length]
    scene = go.Figure(
        [*_moving(film, 0, go, whole=True), _board(film, go), bar],
        layout=layout,
        frames=[
            go.Frame(data=_moving(film, k, go, whole=False), traces=list(MOVING), name=str(k))
            for k in range(len(film.looks))
        ],
    )
    at = {"stroke": film.looks[0].stroke * 1e3, "force": film.force_at(film.looks[0])}
    forces = go.Figure(
        [
            go.Scatter(x=film.stroke * 1e3, y=film.force, mode="lines"),
            go.Scatter(x=[at["stroke"]], y=[at["force"]], mode="markers", marker={"size": 11}, cliponaxis=False),
        ],
        layout={
            "template": "plotly_white",
            "showlegend": False,
            "margin": {"l": 58, "r": 12, "t": 12, "b": 48},
            "xaxis": {"title": {"text": TITLES[1]}, "zeroline": False, "fixedrange": True},
            "yaxis": {"title": {"text": TITLES[2]}, "rangemode": "tozero", "fixedrange": True},
        },
    )
    forces.update_traces(hovertemplate=HOVER, line_color=INK, marker_color=INK)
    return {
        "scene": json.loads(scene.to_json()),
        "forces": json.loads(forces.to_json()),
        "looks": [
            {
                "stroke": look.stroke * 1e3,
                "force": film.force_at(look),
                "said": numbers(film, look),
                "whole": [int(whole) for whole in ~film.surface.cut(look)[film.surface.rims[:, 0]]],
            }
            for look in film.looks
        ],
        "rims": np.searchsorted(np.unique(film.surface.parts[0]), film.surface.rims).tolist(),
        "ticks": ticks([look.stroke * 1e3 for look in film.looks]),
        "own": own_colours(film.food),
        "stress": [stress_colours()] * len(OF_FOOD),
        "coloured": OF_FOOD,
        "corners": ((box - (low + high) / 2) / size).tolist(),
        "eye": EYE.tolist(),
    }


def ticks(strokes: Sequence[float]) -> list[tuple[float, str]]:
    """Round strokes below a slider that goes from look to look, each where its stroke is passed.

    >>> ticks([0.0, 7.0, 20.0])
    [(0.0, '0'), (0.357, '5'), (0.615, '10'), (0.808, '15'), (1.0, '20')]

    Args:
        strokes: Those of the looks [mm]; they fall where the blade is withdrawn.

    Returns:
        Part of the slider and number of each.
    """
    way = float(np.abs(np.diff(strokes)).sum())
    if way == 0.0:
        return []
    power = 10.0 ** np.floor(np.log10(way / MARKS))
    step = next(k * power for k in STEPS if k * power * MARKS >= way * (1.0 - 1e-9))
    found: dict[float, str] = {}
    for k, (begin, end) in enumerate(zip(strokes[:-1], strokes[1:], strict=True)):
        first, last = np.ceil(min(begin, end) / step - 1e-9), np.floor(max(begin, end) / step + 1e-9)
        for mark in step * np.arange(first, last + 1):
            part = 0.0 if begin == end else (mark - begin) / (end - begin)
            found[round((k + float(part)) / (len(strokes) - 1), 3)] = f"{mark + 0.0:.12g}"
    return sorted(found.items())


def _boxes(film: Film) -> np.ndarray:
    """Corners (24, 3) [m] of boxes around the food at all looks, around the blade, and of the board."""
    foods = np.concatenate([film.surface.points(look) for look in film.looks])
    blades = np.concatenate([blade_at(film.scene, look)[0] for look in film.looks])
    around = [np.column_stack([all_.min(axis=0), all_.max(axis=0)]).ravel() for all_ in (foods, blades)]
    return np.concatenate([corners(tuple(ends)) for ends in around] + [corners(board(film, apart=False))])


def _board(film: Film, go: Any) -> Any:
    """The board."""
    return _box(corners(board(film, apart=False)), WOOD, go)


def _box(points: np.ndarray, colour: str, go: Any) -> Any:
    """A box with these corners (8, 3) [m]."""
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([[s[a], s[b], s[c]] for s in sides for a, b, c in ((0, 1, 2), (0, 2, 3))])
    return go.Mesh3d(**_corners(points), **_faces(triangles), color=colour, **SOLID)


def _bar(film: Film, go: Any) -> tuple[Any, dict[str, Any]]:
    """The scale bar, which lies on the board, and its length, which is written beside its end."""
    (x, y, z), (_, end, _) = bar_ends(film)
    _, _, low, high, _, _ = board(film, apart=False)
    thick = THICK * (high - low)
    words = {
        **{name: float(place[0]) for name, place in _corners(np.array([[x, end + thick, z]])).items()},
        "text": f"{1e3 * bar_length(film.scene.food.shape.length):g} mm",
        "showarrow": False,
        "xanchor": "left",
        "font": {"size": 14, "color": INK},
    }
    return _box(corners((x, x + thick, y, end, z, z + thick / 4)), INK, go), words


def _moving(film: Film, k: int, go: Any, *, whole: bool) -> list[Any]:
    """Skin, flesh and blade at one look: all of them, or what changes.

    Skin and flesh have vertices of their own, or their light would run into each other along the rim, like a groove.
    A triangle of the flesh that is not seen has two corners in one place.
    """
    look, surface = film.looks[k], film.surface
    points, triangles = blade_at(film.scene, look)
    step = film.largest / 1e3 / SHADES
    stress = (step * np.round(surface.values(look.mises) / 1e3 / step)).astype(np.float32)
    places, knife = surface.points(look), _corners(points)
    foods, seen = [], (np.ones(len(surface.parts[0]), bool), surface.bare(look))
    for part, shown in zip(surface.parts, seen, strict=True):
        used, own = np.unique(part, return_inverse=True)
        faces = _faces(own.reshape(-1, 3))
        faces["j"] = np.where(shown, faces["j"], faces["i"])
        now = {"intensity": stress[used], **_corners(places[used])}
        foods.append(now | (faces if whole else {} if shown.all() else {"j": faces["j"]}))
    if not whole:
        return [*(go.Mesh3d(**food) for food in foods), go.Mesh3d(**knife)]
    bar = {"title": {"text": TITLES[0], "side": "top"}, "orientation": "h", "x": 0.5, "y": 1.0, "yanchor": "bottom"}
    bar |= {"len": 0.8, "thickness": 12}
    colours = {"cmin": 0.0, "cmax": film.largest / 1e3, "colorbar": bar, "showscale": False}
    hover = "%{intensity:.3g} kPa<extra></extra>"
    meshes = [
        go.Mesh3d(**food, **colours, colorscale=scale, lighting=light, lightposition=LAMP, hovertemplate=hover)
        for food, scale, light in zip(foods, own_colours(film.food), (LIGHT, EVEN), strict=True)
    ]
    return [*meshes, go.Mesh3d(**knife, **_faces(triangles), color=STEEL, **SOLID)]


def own_colours(food: str) -> list[list[list[Any]]]:
    """Scales of one colour, whatever the stress: of the skin of a food, and of its flesh."""
    known = food_colours(food)
    return [[[end, _rgb(colour)] for end in (0, 1)] for colour in (known.skin, known.flesh)]


def stress_colours() -> list[list[Any]]:
    """The scale of the stress, as the pictures have it: light where it is small."""
    scale = colormaps[COLOURS]
    return [[part, _rgb(scale(part)[:3])] for part in np.linspace(0.0, 1.0, SAMPLES).tolist()]


def _rgb(colour: Colour) -> str:
    return f"rgb({', '.join(str(round(255 * part)) for part in colour)})"


def _corners(points: np.ndarray) -> dict[str, np.ndarray]:
    """Places [m] as short integers in twentieths of a millimetre, which is a quarter of the file."""
    limit = np.iinfo(np.int16).max
    short = np.clip(np.round(points * PER_METRE), -limit, limit).astype(np.int16)
    return dict(zip("xyz", short.T, strict=True))


def _faces(triangles: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip("ijk", triangles.astype(np.int32).T, strict=True))


def _scene_layout(low: np.ndarray, high: np.ndarray, size: float) -> dict[str, Any]:
    """Axes of a box with these ends [m], (3,) each, in a scene where a length of ``size`` [m] is one of the camera."""
    scene: dict[str, Any] = {
        f"{name}axis": {"range": [PER_METRE * a, PER_METRE * b], "visible": False}
        for name, a, b in zip("xyz", low.tolist(), high.tolist(), strict=True)
    }
    ratio = dict(zip("xyz", ((high - low) / size).tolist(), strict=True))
    camera = {"eye": dict(zip("xyz", EYE.tolist(), strict=True)), "center": {"x": 0, "y": 0, "z": 0}}
    scene |= {"aspectmode": "manual", "aspectratio": ratio, "camera": camera, "dragmode": "orbit"}
    return {"template": "plotly_white", "showlegend": False, "scene": scene, "margin": dict.fromkeys("lrtb", 0)}
