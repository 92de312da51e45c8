"""Contact of a unit cell's walls: hifi.contact.penalty between the pieces that the cell's cuts leave, moved
by the strains (e, k).

Each gap is seen from the section frame in its middle, in which a wall's node of local position y at the
distance s along the axis lies at exp(s (k, e)) y: linear in y, and its derivatives by the strains are exact
too (base.left_jacobian).
"""

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from pneunet.base.left_jacobian import LeftJacobian
from pneunet.hifi.contact.gaps import Contact, Side
from pneunet.hifi.contact.penalty import WallPenalty, mean_normal, touching
from pneunet.hifi.contact.walls import IN_CONTACT, CellWalls, WallContact, distances_from
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.mixed_field import MixedField

#: strains (e, k) from twists (k, e)
_ORDER = [3, 4, 5, 0, 1, 2]


class CellContact(Contact):
    """Contact in the gaps of `walls` under a penalty; unknowns are the problem's and the six strains
    (e, k)."""

    def __init__(self, problem: MixedField, walls: CellWalls, penalty: WallPenalty):
        size = problem.unknowns + 6
        super().__init__(MPI.COMM_SELF, size, slice(0, size))
        self.problem, self.gaps = problem, len(walls.gaps)
        self.law = penalty.on(problem.segment.material.mu, problem.segment.gap)
        self._walls = []
        for gap in walls.gaps:
            rest = [problem.nodes[w.facets] + np.multiply.outer(w.shift, [[1, 0, 0]]) for w in gap]
            middle = np.mean([r[..., 0].mean() for r in rest])
            normal = mean_normal(rest[0]) - mean_normal(rest[1])
            sheets = [
                _Sheet(
                    w.facets,
                    problem.nodes[w.facets][..., 0] + w.shift[:, None] - middle,
                    surface.reference_areas(problem, w.facets),
                )
                for w in gap
            ]
            normal /= np.linalg.norm(normal)
            self._walls += [(sheets, normal), (sheets[::-1], -normal)]

    def sides(self) -> list[Side]:
        problem, found = self.problem, []
        y = problem.nodes * [0, 1, 1] + problem.displacement()
        e, k = np.split(problem.strains.value, 2)
        for number, (sheets, direction) in enumerate(self._walls):
            places = [sheet.positions(y, np.concatenate([k, e])) for sheet in sheets]
            t = touching(places[0], sheets[0].areas, places[1], direction, self.law)
            if t is not None:
                found.append(_Side(problem, number, self.law, t, sheets, places))
        return found

    def measure(self, pressure: float) -> WallContact:
        """WallContact at the last residual of the gap with the largest force, `pressure` (MPa) being that of
        the air."""
        gaps = [WallContact() for _ in range(self.gaps)]
        for side in self._now:
            t, gap = side.touching, side.number // 2
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
        forces = np.linalg.norm(self.forces(), axis=1)
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


class _Side(Side):
    """Its columns (n, 42) are the nodes' unknowns, and behind all unknowns the strains' twist (k, e)."""

    def __init__(self, problem, number, law, t, sheets, places):
        own, other = sheets
        nodes = np.concatenate([own.facets[t.facet], other.facets[t.other]], axis=1)
        self.s = np.concatenate([own.s[t.facet], other.s[t.other]], axis=1)
        self.x = np.concatenate([places[0][t.facet], places[1][t.other]], axis=1)
        columns = problem.reduced[problem.displacement_dofs[nodes]].reshape(len(nodes), 36)
        strains = np.broadcast_to(problem.unknowns + np.array(_ORDER), (len(nodes), 6))
        super().__init__(number, law, t, np.hstack([columns, strains]), problem.unknowns + 6)
        self.places = places
        e, k = np.split(problem.strains.value, 2)
        self._jacobian = LeftJacobian(self.s.reshape(-1, 1) * np.concatenate([k, e]))
        #: twists (n, 12, 6, 6) by the strains' twist (k, e)
        self._rates = self.s[..., None, None] * self._jacobian.matrix.reshape(*self.s.shape, 6, 6)
        self.rotation = self._jacobian.pose[:, :3, :3].reshape(*self.s.shape, 3, 3)

    def _motion(self):
        """(n, 12, 3, 6): dx by the strains (k, e)."""
        spin, shift = self._rates[..., :3, :], self._rates[..., 3:, :]
        return np.cross(spin, self.x[..., None], axisa=-2, axisb=-2, axisc=-2) + shift

    def chained(self, by_position: np.ndarray) -> np.ndarray:
        local = np.einsum("...ji,...j->...i", self.rotation, by_position).reshape(len(by_position), 36)
        return np.hstack([local, np.einsum("cnis,cni->cs", self._motion(), by_position)])

    def bend(self) -> np.ndarray:
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
        return np.concatenate(
            [np.concatenate([local, coupling], 2), np.concatenate([np.swapaxes(coupling, 1, 2), own], 2)], 1
        )
