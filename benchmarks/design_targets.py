"""Random targets for the part `design`: bodies that can be built, and plane curves.

The seed and everything else here was fixed before the search was run on them for the first time. Half of the
bodies are drawn in dimensions, and the law says their shapes; the other half are made of cells whose strains
the finite elements said and no law was trained on. All stand on passive ends, as real bodies do.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.design.target.reach import reach
from pneunet.design.target.target import Target
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import ONE_SIDED, TWISTING, Manipulator, Segment
from pneunet.geometry.shape_numbers import segment_of
from pneunet.reduced.choice import DATA_SET, shipped_law
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.prediction import predict
from pneunet.reduced.rod.rod import Rod

SEED = 20261128
REACHABLE, PLANAR, GRAVITY, PRESSURES = 50, 20, 10, 10
POINTS, NOISE = 150, 0.2  # mm, standard deviation of each coordinate
UNEVEN = (0.2, 1.8)  # of the mean: steps between neighbouring points
LENGTHS = (35.0, 80.0)  # mm, of segments at rest
WIDTH = 12.0  # mm
SPACING = 0.5  # mm, of the exact curves
EARTH = (0.0, 0.0, -9810.0)  # mm/s2


@dataclass(frozen=True, eq=False)
class Case:
    """target: what the search is given; exact: the curves (n, 3) in mm that its shapes lie on; unseen:
    whether its cells' strains are the finite elements'."""

    target: Target
    exact: tuple[np.ndarray, ...]
    unseen: bool = False


# ---- bodies


def _kinds(random, most):
    """Of one to `most` segments; a twist at an end, or next to another, shows nowhere."""
    n = int(random.integers(1, most + 1))
    kinds = []
    for i in range(n):
        inside = 0 < i < n - 1 and kinds[-1] != TWISTING
        kinds.append(TWISTING if inside and random.random() < 0.5 else ONE_SIDED)
    return kinds


def _drawn(random, kind, base_thickness):
    """A Segment in dimensions of usual size."""
    length = random.uniform(*LENGTHS)
    if kind == TWISTING:
        own = {
            "chamber_height": random.uniform(4.5, 6.5),
            "gap": random.uniform(1.5, 2.5),
            "cavity_floor": 0.5,
        }
        angle = random.choice([-1, 1]) * random.uniform(15, 40) + 90
    else:
        own = {"chamber_height": random.uniform(3.0, 6.0), "gap": random.uniform(1.0, 2.5)}
        own |= {"wall": random.uniform(1.0, 1.4), "base_thickness": base_thickness}
        angle = 90.0 if random.random() < 0.3 else 90 + random.choice([-1, 1]) * random.uniform(5, 45)
    one = Segment(kind, float(angle), 1, **own)
    return replace(one, chambers=max(2, round((length - 2 * one.end_length) / one.pitch)))


def body(random: np.random.Generator, most: int = 4) -> Manipulator:
    """A random Manipulator of at most so many segments with a flush underside."""
    base = random.uniform(1.5, 2.5)
    return Manipulator(tuple(_drawn(random, kind, base) for kind in _kinds(random, most)))


@lru_cache
def _cells():
    """{kind: [(shape (13,), pressures (n,), strains (n, 6))]} of held-out cells on the finest mesh of each
    design, rest included, pressures over the modulus."""
    from pneunet.base.files.dataset import read_dataset

    data, out = read_dataset(DATA_SET), {}
    for number, kind in enumerate(data.about["kinds"]):
        finest: dict[int, int] = {}
        for case in np.flatnonzero(data.held_out & data.accepted & (data.kind == number)):
            design = int(data.design[case])
            if design not in finest or data.mesh[case] > data.mesh[finest[design]]:
                finest[design] = int(case)
        out[kind] = []
        for case in finest.values():
            rows = np.flatnonzero((data.case == case) & ~data.prescribed)
            P = np.concatenate([[0.0], data.pressure[rows]])
            q = np.vstack([np.eye(6)[0], data.strains[rows]])
            order = np.argsort(P, kind="stable")
            out[kind].append((data.shape[case].astype(float), P[order], q[order].astype(float)))
    return out


@lru_cache
def _reaches():
    """{kind: Reach} of segments of usual size at up to 60 kPa."""
    like = {
        ONE_SIDED: Segment(ONE_SIDED, 90.0, 1),
        TWISTING: Segment(TWISTING, 90.0, 1, gap=2.0, cavity_floor=0.5),
    }
    heights = {ONE_SIDED: [4.0, 5.0], TWISTING: [5.5, 6.5]}
    return {
        kind: reach(
            segment, np.linspace(0.01, 0.06, 6), shipped_law(), vary={"chamber_height": heights[kind]}
        )
        for kind, segment in like.items()
    }


def _unseen(random, pressure):
    """(lengths, RodStrains) of the pieces of a body of held-out cells of one width at a pressure in MPa: such
    as segments of usual size reach."""
    mu, segments, free = Segment(ONE_SIDED, 90.0, 1).material.mu, [], []
    for kind in _kinds(random, 4):
        while True:
            cells = _cells()[kind]
            shape, P, q = cells[int(random.integers(len(cells)))]
            if pressure / mu > P[-1]:
                continue
            pitch = WIDTH / shape[1]
            strains = np.array([np.interp(pressure / mu, P, column) for column in q.T])
            strains[3:] /= pitch
            if random.random() < 0.5:  # either hand
                shape, strains = shape.copy(), strains * np.array([1, -1, 1, -1, 1, -1])
                shape[0] = 180 - shape[0]
            there = RodStrains.of_vector(strains)
            twist = there.twist_per_deformed_length if kind == TWISTING else there.frenet_torsion
            if _reaches()[kind].share(there.frenet_curvature * (kind == ONE_SIDED), twist) <= 0.9:
                break
        one = segment_of(kind, shape, pitch, Segment(ONE_SIDED, 90.0, 1).material)
        one = replace(one, end_margin=2.0 + one.gap / 2)
        count = max(2, round((random.uniform(*LENGTHS) - 2 * one.end_length) / one.pitch))
        segments.append(replace(one, chambers=count))
        free.append(strains)
    return free_pieces(segments, RodStrains.of_vector(free))


# ---- points


def _pose(random):
    turn = random.standard_normal(3)
    turn *= random.uniform(0, np.pi) / np.linalg.norm(turn)
    return se3.make_pose(se3.exp_rotation(turn), random.uniform(-100, 100, 3))


def _points(random, line: Centreline, noise=NOISE):
    """Uneven points with noise of a Centreline."""
    steps = random.uniform(*UNEVEN, POINTS - 1)
    own = line.arc_length
    at = np.interp(np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum() * own[-1], own, line.s)
    return line.at(at)[:, :3, 3] + noise * random.standard_normal((POINTS, 3))


def _accepted(make):
    """What make() gives; drawn anew where the curve is refused, as a closed or folded one is."""
    while True:
        try:
            return make()
        except InputError:
            continue


def reachable() -> list[Case]:
    """The free shapes of random bodies anywhere in space."""
    random, cases = np.random.default_rng(SEED), []
    for i in range(REACHABLE):

        def make(i=i):
            pressure, pose = random.uniform(0.025, 0.05), _pose(random)
            if i % 2:
                line = centreline(*_unseen(random, pressure), SPACING, pose)
            else:
                line = predict(body(random), pressure, shipped_law(), SPACING, pose)
            return Case(Target(_points(random, line), name=f"reachable {i}"), (line.points,), bool(i % 2))

        cases.append(_accepted(make))
    return cases


def planar() -> list[Case]:
    """C-shaped curves, whose curvature grows or falls along them, and S-shaped ones, where it changes its
    sign; half of them of two arcs."""
    random, cases = np.random.default_rng(SEED + 1), []
    for i in range(PLANAR):

        def make(i=i):
            ends = random.uniform(6e-3, 16e-3, 2) * (1, -1 if i % 2 else 1)
            length, share = random.uniform(100, 160), random.uniform(0.35, 0.65)
            s = np.linspace(0, length, 2001)
            arcs, line = np.where(s < share * length, *ends), ends[0] + s / length * (ends[1] - ends[0])
            curvature = arcs if i % 4 < 2 else line
            angle = np.concatenate([[0.0], np.cumsum((curvature[1:] + curvature[:-1]) / 2 * np.diff(s))])
            way = np.column_stack([np.cos(angle), 0 * angle, -np.sin(angle)])
            exact = np.vstack([[0.0] * 3, np.cumsum((way[1:] + way[:-1]) / 2 * np.diff(s)[:, None], axis=0)])
            exact = se3.transform(_pose(random), exact)
            return Case(Target(exact[::20], name=f"planar {i}"), (exact,))

        cases.append(_accepted(make))
    return cases


def under_gravity() -> list[Case]:
    """Bodies of one or two segments on a horizontal base, 120 to 180 mm long, as they hang."""
    random, cases = np.random.default_rng(SEED + 2), []
    for i in range(GRAVITY):

        def make(i=i):
            while not 120 <= (one := body(random, 2)).length <= 180:
                one = Manipulator(tuple(replace(s, chambers=2 * s.chambers) for s in one.segments))
                if 120 <= one.length <= 180:
                    break
            pressure = random.uniform(0.025, 0.05)
            line = (
                Rod.of(one, shipped_law(), pressure)
                .equilibrium(DeadLoads(gravity=EARTH), tolerance=1e-4)
                .line
            )
            fixed = {"base_direction": np.array([1.0, 0, 0]), "base_width": np.array([0, 1.0, 0])}
            even = np.interp(np.linspace(0, line.length, 121), line.arc_length, line.s)
            exact = line.at(even)[:, :3, 3]
            return Case(Target(exact, name=f"gravity {i}", gravity=EARTH, **fixed), (exact,))

        cases.append(_accepted(make))
    return cases


def two_pressures() -> list[Case]:
    """Bodies of up to three segments, each with its shapes at a low and at a high pressure."""
    from pneunet.design.target.shapes import TargetShape

    random, cases = np.random.default_rng(SEED + 3), []
    for i in range(PRESSURES):

        def make(i=i):
            one, low, high = body(random, 3), random.uniform(0.015, 0.025), random.uniform(0.04, 0.05)
            lines = [predict(one, P, shipped_law(), SPACING) for P in (high, low)]
            even = [
                line.at(np.interp(np.linspace(0, line.length, 121), line.arc_length, line.s))
                for line in lines
            ]
            exact = [frames[:, :3, 3] for frames in even]
            fixed = {"base_direction": np.array([1.0, 0, 0]), "base_width": np.array([0, 1.0, 0])}
            shape = TargetShape(exact[1], (low,))
            target = Target(
                exact[0], name=f"pressures {i}", pressure_range=(high, high), shapes=(shape,), **fixed
            )
            return Case(target, tuple(exact))

        cases.append(_accepted(make))
    return cases
