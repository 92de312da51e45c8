"""`pneunet doctor`: is everything here that pneunet needs, and what to type if not.

Every check runs in a Python process of its own: a library that crashes at import is then a finding,
and doctor works on a Python that has none of them.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

SETUP = "make setup, then .venv/bin/pneunet doctor"


@dataclass(frozen=True)
class Finding:
    """One line of the report. `fix` is what to type; a finding that is not `needed` is advice."""

    name: str
    ok: bool
    text: str
    fix: str = ""
    needed: bool = True

    def __str__(self) -> str:
        mark = "OK     " if self.ok else "WRONG  " if self.needed else "advice "
        advice = f"\n        to fix: {self.fix}" if self.fix and not self.ok else ""
        return f"{mark} {self.name:<14} {self.text}{advice}"


# What prints each version. In this order: MPI and PETSc before what is built on them.
VERSIONS = {
    "numpy": "import numpy; print(numpy.__version__, 'in', numpy.__path__[0])",
    "scipy": "import scipy; print(scipy.__version__)",
    "mpi4py": "import mpi4py; print(mpi4py.__version__)",
    "MPI library": (
        "from mpi4py import MPI; print(MPI.Get_library_version().splitlines()[0].split(', package')[0])"
    ),
    "petsc4py": "import petsc4py; print(petsc4py.__version__)",
    "PETSc": "from petsc4py import PETSc; print('.'.join(map(str, PETSc.Sys.getVersion())))",
    # the distribution's name changed between the releases
    "ufl": (
        "import ufl; from importlib.metadata import packages_distributions as names,"
        " version\nprint(version(names()['ufl'][0]))"
    ),
    "basix": "import basix; print(basix.__version__)",
    "ffcx": "import ffcx; print(ffcx.__version__)",
    "dolfinx": "import dolfinx; print(dolfinx.__version__)",
    "gmsh": (
        "import gmsh; gmsh.initialize(['gmsh', '-nopopup'], readConfigFiles=False)\n"
        "assert 'OpenCASCADE' in gmsh.option.getString('General.BuildOptions'), 'gmsh without OpenCASCADE'\n"
        "print('module', gmsh.__version__ + ', library', gmsh.option.getString('General.Version'))"
    ),
    "pyvista": "import pyvista, vtk; print(pyvista.__version__ + ', VTK', vtk.vtkVersion().GetVTKVersion())",
    "matplotlib": "import matplotlib; print(matplotlib.__version__)",
}

SCALAR = (
    "from petsc4py import PETSc; import numpy as np\n"
    "assert np.dtype(PETSc.ScalarType) == np.float64, f'{np.dtype(PETSc.ScalarType)}, must be float64'\n"
    "print('float64 (real)')"
)
MUMPS = (
    "from petsc4py import PETSc\nassert PETSc.Sys.hasExternalPackage('mumps'), 'PETSc without"
    " MUMPS'\nprint('in PETSc')"
)
# The kernel's list of mapped files: the BLAS that is really loaded, all symbolic links resolved.
BLAS = r"""
from petsc4py import PETSc
import os, re
PETSc.Vec().createSeq(1)
maps = open("/proc/self/maps").read()
files = re.findall(r"/.*/(?:libblas|libopenblas|libmkl_rt|libblis|libatlas)[^/\n]*$", maps, re.M)
print(*sorted({os.path.realpath(f) for f in files}))
"""
COMPILE = (
    "from mpi4py import MPI; from petsc4py import PETSc; import dolfinx, ufl\n"
    "mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)\n"
    "one = dolfinx.fem.Constant(mesh, PETSc.ScalarType(1))\n"
    "assert abs(dolfinx.fem.assemble_scalar(dolfinx.fem.form(one * ufl.dx(mesh))) - 1) < 1e-12\n"
    "print('a form was compiled and integrated')"
)
DRAW = (
    "import pyvista\n"
    "plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))\n"
    "plotter.add_mesh(pyvista.Sphere(), color='red', lighting=False)\n"
    "assert (plotter.screenshot()[32, 32] == (255, 0, 0)).all(), 'the picture is not what was drawn'\n"
    "print(type(plotter.render_window).__name__)"
)
RANKS = """import sys
from pneunet.base.system import launch
code = "from mpi4py import MPI; c = MPI.COMM_WORLD; s = c.allreduce(c.rank); c.rank or print(c.size, s)"
sys.exit(launch.run(2, ["--", sys.executable, "-P", "-c", code]))
"""


def probe(code: str, **env: str) -> tuple[bool, str]:
    """Run Python code apart; (True, what it printed) or (False, the last line of what went wrong)."""
    command = [sys.executable, "-P", "-c", code]
    try:
        done = subprocess.run(
            command,
            env={**os.environ, **env},
            cwd=sys.prefix,  # no settings from the working directory
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
        )
    except subprocess.TimeoutExpired:
        return False, "no answer within 120 s"
    if done.returncode == 0:
        return True, done.stdout.strip()
    if done.returncode < 0:
        return False, f"crashed with signal {-done.returncode}"
    return False, (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]


def check_blas() -> Finding:
    """The BLAS in use: the reference one is right but slow."""
    ok, text = probe(BLAS)
    if not ok or not text:
        return Finding("BLAS", False, text or "no BLAS is loaded with PETSc", SETUP)
    if any("/blas/libblas" in path for path in text.split()):
        fix = (
            "apt-get install libopenblas0-serial; update-alternatives --auto libblas.so.3-$(gcc"
            " -print-multiarch)"
        )
        return Finding("BLAS", False, f"{text} (reference BLAS, 4-5 times slower)", fix)
    return Finding("BLAS", True, text)


def check_threads() -> Finding:
    """One thread a rank: threads of BLAS beside MPI ranks only get in each other's way."""
    value = os.environ.get("OMP_NUM_THREADS")
    if value in (None, "1"):
        return Finding(
            "threads", True, f"OMP_NUM_THREADS={value or 'not set (pneunet run and make set it to 1)'}"
        )
    text = f"OMP_NUM_THREADS={value}: threads and ranks compete for the cores"
    return Finding("threads", False, text, "export OMP_NUM_THREADS=1", needed=False)


