"""Contact without friction between two walls that face each other: a penalty on what lies behind the other
wall's surface.

Both walls are sheets of quadratic facets (hifi.fem.facets), seen along a fixed direction d from the first
wall towards the second. There each is a height over the plane normal to d, and the gap at a point x of one
wall is the height of the other's surface X(xi) over it,
    g = d . (X - x),   X - x parallel to d,   dg = m . (dX - dx),   m = n / (n . d),  n the surface's normal.
There is no closest-point projection, which jumps. Near a facet's edge, where n jumps, the gaps g_i over the
facets that meet there (each continued a little beyond its edge) are blended by weights w_i(xi) to
    G = sum w_i g_i / W,  W = sum w_i,
so that forces are continuous and the gradient of an energy. The tangent is the second derivative of the same
energy, with
    W d2G = sum (w_i d2g_i + dw_i dg_i + dg_i dw_i + (g_i - G) d2w_i) - dG dW - dW dG.
Each wall is held against the other at its own Gauss points, both with half the stiffness, so that neither is
preferred.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pneunet.hifi.fem.facets import FacetKind, kind_of

#: facets of the other wall that may lie under a point
_CANDIDATES = 10
_ITERATIONS = 6
#: facets are tried where the first guess is within this of their middle, of their width
_NEAR = 0.9
#: half the width of the zone along an edge in which facets are blended, of a facet's height over the edge
_BLEND = 0.05
#: a quadratic facet stays within this part of its nodes' range beyond them
_BULGE = 0.35
#: the gap over a facet that is seen edge-on would change without bound: steeper ones than this are no walls
_STEEPEST = 0.2


#: of the gap: corrections are shortened to this overlap (hifi.path.newton)
DEEPEST = 0.1


@dataclass(frozen=True)
class WallPenalty:
    """pressure (MPa) between walls over their overlap (mm): `stiffness` mu / gap, of the body's mu and the
    gap at rest.

    At an air pressure of 0.3 mu the overlap is 0.75 % of the gap. The pressure rises smoothly over `onset` of
    the gap, either side.
    """

    stiffness: float = 40.0
    onset: float = 5e-3

    def on(self, mu: float, gap: float) -> "PenaltyLaw":
        """The law of a gap (mm) in a body of shear modulus mu (MPa)."""
        return PenaltyLaw(self.stiffness * mu / gap, self.onset * gap, gap)


@dataclass(frozen=True)
class PenaltyLaw:
    """stiffness in MPa/mm; onset in mm: from -onset to onset of overlap the pressure is a parabola; gap at
    rest in mm."""

    stiffness: float
    onset: float
    gap: float

    def __call__(self, overlap: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(energy per area, pressure, its slope) of overlaps (n,) in mm; N/mm, MPa and MPa/mm."""
        k, s = self.stiffness, self.onset
        rising, full = np.clip(overlap + s, 0.0, 2 * s), np.maximum(overlap - s, 0.0)
        pressure = k * (rising**2 / (4 * s) + full)
        energy = k * (rising**3 / (12 * s) + s * full + full**2 / 2)
        return energy, pressure, k * rising / (2 * s)


@dataclass(frozen=True)
class Touching:
    """Points of one wall that push at another. A point lies under one facet, or between several: each is a
    pair of it.

    Per point (n,): overlap (mm), area (mm2, undeformed, with the share of this side), energy (N/mm), pressure
    (MPa), slope (MPa/mm); position, normal (n, 3): the point (mm) and the covector m; name (n, 2): facet of
    this wall and Gauss point on it. Per pair (c,): point, facet of this wall, other of the other wall; what
    it adds to a point's derivatives by the k nodes of both: gradient (c, k, 3) to dG; turn (c, k, 3) to dW /
    W in 1/mm; bend and shift (c, 2, k, 3), whose products, bend_a shift_a + shift_a bend_a over a, add up to
    d2G but for -(dG dW + dW dG) / W, which couples pairs.
    """

    overlap: np.ndarray
    area: np.ndarray
    energy: np.ndarray
    pressure: np.ndarray
    slope: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    facet: np.ndarray
    other: np.ndarray
    gradient: np.ndarray
    turn: np.ndarray
    bend: np.ndarray
    shift: np.ndarray
    name: np.ndarray

    @property
    def push(self) -> np.ndarray:
        """(c,) N: minus the derivative of the energy by the gap, for each pair."""
        return (self.area * self.pressure)[self.point]

    @property
    def forces(self) -> np.ndarray:
        """(c, k, 3) N: how the energy changes with the nodes."""
        return -self.push[:, None, None] * self.gradient


