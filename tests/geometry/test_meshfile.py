"""The file that finite elements read: arrays alone, and refused in one line where they make no mesh."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.archive import write_archive
from pneunet.geometry import tags
from pneunet.geometry.meshfile import SCHEMA, VolumeMesh, read_mesh

CORNERS = np.vstack([np.zeros(3), np.eye(3)])
GOOD = {
    "points": CORNERS,
    "cells": np.array([[0, 1, 2, 3]]),
    "cell_tags": np.array([tags.BODY]),
    "facets": np.array([[0, 1, 2], [1, 2, 3]]),
    "facet_tags": np.array([tags.BASE, tags.CAVITY]),
}


def test_what_was_written_is_read(tmp_path):
    write_archive(tmp_path / "mesh.npz", SCHEMA, {"element": "tetrahedra", "cells": 1}, GOOD)
    mesh, facts = read_mesh(tmp_path / "mesh.npz")
    assert facts == {"element": "tetrahedra", "cells": 1} and (mesh.tagged(tags.CAVITY) == [[1, 2, 3]]).all()
    assert all((getattr(mesh, name) == array).all() for name, array in GOOD.items())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": CORNERS.astype(int)}, "'points': its type"),
        ({"points": CORNERS[:, :2]}, "'points': has shape (4, 2)"),
        ({"points": np.array(1.0)}, "'points': is damaged"),
        ({"points": CORNERS * [1, np.nan, 1]}, "'points': holds nan"),
        ({"points": CORNERS * [1, 1, -1]}, "no positive volume"),
        ({"points": CORNERS * [1, 1, 0]}, "no positive volume"),
        ({"points": CORNERS * 1e200}, "'points': holds 1e+200"),
        ({"cells": np.array([[0, 1, 2, 4]])}, "'cells': holds 4"),
        ({"cells": np.zeros((0, 4), int), "cell_tags": np.zeros(0, int)}, "no positive volume"),
        ({"facets": np.array([[0, 1, 2], [1, 2, -3]])}, "'facets': holds -3"),
        ({"facets": np.array([[0.0, 1, 2], [1, 2, 3]])}, "'facets': its type"),
        ({"facet_tags": np.array([tags.BASE])}, "'facet_tags': has shape (1,)"),
        ({"facet_tags": np.array([tags.BASE, 99])}, "'facet_tags': holds 99"),
        ({"cell_tags": np.array([tags.BASE])}, "'cell_tags': holds 13"),
        ({"cell_tags": np.array([{}], object)}, "'cell_tags': its type"),
        ({"cell_tags": None}, "'cell_tags': is missing"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_makes_no_mesh_is_refused(changes, message, tmp_path):
    path = tmp_path / "mesh.npz"
    content = {name: array for name, array in (GOOD | changes).items() if array is not None}
    write_archive(path, SCHEMA, {"element": "tetrahedra"}, content)
    with pytest.raises(InputError) as refused:
        read_mesh(path)
    text = str(refused.value)
    assert text.startswith(str(path)) and message in text and "\n" not in text


def test_hexahedra_are_read_and_refused_where_they_turn_inside_out(tmp_path):
    cube = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    cube = np.concatenate([cube, cube + [0, 0, 1]])
    cells, facets = np.arange(8)[None], np.array([[0, 3, 2, 1]])
    made = VolumeMesh(cube, cells, np.array([tags.BODY]), facets, np.array([tags.BASE]))
    made.write(tmp_path / "mesh.npz", {"cells": 1})
    mesh, facts = read_mesh(tmp_path / "mesh.npz")
    assert (
        facts == {"element": "hexahedra", "cells": 1}
        and mesh.element == "hexahedra"
        and (mesh.cells == cells).all()
    )
    assert mesh.volumes() == pytest.approx([1.0])
    dented = cube.copy()
    dented[6] = [0.4, 0.4, 0.4]  # still of positive volume, but not at this corner
    with pytest.raises(InputError, match="hexahedra has no positive volume"):
        VolumeMesh(dented, cells, made.cell_tags, facets, made.facet_tags)


def test_an_unknown_element_is_refused(tmp_path):
    write_archive(tmp_path / "mesh.npz", SCHEMA, {"element": "pyramids"}, GOOD)
    with pytest.raises(InputError, match="'pyramids' is none of hexahedra, tetrahedra"):
        read_mesh(tmp_path / "mesh.npz")


def test_a_script_is_no_mesh(tmp_path):
    path = tmp_path / "mesh.npz"
    path.write_text('SystemCall "touch obeyed";\n')
    with pytest.raises(InputError, match="not a mesh"):
        read_mesh(path)


def test_tags_are_those_of_a_body():
    """Of two segments, the second with a layer, and of two pressure groups."""
    faces = list(tags.face_names(2))
    good = {
        "points": CORNERS,
        "cells": np.array([[0, 1, 2, 3]] * 3),
        "cell_tags": np.array([tags.BODY, tags.BODY + 1, tags.LAYER + 1]),
        "facets": np.array([[0, 1, 2]] * len(faces)),
        "facet_tags": np.array(faces),
    }
    VolumeMesh(**good).require_tags([False, True], 2)
    for layered, groups, changes in (
        ([True, True], 2, {}),
        ([False], 2, {}),
        ([False, True], 1, {}),
        ([False, True], 3, {}),
        ([False, True], 2, {"cell_tags": np.array([tags.BODY, tags.BODY + 1, tags.BODY + 1])}),
        ([False, True], 2, {"facet_tags": np.array([*faces[:-1], tags.LAST_FACE])}),
    ):
        with pytest.raises(InputError, match="tags are not those of this body: make it again"):
            VolumeMesh(**(good | changes)).require_tags(layered, groups)
