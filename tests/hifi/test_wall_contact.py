"""Contact of walls over a plane: two quadratic sheets, a cell's gap, pressed cylinders, and a tangent brought
up to date."""

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.geometry.reference_cases import CASES
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import CellSystem
from pneunet.hifi.contact.correction import ContactCorrection, WallPoints
from pneunet.hifi.contact.gaps import Side
from pneunet.hifi.contact.penalty import PenaltyLaw, WallPenalty, touching
from pneunet.hifi.fem.facets import kind_of
from pneunet.hifi.verification.pressed import pressed

serial = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")
UP = np.array([0.0, 0.0, 1.0])
LAW = PenaltyLaw(2.0, 0.02, 1.0)


class Sheet:
    """A rectangle of `counts` squares over x and y in +-size/2, z = height(x, y), each a facet of 9 nodes or
    two of 6; down: seen from below."""

    def __init__(self, counts, size, height, down=False, nodes=6):
        n, m = counts
        i, j = np.meshgrid(np.arange(2 * n + 1), np.arange(2 * m + 1), indexing="ij")
        x, y = size[0] * (i / (2 * n) - 0.5), size[1] * (j / (2 * m) - 0.5)
        self.nodes = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
        a, b = np.meshgrid(2 * np.arange(n), 2 * np.arange(m), indexing="ij")

        def facets(*places):
            return np.stack([((a + di) * (2 * m + 1) + b + dj).ravel() for di, dj in places], axis=1)

        if nodes == 9:
            ring = (0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)
            self.facets = facets(*ring)
        else:
            lower, upper = ((0, 0), (2, 0), (0, 2)), ((2, 2), (0, 2), (2, 0))
            lower, upper = lower + ((1, 0), (1, 1), (0, 1)), upper + ((1, 2), (1, 1), (2, 1))
            self.facets = np.concatenate([facets(*lower), facets(*upper)])
        kind = kind_of(self.facets)
        if down:
            self.facets = self.facets[:, kind.turned]
        self.areas = size[0] * size[1] / len(self.facets) * np.tile(kind.gauss_weights, (len(self.facets), 1))


def sides(first, second, law=LAW):
    """Both sides that push, as functions of the nodes of both sheets, one below the other."""
    size, start = 3 * (len(first.nodes) + len(second.nodes)), {id(first): 0, id(second): len(first.nodes)}
    found = []
    for number, (own, other, direction) in enumerate(((first, second, UP), (second, first, -UP))):
        t = touching(own.nodes[own.facets], own.areas, other.nodes[other.facets], direction, law)
        if t is not None:
            nodes = [start[id(own)] + own.facets[t.facet], start[id(other)] + other.facets[t.other]]
            columns = 3 * np.concatenate(nodes, axis=1)[:, :, None] + np.arange(3)
            found.append(Side(number, law, t, columns.reshape(len(columns), -1), size))
    return found


def energy(first, second):
    touching = [side.touching for side in sides(first, second)]
    return sum((t.area * t.energy).sum() for t in touching)


def gradient(first, second):
    """By the nodes of both sheets, (n, 3)."""
    return sum(side.forces().reshape(-1, 3) for side in sides(first, second))


def moved(sheet, displacement):
    copy = Sheet.__new__(Sheet)
    copy.nodes, copy.facets, copy.areas = sheet.nodes + displacement, sheet.facets, sheet.areas
    return copy


def bumps(nodes, seed=1):
    """Two curved, rough sheets of other meshes that overlap in the middle and are apart at their rims; the
    second lies aslant."""
    rng = np.random.default_rng(seed)
    first = Sheet((3, 4), (2.0, 2.0), lambda x, y: 0.1 - 0.2 * (x**2 + y**2), nodes=nodes)
    second = Sheet((4, 3), (2.2, 2.1), lambda x, y: 0.02 + 0.1 * x + 0.05 * x * y, down=True, nodes=nodes)
    return tuple(moved(s, rng.uniform(-0.01, 0.01, s.nodes.shape)) for s in (first, second))


def test_the_law_is_the_derivative_of_its_energy_and_linear_beyond_its_onset():
    overlap, h = np.array([-0.03, -0.01, 0.0, 0.013, 0.05]), 1e-6
    value, pressure, slope = LAW(overlap)
    up, down = LAW(overlap + h), LAW(overlap - h)
    assert pressure == pytest.approx((up[0] - down[0]) / (2 * h), abs=1e-9)
    assert slope == pytest.approx((up[1] - down[1]) / (2 * h), abs=1e-6)
    assert value[0] == pressure[0] == slope[0] == 0.0
    assert pressure[-1] == pytest.approx(LAW.stiffness * 0.05)


