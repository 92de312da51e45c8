"""The shipped body that tests of whole bodies deform."""

import pytest

from pneunet.geometry.designfile import read_design_file
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.verification import reference_case


@pytest.fixture
def reference():
    """A ManipulatorSolve of hifi/verification/data/reference.npz."""
    design = read_design_file(reference_case.DATA / "reference.toml")
    solve = ManipulatorSolve(design.manipulator, reference_case.DATA / "reference.npz")
    yield solve
    solve.destroy()
