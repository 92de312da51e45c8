"""What Newton's method asks of a system, and of the control that closes the equations for its load."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np


class System(Protocol):
    """A state (an array), a scalar load (pressure, a fraction of gravity, ...) and what must vanish there:
    hifi.body.system, hifi.cell.system."""

    state: np.ndarray
    load: float
    #: unstable directions of the factorised state; None: unknown
    unstable: int | None
    factorisations: int
    #: how deep walls that touch overlap at the last residual, over what a correction may make of it
    overreach: float

    def residual(self) -> tuple[np.ndarray, float]:
        """What must vanish (n,), and the norm of the forces it balances."""

    def load_gradient(self) -> np.ndarray:
        """(n,) derivative of the residual by the load."""

    def factorise(self) -> None:
        """Factorise the tangent at the current state."""

    def renew(self) -> bool | None:
        """Take what touches now, for `solve` and `correction`; whether that has changed, or None where a new
        tangent is due (hifi.contact.correction)."""

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K^-1 times (n,), K possibly an older tangent."""

    def correction(self, residual: np.ndarray) -> np.ndarray:
        """(n,) minus that, with the contact law's own change instead of its slope where walls touch."""

    def at_supports(self, state: np.ndarray) -> np.ndarray:
        """The state with what is prescribed at its values for the present load."""

    def moved(self, state: np.ndarray, increment: np.ndarray) -> np.ndarray:
        """Retraction of an increment (n,)."""

    def extrapolated(self, states: Sequence[np.ndarray], weights: Sequence[float]) -> np.ndarray:
        """Weighted sum of states."""

    def dot(self, a: np.ndarray, b: np.ndarray) -> float:
        """Inner product over all ranks."""

    def volume(self) -> float:
        """Of the cavity, mm3."""


class PathControl(Protocol):
    """What the scalar parameter of a path is: hifi.path.control."""

    name: str

    def told(self, parameter: float) -> str:
        """The parameter in words, with its unit."""

    def satisfied(self, system: System, parameter: float) -> bool:
        """Whether its own equation holds."""

    def close(
        self, system: System, parameter: float, step: np.ndarray, load_step: float
    ) -> tuple[np.ndarray, float]:
        """The correction completed so that its linearised equation holds."""

    def tangent(self, system: System) -> tuple[np.ndarray, float]:
        """(d state, d load) per unit of the parameter, with the factorised tangent."""

    def accepted(self, parameter: float, system: System) -> None:
        """Told after every accepted state."""
