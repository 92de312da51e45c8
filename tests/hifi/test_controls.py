"""Walking along a path by volume or by arc length, and naming the limit points of the load that it passes."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pneunet.base.errors import ConvergenceError
from pneunet.base.materials.laws import NeoHookean
from pneunet.hifi.body.problem import BodyProblem, Support
from pneunet.hifi.body.system import BodySystem
from pneunet.hifi.fem.loads import EndLoad, Pressure
from pneunet.hifi.fem.surface import FaceQuadrature
from pneunet.hifi.path.control import ArcLength, LoadControl, VolumeControl
from pneunet.hifi.path.equilibrium import EquilibriumPath, PathState, limit_point
from pneunet.hifi.path.rod_coordinates import RodCoordinates
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.closed_forms import SPHERE_LIMIT, sphere_pressure
from pneunet.hifi.verification.exact_cases import SYMMETRY
from pneunet.hifi.verification.following import body_system

HALF_SPAN, RISE = 20.0, 3.0


def test_a_limit_point_is_the_top_of_the_parabola():
    def state(x):  # load 5 - (x - 2)^2, volume 3 x
        return PathState(x, 5 - (x - 2) ** 2, None, 3 * x)

    found = limit_point([state(x) for x in (0.5, 1.7, 2.6)])
    assert (found.load, found.volume, found.kind) == (pytest.approx(5.0), pytest.approx(6.0), "maximum")
    assert limit_point([state(x) for x in (0.5, 1.7, 1.9)]) is None


@pytest.fixture
def sphere(shared_directory):
    mesh = bodies.round_body("sphere", 0.25)
    system = body_system(mesh, SYMMETRY, [Pressure((bodies.INNER,))])
    yield system
    system.destroy()


def named(path):
    """The one limit point that the path has passed must be the sphere's."""
    [limit] = path.limit_points
    assert limit.load == pytest.approx(SPHERE_LIMIT[1], rel=2e-3)
    assert limit.volume == pytest.approx(np.pi * SPHERE_LIMIT[0] ** 3 / 6, rel=0.05)
    assert limit.kind == "maximum"


def test_arc_length_follows_the_sphere_through_its_limit_point(sphere):
    path, seen = EquilibriumPath(sphere, ArcLength(sphere)), []
    run_steps(path, 0.9, StepSize(0.01, 1e-5, 0.1), lambda step: seen.append((sphere.volume(), sphere.load)))
    volumes, pressures = np.array(seen).T
    radii = (6 * volumes / np.pi) ** (1 / 3)
    assert radii[-1] > 2.1 and (np.diff(radii) > 0).all()
    assert pressures == pytest.approx(sphere_pressure(radii), rel=3e-3, abs=3e-4)  # a coarse mesh
    named(path)


def test_several_pressures_rise_together(shared_directory):
    """One path, two pressures at a ratio: only their difference deforms an incompressible sphere."""
    mesh = bodies.round_body("sphere", 0.25)
    inner, outer = Pressure((bodies.INNER,)), Pressure((bodies.OUTER,), share=0.0)  # the cavity is the inner
    problem = BodyProblem(*mesh, NeoHookean(1.0), SYMMETRY, [inner, outer])

    def apply(load):
        inner.value.value, outer.value.value = 1.5 * load, 0.5 * load

    system = BodySystem(problem, RodCoordinates(problem.nodes, problem.owned_nodes, problem.mesh.comm), apply)
    run_steps(EquilibriumPath(system, LoadControl()), 0.3, StepSize(0.1, 1e-3))
    assert (6 * system.volume() / np.pi) ** (1 / 3) == pytest.approx(1.10556673, rel=1e-3)
    system.destroy()


def test_volume_control_names_the_limit_point(sphere):
    path = EquilibriumPath(sphere, VolumeControl(), start=sphere.volume())
    run_steps(path, 5.0, StepSize(0.1, 1e-4, 0.5))
    named(path)


def test_pressure_control_says_that_a_limit_point_is_likely(sphere):
    with pytest.raises(ConvergenceError, match="limit point of the load is likely .* times as compliant"):
        run_steps(EquilibriumPath(sphere, LoadControl()), 1.0, StepSize(0.1, 1e-3))


def half_chevron(X):
    """What makes of a box half of a shallow arch of two straight strips, which rises by RISE from its clamp
    to its middle."""
    return X - [0.0, 1.0, 0.5] + X[:, :1] * [0.0, 0.0, RISE / HALF_SPAN]


def test_arc_length_follows_an_arch_that_snaps_through():
    """A dead force on the middle: it rises, falls and rises again. Pushing the middle down step by step takes
    the same forces but for an end effect, some 4 % of the largest: the pushed face may not deform in its
    plane, where the strips bend most."""
    mesh = bodies.box((HALF_SPAN, 2, 1), (20, 2, 2), half_chevron)
    clamp, plane = Support(bodies.PLANE_X), Support(bodies.END, 0)

    def depth(problem):
        """Mean way down of the middle's face, mm."""
        return (
            RISE - FaceQuadrature(problem, bodies.END).moments(problem.nodes + problem.displacement())[1][2]
        )

    pushed = body_system(
        mesh, [clamp, plane, Support(bodies.END, 2, lambda X, load: -load + 0 * X[:, 0])], [], spacing=2.0
    )
    depths, forces = [0.0], [0.0]

    def push(step):
        depths.append(step.load)
        forces.append(-pushed.problem.reaction(bodies.END)[0][2])

    run_steps(EquilibriumPath(pushed, LoadControl()), 7.0, StepSize(0.25, 1e-3, 0.25), push)
    pushed.destroy()
    loaded = body_system(mesh, [clamp, plane], [EndLoad(bodies.END, force=(0.0, 0.0, -1.0))], spacing=2.0)
    path, seen = EquilibriumPath(loaded, ArcLength(loaded)), []
    run_steps(
        path, 3.6, StepSize(0.1, 1e-5, 0.2), lambda step: seen.append((depth(loaded.problem), loaded.load))
    )
    loaded.destroy()
    top, bottom = path.limit_points
    assert (top.kind, bottom.kind) == ("maximum", "minimum") and bottom.load < 0.5 * top.load
    ways, loads = np.array(seen).T
    assert ways[-1] > 1.5 * RISE
    assert loads == pytest.approx(CubicSpline(depths, forces)(ways), rel=0.08, abs=0.05 * top.load)
