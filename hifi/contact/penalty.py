"""Contact without friction between two walls that face each other: a penalty on what lies behind the other
wall's surface.

Both walls are sheets of quadratic facets, seen along a fixed direction d from the first wall towards the
second. There each is a height over the plane normal to d, and the gap at a point x of one wall is the height
of the other's surface X(xi) over it,
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

from pneunet.hifi.fem import surface

_GAUSS = surface.p2_shape(surface._BARYCENTRIC)
#: facets of the other wall that may lie under a point
_CANDIDATES = 10
_ITERATIONS = 6
#: half the width of the zone along an edge in which facets are blended, in barycentric coordinates
_BLEND = 0.05
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
    it adds to a point's derivatives by the six nodes of both: gradient (c, 12, 3) to dG, turn (c, 12, 3) to
    dW / W in 1/mm, bend (c, 36, 36) to d2G in 1/mm, but for -(dG dW + dW dG) / W, which couples pairs.
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
    name: np.ndarray

    @property
    def push(self) -> np.ndarray:
        """(c,) N: minus the derivative of the energy by the gap, for each pair."""
        return (self.area * self.pressure)[self.point]

    @property
    def forces(self) -> np.ndarray:
        """(c, 12, 3) N: how the energy changes with the nodes."""
        return -self.push[:, None, None] * self.gradient


def mean_normal(facets: np.ndarray) -> np.ndarray:
    """(3,) area (mm2) of facets (n, 6, 3) as a vector; edges taken straight."""
    a, b, c = (facets[:, i] for i in range(3))
    return np.cross(b - a, c - a).sum(axis=0) / 2


def touching(
    points: np.ndarray,
    areas: np.ndarray,
    wall: np.ndarray,
    direction: np.ndarray,
    law: PenaltyLaw,
    share: float = 0.5,
) -> Touching | None:
    """The Touching of the Gauss points of facets `points` (n, 6, 3) in mm, undeformed areas (n,) in mm2, on
    the `wall` (m, 6, 3) that lies in `direction` (3,); None where nothing comes closer than the law's onset.
    share: of the contact that this side carries."""
    if not len(points) or not len(wall) or not (np.isfinite(points).all() and np.isfinite(wall).all()):
        return None  # a state that has diverged has a residual that says so
    heights = wall @ direction
    x = np.einsum("qn,fni->fqi", _GAUSS, points)
    above = x @ direction
    # a quadratic facet stays within this of its nodes
    low = (heights.min(axis=1) - 0.2 * np.ptp(heights, axis=1)).min()
    facet, gauss = np.nonzero(above > low - law.onset)
    if not len(facet):
        return None
    plane = np.linalg.svd(direction[None])[2][1:]
    position = x[facet, gauss]
    point, other, xi = _under(position @ plane.T, wall @ plane.T)
    nodes, N, dN = wall[other], surface.p2_shape(_full(xi)), _slopes(xi)
    tangents = np.einsum("can,cni->cai", dN, nodes)
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    facing = -(normal @ direction) > _STEEPEST * np.linalg.norm(normal, axis=1)
    gap = (np.einsum("cn,cni->ci", N, nodes) - position[point]) @ direction
    share_of, *shifts = _blend(xi)
    share_of = np.where(facing, share_of, 0.0)
    total = np.bincount(point, share_of, len(facet))
    mean = np.bincount(point, share_of * gap, len(facet)) / np.maximum(total, 1e-300)
    near = (total > 0) & (mean < law.onset)
    keep = np.flatnonzero(near[point] & (share_of > 0))
    if not len(keep):
        return None
    kept = np.flatnonzero(near)
    point, other, N, dN, tangents, nodes, normal, gap, share_of, by_xi, by_xi_xi = (
        a[keep] for a in (point, other, N, dN, tangents, nodes, normal, gap, share_of, *shifts)
    )
    m = normal / (normal @ direction)[:, None]
    weights = np.concatenate([-_GAUSS[gauss[point]], N], axis=1)
    part, by_xi, by_xi_xi = ((a.T / total[point]).T for a in (share_of, by_xi, by_xi_xi))
    beyond = gap - mean[point]
    derivatives = _derivatives(weights, m, dN, tangents, nodes, plane, part, by_xi, by_xi_xi, beyond)
    normals = np.zeros((len(facet), 3))
    np.add.at(normals, point, part[:, None] * m)
    own = facet[point]
    return Touching(
        *(
            -mean[kept],
            share * areas[facet[kept]] * surface._WEIGHTS[gauss[kept]],
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


#: barycentric coordinates by the last two; of two different ones the third
_BY_XI, _THIRD = np.array([[-1, -1], [1, 0], [0, 1]]), np.array([[0, 2, 1], [2, 0, 0], [1, 0, 0]])


def _blend(xi):
    """(c,) weight of a facet in the gap at its coordinates xi (c, 2); its derivatives (c, 2) and (c, 2, 2) by
    xi."""
    t = np.clip((_full(xi) + _BLEND) / (2 * _BLEND), 0.0, 1.0)
    rise, width = t * t * (3 - 2 * t), 2 * _BLEND
    slope, curve = 6 * t * (1 - t) / width, np.where((t > 0) & (t < 1), 6 - 12 * t, 0.0) / width**2
    a, b, c = rise.T
    others = np.stack([b * c, a * c, a * b], axis=-1)
    second = slope[:, :, None] * slope[:, None, :] * rise[:, _THIRD]
    second[:, range(3), range(3)] = curve * others
    return a * b * c, (slope * others) @ _BY_XI, _BY_XI.T @ second @ _BY_XI


def _derivatives(weights, m, dN, tangents, nodes, plane, part, by_xi, by_xi_xi, beyond):
    """(gradient, turn, bend) of Touching. part, by_xi, by_xi_xi: w / W and the derivatives of w by xi, over
    W; beyond (c,) mm: g - G.

    Both g and xi follow from X staying over the point: dg = m . (dX - dx), dxi_a = l_a . (dX - dx), and each
    second derivative is its covector's product with X,ab dxi_a dxi_b + 2 N,a dX dxi_a.
    """
    n = len(m)
    along = -np.linalg.inv(np.einsum("pi,cai->cpa", plane, tangents)) @ plane
    dxi = np.einsum("cai,cw->cawi", along, weights).reshape(n, 2, 36)
    by_gap = np.einsum("ci,cw->cwi", m, weights).reshape(n, 36)
    turn = np.einsum("ca,cax->cx", by_xi, dxi)
    gradient = part[:, None] * by_gap + beyond[:, None] * turn
    covector = part[:, None] * m + beyond[:, None] * np.einsum("ca,cai->ci", by_xi, along)
    by_dxi = by_xi[:, :, None] * by_gap[:, None, :]
    by_dxi[:, :, 18:] += np.einsum("can,ci->cani", dN, covector).reshape(n, 2, 18)
    curved = np.einsum("abn,cni,ci->cab", _SECOND, nodes, covector) + beyond[:, None, None] * by_xi_xi
    half = np.einsum("cax,cay->cxy", by_dxi + curved @ dxi / 2, dxi)
    return gradient.reshape(n, 12, 3), turn.reshape(n, 12, 3), half + np.swapaxes(half, 1, 2)


def _full(xi):
    return np.concatenate([1 - xi.sum(axis=-1, keepdims=True), xi], axis=-1)


def _slopes(xi):
    """(..., 2, 6) derivatives of the quadratic shape functions by the last two barycentric coordinates xi
    (..., 2)."""
    a, (b, c) = 1 - xi.sum(axis=-1), np.moveaxis(xi, -1, 0)
    zero = np.zeros_like(a)
    by_b = [1 - 4 * a, 4 * b - 1, zero, 4 * (a - b), 4 * c, -4 * c]
    by_c = [1 - 4 * a, zero, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)]
    return np.stack([np.stack(by_b, axis=-1), np.stack(by_c, axis=-1)], axis=-2)


#: (2, 2, 6) second derivatives of the quadratic shape functions
_SECOND = np.array(
    [[[4, 4, 0, -8, 0, 0], [4, 0, 0, -4, 4, -4]], [[4, 0, 0, -4, 4, -4], [4, 0, 4, 0, 0, -8]]], float
)


def _under(points, facets):
    """Pairs (c,) of points (n, 2) and facets (m, 6, 2) they lie over, or just beside: point, facet,
    coordinates xi (c, 2)."""
    count = min(_CANDIDATES, len(facets))
    near = cKDTree(facets[:, :3].mean(axis=1)).query(points, k=count)[1].reshape(len(points), count)
    nodes = facets[near]
    # from the coordinates of the straight-sided facet, by Newton
    edges = nodes[..., 1:3, :] - nodes[..., :1, :]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        xi = _solve2(np.swapaxes(edges, -1, -2), points[:, None] - nodes[..., 0, :])
        point, column = np.nonzero((np.abs(xi - 0.5) < 1.5).all(axis=-1))
        xi, nodes = xi[point, column], nodes[point, column]
        for _ in range(_ITERATIONS):
            miss = points[point] - np.einsum("cn,cni->ci", surface.p2_shape(_full(xi)), nodes)
            xi = xi + _solve2(np.einsum("can,cni->cia", _slopes(xi), nodes), miss)
        over = (_full(xi).min(axis=-1) > -_BLEND) & (np.abs(miss).max(axis=-1) < 1e-3)
    return point[over], near[point, column][over], xi[over]


def _solve2(A, b):
    """Solutions (..., 2) of 2 x 2 systems."""
    (a, c), (d, e) = np.moveaxis(A, (-2, -1), (0, 1))
    x, y = np.moveaxis(b, -1, 0)
    return np.stack([e * x - c * y, a * y - d * x], axis=-1) / (a * e - c * d)[..., None]
