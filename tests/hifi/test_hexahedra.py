"""Cells and bodies on grids of hexahedra: the same solver code, and half turns."""

from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest
from dolfinx.mesh import CellType
from mpi4py import MPI
from scipy.spatial import cKDTree

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import tags
from pneunet.geometry.cad.grid import grid_cell
from pneunet.geometry.grids.body import body_grid
from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.reference_cases import CASES
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.slopes import StateSlopes
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
from pneunet.hifi.cell.unfolding import unfolding
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.fem import compat, surface
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.verification.cells import flexure

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")


def problem_of(name, folder, size=2.5, part=False):
    segment, path = CASES[name](60.0, 1), folder / f"{part}.npz"
    facts = grid_cell(segment, size, path, part=part)
    return CellProblem(segment, path), facts


def touching(segment, folder, part):
    """A coarse cell whose walls will touch."""
    grid_cell(segment, 6.0, folder / "cell.npz", part=part)
    return CellProblem(segment, folder / "cell.npz", contact=WallPenalty())


def solved(problem, pressure):
    system = CellSystem(problem)
    path = EquilibriumPath(system, LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE))
    run_steps(path, pressure, StepSize(first=0.005, smallest=1e-4))
    state = system.measure()
    system.destroy()
    return state


def agree(part, whole, tolerance):
    """Two CellStates of free cells."""
    names = ["strains.vector", "stiffness", "volume", "wall_distance", "largest_stretch", "unstable"]
    if whole.contact:
        names += [f"contact.{name}" for name in ("force", "area", "nearest", "farthest")]
    for name in names:
        a, b = (attrgetter(name)(state) for state in (part, whole))
        assert a == pytest.approx(b, rel=tolerance, abs=tolerance * np.abs(b).max()), name
    assert np.append(part.force, part.moment) == pytest.approx(np.zeros(6), abs=1e-6)


@pytest.mark.parametrize(("name", "copies"), [("one_sided_w10", 2), ("twist_w12", 4)])
def test_a_part_of_the_cell_and_half_turns_are_the_cell(name, copies, tmp_path):
    """Its free state, its stiffness, for which perturbations without the symmetry are needed, and what is
    measured on images of its walls."""
    (whole, facts), (part, of_part) = (problem_of(name, tmp_path, 4.0, part=p) for p in (False, True))
    assert of_part["cells"] * copies == facts["cells"]
    assert of_part["air_mm3"] == pytest.approx(facts["air_mm3"])
    assert sum(c.unknowns + c.gauge.shape[1] for c in part.classes) == whole.unknowns + 6
    states = [solved(problem, 0.02) for problem in (whole, part)]
    agree(states[1], states[0], 1e-6)
    e, k = states[1].strains.e, states[1].strains.k
    zero = [e[2], k[2]] if copies == 2 else [*e[1:], *k[1:]]
    assert not np.any(zero)


def as_whole(part, whole):
    """State array (dofs,) of a whole cell that the part's makes by its half turns."""
    out = np.zeros_like(whole.array)
    pressures = (problem.pressure_space.tabulate_dof_coordinates() for problem in (part, whole))
    for (own, other), values, dofs, signs in (
        ((part.nodes, whole.nodes), part.displacement(), whole.displacement_dofs, part.turns),
        (pressures, part.pressure_field()[:, None], whole.pressure_dofs[:, None], np.ones((4, 1))),
    ):
        shifts = part.segment.pitch * np.array([-1, 0, 1])[:, None, None] * [1, 0, 0]
        places = np.concatenate([own * turn + shifts for turn in part.turns], axis=1).reshape(-1, 3)
        images = np.concatenate([values * sign for sign, _ in zip(signs, part.turns)])
        distance, nearest = cKDTree(places).query(other)
        assert distance.max() < 1e-6
        out[dofs] = np.tile(images, (3, 1))[nearest]
    return out


@pytest.mark.parametrize(("name", "pressure"), [("one_sided_w10", 0.03), ("twist_w15", 0.01)])
def test_walls_of_a_part_of_the_cell_touch_as_those_of_the_cell(name, pressure, tmp_path):
    """The whole gap's walls are images of the part's; perturbations without the symmetry feel them too. The
    part's equilibrium is one of the whole."""
    segment = replace(CASES[name](60.0, 1), gap=0.1, material=NeoHookean(1.0))
    part, whole = (touching(segment, tmp_path, each) for each in (True, False))
    state, system = solved(part, pressure), CellSystem(whole)
    assert state.contact.force > 0.01 and not state.walls_overlap
    x = system.state.copy()
    kept = whole.reduced >= 0
    x[whole.reduced[kept]] = as_whole(part, whole)[kept]
    x[-6:] = state.strains.vector
    system.state, system.load = x, pressure
    residual, scale = system.residual()
    assert np.linalg.norm(residual) < 2 * RELATIVE_TOLERANCE * scale
    agree(state, system.measure(), 1e-8)
    assert part.stored_energy() == pytest.approx(whole.stored_energy(), rel=1e-9)
    system.destroy()


