"""Contact of a unit cell's walls: hifi.contact.penalty between the pieces that the cell's cuts leave, moved
by the strains (e, k).

Each gap is seen from the section frame in its middle, in which a wall's node of local position y at the
distance s along the axis lies at exp(s (k, e)) y: linear in y, and its derivatives by the strains are exact
too (base.left_jacobian).
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from pneunet.base.left_jacobian import LeftJacobian
from pneunet.hifi.contact.penalty import DEEPEST, mean_normal, touching
from pneunet.hifi.contact.walls import IN_CONTACT, WallContact, distances_from
from pneunet.hifi.fem import surface
from pneunet.hifi.path.low_rank import TouchingSides

#: strains (e, k) from twists (k, e)
_ORDER = [3, 4, 5, 0, 1, 2]


class CellContact:
    """Contact in the gaps of `walls` (hifi.contact.walls.CellWalls) under a
    hifi.contact.penalty.WallPenalty."""

    def __init__(self, problem, walls, penalty):
        self.problem, segment = problem, problem.segment
        self.law = penalty.on(segment.material.mu, segment.gap)
        self._sides, self._sides_in_touch = [], TouchingSides()
        #: deepest overlap at the last residual, over DEEPEST of the gap; 0 where nothing comes closer than
        #: the penalty's onset
        self.overreach = 0.0
        for gap in walls.gaps:
            rest = [problem.nodes[f] + np.multiply.outer(s, [[1, 0, 0]]) for f, s in gap]
            middle = np.mean([r[..., 0].mean() for r in rest])
            normal = mean_normal(rest[0]) - mean_normal(rest[1])
            sheets = [
                _Sheet(f, problem.nodes[f][..., 0] + s[:, None] - middle, surface.reference_areas(problem, f))
                for f, s in gap
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
        forces = np.zeros(self.problem.unknowns + 6)
        self._sides_in_touch.now, deepest = self._touching(), 0.0
        for side in self._sides_in_touch.now:
            deepest = max(deepest, side.touching.overlap.max() + self.law.onset)
            np.add.at(forces, side.columns[side.kept], side.first_derivatives()[side.kept])
        self.overreach = deepest / (DEEPEST * self.problem.segment.gap)
        return forces[:-6], forces[-6:]

    def tangent(self):
        """((rows, columns, values) in the unknowns, (unknowns, 6), (6, 6)): second derivatives of the
        energy."""
        n, self._sides_in_touch.then = self.problem.unknowns, self._touching()
        total = sp.csr_matrix((n + 6, n + 6))
        for side in self._sides_in_touch.then:
            gradient = side.gap_gradients
            total = (
                total
                + side.bend()
                + gradient.T @ sp.diags(side.touching.area * side.touching.slope) @ gradient
            )
        inner = total[:n, :n].tocoo()
        return (inner.row, inner.col, inner.data), total[:n, n:].toarray(), total[n:, n:].toarray()

    def stiffnesses(self, factorised=False):
        """{point: N/mm} at the last residual, or at the last tangent."""
        return self._sides_in_touch.stiffnesses(factorised)

    def gradients(self, points):
        """(m, unknowns + 6): how the gaps of points change with unknowns and strains."""
        return self._sides_in_touch.gap_gradients(points, self.problem.unknowns + 6).toarray()

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
                gaps[gap] = WallContact(
                    0.0,
                    c.area + t.area[pushing].sum(),
                    np.fmin(c.nearest, d.min()),
                    np.fmax(c.farthest, d.max()),
                )
        forces = np.linalg.norm(totals, axis=1)
        return replace(gaps[forces.argmax()], force=float(forces.max()))


class _Sheet:
    """facets (n, 6) of nodes, s (n, 6) their distances from the middle of the gap along the axis (mm), areas
    (n,) in mm2."""

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
        columns = problem.reduced[problem.displacement_dofs[nodes]].reshape(len(nodes), 36)
        strains = np.broadcast_to(problem.unknowns + np.array(_ORDER), (len(nodes), 6))
        #: (n, 42) places of the nodes' unknowns, -1 where held, and of the strains' twist (k, e) behind all
        #: unknowns
        self.columns = np.hstack([columns, strains])
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
        """(n, 42) of the energy."""
        return self._chained(self.touching.forces)

    def _chained(self, by_position):
        """(n, 42) derivatives by unknowns and twist from those by positions (n, 12, 3)."""
        local = np.einsum("...ji,...j->...i", self.rotation, by_position).reshape(len(by_position), 36)
        return np.hstack([local, np.einsum("cnis,cni->cs", self._motion(), by_position)])

    def bend(self):
        """Sparse (unknowns + 6, same): second derivatives of the energy at fixed pressures."""
        t, D, pairs = self.touching, self._motion(), len(self.s)
        f, H = t.forces, -t.push[:, None, None] * t.bend
        HD = (H @ D.reshape(pairs, 36, 6)).reshape(pairs, 12, 3, 6)
        H = H.reshape(pairs, 12, 3, 12, 3)
        local = np.einsum("caji,cajbk,cbkl->caibl", self.rotation, H, self.rotation, optimize=True).reshape(
            pairs, 36, 36
        )
        # the wall turns under a force that stands still: d(R^T f) = R^T (f x spin)
        turned = np.cross(f[..., None], self._rates[..., :3, :], axisa=-2, axisb=-2, axisc=-2)
        coupling = np.einsum("caji,cajs->cais", self.rotation, HD + turned).reshape(pairs, 36, 6)
        own = np.einsum("cais,cait->cst", D, HD)
        wrench = np.concatenate([np.cross(self.x, f), f], axis=-1)
        own += np.einsum(
            "ca,cast->cst",
            self.s**2,
            self._jacobian.slope(wrench.reshape(-1, 6)).reshape(*self.s.shape, 6, 6),
        )
        by_place = np.cross(D, f[..., None], axisa=-2, axisb=-2, axisc=-2)  # d(x x f)
        own += np.einsum("cais,cait->cst", self._rates[..., :3, :], by_place)
        whole = np.concatenate(
            [np.concatenate([local, coupling], 2), np.concatenate([np.swapaxes(coupling, 1, 2), own], 2)], 1
        )
        both = self.kept[:, :, None] & self.kept[:, None, :]
        places = [
            np.broadcast_to(c, both.shape)[both] for c in (self.columns[:, :, None], self.columns[:, None, :])
        ]
        return sp.coo_matrix((whole[both], places), shape=(self.unknowns + 6,) * 2).tocsr()

    @cached_property
    def gap_gradients(self):
        """Sparse (points, unknowns + 6): first derivatives of the gaps."""
        t, kept = self.touching, self.kept
        points = np.broadcast_to(t.point[:, None], kept.shape)[kept]
        values = self._chained(t.gradient)[kept]
        return sp.coo_matrix(
            (values, (points, self.columns[kept])), shape=(len(t.area), self.unknowns + 6)
        ).tocsr()
