"""The search's derivatives against differences of the fourth order, for every variable there is."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.materials.laws import PAPER_TWISTING
from pneunet.design.search.aims import EQ27, Aim
from pneunet.design.search.problem import BEYOND, Body, Problem
from pneunet.design.search.space import Variable
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import Target
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced import predict, shipped_law
from pneunet.reduced.rod.clearance import allowed_stretch
from pneunet.reduced.rod.ends import cell_strains, free_pieces
from pneunet.reduced.rod.piece_slopes import FIELDS, cell_states, piece_twists

#: of a silicone so brittle that the walls of its segment, and of no other, would tear at either pressure
BRITTLE = replace(PAPER_TWISTING, elongation_at_break=0.03)
SEGMENTS = (
    Segment("twisting", 65.0, 1, gap=2.2, cavity_floor=0.4, chamber_height=5.5),
    Segment("one-sided", 84.0, 1, wall=0.8, gap=0.9, cavity_floor=0.5),  # its walls would overlap
    Segment("one-sided", 118.0, 1, chamber_height=4.4, cavity_floor=0.5, roll=180, material=BRITTLE),
    Segment("one-sided", 118.0, 1).plain(14.0),
)
#: so that no station lies where a joint passes within the differences, where derivatives jump
COUNTS = np.array([7.35, 5.1, 16.5, 0.0])
#: of large changes: enough for the law's rounding, little enough for the differences
STEP = 5e-4


def problem(law, objective="paired", frames=True):
    """At two pressures, far from its optimum."""
    variables = [
        Variable(name, (i,), 0.0, 100.0, 1.0, 1.0)
        for i in range(3)
        for name in FIELDS
        if name not in ("pressure", "plain_length") and (name, i) != ("base_thickness", 2)
    ]
    variables.append(Variable("plain_length", (3,), 0.0, 100.0, 1.0))
    variables += [Variable("pressure", (0, 1, 2, 3), 0.0, 0.06, 0.02, None, (k,)) for k in range(2)]
    variables = [
        replace(v, segments=(1, 2)) if (v.name, v.segments) == ("base_thickness", (1,)) else v
        for v in variables
    ]
    turn, s = se3.exp_rotation(np.array([0.4, -0.2, 0.6])), np.linspace(0, 1, 60)
    points = np.column_stack([120 * s, 30 * np.sin(4 * s), 20 * s**2])
    frame = np.tile(turn, (60, 1, 1)) if frames else None
    target = Target(points @ turn.T, frames=frame)
    aims = (Aim.of(target, 12.0, objective), Aim.of(replace(target, frames=None), 12.0, objective))
    pieces = tuple(Extracted("twisting", 40.0, 0.01, 0.0, 0.0, twist_seen=i > 0) for i in range(4))
    body = Body(SEGMENTS, COUNTS, np.array([[0.035] * 4, [0.048] * 4]), turn, target.points[0])
    return Problem(aims, pieces, law, tuple(variables), body, np.eye(3))


def differences(evaluate, x, scale):
    """(m, n) of the fourth order."""
    columns = []
    for j, h in enumerate(STEP * scale):
        at = [evaluate(x + k * h * np.eye(len(x))[j]).residual for k in (-2, -1, 1, 2)]
        columns.append((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * h))
    return np.column_stack(columns)


def test_every_derivative_is_exact():
    these = problem(shipped_law())
    x = these.x + np.concatenate([0 * these.x[:-3], [0.1, -0.2, 0.15]])  # a base that is turned
    scale = these.bounds[2]
    at, by_differences = these.evaluate(x), differences(these.evaluate, x, scale)
    states, brittle = [shape.states for shape in at.shapes], 0.95 * (allowed_stretch(SEGMENTS[2]) - 1)
    overlaps = sum((s.closed[:3] > 1).sum() for s in states)
    tears = sum(s.stretch[2] - 1 > brittle for s in states)
    outside = sum((s.excess > 0).sum() for s in states)
    preferences, twists = len(these.variables) - 3, 1
    assert at.residual.shape == (101 * 12 + preferences + overlaps + tears + outside + twists,) and tears
    error = np.linalg.norm((at.jacobian - by_differences) * scale, axis=0)
    assert (error <= 1e-6 * np.linalg.norm(at.jacobian * scale, axis=0).max()).all()


def test_a_pressure_beyond_the_limit_point_is_misfit():
    law, these = shipped_law(), problem(shipped_law())
    high = replace(SEGMENTS[0], chamber_height=8.0, gap=3.0)  # its path ends between 60 and 100 kPa
    assert law.excess(high, 0.06)[-1] <= 0 < law.excess(high, 0.1)[-1]
    body = replace(these.body, segments=(high, *SEGMENTS[1:]), pressures=np.full((2, 4), 0.1))
    there = replace(these, body=body)
    expected = BEYOND * law.excess(high, 0.1)[-1]
    found = there.evaluate(there.x).residual
    assert np.isclose(found, expected, rtol=1e-5).sum() == 2  # of each shape, to the search's last 1e-5


def test_the_gradient_to_nearest_points_is_exact():
    these = problem(shipped_law(), EQ27, frames=False)
    at, gradient = these.evaluate(these.x), []
    for j, h in enumerate(STEP * these.bounds[2]):
        costs = [
            np.sum(these.evaluate(these.x + k * h * np.eye(len(these.x))[j]).residual ** 2) for k in (-1, 1)
        ]
        gradient.append((costs[1] - costs[0]) / (4 * h))
    assert at.residual @ at.jacobian == pytest.approx(gradient, rel=1e-3, abs=5e-3 * np.max(np.abs(gradient)))


def test_pieces_and_points_are_those_of_the_prediction():
    law, counts = shipped_law(), np.array([7, 5, 16, 0])
    states = cell_states(law, SEGMENTS, 0.03)
    lengths, strains = free_pieces(SEGMENTS, cell_strains(law, SEGMENTS, 0.03), counts)
    twists, _ = piece_twists(SEGMENTS, states.strains, states.strains_by, counts)
    assert twists == pytest.approx(lengths[:, None] * strains.twist_vector, abs=1e-4)
    these = problem(law)
    body = replace(these.body, counts=counts.astype(float), pressures=np.full((2, 4), 0.03))
    at = replace(these, body=body).evaluate(replace(these, body=body).x)
    whole = Manipulator(tuple(replace(s, chambers=int(n)) for s, n in zip(SEGMENTS, counts)))
    line = predict(whole, 0.03, law, base_pose=body.base_pose)
    assert at.shapes[0].placed.points[[0, -1]] == pytest.approx(line.points[[0, -1]], abs=1e-3)
