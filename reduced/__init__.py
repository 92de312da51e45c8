"""What is fast: the rod, free and under load, and the laws that predict a manipulator's shape. numpy and
scipy alone."""

from pneunet.reduced.analytic.law import AnalyticLaw
from pneunet.reduced.choice import choose_law, shipped_law
from pneunet.reduced.rod.centreline import Centreline, centreline, free_shapes
from pneunet.reduced.rod.laws import SectionLaw, SegmentLaw
from pneunet.reduced.rod.outline import body_surface
from pneunet.reduced.rod.prediction import doubts, predict
from pneunet.reduced.rod.quadratic import QuadraticLaw
from pneunet.reduced.rod.rod import Rod, RodPiece, RodState
from pneunet.reduced.trained.file import read_law
from pneunet.reduced.trained.law import TrainedLaw

__all__ = [
    "AnalyticLaw",
    "Centreline",
    "QuadraticLaw",
    "Rod",
    "RodPiece",
    "RodState",
    "SectionLaw",
    "SegmentLaw",
    "TrainedLaw",
    "body_surface",
    "centreline",
    "choose_law",
    "doubts",
    "free_shapes",
    "predict",
    "read_law",
    "shipped_law",
]
