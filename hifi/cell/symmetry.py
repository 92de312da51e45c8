"""The unknowns of a cell: what periodicity and half turns leave of the nodes' values, in one class of
symmetry at a time.

Half turns R about the axes take the body to itself. Deformations fall into classes: in each, a half turn
takes u(X) to chi R u(X) with a sign chi of its own, and the strains of one class do not move the others'. A
free state is in the first class, where all signs are +1; the stiffness and the count of unstable directions
are put together from all. With half turns only a part of the cell is meshed, and the signs hold on its cuts.
Without them there is one class.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pneunet.geometry.grids.cell import HALF_TURNS
from pneunet.hifi.fem import surface

#: rows of the gauge that see e2 and e3: a sideways displacement X1 e turns about z and y
_SIDEWAYS = np.zeros((6, 6))
_SIDEWAYS[4, 2], _SIDEWAYS[5, 1] = -1, 1
#: mm
_TOLERANCE = 1e-5


def group(kind: str | None) -> np.ndarray:
    """(g, 3) diagonals of the rotations that make a cell of its mesh: the identity, and the half turns of
    this kind's parts."""
    return np.array([(1, 1, 1), *(HALF_TURNS[kind] if kind else ())], float)


def characters(turns: np.ndarray) -> np.ndarray:
    """(g, g) the classes' signs chi for each of the rotations (g, 3), the first class's all +1."""
    if len(turns) == 4:
        return np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]], float)
    return np.array([[1, 1], [1, -1]], float) if len(turns) == 2 else np.ones((1, 1))


