"""Silicones: laws as energies, makers' figures, tensile tests and fits."""
