"""What is true: incompressible mixed u-p hyperelasticity with follower pressure in dolfinx, under MPI."""

import petsc4py

# before anything else starts PETSc, which would obey a .petscrc in the working directory or at home
petsc4py.init(["pneunet", "-skip_petscrc"])