@pytest.mark.parametrize("nodes", [6, 9])
def test_forces_and_tangent_are_derivatives_of_the_energy_in_blended_edges_too(nodes):
    first, second = bumps(nodes)
    direction = np.random.default_rng(2).normal(size=(len(first.nodes) + len(second.nodes), 3))
    h, n = 1e-6, len(first.nodes)
    ends = [(moved(first, s * h * direction[:n]), moved(second, s * h * direction[n:])) for s in (1, -1)]
    forces, (up, down) = gradient(first, second), (energy(*end) for end in ends)
    found = sides(first, second)
    # points between facets are among them
    assert any(len(side.touching.point) > len(side.touching.area) for side in found)
    assert (forces * direction).sum() == pytest.approx((up - down) / (2 * h), rel=1e-6)
    assert np.abs(forces).max() > 1e-3
    product = sum(side.tangent() @ direction.ravel() for side in found).reshape(-1, 3)
    change = (gradient(*ends[0]) - gradient(*ends[1])) / (2 * h)
    assert product == pytest.approx(change, abs=1e-6 * np.abs(change).max())


@pytest.mark.parametrize("nodes", [6, 9])
def test_both_walls_are_pushed_alike_and_flat_ones_not_sideways(nodes):
    first, second = bumps(nodes)
    forces = gradient(first, second)
    assert forces.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert forces[: len(first.nodes), 2].sum() > 1e-3  # the energy grows as the first wall goes up
    flat = (
        Sheet((3, 2), (2.0, 2.0), lambda x, y: 0 * x, nodes=nodes),
        Sheet((2, 4), (4.0, 4.0), lambda x, y: 0 * x - 0.05, down=True, nodes=nodes),
    )
    assert gradient(*flat)[:, :2] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("nodes", [6, 9])
def test_flat_walls_of_other_meshes_carry_pressure_times_area_and_its_moment(nodes):
    delta, size = 0.05, (2.0, 1.0)
    first = Sheet((3, 2), size, lambda x, y: 0 * x, nodes=nodes)
    second = Sheet((4, 5), size, lambda x, y: 0 * x - delta, down=True, nodes=nodes)
    force = LAW.stiffness * delta * size[0] * size[1]
    forces = gradient(first, second)
    for sheet, f, sign in ((first, forces[: len(first.nodes)], 1), (second, forces[len(first.nodes) :], -1)):
        assert f.sum(axis=0) == pytest.approx([0, 0, sign * force], rel=1e-12, abs=1e-12)
        assert np.cross(sheet.nodes, f).sum(axis=0)[:2] == pytest.approx(np.zeros(2), abs=1e-12)


def test_nothing_pushes_beyond_the_onset():
    first = Sheet((3, 2), (2.0, 1.0), lambda x, y: 0 * x)
    for distance, touches in ((1.01 * LAW.onset, False), (0.99 * LAW.onset, True)):
        second = Sheet((4, 5), (2.0, 1.0), lambda x, y, z=distance: 0 * x + z, down=True)
        assert len(sides(first, second)) == (2 if touches else 0)


@pytest.fixture
def pushed(tmp_path):
    """A coarse cell whose walls are moved into each other, unevenly, at strains far from rest."""
    segment = CASES["twist_w15"](angle=60.0, chambers=1, material=NeoHookean(0.317))
    mesh_cell(segment, 4.0, tmp_path / "cell.npz")
    problem = CellProblem(segment, tmp_path / "cell.npz", contact=WallPenalty())
    system = CellSystem(problem)
    x = system.state.copy()
    x[-6:] = [0.97, 0.01, -0.015, 0.012, 0.003, -0.002]
    x[: problem.unknowns] = np.random.default_rng(4).normal(scale=2e-3, size=problem.unknowns)
    for gap in problem.walls.gaps:
        for wall, sign in zip(gap, (1, -1)):
            nodes = np.unique(wall.facets)
            X = problem.nodes[nodes]
            towards = (
                0.5 * segment.gap / segment.sin * (1.0 - 0.02 * (X[:, 1] / 7.5) ** 2 - 0.01 * abs(X[:, 2]))
            )
            x[problem.reduced[problem.displacement_dofs[nodes, 0]]] += sign * towards
    system.state = x
    yield system
    system.destroy()


def along(system, direction, h):
    """Contact's (energy, forces) at the state, moved by h times `direction` (unknowns + 6,)."""
    kept, n = system.state, system.problem.unknowns
    x = kept.copy()
    x[:n] += h * direction[:n]
    x[-6:] += h * direction[n:]
    system.state = x
    found = system.problem.contact.energy(), system.problem.contact.residual()
    system.state = kept
    return found


