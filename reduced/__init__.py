"""What is fast: the rod, free and under load, and the laws that predict a manipulator's shape. numpy and
scipy alone."""

from reduced.body import body_surface
from reduced.centreline import Centreline, centreline, free_shapes
from reduced.choice import choose_law, shipped_law
from reduced.model import AnalyticModel, SegmentLaw, doubts, predict
from reduced.rod import Piece, Rod
from reduced.section_laws import QuadraticLaw, RodLaw

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
