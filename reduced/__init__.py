"""What is fast: rod kinematics and the analytic laws that predict a manipulator's shape. numpy and scipy alone."""

from reduced.body import body_surface
from reduced.model import AnalyticModel, SegmentLaw, predict
from reduced.centreline import Centreline, centreline

__all__ = ["AnalyticModel", "Centreline", "SegmentLaw", "body_surface", "centreline", "predict"]
