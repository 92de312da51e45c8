"""The wheel: what is in it, and that it designs with numpy and scipy alone, in an environment of its own.

Nothing is downloaded and the checkout stays as it is: built from a copy of what git has, with what is
installed here.
"""

import csv
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from tests.test_architecture import NUMPY_AND_SCIPY_ALONE, PACKAGES, ROOT

OFFLINE = ["--no-deps", "--no-index", "--disable-pip-version-check", "-q"]
DESIGN_AND_SHAPE = """import sys
from pathlib import Path
from pneunet import design
from pneunet.cli import main
shipped = Path(design.__path__[0]) / "data" / "octopus.toml"
assert main(["design", str(shipped), "-o", "out"]) == 0
assert main(["shape", "out/design.toml", "--pressure-kPa", "10,20,40"]) == 0
"""
#: what other systems than Linux lack: installed code that designs never asks for it
WITHOUT_POSIX = """import sys
for name in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[name] = None
"""


def run(*command, cwd, code=0):
    """The finished process of a command that must end with this exit code."""
    line = [str(word) for word in command]
    done = subprocess.run(line, cwd=cwd, capture_output=True, text=True)
    assert done.returncode == code, f"{line}\n{done.stdout}\n{done.stderr}"
    return done


def tracked():
    names = run("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", cwd=ROOT).stdout
    return [name for name in names.split("\0") if name and (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """(wheel of a copy of the checkout, wheel of the sdist of that copy)."""
    if not (ROOT / ".git").exists():  # an unpacked sdist, or the copy in the image
        pytest.skip("no checkout: only git knows which files belong into a wheel")
    copy = tmp_path_factory.mktemp("copy")
    for name in tracked():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, copy / name)
    build_sdist = "from setuptools import build_meta; build_meta.build_sdist('sdist')"
    run(sys.executable, "-W", "ignore", "-c", build_sdist, cwd=copy)
    for source, folder in ((".", "wheel"), (next((copy / "sdist").iterdir()), "again")):
        pip = (sys.executable, "-m", "pip", "wheel", *OFFLINE, "--no-build-isolation", "-w", folder, source)
        run(*pip, cwd=copy)
    return tuple(next((copy / folder).glob("*.whl")) for folder in ("wheel", "again"))


@pytest.fixture(scope="module")
def python(wheels, tmp_path_factory):
    """Python of a new environment that holds the wheel, and of this machine's packages numpy and scipy
    alone."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    python = folder / "bin" / "python"
    site = Path(
        run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).stdout.strip()
    )
    run(sys.executable, "-m", "pip", "--python", python, "install", *OFFLINE, wheels[0], cwd=folder)
    installed = {path.name for path in site.iterdir()}
    assert installed == {"pneunet", f"{wheels[0].name.removesuffix('-py3-none-any.whl')}.dist-info"}
    links = folder / "links"
    links.mkdir()
    for name in ("numpy", "scipy"):
        package = Path(importlib.util.find_spec(name).submodule_search_locations[0])
        for path in (package, package.with_name(f"{name}.libs")):
            if path.exists():
                (links / path.name).symlink_to(path)
    (links / "without_posix.py").write_text(WITHOUT_POSIX)
    (site / "links.pth").write_text(f"{links}\nimport without_posix\n")
    return python


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, in somebody else's repository."""
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)  # as a user has it
    monkeypatch.delenv("PYTHONPATH", raising=False)
    run("git", "init", "-q", cwd=tmp_path)
    return tmp_path


def test_every_folder_of_modules_is_a_package_that_is_installed():
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = {p.parent.relative_to(ROOT) for top in PACKAGES for p in (ROOT / top).rglob("*.py")}
    assert all((ROOT / folder / "__init__.py").exists() for folder in folders)
    names = [".".join(folder.parts) for folder in folders]
    assert sorted(listed) == sorted(n if n == "pneunet" else f"pneunet.{n}" for n in names)


def test_the_wheel_holds_the_packages_with_their_data_and_nothing_else(wheels):
    expected = {
        name if name.startswith("pneunet/") else f"pneunet/{name}"
        for name in tracked()
        if Path(name).parts[0] in PACKAGES
    }
    for wheel in wheels:
        names = set(zipfile.ZipFile(wheel).namelist())
        assert {name for name in names if ".dist-info/" not in name} == expected
    for data in ("py.typed", "design/data/octopus.toml", "reduced/data/rod-law-v2.npz"):
        assert f"pneunet/{data}" in expected
    assert any(name.startswith("pneunet/hifi/verification/data/") for name in expected)


def test_the_sdist_makes_the_same_wheel(wheels):
    one, two = ({item.filename: item.CRC for item in zipfile.ZipFile(wheel).infolist()} for wheel in wheels)
    assert one == two


def test_installed_it_imports_with_numpy_and_scipy_alone(python, folder):
    modules, public = map(int, run(python, "-c", NUMPY_AND_SCIPY_ALONE, cwd=folder).stdout.split())
    assert modules >= 60 and public >= 200
    run(python, "-c", "import dolfinx", cwd=folder, code=1)


def test_installed_it_designs_and_predicts(python, folder):
    """In one process, so that what the law works out once serves both."""
    told_version = run(python.with_name("pneunet"), "--version", cwd=folder).stdout
    told = run(python, "-c", DESIGN_AND_SHAPE, cwd=folder).stdout
    assert told.count("no picture: ") == told.count("no pictures: ") == 1
    assert told.count("pip install 'pneunet[pictures]'") == 2
    with open(folder / "out" / "shape" / "centrelines.csv", newline="") as stream:
        assert {row["pressure_kPa"] for row in csv.DictReader(stream)} == {"10", "20", "40"}
    revision = json.loads((folder / "out" / "run.json").read_text())["revision"]
    assert told_version == f"pneunet {revision}\n" and re.fullmatch(r"[\d.]+", revision)


@pytest.mark.parametrize("command", ["solve", "mesh", "export", "cell", "study", "campaign"])
def test_what_needs_more_says_what_to_install(python, folder, command):
    design = ROOT / "hifi" / "verification" / "data" / "reference.toml"
    done = run(python.with_name("pneunet"), command, design, "-o", "out", cwd=folder, code=2)
    assert done.stderr.count("\n") == 1 and done.stdout == ""
    assert done.stderr.startswith("pneunet: ") and " is missing here: " in done.stderr
    assert ("pip install gmsh" if command in ("mesh", "export") else "make setup") in done.stderr
    assert not any(path.name != ".git" and any(path.iterdir()) for path in folder.iterdir())
