"""A library that is missing is told in one line with what to install; any other missing module is a bug."""

import pytest

from pneunet.base.errors import InputError
from pneunet.base.system.libraries import told_what_to_install


@pytest.mark.parametrize(
    ("name", "fix"),
    [
        ("dolfinx", "make setup"),
        ("petsc4py.PETSc", "make setup"),
        ("gmsh", "pip install gmsh"),
        ("vtkmodules.vtkCommonCore", r"pip install 'pneunet\[pictures\]'"),
        ("matplotlib", "pip install"),
        ("fcntl", "Linux alone"),
    ],
)
def test_what_is_missing_is_named_with_its_fix(name, fix):
    with pytest.raises(InputError, match=f"^{name.partition('.')[0]} is missing here: .*{fix}") as error:
        with told_what_to_install():
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    assert "\n" not in str(error.value)


def test_other_missing_modules_are_bugs():
    with pytest.raises(ModuleNotFoundError):
        with told_what_to_install():
            import pneunet.base.nowhere  # noqa: F401
