"""The rod: section frames, section laws, free shape and equilibrium under load."""
