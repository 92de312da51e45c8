"""Third-medium contact: the gap between two walls is filled with a medium that is soft until it is nearly
squeezed out.

Wriggers, Schroeder & Schwarz (Comput. Mech. 52, 2013) put a medium where bodies may touch; Bluhm, Sigmund &
Poulios (Comput. Mech. 67, 2021) keep its elements in shape by penalising second gradients. Here, with J = det
F and per undeformed volume,
    psi = gamma mu [5/6 L^2 + (|F|^2 - 3 - 2 L)/2] + kr mu/2 |grad F|^2 exp(-5 J+),
L = ln J down to J0 and its quadratic continuation below, J+ a smooth positive part of J. The medium transmits
pressure without friction. It also stiffens gaps that are open: a bias that vanishes with gamma, while a soft
medium is hard to follow along the load. So the path is followed with a stiff medium, and at each load that is
recorded the medium is softened with everything else held (`soften`), which is a path of its own with steps
that fail and are cut back.
"""

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from petsc4py import PETSc
from ufl.core.expr import Expr

from pneunet.base.errors import ConvergenceError
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.path.system import System

#: smooth positive part of J: (J + sqrt(J^2 + s^2))/2
_SMOOTH = 0.01
_DECAY = 5.0
#: steps of the softening below this are given up
SMALLEST_SOFTENING = 0.03


@dataclass(frozen=True)
class ThirdMedium:
    """gamma: shear modulus over the body's, (followed, recorded); regularisation kr in mm2 and J0
    likewise."""

    gamma: tuple = (5e-4, 2e-5)
    regularisation: tuple = (5e-3, 1e-3)
    smallest_volume: tuple = (0.01, 0.01)

    def on(self, mesh: Mesh) -> "MediumEnergy":
        """The medium's MediumEnergy on a mesh."""
        return MediumEnergy(self, mesh)

    def softer(self, start: float, end: float) -> "ThirdMedium":
        """The medium that goes from `start` times the recorded one to `end` times it; squeezed it is thinner
        likewise, by J0."""
        return ThirdMedium(
            *(
                (start * recorded, end * recorded)
                for _, recorded in (self.gamma, self.regularisation, self.smallest_volume)
            )
        )


class MediumEnergy:
    """The energy with its parameters as constants that `softening` sets: 0 the followed, 1 the recorded
    medium."""

    def __init__(self, medium: ThirdMedium, mesh: Mesh):
        self._constants = [fem.Constant(mesh, PETSc.ScalarType(1.0)) for _ in range(3)]
        self.between(medium)

    def between(self, medium: ThirdMedium) -> None:
        """Go from the `medium`'s followed to its recorded parameters, and stand at the former."""
        self._ends = np.log([medium.gamma, medium.regularisation, medium.smallest_volume])
        self.softening = 0.0

    @property
    def softening(self) -> float:
        return self._softening

    @softening.setter
    def softening(self, value: float) -> None:
        self._softening = value
        for constant, (followed, recorded) in zip(self._constants, self._ends):
            constant.value = np.exp((1 - value) * followed + value * recorded)

    @property
    def gamma(self) -> float:
        """Shear modulus of the medium now, over the body's."""
        return float(self._constants[0].value)

    def density(self, F: Expr, second: Expr, mu: Expr) -> Expr:
        """UFL energy density (MPa); second: the third-order tensor grad F (1/mm)."""
        gamma, kr, J0 = self._constants
        J = ufl.det(F)
        x = (J - J0) / J0
        L = ufl.conditional(ufl.gt(J, J0), ufl.ln(ufl.max_value(J, J0)), ufl.ln(J0) + x - x * x / 2)
        positive = (J + ufl.sqrt(J * J + _SMOOTH**2)) / 2
        shape = kr / 2 * ufl.inner(second, second) * ufl.exp(-_DECAY * positive)
        return mu * (gamma * (5 / 6 * L * L + (ufl.inner(F, F) - 3 - 2 * L) / 2) + shape)


class Softening:
    """`system` (hifi.path.newton) with the medium's softening as its load; the system's own load stays."""

    def __init__(self, system: System, energy: MediumEnergy):
        self._system, self._energy = system, energy

    def __getattr__(self, name):
        return getattr(self._system, name)

    @property
    def state(self) -> np.ndarray:
        return self._system.state

    @state.setter
    def state(self, value: np.ndarray) -> None:
        self._system.state = value

    @property
    def load(self) -> float:
        return self._energy.softening

    @load.setter
    def load(self, value: float) -> None:
        self._energy.softening = value

    def load_gradient(self) -> np.ndarray:
        """By a difference: the medium's part of the residual is all but exponential in the softening."""
        kept, step, ends = self.load, 1e-5, []
        for value in (kept - step, kept + step):
            self.load = value
            ends.append(self.residual()[0])
        self.load = kept
        return (ends[1] - ends[0]) / (2 * step)


def soften(system: System, energy: MediumEnergy, options: NewtonOptions) -> float:
    """Walk from the followed medium's equilibrium towards the recorded one's; gamma of the last equilibrium
    on the way."""
    path = EquilibriumPath(Softening(system, energy), LoadControl("the softening"), options)
    try:
        run_steps(path, 1.0, StepSize(0.5, SMALLEST_SOFTENING))
    except ConvergenceError:
        pass  # the path is back at the last equilibrium, which is recorded with its gamma
    return energy.gamma
