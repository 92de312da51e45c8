"""The designs of a campaign: points of a scrambled Sobol sequence in a box of dimensions, and the strains
prescribed around them.

A design is known by kind and index: the sequence is the same however many designs are asked for, so more
designs keep the first ones. Held-out designs, on which a law is judged and never trained, are every n-th
index. Near the edges of the box a law has neighbours on one side only, and in ten dimensions most of the box
is near an edge: edge designs, another sequence, are crowded towards them. Dimensions that users seldom change
apart are tied, which leaves fewer directions to fill:
- the side wall is as thick as the top wall, and in one-sided segments so is the roof of the channel;
- the cavity's floor lies at the channel's top in one-sided segments; in twisting ones anywhere between axis
and channel's top. Angles above 90 degrees are mirror images. The material is Yeoh's with mu = 1 MPa:
only P/mu counts, and how it stiffens. The third constant, which most silicones lack, is 0 in half of the
designs.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, qmc

from pneunet.base.materials.laws import Yeoh
from pneunet.geometry.parameters import KINDS, ONE_SIDED, TWISTING, Segment

MU = 1.0
#: kind -> variable -> (low, high); degrees and mm. floor_share: of half the channel's height. c30_over_c10:
#: what is below 0 counts as 0
RANGES = {
    ONE_SIDED: {
        "angle_deg": (30.0, 90.0),
        "width_mm": (8.0, 16.0),
        "chamber_height_mm": (3.0, 8.0),
        "cavity_thickness_mm": (1.5, 3.0),
        "wall_mm": (0.8, 1.6),
        "gap_mm": (0.8, 2.5),
        "outer_wall_mm": (0.8, 1.6),
        "base_thickness_mm": (1.5, 4.0),
        "channel_width_mm": (2.0, 4.5),
        "channel_height_mm": (1.5, 2.5),
        "c20_over_c10": (0.0, 0.13),
        "c30_over_c10": (-0.008, 0.008),
    },
}
RANGES[TWISTING] = {name: both for name, both in RANGES[ONE_SIDED].items() if name != "base_thickness_mm"} | {
    "roof_mm": (0.8, 2.0),
    "floor_share": (0.25, 1.0),
}
#: prescribed states that an index has places for; a campaign takes the first of them
PLACES = 16


@dataclass(frozen=True)
class Prescribed:
    """A state at prescribed strains around the free ones q: level (0..1) chooses the pressure; direction
    (6,), of length 1.

    The strains are q + amplitude sqrt(2 U) K^(-1/2) direction, U the energy of the free twist and curvatures
    in a rod of stiffness K: amplitudes are in their units, and stiff directions (stretch, shear) are strained
    less. Without a direction the strains are q_rest + amplitude (q - q_rest).
    """

    level: float
    amplitude: float
    direction: tuple[float, ...] | None = None


def segments(
    kind: str, ranges: dict[str, tuple[float, float]], count: int, seed: int, at_edges: bool = False
) -> list[Segment]:
    """The first `count` Segments of a kind; ranges: {variable: (low, high)} with the keys of RANGES[kind].
    at_edges: distributed as Chebyshev's nodes along every variable. (Measured: the 200 of 400 uniform designs
    that lie furthest out, or half of them those and half any, teach a law as much as all 400.)"""
    names = list(RANGES[kind])
    low, high = np.array([ranges[name] for name in names]).T
    points = _sobol(len(names), count, seed + KINDS.index(kind))
    if at_edges:
        points = np.sin(np.pi / 2 * points) ** 2
    return [_segment(kind, dict(zip(names, (low + p * (high - low)).round(5).tolist()))) for p in points]


def typical(kind: str) -> Segment:
    """The Segment in the middle of RANGES, but for its angle of 45 degrees: the more slanted, the more
    elements a chamber needs."""
    return _segment(kind, {name: sum(both) / 2 for name, both in RANGES[kind].items()} | {"angle_deg": 45.0})


def _segment(kind, v):
    outer, half = v["outer_wall_mm"], v["channel_height_mm"] / 2
    c10 = MU / 2
    material = Yeoh(c10=c10, c20=v["c20_over_c10"] * c10, c30=max(v["c30_over_c10"], 0.0) * c10)
    return Segment(
        kind,
        v["angle_deg"],
        1,
        width=v["width_mm"],
        chamber_height=v["chamber_height_mm"],
        cavity_thickness=v["cavity_thickness_mm"],
        wall=v["wall_mm"],
        gap=v["gap_mm"],
        top_wall=outer,
        side_wall=outer,
        base_thickness=v.get("base_thickness_mm", outer),  # a twisting segment has none
        roof=v.get("roof_mm", outer),
        channel_width=v["channel_width_mm"],
        channel_height=v["channel_height_mm"],
        cavity_floor=half * v.get("floor_share", 1.0),
        end_margin=4.0,
        material=material,
    )


def prescribed_states(kind: str, count: int, each: int, seed: int) -> list[list[Prescribed]]:
    """[[Prescribed] of each design]: the free strains' own direction first, extrapolated twofold, then `each`
    - 1 others."""
    points = _sobol(8, count * PLACES, seed + 100 + KINDS.index(kind)).reshape(count, PLACES, 8)
    return [[_prescribed(p, j) for j, p in enumerate(design[:each])] for design in points]


def _prescribed(point, place):
    level = 1 / 3 + 2 / 3 * point[0]
    if place == 0:
        return Prescribed(float(level), 2.0)
    direction = norm.ppf(np.clip(point[2:], 1e-6, 1 - 1e-6))
    direction /= np.linalg.norm(direction)
    return Prescribed(float(level), float(0.4 + 1.1 * point[1]), tuple(direction.round(6).tolist()))


def _sobol(dimension, count, seed):
    """(count, dimension) first points of the scrambled sequence."""
    import warnings

    with warnings.catch_warnings():
        # balance of counts that are no power of two: the sequence is to be extended
        warnings.simplefilter("ignore", UserWarning)
        return qmc.Sobol(dimension, scramble=True, seed=seed).random(count)
