"""The potential of a problem: a list of energy densities on parts of a mesh, from which all else derives."""

from dataclasses import dataclass
from functools import cached_property

import ufl
from ufl.core.expr import Expr

from pneunet.hifi.fem.compat import compile_form
from pneunet.hifi.fem.mixed_field import MixedField


@dataclass(frozen=True)
class Term:
    """stored: energy density on the part `measure` of the mesh; work: density of the work that a load does
    there. MPa."""

    stored: Expr
    measure: ufl.Measure
    work: Expr | float = 0.0

    @property
    def density(self) -> Expr:
        """What the term adds to the potential."""
        return self.stored - self.work if self.work else self.stored


class PotentialEnergy:
    """Stored energy less the loads' work: the sum of `terms` in the state of a field.

    residuals, tangents: compiled forms of its first and second derivatives by the state. Each term is
    compiled by itself, so that problems with a term in common share the form.
    """

    def __init__(self, field: MixedField, terms: list[Term]):
        self.field, self.terms = field, terms
        residuals = [ufl.derivative(t.density * t.measure, field.state, field.test) for t in terms]
        self.residuals = [compile_form(form) for form in residuals]
        self.tangents = [compile_form(ufl.derivative(form, field.state)) for form in residuals]

    @cached_property
    def _stored(self):
        return [compile_form(term.stored * term.measure) for term in self.terms]

    def stored_energy(self) -> float:
        """N mm."""
        return self.field.integral(self._stored)
