import json
from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.dataset import (
    SCHEMA,
    UPPER,
    CellData,
    columns,
    read_dataset,
    write_dataset,
)
from pneunet.base.files.datasheet import datasheet


@pytest.fixture
def data():
    """Three cases: P V of a linear spring, one that bends to a forbidden side, one that was ended; all with
    four free states."""
    P = np.array([0.0, 0.1, 0.2, 0.3])
    about = {
        "kinds": ["one-sided", "twisting"],
        "meshes": [{"name": "coarse", "mesh_size_mm": 2.0, "element": "hexahedra"}],
        "shape": [f"s{i}" for i in range(13)],
        "stiffening": ["c20/c10", "c30/c10"],
        "statuses": ["done", "crashed"],
        "directions": {},
        "reasons": {"2": "ended by signal SIGSEGV"},
        "campaign": {"designs": 3},
        "ranges": {"one-sided": {"wall_mm": [0.8, 1.6]}, "twisting": {"wall_mm": [0.8, 1.6]}},
        "largest_symmetry_defect": 0.02,
        "revisions": ["abc"],
    }
    n, m = 3, 8
    sizes = {"cases": n, "states": m}
    arrays = {
        f.name: np.zeros((sizes[f.metadata["of"]], *f.metadata["shape"]), f.metadata["type"])
        for f in columns()
    }
    arrays["status"][2] = 1
    arrays["case"][:] = np.repeat([0, 1], 4)
    arrays["pressure"][:] = np.tile(P, 2)
    arrays["volume"][:] = 2.0 + 5.0 * np.tile(P, 2)
    arrays["energy"][:] = 5.0 / 2 * np.tile(P, 2) ** 2
    arrays["strains"][:, 0] = 1.0
    arrays["strains"][:, 4] = np.tile(P, 2)
    arrays["strains"][4:, 5] = 0.1 * P
    return CellData(about, **arrays)


def test_a_file_gives_back_what_was_written(tmp_path, data):
    matrix = np.random.default_rng(1).random((8, 6, 6))
    data = replace(data, stiffness=(matrix + matrix.transpose(0, 2, 1))[:, UPPER[0], UPPER[1]].astype("f4"))
    slopes = np.random.default_rng(2).normal(size=data.strain_slopes.shape).astype("f4")
    slopes[0] = np.nan
    data = replace(data, strain_slopes=slopes)
    write_dataset(tmp_path / "cells.npz", data)
    again = read_dataset(tmp_path / "cells.npz")
    assert again.strain_slopes == pytest.approx(slopes, rel=1.3e-4, abs=0, nan_ok=True)
    write_dataset(tmp_path / "again.npz", again)
    assert np.array_equal(
        read_dataset(tmp_path / "again.npz").strain_slopes, again.strain_slopes, equal_nan=True
    )
    for f in columns():
        if f.name != "strain_slopes":
            assert (getattr(again, f.name) == getattr(data, f.name)).all()
    assert again.about == {"schema": SCHEMA, **data.about}
    assert again.matrices == pytest.approx(matrix + matrix.transpose(0, 2, 1), rel=1e-6)


def test_a_case_is_accepted_when_it_is_done_stable_and_symmetric(data):
    assert data.symmetry_defect[:2] == pytest.approx([0, 0.1 / np.hypot(1, 0.1)])
    assert data.accepted.tolist() == [True, False, False]
    data.unstable[3] = 1
    assert not data.accepted.any()


def test_energy_defect_is_what_the_work_of_the_pressure_misses(data):
    assert data.energy_defect()[:2] == pytest.approx([0, 0], abs=1e-6)
    data.energy[3] *= 1.01
    assert data.energy_defect()[0] == pytest.approx(0.01, rel=1e-4)
    assert np.isnan(data.energy_defect()[2])


def test_the_data_sheet_names_what_was_not_accepted(data):
    text = datasheet(data)
    assert "| coarse (mesh_size_mm 2, element hexahedra) | 3 | 1 (33.3%) |" in text
    assert "crashed: ended by signal SIGSEGV" in text and "symmetry defect 10.0%" in text


def test_another_schema_and_another_file_are_refused(tmp_path, data):
    path = tmp_path / "cells.npz"
    np.savez(path, about=np.frombuffer(json.dumps({"schema": "other"}).encode(), np.uint8))
    with pytest.raises(
        InputError, match="cells.npz: schema 'other' is not [^:]*: make it again with pneunet campaign$"
    ):
        read_dataset(path)
    path.write_text("no archive")
    with pytest.raises(InputError, match="not a data set"):
        read_dataset(path)
    with pytest.raises(InputError, match="'volume' has shape"):
        replace(data, volume=np.zeros(3))


def test_what_is_wrong_in_a_file_is_named_with_its_member(tmp_path, data):
    path = tmp_path / "cells.npz"
    write_dataset(path, data)
    with np.load(path) as stored:
        arrays = dict(stored)
    energy, table = arrays["energy"].copy(), json.loads(bytes(arrays["about"]))
    energy[3] = np.nan

    def about(**changed):
        return np.frombuffer(json.dumps(table | changed).encode(), np.uint8)

    for changed, told in (
        ({"energy": energy}, "member 'energy': holds nan"),
        ({"energy": energy[1:]}, r"member 'energy': has shape \(7,\), not \(8,\)"),
        ({"energy": energy.astype(complex)}, "member 'energy': its type is of kind 'c', not 'f'"),
        ({"case": arrays["case"] + 2}, "member 'case': holds 3, where numbers in 0..3 are wanted"),
        ({"kind": arrays["kind"] - 1}, "member 'kind': holds -1"),
        ({"energy": None}, "member 'energy': is missing"),
        ({"about": np.frombuffer(b"[1]", np.uint8)}, "member 'about': is no table of keys"),
        ({"about": about(kinds="twisting")}, "member 'about' has no list 'kinds'"),
        ({"about": about(meshes=[5])}, "member 'about': '5' is not understood"),
        ({"about": about(kinds=[[1]])}, r"member 'about': '\[1\]' is not understood"),
        ({"about": about(meshes=[{"name": [1], "mesh_size_mm": 1}])}, "member 'about': .*is not understood"),
        (
            {"about": about(meshes=[{"name": "a", "mesh_size_mm": "b"}])},
            "member 'about': .*is not understood",
        ),
        ({"about": about(statuses=["crashed", "x"])}, "member 'about': 'statuses' is not understood"),
    ):
        np.savez(path, **{name: value for name, value in (arrays | changed).items() if value is not None})
        with pytest.raises(InputError, match=f"cells.npz: {told}.*: make it again with pneunet campaign$"):
            read_dataset(path)
