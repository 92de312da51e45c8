"""Direct linear solver (MUMPS): LDL^T with the inertia of the matrix when it is symmetric, LU otherwise."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.hifi.fem.compat import ORDERING

_OPTIONS = "pneunet_"
#: MUMPS could not allocate its workspace
OUT_OF_MEMORY = -13


class NotConverged(RuntimeError):
    """This solve failed; the stepper decides what to try next."""


class PredictorTooFar(NotConverged):
    """The predicted state is further from equilibrium than what failed before: not worth a factorisation."""


class DirectSolver:
    """MUMPS factorisation of a PETSc matrix: LDL^T when symmetric (a closed cavity), LU otherwise."""

    def __init__(self, matrix: PETSc.Mat, comm: MPI.Comm, symmetric: bool = True):
        self.matrix, self.comm, self.symmetric, self.factorisations = matrix, comm, symmetric, 0
        self._solution, self._right = matrix.createVecs()
        self._set_up()

    def _set_up(self):
        self.ksp = PETSc.KSP().create(self.comm)
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("cholesky" if self.symmetric else "lu")
        pc.setFactorSolverType("mumps")
        self.ksp.setOperators(self.matrix)
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        # the ordering is taken from PETSc's options alone
        factor.setOptionsPrefix(_OPTIONS)
        PETSc.Options(_OPTIONS)["mat_mumps_icntl_7"] = ORDERING
        if self.symmetric:
            # ordering of the graph compressed by 2x2 pivots: 7 % fewer operations
            factor.setMumpsIcntl(12, 2)
        factor.setMumpsIcntl(14, 60)  # workspace for pivoting, in percent
        factor.setMumpsIcntl(24, 1)  # a singular pivot is told, not a crash
        if self.symmetric and self.comm.size > 1:
            factor.setMumpsIcntl(13, 1)  # the root is not left to ScaLAPACK, which counts no negative pivots
        self._nonzeros = self._count()

    def _count(self):
        return self.matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]

    def factorise(self) -> None:
        # for a new pattern PETSc makes a new factor, without what was set above
        if self._count() != self._nonzeros:
            self.ksp.destroy()
            self._set_up()
        self.ksp.setOperators(self.matrix)
        self.ksp.setUp()
        self.factorisations += 1
        code = self.ksp.getPC().getFactorMatrix().getMumpsInfog(1)
        if code == OUT_OF_MEMORY:  # a smaller step would not help
            raise MemoryError("the tangent could not be factorised for want of memory: take a coarser mesh")
        if code < 0:
            raise NotConverged(f"the tangent could not be factorised (MUMPS error {code})")

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues of the factorised matrix (Sylvester); None for LU."""
        return self.ksp.getPC().getFactorMatrix().getMumpsInfog(12) if self.symmetric else None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K^-1 right, (owned rows,) arrays."""
        self._right.array[:] = right
        self.ksp.solve(self._right, self._solution)
        return self._solution.array.copy()

    def solve_many(self, right: np.ndarray) -> np.ndarray:
        """K^-1 right, (owned rows, columns) arrays: all columns in one pass through the factors."""
        rows, columns = self.matrix.getSizes()[0], (None, right.shape[1])
        b = PETSc.Mat().createDense((rows, columns), array=right.copy(order="F"), comm=self.comm)
        x = b.duplicate()
        self.ksp.getPC().getFactorMatrix().matSolve(b, x)
        solution = x.getDenseArray().copy()
        b.destroy()
        x.destroy()
        return solution

    def destroy(self) -> None:
        self.ksp.destroy()
        self._solution.destroy()
        self._right.destroy()
