"""What a law says of exactly what was measured, with its own error bars."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from pneunet.base import se3
from pneunet.base.curve import Curve
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.design.measured.registration import line_of, register, turned_about
from pneunet.design.measured.table import ANGLE, CENTRELINE, DISPLACEMENT, MARKERS, STATIONS, Measurement
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import PASSIVE, Manipulator, Segment
from pneunet.reduced.rod.centreline import Centreline
from pneunet.reduced.rod.laws import SectionLaw, SegmentLaw
from pneunet.reduced.rod.prediction import predict

#: mm between the points of a predicted centreline
SPACING = 2.0


@dataclass(frozen=True, eq=False)
class ShiftedLaw(SegmentLaw):
    """A law whose free strains are off by `shift` (6,), its stiffness as it is: what an error bar means."""

    law: SegmentLaw
    shift: np.ndarray

    def of(self, segment: Segment) -> "ShiftedSection":
        return ShiftedSection(self.law.of(segment), self.shift)


@dataclass(frozen=True, eq=False)
class ShiftedSection:
    """The SectionLaw of a ShiftedLaw."""

    law: SectionLaw
    shift: np.ndarray

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        return self.law.free_strains(P) + self.shift

    def psi(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        return self.law.psi(q - self.shift, P)

    def force(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        return self.law.force(q - self.shift, P)

    def stiffness(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        return self.law.stiffness(q - self.shift, P)


@dataclass(frozen=True)
class Change:
    """What a casting may differ by from its design: modulus, a factor on every modulus of the body; wall, mm
    by which walls are thicker at the cavities' cost, all around but at the floor."""

    modulus: float = 1.0
    wall: float = 0.0

    def of_body(self, manipulator: Manipulator) -> Manipulator:
        """The Manipulator with its walls changed; InputError where that cannot be built."""
        return manipulator if not self.wall else Manipulator(tuple(map(self._of, manipulator.segments)))

    def _of(self, s):
        d = self.wall
        if s.kind == PASSIVE:
            return s
        return replace(
            s,
            wall=s.wall + d,
            cavity_thickness=s.cavity_thickness - 2 * d,
            top_wall=s.top_wall + d,
            chamber_height=s.chamber_height - d,
            side_wall=s.side_wall + d,
        )


@dataclass(frozen=True, eq=False)
class Predicted:
    """The rods of a design at the pressures of a measurement, in the target's coordinates.

    places (k, 3): where its markers sit on the body at rest, in the body's axes, mm. Every modulus times f is
    every load over f, the pressure among them: bodies of one shape are one body.
    """

    design: DesignFile
    law: SegmentLaw
    measured: Measurement
    places: np.ndarray

    def lines(self, change: Change = Change(), shifts: np.ndarray | None = None) -> list[Centreline]:
        """A Centreline a level; shifts (n, segments, 6): of the free strains. ConvergenceError where there is
        no equilibrium."""
        body, f = change.of_body(self.design.manipulator), change.modulus
        loads = self.design.loads
        over = DeadLoads(*(tuple(v / f for v in getattr(loads, part.name)) for part in fields(loads)))
        found = []
        for i, pressure in enumerate(self.measured.pressures.tolist()):
            laws: SegmentLaw | list[SegmentLaw] = self.law
            if shifts is not None:
                laws = [ShiftedLaw(self.law, shift) for shift in shifts[i]]
            level = self._scaled(pressure / f)
            found.append(predict(body, level, laws, SPACING, self.design.base_pose, over))
        return found

    def line(self, pressure: float, change: Change = Change()) -> Centreline | None:
        """The Centreline at a pressure (MPa) that need not have been measured; None where there is no
        equilibrium."""
        alone = replace(self, measured=replace(self.measured, pressures=np.array([pressure])))
        try:
            return alone.lines(change)[0]
        except (ConvergenceError, InputError):
            return None

    def _scaled(self, pressure):
        """Of every group of segments, the largest of them `pressure` (MPa)."""
        return self.design.scaled(pressure)

    def observed(self, lines: Sequence[Centreline]) -> np.ndarray:
        """(n, k, d) what would be measured of these lines, as Measurement.values, in the target's axes."""
        what = self.measured.what
        if what == CENTRELINE:
            return np.array([Curve(line.points).evenly(STATIONS) for line in lines])
        if what == ANGLE:
            ends = np.array([line.poses[[0, -1], :3, 0] for line in lines])
            cosine = np.clip(np.sum(ends[:, 0] * ends[:, 1], axis=1), -1, 1)
            return np.degrees(np.arccos(cosine))[:, None, None]
        points = np.array([self._markers(line) for line in lines])
        if what == DISPLACEMENT:
            return np.linalg.norm(points - points[0], axis=2, keepdims=True)
        return points

    def _markers(self, line):
        s = np.clip(self.places[:, 0], line.s[0], line.s[-1])
        local = self.places - s[:, None] * [1.0, 0.0, 0.0]
        poses = line.at(s)
        return (poses[:, :3, :3] @ local[:, :, None])[:, :, 0] + poses[:, :3, 3]

    @cached_property
    def plain(self) -> np.ndarray:
        """`observed` of the design as it is."""
        return self.observed(self.lines())

    @cached_property
    def moves(self) -> np.ndarray:
        """(e, n, k, d): what each error that the law admits does to what is observed, at half of its 90 %
        interval: of every strain of every segment, independent of the others; (0, ...) where the law knows
        none."""
        segments, n = self.design.manipulator.segments, len(self.measured.pressures)
        per_level = [self._scaled(p) for p in self.measured.pressures.tolist()]
        pressures = np.array([self.design.manipulator.pressures(p) for p in per_level])
        kinds = []
        for i, segment in enumerate(segments):
            if segment.kind == PASSIVE:
                continue
            halves = [self.law.half_width(segment, float(P)) for P in pressures[:, i]]
            if any(half is None for half in halves):
                return np.zeros((0, *self.plain.shape))
            for j in range(6):
                shift = np.zeros((n, len(segments), 6))
                shift[:, i, j] = [half[j] for half in halves if half is not None]
                kinds.append(shift)
        found = [self.observed(self.lines(shifts=shift)) - self.plain for shift in kinds]
        return np.array(found)

    @property
    def half_width(self) -> np.ndarray | None:
        """(n, k) half of the prediction's 90 % interval, mm or degrees; None where the law knows none."""
        return np.sqrt(np.sum(self.moves**2, axis=(0, 3))) if len(self.moves) else None


