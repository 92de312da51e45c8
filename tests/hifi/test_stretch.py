"""The largest stretch: a mean over the most stretched hundredth of each segment's volume at rest."""

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.geometry.meshfile import read_mesh
from pneunet.hifi.fem.stretch import upper_mean
from pneunet.hifi.verification.reference_case import DATA


def test_upper_mean_is_over_the_stated_part_exactly_whoever_holds_the_values():
    """Of eight units of weight the upper eighth is all of 5 and one of the two halves at 4."""
    comm = MPI.COMM_WORLD
    values, weights = np.array([1.0, 4.0, 2.0, 5.0, 4.0, -7.0]), np.array([2.0, 0.5, 2.0, 0.5, 0.5, 2.5])
    mine = slice(comm.rank, None, comm.size)
    for fraction, expected in ((0.125, 4.5), (0.0625, 5.0), (0.1, (0.5 * 5 + 0.3 * 4) / 0.8), (1.0, -0.625)):
        assert upper_mean(values[mine], weights[mine], fraction, comm) == pytest.approx(expected), fraction
    nothing = slice(0, len(values) if comm.rank == 0 else 0)
    assert upper_mean(values[nothing], weights[nothing], 0.125, comm) == pytest.approx(4.5)


def test_points_stand_for_volume_at_rest_and_the_segment_stretched_most_counts(reference):
    stretch, problem = reference.stretch, reference.problem
    volume = problem.total(stretch.volumes().sum())
    assert volume == pytest.approx(read_mesh(DATA / "reference.npz")[0].volumes().sum())
    X, joint = problem.nodes, reference.manipulator.starts[1]
    array = problem.array.copy()
    array[problem.displacement_dofs[:, 0]] = np.where(X[:, 0] > joint, 0.3, 0.1) * (X[:, 0] - joint)
    problem.set_array(array)
    assert stretch.largest() == pytest.approx(1.3)
