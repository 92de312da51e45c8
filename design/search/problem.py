"""The least-squares problem: what a vector of variables stands for, how far its shapes are from what is
wanted, and how that changes with every variable, exactly."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.left_jacobian import LeftJacobian
from pneunet.base.materials.laws import of_modulus
from pneunet.design.search.aims import Aim
from pneunet.design.search.space import Variable
from pneunet.design.target.extraction import Extracted
from pneunet.geometry.parameters import PASSIVE, TWISTING, Segment
from pneunet.reduced.rod.clearance import allowed_stretch
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.loaded_slopes import loaded
from pneunet.reduced.rod.piece_slopes import (
    FIELD_AT,
    FIELDS,
    OF_LAWS,
    cell_states,
    cells_length_by,
    piece_twists,
    strain_slopes,
)
from pneunet.reduced.rod.placing import PlacedRod, Stations
from pneunet.reduced.rod.states import VARIABLES, StatesWithSlopes

#: mm of misfit per mm that facing walls would overlap: contact is not designed into
TOUCH = 5.0
#: part of the strain that walls are allowed from which on it counts, and mm of misfit per allowed strain
#: beyond: steep, so that the limit itself is kept
NEARLY, TEAR = 0.95, 100.0
BEYOND = 20.0  # mm of misfit per width of what the law knows that a segment lies outside of it
#: mm of misfit per large change that a dimension leaves its start by: decides where the target does not
PREFERENCE = 0.02


@dataclass(frozen=True, eq=False)
class Body:
    """segments (chambers 1) with real numbers of chambers (n,), at pressures (aims, n) in MPa, and the base's
    rotation (3, 3) and origin (3,), mm."""

    segments: tuple[Segment, ...]
    counts: np.ndarray
    pressures: np.ndarray
    rotation: np.ndarray
    origin: np.ndarray

    @property
    def base_pose(self) -> np.ndarray:
        """(4, 4)"""
        return se3.make_pose(self.rotation, self.origin)

    def value(self, variable: Variable) -> float:
        """That of a Variable."""
        i = variable.segments[0]
        if variable.name == "chambers":
            return float(self.counts[i])
        if variable.name == "mu":
            return self.segments[i].material.mu
        if variable.name == "pressure":
            return float(self.pressures[variable.aims[0], i])
        return float(getattr(self.segments[i], variable.name))

    def changed(self, variables: Sequence[Variable], x: np.ndarray) -> "Body":
        """With the values x (n,) of variables; InputError where that cannot be built."""
        counts, pressures = self.counts.copy(), self.pressures.copy()
        changes: list[dict] = [{} for _ in self.segments]
        for variable, value in zip(variables, x.tolist()):
            if variable.name == "mu":
                material = of_modulus(self.segments[variable.segments[0]].material, value)
            for i in variable.segments:
                if variable.name == "chambers":
                    counts[i] = value
                elif variable.name == "pressure":
                    pressures[list(variable.aims), i] = value
                elif variable.name == "mu":
                    changes[i]["material"] = material
                else:
                    changes[i][variable.name] = value
        segments = tuple(replace(s, **change) if change else s for s, change in zip(self.segments, changes))
        return replace(self, segments=segments, counts=counts, pressures=pressures)


@dataclass(frozen=True, eq=False)
class Shape:
    """One shape of a Body and how it changes: placed stations; turns, moves (s, 3, n, fields): their
    derivatives by FIELDS of every segment; base_turns, base_moves (s, 3, 3): by turns of the base about the
    axes of space, besides those of a rigid body; states: of the cells; strain_moves (s, 3, n, 6): derivatives
    of the points by the cells' free strains, where they were asked for."""

    placed: Stations
    turns: np.ndarray
    moves: np.ndarray
    base_turns: np.ndarray
    base_moves: np.ndarray
    states: StatesWithSlopes
    strain_moves: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A Body with its Shapes; residual (m,) and jacobian (m, n) as least squares take them; misfit: the part
    of the residual's squared norm that is the mean squared distance, mm^2."""

    body: Body
    shapes: tuple[Shape, ...]
    residual: np.ndarray
    jacobian: np.ndarray
    misfit: float


