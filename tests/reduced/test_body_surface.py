"""The deformed outline: closed, of the right volume, numbered by segment."""

import numpy as np
import pytest

from pneunet.geometry import Manipulator, Segment
from pneunet.reduced import AnalyticLaw, body_surface, predict

ARM = Manipulator((Segment("twisting", 60.0, 3, cavity_floor=0.5), Segment("one-sided", 70.0, 4)))


def enclosed(vertices, quads):
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    return sum(np.einsum("ij,ij", p, np.cross(q, r)) / 6 for p, q, r in ((a, b, c), (a, c, d)))


def box_volume(s):
    core = s.length * s.width * (s.core_top - s.core_bottom)
    blocks = len(s.sides) * s.chambers * s.chamber_thickness / s.sin * s.width * (s.chamber_top - s.core_top)
    return core + blocks


def test_rest_has_the_volume_of_core_and_chambers():
    vertices, quads, owner = body_surface(ARM, predict(ARM, 0.0, AnalyticLaw()))
    for i, segment in enumerate(ARM.segments):
        assert enclosed(vertices, quads[owner == i]) == pytest.approx(box_volume(segment), rel=1e-9)
    assert vertices[:, 0].min() == pytest.approx(0.0) and vertices[:, 0].max() == pytest.approx(ARM.length)
    assert vertices[:, 2].min() == pytest.approx(ARM.segments[0].chamber_bottom)
    assert quads.max() < len(vertices) and len(owner) == len(quads)


def test_twisting_and_stretching_keep_the_volume():
    arm = Manipulator((ARM.segments[0],))
    vertices, quads, _ = body_surface(arm, predict(arm, 0.03, AnalyticLaw(), 0.5), spacing=0.5)
    assert enclosed(vertices, quads) == pytest.approx(box_volume(arm.segments[0]), rel=5e-3)
