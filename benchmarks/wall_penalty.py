"""Contact of a cell's walls by a penalty at the Gauss points of one wall against the surface of the other: the check on
hifi.contact. No medium, no bias; it starts from a state close to equilibrium and does not follow a load by itself.

Energy: eps/2 g^2 per undeformed area of the first wall, g < 0 the signed distance of its point from the second's tessellated
surface. Gradient exact at fixed projections; the tangent leaves out the curvature of g (Gauss-Newton).
"""

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from base import se3
from hifi import surface
from hifi.cell import CellProblem
from hifi.cell_system import RELATIVE_TOLERANCE, CellSystem
from hifi.control import LoadControl
from hifi.newton import Newton, NewtonOptions
from hifi.walls import closest_point

_DIVISIONS = 4
_NEIGHBOURS = 12


class PenaltyCell(CellProblem):
    """The cell of `segment` meshed at `path` with its gaps void and a penalty of eps (MPa/mm) between its walls."""

    def __init__(self, segment, path, walls, eps=1.0):
        super().__init__(segment, path)
        self.walls, self.eps = walls(self), eps
        self._shape = surface.subdivision(_DIVISIONS)
        self._gauss = surface.p2_shape(surface._BARYCENTRIC)

    def _pose(self, strains, s):
        return se3.exp_pose(np.concatenate([strains[3:], strains[:3]]) * s[..., None])

    def contacts(self):
        """Rows of the gaps' gradients: (g (m,), weights (m,), G (m, unknowns), H (m, 6), force (gaps, 3))."""
        u, q = self.displacement(), np.array(self.strains.value)
        gs, ws, cols, vals, hs, forces = [], [], [], [], [], []
        for (fa, sa), (fb, sb) in self.walls.gaps:
            state = []
            for f, shift in ((fa, sa), (fb, sb)):
                s = self.nodes[f][..., 0] + shift[:, None]
                local = self.nodes[f] * [0, 1, 1] + u[f]
                pose = self._pose(q, s)
                x = np.einsum("...ij,...j->...i", pose[..., :3, :3], local) + pose[..., :3, 3]
                dx = []
                for i in range(6):
                    h = 1e-6 * np.eye(6)[i]
                    ends = [self._pose(q + t * h, s) for t in (1, -1)]
                    ends = [np.einsum("...ij,...j->...i", p[..., :3, :3], local) + p[..., :3, 3] for p in ends]
                    dx.append((ends[0] - ends[1]) / 2e-6)
                state.append((x, pose[..., :3, :3], np.stack(dx, axis=-1)))
            (xa, Ra, da), (xb, Rb, db) = state
            points = np.einsum("qn,fni->fqi", self._gauss, xa).reshape(-1, 3)
            weights = np.outer(surface.reference_areas(self, fa), surface._WEIGHTS).ravel()
            triangles = np.einsum("tcn,fni->ftci", self._shape, xb).reshape(-1, 3, 3)
            near = cKDTree(triangles.mean(axis=1)).query(points, k=_NEIGHBOURS)[1]
            close = closest_point(points[:, None], triangles[near])
            best = np.linalg.norm(points[:, None] - close, axis=-1).argmin(axis=1)
            r = np.arange(len(points))
            t, c = near[r, best], close[r, best]
            T = triangles[t]
            normal = np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            offset = points - c
            g = np.einsum("ni,ni->n", offset, normal)
            on = np.flatnonzero((g < 0) & (np.abs(g) > 0.9 * np.linalg.norm(offset, axis=1)) & (g > -0.5))
            # barycentrics of the closest point, by areas
            a, b, cc = T[on, 0], T[on, 1], T[on, 2]
            n2 = np.cross(b - a, cc - a)
            d = np.einsum("ni,ni->n", n2, n2)
            l1 = np.einsum("ni,ni->n", np.cross(c[on] - a, cc - a), n2) / d
            l2 = np.einsum("ni,ni->n", np.cross(b - a, c[on] - a), n2) / d
            lam = np.stack([1 - l1 - l2, l1, l2], axis=-1)
            per = len(self._shape)
            facet_b, facet_a, gauss = t[on] // per, on // len(self._gauss), on % len(self._gauss)
            Nb = np.einsum("mc,mcn->mn", lam, self._shape[t[on] % per])
            Na = self._gauss[gauss]
            m = normal[on]
            # d g / d y: the section's rotation turns the normal back
            ga = Na[..., None] * np.einsum("mnji,mj->mni", Ra[facet_a], m)
            gb = -Nb[..., None] * np.einsum("mnji,mj->mni", Rb[facet_b], m)
            hs.append(np.einsum("mn,mnik,mi->mk", Na, da[facet_a], m) - np.einsum("mn,mnik,mi->mk", Nb, db[facet_b], m))
            dofs = np.concatenate([self.displacement_dofs[fa[facet_a]], self.displacement_dofs[fb[facet_b]]], axis=1)
            cols.append(self.reduced[dofs].reshape(len(on), 36))
            vals.append(np.concatenate([ga, gb], axis=1).reshape(len(on), 36))
            gs.append(g[on])
            ws.append(weights[on])
            forces.append((-self.eps * weights[on] * g[on]) @ m)
        g, w, cols, vals = (np.concatenate(p) for p in (gs, ws, cols, vals))
        rows = np.repeat(np.arange(len(g)), 36)
        G = sp.coo_matrix((vals.ravel(), (rows, cols.ravel())), shape=(len(g), self.unknowns)).tocsr()
        return g, w, G, np.concatenate(hs), np.array(forces)

    def residual(self):
        r, slope = super().residual()
        g, w, G, H, _ = self.contacts()
        f = self.eps * w * g
        return r + G.T @ f, slope + H.T @ f

    def tangent(self):
        matrix, mixed, curvature = super().tangent()
        g, w, G, H, _ = self.contacts()
        W = sp.diags(self.eps * w)
        extra = sp.bmat([[G.T @ W @ G, None], [None, sp.csr_matrix((6, 6))]], format="csr")
        return (matrix + extra).tocsr(), mixed + G.T @ (W @ H), curvature + H.T @ (W @ H)


class PenaltySystem(CellSystem):
    """Its matrix changes pattern as walls touch."""

    def factorise(self):
        if self._solver is not None:
            self._solver.destroy()
            self._matrix.destroy()
        self._matrix = None
        super().factorise()


def solve(problem, pressure, state, strains, stiffnesses=(1.0, 4.0, 16.0), say=lambda text: None):
    """[(forces (gaps, 3) in N, strains (6,), deepest penetration in mm)] at `pressure` (MPa) for each of growing
    `stiffnesses` (MPa/mm), from a mixed `state` array and strains close by."""
    system = PenaltySystem(problem)
    system.load = pressure
    x = np.zeros(problem.unknowns + 12)
    kept = problem.reduced >= 0
    x[problem.reduced[kept]] = state[kept]
    x[-6:] = strains
    system.state = x
    newton = Newton(system, LoadControl(), NewtonOptions(relative_tolerance=1e-2 * RELATIVE_TOLERANCE**0.5, patience=6.0, secants=4))
    out = []
    for eps in stiffnesses:
        problem.eps = eps
        newton.current = False
        result = newton.solve(pressure)
        g, _, _, _, forces = problem.contacts()
        out.append((forces, system.state[-6:].copy(), float(g.min(initial=0.0))))
        say(f"{eps} MPa/mm: {result.iterations} iterations, {np.linalg.norm(forces, axis=1)} N, {out[-1][2]:.4f} mm, {out[-1][1]}")
    system.destroy()
    return out
