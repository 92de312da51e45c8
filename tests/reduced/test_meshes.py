"""What finer grids change: learned from few designs, and in the law."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.geometry.parameters import KINDS, TWISTING
from pneunet.reduced.training.fit import fit_path, fit_stiffness
from pneunet.reduced.training.judging import stiffness_error, strain_error
from pneunet.reduced.training.meshes import converged, converged_sample, fit_meshes, truth
from pneunet.reduced.training.states import sample_of
from tests.reduced.made_up_cells import made_up_data, softer, true_free, true_stiffness

DESIGNS, FINEST = 36, 3


@pytest.fixture(scope="module", params=KINDS)
def learned(request):
    """(training Sample, held-out Sample, MeshDifference) of made-up cells on three grids."""
    data = made_up_data(DESIGNS, grids=3)
    training, held_out = (sample_of(data, request.param, held) for held in (False, True))
    path = fit_path(training.free)
    return training, held_out, fit_meshes(training, path, fit_stiffness(training.free, path.closing))


def true_states(of, states):
    """What true_free or true_stiffness gives on ever finer grids at the pressures of States."""
    return np.array(
        [of(states.kind, n, P, softer(n, FINEST)) for n, P in zip(states.numbers, states.pressure)]
    )


def test_states_on_the_coarse_grid_become_those_of_ever_finer_ones(learned):
    _, held_out, mesh = learned
    coarse = held_out.free.loaded
    found = converged(coarse, mesh)
    lead = mesh.coordinates.leading
    assert (found.pressure < coarse.pressure).all() and (lead(found.strains) == lead(coarse.strains)).all()
    for states in (found, truth(held_out, mesh).free.loaded):
        assert strain_error(states, true_states(true_free, states)).max() < 0.01
    assert 0 < mesh.uncertainty < 0.02 and 0 < mesh.uncertainty_at_lead < 0.02


def test_stiffness_and_forces_go_along(learned):
    _, held_out, mesh = learned
    free, sample = held_out.free, converged_sample(held_out, mesh)
    assert stiffness_error(sample.free, true_states(true_stiffness, sample.free)).max() < 0.01
    assert stiffness_error(free, true_states(true_stiffness, free)).min() > 0.03
    work, before = (np.einsum("ni,ni->n", s.change, s.forces) for s in (sample, held_out))
    # e1's stiffness, the unit of energies around a free state, falls
    ratio = sample.around.matrices[:, 0, 0] / held_out.around.matrices[:, 0, 0]
    assert work == pytest.approx(ratio * before) and (ratio < 1).all()


def test_the_share_that_the_fine_grid_lacks_is_found(learned):
    _, _, mesh = learned
    assert [mesh.left, mesh.stiffness_left] == pytest.approx([0.3 / 1.3] * 2, rel=0.02)


def test_where_walls_touch_the_coarse_grid_has_states_up_to_there_too():
    """By a second mesh of its size; a design that does not touch has these states already."""
    data, touches = made_up_data(12, grids=2), 2
    about = data.about | {"meshes": [{"name": name, "mesh_size_mm": 2.0} for name in ("coarse", "before")]}
    first = np.where((data.design == touches) & (data.mesh == 0), 0.2, np.nan)
    sample = sample_of(replace(data, about=about, first_touch=first), TWISTING, held_out=False)
    count = np.bincount(sample.free.design)
    assert count[touches] == 2 * count[0] - 1  # at rest once
    assert (count[[0, 6, 8, 10]] == count[0]).all() and not sample.finer
    own = sample.free.of(sample.free.design == touches)
    assert np.ptp(own.size) == 0 and own.touching.sum() == 2


def test_too_few_designs_on_finer_grids_change_nothing(learned):
    training, held_out, _ = learned
    few = training.of(training.finer[0].design[:1])
    path = fit_path(training.free)
    mesh = fit_meshes(few, path, fit_stiffness(training.free, path.closing))
    assert mesh.strains is None and mesh.uncertainty == 0
    assert converged(held_out.free, mesh) is held_out.free
