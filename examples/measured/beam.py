"""Clamped silicone beam under its own weight and a load at its tip: measured, rod, body.

Source: the public repository srl-ethz/diffPD_sim2real, `realbeam_experiments` (motion capture, two repeats a
load). A bar of Dragon Skin 10, 30 x 30 x 100 mm, clamped at one end, horizontal. E = 263,824 Pa was fitted by
that group to this very experiment, with their own finite elements: so its first row tests the load model, and
the others the law. Density 1070 kg/m3, Poisson's ratio 0.499.

Assumed: that the first frames show the straight beam, held by hand; that the whole 100 mm hang free; that the
weight acts at the middle of the tip's face; that the tip markers' mean drop is the axis' there; that the
silicone is incompressible (E = 3 mu) and neo-Hookean, with no creep.
"""

import numpy as np

from pneunet.base.materials.laws import NeoHookean
from pneunet.base.units import GRAVITY
from pneunet.geometry.loading import DeadLoads
from pneunet.reduced import QuadraticLaw, Rod
from pneunet.reduced.rod.clamp import stiffening
from pneunet.reduced.rod.quadratic import beam_stiffness
from pneunet.reduced.rod.rod import RodPiece

LENGTH, SIDE = 100.0, 30.0
E, DENSITY = 0.263824, 1070e-12
MU = E / 3
#: N at the tip -> lowest and highest of the measured drops of three tip markers in two repeats, mm
MEASURED = {0.0: (6.2, 6.7), 0.510: (16.0, 17.6), 0.991: (23.6, 27.6)}
#: mm, of the measured drops as they stand in the source's table
ROUNDED = 0.05
NAMES = ("own weight", "own weight + 52 g", "own weight + 101 g")
#: torsion constant of a square over the fourth power of its side (Timoshenko & Goodier, Sec. 109)
SQUARE = 0.1406


def euler_bernoulli(force: float) -> float:
    """Drop (mm) of the tip, small and without shear."""
    weight, EI = DENSITY * SIDE**2 * GRAVITY, E * SIDE**4 / 12
    return weight * LENGTH**4 / (8 * EI) + force * LENGTH**3 / (3 * EI)


def rod_drop(force: float) -> float:
    """Drop (mm) of the tip of a rod that bends, shears and stretches, at any size, and whose clamp holds its
    section."""
    half = SIDE / 2
    square, torsion = [(half, -half, half, MU)], MU * SQUARE * SIDE**4
    laws = [
        QuadraticLaw([0.0], [np.eye(6)[0]], [beam_stiffness(square, torsion, stiffening(SIDE, SIDE, near))])
        for near in (half, np.inf)  # within half a depth of the clamp, and beyond
    ]
    lengths = half, LENGTH - half
    rod = Rod([RodPiece(s, law, mass=DENSITY * SIDE**2) for s, law in zip(lengths, laws)])
    state = rod.equilibrium(DeadLoads((0.0, 0.0, -GRAVITY), (0.0, 0.0, -force)), tolerance=1e-5)
    return float(-state.tip[2, 3])


def body_drop(force: float, cells: tuple[int, int, int] = (18, 6, 6)) -> float:
    """The same of the whole bar in finite elements, of the middle of its tip's face."""
    from pneunet.hifi.body.problem import Support
    from pneunet.hifi.fem.loads import EndLoad, Gravity
    from pneunet.hifi.verification import bodies
    from pneunet.hifi.verification.following import body_system, displacement_at, follow

    material = NeoHookean(MU, density=DENSITY)
    loads = [Gravity(material, (0.0, 0.0, -GRAVITY)), EndLoad(bodies.END, force=(0.0, 0.0, -force))]
    mesh = bodies.strip((LENGTH, SIDE, SIDE), cells)
    system = body_system(mesh, [Support(bodies.PLANE_X)], loads, material)
    [u] = follow(system, [1.0], lambda: displacement_at(system.problem, (LENGTH, 0.0, 0.0)), first=0.5)
    system.destroy()
    return float(-u[2])


def off(drop: float, force: float) -> float:
    """A drop over the middle of the measured ones, less 1."""
    return drop / float(np.mean(MEASURED[force])) - 1


def lines(with_body: bool = False) -> list[str]:
    """One a load, for people."""
    out = []
    for name, (force, (low, high)) in zip(NAMES, MEASURED.items()):
        computed = {"Euler-Bernoulli": euler_bernoulli(force), "rod": rod_drop(force)}
        if with_body:
            computed["finite elements"] = body_drop(force)
        told = []
        for who, drop in computed.items():
            verdict = "agrees" if low - ROUNDED <= drop <= high + ROUNDED else "does not agree"
            told.append(f"{who} {drop:.2f} mm ({100 * off(drop, force):+.1f} %, {verdict})")
        out.append(f"{name}: measured {low} to {high} mm; {', '.join(told)}")
    return out
