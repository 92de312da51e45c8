"""run.json tells how a result came to be."""

import json
import os
import subprocess
import sys
from importlib.metadata import version

import numpy as np
import pytest

from pneunet.base.files import record
from pneunet.base.files.versions import versions


def test_record_holds_how_and_what(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/some/where/pneunet", "solve", "my design.toml"])
    written = record.write_record(tmp_path, ranks=2, seconds=np.float64(1.5), steps=[{"pressure_kPa": 2.0}])
    read = json.loads((tmp_path / "run.json").read_text())
    assert read == written
    assert read["command"] == "pneunet solve my design.toml"  # the machine's path to the program is left out
    assert read["ranks"] == 2 and read["seconds"] == 1.5 and read["steps"] == [{"pressure_kPa": 2.0}]
    assert read["machine"]["cores"] == os.cpu_count() and read["machine"]["processor"]
    assert read["date"].endswith("Z") and read["revision"]
    assert read["versions"]["numpy"] == np.__version__ and read["versions"]["pneunet"] == version("pneunet")


def test_versions_are_of_what_is_loaded_and_of_the_image(monkeypatch):
    """Of libraries that only shared objects know, in a process of its own that loads one."""
    pytest.importorskip("gmsh", reason="no gmsh here: no shared library to ask")
    code = """import gmsh, json
from pneunet.base.files.versions import versions
gmsh.initialize(["gmsh", "-nopopup"], readConfigFiles=False)
print(json.dumps([versions(), gmsh.option.getString("General.Version")]))"""
    environment = {**os.environ, "PNEUNET_IMAGE": "mine"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    found, of_library = json.loads(done.stdout)
    assert found["gmsh"] == of_library and found["image"] == "mine" and "mumps" not in found
    monkeypatch.delenv("PNEUNET_IMAGE", raising=False)
    assert "image" not in versions()


def test_revision_is_the_checkouts_commit(monkeypatch):
    line = ["git", "describe", "--always", "--dirty", "--abbrev=12"]
    expected = subprocess.run(line, cwd=record.ROOT, capture_output=True, text=True)
    if expected.returncode == 0 and (record.ROOT / ".git").exists():
        assert record.revision() == expected.stdout.strip()
    monkeypatch.setenv("PATH", "/nowhere")  # no git
    assert record.revision() == version("pneunet")


def test_revision_of_installed_code_is_not_that_of_somebody_elses_repository(tmp_path, monkeypatch):
    """Nor is that of a copy without a history of its own, which may say what it is of."""
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    for root in (tmp_path / "lib" / "site-packages", tmp_path, tmp_path / "copy"):
        root.mkdir(parents=True, exist_ok=True)
        monkeypatch.setattr(record, "ROOT", root)
        assert record.revision() == version("pneunet")
        (tmp_path / "copy").mkdir(exist_ok=True)
        (tmp_path / "copy" / "pyproject.toml").write_text("")
    (tmp_path / "copy" / ".revision").write_text("3a03395c\n")
    assert record.revision() == "3a03395c"
