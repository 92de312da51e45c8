"""The equilibrium path of a MixedProblem under growing cavity pressure: predictor, corrector, memory."""

from hifi.solver import NotConverged
from hifi.stepping import lagrange_coefficients


class PressurePath:
    """Predicts by quadratic extrapolation in rod coordinates, corrects by Newton; the load is the pressure in MPa."""

    memory = 3

    def __init__(self, newton):
        self.newton, self.problem = newton, newton.problem
        self.load = 0.0
        self.accepted = [(0.0, self.problem.array.copy())]
        self._slope = None

    def _predict(self, load):
        known = self.accepted[-self.memory :]
        newton, problem = self.newton, self.problem
        if len(known) == 1:
            # (u = 0, P > 0) has load stiffness without membrane stress: start with the tangent at P = 0
            if self._slope is None:
                newton.factorise(0.0)
                self._slope = newton.load_direction()
            return newton.move(known[0][1], load * self._slope)
        weights = lagrange_coefficients([t for t, _ in known], load)
        predicted = sum(w * a for w, (_, a) in zip(weights, known))
        dofs, X = problem.displacement_dofs, newton.coordinates.nodes
        predicted[dofs] = newton.coordinates.extrapolate([X + a[dofs] for _, a in known], weights) - X
        return newton.keep_fixed(predicted)

    def advance(self, load):
        """Solve at `load`; (iterations, factorisations, residual). NotConverged restores the accepted state."""
        before = self.newton.solver.factorisations
        self.problem.set_array(self._predict(load))
        try:
            result = self.newton.solve(load)
        except NotConverged:
            self.problem.set_array(self.accepted[-1][1])
            self.newton.factorised_at = None
            raise
        self.load = load
        self.accepted = self.accepted[-self.memory + 1 :] + [(load, self.problem.array.copy())]
        return result.iterations, self.newton.solver.factorisations - before, result.residuals[-1]
