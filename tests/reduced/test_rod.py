"""The loaded rod: exact derivatives, the elastica, a helix under a tip moment, objectivity, order, load
steps, buckling, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.strains import MIRROR
from pneunet.geometry import Manipulator
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.reference_cases import CASES
from pneunet.reduced.rod.equilibrium import Grid
from pneunet.reduced.rod.quadratic import QuadraticLaw, passive_law
from pneunet.reduced.rod.rod import Rod, RodPiece
from tests.reduced.rod_energy import energy, gradient, hessian

REST = np.eye(6)[0]
#: EA, GA, GA in N, GJ, EI, EI in N mm2
SLENDER = np.diag([40.0, 15.0, 15.0, 70.0, 80.0, 250.0])
HELICAL = np.array([1.05, -0.02, 0.0, 0.013, 0.014, 0.0])
COUPLED = SLENDER + np.array(
    [[0, 0, 0, -3, -18, 0.1], *np.zeros((3, 6)), [-18, 1, 0, -15, 0, 0], np.zeros(6)]
)
COUPLED = (COUPLED + COUPLED.T) / 2


def law(strains=REST, stiffness=SLENDER):
    return QuadraticLaw([0.0], [strains], [stiffness])


def uniform(length=60.0, strains=REST, stiffness=SLENDER, **keys):
    return Rod([RodPiece(length, law(strains, stiffness), **keys)])


class Stiffening:
    """psi = w/2 + w^2/(2 c), w = d.K d: a law that is not quadratic."""

    def __init__(self, scale):
        self.scale = scale

    def free_strains(self, P):
        return HELICAL * 1.0

    def _w(self, q):
        d = q - HELICAL
        return d @ COUPLED, np.einsum("...i,ij,...j", d, COUPLED, d)

    def psi(self, q, P):
        w = self._w(q)[1]
        return w / 2 + w**2 / (2 * self.scale)

    def force(self, q, P):
        g, w = self._w(q)
        return g * (1 + 2 * w / self.scale)[..., None]

    def stiffness(self, q, P):
        g, w = self._w(q)
        return (
            COUPLED * (1 + 2 * w / self.scale)[..., None, None]
            + 4 / self.scale * g[..., :, None] * g[..., None, :]
        )


MIXED = Rod(
    [
        RodPiece(20.0, law(HELICAL, COUPLED), mass=7e-8, mass_centre=(0.0, 1.0)),
        RodPiece(5.0, law(REST, 3 * SLENDER), mass=5e-8, mass_centre=(0.0, -0.5)),
        RodPiece(25.0, law(HELICAL * MIRROR, COUPLED), mass=7e-8, mass_centre=(0.3, 1.0)),
    ],
    tip_centre=(0.2, -0.5),
)
GRAVITY, FORCE, MOMENT = (3000.0, -5000.0, 9000.0), (0.01, 0.02, -0.03), (0.5, 0.2, 0.3)


def vectors(gravity=(0, 0, 0), force=(0, 0, 0), moment=(0, 0, 0), distributed=(0, 0, 0)):
    return [np.array(v, float) for v in (gravity, force, moment, distributed)]


@pytest.mark.parametrize("moment", [(0.0, 0.0, 0.0), MOMENT], ids=["conservative", "tip moment"])
def test_gradient_hessian_and_newton_step_are_exact(moment):
    rod = Rod([*MIXED.pieces[:2], RodPiece(25.0, Stiffening(0.1))], tip_centre=MIXED.tip_centre)
    grid = Grid(rod, np.array([2, 1, 2]), vectors(GRAVITY, FORCE, moment, (1e-3, 0.0, 2e-3)))
    elements, loads, step = grid.elements, grid.loads, 1e-6
    x = elements.free()
    x = x + np.array([0.03] * 3 + [0.02] * 3) * np.random.default_rng(2).standard_normal(x.shape)
    n = x.size
    slopes, tangent = gradient(elements, x, loads).ravel(), hessian(elements, x, loads).reshape(n, n)
    moved = [d.reshape(x.shape) for d in step * np.eye(n)]
    slope = np.array(
        [
            (gradient(elements, x + d, loads) - gradient(elements, x - d, loads)).ravel() / (2 * step)
            for d in moved
        ]
    )
    np.testing.assert_allclose(tangent, slope.T, atol=1e-7)
    symmetric = abs(tangent - tangent.T).max() < 1e-11 * abs(tangent).max()
    assert symmetric == loads.conservative
    if loads.conservative:
        work = [(energy(elements, x + d, loads) - energy(elements, x - d, loads)) / (2 * step) for d in moved]
        np.testing.assert_allclose(slopes, work, atol=1e-7)
    np.testing.assert_allclose(
        elements.newton_step(x, loads)[0].ravel(), np.linalg.solve(tangent, -slopes), atol=1e-12
    )


def planar_elastica(length, curvature, force, weight, moment):
    """Tip (x, z, angle about y) of a rod of stiffness SLENDER in the x-z plane by its balance as a boundary
    value problem."""
    EA, _, GA, _, EI, _ = np.diag(SLENDER)

    s = np.linspace(0, length, 101)
    guess = np.array([s, 0 * s, curvature * s, 0 * s])
    for share in np.linspace(0.1, 1, 10):  # the solver needs a near start

        def slope(s, y, share=share):
            nx, nz = (share * (f + w * (length - s)) for f, w in zip(force, weight))
            c, n = np.cos(y[2]), np.sin(y[2])
            e1, e3 = 1 + (nx * c - nz * n) / EA, (nx * n + nz * c) / GA
            dx, dz = e1 * c + e3 * n, -e1 * n + e3 * c
            return np.array([dx, dz, curvature + y[3] / EI, dx * nz - dz * nx])

        start = solve_bvp(
            slope, lambda a, b: np.array([*a[:3], b[3] - moment]), s, guess, tol=1e-10, max_nodes=100000
        )
        assert start.success
        guess = start.sol(s)
    return start.y[:3, -1]


@pytest.mark.parametrize(
    ("force", "weight", "moment"),
    [((0.02, 0.15), (0.0, 0.0), 0.0), ((0.0, 0.0), (1e-3, -4e-3), 0.0), ((-0.01, 0.05), (0.0, 2e-3), 2.0)],
    ids=["tip force", "own weight", "all with a tip moment"],
)
def test_planar_elastica(force, weight, moment):
    length, curvature = 60.0, 0.01
    mass = 1e-7
    rod = uniform(length, [1, 0, 0, 0, curvature, 0], mass=mass)
    loads = DeadLoads((weight[0] / mass, 0, weight[1] / mass), (force[0], 0, force[1]), (0, moment, 0))
    tip = rod.equilibrium(loads, tolerance=2e-7).tip
    x, z, angle = planar_elastica(length, curvature, force, weight, moment)
    np.testing.assert_allclose(tip[:3, 3], [x, 0, z], atol=1e-6 * length)
    np.testing.assert_allclose(tip[:3, :3], se3.exp_rotation([0, angle, 0]), atol=1e-6)


def test_a_tip_moment_winds_a_straight_rod_into_a_helix():
    """Equal bending stiffnesses: t' = M x t/EI, so the tangent turns about the moment at a constant rate:
    exact."""
    length, EI, moment = 80.0, 90.0, np.array([2.0, 3.0, -1.5])
    rod = uniform(length, REST, np.diag([40.0, 15.0, 15.0, 60.0, EI, EI]))
    tip = rod.equilibrium(DeadLoads(tip_moment=moment), tolerance=1e-6).tip
    helix = se3.exp_pose(length * np.array([*moment / EI, 1.0, 0.0, 0.0]))
    assert length * np.linalg.norm(moment) / EI > 3
    np.testing.assert_allclose(tip[:3, 3], helix[:3, 3], atol=1e-6 * length)
    np.testing.assert_allclose(tip[:3, 0], helix[:3, 0], atol=1e-5)


def test_a_rod_wound_up_many_times_needs_finer_elements_and_gets_them():
    length, EI, moment = 100.0, 90.0, 70.0
    rod = uniform(length, REST, np.diag([40.0, 15.0, 15.0, 60.0, EI, EI]))
    state = rod.equilibrium(DeadLoads(tip_moment=(0.0, moment, 0.0)))
    ring = se3.exp_pose([0.0, length * moment / EI, 0.0, length, 0.0, 0.0])
    assert length * moment / EI > 12 * 2 * np.pi
    np.testing.assert_allclose(state.tip, ring, atol=1e-3)


def test_turning_base_and_loads_turns_the_answer():
    motion = se3.exp_pose([0.7, -1.1, 0.4, 10.0, -20.0, 5.0])
    loads = DeadLoads(GRAVITY, FORCE, MOMENT)
    turned = DeadLoads(*(tuple(motion[:3, :3] @ v) for v in (GRAVITY, FORCE, MOMENT)))
    here = MIXED.equilibrium(loads)
    there = Rod(MIXED.pieces, motion, MIXED.tip_centre).equilibrium(turned)
    np.testing.assert_allclose(there.line.poses, motion @ here.line.poses, atol=1e-7)
    np.testing.assert_allclose(there.moment, here.moment, atol=1e-8)


def test_without_loads_it_is_the_free_shape():
    state = MIXED.equilibrium()
    np.testing.assert_allclose(state.line.poses, MIXED.free().at(state.line.s), atol=1e-9)
    np.testing.assert_allclose(np.hstack([state.force, state.moment]), 0.0, atol=1e-9)


def test_section_forces_balance_what_hangs_behind_them():
    state = MIXED.equilibrium(DeadLoads(GRAVITY, FORCE), (0.0, 1e-3, 0.0), tolerance=1e-5)
    mass = sum(p.mass * p.length for p in MIXED.pieces)
    total = mass * np.array(GRAVITY) + FORCE + np.array([0.0, 1e-3, 0.0]) * MIXED.lengths.sum()
    middle = se3.exp_pose(state.line.strains.twist_vector[0] * np.diff(state.line.s)[0] / 2)[:3, :3]
    assert middle @ state.force[0] == pytest.approx(total, abs=0.01 * np.linalg.norm(total))


def test_error_falls_with_the_square_of_the_elements():
    tips = []
    for count in (4, 8, 16, 32):
        grid = Grid(MIXED, np.array([count, 1, count]), vectors(GRAVITY, FORCE))
        tips.append(grid.elements.poses(grid.follow(1e-8))[-1, :3, 3])
    moved = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    assert moved[:-1] / moved[1:] == pytest.approx([4.0, 4.0], rel=0.05)


def test_estimated_error_is_the_error():
    exact = MIXED.equilibrium(DeadLoads(GRAVITY, FORCE), tolerance=1e-6).line
    rough = MIXED.equilibrium(DeadLoads(GRAVITY, FORCE), tolerance=1e-3)
    error = np.linalg.norm(rough.line.points - exact.at(rough.line.s)[:, :3, 3], axis=1).max()
    assert error <= 1e-3 * 50 and error == pytest.approx(rough.error, rel=0.3)


def test_large_loads_are_reached_in_load_steps():
    """A force of 80 EI/L^2 across the tip: the rod ends up along it, stretched by it, as seen from far."""
    rod, force = uniform(80.0), 1.0
    state = rod.equilibrium(DeadLoads(tip_force=(0.0, 0.0, force)))
    assert state.load_steps > 0
    assert state.line.poses[-1, :3, 0] == pytest.approx([0.0, 0.0, 1.0], abs=0.02)
    assert state.force[-1][0] == pytest.approx(force, rel=0.01)
    assert state.line.strains.e[-1, 0] == pytest.approx(1 + force / SLENDER[0, 0], rel=1e-3)


def test_a_law_that_stiffens_bends_less_and_slow_loading_ends_there_too():
    force = DeadLoads(tip_force=(0.0, 0.05, -0.05))
    hard, soft = (Rod([RodPiece(40.0, own)]) for own in (Stiffening(0.05), law(HELICAL, COUPLED)))
    at_once, slowly = hard.equilibrium(force), hard.equilibrium(force, first_load=0.1)
    moved = [
        np.linalg.norm(state.tip[:3, 3] - rod.free().points[-1])
        for state, rod in ((at_once, hard), (soft.equilibrium(force), soft))
    ]
    assert 1 < moved[0] < 0.9 * moved[1] and slowly.load_steps > at_once.load_steps
    np.testing.assert_allclose(slowly.tip, at_once.tip, atol=1e-4)


def test_a_column_is_stable_below_its_buckling_load_and_refused_above():
    EI, length = 80.0, 100.0
    stiff = np.diag([1e5, 1e5, 1e5, 70.0, EI, 250.0])
    rod, euler = uniform(length, REST, stiff), np.pi**2 * EI / (4 * length**2)
    below = rod.equilibrium(DeadLoads(tip_force=(-0.99 * euler, 0.0, 0.0)))
    assert below.tip[:3, 3] == pytest.approx([length, 0, 0], abs=0.01)
    with pytest.raises(ConvergenceError, match=r"beyond (9\d|100)\.?\d* % of the loads: the rod buckles"):
        rod.equilibrium(DeadLoads(tip_force=(-1.01 * euler, 0.0, 0.0)))
    aside = rod.equilibrium(DeadLoads(tip_force=(-1.5 * euler, 0.0, 1e-3 * euler)))
    assert aside.tip[2, 3] > 0.5 * length


def test_a_long_finger_hangs_by_its_weight():
    """180 mm, level, soft: bends down by more than its pressure bends it; twice as stiff and heavy it hangs
    the same."""
    free = [1.02, 0, 0, 0.0, -0.004, 0.0]  # bends up
    finger = uniform(180.0, free, SLENDER, mass=7e-8)
    hanging = finger.equilibrium(DeadLoads((0, 0, -9810.0)))
    assert finger.free().points[-1, 2] > 40 and hanging.tip[2, 3] < -100
    strongest = hanging.line.strains.k[:, 1].max()
    assert strongest > 2 * 0.004
    double = uniform(180.0, free, 2 * SLENDER, mass=14e-8).equilibrium(DeadLoads((0, 0, -9810.0)))
    np.testing.assert_allclose(double.line.points, hanging.line.points, atol=1e-6)
    line_load = uniform(180.0, free, SLENDER).equilibrium(distributed=(0.0, 0.0, -9810.0 * 7e-8))
    np.testing.assert_allclose(line_load.line.points, hanging.line.points, atol=1e-6)


def test_weight_beside_the_line_twists():
    """Level rod, mass centre 1 mm beside the line: torque w y L at the base, turning the tip by w y L^2/(2
    GJ)."""
    length, mass = 40.0, 1e-8
    tip = uniform(
        length, REST, np.diag([1e6, 1e6, 1e6, 70.0, 1e6, 1e6]), mass=mass, mass_centre=(1.0, 0.0)
    ).equilibrium(DeadLoads((0, 0, -9810.0)), tolerance=1e-6)
    turn = -mass * 9810 * length**2 / (2 * 70.0)
    assert se3.log_rotation(tip.tip[:3, :3])[0] == pytest.approx(turn, rel=1e-3)


class TestOfAManipulator:
    body = Manipulator(
        (CASES["twist_w12"](angle=60.0, chambers=3), CASES["one_sided_w10"](angle=90.0, chambers=4))
    )
    laws = [law([1.04, 0, 0, 0.02, 0, 0]), law([1.02, 0, 0, 0, 0.015, 0])]

    def test_pieces_are_active_and_passive_in_turn(self):
        for end_effects in (True, False):
            rod = Rod.of(self.body, self.laws, 0.02, end_effects=end_effects)
            assert rod.lengths.sum() == pytest.approx(self.body.length)
            assert [p.law in self.laws for p in rod.pieces] == [False, True, False] * 2
        assert rod.lengths[[1, 4]] == pytest.approx([s.active_length for s in self.body.segments])
        whole = Rod.of(self.body, self.laws, 0.02)
        assert whole.lengths[[1, 4]] == pytest.approx([3 * self.body.segments[0].pitch, 4 * 5.0])

    def test_each_group_may_have_its_own_pressure(self):
        states = QuadraticLaw([0.0, 0.05], [REST, [1.1, 0, 0, 0.04, 0, 0]], [SLENDER, 2 * SLENDER])
        first, second = self.body.segments
        rod = Rod.of(Manipulator((first, replace(second, group=2))), states, (0.01, 0.03))
        assert rod.free_strains.k[:, 0] == pytest.approx([0, 0.008, 0, 0, 0.024, 0])

    def test_passive_pieces_yield_to_loads_less_than_soft_active_ones(self):
        rod = Rod.of(self.body, [law(stiffness=SLENDER / 4)] * 2, 0.0)
        state = rod.equilibrium(DeadLoads(tip_moment=(0, 1.0, 0)))
        owner = np.searchsorted(np.cumsum(rod.lengths), state.line.s[1:] - 1e-9)
        bend = state.line.strains.k[:, 1]
        assert bend[np.isin(owner, (1, 4))] == pytest.approx(4 / 80, rel=1e-4)
        assert (bend[~np.isin(owner, (1, 4))] < 2 / 80).all()

    def test_lines_along_the_bottom_of_slanted_segments_go_straight_into_their_ends(self):
        strains = np.array([1.02, -0.015, 0.0, 0.013, 0.014, 0.0])
        rod = Rod.of(Manipulator((CASES["one_sided_w10"](angle=60.0, chambers=3),)), law(strains), 0.02)
        bottom = np.array([0.0, 0.0, -3.0])
        for joint, beyond in ((rod.lengths[0], 0.0), (rod.lengths[:2].sum(), rod.lengths.sum())):
            active, end = rod.free().at([joint, beyond])
            slope = active[:3, :3] @ (strains[:3] + np.cross(strains[3:], bottom))
            along = end[:3, :3].T @ slope
            assert abs(along[1]) < 0.03 * 0.04 < abs(strains[3] * 3.0)
        straight = Rod.of(self.body, self.laws, 0.02)
        assert (straight.free_strains.k[[0, 2, 3, 5]] == 0).all()

    def test_a_mirrored_body_takes_the_mirrored_shape(self):
        body = Manipulator((CASES["one_sided_w10"](angle=60.0, chambers=4),))
        own = law(HELICAL, COUPLED)
        tip = Rod.of(body, own, 0.02).equilibrium(DeadLoads((3e3, 5e3, -9e3))).tip
        image = Rod.of(body.mirrored, own.mirrored, 0.02).equilibrium(DeadLoads((3e3, -5e3, -9e3))).tip
        flip = np.diag([1, -1, 1, 1])
        np.testing.assert_allclose(image, flip @ tip @ flip, atol=1e-8)

    def test_weight_is_the_bodys(self):
        """one-sided-w10 at 90 degrees, one pitch: core 250 + block 160 - channel 20 - cavity 64 = 326 mm3;
        bare core 46 mm2."""
        rod = Rod.of(Manipulator(self.body.segments[1:]), self.laws[1], 0.02)
        density = self.body.segments[1].material.density
        assert rod.pieces[1].mass * rod.pieces[1].length == pytest.approx(4 * 326 * density)
        assert rod.pieces[0].mass == pytest.approx(46 * density)
        centre = (250 * -0.5 + 160 * 4 - 64 * 3) / 326
        assert rod.pieces[1].mass_centre == pytest.approx((0.0, centre))
        assert rod.tip_centre == (0.0, -0.5)


BAD = {
    "no pieces": (lambda: Rod([]), "pieces"),
    "length": (lambda: RodPiece(0.0, law()), "length_mm = 0"),
    "pressure": (lambda: RodPiece(1.0, law(), -1e-3), "pressure_kPa = -1"),
    "mass": (lambda: RodPiece(1.0, law(), mass=np.nan), "mass = nan"),
    "pose": (lambda: Rod([RodPiece(1.0, law())], 2 * np.eye(4)), "base_pose"),
    "mirror": (lambda: Rod([RodPiece(1.0, law())], np.diag([-1.0, 1, 1, 1])), "base_pose"),
    "no pose": (lambda: Rod([RodPiece(1.0, law())], np.ones(4)), "base_pose"),
    "no law": (
        lambda: RodPiece(1.0, 3.0),
        "law: float is no SectionLaw, which has free_strains, psi, force and stiffness",
    ),
    "tolerance": (lambda: MIXED.equilibrium(tolerance=0.0), "tolerance = 0 must lie in"),
    "first load": (lambda: MIXED.equilibrium(first_load=2.0), "first_load = 2 must lie in"),
    "loads": (lambda: DeadLoads((0, 0, np.nan)), "gravity_m_per_s2 = nan must lie in"),
    "laws": (
        lambda: Rod.of(TestOfAManipulator.body, [law()] * 3, 0.0),
        "one for all or one for each of the 2 segments",
    ),
    "no laws": (lambda: Rod.of(TestOfAManipulator.body, 3.0, 0.0), "laws: float is no SegmentLaw"),
    "pressures": (
        lambda: Rod.of(TestOfAManipulator.body, law(), (0.0, 0.0, 0.0)),
        "pressure_kPa: give one, not 3",
    ),
    "states": (lambda: QuadraticLaw([0.02, 0.01], [REST] * 2, [SLENDER] * 2), "increasing pressures"),
    "unsymmetric": (lambda: law(stiffness=SLENDER + np.eye(6, k=1)), "finite and symmetric"),
    "indefinite": (lambda: law(stiffness=-SLENDER), "positive definite"),
    "beyond": (
        lambda: QuadraticLaw([0.0, 0.01], [REST] * 2, [SLENDER] * 2).free_strains(0.02),
        "this law knows 0..10 kPa",
    ),
}


@pytest.mark.parametrize(("call", "message"), BAD.values(), ids=BAD)
def test_bad_input_is_refused_in_one_line(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_quadratic_law_has_consistent_derivatives_and_shapes():
    states = QuadraticLaw(
        [0.0, 0.02, 0.05], [REST, HELICAL, HELICAL * 1.2], [SLENDER, COUPLED, 1.1 * COUPLED]
    )
    rng, step = np.random.default_rng(5), 1e-6
    q, P = HELICAL + 0.01 * rng.standard_normal((4, 6)), np.array([0.0, 0.01, 0.03, 0.05])
    found = states.psi(q, P), states.force(q, P), states.stiffness(q, P)
    assert [each.shape for each in found] == [(4,), (4, 6), (4, 6, 6)]
    for i, d in enumerate(step * np.eye(6)):
        for value, slope in (
            (states.psi, states.force(q, P)[:, i]),
            (states.force, states.stiffness(q, P)[..., i]),
        ):
            np.testing.assert_allclose(slope, (value(q + d, P) - value(q - d, P)) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(states.free_strains(P)[1], (REST + HELICAL) / 2)
    np.testing.assert_allclose(states.force(states.free_strains(P), P), 0.0, atol=1e-12)
    np.testing.assert_allclose(states.stiffness(q, 0.02), np.broadcast_to(COUPLED, (4, 6, 6)))


def test_passive_core_is_a_beam_about_its_own_centre():
    """one-sided-w10: 10 x 5 mm, centre 0.5 mm below the line, channel 2 x 2 on the line; E = 3 mu."""
    segment = CASES["one_sided_w10"](angle=90.0, chambers=2)
    K = passive_law(segment).stiffnesses[0] / (3 * segment.material.mu)
    assert K[0, 0] == pytest.approx(46.0) and K[0, 4] == pytest.approx(50 * -0.5)
    assert K[4, 4] == pytest.approx(10 * 125 / 12 + 50 * 0.25 - 2 * 8 / 12)
    assert K[5, 5] == pytest.approx(5 * 1000 / 12 - 2 * 8 / 12)