def check_ranks() -> Finding:
    """Two ranks add their numbers."""
    ok, text = probe(RANKS)
    if ok and text.split()[-2:] != ["2", "1"]:
        ok, text = (
            False,
            f"expected '2 1' from two ranks, got {text!r}: mpirun and mpi4py are of different MPIs",
        )
    return Finding("2 ranks", ok, "sum of ranks is right" if ok else text, SETUP)


def findings() -> Iterator[Finding]:
    """The findings, one after the other as they are made."""
    text = f"{sys.version.split()[0]}, {sys.executable}"
    yield Finding("Python", sys.version_info >= (3, 11), text, SETUP)
    for name, code in VERSIONS.items():
        yield Finding(name, *probe(code), SETUP)
    compiler = "apt-get install gcc libc6-dev python3-dev"
    yield Finding(
        "scalars", *probe(SCALAR), "apt-get install python3-petsc4py-real; unset PETSC_DIR PETSC_ARCH"
    )
    yield Finding("MUMPS", *probe(MUMPS), SETUP)
    yield check_blas()
    with tempfile.TemporaryDirectory() as cache:  # an empty form cache, so that the compiler does run
        yield Finding("form compiler", *probe(COMPILE, XDG_CACHE_HOME=cache), compiler)
    window = {} if os.environ.get("DISPLAY") else {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow"}
    yield Finding(
        "drawing", *probe(DRAW, **window), "apt-get install libegl1 libgl1-mesa-dri libx11-6 libxrender1"
    )
    yield check_ranks()
    yield check_threads()


def report() -> list[Finding]:
    """All findings about this Python and this machine."""
    return list(findings())


def main() -> int:
    """Print the report; 0 if all that is needed is there, else 1."""
    wrong = 0
    for finding in findings():
        print(finding, flush=True)
        wrong += finding.needed and not finding.ok
    print(f"{wrong} of the above must be fixed" if wrong else "all that is needed is there")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
