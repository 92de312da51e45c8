"""Facets of quadratic elements as reference shapes: shape functions, their derivatives, and rules of
quadrature. Quadratic triangles of tetrahedra, biquadratic quadrilaterals of hexahedra.

Nodes of a facet: its corners in turn, then the middles of its edges in turn from the first corner, of a
quadrilateral last its own. Reference places lie in the triangle (0, 0), (1, 0), (0, 1) or the unit square.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

# degree-4 rule on the triangle (Dunavant 1985): exact for P2 shape functions times linear coordinates
_A4, _B4 = 0.445948490915965, 0.091576213509771
_BARYCENTRIC = np.array(
    [[1 - 2 * a if i == j else a for i in range(3)] for a in (_A4, _B4) for j in range(3)]
)
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)
#: exponents of x and y up to degree 2
_SQUARES = np.array([(i, j) for i in range(3) for j in range(3)])


def _collapsed(points):
    """(barycentric coordinates (points^2, 3), weights) of a rule on the triangle of degree 2 points - 2."""
    x, w = np.polynomial.legendre.leggauss(points)
    x, w = (1 + x) / 2, w / 2
    a, b = np.meshgrid(x, x, indexing="ij")
    places = np.stack([1 - a, a * (1 - b), a * b], axis=-1).reshape(-1, 3)
    return places, 2 * np.outer(w * x, w).ravel()


def _tensor(points):
    """(places (points^2, 2), weights) of the Gauss rule on the unit square; weights add up to 1."""
    x, w = np.polynomial.legendre.leggauss(points)
    places = np.stack(np.meshgrid((1 + x) / 2, (1 + x) / 2, indexing="ij"), axis=-1).reshape(-1, 2)
    return places, np.outer(w, w).ravel() / 4


@dataclass(frozen=True, eq=False)
class FacetKind:
    """One kind of facets. ring (corners, 2) of its reference shape; exponents (nodes, 2) of its monomials.

    triangles (t, 3, 2) that the reference shape is made of; barycentric (q, 3) and weights (q,) of a rule on
    each, exact for displacement times place. gauss (p, 2) places, gauss_weights (p,) adding up to 1: of a
    cheaper rule.
    """

    ring: np.ndarray
    exponents: np.ndarray
    triangles: np.ndarray
    barycentric: np.ndarray
    weights: np.ndarray
    gauss: np.ndarray
    gauss_weights: np.ndarray

    @property
    def corners(self) -> int:
        return len(self.ring)

    @cached_property
    def nodes(self) -> np.ndarray:
        """(nodes, 2) their reference places."""
        middles = (self.ring + np.roll(self.ring, -1, axis=0)) / 2
        return np.concatenate([self.ring, middles, [self.centre]])[: len(self.exponents)]

    @property
    def reference_area(self) -> float:
        return 0.5 if self.corners == 3 else 1.0

    @property
    def centre(self) -> np.ndarray:
        """(2,) the middle of the reference shape."""
        return self.ring.mean(axis=0)

    @cached_property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """(values (corners,) at the origin, slopes (corners, 2)) of linear coordinates that are 0 on one edge
        each and 1 on what is farthest from it."""
        way = np.roll(self.ring, -1, axis=0) - self.ring
        slopes = np.stack([-way[:, 1], way[:, 0]], axis=1)
        height = ((self.ring[None] - self.ring[:, None]) @ slopes[:, :, None])[..., 0].max(axis=1)
        slopes = slopes / height[:, None]
        return -(slopes * self.ring).sum(axis=1), slopes

    @cached_property
    def turned(self) -> np.ndarray:
        """(nodes,) the nodes in the order of the other orientation."""
        n = self.corners
        order = [0, *range(n - 1, 0, -1), *range(2 * n - 1, n - 1, -1), 2 * n]
        return np.array(order[: len(self.exponents)])

    @cached_property
    def _coefficients(self):
        """(monomials, nodes) of the shape functions."""
        return np.linalg.inv((self.nodes[:, None] ** self.exponents).prod(axis=-1))

    def _polynomials(self, places, *by):
        """(..., nodes) the shape functions' derivatives by the coordinates `by`, one after the other."""
        exponents, factors = self.exponents.copy(), np.ones(len(self.exponents))
        for axis in by:
            factors *= exponents[:, axis]
            exponents[:, axis] = np.maximum(exponents[:, axis] - 1, 0)
        x, y = np.moveaxis(places, -1, 0)
        x, y = (np.stack([np.ones_like(a), a, a * a], axis=-1) for a in (x, y))
        monomials = x[..., exponents[:, 0]] * y[..., exponents[:, 1]]
        return monomials @ (factors[:, None] * self._coefficients)

    def shape(self, places: np.ndarray) -> np.ndarray:
        """(..., nodes) shape functions at reference places (..., 2)."""
        return self._polynomials(places)

    def slopes(self, places: np.ndarray) -> np.ndarray:
        """(..., 2, nodes) their derivatives by the place."""
        return np.stack([self._polynomials(places, a) for a in range(2)], axis=-2)

    def curvatures(self, places: np.ndarray) -> np.ndarray:
        """(..., 2, 2, nodes) their second derivatives by the place."""
        rows = [np.stack([self._polynomials(places, a, b) for b in range(2)], axis=-2) for a in range(2)]
        return np.stack(rows, axis=-3)

    def stretched(self, places: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """(..., q) area over reference area at places (q, 2) of facets with these corners (..., corners, 3),
        mm2."""
        if self.corners == 3:
            one = np.ones(len(places))
            slopes = [[-one, one, 0 * one], [-one, 0 * one, one]]
        else:
            x, y = places.T
            slopes = [[y - 1, 1 - y, y, -y], [x - 1, -x, x, 1 - x]]
        tangents = np.einsum("acq,...ci->a...qi", np.array(slopes), corners)
        return np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=-1)

    def flat(self, divisions: int) -> np.ndarray:
        """(t, 3, nodes) shape functions at the corners of flat triangles that a facet is seen as, each edge
        in so many parts; of its own orientation.

        A square's part is four triangles around its middle, which mirror images and turns take to themselves.
        """
        n = divisions
        if self.corners == 3:
            up = [[(i, j), (i + 1, j), (i, j + 1)] for i in range(n) for j in range(n - i)]
            down = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i in range(n) for j in range(n - i - 1)]
            return self.shape(np.array(up + down) / n)
        own = np.array([[self.ring[i], self.ring[(i + 1) % 4], [0.5, 0.5]] for i in range(4)])
        starts = np.stack(np.meshgrid(range(n), range(n), indexing="ij"), axis=-1).reshape(-1, 1, 1, 2)
        return self.shape((starts + own).reshape(-1, 3, 2) / n)


_TRIANGLE, _SQUARE = (
    np.array([[0, 0], [1, 0], [0, 1]], float),
    np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float),
)
#: nodes of a facet -> its kind
KINDS = {
    6: FacetKind(
        _TRIANGLE,
        _SQUARES[_SQUARES.sum(axis=1) <= 2],
        _TRIANGLE[None],
        _BARYCENTRIC,
        _WEIGHTS,
        _BARYCENTRIC[:, 1:],
        _WEIGHTS,
    ),
    9: FacetKind(_SQUARE, _SQUARES, _SQUARE[[[0, 1, 2], [0, 2, 3]]], *_collapsed(5), *_tensor(3)),
}


def kind_of(facets: np.ndarray) -> FacetKind:
    """Of facets (n, nodes) or of what their nodes have (n, nodes, ...)."""
    return KINDS[facets.shape[1]]


def subdivided(facets: np.ndarray, divisions: int) -> np.ndarray:
    """(t, 3, 3) flat triangles between points of facets (facets, nodes, 3), each edge in so many parts, same
    orientation."""
    return np.einsum("tcn,fni->ftci", kind_of(facets).flat(divisions), facets).reshape(-1, 3, 3)
