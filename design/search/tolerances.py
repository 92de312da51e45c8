"""What a design's shape does when it is cast, pressed or known a little differently: linear, from the exact
derivatives at the design."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneunet.base.units import MPA_PER_KPA
from pneunet.design.search.problem import Body, Shape
from pneunet.design.target.casting import Casting
from pneunet.geometry.parameters import PASSIVE, TWISTING, Segment
from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.piece_slopes import FIELD_AT

#: mm, degrees, kPa, of the modulus: what effects are told of
PER_LENGTH, PER_ANGLE, PER_PRESSURE, PER_MODULUS = 0.1, 1.0, 1.0, 0.01
#: dimensions that a casting misses, by file key without its unit
LENGTHS = (*SHAPE[1:], "end_margin", "plain_length")


@dataclass(frozen=True)
class Effect:
    """What a small change does: name (a file key with its unit), segment (from 1 on, None for all), change as
    text, rms and tip in mm."""

    name: str
    segment: int | None
    change: str
    rms: float
    tip: float

    def __str__(self) -> str:
        where = "" if self.segment is None else f"segment {self.segment} "
        what = self.name.rsplit("_", 1)[0]
        return f"{where}{what} {self.change}: {self.rms:.2f} mm RMS, {self.tip:.2f} mm at the tip"


@dataclass(frozen=True)
class Tolerances:
    """effects: of each dimension, pressure and modulus alone. rms, tip: root mean square and tip deviation
    (mm) to be expected of castings with the stated tolerances, all independent. law_rms, law_tip: half of the
    90 % interval of the law, None where it knows none."""

    effects: tuple[Effect, ...]
    rms: float
    tip: float
    law_rms: float | None
    law_tip: float | None

    def table(self) -> dict:
        """By file key."""
        out: dict = {"casting_rms_mm": self.rms, "casting_tip_mm": self.tip}
        if self.law_rms is not None and self.law_tip is not None:
            out |= {"law_90_percent_rms_mm": self.law_rms, "law_90_percent_tip_mm": self.law_tip}
        out = {key: round(float(value), 4) for key, value in out.items()}
        rows = [
            {"name": e.name, "change": e.change, "rms_mm": round(e.rms, 4), "tip_mm": round(e.tip, 4)}
            | ({} if e.segment is None else {"segment": e.segment})
            for e in self.effects
        ]
        return out | {"effect": rows}


def tolerances(body: Body, shape: Shape, casting: Casting, law: SegmentLaw) -> Tolerances:
    """The Tolerances of a Body at one of its Shapes; its base stays where it is."""
    effects, variances = [], np.zeros(2)

    def add(name, segment, change, moves, scale, deviation):
        rms, tip = _sizes(moves)
        effects.append(Effect(name, segment, change, scale * rms, scale * tip))
        variances[:] += (deviation * rms) ** 2, (deviation * tip) ** 2

    for i, segment in enumerate(body.segments):
        for name in dimensions(segment):
            moves = shape.moves[:, :, i, FIELD_AT[name]]
            if name == "angle":
                add("angle_deg", i + 1, "1 deg", moves, PER_ANGLE, casting.angle_tolerance)
            elif moves.any():
                add(f"{name}_mm", i + 1, "0.1 mm", moves, PER_LENGTH, casting.tolerance)
    by_pressure = shape.moves[:, :, :, FIELD_AT["pressure"]]
    groups = sorted({segment.group for segment in body.segments})
    for group in groups:
        members = [i for i, segment in enumerate(body.segments) if segment.group == group]
        moves = by_pressure[:, :, members].sum(axis=2)
        name = "pressure_kPa" if len(groups) == 1 else f"pressure_group_{group}_kPa"
        add(name, None, "1 kPa", moves, PER_PRESSURE * MPA_PER_KPA, casting.pressure_tolerance)
    moves = shape.moves[:, :, :, FIELD_AT["mu"]] @ [s.material.mu for s in body.segments]
    add("mu_MPa", None, "1 %", moves, PER_MODULUS, casting.modulus_tolerance)
    rms, tip = np.sqrt(variances)
    return Tolerances(tuple(effects), float(rms), float(tip), *_of_the_law(body, shape, law))


def dimensions(segment: Segment) -> tuple[str, ...]:
    """Of Segment's fields those that a casting of its kind has."""
    if segment.kind == PASSIVE:
        return ("plain_length",)
    without = {"plain_length"} | ({"base_thickness"} if segment.kind == TWISTING else set())
    return ("angle", *(name for name in LENGTHS if name not in without))


def _sizes(moves):
    """(root mean square, at the tip) of moves (s, 3), mm."""
    squared = np.sum(moves**2, axis=1)
    return np.sqrt(squared.mean()), np.sqrt(squared[-1])


def _of_the_law(body, shape, law):
    """(RMS, tip) in mm of the law, half of 90 % intervals, each strain's error independent of the others', or
    None."""
    squares = np.zeros(2)
    for i, segment in enumerate(body.segments):
        if segment.kind == PASSIVE:
            continue
        half = law.half_width(segment, float(body.pressures[0, i]))
        if half is None:
            return None, None
        for j in range(6):
            squares += np.square(_sizes(half[j] * shape.strain_moves[:, :, i, j]))
    return tuple(np.sqrt(squares).tolist())


def largest(effects: Sequence[Effect], count: int) -> list[Effect]:
    """Those that move the shape most."""
    return sorted(effects, key=lambda e: -e.rms)[:count]
