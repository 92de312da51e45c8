"""What walls that come into touch, or part, do to a correction by a factorised tangent K.

A point of a wall pushes along g, the gradient of its gap, with a force that depends on its overlap alone
(hifi.contact.penalty). K knows it as a spring, of the stiffness that it had then. So the correction is d =
K^-1 (f + sum h g): h is what the push changes by, other than by that spring, while the gap opens by y = g .
d. Only points whose h matters need their column K^-1 g; it costs one solve, much less than a factorisation,
and serves until the next. Of them y = y_0 + C h: a small system for their pushes, the minimum of an energy.
Points that d would bring into touch join, until none is left.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from pneunet.hifi.contact.penalty import PenaltyLaw

#: point of a wall: its side, facet and Gauss point
Name = tuple[int, int, int]
#: of the norm of the forces that a correction balances: smaller changes of pushes are left to the iterations,
#: and a hundredth of it is what the small system may lack
SMALLEST = 0.01
#: of the largest slope of a push: smaller changes are none
CHANGED = 0.02
#: rounds in which points join; iterations of the small system, and how often one is halved
ROUNDS, ITERATIONS, HALVINGS = 6, 40, 12
#: of its largest entry, by which a flexibility may be negative
NEGATIVE = 1e-3


def _none():
    return np.zeros(0)


@dataclass(frozen=True)
class WallPoints:
    """Points (m,) of walls that touch or nearly do: names; area (mm2, undeformed) and overlap (mm), negative
    while they are apart; stiffness (MPa/mm) and onset (mm) of their PenaltyLaw."""

    names: list[Name] = field(default_factory=list)
    area: np.ndarray = field(default_factory=_none)
    overlap: np.ndarray = field(default_factory=_none)
    stiffness: np.ndarray = field(default_factory=_none)
    onset: np.ndarray = field(default_factory=_none)

    def of(self, rows: np.ndarray) -> "WallPoints":
        """Those in these rows."""
        columns = (a[rows] for a in (self.area, self.overlap, self.stiffness, self.onset))
        return WallPoints([self.names[i] for i in rows], *columns)

    def joined(self, others: "WallPoints") -> "WallPoints":
        """These, then the others."""
        pairs = (
            (getattr(self, name), getattr(others, name)) for name in ("area", "overlap", "stiffness", "onset")
        )
        return WallPoints(self.names + others.names, *map(np.concatenate, pairs))

    def apart(self, names: list[Name]) -> "WallPoints":
        """These, and further ones by name, too far apart to push."""
        nothing = np.zeros(len(names))
        return self.joined(WallPoints(names, nothing, nothing, nothing, nothing + 1))

    def pushes(self, opening: float | np.ndarray = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(energies (m,) in N mm, pushes in N, their slopes by the overlap in N/mm) when gaps have opened by
        `opening` (m,) in mm."""
        law = PenaltyLaw(self.stiffness, self.onset, np.nan)
        energy, pressure, slope = law(self.overlap - opening)
        return self.area * energy, self.area * pressure, self.area * slope

    @property
    def slopes(self) -> dict[Name, float]:
        """Of the pushes, N/mm."""
        return dict(zip(self.names, self.pushes()[2].tolist()))


