"""Contact of a unit cell's walls: hifi.wall_contact between the pieces that the cell's cuts leave, moved by the strains (e, k).

Each gap is seen from the section frame in its middle, in which a wall's node of local position y at the distance s along the axis
lies at exp(s (k, e)) y: linear in y, and its derivatives by the strains are exact too (base.left_jacobian).
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from base.left_jacobian import LeftJacobian
from hifi import surface
from hifi.wall_contact import DEEPEST, mean_normal, touching
from hifi.walls import IN_CONTACT, WallContact, distances_from

#: strains (e, k) from twists (k, e)
_ORDER = [3, 4, 5, 0, 1, 2]


class CellContact:
    """Contact in the gaps of `walls` (hifi.walls.CellWalls) under a hifi.wall_contact.WallPenalty."""

    def __init__(self, problem, walls, penalty):
        self.problem, segment = problem, problem.segment
        self.law = penalty.on(segment.material.mu, segment.gap)
        self._sides, self._then, self._now = [], [], []
        #: deepest overlap at the last residual, over DEEPEST of the gap; 0 where nothing comes closer than the penalty's onset
        self.overreach = 0.0
        for gap in walls.gaps:
            rest = [problem.nodes[f] + np.multiply.outer(s, [[1, 0, 0]]) for f, s in gap]
            middle = np.mean([r[..., 0].mean() for r in rest])
            normal = mean_normal(rest[0]) - mean_normal(rest[1])
            sheets = [
                _Sheet(f, problem.nodes[f][..., 0] + s[:, None] - middle, surface.reference_areas(problem, f)) for f, s in gap
            ]
            normal /= np.linalg.norm(normal)
            self._sides += [(sheets, normal), (sheets[::-1], -normal)]

    def _touching(self):
        """[_Side] of all sides in touch."""
        problem, found = self.problem, []
        y = problem.nodes * [0, 1, 1] + problem.displacement()
        e, k = np.split(problem.strains.value, 2)
        for number, (sheets, direction) in enumerate(self._sides):
            places = [sheet.positions(y, np.concatenate([k, e])) for sheet in sheets]
            t = touching(places[0], sheets[0].areas, places[1], direction, self.law)
            if t is not None:
                found.append(_Side(problem, number, t, sheets, places))
        return found

    def energy(self):
        """N mm stored in the walls' overlaps."""
        return float(sum((t.touching.area * t.touching.energy).sum() for t in self._touching()))

    def residual(self):
        """(unknowns,) and (6,): how the energy changes with the problem's unknowns and strains (e, k)."""
        forces, slope = np.zeros(self.problem.unknowns), np.zeros(6)
        self._now, deepest = self._touching(), 0.0
        for side in self._now:
            deepest = max(deepest, side.touching.overlap.max() + self.law.onset)
            local, wrench = side.first_derivatives()
            np.add.at(forces, side.columns[side.kept], local[side.kept])
            slope += wrench
        self.overreach = deepest / (DEEPEST * self.problem.segment.gap)
        return forces, slope

    def tangent(self):
        """((rows, columns, values) in the unknowns, (unknowns, 6), (6, 6)): second derivatives of the energy."""
        n = self.problem.unknowns
        total, mixed, curvature = sp.csr_matrix((n, n)), np.zeros((n, 6)), np.zeros((6, 6))
        self._then = self._touching()
        for side in self._then:
            bend, coupling, own = side.second_derivatives()
            gradient, by_strains = side.gap_gradients
            stiff = sp.diags(side.touching.area * side.touching.slope)
            total = total + bend + gradient.T @ stiff @ gradient
            mixed += coupling + gradient.T @ (stiff @ by_strains)
            curvature += own + by_strains.T @ (stiff @ by_strains)
        total = total.tocoo()
        return (total.row, total.col, total.data), mixed, curvature

    def stiffnesses(self, factorised=False):
        """{point: N/mm} at the last residual, or the last tangent."""
        sides = self._then if factorised else self._now
        return {point: value for side in sides for point, value in side.touching.stiffnesses(side.number).items()}

    def gradients(self, points):
        """(m, unknowns + 6): how the gaps of points that push, or did so at the last tangent, change with unknowns and strains."""
        out = np.zeros((len(points), self.problem.unknowns + 6))
        places = {p: i for i, p in enumerate(points)}
        for side in [*self._now, *self._then]:  # what is taken away was put in as it was then
            rows = [(places[p], row) for row, p in enumerate(side.touching.stiffnesses(side.number)) if p in places]
            if rows:
                to, of = np.array(rows).T
                gradient, by_strains = side.gap_gradients
                out[to] = np.hstack([gradient[of].toarray(), by_strains[of]])
        return out

    def measure(self, pressure):
        """WallContact of the gap with the largest force, `pressure` (MPa) being that of the air."""
        gaps = [WallContact() for _ in range(len(self._sides) // 2)]
        totals = np.zeros((len(gaps), 3))
        for side in self._touching():
            t, gap = side.touching, side.number // 2
            totals[gap] += (-1) ** side.number * (t.area * t.pressure) @ t.normal
            pushing = t.pressure > IN_CONTACT * pressure
            if pushing.any():
                d = distances_from(side.places[1], t.position[pushing])
                c = gaps[gap]
                gaps[gap] = WallContact(0.0, c.area + t.area[pushing].sum(), np.fmin(c.nearest, d.min()), np.fmax(c.farthest, d.max()))
        forces = np.linalg.norm(totals, axis=1)
        return replace(gaps[forces.argmax()], force=float(forces.max()))


class _Sheet:
    """facets (n, 6) of nodes, s (n, 6) their distances from the middle of the gap along the axis (mm), areas (n,) in mm2."""

    def __init__(self, facets, s, areas):
        self.facets, self.s, self.areas = facets, s, areas
        self._stations, self._inverse = np.unique(s.round(9), return_inverse=True)

    def positions(self, y, twist):
        """(n, 6, 3) of local positions y (nodes, 3)."""
        pose = LeftJacobian(self._stations[:, None] * twist).pose[self._inverse.reshape(self.s.shape)]
        return np.einsum("...ij,...j->...i", pose[..., :3, :3], y[self.facets]) + pose[..., :3, 3]


class _Side:
    """One side of a gap in touch: the chain from positions x to the cell's unknowns and strains."""

    def __init__(self, problem, number, t, sheets, places):
        self.number, self.touching, self.places, self.unknowns = number, t, places, problem.unknowns
        own, other = sheets
        nodes = np.concatenate([own.facets[t.facet], other.facets[t.other]], axis=1)
        self.s = np.concatenate([own.s[t.facet], other.s[t.other]], axis=1)
        self.x = np.concatenate([places[0][t.facet], places[1][t.other]], axis=1)
        self.columns = problem.reduced[problem.displacement_dofs[nodes]].reshape(len(nodes), 36)
        self.kept = self.columns >= 0
        e, k = np.split(problem.strains.value, 2)
        self._jacobian = LeftJacobian(self.s.reshape(-1, 1) * np.concatenate([k, e]))
        #: twists (n, 12, 6, 6) by the strains' twist (k, e)
        self._rates = self.s[..., None, None] * self._jacobian.matrix.reshape(*self.s.shape, 6, 6)
        self.rotation = self._jacobian.pose[:, :3, :3].reshape(*self.s.shape, 3, 3)

    def _motion(self):
        """(n, 12, 3, 6): dx by the strains (k, e)."""
        spin, shift = self._rates[..., :3, :], self._rates[..., 3:, :]
        return np.cross(spin, self.x[..., None], axisa=-2, axisb=-2, axisc=-2) + shift

    def first_derivatives(self):
        """(n, 36) by local positions, (6,) by strains (e, k)."""
        f = self.touching.forces
        local = np.einsum("...ji,...j->...i", self.rotation, f)
        return local.reshape(len(f), 36), np.einsum("cnis,cni->s", self._motion(), f)[_ORDER]

    def second_derivatives(self):
        """Of the energy at fixed pressures: sparse (unknowns, unknowns), (unknowns, 6), (6, 6)."""
        t, D, pairs = self.touching, self._motion(), len(self.s)
        f, H = t.forces, -t.push[:, None, None] * t.bend
        HD = (H @ D.reshape(pairs, 36, 6)).reshape(pairs, 12, 3, 6)
        H = H.reshape(pairs, 12, 3, 12, 3)
        local = np.einsum("caji,cajbk,cbkl->caibl", self.rotation, H, self.rotation, optimize=True).reshape(pairs, 36, 36)
        both = self.kept[:, :, None] & self.kept[:, None, :]
        places = [np.broadcast_to(c, both.shape)[both] for c in (self.columns[:, :, None], self.columns[:, None, :])]
        bend = sp.coo_matrix((local[both], places), shape=(self.unknowns, self.unknowns)).tocsr()
        # the wall turns under a force that stands still: d(R^T f) = R^T (f x spin)
        turned = np.cross(f[..., None], self._rates[..., :3, :], axisa=-2, axisb=-2, axisc=-2)
        coupling = np.zeros((self.unknowns, 6))
        local = np.einsum("caji,cajs->cais", self.rotation, HD + turned).reshape(pairs, 36, 6)
        np.add.at(coupling, self.columns[self.kept], local[self.kept])
        own = np.einsum("cais,cait->st", D, HD)
        wrench = np.concatenate([np.cross(self.x, f), f], axis=-1)
        own += np.einsum("ca,cast->st", self.s**2, self._jacobian.slope(wrench.reshape(-1, 6)).reshape(*self.s.shape, 6, 6))
        by_place = np.cross(D, f[..., None], axisa=-2, axisb=-2, axisc=-2)  # d(x x f)
        own += np.einsum("cais,cait->st", self._rates[..., :3, :], by_place)
        return bend, coupling[:, _ORDER], own[np.ix_(_ORDER, _ORDER)]

    @cached_property
    def gap_gradients(self):
        """First derivatives of the gaps: sparse (points, unknowns), (points, 6)."""
        t = self.touching
        local = np.einsum("caji,caj->cai", self.rotation, t.gradient).reshape(len(self.s), 36)
        points = np.broadcast_to(t.point[:, None], local.shape)[self.kept]
        gradient = sp.coo_matrix((local[self.kept], (points, self.columns[self.kept])), shape=(len(t.area), self.unknowns)).tocsr()
        by_strains = np.zeros((len(t.area), 6))
        np.add.at(by_strains, t.point, np.einsum("cais,cai->cs", self._motion(), t.gradient))
        return gradient, by_strains[:, _ORDER]
