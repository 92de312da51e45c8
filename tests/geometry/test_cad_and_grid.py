"""CAD and grid describe one body: tapers at joints, channels' leaning ends, planes that were made one."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.geometry import Manipulator, Segment, tags
from pneunet.geometry.cad import body as cad
from pneunet.geometry.grids.body import body_grid
from pneunet.geometry.grids.sample import random_manipulator
from pneunet.geometry.reference_cases import CASES

ONE_SIDED = Segment("one-sided", 60.0, 1)
TWISTING = Segment("twisting", 60.0, 1, cavity_floor=0.5, chamber_height=5.5, gap=2.0)


def volumes(body):
    """(CAD's, grid's) volumes of body and cavity, (2, 2), mm3."""
    with cad.session():
        built = cad.build(body)
    mesh = body_grid(body, 3.0).mesh(air=True)
    air, each = mesh.cell_tags == tags.AIR, mesh.volumes()
    return [built["body_mm3"], built["cavity_mm3"]], [each[~air].sum(), each[air].sum()]


@pytest.mark.parametrize("name", CASES)
def test_reference_cases(name):
    built, grid = volumes(Manipulator((CASES[name](60.0, 2), CASES[name](120.0, 1))))
    assert built == pytest.approx(grid, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_random_manipulators(seed):
    """Of one chamber a segment: more are copies."""
    body = random_manipulator(np.random.default_rng(seed))
    short = Manipulator(tuple(replace(s, chambers=min(s.chambers, 1)) for s in body.segments))
    built, grid = volumes(short)
    assert built == pytest.approx(grid, rel=1e-9)


@pytest.mark.parametrize(
    "segments",
    [
        (TWISTING, replace(ONE_SIDED, width=8.0, channel_height=1.6, cavity_floor=0.3)),
        (
            replace(ONE_SIDED, width=9.0, base_thickness=3.0, channel_width=2.0, roll=90),
            replace(TWISTING, angle=110.0, channel_width=2.0, group=2),
        ),
    ],
    ids=["one cavity", "two, rolled"],
)
def test_the_surface_of_the_grid_lies_on_the_cads_faces(segments):
    body = Manipulator(segments)
    mesh = body_grid(body, 2.0).mesh()
    with cad.session() as model:
        cad.build(body)
        for tag in tags.face_names(len(body.groups)):
            points = mesh.points[np.unique(mesh.tagged(tag))]
            distances = []
            for face in model.getEntitiesForPhysicalGroup(2, tag):
                nearest = model.getClosestPoint(2, face, points.ravel())[0].reshape(-1, 3)
                distances.append(np.linalg.norm(nearest - points, axis=1))
            assert np.min(distances, axis=0).max() < 1e-6, tag


def test_a_twisting_channel_ends_in_a_saddle():
    with cad.session() as model:
        cad.build(Manipulator((TWISTING,)))
        curved = [face for _, face in model.getEntities(2) if model.getType(2, face) != "Plane"]
        assert len(curved) == 2
