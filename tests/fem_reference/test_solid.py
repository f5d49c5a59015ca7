"""The finite elements: patch, presses with closed forms, contact, meshes, errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
import skfem as sk

from fem_reference import meshes
from fem_reference.contact import Contact, Plane, Wedge
from fem_reference.laws import Corotated, NeoHookean
from fem_reference.press import Elements, press
from fem_reference.solid import EquilibriumError, Solid
from mpm.scene.material import Material
from mpm.scene.shapes import Shape, volume
from tests.mpm import twins

FOOD = Material(E=1e5, nu=0.35, rho=1000.0)
CUBE = Shape("block", 0.02, 0.02, 0.02)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", [sk.MeshHex, sk.MeshTet])
def test_a_homogeneous_deformation_is_exact(kind, order):
    """Patch test: held on its faces to an affine field, the inside follows and the forces inside balance."""
    solid = Solid(kind.init_tensor(*[np.linspace(0, 1, 4)] * 3), NeoHookean(1.0, 2.0), order)
    f = np.array([[1.1, 0.2, 0.0], [0.05, 0.9, -0.1], [0.0, 0.15, 1.2]])
    outside = ((solid.nodes < 1e-9) | (solid.nodes > 1 - 1e-9)).any(axis=1)
    want = solid.nodes @ (f - np.eye(3)).T
    for axis in range(3):
        for n in np.flatnonzero(outside):
            solid.hold(np.array([n]), [axis], want[n, axis])
    solid.solve()
    np.testing.assert_allclose(solid.u, want, atol=1e-7)
    assert (~outside).any()


@pytest.mark.parametrize(("stretch", "nominal"), [(0.95, -0.05119), (0.9, -0.10507), (0.8, -0.22310), (0.7, -0.35968)])
def test_a_sliding_press_has_the_closed_form(stretch, nominal):
    """Force = nominal stress times area, on plate and board, to 0.1 %; penetration below 1e-4 of an element."""
    curve = press(CUBE, FOOD, [(1 - stretch) * CUBE.height], elements=Elements(cells=2))
    want = -nominal * FOOD.E * CUBE.width * CUBE.length
    assert curve.force[0] == pytest.approx(want, rel=1e-3)
    assert curve.board[0] == pytest.approx(want, rel=1e-3)
    assert curve.penetration[0] < 1e-4 * CUBE.height / 4


def test_a_flowing_press_has_the_closed_form():
    """Beyond the yield stress the Kirchhoff stress stays there: force = yield stress times area over stretch."""
    soft = Material(E=1e5, nu=0.35, rho=1000.0, yield_stress=5e3)
    curve = press(CUBE, soft, [0.002, 0.004], elements=Elements(cells=2))
    area = CUBE.width * CUBE.length
    np.testing.assert_allclose(curve.force, [5e3 * area / 0.9, 5e3 * area / 0.8], rtol=2e-3)


def test_bonded_ends_stiffen_and_finer_elements_approach_quadratic_ones():
    """Bonded ends carry more than sliding ones; linear elements come down to the quadratic result with their size."""
    fine = press(CUBE, FOOD, [0.002], bonded=True, elements=Elements(cells=3, order=2)).force[0]
    coarse, finer = (press(CUBE, FOOD, [0.002], bonded=True, elements=Elements(cells=n)).force[0] for n in (2, 4))
    assert 1.05 * 4.203 < fine < finer < coarse < 1.15 * 4.203
    assert coarse / fine - 1 > 2 * (finer / fine - 1)


def test_a_wedge_pushes_along_its_faces():
    """A wedge of 140 degrees indents a block with less force than a plate, and the board carries all of it."""
    curve = press(CUBE, FOOD, [0.001, 0.002], half_angle=math.radians(70), elements=Elements(cells=4))
    assert 0 < curve.force[0] < curve.force[1] < 0.8 * press(CUBE, FOOD, [0.002], elements=Elements(cells=2)).force[0]
    np.testing.assert_allclose(curve.board, curve.force, rtol=1e-5)


def test_wedge_distance():
    """Distance and its gradient against the brute-force outline of the particles' tests."""
    wedge = Wedge(0.01, math.radians(20), spine=2e-3)
    rng = np.random.default_rng(0)
    points = rng.uniform([-1e-3, -3e-3, 0.008], [1e-3, 3e-3, 0.02], (60, 3))
    d, n = wedge.distance(points)
    want = [twins.wedge(abs(y), z - 0.01, 2e-3, math.radians(40)) for _, y, z in points]
    outside = d > 0
    np.testing.assert_allclose(
        d[outside], np.array(want)[outside], atol=2e-5
    )  # beyond the shoulder it is that of the faces
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, rtol=1e-12)
    step = 1e-7 * n
    np.testing.assert_allclose((wedge.distance(points + step)[0] - d) / 1e-7, 1.0, atol=1e-5)


def test_contact_only_pushes():
    """A node above the plane feels nothing; below it the force is along the normal."""
    contact = Contact(Plane((0, 0, 0), (0, 0, 1)), np.array([0, 1]), np.array([2.0, 2.0]), penalty=10.0, tolerance=1e-3)
    force = contact.force(np.array([[0, 0, 0.1], [0, 0, -0.1]]))
    np.testing.assert_allclose(force, [[0, 0, 0], [0, 0, 2.0]])
    assert contact.penetration(np.array([[0, 0, 0.1], [0, 0, -0.1]])) == pytest.approx(0.1)


