"""Finite elements against exact solutions of incompressible neo-Hookean bodies (mu = 1 MPa, radii 1 and 2 mm)."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from base.materials import NeoHookean
from hifi.body import BodySystem
from hifi.control import LoadControl, VolumeControl
from hifi.loads import EndLoad, Gravity, Pressure
from hifi.path import EquilibriumPath
from hifi.problem import MixedProblem, Support
from hifi.rod_coordinates import RodCoordinates
from hifi.stepping import StepSize, run_steps
from tests.hifi import bodies

SYMMETRY = [Support(bodies.PLANE_X, 0), Support(bodies.PLANE_Y, 1), Support(bodies.PLANE_Z, 2)]


def body_system(mesh, supports, loads, material=None, spacing=None):
    """BodySystem (mu = 1 MPa by default) whose load is the common value of all `loads`."""
    problem = MixedProblem(*mesh, material or NeoHookean(1.0), supports, loads)

    def apply(value):
        for load in loads:
            load.value.value = value

    return BodySystem(problem, RodCoordinates(problem.nodes, problem.owned_nodes, problem.mesh.comm, spacing), apply)


def follow(mesh, supports, loads, observe, cavity=(bodies.INNER,), first=0.05):
    """[observe(problem) at each of the loads]; the load is the pressure in the cavity, or drives the supports."""
    system = body_system(mesh, supports, [Pressure(cavity)] if cavity else [])
    seen = {}
    size = StepSize(first, 1e-4, milestones=tuple(loads))
    path = EquilibriumPath(system, LoadControl())
    run_steps(path, loads[-1], size, lambda step: seen.update({step.load: observe(system.problem)}))
    system.destroy()
    return [seen[load] for load in loads]


def sphere_pressure(a):
    """Pressure of the inflated sphere at inner radius a, from the closed form."""

    def f(stretch):
        return 2 / stretch + 1 / (2 * stretch**4)

    return f((a**3 + 7) ** (1 / 3) / 2) - f(a)


def sphere_radius(P):
    """Inner radius below the limit point."""
    return brentq(lambda a: sphere_pressure(a) - P, 1.0, 1.8)


def test_inflated_sphere(shared_directory):
    mesh = bodies.build(shared_directory, "sphere", 0.4, bodies.sphere_octant, bodies.sphere_faces)
    loads = [0.1, 0.3, 0.5, 0.7]
    radii = follow(mesh, SYMMETRY, loads, lambda problem: (6 * problem.cavity_volume() / np.pi) ** (1 / 3))
    # the exact formula itself against the tabulated values
    assert [sphere_radius(P) for P in loads] == pytest.approx([1.03041551, 1.10556673, 1.21288815, 1.40224705], abs=1e-8)
    assert radii == pytest.approx([sphere_radius(P) for P in loads], rel=1e-3)


def test_sphere_under_volume_control_passes_its_limit_point(shared_directory):
    """Pressure at given radius, up to and beyond its maximum 0.81642 at a = 1.828147; one direction turns unstable there."""
    mesh = bodies.build(shared_directory, "sphere", 0.25, bodies.sphere_octant, bodies.sphere_faces)
    system = body_system(mesh, SYMMETRY, [Pressure((bodies.INNER,))])
    start, seen = system.volume(), {}
    radii = np.array([1.2, 1.6, 1.9, 2.2])
    volumes = np.pi * radii**3 / 6
    path = EquilibriumPath(system, VolumeControl(), start=start)

    def observe(step):
        if step.load in volumes:
            system.factorise()
            seen[step.load] = (system.load, system.unstable)

    run_steps(path, volumes[-1], StepSize(0.1, 1e-4, milestones=tuple(volumes)), observe)
    pressures, unstable = zip(*(seen[v] for v in volumes))
    system.destroy()
    assert sphere_pressure(1.828147) == pytest.approx(0.81642365, abs=1e-8)
    assert pressures == pytest.approx(sphere_pressure(radii), rel=1e-3)
    assert unstable == (0, 0, 1, 1)


def cantilever(EI, length, force, weight, moment):
    """Tip (x, z) of an inextensible elastica clamped along x under a downward tip force (N), weight per length and tip moment."""
    from scipy.integrate import solve_bvp

    def slope(s, y):  # angle, its derivative; EI angle'' = (force + weight (L - s)) cos(angle), downwards positive
        return np.vstack([y[1], -(force + weight * (length - s)) * np.cos(y[0]) / EI, np.cos(y[0]), np.sin(y[0])])

    def ends(a, b):
        return np.array([a[0], b[1] - moment / EI, a[2], a[3]])

    s = np.linspace(0, length, 201)
    found = solve_bvp(slope, ends, s, np.vstack([0 * s, 0 * s, s, 0 * s]), tol=1e-8)
    assert found.success
    return found.y[2, -1], -found.y[3, -1]


STRIP = 60.0, 2.0, 2.0  # length, width, height, mm
STRIP_LOADS = {
    "gravity": (Gravity(NeoHookean(1.0, density=1.07e-9), (0.0, 0.0, -9810.0)), (0.0, 9810 * 1.07e-9 * 4.0, 0.0)),
    "force": (EndLoad(bodies.END, force=(0.0, 0.0, -1e-3)), (1e-3, 0.0, 0.0)),
    "moment": (EndLoad(bodies.END, moment=(0.0, 0.06, 0.0)), (0.0, 0.0, 0.06)),
}


@pytest.mark.parametrize(("load", "elastica"), STRIP_LOADS.values(), ids=STRIP_LOADS)
def test_cantilever_strip_is_an_elastica(shared_directory, load, elastica):
    """Tip displacement within 1 % of its own size; E = 3 mu, I = w h^3/12."""
    length, width, height = STRIP
    mesh = bodies.build(shared_directory, "strip", 1.0, lambda: bodies.strip(*STRIP), lambda box: bodies.strip_faces(box, length))
    system = body_system(mesh, [Support(bodies.PLANE_X)], [load], spacing=4.0)
    run_steps(EquilibriumPath(system, LoadControl()), 1.0, StepSize(0.2, 1e-3))
    owned = slice(system.problem.owned_nodes)  # each node once, whatever the ranks
    X, u = system.problem.nodes[owned], system.problem.displacement()[owned]
    tip = np.flatnonzero(np.linalg.norm(X - [length, 0.0, 0.0], axis=1) < 0.6 * height)
    comm = system.comm
    rows = np.concatenate(comm.allgather((X + u)[tip][X[tip, 0] > length - 1e-6]))
    system.destroy()
    x, z = cantilever(3 * width * height**3 / 12, length, *elastica)
    wanted = np.array([x, z])
    moved = np.hypot(wanted[0] - length, wanted[1])
    assert abs(wanted[1]) > 0.2 * length
    assert rows[:, [0, 2]].mean(axis=0) == pytest.approx(wanted, abs=0.01 * moved)


def capped_tube(P):
    """(inner radius, axial stretch) of the infinite capped tube: radial equilibrium and thrust P pi a^2."""
    from scipy.optimize import fsolve

    r, w = np.polynomial.legendre.leggauss(40)

    def residual(x):
        a, stretch = x
        b = np.sqrt(a * a + 3 / stretch)
        radius = (b - a) / 2 * r + (a + b) / 2
        weight = (b - a) / 2 * w
        R = np.sqrt(1 + stretch * (radius**2 - a**2))
        srr, spp, szz = (R / (radius * stretch)) ** 2, (radius / R) ** 2, stretch**2
        return [np.sum(weight * (spp - srr) / radius) - P, np.sum(weight * (2 * szz - srr - spp) * radius)]

    return fsolve(residual, [1 + P / 2, 1.0], xtol=1e-12)


def test_capped_tube(shared_directory):
    mesh = bodies.build(shared_directory, "capsule", 0.5, bodies.capsule_octant, bodies.capsule_faces)

    def middle(problem):
        X = problem.nodes[: problem.owned_nodes]
        radius = np.hypot(X[:, 1], X[:, 2])
        inner = np.flatnonzero((X[:, 0] < 1.0) & (radius < 1.001))
        rows = problem.mesh.comm.allgather((X[inner], problem.displacement()[inner]))
        Xs, us = (np.concatenate(part) for part in zip(*rows))
        a = np.hypot(Xs[:, 1] + us[:, 1], Xs[:, 2] + us[:, 2]).mean()
        return [a, 1 + np.sum(Xs[:, 0] * us[:, 0]) / np.sum(Xs[:, 0] ** 2)]

    assert list(capped_tube(0.3)) == pytest.approx([1.27865588, 1.01267626], abs=1e-7)
    loads = [0.1, 0.3]
    for P, (a, stretch) in zip(loads, follow(mesh, SYMMETRY, loads, middle)):
        assert [a, stretch] == pytest.approx(capped_tube(P), rel=1e-3)


def test_torsion_and_stretch_of_a_cylinder(shared_directory):
    mesh = bodies.build(shared_directory, "cylinder", 0.5, bodies.cylinder, bodies.cylinder_faces)
    stretch, twist = 1.2, 0.5

    def motion(X, load):
        """The exact deformation at a fraction of the final stretch and twist per length."""
        lam, psi = 1 + load * (stretch - 1), load * twist
        angle, shrink = psi * X[:, 0], lam**-0.5
        c, s = np.cos(angle), np.sin(angle)
        y, z = shrink * (c * X[:, 1] - s * X[:, 2]), shrink * (s * X[:, 1] + c * X[:, 2])
        return np.stack([lam * X[:, 0], y, z], axis=1) - X

    supports = [Support(bodies.PLANE_X, None, motion), Support(bodies.END, None, motion)]

    def observe(problem):
        error = np.abs(problem.displacement() - motion(problem.nodes, 1.0)).max()
        return *problem.reaction(bodies.END), problem.mesh.comm.allreduce(error, op=MPI.MAX)

    [(force, moment, error)] = follow(mesh, supports, [1.0], observe, cavity=(), first=0.2)
    a2 = 1 / stretch
    assert moment[0] == pytest.approx(np.pi * twist / (2 * stretch), rel=1e-3)
    assert force[0] == pytest.approx(np.pi * a2 * (stretch**2 - 1 / stretch) - np.pi * twist**2 * a2**2 / 4, rel=2e-3)
    assert error < 2e-3