@pytest.mark.parametrize("name", ["one_sided_w10", "twist_w15"])
def test_a_part_s_state_unfolded_is_an_equilibrium_of_the_cell(name, tmp_path):
    segment = replace(CASES[name](60.0, 1), gap=0.1, material=NeoHookean(1.0))
    part, whole = (touching(segment, tmp_path, p) for p in (True, False))
    systems = [CellSystem(problem) for problem in (part, whole)]
    path = EquilibriumPath(systems[0], LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE))
    run_steps(path, 0.01, StepSize(first=0.005, smallest=1e-4))
    systems[1].load, systems[1].state = 0.01, unfolding(part, whole)(systems[0].state)
    residuals = [np.linalg.norm(system.residual()[0]) for system in systems]
    assert residuals[1] < 2 * residuals[0] + 1e-10
    assert whole.contact.energy() == pytest.approx(part.contact.energy(), rel=1e-8)
    for system in systems:
        system.destroy()


def test_all_classes_count_unstable_directions(tmp_path):
    """Under a pressure that the body cannot hold at rest."""
    counts = []
    for part in (False, True):
        problem, _ = problem_of("twist_w12", tmp_path, 5.0, part)
        system = CellSystem(problem)
        system.load = 0.5
        counts.append(system.measure().unstable)
        system.destroy()
    assert counts[0] == counts[1] > 0


def test_a_part_of_the_cell_has_the_whole_s_derivatives_by_the_shape(tmp_path):
    """Of the strains and of all of the stiffness, whose entries belong to different classes; where walls
    touch."""
    slopes, segment = [], replace(CASES["one_sided_w10"](60.0, 1), gap=0.1, material=NeoHookean(1.0))
    for part in (False, True):
        problem = touching(segment, tmp_path, part)
        system = CellSystem(problem)
        path = EquilibriumPath(system, LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE))
        run_steps(path, 0.03, StepSize(first=0.01, smallest=1e-4))
        system.factorise()
        assert system.overreach > 0
        slopes.append(StateSlopes(problem).of(system))
        system.destroy()
    for whole, part in zip(*slopes):
        assert part == pytest.approx(whole, rel=1e-3, abs=1e-4 * np.abs(whole).max())


def test_the_tangent_is_the_slope_of_the_residual(tmp_path):
    problem, _ = problem_of("twist_w12", tmp_path, 4.0, part=True)
    system = CellSystem(problem)
    system.load = 0.01
    random = np.random.default_rng(3)
    x = system.state + np.where(np.arange(len(system.state)) < problem.unknowns, 0.01, 0) * random.normal(
        size=len(system.state)
    )
    way = random.normal(size=len(x) - 6) * np.append(
        np.ones(problem.unknowns), np.zeros(len(x) - 6 - problem.unknowns)
    )
    system.state = x
    matrix, _, _ = problem.tangent()
    ends = []
    for h in (1e-5, -1e-5):
        system.state = x + np.append(h * way, np.zeros(6))
        ends.append(problem.residual()[0])
    slope = (ends[0] - ends[1]) / 2e-5
    assert (matrix @ way)[: problem.unknowns] == pytest.approx(
        slope, rel=1e-6, abs=1e-8 * np.abs(slope).max()
    )


def test_quadrilaterals_tile_the_channel_s_wall(tmp_path):
    problem, _ = problem_of("one_sided_w10", tmp_path)
    s = problem.segment
    facets = surface.facet_nodes(problem, tags.CHANNEL)
    # over a pitch, but for where the chamber opens into the channel
    area = 2 * (s.channel_width + s.channel_height) * s.pitch - s.channel_width * s.cavity_thickness / s.sin
    assert facets.shape[1] == 9
    assert surface.reference_areas(problem, facets).sum() == pytest.approx(area)
    halves = [surface.SlabIntegral(problem, facets, *ends) for ends in ((-np.inf, 0.3), (0.3, np.inf))]
    assert sum(half.area for half in halves) == pytest.approx(area)
    # a rigid motion of the nodes is one of the surface
    both = surface.SlabIntegral(problem, facets)
    assert both.weights.sum() == pytest.approx(area)
    assert both.first.sum(axis=0) == pytest.approx(both.centre)
    a, b, c = (problem.nodes[facets[:, i]] for i in range(3))
    outward = np.einsum("ni,ni->n", np.cross(b - a, c - a), (a + c) / 2 * [0, 1, 1])
    assert (outward < 0).all()  # out of the body: towards the axis


