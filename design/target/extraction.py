"""Extraction of twist, curvature, torsion and pitch from the pieces of a target (the paper's Fig. 8).

Every kind of piece is an arc of uniform Frenet curvature and torsion: a straight line has neither, a circle
no torsion. So one fit serves all: place the arc on the points by the best rigid fit, which has a closed form,
and search the one or two rates that are left. The placed arc also has frames, bent towards -z as a one-sided
segment bends, and the twist of a straight piece is the angle about it between the frames before and after.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from pneunet.base import se3
from pneunet.base.curve import Curve
from pneunet.base.frames import best_rigid_fit
from pneunet.base.strains import RodStrains
from pneunet.base.units import PER_MM_PER_M
from pneunet.design.target.target import BENDING, HELICAL, Piece, Target
from pneunet.geometry.parameters import PASSIVE, TWISTING

FIT_POINTS = 31


@dataclass(frozen=True)
class Arc:
    """An arc of uniform curvature (1/mm) and torsion (rad/mm) on points; frames (3, 3) at its ends; rms in
    mm."""

    length: float
    curvature: float
    twist: float
    start: np.ndarray
    end: np.ndarray
    rms: float


@dataclass(frozen=True)
class Extracted:
    """What one segment is to do, per deformed length: length mm, twist (tau or torsion) rad/mm, curvature
    1/mm.

    roll in degrees and group as a Piece's. twist_seen: the points (or frames) determine the twist. fit_rms:
    mm between the points and the piece of uniform rates. note: what had to be assumed.
    """

    kind: str
    length: float
    twist: float
    curvature: float
    fit_rms: float
    twist_seen: bool = True
    note: str = ""
    roll: float = 0.0
    group: int = 1

    @property
    def strains(self) -> RodStrains:
        """RodStrains of the wanted piece as an unstretched rod."""
        return RodStrains([1.0, 0, 0], [self.twist, self.curvature, 0.0])

    def table(self) -> dict:
        """By file key; the paper's and Frenet's numbers by their own names."""
        out = {"kind": self.kind, "length_mm": self.length} | rates(self.kind, self.strains)
        if self.roll:
            out["roll_deg"] = self.roll
        if self.group > 1:
            out["pressure_group"] = self.group
        return out | {"fit_rms_mm": self.fit_rms} | ({"note": self.note} if self.note else {})


def rates(kind: str, strains: RodStrains) -> dict[str, float]:
    """What a piece of a kind does per deformed length, by file key, from its RodStrains (3,)."""
    if kind == TWISTING:
        return {"tau_rad_per_mm": float(strains.twist_per_deformed_length)}
    table = {"curvature_per_m": float(strains.frenet_curvature) / PER_MM_PER_M}
    if kind == HELICAL:
        table["torsion_rad_per_m"] = float(strains.frenet_torsion) / PER_MM_PER_M
        table["cylinder_curvature_per_m"] = float(strains.helix_cylinder_curvature) / PER_MM_PER_M
        table["pitch_mm"] = float(strains.helix_pitch)
    return table


def _screw(curvature, twist):
    return np.array([twist, curvature, 0.0, 1.0, 0.0, 0.0])


def _arc_points(s, curvature, twist):
    return se3.exp_pose(s[:, None] * _screw(curvature, twist))[:, :3, 3]


def fit_arc(points: np.ndarray, kind: str, curvature: float | None = None, twist: float | None = None) -> Arc:
    """The `Arc` of a kind nearest to points (n, 3), paired by arc length, with given rates kept.

    twisting: curvature 0; bending: torsion 0. The search starts from the median curvature and torsion of the
    points, and, for a helix, from both hands.
    """
    curve = Curve.of(points)
    length, wanted = curve.length, curve.evenly(FIT_POINTS)
    s = np.linspace(0, length, FIT_POINTS)
    weights = np.ones(FIT_POINTS)
    given_curvature = 0.0 if kind in (TWISTING, PASSIVE) else curvature
    given_twist = 0.0 if kind in (TWISTING, PASSIVE, BENDING) else twist

    def rates_of(x):
        x = list(x / length)
        c = given_curvature if given_curvature is not None else x.pop(0)
        t = given_twist if given_twist is not None else x.pop(0)
        return c, t

    def misfit(x):
        arc = _arc_points(s, *rates_of(x))
        return (se3.transform(best_rigid_fit(arc, wanted, weights), arc) - wanted).ravel()

    _, curvatures, torsions = curve.frenet(length / 3)
    starts: list[list[float]] = [[]]
    if given_curvature is None:
        starts = [[length * np.median(curvatures)]]
    if given_twist is None:
        guess = np.median(torsions)
        starts = [
            start + [length * t] for start in starts for t in ((guess, -guess, 0.0) if guess else (0.0,))
        ]
    best = np.array(starts[0])
    if best.size:
        fits = [least_squares(misfit, start, xtol=1e-10, ftol=1e-12) for start in starts]
        best = min(fits, key=lambda fit: fit.cost).x
    c, t = rates_of(best)
    c = abs(c)  # a half turn about the tangent makes it the same arc with a positive curvature
    arc = _arc_points(s, c, t)
    pose = best_rigid_fit(arc, wanted, weights)
    rms = float(np.sqrt(np.mean(np.sum((se3.transform(pose, arc) - wanted) ** 2, axis=1))))
    end = pose @ se3.exp_pose(length * _screw(c, t))
    return Arc(float(length), float(c), float(t), pose[:3, :3], end[:3, :3], rms)


def turn_about_axis(before: np.ndarray, after: np.ndarray) -> float:
    """Angle in rad (-pi..pi) about the first axis that turns frame (3, 3) `before` into `after`."""
    R = before.T @ after
    return float(np.arctan2(R[2, 1] - R[1, 2], R[1, 1] + R[2, 2]))


def extract(target: Target, pieces: Sequence[Piece]) -> list[Extracted]:
    """The list of `Extracted` for the pieces of a target; the user's givens are kept where there are any."""
    ends = np.concatenate([[0.0], np.cumsum([p.length for p in pieces])])
    own = target.curve.arc_lengths
    arcs = []
    for piece, low, high in zip(pieces, ends[:-1], ends[1:]):
        within = (own > low + 1e-6 * ends[-1]) & (own < high - 1e-6 * ends[-1])
        stations = np.concatenate([[low], own[within], [high]])
        arc = fit_arc(target.curve.at(stations), piece.kind, piece.curvature, piece.twist)
        back = se3.exp_rotation(np.array([-np.radians(piece.roll), 0.0, 0.0]))  # to the body's frame
        arcs.append(replace(arc, start=arc.start @ back, end=arc.end @ back))
    out = [
        Extracted(p.kind, p.length, arc.twist, arc.curvature, arc.rms, note=_kept(p), roll=p.roll)
        for p, arc in zip(pieces, arcs)
    ]
    for run in _runs(pieces):
        for i in run:
            if target.frames is not None:
                out[i] = _twist_from_frames(target, pieces[i], arcs[i], ends[i], ends[i + 1])
        if target.frames is None:
            for i, extracted in zip(run, _twist_of_run(target, pieces, arcs, run)):
                out[i] = extracted
    return [replace(one, group=p.group) for one, p in zip(out, pieces)]


