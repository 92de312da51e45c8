"""What is built: pneu-net segments and manipulators as parameters, CAD, meshes. The CAD modules import
gmsh."""

from pneunet.geometry.parameters import Manipulator, Segment

__all__ = ["Manipulator", "Segment"]
