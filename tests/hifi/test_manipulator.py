"""Whole bodies: symmetry, agreement of ranks, section frames and walls on the shipped mesh."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError
from pneunet.base.files.atomic import read_columns
from pneunet.geometry import Manipulator, Segment
from pneunet.geometry.cad.mesh import mesh_manipulator
from pneunet.geometry.meshfile import read_mesh
from pneunet.geometry.sections import rotation
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.runs.solve.tables import Tables
from pneunet.hifi.verification import reference_case


def meshed(manipulator, directory, size=3.0):
    comm = MPI.COMM_WORLD
    if comm.rank == 0:
        mesh_manipulator(manipulator, size, directory, "tetrahedra")
    comm.barrier()
    return directory / "manipulator.npz"


def set_positions(problem, positions):
    array = problem.array.copy()
    array[problem.displacement_dofs] = positions - problem.nodes
    problem.set_array(array)


def test_section_frames_measure_a_prescribed_screw(reference):
    """Frames of an exact screw differ from the screw's by one constant motion, so their strains are exact."""
    k, e = np.array([0.02, 0.03, -0.01]), np.array([1.1, 0.02, 0.01])
    X = reference.problem.nodes
    poses = se3.exp_pose(X[:, :1] * np.concatenate([k, e]))
    section = np.column_stack([np.zeros(len(X)), X[:, 1:]])
    set_positions(reference.problem, np.einsum("nij,nj->ni", poses[:, :3, :3], section) + poses[:, :3, 3])
    strains = reference.sections.segment_strains(reference.sections.frames())
    # |k| and k.e do not depend on the constant motion between the two lines
    assert np.linalg.norm(strains.k, axis=1) == pytest.approx(np.linalg.norm(k), rel=2e-3)
    assert np.sum(strains.k * strains.e, axis=1) == pytest.approx(k @ e, rel=5e-3)
    assert strains.k == pytest.approx(np.tile(k, (2, 1)), abs=2e-3)


def test_section_frames_follow_a_rigid_motion_exactly(reference):
    motion = se3.exp_pose([0.4, -0.3, 1.0, 5.0, 2.0, -1.0])
    set_positions(reference.problem, se3.transform(motion, reference.problem.nodes))
    frames = reference.sections.frames()[1:]
    expected = np.tile(motion, (len(frames), 1, 1))
    expected[:, :3, 3] += np.outer(reference.sections.stations[1:], motion[:3, 0])
    assert frames == pytest.approx(expected, abs=1e-10)
    assert reference.stretch.largest() == pytest.approx(1.0, abs=1e-10)
    walls = reference.walls.distances()
    if walls is not None:
        assert walls == pytest.approx([gap[3] for gap in reference.walls.gaps], abs=1e-9)


def test_walls_that_pass_through_each_other_are_negative(reference):
    """Squeezing x to 60 % keeps gaps open in proportion; a shift of the second block's walls closes them."""
    X = reference.problem.nodes
    set_positions(reference.problem, X * [0.6, 1.0, 1.0])
    walls = reference.walls.distances()
    middle = reference.manipulator.segments[0]
    x_middle = middle.chamber_positions.mean()
    moved = X.copy()
    beyond = X[:, 0] - middle.cot * X[:, 1] * np.sign(X[:, 2]) > x_middle
    for side in (1, -1):
        normal = np.array([middle.sin, -side * middle.cot * middle.sin, 0.0])
        moved -= np.outer(beyond & (side * X[:, 2] > 0), 2.0 * middle.gap * normal)
    if walls is not None:
        assert (walls > 0).all() and (walls < [gap[3] for gap in reference.walls.gaps]).all()
    set_positions(reference.problem, moved)
    walls = reference.walls.distances()
    if walls is not None:
        # walls shifted through each other by a gap's width: each point lies that far behind the other wall
        assert walls[:2] == pytest.approx([-middle.gap] * 2, rel=0.05)
    touch = reference.measure().touch
    assert touch.walls_overlap and not touch.body_overlap and touch.body_distance > 5  # neighbours only


def test_mirror_design_mirrors(shared_directory):
    """The mirror image on the mirrored mesh: e and k change sign like polar and axial vectors."""
    manipulator = Manipulator((Segment("one-sided", 60.0, 2),))
    path = meshed(manipulator, shared_directory)
    results = []
    for body, flip in ((manipulator, 1.0), (manipulator.mirrored, -1.0)):
        solve = ManipulatorSolve(body, path, flip_y=flip < 0)
        solve.run(0.02)
        results.append(solve.measure())
        solve.destroy()
    a, b = results
    assert b.frames[-1, :3, 3] == pytest.approx(a.frames[-1, :3, 3] * [1, -1, 1], abs=1e-7)
    assert b.strains.k == pytest.approx(a.strains.k * [-1, 1, -1], abs=1e-8)
    assert b.strains.e == pytest.approx(a.strains.e * [1, -1, 1], abs=1e-8)