def mean_normal(facets: np.ndarray) -> np.ndarray:
    """(3,) area (mm2) of facets (n, nodes, 3) as a vector; edges taken straight."""
    ring = facets[:, : kind_of(facets).corners]
    return np.cross(ring, np.roll(ring, -1, axis=1)).sum(axis=(0, 1)) / 2


def touching(
    points: np.ndarray,
    areas: np.ndarray,
    wall: np.ndarray,
    direction: np.ndarray,
    law: PenaltyLaw,
    share: float = 0.5,
    reach: float = 0.0,
) -> Touching | None:
    """The Touching of the Gauss points of facets `points` (n, nodes, 3) in mm, undeformed areas (n, p) of
    these points in mm2, on the `wall` (m, nodes, 3) that lies in `direction` (3,); None where nothing comes
    closer than the law's onset and `reach` (mm). share: of the contact that this side carries."""
    if not len(points) or not len(wall) or not (np.isfinite(points).all() and np.isfinite(wall).all()):
        return None  # a state that has diverged has a residual that says so
    kind, heights = kind_of(wall), wall @ direction
    shape = kind.shape(kind.gauss)
    x = np.einsum("qn,fni->fqi", shape, points)
    above = x @ direction
    low = (heights.min(axis=1) - _BULGE * np.ptp(heights, axis=1)).min()
    facet, gauss = np.nonzero(above > low - law.onset - reach)
    if not len(facet):
        return None
    plane = np.linalg.svd(direction[None])[2][1:]
    position = x[facet, gauss]
    point, other, xi = _under(kind, position @ plane.T, wall @ plane.T)
    nodes, (N, dN, ddN) = wall[other], kind.with_curvatures(xi)
    tangents = dN @ nodes
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    facing = -(normal @ direction) > _STEEPEST * np.linalg.norm(normal, axis=1)
    gap = ((N[:, None] @ nodes)[:, 0] - position[point]) @ direction
    share_of, *shifts = _blend(kind, xi)
    share_of = np.where(facing, share_of, 0.0)
    total = np.bincount(point, share_of, len(facet))
    mean = np.bincount(point, share_of * gap, len(facet)) / np.maximum(total, 1e-300)
    near = (total > 0) & (mean < law.onset + reach)
    keep = np.flatnonzero(near[point] & (share_of > 0))
    if not len(keep):
        return None
    kept = np.flatnonzero(near)
    point, other, N, dN, ddN, tangents, nodes, normal, gap, share_of, by_xi, by_xi_xi = (
        a[keep] for a in (point, other, N, dN, ddN, tangents, nodes, normal, gap, share_of, *shifts)
    )
    m = normal / (normal @ direction)[:, None]
    weights = np.concatenate([-shape[gauss[point]], N], axis=1)
    part, by_xi, by_xi_xi = ((a.T / total[point]).T for a in (share_of, by_xi, by_xi_xi))
    beyond = gap - mean[point]
    curved = ddN @ nodes[:, None]
    derivatives = _derivatives(weights, m, dN, tangents, curved, plane, part, by_xi, by_xi_xi, beyond)
    normals = np.zeros((len(facet), 3))
    np.add.at(normals, point, part[:, None] * m)
    own = facet[point]
    return Touching(
        *(
            -mean[kept],
            share * areas[facet[kept], gauss[kept]],
            *law(-mean[kept]),
            position[kept],
            normals[kept],
        ),
        *(
            np.searchsorted(kept, point),
            own,
            other,
            *derivatives,
            np.stack([facet[kept], gauss[kept]], axis=1),
        ),
    )