def strains_of(chi: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """(6,) bool: which of (e, k) belong to the class with the signs `chi` (g,) under the rotations (g, 3)."""
    return (chi[:, None] == np.tile(turns[:, :1] * turns, 2)).all(axis=0)


class Orbits:
    """Which nodes of a mesh are images of each other: images (g, n) for each rotation the first node that the
    pitch takes a node's image to, -1 where the mesh has none."""

    def __init__(self, points: np.ndarray, pitch: float, turns: np.ndarray):
        tree, wrapped = periodic_tree(points, pitch)
        pairs = tree.query_pairs(_TOLERANCE, output_type="ndarray")
        graph = sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
        _, labels = connected_components(graph, directed=False)
        first = np.full(labels.max() + 1, len(points))
        np.minimum.at(first, labels, np.arange(len(points)))
        first = first[labels]
        images = [first]
        for turn in turns[1:]:
            distance, nearest = tree.query(wrapped(points * turn))
            images.append(np.where(distance < _TOLERANCE, first[nearest], -1))
        self.images = np.array(images)

    def masters(self, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(master (n,), sign (n,), zero (n,) bool) of a quantity that takes these signs (g,) under the
        rotations: its value at a node is `sign` times that at the master, and 0 where it would be its own
        negative."""
        there = np.where(self.images < 0, self.images.shape[1], self.images)
        which = there.argmin(axis=0)
        zero = ((self.images == self.images[0]) & (signs < 0)[:, None]).any(axis=0)
        return there.min(axis=0), signs[which], zero


def periodic_tree(points: np.ndarray, pitch: float) -> tuple[cKDTree, Callable[[np.ndarray], np.ndarray]]:
    """(tree of the points with X1 taken modulo the pitch, function that wraps others the same way)."""
    low, far = points[:, 1:].min(axis=0), 4 * np.abs(points).max(axis=0)[1:] + 1.0

    def wrapped(others):
        x = np.mod(others[:, 0], pitch)
        x[x >= pitch] = 0.0
        return np.column_stack([x, np.mod(others[:, 1:] - low, far)])

    return cKDTree(wrapped(points), boxsize=[pitch, *far]), wrapped


@dataclass(frozen=True)
class Window:
    """What of a surface's image by rotation `number`, moved by `shift` (mm) along X1, lies within a pitch."""

    number: int
    shift: float
    integral: surface.SlabIntegral


def windows(problem: Any, tags: Sequence[int], centre: float) -> list[Window]:
    """The tagged facets of the periodic cell within half a pitch from X1 = `centre` (mm)."""
    facets, pitch = surface.facet_nodes(problem, *tags), problem.segment.pitch
    found = []
    for number, turn in enumerate(problem.turns):
        places = problem.nodes * turn
        x = places[facets, 0]
        first, last = (centre - x.max()) / pitch - 0.5, (centre - x.min()) / pitch + 0.5
        for shift in pitch * np.arange(np.floor(first), np.ceil(last) + 1):
            low, high = centre - shift - pitch / 2, centre - shift + pitch / 2
            integral = surface.SlabIntegral(problem, facets, low, high, places)
            if integral.area:
                found.append(Window(number, float(shift), integral))
    return found


class SymmetryClass:
    """The unknowns of a hifi.cell.problem.CellProblem in one class, whose signs (g,) are `chi`.

    reduced (dofs,): index of each mixed dof among the unknowns, -1 where it is zero or not there; signs
    (dofs,). constraints: number of incompressibility multipliers: so many negative pivots has a stable
    tangent. strains (6,): which of (e, k) belong to the class. gauge (unknowns, m), gauge_strains (m, 6).
    """

    def __init__(self, problem: Any, chi: np.ndarray, rollers: dict[int, int], used: np.ndarray):
        self.problem, self.chi, turns = problem, chi, problem.turns
        n = len(problem.state.x.array)
        master, self.signs, zero = np.arange(n), np.ones(n), np.zeros(n, bool)
        for orbits, dofs, signs in (
            *((problem.orbits[0], problem.displacement_dofs[:, i], chi * turns[:, i]) for i in range(3)),
            (problem.orbits[1], problem.pressure_dofs, chi),
        ):
            to, self.signs[dofs], zero[dofs] = orbits.masters(signs)
            master[dofs] = dofs[to]
        for tag, component in rollers.items():
            nodes = np.unique(surface.facet_nodes(problem, tag))
            zero |= np.isin(master, master[problem.displacement_dofs[nodes, component]])
        used = used & ~zero
        kept = np.unique(master[used])
        place = np.full(n, -1)
        place[kept] = np.arange(len(kept))
        self.reduced = np.where(used, place[master], -1)
        self.unknowns = len(kept)
        self.constraints = int(np.count_nonzero(np.isin(kept, problem.pressure_dofs)))
        self.strains = strains_of(chi, turns)
        self._conditions = (chi[:, None] == np.tile(turns, 2)).all(axis=0)
        self._keep = self.reduced >= 0

    def expand(self, values: np.ndarray) -> np.ndarray:
        """State array of the mixed space from the unknowns (unknowns,)."""
        return np.where(self._keep, self.signs * values[self.reduced], 0.0)

    def collected(self, vector: np.ndarray) -> np.ndarray:
        """(unknowns,) of a vector (dofs,) of derivatives by the nodes' values."""
        keep = self._keep
        return np.bincount(self.reduced[keep], (self.signs * vector)[keep], minlength=self.unknowns)

    def define_gauge(self, windows: "list[Window]", centre: float) -> None:
        """The section frame's conditions are linear in u and (e, k): mean displacement (3) and mean rotation
        (3) over the windows, which make up a pitch around X1 = `centre`, are zero; as many of them as are not
        so by symmetry.

        The facets' points also lie along X1, where the shears e2 and e3 displace them sideways by X1 e: a
        frame fitted over a pitch follows mostly the tangent, and so must the gauge.
        """
        problem = self.problem
        area, size = sum(each.integral.area for each in windows), problem.segment.width
        strains, gauge = np.zeros((6, 6)), sp.csr_matrix((self.unknowns, 6))
        for each in windows:
            integral, shift = each.integral, each.shift
            w, first = integral.weights / area, integral.first / area
            first[:, 0] += (shift - centre) * w
            rows = np.zeros((6, len(w), 3))
            rows[[0, 1, 2], :, [0, 1, 2]] = w
            for i, (a, b) in enumerate(((1, 2), (2, 0), (0, 1)), start=3):  # (X x u)_i = X_a u_b - X_b u_a
                rows[i, :, b], rows[i, :, a] = first[:, a] / size, -first[:, b] / size
            X1 = problem.nodes[integral.nodes, 0] * problem.turns[each.number, 0] + shift - centre
            strains += (X1 @ first[:, 0]) / size * _SIDEWAYS
            dofs = problem.displacement_dofs[integral.nodes]
            columns = self.reduced[dofs]
            signs = self.chi[each.number] * problem.turns[each.number] * self.signs[dofs]
            moving = columns >= 0
            for i in np.flatnonzero(self._conditions):
                entries = (rows[i] * signs)[moving], (columns[moving], np.full(moving.sum(), i))
                gauge += sp.coo_matrix(entries, shape=gauge.shape).tocsr()
        self.gauge, self.gauge_strains = gauge[:, self._conditions], strains[self._conditions]
        self._pattern: BorderedPattern | None = None

    def bordered(
        self, matrix: Any, rows: Sequence = (), columns: Sequence = (), values: Sequence = ()
    ) -> sp.csr_matrix:
        """The unknowns' matrix bordered by the gauge, of that of the mixed space and of entries of the
        unknowns."""
        if self._pattern is None:
            self._pattern = BorderedPattern(matrix, self)
        return self._pattern.filled(matrix.getValuesCSR()[2], rows, columns, values)


class BorderedPattern:
    """Where the entries of a matrix of the mixed space go in that of a class's unknowns, bordered by the
    gauge.

    It grows by the entries of walls that touch, and keeps them when they part: a new pattern costs a new
    analysis.
    """

    def __init__(self, matrix: Any, of: SymmetryClass):
        indptr, indices, _ = matrix.getValuesCSR()
        reduced, gauge = of.reduced, of.gauge
        owners = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        rows, columns = reduced[owners], reduced[indices]
        self._keep = np.flatnonzero((rows >= 0) & (columns >= 0))
        self._signs = (of.signs[owners] * of.signs[indices])[self._keep]
        border, self._size = gauge.tocoo(), sum(gauge.shape)
        i, j, corner = (
            border.row.astype(np.int64),
            border.col + gauge.shape[0],
            np.arange(gauge.shape[0], self._size),
        )
        self._border = np.concatenate([border.data, border.data, np.zeros(len(corner))])
        rows = np.concatenate([rows[self._keep], i, j, corner])
        known = self._key(rows, np.concatenate([columns[self._keep], j, i, corner]))
        self._keys, self._place = np.unique(known, return_inverse=True)
        self._index()

    def _key(self, rows, columns):
        return rows * np.int64(self._size) + columns

    def _grow(self, keys):
        """Put new `keys`, each once and in their order, between those that are there."""
        at = np.searchsorted(self._keys, keys)
        self._place += np.cumsum(np.bincount(at, minlength=len(self._keys)))[self._place]
        self._keys = np.insert(self._keys, at, keys)
        self._index()

    def _index(self):
        self._indices = (self._keys % self._size).astype(np.int32)
        self._indptr = np.searchsorted(self._keys, self._size * np.arange(self._size + 1)).astype(np.int32)

    def filled(
        self, data: np.ndarray, rows: Sequence = (), columns: Sequence = (), values: Sequence = ()
    ) -> sp.csr_matrix:
        """CSR matrix of the values `data` of the mixed space's matrix and of entries (row, column, value) of
        the unknowns.

        Its `indices` are the same array until the pattern grows.
        """
        key = self._key(np.asarray(rows, np.int64), np.asarray(columns, np.int64))
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        new = self._keys[place] != key
        if new.any():
            self._grow(np.unique(key[new]))
            place = np.searchsorted(self._keys, key)
        entries = np.concatenate([data[self._keep] * self._signs, self._border, values])
        summed = np.bincount(np.concatenate([self._place, place]), entries, len(self._keys))
        matrix = sp.csr_matrix((summed, self._indices, self._indptr), shape=(self._size, self._size))
        matrix.indices, matrix.indptr = self._indices, self._indptr  # not views, which would be new ones
        return matrix
