"""The screw-periodic unit cell. Serial by design: cells are spread over ranks, not split."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import simpson

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_columns
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import tags
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.geometry.cad.recut import recut
from pneunet.geometry.reference_cases import CASES
from pneunet.hifi.cell.file import CellCase
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.run import solve_cell
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.runs.cell import run_cell

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"roll": 180}, "roll_deg = 180: a cell is one by itself"),
        ({"group": 2}, "pressure_group = 2: a cell is one by itself"),
        (None, "kind = 'passive': a cell is a pitch of chambers"),
    ],
)
def test_what_is_of_a_body_is_refused_in_a_cell(other, message):
    segment = CASES["one_sided_w10"](60.0, 1)
    with pytest.raises(InputError, match=message):
        CellCase(segment.plain(9.0) if other is None else replace(segment, **other), 0.01)


def solved(segment, path, pressure, mesh_size=2.5):
    """The cell at `pressure` (MPa), its strains free."""
    mesh_cell(segment, mesh_size, path)
    system = CellSystem(CellProblem(segment, path))
    follow(system, pressure, StepSize(first=0.005, smallest=1e-4))
    return system


def held(segment, path, pressure, strains):
    """(force, moment) (6,) per section at prescribed strains (6,), on the mesh that is there."""
    rest = np.eye(6)[0]
    system = CellSystem(CellProblem(segment, path), np.ones(6, bool), (0.0, pressure), (rest, strains - rest))
    follow(system, 1.0, StepSize(first=0.25, smallest=1e-3))
    state = system.measure()
    system.destroy()
    return np.concatenate([state.force, state.moment])


def follow(system, target, size, on_load=lambda load: None):
    path = EquilibriumPath(system, LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE))
    run_steps(path, target, size, lambda step: on_load(step.load))


@pytest.fixture
def one_sided():
    return CASES["one_sided_w10"](angle=60.0, chambers=1, material=NeoHookean(0.2068))


def test_free_state_has_the_segment_s_symmetry_and_no_force(one_sided, tmp_path):
    cell = solved(one_sided, tmp_path / "cell.npz", 0.02)
    state = cell.measure()
    e, k = state.strains.e, state.strains.k
    size = np.linalg.norm(k)
    assert abs(k[2]) < 0.01 * size and abs(e[2]) < 0.01 * size * one_sided.pitch
    assert k[0] > 0.5 * size and k[1] > 0.5 * size  # twists and bends away from the chambers
    assert state.force == pytest.approx(np.zeros(3), abs=1e-7)
    assert state.moment == pytest.approx(np.zeros(3), abs=1e-6)
    cell.destroy()


def test_stiffness_is_symmetric_positive_and_the_slope_of_forces(one_sided, tmp_path):
    path = tmp_path / "cell.npz"
    cell = solved(one_sided, path, 0.02)
    state = cell.measure()
    free = state.strains.vector
    K = state.stiffness
    assert abs(K - K.T).max() < 1e-8 * abs(K).max()
    assert np.linalg.eigvalsh(K)[0] > 0
    cell.destroy()
    direction = np.array([0.01, -0.005, 0.004, 0.001, 0.0008, -0.0006])
    h = 0.05
    ahead, behind = (held(one_sided, path, 0.02, free + s * h * direction) for s in (1, -1))
    assert (ahead - behind) / (2 * h) == pytest.approx(
        K @ direction, rel=1e-4, abs=1e-4 * np.linalg.norm(K @ direction)
    )


def test_a_stiff_bottom_layer_keeps_its_length(one_sided, tmp_path):
    path, z = tmp_path / "cell.npz", one_sided.core_bottom + 0.25
    stretches = []
    for mu in (0.2068, 20.68):
        layered = replace(one_sided, layer_thickness=0.5, layer_material=NeoHookean(mu))
        cell = solved(layered, path, 0.02)
        strains = cell.measure().strains
        stretches.append(np.linalg.norm(strains.e + np.cross(strains.k, [0, 0, z])))
        cell.destroy()
    assert stretches[0] < 0.99  # the soft base is compressed by the bending
    assert stretches[1] == pytest.approx(1.0, abs=2e-3)


def test_the_work_of_the_pressure_is_stored_in_the_body_and_its_bottom_layer(one_sided, tmp_path):
    """P V - int V dP by Simpson's rule, at equal steps of the pressure."""
    layered = replace(one_sided, layer_thickness=0.5, layer_material=NeoHookean(0.6))
    mesh_cell(layered, 4.0, tmp_path / "cell.npz")
    system, pressures = CellSystem(CellProblem(layered, tmp_path / "cell.npz")), np.linspace(0, 0.02, 9)
    volume, rest = {0.0: system.volume()}, system.problem.stored_energy()
    marks = tuple(pressures[1:])
    follow(
        system,
        0.02,
        StepSize(0.0025, 1e-4, milestones=marks),
        lambda load: volume.update({load: system.volume()}),
    )
    work = 0.02 * volume[0.02] - simpson([volume[P] for P in pressures], x=pressures)
    assert system.problem.stored_energy() - rest == pytest.approx(work, rel=1e-5)
    system.destroy()


def test_twisting_cell_only_twists(tmp_path):
    segment = CASES["twist_w12"](angle=60.0, chambers=1, material=NeoHookean(0.317))
    cell = solved(segment, tmp_path / "cell.npz", 0.02)
    k = cell.measure().strains.k
    assert np.abs(k[1:]).max() < 0.01 * abs(k[0])
    cell.destroy()