@serial
def test_a_cell_s_contact_is_exact_in_unknowns_and_strains(pushed):
    """Forces are the energy's slope, the tangent is the forces' slope."""
    contact, n = pushed.problem.contact, pushed.problem.unknowns
    pushed.state = pushed.state.copy()
    forces = contact.residual()
    assert contact.overreach > 0 and np.abs(forces[:n]).max() > 1e-3
    K = contact.tangent()
    for block in (K[:n, :n], K[n:, n:]):
        assert abs(block - block.T).max() < 1e-12 * abs(block).max()
    rng, h = np.random.default_rng(5), 1e-7
    moves = (
        np.r_[rng.normal(size=n), np.zeros(6)],
        np.r_[np.zeros(n), rng.normal(size=6) * [1, 1, 1, 0.1, 0.1, 0.1]],
    )
    for d in moves:
        up, down = along(pushed, d, h), along(pushed, d, -h)
        energy, change = ((a - b) / (2 * h) for a, b in zip(up, down))
        assert forces @ d == pytest.approx(energy, rel=1e-6)
        for part in (slice(n), slice(n, None)):
            error = (K @ d - change)[part]
            assert np.linalg.norm(error) < 1e-6 * np.linalg.norm(change[part])


@serial
def test_pressed_cylinders_carry_the_exact_force_and_no_torque(tmp_path):
    force, torque, state = pressed(tmp_path, 0.5)
    assert force.relative_error < 5e-3
    assert abs(torque) < 2e-3 * abs(force.computed)  # on a radius of 1 mm
    assert state.contact.force == pytest.approx(-state.force[0], rel=1e-6)


class Springs:
    """A stand-in for a system: a bare K (n, n), and points with gradients (m, n) of their gaps; its tangent
    is that of the overlaps `then` (m,)."""

    def __init__(self, then, n=12, m=7):
        rng = np.random.default_rng(6)
        A = rng.normal(size=(n, n))
        self.bare, self.rows = A @ A.T + np.eye(n), rng.normal(size=(m, n))
        self.force, self.then, self.columns = rng.normal(size=n), self.points(then), 0
        slopes = [self.then.slopes.get(p, 0.0) for p in range(m)]
        self.inverse = np.linalg.inv(self.bare + self.rows.T @ (np.array(slopes)[:, None] * self.rows))
        self.contact = ContactCorrection(self.then, most=5)

    def points(self, overlaps):
        m = len(overlaps)
        return WallPoints(
            list(range(m)), np.ones(m), np.asarray(overlaps, float), np.full(m, 3.0), np.full(m, 0.02)
        )

    def solve(self, right):
        self.columns += right.shape[1]
        return self.inverse @ right

    def renew(self, overlaps):
        return self.contact.renew(
            self.points(overlaps), lambda names: sp.csr_matrix(self.rows[names]), self.solve
        )

    def corrected(self, **more):
        return self.contact.corrected(self.inverse @ self.force, np.linalg.norm(self.force), **more)


THEN = [0.5, 0.5, 0.5, -9, -9, -9, -9]


def test_a_correction_by_slopes_is_that_of_a_tangent_factorised_anew():
    springs = Springs(THEN)
    for now in ([0.5, -9, -9, 0.4, -9, -9, -9], [0.01, 0.5, -9, 0.4, -9, -9, -9], 7 * [-9]):
        assert springs.renew(now) is True
        slopes = springs.points(now).pushes()[2]
        whole = springs.bare + springs.rows.T @ (slopes[:, None] * springs.rows)
        exact = np.linalg.solve(whole, springs.force)
        assert springs.corrected(straight=True) == pytest.approx(exact, rel=1e-9, abs=1e-12)
        assert springs.renew(now) is False


def test_a_correction_by_the_law_balances_the_pushes_that_it_leads_to():
    springs, now = Springs(THEN), [0.03, 0.02, -0.02, 0.01, -0.03, 0.03, -9]
    springs.force *= -1
    springs.renew(now)
    d = springs.corrected()
    before, after = (springs.points(now).pushes(opening)[1] for opening in (0.0, springs.rows @ d))
    assert ((before == 0) & (after > 0)).any() and ((before > 0) & (after == 0)).any()
    left = springs.bare @ d - springs.force - springs.rows.T @ (after - before)
    assert np.linalg.norm(left) < 0.03 * np.linalg.norm(springs.force)


def test_points_that_change_nothing_cost_no_column_and_many_ask_for_a_factorisation():
    springs = Springs(THEN)
    assert springs.renew(THEN) is False
    assert (springs.corrected() == springs.inverse @ springs.force).all() and springs.columns == 0
    springs.renew(7 * [0.5])
    springs.corrected(straight=True)
    assert springs.columns == 4  # the first three are in the tangent
    springs.renew([0.2, -9, -9, 0.5, 0.5, 0.5, 0.5])
    springs.corrected(straight=True)
    assert springs.columns == 6 and springs.renew(THEN) is None
