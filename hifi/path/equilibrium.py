"""The equilibrium path of a system under a growing control parameter: predictor, corrector, memory, limit
points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneunet.base.units import KPA_PER_MPA
from pneunet.hifi.fem.solver import NotConverged, PredictorTooFar
from pneunet.hifi.path.newton import Newton, NewtonOptions
from pneunet.hifi.path.stepping import lagrange_coefficients
from pneunet.hifi.path.system import PathControl, System

#: a compliance that has grown this often since the start announces a limit point of the load
SOFTENED = 4.0


@dataclass(frozen=True)
class PathState:
    """An accepted state: control parameter, load, the system's state array, and its cavity volume in mm3."""

    parameter: float
    load: float
    state: np.ndarray
    volume: float


@dataclass(frozen=True)
class LimitPoint:
    """Where the load stops growing ('maximum') or falling ('minimum') along the path; volume of the cavity in
    mm3."""

    load: float
    volume: float
    kind: str

    @property
    def text(self) -> str:
        """In words, of a path whose load is a pressure."""
        pressure = f"{self.load * KPA_PER_MPA:.4g} kPa ({self.kind})"
        return f"limit point: pressure {pressure} at volume {self.volume:.4g} mm3"

    def table(self) -> dict[str, float | str]:
        """The same for run.json."""
        return {"pressure_kPa": self.load * KPA_PER_MPA, "volume_mm3": self.volume, "kind": self.kind}


def limit_point(three: Sequence[PathState]) -> LimitPoint | None:
    """The LimitPoint between three consecutive PathStates, by the parabola through them; None when the load
    goes on."""
    p, loads, volumes = (
        np.array([getattr(a, name) for a in three]) for name in ("parameter", "load", "volume")
    )
    slopes = np.diff(loads) / np.diff(p)
    if not slopes[0] * slopes[1] < 0:
        return None
    middles = (p[1:] + p[:-1]) / 2
    top = middles[0] - slopes[0] * (middles[1] - middles[0]) / (slopes[1] - slopes[0])
    weights = np.array(lagrange_coefficients(p, top))
    return LimitPoint(
        float(weights @ loads), float(weights @ volumes), "maximum" if slopes[0] > 0 else "minimum"
    )


class EquilibriumPath:
    """Predicts by polynomial extrapolation in the control's parameter, corrects by Newton."""

    memory = 3

    def __init__(
        self, system: System, control: PathControl, options: NewtonOptions | None = None, start: float = 0.0
    ):
        self.system, self.control = system, control
        self.newton = Newton(system, control, options)
        self.parameter = start
        self.accepted = [self._present()]
        self._tangent, self._touching = None, system.overreach > 0
        #: predicted residuals (relative to the load) above this failed before; a residual is 10x cheaper than
        #: a failure
        self.trusted = np.inf
        #: LimitPoints of the load passed so far; the load cannot pass one while it is the parameter itself
        self.limit_points = []
        #: displacement per load, in the load's own measure (dV/dP for a pressure), at the start of the path
        self.first_compliance = np.nan

    def _present(self):
        system = self.system
        return PathState(self.parameter, system.load, system.state.copy(), system.volume())

    def _predict(self, parameter):
        system, known = self.system, self.accepted[-self.memory :]
        if len(known) == 1:
            # (u = 0, P > 0) has load stiffness without membrane stress: start with the tangent at the start
            if self._tangent is None:
                if not self.newton.current:
                    self.newton.factorise()
                self._tangent = self.control.tangent(system)
                self.first_compliance = self._compliance()
            step = parameter - known[0].parameter
            system.load = known[0].load + step * self._tangent[1]
            return system.moved(known[0].state, step * self._tangent[0])
        if self._touching:
            # extrapolated walls part or overlap; a tangent at rest keeps together what touches
            known = known[-1:]
        weights = lagrange_coefficients([a.parameter for a in known], parameter)
        system.load = sum(w * a.load for w, a in zip(weights, known))
        return system.extrapolated([a.state for a in known], weights)

    def _compliance(self):
        gradient = self.system.load_gradient()
        return self.system.dot(gradient, self.system.solve(gradient))

    def resume(
        self,
        accepted: Sequence[PathState],
        trusted: float,
        factorised_at: tuple[np.ndarray, float] | None = None,
    ) -> None:
        """Go on from the `accepted` PathStates of another run, lagging the tangent at `factorised_at` (state,
        load) as it did."""
        self.accepted, self.trusted, self.parameter = list(accepted), trusted, accepted[-1].parameter
        if factorised_at is not None:
            self.system.state, self.system.load = factorised_at
            self.newton.factorise()
        for known in accepted:
            self._back(known)
            self.control.accepted(known.parameter, self.system)
        self.newton.residual()
        self._touching = self.system.overreach > 0

    def _back(self, kept):
        self.system.state, self.system.load = kept.state, kept.load

    def advance(self, parameter: float) -> tuple[int, int, float]:
        """Solve at `parameter`; (iterations, factorisations, residual). NotConverged restores the accepted
        state."""
        system, newton, before = self.system, self.newton, self.system.factorisations
        state = self._predict(parameter)
        if self.control.name == "load":
            system.load = parameter
        system.state = system.at_supports(state)
        _, norm, scale = newton.residual()
        try:
            if not np.isfinite(norm):
                raise PredictorTooFar("the predicted state is beyond what the material's law allows")
            if system.overreach > 1.0 and not self._touching:
                raise PredictorTooFar("the predicted walls overlap")
            if not norm <= self.trusted * scale and not self._touching:
                raise PredictorTooFar(f"the predicted state is off by {norm / scale:.1e} of the load")
            result = newton.solve(parameter)
        except NotConverged as error:
            if not isinstance(error, PredictorTooFar):
                self.trusted = 0.5 * norm / scale
                newton.current = False
            self._back(self.accepted[-1])
            raise
        self._touching = system.overreach > 0
        self.trusted *= 1.1  # so that one bad spot does not slow the rest
        self.parameter = parameter
        self.control.accepted(parameter, system)
        self.accepted = self.accepted[-self.memory + 1 :] + [self._present()]
        if self.control.name != "load" and len(self.accepted) == 3:
            found = limit_point(self.accepted)
            self.limit_points += [found] if found else []
        return result.iterations, system.factorisations - before, result.residuals[-1]

    def told(self, parameter: float) -> str:
        """A parameter in words, with its unit."""
        return self.control.told(parameter)

    def diagnosis(self) -> str:
        """What the tangent of the last accepted state says when no further step converges; '' when it has
        nothing to say.

        Towards a limit point of the load the compliance grows without bound; beyond it, and beyond a
        bifurcation, a direction is unstable. Costs a factorisation.
        """
        if self.control.name != "load":
            return ""
        try:
            self.newton.factorise()
        except NotConverged:
            return "a limit point of the load is likely (its tangent is singular)"
        signs, compliance = [], self._compliance()
        if self.system.unstable:
            signs.append(
                f"the state is unstable in {self.system.unstable} direction{'s' * (self.system.unstable > 1)}"
            )
        if compliance > SOFTENED * self.first_compliance:
            signs.append(
                f"the body has become {compliance / self.first_compliance:.0f} times as compliant as at the"
                " start"
            )
        if compliance < 0:
            signs.append("the load would have to fall from here on")
        return f"a limit point of the load is likely ({', '.join(signs)})" if signs else ""
