"""Solids and tetrahedral meshes of manipulators and cells, by gmsh."""

from contextlib import suppress

from pneunet.base.system.interrupts import kept

with kept(), suppress(ImportError):  # the modules of this room say that it is missing
    import gmsh  # noqa: F401