@pytest.mark.parametrize("kind", ["block", "cylinder", "upright_cylinder", "sphere", "ellipsoid"])
def test_quarter_meshes_fill_the_shape(kind):
    """Four quarters have the shape's volume: straight edges from below and with order 2, curved ones to 1e-4."""
    sizes = (0.04, 0.04, 0.04) if kind == "sphere" else (0.05, 0.04, 0.03)
    shape = Shape(kind, *sizes)

    def part(cells: int, order: int) -> float:
        mesh = meshes.quarter(shape, cells, 1.3, order)
        element = sk.ElementHex1() if order == 1 else sk.ElementHex2()
        return 4 * sk.CellBasis(mesh, element, intorder=4).dx.sum() / volume(shape) - 1

    coarse, fine, curved = part(3, 1), part(6, 1), part(3, 2)
    assert abs(curved) < 1e-4
    if kind == "block":
        assert abs(coarse) < 1e-12
    else:
        assert coarse < 4 * 0.9 * fine < 0
    p = meshes.quarter(shape, 3).p
    assert (p > -1e-12).all()


@pytest.mark.parametrize("kind", ["cylinder", "upright_cylinder"])
def test_elements_follow_the_core(kind):
    """No element lies on both sides of the core's circle, and those within it have its volume."""
    shape, core = Shape(kind, 0.05, 0.04, 0.03), 0.6
    mesh = meshes.quarter(shape, 3, order=2, core=core)
    basis = sk.CellBasis(mesh, sk.ElementHex2(), intorder=4)
    x, y, z = np.asarray(basis.global_coordinates())
    other = (z - shape.height / 2) / (shape.height / 2) if kind == "cylinder" else y / (shape.length / 2)
    within = (x / (shape.width / 2)) ** 2 + other**2 < core**2
    assert (within.all(axis=1) | ~within.any(axis=1)).all()
    assert 4 * basis.dx[within].sum() == pytest.approx(core**2 * volume(shape), rel=1e-4)
    with pytest.raises(meshes.MeshError, match="no finite-element mesh of a block with a core"):
        meshes.quarter(CUBE, 3, core=core)


def test_a_mesh_survives_its_file(tmp_path):
    """A mesh goes to a file and comes back with its volume, the displacements beside it."""
    mesh = meshes.quarter(CUBE, 2)
    meshes.write(mesh, tmp_path / "cube.vtu", np.zeros((mesh.p.shape[1], 3)))
    back = meshes.read(tmp_path / "cube.vtu")
    solid = Solid(back, Corotated(1.0, 1.0))
    assert solid.weights.sum() == pytest.approx(CUBE.width * CUBE.length * CUBE.height / 4)


def test_errors_say_what_to_do(tmp_path):
    """No such file, a surface mesh, a shape without a mesh, bonding a ball, and a load that no equilibrium carries."""
    with pytest.raises(meshes.MeshError, match=r"missing\.vtu: cannot read"):
        meshes.read(tmp_path / "missing.vtu")
    sk.MeshTri().save(str(tmp_path / "flat.vtu"))
    with pytest.raises(meshes.MeshError, match="not hexahedra or tetrahedra"):
        meshes.read(tmp_path / "flat.vtu")
    with pytest.raises(meshes.MeshError, match="capsule"):
        meshes.quarter(Shape("capsule", 0.06, 0.03, 0.03), 2)
    with pytest.raises(meshes.MeshError, match="no flat ends"):
        press(Shape("sphere", 0.03, 0.03, 0.03), FOOD, [0.001], bonded=True)
    solid = Solid(meshes.quarter(CUBE, 1), Corotated(1.0, 1.0))
    for level, way in ((0.0, 0.0), (0.02, -0.03)):  # the upper face through the lower one
        solid.hold(np.flatnonzero(np.abs(solid.nodes[:, 2] - level) < 1e-9), [0, 1, 2], way if level else 0.0)
    with pytest.raises(EquilibriumError, match="use smaller"):
        solid.solve()
    np.testing.assert_array_equal(solid.u, 0.0)


def test_a_loose_solid_is_an_error():
    """Nothing holds it: one message, not the factorisation's."""
    solid = Solid(sk.MeshHex(), Corotated(1.0, 0.0))
    solid.load[:, 2] = 1e-3
    with pytest.raises(EquilibriumError, match="finite elements: "):
        solid.solve()


def test_a_bonded_block_flows_in_steps():
    """J2 flow between bonded ends: more force than with sliding ones and less than without flow."""
    soft = Material(E=1e5, nu=0.35, rho=1000.0, yield_stress=5e3)
    strokes = [0.0005, 0.001, 0.0015]
    flowing = press(CUBE, soft, strokes, bonded=True, elements=Elements(cells=2)).force
    sliding, elastic = (
        press(CUBE, soft, strokes, elements=Elements(cells=2)).force,
        press(CUBE, FOOD, strokes, bonded=True, elements=Elements(cells=2)).force,
    )
    assert flowing[0] == pytest.approx(elastic[0], rel=0.03)
    assert (flowing[1:] > 1.01 * sliding[1:]).all()
    assert flowing[2] < 0.8 * elastic[2]
