"""Walls that touch: distances, the penalty that holds them apart, the third medium."""
