"""The equilibrium path of a system under a growing control parameter: predictor, corrector, memory."""

from dataclasses import dataclass

import numpy as np

from hifi.newton import Newton
from hifi.solver import NotConverged, PredictorTooFar
from hifi.stepping import lagrange_coefficients


@dataclass(frozen=True)
class PathState:
    """An accepted state: control parameter, load, and the system's state array."""

    parameter: float
    load: float
    state: np.ndarray


class EquilibriumPath:
    """Predicts by polynomial extrapolation in the control's parameter, corrects by Newton."""

    memory = 3

    def __init__(self, system, control, options=None, start=0.0):
        self.system, self.control = system, control
        self.newton = Newton(system, control, options)
        self.parameter = start
        self.accepted = [PathState(start, system.load, system.state.copy())]
        self._tangent = None
        #: predicted residuals (relative to the load) above this failed before; a residual is 10x cheaper than a failure
        self.trusted = np.inf

    def _predict(self, parameter):
        system, known = self.system, self.accepted[-self.memory :]
        if len(known) == 1:
            # (u = 0, P > 0) has load stiffness without membrane stress: start with the tangent at the start
            if self._tangent is None:
                self.newton.factorise()
                self._tangent = self.control.tangent(system)
            step = parameter - known[0].parameter
            system.load = known[0].load + step * self._tangent[1]
            return system.moved(known[0].state, step * self._tangent[0])
        weights = lagrange_coefficients([a.parameter for a in known], parameter)
        system.load = sum(w * a.load for w, a in zip(weights, known))
        return system.extrapolated([a.state for a in known], weights)

    def resume(self, accepted, trusted, factorised_at=None):
        """Go on from the `accepted` PathStates of another run, lagging the tangent at `factorised_at` (state, load) as it did."""
        self.accepted, self.trusted, self.parameter = list(accepted), trusted, accepted[-1].parameter
        if factorised_at is not None:
            self.system.state, self.system.load = factorised_at
            self.newton.factorise()
        self._back(accepted[-1])

    def _back(self, kept):
        self.system.state, self.system.load = kept.state, kept.load

    def advance(self, parameter):
        """Solve at `parameter`; (iterations, factorisations, residual). NotConverged restores the accepted state."""
        system, newton, before = self.system, self.newton, self.system.factorisations
        state = self._predict(parameter)
        if self.control.name == "load":
            system.load = parameter
        system.state = system.at_supports(state)
        _, norm, scale = newton.residual()
        try:
            if not np.isfinite(norm):
                raise PredictorTooFar("the predicted state is beyond what the material's law allows")
            if not norm <= self.trusted * scale:
                raise PredictorTooFar(f"the predicted state is off by {norm / scale:.1e} of the load")
            result = newton.solve(parameter)
        except NotConverged as error:
            if not isinstance(error, PredictorTooFar):
                self.trusted = 0.5 * norm / scale
                newton.current = False
            self._back(self.accepted[-1])
            raise
        self.trusted *= 1.1  # so that one bad spot does not slow the rest
        self.parameter = parameter
        self.control.accepted(parameter, system)
        self.accepted = self.accepted[-self.memory + 1 :] + [PathState(parameter, system.load, system.state.copy())]
        return result.iterations, system.factorisations - before, result.residuals[-1]
