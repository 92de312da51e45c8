"""The ramp's body in NGSolve: an energy, compiled to C++, whose derivatives NGSolve takes itself; MKL
PARDISO.

The follower pressure is the energy -P V with V = -1/3 int x . cof(F) N over the cavity's wall (N out of the
body), whose second variation is symmetric since the cavity is closed. NGSolve integrates with its own rules
of order 5: the same Gauss points.
"""

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np
from ramp import MU, Body

#: METIS, no iterative refinement, two-level factorisation: faster than NGSolve's own choice and its
#: sparsecholesky
PARDISO = {"ordering": "metis", "refinement": 0, "iparm23": 1}
ORDER = 5


def make_mesh(mesh):
    """NGSolve's mesh of the same points and hexahedra, with the boundary regions base and cavity."""
    made = netgen.Mesh(3)
    made.AddPoints(mesh["points"])
    surfaces = {"base": mesh["base"], "cavity": np.vstack([mesh["cavity"], mesh["channel"]])}
    for i, (name, cells) in enumerate(surfaces.items()):
        face = made.Add(netgen.FaceDescriptor(surfnr=i + 1, bc=i + 1, domin=1))
        made.SetBCName(i, name)
        outwards = np.ascontiguousarray(cells[:, [0, 3, 2, 1]], dtype=np.int32)
        made.AddElements(dim=2, index=face, data=outwards, base=0)
    made.SetMaterial(1, "body")
    made.AddElements(dim=3, index=1, data=np.ascontiguousarray(mesh["cells"], dtype=np.int32), base=0)
    return ng.Mesh(made)


class NGSolveBody(Body):
    name = "ngsolve"

    def __init__(self, mesh):
        super().__init__()
        ng.SetNumThreads(1)
        self.mesh = make_mesh(mesh)
        self.points = mesh["points"]
        self.space = ng.VectorH1(self.mesh, order=2, dirichlet="base") * ng.H1(self.mesh, order=1)
        self.free = self.space.FreeDofs()
        self.fixed = np.flatnonzero(~np.array(self.free))
        self.dofs = self.space.ndof
        self.unknown = ng.GridFunction(self.space)
        self.pressure = ng.Parameter(0.0)
        stored, dx, less_volume, ds = self._energies()
        self.internal = self._form(stored * dx)
        self.load = self._form(less_volume * ds)
        self.total = self._form(stored * dx, self.pressure * less_volume * ds)
        self._vectors = [self.unknown.vec.CreateVector() for _ in range(2)]
        self.inverse = None
        self.forces()  # everything is made and compiled before anything is timed
        self.total.AssembleLinearization(self.unknown.vec)

    def _energies(self):
        u, p = self.space.TrialFunction()
        compiled = {"realcompile": True, "wait": True, "maxderiv": 2}
        F = ng.Id(3) + ng.Grad(u)
        J = ng.Det(F)
        stored = MU / 2 * (J ** (-2 / 3) * ng.InnerProduct(F, F) - 3) + p * (J - 1)
        on_wall = ng.Id(3) + ng.Grad(u).Trace()  # tangential derivatives are all that cof(F) N needs
        deformed = ng.CF((ng.x, ng.y, ng.z)) + u
        less_volume = 1 / 3 * ng.InnerProduct(deformed, ng.Cof(on_wall) * ng.specialcf.normal(3))
        dx = ng.dx(intrules={ng.HEX: ng.IntegrationRule(ng.HEX, ORDER)})
        ds = ng.ds("cavity", intrules={ng.QUAD: ng.IntegrationRule(ng.QUAD, ORDER)})
        return stored.Compile(**compiled), dx, less_volume.Compile(**compiled), ds

    def _form(self, *energies):
        form = ng.BilinearForm(self.space, symmetric=True, symmetric_storage=True)
        for energy in energies:
            form += ng.Variation(energy)
        return form

    @property
    def state(self):
        return self.unknown.vec.FV().NumPy().copy()

    @state.setter
    def state(self, values):
        self.unknown.vec.FV().NumPy()[:] = values

    def forces(self):
        for form, vector in zip((self.internal, self.load), self._vectors):
            form.Apply(self.unknown.vec, vector)
        return [vector.FV().NumPy().copy() for vector in self._vectors]

    def factorise(self, pressure):
        with self.timed("tangent"):
            self.pressure.Set(pressure)
            self.total.AssembleLinearization(self.unknown.vec)
        with self.timed("factorise"):
            if self.inverse is None:
                self.inverse = self.total.mat.Inverse(self.free, inverse="pardiso", flags=PARDISO)
            else:
                self.inverse.Update()

    def solve(self, right):
        with self.timed("solve"):
            b, x = self._vectors
            b.FV().NumPy()[:] = right
            x.data = self.inverse * b
            return x.FV().NumPy().copy()

    def displacements(self):
        """(points (n, 3), displacements (n, 3)) at vertices, in mm (the basis is hierarchical: others are no
        nodes)."""
        u = self.unknown.components[0]
        return self.points, np.column_stack(
            [u.components[i].vec.FV().NumPy()[: len(self.points)] for i in range(3)]
        )