@pytest.mark.parametrize("name", ["one_sided_w10", "twist_w12"])
def test_pressure_does_not_push_inside_the_air(name, tmp_path):
    """Whatever the state, the air's volume depends on where its walls are alone."""
    problem, _ = problem_of(name, tmp_path, size=6.0)
    problem.strains.value[:] = [1.2, 0.05, -0.05, 0.03, 0.05, -0.04]
    problem.array[:] = problem.expand(np.random.default_rng(3).normal(scale=0.01, size=problem.unknowns))
    forces = []
    for problem.pressure.value in (0.0, 1.0):
        forces.append(problem.residual()[0])
    pushing, cells = np.abs(forces[1] - forces[0]), compat.cell_dofs(problem.displacement_space)
    air, body = (
        problem.reduced[problem.displacement_dofs[cells[problem.cell_tags.find(tag)]]]
        for tag in (tags.AIR, tags.BODY)
    )
    inside = np.setdiff1d(air, body)
    assert len(inside) > 30
    assert pushing[inside].max() < 1e-12 * pushing.max()


def test_a_block_of_hexahedra_bends_as_it_should():
    for row in flexure((1, 8), element=CellType.hexahedron):
        assert row.relative_error < 1e-3, row


def test_a_body_of_hexahedra_is_held_without_force(tmp_path):
    """Two segments of different width. At rest the frames are the body's and the cavity's volume is the
    grid's; under pressure a closed cavity pushes at nothing, so that the clamp holds nothing."""
    a = CASES["one_sided_w10"](60.0, 1)
    body = Manipulator([a, replace(a, width=8.0, angle=110.0)])
    grid = body_grid(body, 4.0)
    filled = grid.mesh(air=True)
    grid.mesh().write(tmp_path / "body.npz", {})
    solve = ManipulatorSolve(body, tmp_path / "body.npz", MPI.COMM_SELF)
    rest = solve.measure()
    assert np.abs(rest.frames[:, :3, :3] - np.eye(3)).max() < 1e-9
    assert rest.frames[:, 0, 3] == pytest.approx(rest.stations)
    assert rest.volume == pytest.approx(filled.volumes()[filled.cell_tags == tags.AIR].sum())
    solve.run(0.005, stability=False)
    state = solve.measure()
    force, moment = solve.problem.reaction(tags.BASE)
    assert state.frames[-1, 2, 3] < -0.05  # it bends
    assert np.abs(force).max() < 1e-6 and np.abs(moment).max() < 1e-5
    solve.destroy()


def test_walls_of_a_body_touch_as_their_energy_says(tmp_path):
    """Forces are its slope, the tangent is theirs; two chambers are pushed together, with some noise."""
    segment = replace(CASES["one_sided_w10"](60.0, 2), gap=0.1)
    body = Manipulator([segment])
    body_grid(body, 6.0).mesh().write(tmp_path / "body.npz", {})
    solve = ManipulatorSolve(body, tmp_path / "body.npz", MPI.COMM_SELF, contact=WallPenalty())
    problem, contact, random = solve.problem, solve.problem.contact, np.random.default_rng(7)
    X = problem.nodes
    beyond = X[:, 0] - segment.cot * X[:, 1] > segment.chamber_positions.mean()
    array = np.zeros(len(problem.array))
    array[problem.displacement_dofs] = random.normal(scale=5e-4, size=X.shape)
    array[problem.displacement_dofs[:, 0]] -= beyond * 1.002 * segment.gap / segment.sin
    problem.set_array(array)
    forces, tangent = contact.residual(), contact.tangent()
    assert solve.walls.distances().min() < 0 < contact.overreach
    assert np.linalg.norm(contact.forces()) > 1e-2
    way, ends = random.normal(size=len(array)), []
    way[problem.fixed_dofs] = 0.0
    for step in (1e-7, -1e-7):
        problem.set_array(array + step * way)
        ends.append((contact.energy(), contact.residual()))
    energy, change = ((a - b) / 2e-7 for a, b in zip(*ends))
    assert forces @ way == pytest.approx(energy, rel=1e-6)
    assert np.linalg.norm(tangent @ way - change) < 1e-5 * np.linalg.norm(change)
    solve.destroy()
