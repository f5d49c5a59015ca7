"""What the sides of a cut do to a blade that leaves its plane."""

from __future__ import annotations

import numpy as np
import pytest

from calib.material.food import load_food
from intsim.sim.coupling import Coupling
from intsim.sim.lateral import STABLE_STIFFNESS, STAMP_FACTOR, face_area, lateral_force
from intsim.sim.severing import cut_scene_at
from intsim.task.targets import Item
from mpm.scene.shapes import Shape

BERRY = Item("strawberry", Shape("ellipsoid", 0.04, 0.032, 0.032), x=0.03, y=-0.02, yaw=1.2)
FOOD = load_food("strawberry")


def test_the_force_is_a_stamp_s_up_to_what_the_food_bears():
    """Back to the plane, linear, with Barkan's stiffness; then the yield stress over the face; none of a food that the
    blade is above, and no more stiffness than a step bears."""
    scene = cut_scene_at(BERRY, 0.0, FOOD)
    material = scene.food.material
    area = face_area(scene, 0.012)
    assert area == pytest.approx(0.02 * 0.032, rel=1e-6) and face_area(scene, 0.05) == 0
    stiffness = STAMP_FACTOR * material.E / (1 - material.nu**2) * np.sqrt(area)
    assert stiffness < STABLE_STIFFNESS
    assert lateral_force(material, area, 1e-5) == pytest.approx(-stiffness * 1e-5)
    assert lateral_force(material, area, -1e-5) == pytest.approx(stiffness * 1e-5)
    assert lateral_force(material, area, 0.1) == pytest.approx(-material.yield_stress * area)
    assert lateral_force(material, 0.0, 0.1) == 0
    stone = load_food("potato").to_scene_food().material
    assert lateral_force(stone, area, 1e-6) == pytest.approx(-STABLE_STIFFNESS * 1e-6)


@pytest.mark.slow
def test_a_blade_that_leaves_its_plane_is_pushed_back_half_way_up_its_face():
    """2 mm aside, half-way down: the force across the blade is that of the closed form, and with it its torque about
    the edge; on the way down in the plane there is none."""
    coupling = Coupling([BERRY], {"strawberry": FOOD})
    pose = np.array([BERRY.x, BERRY.y, 0.043, BERRY.yaw - np.pi / 2, 0.0])
    while pose[2] > 0.016:
        pose[2] -= 5e-4
        coupling.move(pose, 0.0125)
        assert abs(coupling.force[:2] @ BERRY.axis) < 1e-9
    pose[:2] += 2e-3 * BERRY.axis
    pose[2] -= 1e-5
    force = coupling.move(pose, 0.0125)
    scene = cut_scene_at(BERRY, 0.0, FOOD)
    want = lateral_force(scene.food.material, face_area(scene, float(pose[2])), 2e-3)
    assert want < 0 and force[:2] @ BERRY.axis == pytest.approx(want, rel=1e-6)
    arm = (BERRY.shape.height - pose[2]) / 2
    assert coupling.torque == pytest.approx(np.cross([0, 0, arm], [*(want * BERRY.axis), 0]), rel=1e-6)