def at_gauge(segment, path, **gauge):
    system = CellSystem(CellProblem(segment, path, **gauge))
    follow(system, 0.02, StepSize(first=0.005, smallest=1e-4))
    state = system.measure()
    system.destroy()
    return state


def test_the_place_of_the_cut_does_not_matter(one_sided, tmp_path):
    path, other = tmp_path / "cell.npz", tmp_path / "recut.npz"
    mesh_cell(one_sided, 3.0, path)
    recut(path, other, one_sided.pitch, 0.9)
    state, moved = at_gauge(one_sided, path), at_gauge(one_sided, other)
    for name in ("e", "k"):
        assert getattr(moved.strains, name) == pytest.approx(getattr(state.strains, name), abs=1e-9)
    assert moved.stiffness == pytest.approx(state.stiffness, abs=1e-8 * abs(state.stiffness).max())


def test_what_no_section_frame_can_change(one_sided, tmp_path):
    """Another gauge is another frame, whose strains and stiffness differ; |k|, k.e and the screw's compliance
    are the body's own."""
    mesh_cell(one_sided, 3.0, tmp_path / "cell.npz")
    state, other = (
        at_gauge(one_sided, tmp_path / "cell.npz", gauge=g) for g in ((tags.CHANNEL,), (tags.CAVITY,))
    )
    assert abs(other.strains.e[1] - state.strains.e[1]) > 0.01
    assert np.linalg.norm(other.strains.k) == pytest.approx(np.linalg.norm(state.strains.k), rel=1e-7)
    assert other.strains.k @ other.strains.e == pytest.approx(state.strains.k @ state.strains.e, rel=1e-7)
    assert other.screw_compliance == pytest.approx(state.screw_compliance, rel=1e-6)


def test_prescribed_curvature_leaves_the_other_strains_free(one_sided, tmp_path):
    """Holding k2 alone: its moment is what it takes, all other forces vanish; at the free value that moment
    does too."""
    path = tmp_path / "cell.npz"
    free, _ = solve_cell(CellCase(one_sided, 0.02, 2.5, 1, element="tetrahedra"), path)
    change = 0.002
    held = {4: free.strains.k[1] + change}
    bent, _ = solve_cell(CellCase(one_sided, 0.02, 2.5, 1, held, element="tetrahedra"), path)
    assert bent.strains.k[1] == pytest.approx(free.strains.k[1] + change, abs=1e-12)
    forces = np.concatenate([bent.force, bent.moment])
    assert np.delete(forces, 4) == pytest.approx(np.zeros(5), abs=1e-6)
    # the compliance of the free state predicts it to first order
    assert forces[4] == pytest.approx(change / np.linalg.inv(free.stiffness)[4, 4], rel=0.05)


def test_volume_control_walks_through_the_limit_point_of_the_pressure(tmp_path):
    """The case `ballooning`, without a contact model: pressure rises to a limit near 47 kPa and falls beyond
    it."""
    segment = CASES["twist_w15"](angle=60.0, chambers=1, material=NeoHookean(0.208))
    states, limits = [], []
    way = {"control": "volume", "volume_factor": 8.0, "contact": "none", "element": "tetrahedra"}
    case = CellCase(segment, 0.05, 6.0, 8, **way)
    solve_cell(case, tmp_path / "cell.npz", states.append, limits.append)
    pressure, unstable = (np.array([getattr(s, name) for s in states]) for name in ("pressure", "unstable"))
    top = int(pressure.argmax())
    assert 0 < top < len(states) - 1
    assert 0.042 < pressure[top] < 0.052
    [limit] = limits
    assert (
        limit.load == pytest.approx(pressure[top], rel=5e-3)
        and states[top - 1].volume < limit.volume < states[top + 1].volume
    )
    assert (np.diff(pressure[: top + 1]) > 0).all() and (np.diff(pressure[top:]) < 0).all()
    # stable at fixed pressure before the limit, one unstable direction beyond it (further on, at 9 volumes, a
    # branch leaves this path, which has a second one from there)
    assert (unstable[:top] == 0).all() and (unstable[top + 1 :] == 1).all()


def test_the_command_leaves_a_table_and_a_record(tmp_path):
    (tmp_path / "cell.toml").write_text(
        "pressure_kPa = 10\nmesh_size_mm = 2.5\nlevels = 2\n[material]\nmu_MPa = 0.2068\n[segment]\nkind ="
        ' "one-sided"\nangle_deg = 60\n'
    )
    run_cell(tmp_path / "cell.toml", tmp_path)
    names = [
        "pressure_kPa",
        "e1",
        "k1_rad_per_mm",
        "k_norm_per_mm",
        "unstable_directions",
        "K11",
        "K44",
        "kirchhoff22",
    ]
    table = read_columns(tmp_path / "cell" / "cell.csv", names)
    assert table[:, 0] == pytest.approx([0, 5, 10])
    assert table[0, 1:4] == pytest.approx([1, 0, 0], abs=1e-12)
    assert (np.diff(table[:, 1:4], axis=0) > 0).all() and (table[:, 4] == 0).all()
    assert (table[:, 7] <= table[:, 6]).all()  # relaxing the shears only softens
    assert json.loads((tmp_path / "cell" / "run.json").read_text())["mesh"]["cells"] > 100
