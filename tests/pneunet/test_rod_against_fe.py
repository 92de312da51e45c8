"""The rod with a unit cell's law against finite elements of a short finger, free and hanging, on the same
grid."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import clamp
from pneunet.geometry import Manipulator
from pneunet.geometry.cad.mesh import mesh_manipulator
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.reference_cases import CASES
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.cell.file import CellCase
from pneunet.hifi.cell.run import solve_cell
from pneunet.reduced import QuadraticLaw, Rod
from pneunet.reduced.rod.clamp import held_lengths

MESH_SIZE, PRESSURE = 3.0, 0.01


@pytest.fixture(scope="module")
def finger(tmp_path_factory):
    folder, body = (
        tmp_path_factory.mktemp("rod"),
        Manipulator((CASES["one_sided_w10"](angle=60.0, chambers=3),)),
    )
    states = []
    solve_cell(
        CellCase(replace(body.segments[0], chambers=1), PRESSURE, MESH_SIZE, 1),
        folder / "cell.npz",
        states.append,
    )
    mesh_manipulator(body, MESH_SIZE, folder)
    return body, QuadraticLaw.of_states(states), folder / "manipulator.npz"


@pytest.mark.parametrize(
    "loads", [DeadLoads(), DeadLoads((0.0, 0.0, -3 * 9810.0))], ids=["free", "hanging at 3 g"]
)
def test_tips_agree_and_end_effects_are_why(finger, loads):
    body, law, mesh = finger
    solve = ManipulatorSolve(body, mesh, loads=loads)
    solve.run(PRESSURE, stability=False)
    tip = solve.measure().frames[-1, :3, 3]
    solve.destroy()
    moved = np.linalg.norm(tip - [body.length, 0, 0])
    rods = [Rod.of(body, law, PRESSURE, end_effects=end_effects) for end_effects in (True, False)]
    modelled, without = (np.linalg.norm(rod.equilibrium(loads).tip[:3, 3] - tip) for rod in rods)
    assert moved > 0.05 * body.length
    assert modelled < 0.01 * body.length and modelled < 0.9 * without


def test_a_clamp_holds_the_lengths_that_finite_elements_give():
    """A bar twice as wide as high; its own height is 1 mm."""
    told = held_lengths(2.0, 1.0)[list(clamp.AT)]
    np.testing.assert_allclose(told, clamp.computed(2.0), atol=0.005)