@dataclass(frozen=True, eq=False)
class Problem:
    """The problem around a Body: variables, then turns of the base about axes (the columns of `turns` (3, t),
    in base axes) are what is sought. gravity (3,) in mm/s2; everything: derivatives by fields
    that do not vary are wanted too. may_touch: facing walls may."""

    aims: tuple[Aim, ...]
    pieces: tuple[Extracted, ...]
    law: SegmentLaw
    variables: tuple[Variable, ...]
    body: Body
    turns: np.ndarray
    gravity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    everything: bool = False
    may_touch: bool = False

    @cached_property
    def x(self) -> np.ndarray:
        """What is sought, at the Body."""
        return np.array([self.body.value(v) for v in self.variables] + [0.0] * self.turns.shape[1])

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of x: lowest, highest, large changes."""
        free, (v, inf) = self.turns.shape[1], (self.variables, np.inf)
        low, high = [a.low for a in v] + [-inf] * free, [a.high for a in v] + [inf] * free
        return np.array(low), np.array(high), np.array([a.scale for a in v] + [1.0] * free)

    def moved(self, x: np.ndarray) -> Body:
        """The Body that x stands for; InputError where it cannot be built."""
        count = len(self.variables)
        body = self.body.changed(self.variables, x[:count])
        return replace(body, rotation=body.rotation @ se3.exp_rotation(self.turns @ x[count:]))

    def evaluate(self, x: np.ndarray) -> Evaluation | None:
        """The Evaluation at x, or None where there is no such body or no equilibrium."""
        try:
            body = self.moved(x)
            shapes = tuple(self._shape(body, i, aim) for i, aim in enumerate(self.aims))
        except (InputError, ConvergenceError):
            return None
        turned = np.concatenate([self.turns @ x[len(self.variables) :], np.zeros(3)])
        omega = self.body.rotation @ LeftJacobian(turned[None]).matrix[0, :3, :3] @ self.turns
        parts = [self._misfits(i, shape, body, omega) for i, shape in enumerate(shapes)]
        misfit = sum(float(r @ r) for r, _ in parts) / len(parts)
        parts = [(r / np.sqrt(len(shapes)), J / np.sqrt(len(shapes))) for r, J in parts]
        parts += [self._doubts(i, shape) for i, shape in enumerate(shapes)]
        parts += [self._unseen_twists(body, shapes[0]), self._walls(body, shapes), self._preferences(x)]
        residual, jacobian = np.concatenate([r for r, _ in parts]), np.vstack([J for _, J in parts])
        return Evaluation(body, shapes, residual, jacobian, misfit)

    def _shape(self, body, number, aim):
        n, pressures = len(body.segments), body.pressures[number]
        names = FIELDS if self.everything else {v.name for v in self.variables}
        states = cell_states(self.law, body.segments, pressures, names)
        by_laws = states.strains_by
        by_base = by_strains = None
        if self.gravity.any():
            found = loaded(
                body.segments, body.counts, self.law, pressures, body.base_pose, self.gravity, names
            )
            twists, by, by_base, by_strains = found.twists, found.by, found.by_turn, found.by_strains
        else:
            twists, own = piece_twists(body.segments, states.strains, by_laws, body.counts)
            by = _spread(own, n)
            if self.everything:
                by_strains = _spread(strain_slopes(body.segments, states.strains, body.counts), n)
        placed = aim.stations(PlacedRod(twists, body.base_pose))
        turns, moves = _chained(placed.turns, by), _chained(placed.moves, by)
        if by_base is None:
            base_turns = base_moves = np.zeros((len(moves), 3, 3))
        else:
            base_turns, base_moves = _chained(placed.turns, by_base), _chained(placed.moves, by_base)
        strain_moves = _chained(placed.moves, by_strains) if self.everything else None
        return Shape(placed, turns, moves, base_turns, base_moves, states, strain_moves)

    def columns(self, by_fields: np.ndarray, aim: int) -> np.ndarray:
        """(..., n) derivatives by x, those of the base 0, from those (..., segments, fields) of one shape."""
        out = np.zeros((*by_fields.shape[:-2], len(self.x)))
        for j, v in enumerate(self.variables):
            if v.name != "pressure" or aim in v.aims:
                out[..., j] = by_fields[..., list(v.segments), FIELD_AT[v.name]].sum(axis=-1)
        return out

    def _misfits(self, number, shape, body, omega):
        aim, placed = self.aims[number], shape.placed
        turns, moves = self.columns(shape.turns, number), self.columns(shape.moves, number)
        if omega.shape[1]:
            count = len(self.variables)
            turns[:, :, count:] = omega + shape.base_turns @ omega
            moves[:, :, count:] = (shape.base_moves - se3.hat(placed.points - body.origin)) @ omega
        return aim.misfit(placed), aim.slopes(placed, turns, moves)

    def _doubts(self, number, shape):
        """BEYOND times how far each segment lies outside what the law knows, its limit point included."""
        states = shape.states
        segment, what = np.nonzero(states.excess)
        by = np.zeros((len(segment), len(states.excess), len(FIELDS)))
        by[np.arange(len(segment))[:, None], segment[:, None], OF_LAWS] = states.excess_by[segment, what]
        return BEYOND * states.excess[segment, what], BEYOND * self.columns(by, number)

    def _unseen_twists(self, body, shape):
        """Misfit at the body's edge, mm, of twists that no point of the target shows."""
        rows, slopes = [], []
        for i, (piece, segment) in enumerate(zip(self.pieces, body.segments)):
            if piece.kind == TWISTING and not piece.twist_seen:
                k1, count = shape.states.strains[i, 3], body.counts[i]
                by = np.zeros((len(body.segments), len(FIELDS)))
                half, length = segment.width / 2, count * segment.pitch
                turn = k1 * length - piece.twist * piece.length
                by[i] = half * k1 * cells_length_by(segment, count)
                by[i, OF_LAWS] += half * length * shape.states.strains_by[i, 3]
                by[i, FIELD_AT["width"]] += turn / 2
                rows.append(half * turn)
                slopes.append(self.columns(by, 0))
        return np.array(rows), np.array(slopes).reshape(len(rows), len(self.x))

    def _walls(self, body, shapes):
        """TOUCH times by how much facing walls of each segment are expected to pass through each other, and
        TEAR times by how much they are expected to stretch too far."""
        rows, slopes = [], []
        for number, shape in enumerate(shapes):
            for i, segment in enumerate(body.segments):
                for value, by_value in (
                    () if segment.kind == PASSIVE else self._beyond(segment, i, shape.states)
                ):
                    if value > 0:
                        by = np.zeros((len(body.segments), len(FIELDS)))
                        by[i, OF_LAWS] = by_value
                        rows.append(value)
                        slopes.append(self.columns(by, number))
        return np.array(rows), np.array(slopes).reshape(len(rows), len(self.x))

    def _beyond(self, segment, i, states):
        """Yields (mm of misfit where positive, its derivatives) of each limit of the i-th segment's walls."""
        if not self.may_touch:
            overlap = states.closed[i] - 1
            by = segment.gap * states.closed_by[i]
            by[VARIABLES.index("gap")] += overlap
            yield TOUCH * segment.gap * overlap, TOUCH * by
        allowed = allowed_stretch(segment) - 1
        if np.isfinite(allowed):
            strain = (states.stretch[i] - 1) / allowed
            yield TEAR * (strain - NEARLY), TEAR / allowed * states.stretch_by[i]

    def _preferences(self, x):
        drawn = [(j, v.start, PREFERENCE / v.scale) for j, v in enumerate(self.variables) if v.start]
        slopes = np.zeros((len(drawn), len(x)))
        for row, (j, _, weight) in zip(slopes, drawn):
            row[j] = weight
        return np.array([weight * (x[j] - start) for j, start, weight in drawn]), slopes


def _spread(own, n):
    """(3 n, 6, n, c) derivatives by every segment, of those (3 n, 6, c) of pieces by their own segment."""
    out = np.zeros((*own.shape[:2], n, own.shape[2]))
    pieces = np.arange(len(own))
    out[pieces, :, pieces // 3] = own
    return out


def _chained(by_twists, twists_by):
    """(s, 3, ...) of derivatives (s, 3, 6 m) by twists and theirs (m, 6, ...)."""
    s, _, count = by_twists.shape
    flat = by_twists.reshape(3 * s, count) @ twists_by.reshape(count, -1)
    return flat.reshape(s, 3, *twists_by.shape[2:])
