"""Each law through the finite element residual and tangent against its closed form, on homogeneous states of
a unit cube."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from pneunet.base.materials.hyperelastic import MODES, nominal_stress, shear_stress, slopes
from pneunet.base.materials.laws import Gent, MooneyRivlin, NeoHookean, Ogden, Yeoh, material_from_table
from pneunet.hifi.body.problem import BodyProblem
from pneunet.hifi.verification import bodies
from tests.toy_law import Demiray

LAWS = [
    NeoHookean(0.3),
    MooneyRivlin(0.12, 0.03),
    Yeoh(0.1, -1e-3, 2e-4),
    Gent(0.3, 20.0),
    Ogden(0.2, 1.3, 0.004, 5.0, 0.03, -2.0),
    Demiray(0.3, 0.1),
]


class Cube:
    """Residual and tangent of one material on a free unit cube, as functions of a displacement gradient and a
    pressure."""

    def __init__(self, material):
        self.material = material
        self.problem = BodyProblem(*bodies.box((1.0, 1.0, 1.0), (1, 1, 1)), material, [])
        self.energy = self.problem.stored_energy

    def field(self, H, p=0.0):
        """Array of the mixed space with displacement H X and pressure p."""
        array = np.zeros(len(self.problem.array))
        array[self.problem.displacement_dofs] = self.problem.nodes @ np.asarray(H).T
        array[self.problem.pressure_dofs] = p
        return array

    def set(self, F, p):
        self.problem.set_array(self.field(np.asarray(F) - np.eye(3), p))

    def work(self, H, p=0.0):
        """dPi of the variation H X of the displacement and p of the pressure."""
        r, _ = self.problem.residual()
        return self.problem.total(r @ self.field(H, p)[: len(r)])

    def stiffness(self, H):
        """d2Pi along H X, twice."""
        A = self.problem.assemble_tangent(self.problem.create_tangent())
        x, y = A.createVecs()
        x.array[:] = self.field(H)[: len(x.array)]
        A.mult(x, y)
        return x.dot(y)


@pytest.fixture(scope="module")
def cubes():
    """law -> its Cube, made once"""
    return {m.law: Cube(m) for m in LAWS}


@pytest.fixture(params=[m.law for m in LAWS])
def cube(cubes, request):
    return cubes[request.param]


@pytest.fixture
def ogden(cubes):
    return cubes["Ogden"]


def free_pressure(material, stretches):
    """p that leaves the third direction free of stress: s_3 - mean s + p = 0."""
    s = slopes(material, stretches)
    return s.mean() - s[2]


@pytest.mark.parametrize("mode", MODES)
def test_homogeneous_stretch(cube, mode):
    for stretch in (0.7, 1.0, 1.4, 2.6):
        stretches = MODES[mode](np.array(stretch))
        cube.set(np.diag(stretches), free_pressure(cube.material, stretches))
        pulled = [1, 1, 0] if mode == "equibiaxial" else [1, 0, 0]
        force = cube.work(np.diag(pulled)) / sum(pulled)
        assert force == pytest.approx(nominal_stress(cube.material, mode, stretch), rel=1e-9, abs=1e-12)
        assert cube.work(np.diag([0, 0, 1])) == pytest.approx(0, abs=1e-9)  # free direction
        assert cube.work(np.zeros((3, 3)), 1.0) == pytest.approx(0, abs=1e-12)  # volume


def test_simple_shear(cube):
    for amount in (-0.3, 0.2, 1.7):
        F = np.eye(3)
        F[0, 1] = amount
        cube.set(F, 0.0)
        assert cube.work(F - np.eye(3)) / amount == pytest.approx(
            shear_stress(cube.material, amount), rel=1e-9
        )


def test_stress_and_tangent_are_derivatives_of_the_energy(cube):
    F, H = (
        np.array([[1.3, 0.2, 0.0], [-0.1, 0.8, 0.3], [0.1, 0.0, 1.1]]),
        np.array([[0.3, -1, 0.2], [0.5, 0.1, 0.4], [0, 0.7, -0.2]]),
    )
    energies, works, step = [], [], 1e-3
    for k in (-2, -1, 1, 2):
        cube.set(F + k * step * H, 0.03)
        energies.append(cube.energy())
        works.append(cube.work(H))
    cube.set(F, 0.03)
    difference = np.array([1, -8, 8, -1]) / (12 * step)
    assert cube.work(H) == pytest.approx(difference @ energies, rel=1e-8)
    assert cube.stiffness(H) == pytest.approx(difference @ works, rel=1e-8)


def eigenvalue_energy(material, F):
    """Ogden's energy by numpy's singular values."""
    l = np.linalg.svd(F, compute_uv=False) / np.cbrt(np.linalg.det(F))
    return sum(2 * mu / a**2 * (np.sum(l**a) - 3) for mu, a in material.terms)


@pytest.mark.parametrize(
    "F", [np.eye(3), np.diag([1.6, 0.8, 0.8]), np.diag([0.5, 1.4, 1.4]), np.diag([1.5, 1.1, 0.7])], ids=str
)
def test_ogden_stress_and_tangent_at_repeated_stretches(ogden, F):
    rng = np.random.default_rng(1)
    ogden.set(F, 0.0)
    assert ogden.energy() == pytest.approx(eigenvalue_energy(ogden.material, F), rel=1e-9, abs=1e-14)
    step = 4e-3
    for H in rng.normal(size=(4, 3, 3)):
        H /= np.linalg.norm(H)
        w = [eigenvalue_energy(ogden.material, F + k * step * H) for k in range(-4, 5)]
        first = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) @ w / step
        second = (
            np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
            @ w
            / step**2
        )
        assert ogden.work(H) == pytest.approx(first, rel=1e-8, abs=1e-10)
        assert ogden.stiffness(H) == pytest.approx(second, rel=1e-6, abs=1e-8)
        if (F == np.eye(3)).all():
            E = (H + H.T) / 2 - np.trace(H) / 3 * np.eye(3)
            assert ogden.stiffness(H) == pytest.approx(2 * ogden.material.mu * np.sum(E * E), rel=1e-9)


def test_a_finite_bulk_modulus_changes_the_volume(cube):
    """Uniaxial tension of a compressible cube: isochoric stress s_i - mean s, pressure p = K (J - 1)."""
    material = type(cube.material)(
        *(getattr(cube.material, n) for n in cube.material.parameters), bulk_modulus=2.0
    )
    soft = Cube(material)  # the same form, compiled already

    def stresses(x):
        stretches = np.array([1.5, x[0], x[0]])
        J = stretches.prod()
        s = slopes(material, stretches / np.cbrt(J))
        return s - s.mean() + material.bulk_modulus * (J - 1) * J

    [side] = fsolve(lambda x: stresses(x)[2], 0.85, xtol=1e-13)
    J = 1.5 * side**2
    assert J > 1.005
    soft.set(np.diag([1.5, side, side]), material.bulk_modulus * (J - 1))
    assert soft.work(np.diag([1, 0, 0])) == pytest.approx(stresses([side])[0] / 1.5, rel=1e-9)
    assert soft.work(np.diag([0, 0, 1])) == pytest.approx(0, abs=1e-9)
    assert soft.work(np.zeros((3, 3)), 1.0) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("nu", [0.2, 0.35])
def test_a_stiff_layer_of_paper_follows_hookes_law(cubes, nu):
    """Its Young's modulus and Poisson's ratio come back at small strain, in tension and in shear."""
    paper = Cube(material_from_table({"youngs_modulus_MPa": 6500, "poisson_ratio": nu}, "paper"))
    strain = 1e-6
    pressure = paper.material.bulk_modulus * strain * (1 - 2 * nu)
    paper.set(np.diag([1 + strain, 1 - nu * strain, 1 - nu * strain]), pressure)
    assert paper.work(np.diag([1, 0, 0])) / strain == pytest.approx(6500, rel=1e-5)
    assert paper.work(np.diag([0, 1, 0])) / strain == pytest.approx(0, abs=0.1)
    assert paper.work(np.zeros((3, 3)), 1.0) / strain == pytest.approx(0, abs=1e-5)
    paper.set([[1, strain, 0], [0, 1, 0], [0, 0, 1]], 0.0)
    shear = paper.work([[0, 1, 0], [0, 0, 0], [0, 0, 0]]) / strain
    assert shear == pytest.approx(6500 / 2 / (1 + nu), rel=1e-5)


def test_beyond_gents_limit_there_is_no_stress():
    """Not a finite one of the wrong sign: Newton's method must see that it left the admissible states."""
    cube = Cube(Gent(0.3, 5.0))
    for stretch, admissible in ((2.5, True), (2.7, False), (4.0, False)):
        stretches = MODES["uniaxial"](np.array(stretch))
        assert (np.sum(stretches**2) - 3 < 5.0) == admissible
        cube.set(np.diag(stretches), 0.0)
        assert np.isfinite(cube.work(np.diag([1, 0, 0]))) == admissible
