"""Areas of a segment's cross-section, averaged over one pitch: the slanted chambers make every section
different, so the areas of the twisting tube are the volumes of one cell divided by its pitch."""

import numpy as np

from pneunet.geometry.parameters import Segment


def empty_area(segment: Segment) -> float:
    """Mean area of channel and cavities, mm^2."""
    share = segment.cavity_thickness / segment.sin / segment.pitch
    overlap = segment.channel_width * (segment.channel_height / 2 - segment.cavity_floor)
    cavity = share * (segment.cavity_width * segment.chamber_height - overlap)
    return segment.channel_width * segment.channel_height + len(segment.sides) * cavity


def occupied_area(segment: Segment) -> float:
    """Mean area of the solid, mm^2: core and chamber blocks less what is empty."""
    core = segment.width * (segment.core_top - segment.core_bottom)
    share = segment.chamber_thickness / segment.sin / segment.pitch
    blocks = len(segment.sides) * share * segment.width * (segment.chamber_top - segment.core_top)
    return core + blocks - empty_area(segment)


def equivalent_radii(segment: Segment) -> tuple[float, float]:
    """(Ri, Ro) in mm of the tube with the same empty and the same occupied area (paper, Sec. II.A.1).

    The paper shows one cross-section; for slanted chambers we take the areas' mean over a pitch.
    """
    empty = empty_area(segment)
    return float(np.sqrt(empty / np.pi)), float(np.sqrt((empty + occupied_area(segment)) / np.pi))


def active_mass(segment: Segment) -> tuple[float, float]:
    """(mass per undeformed length in tonne/mm, z of its centre in mm) of chambers and core, averaged over a
    pitch."""
    s = segment
    share = s.chamber_thickness / s.sin / s.pitch
    hollow = s.cavity_thickness / s.sin / s.pitch
    parts = _core(s)
    for side in s.sides:
        blocks = [
            (share * s.width, s.core_top, s.chamber_top),
            (-hollow * s.cavity_width, s.cavity_floor, s.cavity_top),
        ]
        if s.cavity_floor < s.channel_height / 2:
            blocks.append((hollow * s.channel_width, s.cavity_floor, s.channel_height / 2))
        parts += [(w * s.material.density, *sorted((side * a, side * b))) for w, a, b in blocks]
    return _mass(parts)


def passive_mass(segment: Segment) -> tuple[float, float]:
    """The same of the bare core with its channel."""
    return _mass(_core(segment))


def _core(s):
    density = s.material.density
    parts = [
        (s.width * density, s.core_bottom, s.core_top),
        (-s.channel_width * density, -s.channel_height / 2, s.channel_height / 2),
    ]
    if s.layer_material:
        parts.append((s.width * (s.layer_material.density - density), s.core_bottom, s.layer_top))
    return parts


def _mass(parts):
    width, low, high = (np.array(a, float) for a in zip(*parts))
    mass = width * (high - low)
    total = float(mass.sum())
    return total, float((mass * (low + high)).sum() / 2 / total) if total else 0.0
