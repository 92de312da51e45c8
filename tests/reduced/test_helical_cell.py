"""The one-sided cell: exact derivatives, rest, symmetries, scaling, the core's own stiffness, limit load."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Segment
from pneunet.reduced.analytic import energies as laws
from pneunet.reduced.analytic.equilibrium import follow
from pneunet.reduced.analytic.helical import HelicalCell
from pneunet.reduced.analytic.kinematics import INDEX, SIZE

SEGMENT = Segment("one-sided", 60.0, 5, width=10.0, channel_width=2.0, material=NeoHookean(mu=0.2068))


@pytest.mark.parametrize(
    "law, size", [(laws.membrane, 4), (laws.panel, 3), (laws.bulged_wall, 4), (laws.product, 3)]
)
def test_derivatives_of_the_laws(law, size, assert_derivatives):
    a = np.array([1.1, 0.2, -0.1, 0.9])[:size] + (0.3 if size == 3 else 0.0)

    def one(x):
        value, gradient, hessian = law(x[None])
        return value[0], gradient[0], hessian[0]

    assert_derivatives(one, a)


def test_derivatives_of_the_potential(assert_derivatives):
    cell = HelicalCell(SEGMENT)
    x = cell.start + 0.05 * np.random.default_rng(0).standard_normal(SIZE)
    assert_derivatives(cell.energy, x)
    assert_derivatives(cell.volume, x)


def test_rest_is_the_minimum_without_pressure():
    cell = HelicalCell(SEGMENT)
    value, gradient, hessian = cell.energy(cell.start)
    assert value == pytest.approx(0.0, abs=1e-12)
    assert abs(gradient).max() < 1e-12
    assert np.linalg.eigvalsh(hessian).min() > 0
    s = SEGMENT
    volume = s.cavity_thickness * s.cavity_width * s.chamber_height / s.sin
    assert cell.volume(cell.start)[0] == pytest.approx(volume)
    np.testing.assert_allclose(cell.strains(np.array([0.0])).vector, [[1, 0, 0, 0, 0, 0]], atol=1e-12)


def test_the_core_alone_has_the_modulus_three_mu():
    """Uniaxial stiffness of the membranes, transversely free, is E A = 3 mu A per pitch."""
    cell = HelicalCell(replace(SEGMENT, angle=90.0))
    law, rows, weights = cell.walls[0]
    value, _, hessian = law(rows @ cell.start)
    H = cell.mu / 2 * np.einsum("n,nas,nab,nbt->st", weights, rows, hessian, rows)
    i, j = INDEX["M11"], INDEX["M22"]
    stiffness = H[i, i] - H[i, j] ** 2 / H[j, j]
    solid = weights.sum()
    s = cell.segment
    cavity = (s.core_top - s.cavity_floor) * s.cavity_thickness * s.width
    assert solid == pytest.approx(
        s.pitch * (s.width * cell.cell.core_height - s.channel_width * 2.0) - cavity
    )
    assert stiffness == pytest.approx(3 * cell.mu * solid)


def test_ninety_degrees_bends_towards_minus_z_without_twist():
    strains = HelicalCell(replace(SEGMENT, angle=90.0)).strains(np.array([0.01, 0.05]))
    e, k = strains.e, strains.k
    np.testing.assert_allclose(np.c_[e[:, 1:], k[:, [0, 2]]], 0.0, atol=1e-12)
    assert (k[:, 1] > 0).all() and (e[:, 0] > 1).all()
    assert k[1, 1] > 4 * k[0, 1]


def test_mirror_designs_mirror_and_chambers_below_ninety_twist_positively():
    pressures = np.array([0.02, 0.05])
    strains = HelicalCell(SEGMENT).strains(pressures)
    mirrored = HelicalCell(SEGMENT.mirrored).strains(pressures)
    np.testing.assert_allclose(mirrored.vector, strains.mirrored.vector, atol=1e-10)
    assert (strains.k[:, 0] > 0).all()


def test_only_pressure_over_mu_and_shape_matter():
    strains = HelicalCell(SEGMENT).strains(np.array([0.05]))
    softer = replace(SEGMENT, material=NeoHookean(mu=0.1034))
    np.testing.assert_allclose(HelicalCell(softer).strains(np.array([0.025])).k, strains.k, rtol=1e-9)
    lengths = (
        "width",
        "chamber_height",
        "cavity_thickness",
        "wall",
        "gap",
        "top_wall",
        "side_wall",
        "base_thickness",
    )
    lengths += ("roof", "channel_width", "channel_height", "cavity_floor")
    larger = replace(SEGMENT, **{name: 2 * getattr(SEGMENT, name) for name in lengths})
    found = HelicalCell(larger).strains(np.array([0.05]))
    np.testing.assert_allclose(found.k, strains.k / 2, rtol=1e-9)
    np.testing.assert_allclose(found.e, strains.e, rtol=1e-9)


def test_small_pressures_are_linear_and_obey_clapeyron():
    cell = HelicalCell(SEGMENT)
    x = follow(cell, [1e-6])[0]
    work = 1e-6 * (cell.volume(x)[0] - cell.volume(cell.start)[0])
    assert 2 * cell.energy(x)[0] == pytest.approx(work, rel=1e-3)


def test_the_limit_load_is_named():
    with pytest.raises(ConvergenceError, match="one-sided cell: no stable equilibrium beyond"):
        HelicalCell(SEGMENT).strains(np.array([2.0]))


def test_cells_it_does_not_describe():
    with pytest.raises(InputError, match="kind"):
        HelicalCell(Segment("twisting", 60.0, 3))
    with pytest.raises(InputError, match="chamber_height_mm"):
        HelicalCell(replace(SEGMENT, chamber_height=0.6))
