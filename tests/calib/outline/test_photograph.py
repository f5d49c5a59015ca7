"""Silhouettes of known foods: sizes, volume and section come back, and what is no outline is one clear line."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from calib.errors import ShapeError
from calib.material.scene import Sizing
from calib.outline.outline_file import OutlineFile
from mpm.scene.shapes import OUTLINE, Shape, section_area, span, volume
from tests.calib.made_outlines import ellipse, half, picture


def food(path, way, scale="0.5mm/px", length=None) -> Shape:
    """The shape of a silhouette."""
    s = OutlineFile(path, scale, way).sizing(Sizing(length=length))
    return Shape(OUTLINE, s.length, s.width, s.height, outline=s.outline)


@pytest.mark.parametrize(
    ("within", "way", "known"),
    [
        (ellipse(100, 60), "revolved", Shape("ellipsoid", 0.1, 0.06, 0.06)),
        (ellipse(100, 60), "bent", Shape("ellipsoid", 0.1, 0.06, 0.06)),
        (ellipse(70, 40, 0.5), "revolved", Shape("ellipsoid", 0.07, 0.04, 0.04)),
        (half(100, 70), "half", Shape("hemisphere", 0.1, 0.07, 0.035)),
        (half(100, 70), "extruded", Shape("half_cylinder", 0.08, 0.1, 0.035)),
    ],
)
def test_the_food_of_a_silhouette_is_the_food_that_was_drawn(tmp_path, within, way, known):
    """Half a pixel in 100: sizes to 0.3 %, volume and section to 0.5 %, and the mirrors that the food has."""
    found = food(picture(tmp_path / "p.png", within), way, length=0.08 if way == "extruded" else None)
    for name in ("length", "width", "height"):
        assert getattr(found, name) == pytest.approx(getattr(known, name), rel=3e-3)
    assert volume(found) == pytest.approx(volume(known), rel=5e-3)
    assert section_area(found) == pytest.approx(section_area(known), rel=5e-3)
    assert found.symmetric == (True, True)


def test_noise_dust_and_highlights_do_not_move_the_outline(tmp_path):
    """A JPEG with noise, a spot of the background's colour within the food and specks beside it."""

    def spotted(x, z):
        return (ellipse(90, 60)(x, z) & ~ellipse(8, 8)(x - 20, z)) | ellipse(3, 3)(x - 108, z - 60)

    found = food(picture(tmp_path / "p.jpg", spotted, noise=6.0), "revolved")
    assert volume(found) == pytest.approx(volume(Shape("ellipsoid", 0.09, 0.06, 0.06)), rel=1e-2)


def test_a_drawing_is_its_outer_line(tmp_path):
    """A closed line with something drawn in it is one food."""
    path = picture(tmp_path / "p.png", lambda x, z: (np.abs(np.hypot(x, z) - 58) < 2) | ellipse(20, 20)(x, z))
    assert volume(food(path, "revolved")) == pytest.approx(volume(Shape("sphere", 0.06, 0.06, 0.06)), rel=0.01)


def test_a_shadow_is_said(tmp_path):
    """A soft one under the food makes its edge vague; the same picture without it has nothing to say."""
    path = picture(tmp_path / "p.png", ellipse(90, 50))
    assert OutlineFile(path, "0.5mm/px", "revolved").sizing(Sizing()).said == ()
    image = np.asarray(Image.open(path)).astype(float)
    z, x = np.mgrid[0:160, 0:240]
    dark = 100 * np.exp(-((np.hypot((x - 120) / 95, (z - 95) / 55) / 0.95) ** 8))
    shaded = np.where(image[..., :1] < 200, image, image - dark[..., None])
    Image.fromarray(np.clip(shaded, 0, 255).astype(np.uint8)).save(path)
    (said,) = OutlineFile(path, "0.5mm/px", "revolved").sizing(Sizing()).said
    assert "not sharp" in said and "shadow" in said


def test_a_rough_edge_is_no_overhang(tmp_path):
    """A twig that hardly stands out, and a crack of three pixels, are left to the envelope."""
    twig = picture(tmp_path / "p.png", lambda x, z: ellipse(90, 70)(x, z) | ((np.abs(x - 30) < 2) & (z > 0) & (z < 72)))
    rough = picture(tmp_path / "r.png", lambda x, z: ellipse(90, 70)(x, z) & ~((np.abs(z - 20) < 1.4) & (x > 55)))
    for path in (twig, rough):
        assert volume(food(path, "revolved")) == pytest.approx(volume(Shape("ellipsoid", 0.09, 0.07, 0.07)), rel=0.02)


