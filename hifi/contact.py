"""Third-medium contact."""

import ufl
from dolfinx import fem
from petsc4py import PETSc


class ThirdMedium:
    def __init__(self, kind="log", gamma=5e-4, kr=10.0, alpha=5.0, J0=0.01, eps=0.01, **k):
        self.kind, self.gamma0, self.kr0, self.alpha, self.J0, self.eps, self.k = kind, gamma, kr, alpha, J0, eps, k

    def energy(self, mesh, F, second, mu):
        C = lambda v: fem.Constant(mesh, PETSc.ScalarType(v))
        self.gamma, self.kr, self.ks = C(self.gamma0), C(self.kr0), C(self.k.get("ks", 0.0))
        J = ufl.det(F)
        J0, alpha, eps = C(self.J0), C(self.alpha), C(self.eps)
        soft = (J + ufl.sqrt(J * J + eps**2)) / 2
        reg = self.kr * mu / 2 * ufl.inner(second, second) * ufl.exp(-alpha * soft)
        I1 = ufl.inner(F, F)
        if self.kind == "log":
            x = (J - J0) / J0
            L = ufl.conditional(ufl.gt(J, J0), ufl.ln(ufl.max_value(J, J0)), ufl.ln(J0) + x - x * x / 2)
            w = self.gamma * mu * (5 / 6 * L * L + (I1 - 3 - 2 * L) / 2)
        elif self.kind == "pen":  # p = mu kappa ((Jc - J)+ / Jc)^n
            Jc, n = C(self.k["Jc"]), self.k.get("n", 2)
            z = ufl.max_value(Jc - J, 0.0) / Jc
            w = self.gamma * mu * Jc * z ** (n + 1) / (n + 1) + self.ks * mu / 2 * (I1 - 2 * J)
        elif self.kind == "pow":  # energy gamma mu J^-n, continued quadratically below J0
            n = self.k.get("n", 2)
            Jm = ufl.max_value(J, J0)
            x = ufl.min_value(J - J0, 0.0)
            w = self.gamma * mu * (Jm ** (-n) - n * J0 ** (-n - 1) * x + n * (n + 1) * J0 ** (-n - 2) * x * x / 2) + self.ks * mu / 2 * (I1 - 2 * J)
        return w + reg
