"""The constants of the method: each is varied alone, and what is nothing is not."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import pytest

from calib.validation.method_constants import CONSTANTS, varied
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.setup.parameters import parameters
from mpm.setup.setup import Setup
from tests.mpm.scenes import PRISM


def flat(data: dict[str, Any], at: str = "") -> dict[str, Any]:
    """Leaves of nested dictionaries by their path."""
    out: dict[str, Any] = {}
    for key, value in data.items():
        out |= flat(value, f"{at}{key}.") if isinstance(value, dict) else {at + key: value}
    return out


def test_each_constant_is_varied_alone():
    """One number changes in each scene, to half or twice; the blade moves by half a cell across the grid."""
    scene = PRISM.with_material(loss_factor=0.02)
    own = flat(asdict(scene))
    for name, other in varied(scene).items():
        changed = {key: (own[key], value) for key, value in flat(asdict(other)).items() if value != own[key]}
        ((key, (old, new)),) = changed.items()
        if name == "blade half a cell aside":
            assert (key, new) == ("numerics.grid_shift", (0.0, 0.5, 0.0))
        else:
            assert new == {"half": 0.5, "twice": 2.0}[name.split()[0]] * old


def test_what_cannot_be_varied_says_why():
    """Both half and twice, or a reason; a loss factor of nothing is not varied."""
    assert all(bool(c.why) is (c.factors != (0.5, 2.0)) and c.source for c in CONSTANTS)
    assert not any("loss factor" in name for name in varied(PRISM))


def test_the_zone_of_a_food_without_strength_is_varied_only_there():
    """A food that has a tensile strength does not ask for it."""
    name = "process zone of a food without strength"
    assert PRISM.food.material.strength is None
    assert {f"half the {name}", f"twice the {name}"} <= set(varied(PRISM))
    assert not any(name in other for other in varied(PRISM.with_material(tensile_strength=2e4)))


SHARP = {"tensile_strength": 1e6, "yield_stress": 2e6}


def test_the_ties_of_a_crack_are_varied_only_where_it_is_sharp():
    """A process zone of many ties does not change with how many it has at least; one that is just long enough does."""
    name = "ties of a crack's process zone"
    assert not any(name in other for other in varied(PRISM.with_material(tensile_strength=1e5)))
    assert {f"half the {name}", f"twice the {name}"} <= set(varied(PRISM.with_material(**SHARP)))


@pytest.mark.parametrize("constant", [c for c in CONSTANTS if c.part == "numerics"], ids=lambda c: c.key)
def test_a_constant_of_the_numerics_reaches_the_kernels(constant):
    """Each changes what the kernels read, or the time step."""

    fruit = PRISM.with_material(R_rind=100.0, rind_thickness=2e-3, **SHARP)
    fruit = replace(fruit, numerics=replace(fruit.numerics, damper_mass=0.4))

    def read(scene: Scene) -> tuple[float, ...]:
        setup = Setup(scene, Runtime(threads=1))
        material, rows = scene.food.material, setup.contents(scene.food.material).tie_rows
        return (setup.time_step(material), rows.size, *parameters(scene, material, setup.seeds, setup.grid))

    assert all(read(constant.varied(fruit, factor)) != read(fruit) for factor in constant.factors)


def test_the_rows_of_a_tie_are_varied_only_in_layers():
    """A food without rind and core has no use for them; where they are, they stay whole numbers."""
    fruit = PRISM.with_material(R_rind=100.0, rind_thickness=2e-3)
    assert not any("rows of a tie" in name for name in varied(PRISM))
    assert varied(fruit)["half the rows of a tie"].numerics.layer_rows == 4
    assert isinstance(varied(fruit)["twice the rows of a tie"].numerics.layer_rows, int)


def test_what_is_fitted_is_no_constant():
    """A friction of the board and a loss factor that the trace is asked for have intervals, and are not varied too."""
    damped = PRISM.with_material(loss_factor=0.1)
    whole = varied(damped)
    left_out = {name for name in whole if name.endswith(("the friction of the board", "the loss factor"))}
    assert len(left_out) == 4
    assert set(varied(damped, ("E", "board_friction", "loss_factor"))) == set(whole) - left_out