class ContactCorrection:
    """Corrections by the inverse of a factorised tangent in which the points `then` pushed.

    most: columns above which a factorisation is cheaper. total: sums over the ranks that hold parts of (n,).
    """

    def __init__(
        self,
        then: WallPoints = WallPoints(),
        most: int = 200,
        total: Callable[[np.ndarray], np.ndarray] = lambda part: part,
    ):
        self._most, self._total = most, total
        self._then = self._slopes = then.slopes
        #: {point: place of its column K^-1 g among those (n, columns)}
        self._places: dict[Name, int] = {}
        self._columns = np.zeros((0, 0))
        self._points, self._springs = WallPoints(), np.zeros(0)

    def renew(
        self,
        now: WallPoints,
        gradients: Callable[[list[Name]], sp.csr_matrix],
        solve: Callable[[np.ndarray], np.ndarray],
    ) -> bool | None:
        """Take the points that touch now, or nearly do; True where slopes of pushes have changed, False where
        not, None where a new factorisation is due.

        gradients(names) -> sparse (m, n) of their gaps; solve((n, m)) -> K^-1 times it.
        """
        then, before, self._slopes = self._then, self._slopes, now.slopes
        self._points = now.apart([name for name in then if name not in self._slopes])
        self._springs = np.array([then.get(name, 0.0) for name in self._points.names])
        self._gradients, self._solve = gradients(self._points.names), solve
        if len(self._places) > self._most:
            return None
        least = CHANGED * max([*self._slopes.values(), *then.values()], default=0.0)
        either = self._slopes.keys() | before.keys()
        return any(abs(self._slopes.get(p, 0.0) - before.get(p, 0.0)) > least for p in either)

    def corrected(self, solution: np.ndarray, size: float, straight: bool = False) -> np.ndarray:
        """d (n,) from `solution` = K^-1 f; size: norm of f. straight: pushes change by their present slopes,
        so that d is linear in f."""
        if not self._points.names:
            return solution
        enough, names = SMALLEST * size, self._points.names
        free = y = self._total(self._gradients @ solution)
        d = solution
        for _ in range(ROUNDS):
            known = np.array([name in self._places for name in names])
            wanted = (np.abs(self._changes(y, straight)) > enough) & ~known
            if not wanted.any() and d is not solution:
                break
            self._solve_for(np.flatnonzero(wanted))
            rows = np.flatnonzero(known | wanted)
            if not len(rows):
                break
            columns = self._columns[:, [self._places[names[i]] for i in rows]]
            flexibility = self._total(self._gradients @ columns)
            own = self._points.of(rows), free[rows], flexibility[rows], self._springs[rows]
            changes = None if straight else _by_law(*own, enough / 100)
            changes = _by_slopes(*own) if changes is None else changes
            d, y = solution + columns @ changes, free + flexibility @ changes
        return d

    def _changes(self, opening, straight):
        """(m,) N: h of all points whose gaps open by (m,)."""
        _, push, slope = self._points.pushes()
        change = -slope * opening if straight else self._points.pushes(opening)[1] - push
        return change + self._springs * opening

    def _solve_for(self, rows):
        """The columns of further points."""
        if len(rows):
            columns = self._solve(self._gradients[rows].toarray().T)
            self._columns = np.hstack([self._columns, columns]) if self._places else columns
            self._places |= {self._points.names[i]: len(self._places) + n for n, i in enumerate(rows)}


def _by_slopes(points, free, flexibility, springs):
    """(m,) h of points whose pushes have the slopes that they have now."""
    changes = springs - points.pushes()[2]
    return changes * np.linalg.solve(np.eye(len(free)) - flexibility * changes, free)


def _by_law(points, free, flexibility, springs, enough):
    """(m,) h of points; None where there is no such minimum or it is not found.

    h = t - t_0 + springs y. Without the springs y = loose + H t, and the pushes t minimise t H t / 2 +
    energy(overlap - y): Newton's iterations, halved where the energy would rise, until t is the law's to
    `enough`.
    """
    before = points.pushes()[1]
    own = np.eye(len(free)) - flexibility * springs
    loose, H = np.linalg.solve(own, free - flexibility @ before), np.linalg.solve(own, flexibility)
    if np.linalg.eigvalsh(H + H.T)[0] < -NEGATIVE * np.abs(H).max():
        return None  # without these pushes the body would be unstable

    def at(t):
        y = loose + H @ t
        energy, push, slope = points.pushes(y)
        return t, y, t @ H @ t / 2 + energy.sum(), push - t, slope

    t, y, energy, missing, slope = at(before)
    for _ in range(ITERATIONS):
        if np.linalg.norm(missing) <= enough:
            return t - before + springs * y
        step = np.linalg.solve(np.eye(len(t)) + slope[:, None] * H, missing)
        for halving in range(HALVINGS):
            part = 0.5**halving
            found = at(t + part * step)
            nearer = np.linalg.norm(found[3]) < np.linalg.norm(missing) / 2
            if nearer or found[2] <= energy - 1e-4 * part * (missing @ H @ step):
                break
        t, y, energy, missing, slope = found
    return None
