"""A cell's shape without a length: what strains times a length depend on when the material has only one modulus."""

import numpy as np

from geometry.parameters import Segment

#: Segment's attributes in order: the angle in degrees, then lengths
SHAPE = (
    *("angle", "width", "chamber_height", "cavity_thickness", "wall", "gap", "top_wall", "side_wall"),
    *("base_thickness", "roof", "channel_width", "channel_height", "cavity_floor"),
)


def normal_pitch(segment):
    """Distance of neighbouring chambers across themselves, mm: the length by which all others are divided."""
    return segment.chamber_thickness + segment.gap


def shape_numbers(segment):
    """(13,) the angle in degrees and the lengths of SHAPE in normal pitches."""
    values = np.array([getattr(segment, name) for name in SHAPE])
    values[1:] /= normal_pitch(segment)
    return values


def segment_of(kind, shape, pitch, material):
    """The Segment of one chamber with these shape numbers (13,) and normal pitch (mm)."""
    lengths = dict(zip(SHAPE[1:], (shape[1:] * pitch).tolist()))
    return Segment(kind, float(shape[0]), 1, **lengths, end_margin=1.0 + pitch, material=material)
