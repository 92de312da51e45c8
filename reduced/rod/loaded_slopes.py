"""A rod under gravity and how it changes with dimensions, counts, pressures and its base: the equilibrium's
derivative by the implicit function theorem.

Unknown are the elements' twists X over their whole length: with them held, a change of a segment changes its
sections' wrenches and its weight alone. Both are differenced at held twists (a law's forces have no slopes of
their own); how the rod answers is exact.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.materials.laws import of_modulus
from pneunet.base.strains import RodStrains
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import PASSIVE, Segment
from pneunet.geometry.sections import rotation
from pneunet.reduced.rod.elements import TWIST_ORDER, NodalLoads, RodElements
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.piece_slopes import FIELD_AT, FIELDS
from pneunet.reduced.rod.rod import Rod, rod_pieces

#: of the length: what elements may leave
TOLERANCE = 1e-4
#: mm, degrees, of a number of chambers, MPa of a modulus; MPa of a pressure: of the differences
STEP, PRESSURE_STEP = 1e-3, 2e-5
#: of FIELDS, those that no section depends on
OF_LENGTHS = ("plain_length", "chambers")


@dataclass(frozen=True, eq=False)
class Loaded:
    """twists (e, 6): of the elements over their whole length; by (e, 6, n, fields): derivatives by FIELDS of
    every segment; by_turn (e, 6, 3): by turns of the base about the axes of space; by_strains (e, 6, n, 6):
    by the free strains of every segment's cells."""

    twists: np.ndarray
    by: np.ndarray
    by_turn: np.ndarray
    by_strains: np.ndarray


def loaded(
    segments: Sequence[Segment],
    counts: np.ndarray,
    law: SegmentLaw,
    pressures: np.ndarray,
    base_pose: np.ndarray,
    gravity: np.ndarray,
    names: Collection[str],
) -> Loaded:
    """The Loaded of n segments with real numbers of chambers (n,) at pressures (n,) in MPa under gravity (3,)
    in mm/s2; derivatives by those of FIELDS that are among `names` at least. ConvergenceError where no stable
    equilibrium follows."""
    laws = [law] * len(segments)
    rod = Rod(rod_pieces(segments, laws, pressures, counts), base_pose)
    line = rod.equilibrium(DeadLoads(gravity=tuple(gravity)), tolerance=TOLERANCE).line
    return _Balance(segments, counts, law, pressures, rod, line, gravity).answer(names)


