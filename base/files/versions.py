"""Which versions computed a result: of pneunet, Python, the packages that are installed and the shared
libraries that this process has loaded."""

import os
import platform
import re
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

#: what a record calls it -> the distribution's name
DISTRIBUTIONS = {
    "pneunet": "pneunet",
    "numpy": "numpy",
    "scipy": "scipy",
    "mpi4py": "mpi4py",
    "petsc4py": "petsc4py",
    "dolfinx": "fenics-dolfinx",
    "gmsh": "gmsh",
}
#: the same -> the library's file; Debian's gmsh and MUMPS come without a distribution
LIBRARIES = {
    name: re.compile(rf"/lib{file}[^/\s]*?[.-](\d+\.\d+\.\d+)[^/\s]*$", re.MULTILINE)
    for name, file in {"petsc": "petsc", "mumps": "dmumps", "gmsh": "gmsh"}.items()
}
#: an image names itself by this variable; who starts it may give its digest
IMAGE = "PNEUNET_IMAGE"


def versions() -> dict[str, str]:
    """{name: version} of what is installed, of the libraries "petsc", "mumps", "gmsh" and "mpi" once they are
    loaded, and "image" inside a container image. What is not here has no entry."""
    try:
        loaded = Path("/proc/self/maps").read_text(errors="replace")
    except OSError:  # not Linux
        loaded = ""
    there = dict(_installed())
    there |= {name: match[1] for name, file in LIBRARIES.items() if (match := file.search(loaded))}
    if mpi := sys.modules.get("mpi4py.MPI"):
        there["mpi"] = mpi.Get_library_version().split(",")[0]
    if image := os.environ.get(IMAGE):
        there["image"] = image
    return there


@cache
def _installed() -> dict[str, str]:
    there = {"python": platform.python_version()}
    for name, distribution in DISTRIBUTIONS.items():
        try:
            there[name] = version(distribution)
        except PackageNotFoundError:
            pass
    return there
