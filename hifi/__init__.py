"""What is true: incompressible mixed u-p hyperelasticity with follower pressure in dolfinx, under MPI."""

# MPI before PETSc, which would start it without the threads that hand out cases
import petsc4py
from mpi4py import MPI  # noqa: F401

# before anything else starts PETSc, which would obey a .petscrc in the working directory or at home
petsc4py.init(["pneunet", "-skip_petscrc"])