class _Balance:
    def __init__(self, segments, counts, law, pressures, rod, line, gravity):
        self.segments, self.counts, self.law, self.pressures = segments, counts, law, pressures
        self.rod, self.gravity, self.poses, h = rod, gravity, line.poses, np.diff(line.s)
        ends = np.cumsum(rod.lengths)
        self.owner = np.minimum(np.searchsorted(ends, line.s[:-1] + h / 2), len(ends) - 1)
        self.elements = RodElements(h, [rod.pieces[i] for i in self.owner], rod.base_pose)
        self.x = line.strains.twist_vector
        self.twists = h[:, None] * self.x
        mass = h * np.array([rod.pieces[i].mass for i in self.owner])
        centres = np.array([(0.0, *rod.pieces[i].mass_centre) for i in self.owner])
        self.masses = np.column_stack([mass, mass[:, None] * centres])
        self.loads = NodalLoads(len(h))
        for node, weights in enumerate(self._nodal(self.masses)):
            self.loads.forces[node] = weights[0] * gravity
            self.loads.spreads[node] = np.outer(weights[1:], gravity)

    def _nodal(self, masses):
        """(e, 4, ...) of the elements' ends, of elements' masses and first moments (e, 4, ...)."""
        out = masses / 2
        out[:-1] += masses[1:] / 2
        return out

    def answer(self, names):
        n, e = len(self.segments), len(self.x)
        wrenches = [np.zeros((e, 6, n, len(FIELDS))), np.zeros((e, 6, 3)), np.zeros((e, 6, n, 6))]
        masses = np.zeros((e, 4, n, len(FIELDS)))
        stiffness = self.elements.stiffnesses(self.x)
        for i, segment in enumerate(self.segments):
            own = self.owner // 3 == i
            for name in FIELDS:
                if name in names and not (segment.kind == PASSIVE and name in ("chambers", "pressure")):
                    k = FIELD_AT[name]
                    wrenches[0][own, :, i, k], masses[own, :, i, k] = self._slope(i, own, name)
            if segment.kind != PASSIVE:
                cells = self.owner == 3 * i + 1
                # wrenches depend on the strains less the free ones
                turn = np.kron(np.eye(2), rotation(segment))[TWIST_ORDER][:, range(6)]
                wrenches[2][cells, :, i] = -stiffness[cells] @ turn
        loading = [self._of_masses(masses), self._of_turns(), np.zeros((e, 6, n, 6))]
        found = self.elements.responses(
            self.x,
            self.loads,
            np.concatenate([w.reshape(e, 6, -1) for w in wrenches], axis=2),
            np.concatenate([a.reshape(e, 6, -1) for a in loading], axis=2),
        )
        if found is None:
            raise ConvergenceError("rod: at the brink of buckling, where it answers to nothing smoothly")
        cut = n * len(FIELDS)
        by, by_turn, by_strains = np.split(found, [cut, cut + 3], axis=2)
        return Loaded(self.twists, by.reshape(e, 6, n, -1), by_turn, by_strains.reshape(e, 6, n, 6))

    def _slope(self, i, own, name):
        """Derivatives of the wrenches (o, 6) and masses (o, 4) of a segment's own elements by one of FIELDS,
        at held twists."""
        step = PRESSURE_STEP if name == "pressure" else STEP
        sides = []
        for sign in (-1, 1):
            try:
                sides.append((sign * step, self._local(i, own, name, sign * step)))
            except (InputError, ConvergenceError):
                sides.append((0.0, self._local(i, own, name, 0.0)))
        (low, before), (high, after) = sides
        if high == low:
            return np.zeros((own.sum(), 6)), np.zeros((own.sum(), 4))
        return tuple((b - a) / (high - low) for a, b in zip(before, after))

    def _local(self, i, own, name, step):
        """(wrenches (o, 6), masses and first moments (o, 4)) of a segment's elements after a step."""
        segment, count, P = self.segments[i], self.counts[i], self.pressures[i]
        if name == "chambers":
            count = count + step
        elif name == "pressure":
            P = P + step
        elif name == "mu":
            segment = replace(segment, material=of_modulus(segment.material, segment.material.mu + step))
        else:
            segment = replace(segment, **{name: getattr(segment, name) + step})
        if name in OF_LENGTHS:  # sections stay as they are
            lengths, _ = free_pieces([segment], RodStrains.of_vector(np.eye(6)[:1]), [count])
            pieces = [replace(p, length=length) for p, length in zip(self.rod.pieces[3 * i :], lengths)]
        else:
            pieces = rod_pieces([segment], [self.law], [P], [count], clamped=i == 0)
        wrenches, masses = np.empty((own.sum(), 6)), np.empty((own.sum(), 4))
        place = self.owner[own] - 3 * i
        for j, piece in enumerate(pieces):
            rows = place == j
            h = piece.length / rows.sum()
            q = (self.twists[own][rows] / h)[:, TWIST_ORDER]
            wrenches[rows] = piece.law.force(q, piece.pressure)[:, TWIST_ORDER]
            masses[rows] = piece.mass * h * np.array([1.0, 0.0, *piece.mass_centre])
        return wrenches, masses

    def _of_masses(self, masses):
        """(e, 6, ...) loads' wrenches at the nodes of elements' masses (e, 4, ...)."""
        nodal, (R, p) = self._nodal(masses), (self.poses[1:, :3, :3], self.poses[1:, :3, 3])
        flat = nodal.reshape(len(nodal), 4, -1)
        arm = p[:, :, None] * flat[:, :1] + R @ flat[:, 1:]
        moment = -se3.hat(self.gravity) @ arm
        force = np.broadcast_to(self.gravity[:, None], arm.shape) * flat[:, :1]
        return np.concatenate([moment, force], axis=1).reshape(len(nodal), 6, *masses.shape[2:])

    def _of_turns(self):
        """(e, 6, 3) loads' wrenches when the whole rod has turned about an axis of space through its base and
        is looked at from there: gravity has turned the other way."""
        nodal, (R, p) = self._nodal(self.masses), (self.poses[1:, :3, :3], self.poses[1:, :3, 3])
        arm = p * nodal[:, :1] + (R @ nodal[:, 1:, None])[..., 0]
        change = se3.hat(self.gravity)  # columns: -axis x gravity
        moment = se3.hat(arm) @ change
        return np.concatenate([moment, nodal[:, :1, None] * change], axis=1)
