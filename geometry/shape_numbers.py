"""A cell's shape without a length: what strains times a length depend on when the material has only one
modulus; and the directions in which cells differ, those of their material included."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from pneunet.base.materials.laws import Hyperelastic
from pneunet.base.materials.stiffening import stiffening
from pneunet.geometry.parameters import ONE_SIDED, TWISTING, Segment

#: Segment's attributes in order: the angle in degrees, then lengths
SHAPE = (
    *("angle", "width", "chamber_height", "cavity_thickness", "wall", "gap", "top_wall", "side_wall"),
    *("base_thickness", "roof", "channel_width", "channel_height", "cavity_floor"),
)
_dimensions = attrgetter(*SHAPE)
#: (13,) derivatives of the normal pitch by them
PITCH_BY = np.array([{"cavity_thickness": 1.0, "wall": 2.0, "gap": 1.0}.get(name, 0.0) for name in SHAPE])
#: how a material stiffens, after SHAPE among a cell's numbers: of Yeoh's law
STIFFENING = ("c20/c10", "c30/c10")
#: what strains times a length depend on, besides the pressure over the initial shear modulus
NUMBERS = (*SHAPE, *STIFFENING)
#: kind -> name -> changes of SHAPE by one: the directions in which shapes differ when the normal pitch is
#: the unit of length. Walls and cavities grow at the gap's cost; what a campaign ties together
#: (hifi.runs.campaign.sample) moves together
_OF_BOTH = {
    "angle": {"angle": 1.0},
    "width": {"width": 1.0},
    "chamber_height": {"chamber_height": 1.0},
    "cavity_thickness": {"cavity_thickness": 1.0, "gap": -1.0},
    "wall": {"wall": 1.0, "gap": -2.0},
    "channel_width": {"channel_width": 1.0},
}
DIRECTIONS = {
    ONE_SIDED: _OF_BOTH
    | {
        "channel_height": {"channel_height": 1.0, "cavity_floor": 0.5},
        "shell": {"top_wall": 1.0, "side_wall": 1.0, "roof": 1.0},
        "base_thickness": {"base_thickness": 1.0},
    },
    TWISTING: _OF_BOTH
    | {
        "channel_height": {"channel_height": 1.0},
        "shell": {"top_wall": 1.0, "side_wall": 1.0, "base_thickness": 1.0},
        "roof": {"roof": 1.0},
        "cavity_floor": {"cavity_floor": 1.0},
    },
}


def direction_matrix(kind: str) -> np.ndarray:
    """(directions, 15) changes of NUMBERS: along DIRECTIONS, then one of STIFFENING each."""
    changes = [*DIRECTIONS[kind].values(), *({name: 1.0} for name in STIFFENING)]
    return np.array([[change.get(name, 0.0) for name in NUMBERS] for change in changes])


def changed(segment: Segment, change: Mapping[str, float], step: float) -> Segment:
    """The Segment `step` along one of DIRECTIONS: degrees, or normal pitches."""
    length = normal_pitch(segment)
    return replace(
        segment,
        **{n: getattr(segment, n) + step * by * (1 if n == "angle" else length) for n, by in change.items()},
    )


def normal_pitch(segment: Segment) -> float:
    """Distance of neighbouring chambers across themselves, mm: the length by which all others are divided."""
    return segment.chamber_thickness + segment.gap


def shape_numbers(segment: Segment) -> np.ndarray:
    """(13,) the angle in degrees and the lengths of SHAPE in normal pitches."""
    return numbers_of([segment])[0][0, : len(SHAPE)]


def numbers_of(segments: Sequence[Segment]) -> tuple[np.ndarray, np.ndarray]:
    """(NUMBERS (n, 15), `normal_pitch` (n,) in mm) of n segments, with their materials' stiffening
    (base.materials.stiffening)."""
    numbers = np.array([(*_dimensions(s), *stiffening(s.material)[:2]) for s in segments])
    pitch = np.array([normal_pitch(s) for s in segments])
    numbers[:, 1 : len(SHAPE)] /= pitch[:, None]
    return numbers, pitch


def by_dimensions(slopes: np.ndarray, shape: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """(n, p, 13) derivatives by SHAPE's dimensions (degrees, mm) of what has the derivatives (n, p, 13) by
    the shape numbers (n, 13), at normal pitches (n,)."""
    scaled = (slopes[:, :, 1:] @ shape[:, 1:, None])[:, :, 0]
    by = slopes - scaled[:, :, None] * PITCH_BY
    by[:, :, 1:] /= pitch[:, None, None]
    return by


def segment_of(kind: str, shape: np.ndarray, pitch: float, material: Hyperelastic) -> Segment:
    """The Segment of one chamber with these shape numbers (13,) and normal pitch (mm)."""
    lengths = dict(zip(SHAPE[1:], (shape[1:] * pitch).tolist()))
    return Segment(kind, float(shape[0]), 1, **lengths, end_margin=1.0 + pitch, material=material)
