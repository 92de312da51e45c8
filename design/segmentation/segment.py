"""The public function: a target in, its `Segmentation` out."""

import numpy as np

from pneunet.base import se3
from pneunet.design.segmentation.segmentation import Segmentation
from pneunet.design.target.extraction import extract
from pneunet.design.target.segmentation import split
from pneunet.design.target.target import Piece, Target


def segment(target: Target) -> Segmentation:
    """The `Segmentation` of a target; its own pieces are kept where it has any."""
    wanted = extract(target, target.pieces or split(target.curve))
    pieces = tuple(Piece(w.kind, w.length, w.twist, w.curvature) for w in wanted)
    strains = np.array([[p.twist, p.curvature, 0.0] for p in pieces], float)
    rms = float(np.sqrt(np.mean([w.fit_rms**2 for w in wanted])))
    pose = se3.make_pose(np.eye(3), target.points[0])
    return Segmentation(pieces, pose, strains, 0 * strains, 0.0, rms, np.nan, target.curve)