@dataclass(frozen=True, eq=False)
class Aligned:
    """values (n, k, d): a measurement in the coordinates of a prediction; pose (4, 4): what took it there
    (None of a scalar, whose value at rest was set right); off: RMS distance at rest, mm or degrees; turned:
    whether the turn about the line of the markers was taken from the loaded shapes, as rest does not show
    it."""

    values: np.ndarray
    pose: np.ndarray | None
    off: float
    turned: bool = False


def align(measured: Measurement, predicted: np.ndarray, as_is: bool = False) -> Aligned:
    """The Aligned measurement for a prediction (n, k, d). as_is: its coordinates are the prediction's.
    InputError where nothing was measured at rest, or fewer than two of the markers."""
    values = measured.values
    if not as_is and not measured.at_rest:
        raise InputError(
            f"{measured.path}: no row is at rest (the lowest is {1e3 * measured.pressures[0]:g} kPa):"
            " registration needs one at 0 kPa; or say --as-is where the coordinates are the design's own"
        )
    if as_is:
        return Aligned(values, np.eye(4) if values.shape[2] == 3 else None, _rms(values[0] - predicted[0]))
    if values.shape[2] == 1:
        moved = values - values[0] + predicted[0]
        return Aligned(moved, None, float(abs(values[0] - predicted[0]).max()))
    seen = np.isfinite(values[0]).all(axis=1)
    if seen.sum() < 2:
        raise InputError(
            f"{measured.path}: fewer than two markers were seen at rest: registration needs them"
        )
    pose = register(values[0, seen], predicted[0, seen])
    line = line_of(predicted[0, seen])
    moved = se3.transform(pose, values.reshape(-1, 3)).reshape(values.shape)
    if line is not None:
        there = np.isfinite(moved).all(axis=2)
        pose = turned_about(line, moved[there], predicted[there]) @ pose
        moved = se3.transform(pose, values.reshape(-1, 3)).reshape(values.shape)
    return Aligned(moved, pose, _rms(moved[0] - predicted[0]), line is not None)


def _rms(off):
    """Root of the mean squared length of vectors (k, d), those that are nan left out."""
    return float(np.sqrt(np.nanmean(np.sum(off**2, axis=-1))))


def one_marker(measured: Measurement) -> Measurement:
    """A single marker tells how far it has moved, in no coordinates; any other Measurement as it is."""
    if measured.what != MARKERS or len(measured.names) > 1:
        return measured
    moved = np.linalg.norm(measured.values - measured.values[0], axis=2, keepdims=True)
    return replace(measured, what=DISPLACEMENT, values=moved)
