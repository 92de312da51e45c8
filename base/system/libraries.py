"""Libraries that pneunet can do without: a command that needs one says in a line what to install."""

from collections.abc import Iterator
from contextlib import contextmanager

from pneunet.base.errors import InputError
from pneunet.base.system.interrupts import deferred, is_interrupted

_SOLVERS = (
    "pip does not bring finite elements; on Debian 12 or 13 run 'make setup' in a checkout of pneunet,"
    " elsewhere use its container image ('make image')"
)
_VIEW = "install it with: pip install 'pneunet[view]'"
_PICTURES = "install it with: pip install 'pneunet[pictures]'"
#: module -> what to do where it is missing
MISSING = {
    **dict.fromkeys(("dolfinx", "ufl", "basix", "ffcx", "mpi4py", "petsc4py"), _SOLVERS),
    **dict.fromkeys(("pyvista", "vtk", "vtkmodules", "matplotlib", "PIL"), _PICTURES),
    **dict.fromkeys(("trimesh", "manifold3d"), "install it with: pip install 'pneunet[moulds]'"),
    **dict.fromkeys(("fcntl", "resource"), "this runs on Linux alone; elsewhere use the container image"),
    **dict.fromkeys(("plotly", "imageio_ffmpeg"), _VIEW),
    "shtab": "install it with: pip install 'pneunet[completion]'",
    "gmsh": "install it with: pip install gmsh (in a checkout on Debian: make setup)",
}


@contextmanager
def told_what_to_install() -> Iterator[None]:
    """An import of the block that fails for want of one of these libraries is an InputError with the fix."""
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in MISSING:
            raise
        raise InputError(f"{name} is missing here: {MISSING[name]}") from None


def load_vtk() -> None:
    """Load pyvista before it is used. Interrupted while it loads VTK, it would lose the signal or crash: the
    signal is heeded at the end."""
    with deferred():
        import pyvista  # noqa: F401

        if is_interrupted():
            raise KeyboardInterrupt
