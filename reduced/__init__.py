"""What is fast: the rod, free and under load, and the laws that predict a manipulator's shape. numpy and
scipy alone."""

from pneunet.reduced.choice import choose_law, shipped_law
from pneunet.reduced.model import AnalyticModel, SegmentLaw, doubts, predict
from pneunet.reduced.rod.centreline import Centreline, centreline, free_shapes
from pneunet.reduced.rod.laws import QuadraticLaw, RodLaw
from pneunet.reduced.rod.outline import body_surface
from pneunet.reduced.rod.rod import Piece, Rod

__all__ = [
    "AnalyticModel",
    "Centreline",
    "Piece",
    "QuadraticLaw",
    "Rod",
    "RodLaw",
    "SegmentLaw",
    "body_surface",
    "centreline",
    "choose_law",
    "doubts",
    "free_shapes",
    "predict",
    "shipped_law",
]
