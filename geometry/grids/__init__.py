"""Grids of hexahedra for cells and manipulators: sheared tensor grids, numpy alone."""
