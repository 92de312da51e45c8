"""The direct solver on a matrix whose pattern grows, as that of a body does whose walls come into touch."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.hifi.fem.solver import DirectSolver


def test_a_growing_pattern_keeps_settings_inertia_and_solution():
    comm, n = MPI.COMM_WORLD, 6
    matrix = PETSc.Mat().createAIJ((n, n), nnz=1, comm=comm)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    first, last = matrix.getOwnershipRange()
    for i in range(first, last):
        matrix.setValue(i, i, 1.0 + i)
    matrix.assemble()
    solver = DirectSolver(matrix, comm)
    solver.factorise()
    assert solver.negative_pivots == 0
    more = PETSc.Mat().createAIJ((n, n), nnz=2, comm=comm)
    for i in range(first, last):
        more.setValue(i, n - 1 - i, 5.0)
    more.assemble()
    matrix.axpy(1.0, more, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    solver.factorise()
    dense = np.diag(1.0 + np.arange(n)) + 5.0 * np.fliplr(np.eye(n))
    assert solver.negative_pivots == (np.linalg.eigvalsh(dense) < 0).sum() == 3
    assert solver.factorisations == 2
    factor = solver.ksp.getPC().getFactorMatrix()
    # also what PETSc sets on one rank
    assert [factor.getMumpsIcntl(i) for i in (14, 24)] == [60, 1] and factor.getMumpsIcntl(13) == 1
    right = np.arange(n, dtype=float)
    assert solver.solve(right[first:last]) == pytest.approx(np.linalg.solve(dense, right)[first:last])
    for each in (solver, matrix, more):
        each.destroy()
