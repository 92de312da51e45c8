"""The shipped body that tests of whole bodies deform."""

import pytest

from geometry.designfile import read_design
from hifi.manipulator import ManipulatorSolve
from tests import reference_case


@pytest.fixture
def reference():
    """A ManipulatorSolve of tests/data/reference.msh."""
    design = read_design(reference_case.DATA / "reference.toml")
    solve = ManipulatorSolve(design.manipulator, reference_case.DATA / "reference.msh")
    yield solve
    solve.destroy()
