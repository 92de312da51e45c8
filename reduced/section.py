"""Areas of a segment's cross-section, averaged over one pitch: the slanted chambers make every section different, so
the areas of the twisting tube are the volumes of one cell divided by its pitch."""

import numpy as np


def empty_area(segment):
    """Mean area of channel and cavities, mm^2."""
    share = segment.cavity_thickness / segment.sin / segment.pitch
    overlap = segment.channel_width * (segment.channel_height / 2 - segment.cavity_floor)
    cavity = share * (segment.cavity_width * segment.chamber_height - overlap)
    return segment.channel_width * segment.channel_height + len(segment.sides) * cavity


def occupied_area(segment):
    """Mean area of the solid, mm^2: core and chamber blocks less what is empty."""
    core = segment.width * (segment.core_top - segment.core_bottom)
    share = segment.chamber_thickness / segment.sin / segment.pitch
    blocks = len(segment.sides) * share * segment.width * (segment.chamber_top - segment.core_top)
    return core + blocks - empty_area(segment)


def equivalent_radii(segment):
    """(Ri, Ro) in mm of the tube with the same empty and the same occupied area (paper, Sec. II.A.1).

    The paper shows one cross-section; for slanted chambers we take the areas' mean over a pitch.
    """
    empty = empty_area(segment)
    return float(np.sqrt(empty / np.pi)), float(np.sqrt((empty + occupied_area(segment)) / np.pi))
