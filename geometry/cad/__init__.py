"""Solids and tetrahedral meshes of manipulators and cells, by gmsh."""
