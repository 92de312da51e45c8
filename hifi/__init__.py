"""What is true: incompressible mixed u-p hyperelasticity with follower pressure in dolfinx, under MPI."""
