"""What closes the equations for the load along a path: the load itself, the cavity's volume, or the arc
length."""

import numpy as np

from pneunet.base.units import KPA_PER_MPA
from pneunet.hifi.path.system import System


class LoadControl:
    """The parameter is the load: a pressure (MPa), or the share of what `share_of` says in words."""

    name = "load"

    def __init__(self, share_of: str = ""):
        self.share_of = share_of

    def told(self, parameter: float) -> str:
        if self.share_of:
            return f"{100 * parameter:.4g} % of {self.share_of}"
        return f"{parameter * KPA_PER_MPA:.4g} kPa"

    def satisfied(self, system: System, parameter: float) -> bool:
        return system.load == parameter

    def close(
        self, system: System, parameter: float, step: np.ndarray, load_step: float
    ) -> tuple[np.ndarray, float]:
        return step, 0.0  # the predictor has set the load

    def tangent(self, system: System) -> tuple[np.ndarray, float]:
        return -system.solve(system.load_gradient()), 1.0

    def accepted(self, parameter: float, system: System) -> None:
        pass


class _Bordered:
    """One more unknown, the load, and one more equation g(state) = parameter with gradient `row`: block
    elimination."""

    def close(
        self, system: System, parameter: float, step: np.ndarray, load_step: float
    ) -> tuple[np.ndarray, float]:
        along = -system.solve(system.load_gradient())
        row = self.row(system)
        missing = -self.gap(system, parameter) - system.dot(row, step)
        change = missing / system.dot(row, along)
        return step + change * along, load_step + change

    def tangent(self, system: System) -> tuple[np.ndarray, float]:
        along = -system.solve(system.load_gradient())
        rate = system.dot(self.row(system), along)
        return along / rate, 1.0 / rate

    def accepted(self, parameter: float, system: System) -> None:
        pass


class VolumeControl(_Bordered):
    """The parameter is the cavity's volume (mm3), the load its pressure: walks through limit points of the
    pressure.

    The energy's load term is -P V, so the gradient of the volume is minus the residual's derivative by the
    load. relative_tolerance: of the volume.
    """

    name = "volume"

    def __init__(self, relative_tolerance: float = 1e-10):
        self.relative_tolerance = relative_tolerance

    def told(self, parameter: float) -> str:
        return f"{parameter:.4g} mm3"

    def gap(self, system: System, parameter: float) -> float:
        return system.volume() - parameter

    def row(self, system: System) -> np.ndarray:
        return -system.load_gradient()

    def satisfied(self, system: System, parameter: float) -> bool:
        return abs(self.gap(system, parameter)) <= self.relative_tolerance * abs(parameter)


class ArcLength(_Bordered):
    """The parameter is the distance walked along the secant of the last two accepted states (Riks 1979).

    Distance is the root mean square displacement of the nodes in mm: it also grows where load and volume turn
    back.
    """

    name = "arc length"

    def __init__(self, system: System):
        self._last, self._parameter = system.positions().copy(), 0.0
        self._direction = None

    def told(self, parameter: float) -> str:
        return f"{parameter:.4g} mm"

    def _secant(self, system):
        if self._direction is None:  # at the start, along the tangent
            along = system.positions_part(-system.solve(system.load_gradient()))
            self._direction = along / np.sqrt(system.mean_square(along, along))
        return self._direction

    def gap(self, system: System, parameter: float) -> float:
        moved = system.positions() - self._last
        return system.mean_square(self._secant(system), moved) - (parameter - self._parameter)

    def row(self, system: System) -> np.ndarray:
        return system.mean_square_row(self._secant(system))

    def satisfied(self, system: System, parameter: float) -> bool:
        return abs(self.gap(system, parameter)) <= 1e-8 * abs(parameter - self._parameter)

    def accepted(self, parameter: float, system: System) -> None:
        moved = system.positions() - self._last
        length = np.sqrt(system.mean_square(moved, moved))
        if length > 0:
            self._direction = moved / length
        self._last, self._parameter = system.positions().copy(), parameter
