"""A factorised tangent brought up to date with which walls touch: a low-rank update (Woodbury).

A point of a wall that comes into touch adds its stiffness times g g^T to the tangent, g the gradient of its
gap; one that leaves takes it away. Its column K^-1 g costs one solve, much less than a factorisation, and
serves until the next one.
"""

from collections.abc import Callable

import numpy as np

#: {point of a wall, its side, facet and Gauss point: N/mm}
Stiffnesses = dict[tuple[int, int, int], float]
#: of the largest stiffness of a point: smaller changes are left to the iterations
SMALLEST = 0.02


class ContactUpdate:
    """K^-1 of a factorised tangent K, corrected to (K + U^T D U)^-1: U the gap gradients (m, n), D stiffness
    changes (m,) in N/mm."""

    def __init__(
        self,
        stiffnesses: Stiffnesses | None = None,
        most: int = 200,
        total: Callable[[np.ndarray], np.ndarray] = lambda part: part,
    ):
        """stiffnesses: {point: N/mm} in the factorised tangent. most: columns above which a factorisation is
        cheaper. total: sums over the ranks that hold parts of (n,)."""
        self._most, self._total = most, total
        self._then, self._places = stiffnesses or {}, {}
        self._rows = self._columns = None
        self._changes = np.zeros(0)

    def renew(
        self,
        now: Stiffnesses,
        gradients: Callable[[list], np.ndarray],
        solve: Callable[[np.ndarray], np.ndarray],
    ) -> bool | None:
        """Take the present stiffnesses {point: N/mm}; True where the tangent has changed, False where not,
        None where a new factorisation is due.

        gradients(points) -> (m, n) of their gaps; solve((n, m)) -> K^-1 times it.
        """
        then, places = self._then, self._places
        largest = max([*now.values(), *then.values()], default=0.0)
        changes = {p: now.get(p, 0.0) - then.get(p, 0.0) for p in sorted(now.keys() | then.keys())}
        new = [p for p, change in changes.items() if p not in places and abs(change) > SMALLEST * largest]
        if len(places) + len(new) > self._most:
            return None
        if new:
            rows = gradients(new)
            columns = solve(rows.T)
            self._rows = rows if self._rows is None else np.vstack([self._rows, rows])
            self._columns = columns if self._columns is None else np.hstack([self._columns, columns])
            places |= {p: len(places) + i for i, p in enumerate(new)}
        before, self._changes = self._changes, np.array([changes.get(p, 0.0) for p in places])
        return len(before) < len(places) or bool((np.abs(before - self._changes) > SMALLEST * largest).any())

    def corrected(self, solution: np.ndarray) -> np.ndarray:
        """(K + U^T D U)^-1 r from `solution` (n,) = K^-1 r."""
        if self._rows is None:
            return solution
        known = self._total(self._rows @ np.column_stack([self._columns, solution]))
        inner = np.eye(len(self._changes)) + self._changes[:, None] * known[:, :-1]
        return solution - self._columns @ np.linalg.solve(inner, self._changes * known[:, -1])