def test_transparency_is_an_outline_too(tmp_path):
    """Of a picture with its background cut away the food is what is left, whatever its colour; and the scale counts."""
    path = picture(tmp_path / "p.png", ellipse(100, 60))
    shape = np.asarray(Image.open(path).convert("RGB")).astype(int)
    alpha = (255 * (shape[..., 2] < 125)).astype(np.uint8)
    Image.fromarray(np.dstack([np.full_like(shape, 255).astype(np.uint8), alpha])).save(path)
    assert food(path, "revolved", "2px/mm").length == pytest.approx(0.1, rel=5e-3)
    assert food(path, "revolved", "1 mm/px").length == pytest.approx(0.2, rel=5e-3)


def test_a_large_picture_is_made_smaller_with_its_scale(tmp_path):
    """Twelve times as many pixels along a side: the same food."""
    path = picture(tmp_path / "p.png", ellipse(100, 60))
    image = Image.open(path)
    image.resize((12 * image.width, 12 * image.height), Image.Resampling.NEAREST).save(path)
    assert food(path, "revolved", "24px/mm").width == pytest.approx(0.06, rel=5e-3)


def test_a_camera_that_was_held_upside_down_says_so(tmp_path):
    """A half that lies on its back in the file, with the camera's mark of a turn by 180 degrees."""
    path = picture(tmp_path / "p.jpg", lambda x, z: half(100, 70)(x, -z))
    with pytest.raises(ShapeError, match="is level"):
        food(path, "half")
    turned = Image.Exif()
    turned[0x0112] = 3
    Image.open(path).save(path, exif=turned)
    assert food(path, "half").height == pytest.approx(0.035, rel=0.01)


def test_left_of_the_picture_is_left_of_the_blade(tmp_path):
    """A pear with its body on the left is thick at y < 0; an upright one stands on its body."""

    def pear(x, z):
        return ellipse(50, 50)(x + 40, z) | ((np.abs(z) < 20) & (x > -40) & (x < 90))

    lying = food(picture(tmp_path / "p.png", pear), "revolved")
    upright = food(picture(tmp_path / "u.png", lambda x, z: pear(z, x), size=(160, 240)), "revolved")
    for one in (lying, upright):
        assert np.diff(span(one, -0.015))[0] > 2 * np.diff(span(one, 0.03))[0]
        assert one.symmetric == (True, False)


def test_a_bent_silhouette_is_followed_or_named(tmp_path):
    """An arc: revolved says how far the middle lies aside; bent follows it, towards -x where it was above."""

    def banana(x, z):
        return (np.abs(np.hypot(x, z + 60) - 90) < 14) & (np.abs(x) < 75) & (z > -40)

    path = picture(tmp_path / "p.png", banana)
    s = OutlineFile(path, "1mm/px", "revolved").sizing(Sizing())
    assert "--outline-as bent" in s.said[0]
    followed = food(path, "bent", "1mm/px")
    assert followed.height < 0.75 * followed.width and OutlineFile(path, "1mm/px", "bent").sizing(Sizing()).said == ()
    middle, end = (sum(span(followed, y)) for y in (0.0, 0.06))
    assert middle < end - 0.01 and followed.symmetric[0] is False


BAD = {
    "cut": (lambda x, z: ellipse(100, 60)(x - 40, z), "reaches the edge of the picture"),
    "two": (lambda x, z: ellipse(40, 40)(x - 50, z) | ellipse(30, 30)(x + 50, z), "two objects"),
    "none": (lambda x, z: np.zeros_like(x), "nothing stands out"),
    "open": (lambda x, z: (np.abs(np.hypot(x, z) - 60) < 2) & ~((x > 0) & (np.abs(z) < 8)), "not closed"),
    "fork": (lambda x, z: ellipse(90, 60)(x, z) & ~((np.abs(z) < 15) & (x > -20)), "enters the food twice"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_outline_is_one_clear_line(tmp_path, name):
    """Cut off, two foods, none, an outline with a gap, one that is entered twice; the file is named."""
    within, said = BAD[name]
    path = picture(tmp_path / "p.png", within)
    with pytest.raises(ShapeError, match=said) as error:
        food(path, "extruded", length=0.1)
    assert "p.png" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(("way", "said"), [("half", "is level"), ("extruded", "does not stand")])
def test_a_tilted_half_is_refused(tmp_path, way, said):
    """Five degrees: its face is not on the board."""
    with pytest.raises(ShapeError, match=said):
        food(picture(tmp_path / "p.png", half(100, 70, np.deg2rad(5))), way, length=0.1)


def test_a_file_that_is_no_picture_is_refused(tmp_path):
    """Text, and a picture that ends half-way."""
    path = picture(tmp_path / "p.png", ellipse(100, 60))
    path.write_bytes(path.read_bytes()[:300])
    (tmp_path / "t.png").write_text("no picture")
    for one in (path, tmp_path / "t.png"):
        with pytest.raises(ShapeError, match="no picture that can be read"):
            food(one, "revolved")
