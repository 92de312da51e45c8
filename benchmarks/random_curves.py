"""200 random targets of one to five pieces with noise, for the part `segmentation`.

The seed and everything else here was fixed before the split was run on them for the first time. A target is
drawn anew until its neighbouring pieces can be told apart: their strains differ by at least `APART`, no
twisting piece stands at an end, and no two straight pieces follow each other, of which only the sum of the
twists would show.
"""

from dataclasses import dataclass

import numpy as np

from pneunet.base import se3

SEED = 20261127
COUNT = 200
POINTS = 150
NOISE = 0.3  # mm, standard deviation of each coordinate
LENGTHS = (25.0, 100.0)  # mm
RATE = (0.006, 0.035)  # 1/mm: curvature, and twist of a twisting piece, either sign
TORSION = 0.035  # rad/mm: largest of a helical piece, either sign
APART = 0.006  # 1/mm
UNEVEN = (0.2, 1.8)  # of the mean: steps between neighbouring points
KINDS = ("passive", "twisting", "bending", "helical")


@dataclass(frozen=True)
class RandomTarget:
    """points (150, 3) with noise, mm; kinds, lengths (n,) in mm and strains (n, 2) = (k1, k2) in 1/mm of the
    pieces; pose (4, 4) of the section frame at the start."""

    points: np.ndarray
    kinds: tuple[str, ...]
    lengths: np.ndarray
    strains: np.ndarray
    pose: np.ndarray

    def exact(self, s: np.ndarray) -> np.ndarray:
        """Points (m, 3) of the curve without noise at arc lengths s (m,) in mm."""
        ends = np.concatenate([[0.0], np.cumsum(self.lengths)])
        screws = np.array([[k1, k2, 0, 1, 0, 0] for k1, k2 in self.strains])
        poses = [self.pose]
        for length, screw in zip(self.lengths, screws):
            poses.append(poses[-1] @ se3.exp_pose(length * screw))
        piece = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(screws) - 1)
        return (np.array(poses)[piece] @ se3.exp_pose((s - ends[piece])[:, None] * screws[piece]))[:, :3, 3]


def _rate(random):
    return random.choice([-1, 1]) * random.uniform(*RATE)


def _strains(kind, random):
    k1 = {"twisting": lambda: _rate(random), "helical": lambda: random.uniform(-TORSION, TORSION)}
    return [
        k1[kind]() if kind in k1 else 0.0,
        _rate(random) if kind in ("bending", "helical") else 0.0,
    ]


def _told_apart(kinds, strains):
    straight = [kind in ("passive", "twisting") for kind in kinds]
    return not (
        "twisting" in (kinds[0], kinds[-1])
        or any(a and b for a, b in zip(straight, straight[1:]))
        or (np.linalg.norm(np.diff(strains, axis=0), axis=1) < APART).any()
    )


def random_target(random: np.random.Generator, noise: float = NOISE) -> RandomTarget:
    """One of them; `noise` in mm."""
    n = random.integers(1, 6)
    while True:
        kinds = tuple(str(kind) for kind in random.choice(KINDS, n))
        strains = np.array([_strains(kind, random) for kind in kinds])
        if _told_apart(kinds, strains):
            break
    lengths = random.uniform(*LENGTHS, n)
    turn = random.standard_normal(3)
    turn *= random.uniform(0, np.pi) / np.linalg.norm(turn)
    pose = se3.make_pose(se3.exp_rotation(turn), random.uniform(-50, 50, 3))
    target = RandomTarget(np.empty((0, 3)), kinds, lengths, strains, pose)
    steps = np.concatenate([[0.0], np.cumsum(random.uniform(*UNEVEN, POINTS - 1))])
    exact = target.exact(steps / steps[-1] * lengths.sum())
    points = exact + noise * random.standard_normal(exact.shape)
    return RandomTarget(points, kinds, lengths, strains, pose)


def random_targets(count: int = COUNT, noise: float = NOISE, seed: int = SEED) -> list[RandomTarget]:
    """The targets of the part `segmentation`."""
    random = np.random.default_rng(seed)
    return [random_target(random, noise) for _ in range(count)]
