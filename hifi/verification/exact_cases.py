"""Cases with exact solutions: each a function of its mesh's resolution that returns a list of
`ExactComparison`."""

from pathlib import Path

import numpy as np
from dolfinx.mesh import CellType
from scipy.optimize import root_scalar

from pneunet.base.materials.laws import NeoHookean
from pneunet.hifi.body.problem import Support
from pneunet.hifi.fem.loads import EndLoad, Gravity, Pressure
from pneunet.hifi.path.control import LoadControl, VolumeControl
from pneunet.hifi.path.newton import Newton
from pneunet.hifi.verification import bodies, closed_forms
from pneunet.hifi.verification.following import (
    ExactComparison,
    body_system,
    follow,
    from_all_ranks,
    solve_from,
)

SYMMETRY = [Support(bodies.PLANE_X, 0), Support(bodies.PLANE_Y, 1), Support(bodies.PLANE_Z, 2)]
SPHERE_PRESSURES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
PAST_LIMIT_RADII = (1.7, closed_forms.SPHERE_LIMIT[0], 1.9, 2.0, 2.1, 2.2)
TUBE_PRESSURES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
CAPPED_PRESSURES = (0.1, 0.2, 0.3, 0.4, 0.5)
FLEXURE_CURVATURES = (0.1, 0.25, 0.5, 1.0, 1.5)


def sphere(
    folder: Path, size: float = 0.19, element: CellType = CellType.tetrahedron
) -> tuple[list[ExactComparison], list[ExactComparison], list[int]]:
    """(radii at given pressures, pressures at given radii up to and past the limit, unstable directions at
    the latter).

    Pressure control to 0.8, from there on volume control; radii are those of the cavity's volume.
    """
    system = body_system(
        bodies.round_body("sphere", size, element=element), SYMMETRY, [Pressure((bodies.INNER,))]
    )

    def radius():
        return (6 * system.volume() / np.pi) ** (1 / 3)

    radii = follow(system, SPHERE_PRESSURES, radius)

    def pressure_and_stability():
        system.factorise()
        return system.load, system.unstable

    volumes = [np.pi * a**3 / 6 for a in PAST_LIMIT_RADII]
    past = follow(system, volumes, pressure_and_stability, control=VolumeControl(), start=system.volume())
    told = f"h = {size:g} r", system.problem.dofs
    system.destroy()
    rows = [
        ExactComparison("sphere", f"a at P = {P}", *told, closed_forms.sphere_radius(P), a)
        for P, a in zip(SPHERE_PRESSURES, radii)
    ]
    beyond = [
        ExactComparison(
            "sphere, volume control", f"P at a = {a:g}", *told, closed_forms.sphere_pressure(a), P
        )
        for a, (P, _) in zip(PAST_LIMIT_RADII, past)
    ]
    return rows, beyond, [unstable for _, unstable in past]


class _Tube:
    """A quarter of a slice of a tube between two planes; the far one is held at a stretch that may be
    changed."""

    def __init__(self, size, element):
        self.stretch = 1.0
        end = Support(bodies.END, 0, lambda X, load: (self.stretch - 1) * X[:, 0])
        self.system = body_system(
            bodies.round_body("tube", size, element=element), [*SYMMETRY, end], [Pressure((bodies.INNER,))]
        )
        self.told = f"h = {size:g} r", self.system.problem.dofs

    def radius(self):
        """From the volume term of the inner wall: the integral of x.n/3 misses the third that the end planes
        carry."""
        return np.sqrt(6 * self.system.volume() / (np.pi * bodies.SLICE * self.stretch))

    def axial_force(self):
        return 4 * self.system.problem.reaction(bodies.END)[0][0]


def tube(folder: Path, size: float = 0.25, element: CellType = CellType.tetrahedron) -> list[ExactComparison]:
    """Inner radii of the tube held at its length."""
    held = _Tube(size, element)
    radii = follow(held.system, TUBE_PRESSURES, held.radius)
    held.system.destroy()
    return [
        ExactComparison("tube, lambda_z = 1", f"a at P = {P}", *held.told, closed_forms.tube_radius(P), a)
        for P, a in zip(TUBE_PRESSURES, radii)
    ]


def capped_tube(
    folder: Path, size: float = 0.25, element: CellType = CellType.tetrahedron
) -> list[ExactComparison]:
    """Inner radii and stretches of the tube whose axial force is the thrust P pi a^2 on its far caps."""
    held = _Tube(size, element)
    system, rows = held.system, []
    newton = Newton(system, LoadControl())

    def missing_thrust(stretch, P):
        held.stretch, system.load = stretch, P
        system.state = system.at_supports(system.state)
        newton.solve(P)
        return held.axial_force() - P * np.pi * held.radius() ** 2

    for P in CAPPED_PRESSURES:
        stretch = root_scalar(
            missing_thrust, args=(P,), x0=held.stretch, x1=held.stretch + 1e-3, xtol=1e-9
        ).root
        missing_thrust(stretch, P)
        a, exact_stretch = closed_forms.capped_tube(P)
        rows.append(ExactComparison("capped tube", f"a at P = {P}", *held.told, a, held.radius()))
        rows.append(
            ExactComparison("capped tube", f"lambda_z at P = {P}", *held.told, exact_stretch, stretch)
        )
    system.destroy()
    return rows


