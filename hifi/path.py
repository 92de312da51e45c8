"""The equilibrium path of a MixedProblem under a growing load: predictor, corrector, memory."""

import numpy as np

from hifi.solver import NotConverged, PredictorTooFar
from hifi.stepping import lagrange_coefficients


class LoadPath:
    """Predicts by quadratic extrapolation in rod coordinates, corrects by Newton.

    `pressure(load)` gives the cavity pressure in MPa (by default the load itself); supports follow the load too.
    """

    memory = 3

    def __init__(self, newton, pressure=lambda load: load):
        self.newton, self.problem, self.pressure = newton, newton.problem, pressure
        self.load = 0.0
        self.accepted = [(0.0, self.problem.array.copy())]
        self._slope = None
        #: predicted residuals (relative to the load) above this failed before; a residual is 10x cheaper than a failure
        self._trusted = np.inf

    def _predict(self, load):
        known = self.accepted[-self.memory :]
        newton, problem = self.newton, self.problem
        if len(known) == 1:
            # (u = 0, P > 0) has load stiffness without membrane stress: start with the tangent at P = 0
            if self._slope is None:
                newton.factorise(0.0)
                self._slope = newton.load_direction()
            return newton.move(known[0][1], self.pressure(load) * self._slope)
        weights = lagrange_coefficients([t for t, _ in known], load)
        predicted = sum(w * a for w, (_, a) in zip(weights, known))
        dofs, X = problem.displacement_dofs, newton.coordinates.nodes
        predicted[dofs] = newton.coordinates.extrapolate([X + a[dofs] for _, a in known], weights) - X
        return predicted

    def advance(self, load):
        """Solve at `load`; (iterations, factorisations, residual). NotConverged restores the accepted state."""
        before = self.newton.solver.factorisations
        pressure = self.pressure(load)
        self.problem.set_array(self.problem.supported(self._predict(load), load))
        _, norm, scale = self.newton.residual(pressure)
        try:
            if not np.isfinite(norm):
                raise PredictorTooFar("the predicted state is beyond what the material's law allows")
            if not norm <= self._trusted * scale:
                raise PredictorTooFar(f"the predicted state is off by {norm / scale:.1e} of the load")
            result = self.newton.solve(pressure)
        except NotConverged as error:
            if not isinstance(error, PredictorTooFar):
                self._trusted = 0.5 * norm / scale
                self.newton.factorised_at = None
            self.problem.set_array(self.accepted[-1][1])
            raise
        self._trusted *= 1.1  # so that one bad spot does not slow the rest
        self.load = load
        self.accepted = self.accepted[-self.memory + 1 :] + [(load, self.problem.array.copy())]
        return result.iterations, self.newton.solver.factorisations - before, result.residuals[-1]
