"""A cut as one HTML file that needs no network: the food to turn around, a slider over the stroke, and the forces.

The food has its own colours at first; a button shows the stress in their place.
"""

from __future__ import annotations

import base64
import gzip
from pathlib import Path
from typing import Any

import numpy as np

from mpm.files import write_atomic
from mpm.output.food_colours import Colour, food_colours
from mpm.scene.errors import OutputError
from reports.base.film import COLOURS, EYE, FRAME, Film, blade_at
from reports.base.scene_render import INK, STEEL, WOOD

PER_METRE = 2e4  # whole numbers of the file in a metre: a twentieth of a millimetre, less than a pixel
SHADES = 100  # of a page: more steps of the stress than colours would only make it larger
WRAPPER = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>A simulated cut</title></head>
<body><p>Unpacking. This needs a browser of 2023 or later, with scripts.</p>
<script>
const packed = "PACKED";
const bytes = Uint8Array.from(atob(packed), (one) => one.charCodeAt(0));
const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
new Response(stream).text().then((page) => { document.open(); document.write(page); document.close(); });
</script></body></html>
"""
HOVER = "%{x:.1f} mm, %{y:.2f} N<extra></extra>"
LIGHT = {"ambient": 0.55, "diffuse": 0.7, "specular": 0.15}
OF_FOOD = (1, 2)  # traces of the page that are the food: its skin and the faces of the cut
TITLES = ("von Mises stress [kPa]", "stroke [mm]", "force on the knife [N]")


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
        from plotly.subplots import make_subplots
    except ImportError:
        raise OutputError("a page needs plotly: pip install 'cutcal[view]', or leave the option out") from None
    figure = make_subplots(
        rows=1, cols=2, column_widths=[0.66, 0.34], specs=[[{"type": "scene"}, {"type": "xy"}]], horizontal_spacing=0.07
    )
    figure.add_trace(_board(film, go), row=1, col=1)
    for part, column in zip(_moving(film, 0, go, whole=True), (1, 1, 1, 2), strict=True):
        figure.add_trace(part, row=1, col=column)
    curve = go.Scatter(x=film.stroke * 1e3, y=film.force, mode="lines", line={"color": INK}, hovertemplate=HOVER)
    figure.add_trace(curve, row=1, col=2)
    figure.frames = [
        go.Frame(data=_moving(film, k, go, whole=False), traces=[1, 2, 3, 4], name=str(k))
        for k in range(len(film.looks))
    ]
    figure.update_layout(**_layout(film, title))
    figure.update_xaxes(title=TITLES[1], zeroline=False)
    figure.update_yaxes(title=TITLES[2], rangemode="tozero")
    text = packed(figure.to_html(include_plotlyjs=True, full_html=True, auto_play=False, config={"displaylogo": False}))
    try:
        write_atomic(path, text)
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror or e})") from None


def packed(page: str) -> str:
    """A page that unpacks another one in the browser: a third of its size, and still one file without a network.

    Args:
        page: The HTML document.

    Returns:
        The HTML document that holds it.
    """
    return WRAPPER.replace("PACKED", base64.b64encode(gzip.compress(page.encode(), mtime=0)).decode())


def _board(film: Film, go: Any) -> Any:
    """The top of the board."""
    shape = film.scene.food.shape
    near = FRAME * max(shape.width, shape.height)
    a, b = 0.7 * near, 0.55 * max(shape.length, 2 * near)
    x, y = np.array([-a, a, a, -a]), np.array([-b, -b, b, b])
    corners = np.column_stack([x, y, np.full(4, -1e-4)])
    faces = _faces(np.array([[0, 1, 2], [0, 2, 3]]))
    return go.Mesh3d(**_corners(corners), **faces, color=WOOD, lighting=LIGHT, hoverinfo="skip")


def _moving(film: Film, k: int, go: Any, *, whole: bool) -> list[Any]:
    """Skin, faces of the cut, blade and the place on the curve at one look: all of them, or what changes.

    Skin and faces have vertices of their own, or their light would run into each other along the rim, like a groove.
    """
    look, surface = film.looks[k], film.surface
    points, triangles = blade_at(film.scene, look)
    step = film.largest / 1e3 / SHADES
    stress = (step * np.round(surface.values(look.mises) / 1e3 / step)).astype(np.float32)
    places, knife = surface.points(look), _corners(points)
    now = {"x": [look.stroke * 1e3], "y": [film.force_at(look)]}
    parts = [np.unique(part, return_inverse=True) for part in surface.parts]
    foods = [{"intensity": stress[used], **_corners(places[used])} for used, _ in parts]
    if not whole:
        return [*(go.Mesh3d(**food) for food in foods), go.Mesh3d(**knife), go.Scatter(**now)]
    bar = {"title": {"text": TITLES[0], "side": "right"}, "x": -0.04, "len": 0.6, "thickness": 14}
    colours = {"cmin": 0.0, "cmax": film.largest / 1e3, "colorbar": bar, "showscale": False}
    hover = "%{intensity:.3g} kPa<extra></extra>"
    meshes = [
        go.Mesh3d(
            **food,
            **_faces(own.reshape(-1, 3)),
            **colours,
            colorscale=scale,
            lighting=LIGHT,
            hovertemplate=hover,
        )
        for food, (_, own), scale in zip(foods, parts, own_colours(film.food), strict=True)
    ]
    return [
        *meshes,
        go.Mesh3d(**knife, **_faces(triangles), color=STEEL, flatshading=True, lighting=LIGHT, hoverinfo="skip"),
        go.Scatter(**now, mode="markers", marker={"size": 11, "color": INK}, hovertemplate=HOVER),
    ]


def own_colours(food: str) -> list[list[list[Any]]]:
    """Scales of one colour, whatever the stress: of the skin of a food, and of its flesh."""
    known = food_colours(food)
    return [[[end, _rgb(colour)] for end in (0, 1)] for colour in (known.skin, known.flesh)]


def _rgb(colour: Colour) -> str:
    return f"rgb({', '.join(str(round(255 * part)) for part in colour)})"


def _corners(points: np.ndarray) -> dict[str, np.ndarray]:
    """Places [m] as short integers in twentieths of a millimetre, which is a quarter of the file."""
    limit = np.iinfo(np.int16).max
    short = np.clip(np.round(points * PER_METRE), -limit, limit).astype(np.int16)
    return dict(zip("xyz", short.T, strict=True))


def _faces(triangles: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip("ijk", triangles.astype(np.int32).T, strict=True))


def _layout(film: Film, title: str) -> dict[str, Any]:
    """Axes, camera and slider."""
    shape = film.scene.food.shape
    reach = PER_METRE * FRAME * max(shape.width, shape.height)
    long, top = PER_METRE * 0.6 * max(shape.length, 2 * shape.width), PER_METRE * 1.6 * shape.height
    ranges = {"xaxis": [-reach, reach], "yaxis": [-long, long]}
    scene: dict[str, Any] = {
        name: {"range": limits, "visible": False} for name, limits in (ranges | {"zaxis": [-0.01 * top, top]}).items()
    }
    eye = 3.2 * EYE / np.linalg.norm(EYE)
    scene |= {"aspectmode": "data", "camera": {"eye": dict(zip("xyz", map(float, eye), strict=True))}}
    step = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate", "transition": {"duration": 0}}
    play = {"frame": {"duration": 120, "redraw": True}, "fromcurrent": True, "transition": {"duration": 0}}
    return {
        "title": {"text": title, "x": 0.5},
        "showlegend": False,
        "template": "plotly_white",
        "scene": scene,
        "margin": {"l": 70, "r": 20, "t": 60, "b": 20},
        "sliders": [
            {
                "currentvalue": {"prefix": f"{TITLES[1]} "},
                "steps": [
                    {"args": [[str(k)], step], "label": f"{look.stroke * 1e3:.1f}", "method": "animate"}
                    for k, look in enumerate(film.looks)
                ],
            }
        ],
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.0,
                "y": 1.08,
                "buttons": [
                    {"label": "play", "method": "animate", "args": [None, play]},
                    {"label": "stop", "method": "animate", "args": [[None], step]},
                ],
            },
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.22,
                "y": 1.08,
                "buttons": [
                    _coloured("food", own_colours(film.food), shown=False),
                    _coloured("stress", [COLOURS, COLOURS], shown=True),
                ],
            },
        ],
    }


def _coloured(label: str, scales: list[Any], *, shown: bool) -> dict[str, Any]:
    """A button that colours skin and faces of the cut by these scales, with the bar of the stress or without."""
    change = {"colorscale": scales, "showscale": [shown, False]}
    return {"label": label, "method": "restyle", "args": [change, list(OF_FOOD)]}