def _kept(piece):
    return "" if piece.curvature is None and piece.twist is None else "as given"


def _runs(pieces):
    """Indices of neighbouring twisting pieces, as lists."""
    runs: list[list[int]] = []
    for i, piece in enumerate(pieces):
        if piece.kind == TWISTING:
            if runs and runs[-1][-1] == i - 1:
                runs[-1].append(i)
            else:
                runs.append([i])
    return runs


def _twist_of_run(target, pieces, arcs, run):
    """`Extracted` for straight pieces in a row: only their sum shows, as a turn of the bending plane, modulo
    2 pi."""
    first, last = run[0], run[-1]
    before = arcs[first - 1].end if first > 0 else target.base_rotation
    after = arcs[last + 1].start if last + 1 < len(pieces) else None
    shown = turn_about_axis(before, after) if before is not None and after is not None else None
    free = [i for i in run if pieces[i].twist is None]
    given = sum(pieces[i].twist * pieces[i].length for i in run if pieces[i].twist is not None)
    turn, note = 0.0, "the points do not show its twist: taken as 0"
    if shown is not None:
        turn = (shown - given + np.pi) % (2 * np.pi) - np.pi
        note = (
            f"twist from the turn of the bending plane, {np.degrees(shown):.1f} deg modulo 360: the smallest"
            " is taken"
        )
        if len(free) > 1:
            note += "; shared evenly among neighbours"
    free_length = sum(pieces[i].length for i in free)
    for i in run:
        piece = pieces[i]
        visible = shown is not None and len(run) == 1
        if piece.twist is None:
            yield Extracted(TWISTING, piece.length, turn / free_length, 0.0, arcs[i].rms, visible, note)
        else:
            kept = "as given"
            if shown is None:
                kept += "; the points do not show it"
            elif visible:
                kept += f"; the points show a turn of {np.degrees(shown):.1f} deg modulo 360"
                kept += f", the given one is {np.degrees(given):.1f} deg"
            yield Extracted(TWISTING, piece.length, piece.twist, 0.0, arcs[i].rms, visible, kept)


def _twist_from_frames(target, piece, arc, low, high):
    """`Extracted` of a twisting piece from the turns about t1 between neighbouring frames."""
    own = target.curve.arc_lengths
    turns = [turn_about_axis(a, b) for a, b in zip(target.frames, target.frames[1:])]
    angle = np.interp([low, high], own, np.concatenate([[0.0], np.cumsum(turns)]))
    twist, note = (angle[1] - angle[0]) / piece.length, "twist from the frames"
    if piece.twist is not None:
        twist, note = piece.twist, "as given"
    return Extracted(TWISTING, piece.length, float(twist), 0.0, arc.rms, True, note)
