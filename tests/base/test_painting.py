"""Pictures and files of bodies made of quads."""

import numpy as np
import pytest

from pneunet.base.pictures.depth import shaded
from pneunet.base.pictures.painting import paint, sharp_edges
from pneunet.base.pictures.rendering import View
from pneunet.base.pictures.vtp import write_quads

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
#: from above: x to the right, y up, 4 mm high
ABOVE = View(np.array([0.5, 0.5, 0.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), 2.0)


def test_the_nearer_of_two_cubes_covers_the_other_and_both_have_their_size():
    pytest.importorskip("PIL")
    near = CORNERS * 0.5 + [0.25, 0.25, 5.0]
    vertices, quads = np.vstack([near, CORNERS]), np.vstack([FACES, FACES + 8])
    colours = np.repeat([[200, 0, 0], [0, 0, 200]], 6, axis=0)
    picture = np.asarray(paint(ABOVE, vertices, quads, colours, (120, 80)), int)
    assert picture.shape == (80, 120, 3) and (picture[2, 2] == 255).all()
    red, blue = ((picture[..., i] > picture[..., 2 - i] + 60).any(axis=0).nonzero()[0] for i in (0, 2))
    # 20 pixels a mm; edges are grey
    assert np.ptp(blue) == pytest.approx(20, abs=4) and np.ptp(red) == pytest.approx(10, abs=4)
    assert red.mean() == pytest.approx(59.5, abs=1) and picture[40, 60, 0] > 150


def test_edges_that_quads_share_are_not_sharp():
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    assert sharp_edges(quads).tolist() == [[True, False, True, True], [True, True, True, False]]


def test_a_surface_s_file_is_read_by_vtk(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    write_quads(tmp_path / "cube.vtp", CORNERS, FACES, {"segment": np.arange(6)})
    mesh = pyvista.read(tmp_path / "cube.vtp")
    assert mesh.volume == pytest.approx(1.0) and (mesh.cell_data["segment"] == np.arange(6)).all()


def test_of_crossing_surfaces_the_nearest_is_seen_at_every_pixel():
    """A face twice as large that lies low around a cube is seen around it and not inside; no sorting of whole
    faces could tell."""
    top = FACES[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    sheet = (CORNERS - 0.5) * [2, 2, 0.2] + [0.5, 0.5, 0.2]
    points, triangles = np.vstack([CORNERS, sheet]), np.vstack([top, top + 8])
    picture = shaded(ABOVE, points, triangles, (200, 200, 200), (120, 80))
    assert picture.shape == (80, 120, 3)
    covered = (picture < 250).any(axis=-1)  # 20 pixels a mm
    assert covered.sum() == pytest.approx(40 * 40, rel=0.1)
    rows = np.flatnonzero(np.abs(np.diff(picture[:, 60, 0])) > 20)
    assert {30, 50} <= {int(round(r, -1)) for r in rows}  # the cube's edges, drawn over the sheet