def test_free_segments_keep_their_symmetry(shared_directory):
    """Twisting does not bend (k2 = k3 = 0); a one-sided segment at 90 degrees does not twist (k1 = k3 =
    0)."""
    twisting = Segment("twisting", 60.0, 2, gap=2.0, cavity_floor=0.5, chamber_height=5.5)
    bending = Segment("one-sided", 90.0, 3)
    for name, segment, large in (("twisting", twisting, 0), ("bending", bending, 1)):
        folder = shared_directory / name
        solve = ManipulatorSolve(Manipulator((segment,)), meshed(Manipulator((segment,)), folder))
        solve.run(0.02)
        k = solve.measure().strains.k[0]
        solve.destroy()
        others = np.delete(k, large)
        # k1 > 0 for angle < 90; k2 > 0 bends away from the chambers
        assert k[large] > 0.003
        assert np.abs(others).max() < (0.05 if large == 0 else 0.02) * np.linalg.norm(k)


def strains_at_rest(solve, pressures):
    """k (segments, 3) and the positions of the nodes that pressures (MPa, one a group) give at once, as if
    linear."""
    for load, pressure in zip(solve.pressures, pressures):
        load.value.value = pressure
    problem, system = solve.problem, solve.system
    system.factorise()
    state = system.moved(system.state, system.solve(-problem.unsupported(problem.external_force())))
    return solve.sections.segment_strains(solve.sections.frames(state)).k, state


def test_a_rolled_segment_on_the_turned_mesh_is_the_unrolled_one_turned(shared_directory):
    """Loads, section frames and walls follow the roll, exactly."""
    segment, path = Segment("one-sided", 60.0, 2), shared_directory / "turned.npz"
    solve = ManipulatorSolve(Manipulator((segment,)), meshed(Manipulator((segment,)), shared_directory))
    k, state = strains_at_rest(solve, [1e-3])
    walls = solve.walls.distances(state)
    solve.destroy()
    for roll in (90, 180):
        rolled = replace(segment, roll=roll)
        if MPI.COMM_WORLD.rank == 0:
            mesh, facts = read_mesh(shared_directory / "manipulator.npz")
            replace(mesh, points=mesh.points @ rotation(rolled).T).write(path, facts)
        MPI.COMM_WORLD.barrier()
        solve = ManipulatorSolve(Manipulator((rolled,)), path)
        turned, state = strains_at_rest(solve, [1e-3])
        assert turned == pytest.approx(k @ rotation(rolled).T, abs=1e-9 * abs(k).max())
        again = solve.walls.distances(state)
        if walls is not None:
            assert 0.5 < walls[0] < 1 and again == pytest.approx(walls, rel=1e-9)
        solve.destroy()


def test_each_pressure_group_inflates_its_own_segments(shared_directory):
    """A passive segment and two equal bending ones, one above and one below the core, in a cavity each. At
    rest either pressure bends its own segment away from its chambers, and the others, where they hold on to
    it, hardly. On the way to P and P/2 the body's pressure does its work on the volumes weighted by their
    shares."""
    bend, reached = Segment("one-sided", 90.0, 2), []
    body = Manipulator((bend.plain(8.0), bend, replace(bend, roll=180, group=2)))
    solve = ManipulatorSolve(body, meshed(body, shared_directory, 4.0), shares=(1.0, 0.5))
    for own, pressures, sign in ((1, (1e-5, 0.0), 1), (2, (0.0, 1e-5), -1)):
        k = strains_at_rest(solve, pressures)[0][:, 1]
        assert sign * k[own] > 5e-6 and abs(np.delete(k, own)).max() < 0.1 * abs(k[own])
    solve.run(0.02, reached.append)
    P, V = np.array([(0.0, solve.rest_volume)] + [(m.pressure, m.volume) for m in reached]).T
    stored, pressures = solve.problem.stored_energy(), [float(p.value.value) for p in solve.pressures]
    Tables(MPI.COMM_WORLD, shared_directory, solve.walls.gaps, (1.0, 0.5)).accepted(reached[-1])
    solve.destroy()
    assert pressures == pytest.approx([0.02, 0.01])
    columns = ["pressure_kPa", "pressure_1_kPa", "pressure_2_kPa"]
    assert read_columns(shared_directory / "steps.csv", columns)[-1] == pytest.approx([20, 20, 10])
    assert stored == pytest.approx(np.sum((P[1:] + P[:-1]) / 2 * np.diff(V)), rel=5e-3)


def test_pressure_out_of_reach_keeps_what_converged(shared_directory):
    thin = {"wall": 0.5, "top_wall": 0.5, "side_wall": 0.5}
    soft = Manipulator((Segment("one-sided", 90.0, 1, chamber_height=8.0, **thin),))
    solve = ManipulatorSolve(soft, meshed(soft, shared_directory))
    reached = []
    with pytest.raises(ConvergenceError, match=r"stopped at [\d.]+ kPa"):
        solve.run(2.0, lambda m: reached.append(m.pressure))
    assert reached and solve.path.parameter == reached[-1] < 2.0
    solve.destroy()


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts its own two ranks")
def test_two_ranks_agree_with_one(tmp_path):
    one, two = reference_case.numbers(), reference_case.on_ranks(2, tmp_path / "two.json")
    assert reference_case.largest_difference(one, two) < 1e-8
    for lost in ({"volume_mm3": float("nan")}, {"another": 0.0}):
        assert not reference_case.largest_difference(one, two | lost) <= reference_case.SAME