def torsion(
    folder: Path,
    size: float = 0.3,
    stretch: float = 1.2,
    twist: float = 0.5,
    element: CellType = CellType.tetrahedron,
) -> tuple[list[ExactComparison], float]:
    """(torque and axial force of a stretched and twisted cylinder, largest error of its displacements in
    mm)."""

    def motion(X, load):
        """The exact deformation at a fraction of the final stretch and twist per length."""
        lam, psi = 1 + load * (stretch - 1), load * twist
        angle, shrink = psi * X[:, 0], lam**-0.5
        c, s = np.cos(angle), np.sin(angle)
        y, z = shrink * (c * X[:, 1] - s * X[:, 2]), shrink * (s * X[:, 1] + c * X[:, 2])
        return np.stack([lam * X[:, 0], y, z], axis=1) - X

    supports = [Support(bodies.PLANE_X, None, motion), Support(bodies.END, None, motion)]
    system = body_system(bodies.round_body("cylinder", size, element=element), supports, [])
    problem = system.problem
    [(force, moment)] = follow(system, [1.0], lambda: problem.reaction(bodies.END), first=0.5)
    X, u = from_all_ranks(problem, lambda X: X[:, 0] > -1)
    told = f"h = {size:g}", problem.dofs
    system.destroy()
    torque, axial = closed_forms.torsion(stretch, twist)
    at = f"at lambda = {stretch:g}, psi = {twist:g}"
    rows = [
        ExactComparison("torsion of a solid cylinder", f"torque {at}", *told, torque, moment[0]),
        ExactComparison("torsion of a solid cylinder", f"axial force {at}", *told, axial, force[0]),
    ]
    return rows, float(np.abs(u - motion(X, 1.0)).max())


def flexure(
    cells: tuple[int, int] = (4, 16),
    length: float = 0.3,
    thickness: float = 0.07,
    element: CellType = CellType.tetrahedron,
) -> list[ExactComparison]:
    """Moments of a block of height 1 bent in plane strain: rollers in the middle, an end section that turns
    as it should.

    A strongly bent block wrinkles on its inner face (about 0.55 of its length is where a half-space becomes
    unstable, Biot 1963), so that a path followed from rest may leave the exact solution: each bending starts
    from that solution's interpolant.
    """

    def radius(X, k):
        return np.sqrt(closed_forms.flexure_radii(k)[0] ** 2 + 2 * X[:, 1] / k)

    def motion(X, k):
        if k == 0:
            return np.zeros_like(X)
        r = radius(X, k)
        y = r * np.cos(k * X[:, 0]) - closed_forms.flexure_radii(k)[0]
        return np.stack([r * np.sin(k * X[:, 0]), y, X[:, 2]], axis=1) - X

    sides = [Support(bodies.PLANE_Z, 2), Support(bodies.END_Z, 2)]
    supports = [Support(bodies.PLANE_X, 0), *sides, Support(bodies.END, None, motion)]
    system = body_system(bodies.box((length, 1.0, thickness), (*cells, 1), element=element), supports, [])
    told, rows = (f"{cells[0]} x {cells[1]} x 1", system.problem.dofs), []
    for k in FLEXURE_CURVATURES:
        solve_from(
            system,
            k,
            lambda X, k=k: motion(X, k),
            lambda X, k=k: closed_forms.flexure_pressure(k, radius(X, k)),
        )
        centre = (0.0, -closed_forms.flexure_radii(k)[0], 0.0)
        M = -system.problem.reaction(bodies.END, centre)[1][2] / thickness
        exact = closed_forms.flexure_moment(k)
        rows.append(ExactComparison("plane-strain flexure", f"M at k = {k:g}", *told, exact, M))
    system.destroy()
    return rows


STRIP = 90.0, 2.0, 2.0  # length, width, height, mm
STRIP_DENSITY = 1.07e-9
#: the load and its (tip force, weight per length, tip moment)
STRIP_LOADS = {
    "gravity": (
        Gravity(NeoHookean(1.0, density=STRIP_DENSITY), (0.0, 0.0, -9810.0)),
        (0.0, 9810 * STRIP_DENSITY * 4.0, 0.0),
    ),
    "force": (EndLoad(bodies.END, force=(0.0, 0.0, -5e-4)), (5e-4, 0.0, 0.0)),
    "moment": (EndLoad(bodies.END, moment=(0.0, 0.04, 0.0)), (0.0, 0.0, 0.04)),
}


def cantilever(
    name: str,
    cells: tuple[int, int, int] = (60, 2, 2),
    element: CellType = CellType.tetrahedron,
) -> tuple[np.ndarray, np.ndarray]:
    """(tip (x, z) of a strip under one of STRIP_LOADS, that of the elastica with E = 3 mu and I = w
    h^3/12)."""
    length, width, height = STRIP
    load, elastica = STRIP_LOADS[name]
    system = body_system(bodies.strip(STRIP, cells, element), [Support(bodies.PLANE_X)], [load], spacing=4.0)
    follow(system, [1.0], lambda: None, first=0.2)
    X, u = from_all_ranks(system.problem, lambda X: X[:, 0] > length - 1e-6)
    system.destroy()
    return (X + u)[:, [0, 2]].mean(axis=0), np.array(
        closed_forms.elastica(3 * width * height**3 / 12, length, *elastica)
    )
