"""Compiled forms: kills and neighbours do no harm, and settings in the working directory are not obeyed."""

import os
import signal
import subprocess
import sys
import time

from pneunet.hifi.fem.form_cache import form_cache, lock_module

FORM = """
from pneunet.base.errors import InputError
from pneunet.hifi.fem import compat
from mpi4py import MPI
from dolfinx import fem, mesh
import ufl
from petsc4py import PETSc

cube = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
try:
    compiled = compat.compile_form(fem.Constant(cube, PETSc.ScalarType(2)) * ufl.dx(cube))
except InputError as error:
    raise SystemExit(str(error))
assert abs(fem.assemble_scalar(compiled) - 2) < 1e-12
print(*sorted(set(PETSc.Options().getAll()) - {"skip_petscrc"}))
"""
GMSH = """
import gmsh
from pneunet.geometry.cad.body import session
with session():
    print(gmsh.option.getNumber("Mesh.MeshSizeFactor"))
"""


def start(code, folder, **environment):
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_kill_while_a_form_compiles_stops_nobody(tmp_path):
    killed = start(FORM, tmp_path, XDG_CACHE_HOME=str(tmp_path))
    deadline = time.monotonic() + 60
    while not list(tmp_path.rglob("libffcx_*.c")) and time.monotonic() < deadline:
        time.sleep(0.001)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    (half,) = tmp_path.rglob("libffcx_*.c")
    assert not half.with_suffix(".c.cached").exists()
    both = [start(FORM, tmp_path, XDG_CACHE_HOME=str(tmp_path)) for _ in range(2)]
    for process in both:
        assert process.communicate(timeout=60) == ("\n", "") and process.returncode == 0
    assert half.with_suffix(".c.cached").exists()


def test_who_wants_another_form_than_a_neighbour_does_not_wait(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    form_cache().mkdir(parents=True)
    lock = lock_module("libffcx_forms_of_a_neighbour")
    process = start(FORM, tmp_path)
    assert process.communicate(timeout=60) == ("\n", "") and process.returncode == 0
    os.close(lock)


def test_a_cache_that_cannot_be_written_to_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    process = start(FORM, tmp_path, XDG_CACHE_HOME=str(tmp_path / "file"))
    told = process.communicate(timeout=60)[1]
    assert process.returncode == 1 and told.count("\n") == 1
    assert "file/pneunet" in told and "set XDG_CACHE_HOME" in told


def test_settings_in_the_working_directory_and_at_home_are_not_obeyed(tmp_path):
    for folder in (tmp_path, tmp_path / "dolfinx", tmp_path / "ffcx"):
        folder.mkdir(exist_ok=True)
        for name in ("dolfinx_jit", "ffcx"):
            for kind in ("parameters", "options"):
                (folder / f"{name}_{kind}.json").write_text("no JSON")
    (tmp_path / ".petscrc").write_text("-mat_mumps_icntl_14 1\n-info :told\n")
    (tmp_path / ".gmshrc").write_text("Mesh.MeshSizeFactor = 7;\nMesh.CharacteristicLengthFactor = 7;\n")
    home = {"HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path)}
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for code, answer in ((FORM, "\n"), (GMSH, "1.0\n")):
        process = start(code, tmp_path, **home, XDG_CACHE_HOME=cache)
        assert process.communicate(timeout=60) == (answer, "")
    assert not list(tmp_path.glob("told*"))
