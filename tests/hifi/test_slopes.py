"""Derivatives of free states by the shape, against states of cells whose mesh was moved and solved again; and
by how the material stiffens, against those of cells of stiffer materials."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean, Yeoh, unchecked
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.geometry.cad.grid import grid_cell
from pneunet.geometry.grids.cell import cell_grid
from pneunet.geometry.grids.morph import Morph
from pneunet.geometry.parameters import Segment
from pneunet.geometry.reference_cases import CASES
from pneunet.geometry.shape_numbers import DIRECTIONS, changed
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.slopes import StateSlopes
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")

STEPS = {"angle": 0.2, "wall": 2e-3}


def solved(problem, pressure):
    system = CellSystem(problem)
    path = EquilibriumPath(system, LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE))
    run_steps(path, pressure, StepSize(first=pressure / 4, smallest=pressure / 64))
    return system, system.measure()


def numbers(state):
    return state.strains.vector, state.stiffness


@pytest.mark.parametrize("name, pressure", [("one_sided_w10", 0.02), ("twist_w12", 0.02)])
def test_they_are_differences_of_states_on_the_moved_mesh(name, pressure, tmp_path):
    segment = CASES[name](angle=60.0, chambers=1, material=NeoHookean(0.2))
    mesh_cell(segment, 6.0, tmp_path / "cell.npz")
    problem = CellProblem(segment, tmp_path / "cell.npz", contact=WallPenalty())
    home = problem.mesh.geometry.x.copy()
    system, state = solved(problem, pressure)
    strains, stiffness = StateSlopes(problem).of(system)
    # all is where it was: measured again, nothing has changed
    assert (problem.mesh.geometry.x == home).all() and problem.segment == segment
    system.factorise()
    assert numbers(system.measure())[1] == pytest.approx(
        state.stiffness, rel=1e-9, abs=1e-9 * np.abs(state.stiffness).max()
    )
    system.destroy()
    for direction, step in STEPS.items():
        ends = []
        for sign in (1, -1):
            other = changed(segment, DIRECTIONS[segment.kind][direction], sign * step)
            problem.move(other, Morph(segment, other)(home))
            there, found = solved(problem, pressure)
            ends.append(numbers(found))
            there.destroy()
        row = list(DIRECTIONS[segment.kind]).index(direction)
        for slope, plus, minus in zip((strains[row], stiffness[row]), *ends):
            difference = (plus - minus) / (2 * step)
            assert slope == pytest.approx(difference, rel=0.02, abs=0.02 * np.abs(difference).max())


def test_a_cell_whose_grid_ends_elsewhere_has_none():
    """Its ceiling, 0.05 mm below the core's top, was lifted there, and its top with it."""
    segment = Segment("one-sided", 60.0, 1, cavity_floor=0.0, chamber_height=1.95)
    points = cell_grid(segment, 4.0).mesh(air=True).points
    mesh = SimpleNamespace(geometry=SimpleNamespace(x=points))
    with pytest.raises(InputError, match="no derivative is known there"):
        StateSlopes(SimpleNamespace(segment=segment, mesh=mesh))


def test_those_by_the_stiffening_are_differences_of_states_of_other_materials(tmp_path):
    ends, step = [], 0.01
    for c20, c30 in ((0.05, 0.0), (0.05 + step, 0.0), (0.05 - step, 0.0), (0.05, step), (0.05, -step)):
        material = unchecked(Yeoh, **vars(Yeoh(c10=0.1)) | {"c20": c20 * 0.1, "c30": c30 * 0.1})
        segment = CASES["one_sided_w10"](angle=60.0, chambers=1, material=material)
        grid_cell(segment, 6.0, tmp_path / "cell.npz", part=True)
        problem = CellProblem(segment, tmp_path / "cell.npz")
        system, state = solved(problem, 0.03)
        ends.append(numbers(state))
        if len(ends) == 1:
            slopes = StateSlopes(problem).of(system)
        system.destroy()
    for row, (plus, minus) in zip((-2, -1), (ends[1:3], ends[3:])):
        for slope, a, b in zip((s[row] for s in slopes), plus, minus):
            difference = (a - b) / (2 * step)
            assert slope == pytest.approx(difference, rel=0.02, abs=0.02 * np.abs(difference).max())
