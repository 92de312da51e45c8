"""Loads: each is an object with its residual; what a path sets are its `value`."""

from abc import ABC, abstractmethod

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from pneunet.hifi.fem.materials import Materials, groups
from pneunet.hifi.fem.mixed_field import MixedField
from pneunet.hifi.fem.surface import FaceQuadrature


class AppliedLoad(ABC):
    """`value` times what the load is.

    has_tangent: whether its residual's derivative belongs to the tangent; closed: whether that is symmetric.
    """

    has_tangent = False
    closed = True

    def on(self, field: MixedField) -> list[ufl.Form]:
        """Residual (N, tested with field.test), in parts; called once by the problem on which it acts."""
        self.value = fem.Constant(field.mesh, PETSc.ScalarType(0.0))
        v, _ = ufl.split(field.test)
        return [self.value * part for part in self.parts(field, v)]

    @abstractmethod
    def parts(self, field: MixedField, v: ufl.core.expr.Expr) -> list[ufl.Form]:
        """Residual at value = 1, tested with the displacement v."""

    def update(self, field: MixedField) -> None:  # noqa: B027, most have nothing to do
        """Told before the residual is assembled."""


class Pressure(AppliedLoad):
    """Follower pressure `value` (MPa) on tagged facets: -P V, so P inner(J inv(F).T N, v) in the residual.

    closed: the facets close a cavity, so that the load's tangent is symmetric; an open loaded patch has
    closed = False. share: of the body's pressure, which several cavities divide.
    """

    has_tangent = True

    def __init__(self, tags: tuple[int, ...], closed: bool = True, share: float = 1.0):
        self.tags, self.closed, self.share = tuple(tags), closed, share

    def parts(self, field: MixedField, v: ufl.core.expr.Expr) -> list[ufl.Form]:
        ds, F = field.facets(*self.tags), ufl.Identity(3) + ufl.grad(field.u)
        area = ufl.det(F) * ufl.inv(F).T * ufl.FacetNormal(field.mesh)
        self.volume_form = -ufl.inner(ufl.SpatialCoordinate(field.mesh) + field.u, area) / 3 * ds
        return [ufl.inner(area, v) * ds]


class Gravity(AppliedLoad):
    """Weight: `value` times the acceleration (3,) in mm/s^2 on materials {cell tag: law with a density, or
    one law}."""

    def __init__(self, materials: Materials, acceleration: tuple[float, float, float]):
        self.materials, self.acceleration = materials, np.asarray(acceleration, float)

    def parts(self, field: MixedField, v: ufl.core.expr.Expr) -> list[ufl.Form]:
        parts = []
        for density, tags in groups(self.materials, lambda material: material.density).items():
            weight = fem.Constant(field.mesh, PETSc.ScalarType(-density * self.acceleration))
            parts.append(ufl.inner(weight, v) * field.cells(*tags, degree=2))
        return parts


class EndLoad(AppliedLoad):
    """Dead force (3,) in N and moment (3,) in N mm, fixed in space, on a tagged face, times `value`.

    The traction force/A + w x (x - c), c the face's centre and w such that it has exactly this moment about
    c, is even over the reference area. A moment fixed in space is not conservative: its (skew) tangent is
    left out, Newton finds the equilibrium all the same.
    """

    def __init__(
        self,
        tag: int,
        force: tuple[float, float, float] = (0.0, 0.0, 0.0),
        moment: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ):
        self.tag, self.force, self.moment = tag, np.asarray(force, float), np.asarray(moment, float)

    def parts(self, field: MixedField, v: ufl.core.expr.Expr) -> list[ufl.Form]:
        self._face = FaceQuadrature(field, self.tag)
        self._even, self._spin, self._centre = (
            fem.Constant(field.mesh, PETSc.ScalarType(np.zeros(3))) for _ in range(3)
        )
        x = ufl.SpatialCoordinate(field.mesh) + field.u
        traction = self._even + ufl.cross(self._spin, x - self._centre)
        return [-ufl.inner(traction, v) * field.facets(self.tag)]

    def update(self, field: MixedField) -> None:
        """Refer the traction to the face's present centre and second moments."""
        traction = self._face.traction(field.nodes + field.displacement(), self.force, self.moment)
        self._even.value[:], self._spin.value[:], self._centre.value[:] = traction
