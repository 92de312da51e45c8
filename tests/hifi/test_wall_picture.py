"""Picture of a cell's walls."""

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.geometry import Segment
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import CellSystem
from pneunet.hifi.contact.picture import draw_cell, node_distances
from pneunet.hifi.contact.walls import CellWalls

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")


def test_walls_are_coloured_by_their_distance(tmp_path):
    """At rest all walls are a gap apart, which is blue."""
    pytest.importorskip("pyvista")
    from PIL import Image

    segment = Segment("one-sided", 90.0, 1)
    mesh_cell(segment, 3.0, tmp_path / "cell.npz")
    problem = CellProblem(segment, tmp_path / "cell.npz")
    system = CellSystem(problem)
    distances = node_distances(CellWalls(problem), system.measure().array)
    on_wall = np.isfinite(distances)
    assert distances[on_wall] == pytest.approx(segment.gap, abs=1e-9)
    assert problem.nodes[on_wall, 2].min() == pytest.approx(segment.core_top)
    assert problem.nodes[on_wall, 2].max() == pytest.approx(segment.chamber_top)
    assert draw_cell(problem, system.measure(), tmp_path / "walls.png")
    image = np.asarray(Image.open(tmp_path / "walls.png").convert("RGB"), int)[60:580]
    blue = (image[..., 2] > image[..., 0] + 60).mean()
    assert 0.05 < blue < 0.8 and (image[0] > 250).all()
    system.destroy()
