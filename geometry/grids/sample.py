"""Segments and manipulators at random that could be cast: what every grid must be made of."""

from dataclasses import replace

import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry.parameters import KINDS, ONE_SIDED, ROLLS, Manipulator, Segment


def random_segment(random: np.random.Generator) -> Segment:
    """A Segment with angle and dimensions anywhere in wide ranges; each of them rounded to 0.05 mm in half of
    the cases, so that planes meet or all but meet."""
    kind = KINDS[random.integers(len(KINDS))]
    to = 0.05 if random.random() < 0.5 else 1e-3

    def between(low: float, high: float) -> float:
        return round(float(np.round(random.uniform(low, high) / to) * to), 6)

    side_wall, width = between(0.8, 2.5), between(6.0, 30.0)
    channel_height = between(1.0, 5.0)
    lowest = -channel_height / 2 if kind == ONE_SIDED else 0.0
    gap, roof, top_wall = between(0.5, 4.0), between(0.8, 3.0), between(0.8, 3.0)
    floor = between(lowest, channel_height / 2)
    floor = min(max(floor, lowest), channel_height / 2)
    return Segment(
        kind,
        between(30.0, 150.0),
        int(random.integers(1, 6)),
        width=width,
        chamber_height=between(max(1.0, channel_height / 2 + roof - top_wall - floor + 0.2), 15.0),
        cavity_thickness=between(1.0, 6.0),
        wall=between(0.8, 3.0),
        gap=gap,
        top_wall=top_wall,
        side_wall=side_wall,
        base_thickness=between(0.8, 5.0),
        roof=roof,
        channel_width=min(between(1.0, 8.0), width - 2 * side_wall),
        channel_height=channel_height,
        cavity_floor=floor,
        end_margin=gap + between(0.5, 5.0),
    )


def random_manipulator(random: np.random.Generator) -> Manipulator:
    """Two to five random segments whose channels fit into their neighbours' cores, some of them rolled, some
    passive, some with a cavity of their own."""
    while True:
        segments: list[Segment] = []
        for _ in range(random.integers(2, 6)):
            segment = random_segment(random)
            if segments and random.random() < 0.2:
                segment = segment.plain(segment.end_margin + float(random.uniform(0.5, 20.0)))
            group = segments[-1].group + bool(random.random() < 0.2) if segments else 1
            segments.append(replace(segment, roll=int(random.choice(ROLLS)), group=int(group)))
        try:
            return Manipulator(tuple(segments))
        except InputError:
            continue
