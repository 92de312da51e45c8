"""Published problems without exact solutions, orders of convergence, patch tests and the balance of
energy."""

import pytest
from dolfinx.mesh import CellType

from pneunet.hifi.verification import cook, energy_balance, land, manufactured, patch

both_elements = pytest.mark.parametrize(
    "element", [CellType.tetrahedron, CellType.hexahedron], ids=["tetrahedra", "hexahedra"]
)


@pytest.mark.parametrize(
    ("cells", "element"), [((24, 4, 4), CellType.tetrahedron), ((8, 2, 2), CellType.hexahedron)]
)
def test_land_problem_1(cells, element):
    z, _ = land.beam(cells, element)
    assert land.RANGE[0] <= z <= land.RANGE[1]


def test_cook_s_membrane():
    rises = [cook.rise(cells)[0] for cells in (4, 8, 16)]
    assert rises[-1] == pytest.approx(cook.converged(*rises), rel=5e-3)
    assert rises[-1] == pytest.approx(cook.PUBLISHED, rel=1e-2)


@pytest.mark.parametrize(
    ("meshes", "element"), [((2, 4, 8), CellType.tetrahedron), ((2, 4), CellType.hexahedron)]
)
def test_manufactured_solution_converges_with_full_order(meshes, element):
    errors = [manufactured.errors(cells, element) for cells in meshes]
    for coarse, fine in zip(errors, errors[1:]):
        order_u, order_p = manufactured.orders(coarse, fine)
        assert order_u >= 2.8 and order_p >= 1.8


@both_elements
def test_affine_deformation_is_exact_on_a_distorted_mesh(element):
    assert max(patch.affine(element=element)) < 1e-10


@both_elements
def test_constant_pressure_is_exact_on_a_distorted_mesh(element):
    assert max(patch.squeezed(element=element)) < 1e-12


def test_work_of_the_pressure_is_stored():
    """To 1e-5, and the rule's own error is smaller: it falls 16 times as its step is halved."""
    (_, coarse), (_, middle), (_, fine) = energy_balance.balance()[0]
    assert abs(fine) < 1e-5
    assert 10 < (coarse - middle) / (middle - fine) < 30
