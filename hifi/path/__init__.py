"""Equilibrium paths of any system: Newton's method, controls, steps, limit points."""