def _blend(kind: FacetKind, xi):
    """(c,) weight of a facet in the gap at its coordinates xi (c, 2); its derivatives (c, 2) and (c, 2, 2) by
    xi: a smooth step at each edge, multiplied."""
    (values, ways), width = kind.edges, 2 * _BLEND
    t = np.clip((values + xi @ ways.T + _BLEND) / width, 0.0, 1.0)
    rise = t * t * (3 - 2 * t)
    slope, curve = 6 * t * (1 - t) / width, np.where((t > 0) & (t < 1), 6 - 12 * t, 0.0) / width**2
    # products of the steps at all edges but one, and but two
    same = np.eye(len(ways), dtype=bool)
    others = np.where(same, 1.0, rise[:, None]).prod(axis=-1)
    second = np.where(same[:, None] | same, 1.0, rise[:, None, None]).prod(axis=-1)
    second = second * slope[:, :, None] * slope[:, None, :]
    second[:, same] = curve * others
    return rise.prod(axis=-1), (slope * others) @ ways, ways.T @ second @ ways


def _derivatives(weights, m, dN, tangents, curved, plane, part, by_xi, by_xi_xi, beyond):
    """(gradient, turn, bend, shift) of Touching. curved (c, 2, 2, 3): X,ab; part, by_xi, by_xi_xi: w / W and
    the derivatives of w by xi, over W; beyond (c,) mm: g - G.

    Both g and xi follow from X staying over the point: dg = m . (dX - dx), dxi_a = l_a . (dX - dx), and each
    second derivative is its covector's product with X,ab dxi_a dxi_b + 2 N,a dX dxi_a.
    """
    n, k = weights.shape
    own = 3 * (k - dN.shape[2])
    along = -np.linalg.inv(np.einsum("pi,cai->cpa", plane, tangents)) @ plane
    dxi = np.einsum("cai,cw->cawi", along, weights).reshape(n, 2, 3 * k)
    by_gap = np.einsum("ci,cw->cwi", m, weights).reshape(n, 3 * k)
    turn = np.einsum("ca,cax->cx", by_xi, dxi)
    gradient = part[:, None] * by_gap + beyond[:, None] * turn
    covector = part[:, None] * m + beyond[:, None] * np.einsum("ca,cai->ci", by_xi, along)
    by_dxi = by_xi[:, :, None] * by_gap[:, None, :]
    by_dxi[:, :, own:] += np.einsum("can,ci->cani", dN, covector).reshape(n, 2, 3 * k - own)
    curved = np.einsum("cabi,ci->cab", curved, covector) + beyond[:, None, None] * by_xi_xi
    bend = by_dxi + curved @ dxi / 2
    return tuple(a.reshape(*a.shape[:-1], k, 3) for a in (gradient, turn, bend, dxi))


def _under(kind: FacetKind, points, facets):
    """Pairs (c,) of points (n, 2) and facets (m, nodes, 2) they lie over, or just beside: point, facet,
    coordinates xi (c, 2)."""
    count = min(_CANDIDATES, len(facets))
    N, dN = kind.with_slopes(kind.centre)
    centres, slopes = N @ facets, dN @ facets
    near = cKDTree(centres).query(points, k=count)[1].reshape(len(points), count)
    # by Newton, from the coordinates in the middle's tangent plane
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        xi = kind.centre + _solve2(np.swapaxes(slopes, -1, -2)[near], points[:, None] - centres[near])
        point, column = np.nonzero((np.abs(xi - kind.centre) < _NEAR).all(axis=-1))
        other, xi = near[point, column], xi[point, column]
        nodes = facets[other]
        for _ in range(_ITERATIONS):
            N, dN = kind.with_slopes(xi)
            miss = points[point] - (N[:, None] @ nodes)[:, 0]
            xi = xi + _solve2(np.swapaxes(dN @ nodes, 1, 2), miss)
        values, ways = kind.edges
        over = ((values + xi @ ways.T).min(axis=-1) > -_BLEND) & (np.abs(miss).max(axis=-1) < 1e-3)
    return point[over], other[over], xi[over]


def _solve2(A, b):
    """Solutions (..., 2) of 2 x 2 systems."""
    (a, c), (d, e) = np.moveaxis(A, (-2, -1), (0, 1))
    x, y = np.moveaxis(b, -1, 0)
    return np.stack([e * x - c * y, a * y - d * x], axis=-1) / (a * e - c * d)[..., None]
