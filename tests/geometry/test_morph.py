from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry.grids.cell import cell_grid
from pneunet.geometry.grids.morph import Morph
from pneunet.geometry.parameters import ONE_SIDED
from pneunet.geometry.reference_cases import CASES
from pneunet.geometry.shape_numbers import DIRECTIONS, changed, direction_matrix, normal_pitch, shape_numbers

BODIES = [
    CASES["one_sided_w10"](angle=60.0, chambers=1, material=NeoHookean(0.2)),
    CASES["twist_w12"](angle=50.0, chambers=1, material=NeoHookean(0.2)),
]


@pytest.mark.parametrize("segment", BODIES, ids=lambda s: s.kind)
def test_faces_of_one_cell_go_to_those_of_the_other(segment):
    s = segment
    other = replace(
        s, angle=55.0, width=1.1 * s.width, wall=0.9 * s.wall, gap=1.2 * s.gap, roof=0.95 * s.roof
    )

    def on_wall(s):
        """Places on a chamber's slanted outer wall, the first and last at its sides and at bottom and top."""
        y, z = (
            s.width / 2 * np.array([-1, -0.3, 0.5, 1]),
            np.array([0, 0.5, 0.8, 1]) * (s.chamber_top - s.core_top) + s.core_top,
        )
        return np.column_stack([y * s.cot + s.chamber_thickness / 2 / s.sin, y, z])

    start = on_wall(segment)
    there = Morph(segment, other)(start)
    assert there[:, 0] - there[:, 1] * other.cot == pytest.approx(
        np.full(4, other.chamber_thickness / 2 / other.sin)
    )
    assert there[[0, -1]] == pytest.approx(on_wall(other)[[0, -1]])
    assert Morph(other, segment)(there) == pytest.approx(start)


@pytest.mark.parametrize("segment", BODIES, ids=lambda s: s.kind)
def test_a_cell_stays_periodic_and_keeps_its_orientation(segment):
    rng = np.random.default_rng(0)
    low = segment.core_bottom if segment.kind == ONE_SIDED else -segment.chamber_top
    x = rng.uniform(
        [-segment.pitch / 2, -segment.width / 2, low],
        [segment.pitch / 2, segment.width / 2, segment.chamber_top],
        (200, 3),
    )
    x[:, 0] += segment.cot * x[:, 1] if segment.kind == ONE_SIDED else 0.0
    for name, change in DIRECTIONS[segment.kind].items():
        other = changed(segment, change, 1.0 if name == "angle" else 0.02)
        step = np.array([segment.pitch, 0, 0])
        assert Morph(segment, other)(x + step) - Morph(segment, other)(x) == pytest.approx(
            np.tile([other.pitch, 0, 0], (200, 1)), abs=1e-9
        )
        h = 1e-6
        columns = [(Morph(segment, other)(x + h * e) - Morph(segment, other)(x)) / h for e in np.eye(3)]
        assert (np.linalg.det(np.stack(columns, axis=2)) > 0.5).all()


@pytest.mark.parametrize("segment", BODIES, ids=lambda s: s.kind)
def test_directions_keep_the_normal_pitch_and_are_what_the_matrix_says(segment):
    rows = direction_matrix(segment.kind)
    assert np.linalg.matrix_rank(rows) == len(rows)
    for change, row in zip(DIRECTIONS[segment.kind].values(), rows):
        other = changed(segment, change, 0.01)
        assert normal_pitch(other) == pytest.approx(normal_pitch(segment))
        assert shape_numbers(other) - shape_numbers(segment) == pytest.approx(0.01 * row[:13], abs=1e-12)


@pytest.mark.parametrize("segment", BODIES, ids=lambda s: s.kind)
def test_the_grid_of_one_cell_goes_to_that_of_the_other(segment):
    other = replace(segment, angle=segment.angle + 0.5, width=1.01 * segment.width, roof=1.02 * segment.roof)
    grids = [cell_grid(s, 1.7).mesh(air=True).points for s in (segment, other)]
    assert Morph(segment, other)(grids[0]) == pytest.approx(grids[1], abs=1e-12)
