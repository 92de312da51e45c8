"""Loads: each is an object with its residual term; what a path sets is their `value`."""

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

PRESSURE_DEGREE = 4


class Pressure:
    """Follower pressure `value` (MPa) on tagged facets: -P V, so P inner(J inv(F).T N, v) in the residual.

    closed: the facets close a cavity, so that the load's tangent is symmetric; an open loaded patch has
    closed = False.
    """

    has_tangent = True

    def __init__(self, tags, closed=True):
        self.tags, self.closed = tuple(tags), closed

    def term(self, problem, u, v):
        """Residual form (N, tested with v); called once by the problem this load acts on."""
        mesh = problem.mesh
        self.value = fem.Constant(mesh, PETSc.ScalarType(0.0))
        ds = ufl.Measure(
            "ds",
            domain=mesh,
            subdomain_data=problem.facet_tags,
            metadata={"quadrature_degree": PRESSURE_DEGREE},
        )
        F = ufl.Identity(3) + ufl.grad(u)
        area = ufl.det(F) * ufl.inv(F).T * ufl.FacetNormal(mesh)
        self.volume_form = -ufl.inner(ufl.SpatialCoordinate(mesh) + u, area) / 3 * ds(self.tags)
        return self.value * ufl.inner(area, v) * ds(self.tags)

    def update(self, problem):
        pass


class Gravity:
    """Weight: `value` times the acceleration (3,) in mm/s^2 on materials {cell tag: law with a density, or
    one law}."""

    has_tangent = False
    closed = True

    def __init__(self, materials, acceleration):
        self.materials, self.acceleration = materials, np.asarray(acceleration, float)

    def term(self, problem, u, v):
        mesh = problem.mesh
        self.value = fem.Constant(mesh, PETSc.ScalarType(0.0))
        dx = ufl.Measure(
            "dx", domain=mesh, subdomain_data=problem.cell_tags, metadata={"quadrature_degree": 2}
        )
        groups = {}
        if isinstance(self.materials, dict):
            for tag, material in self.materials.items():
                groups.setdefault(material.density, []).append(tag)
            parts = [(density, dx(tuple(tags))) for density, tags in groups.items()]
        else:
            parts = [(self.materials.density, dx)]
        g = ufl.as_vector([fem.Constant(mesh, PETSc.ScalarType(a)) for a in self.acceleration])
        return sum(
            -self.value * fem.Constant(mesh, PETSc.ScalarType(density)) * ufl.inner(g, v) * d
            for density, d in parts
        )

    def update(self, problem):
        pass


class EndLoad:
    """Dead force (3,) in N and moment (3,) in N mm, fixed in space, on a tagged face, times `value`.

    The traction force/A + w x (x - c), c the face's centre and w such that it has exactly this moment about
    c, is even over the reference area. A moment fixed in space is not conservative: its (skew) tangent is
    left out, Newton finds the equilibrium all the same.
    """

    has_tangent = False
    closed = True

    def __init__(self, tag, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0)):
        self.tag, self.force, self.moment = tag, np.asarray(force, float), np.asarray(moment, float)

    def term(self, problem, u, v):
        from pneunet.hifi.fem.surface import FaceQuadrature

        mesh = problem.mesh
        self.value = fem.Constant(mesh, PETSc.ScalarType(0.0))
        self._face = FaceQuadrature(problem, self.tag)
        self._even, self._spin, self._centre = (
            fem.Constant(mesh, PETSc.ScalarType(np.zeros(3))) for _ in range(3)
        )
        ds = ufl.Measure(
            "ds",
            domain=mesh,
            subdomain_data=problem.facet_tags,
            metadata={"quadrature_degree": PRESSURE_DEGREE},
        )
        x = ufl.SpatialCoordinate(mesh) + u
        traction = self._even + ufl.cross(self._spin, x - self._centre)
        return -self.value * ufl.inner(traction, v) * ds(self.tag)

    def update(self, problem):
        """Refer the traction to the face's present centre and second moments."""
        traction = self._face.traction(problem.nodes + problem.displacement(), self.force, self.moment)
        self._even.value[:], self._spin.value[:], self._centre.value[:] = traction
