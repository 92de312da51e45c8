"""The front door: command line, doctor, MPI launcher. Nothing numerical."""
