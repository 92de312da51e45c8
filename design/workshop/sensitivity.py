"""Which dimensions a casting must keep most: each one changed a little, for any design, searched or made by
hand."""

from dataclasses import replace

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.design.search.tolerances import PER_ANGLE, PER_LENGTH, Effect, dimensions, largest
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import Manipulator
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.prediction import predict_design

#: equal fractions of arc length at which shapes are compared
STATIONS = np.linspace(0, 1, 101)


def sensitive(design: DesignFile, law: SegmentLaw, count: int = 8) -> list[Effect]:
    """The changes that move the shape most; none where the law has no equilibrium at the design's pressure.
    A dimension of a body that cannot be built with it changed is left out."""
    try:
        rest = _points(design, design.manipulator, law)
    except (InputError, ConvergenceError):
        return []
    effects = []
    for i, segment in enumerate(design.manipulator.segments):
        for name in dimensions(segment):
            step = PER_ANGLE if name == "angle" else PER_LENGTH
            moved = _moved(design, i, {name: getattr(segment, name) + step}, law)
            if moved is None:
                moved = _moved(design, i, {name: getattr(segment, name) - step}, law)
            if moved is None:
                continue
            distances = np.linalg.norm(moved - rest, axis=1)
            unit = "deg" if name == "angle" else "mm"
            rms = float(np.sqrt(np.mean(distances**2)))
            effects.append(Effect(f"{name}_{unit}", i + 1, f"{step:g} {unit}", rms, float(distances[-1])))
    return largest(effects, count)


def _moved(design, i, change, law):
    segments = list(design.manipulator.segments)
    try:
        segments[i] = replace(segments[i], **change)
        return _points(design, Manipulator(tuple(segments)), law)
    except (InputError, ConvergenceError):
        return None


def _points(design, manipulator, law):
    line = predict_design(replace(design, manipulator=manipulator), design.pressure, law)
    return np.column_stack([np.interp(STATIONS * line.s[-1], line.s, x) for x in line.points.T])
