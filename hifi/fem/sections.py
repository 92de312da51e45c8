"""Section frames and rod strains of a deformed body, measured as `base.frames` defines them."""

import numpy as np
from mpi4py import MPI

from pneunet.base import se3
from pneunet.base.frames import FitMoments, frame_at
from pneunet.base.strains import RodStrains
from pneunet.geometry import tags
from pneunet.geometry.parameters import Manipulator
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.mixed_field import MixedField


class SectionFrames:
    """Frames at stations along a manipulator: best rigid fits of the channel's wall over one pitch around
    each.

    Surface integrals are exact for the quadratic displacement, cut at the window's ends. The base frame is
    the clamp's; the tip frame is the fit of the tip face. `stations` (n,) are undeformed arc lengths in mm.
    """

    def __init__(self, problem: MixedField, manipulator: Manipulator):
        self.problem, self.manipulator = problem, manipulator
        self.comm = problem.mesh.comm
        wall = surface.facet_nodes(problem, tags.CHANNEL)
        windows, self.segment_stations = [], []
        for segment, start in zip(manipulator.segments, manipulator.starts):
            s = np.arange(2 * segment.chambers - 1) * segment.pitch / 2 + start + segment.chamber_positions[0]
            self.segment_stations.append(s[::2])
            windows += [(x, segment.pitch) for x in s]
            joint = start + segment.length
            if joint < manipulator.length - 1e-9:
                windows.append((joint, segment.pitch))
        windows = sorted(windows)
        self._integrals = [
            surface.SlabIntegral(problem, wall, s - pitch / 2, s + pitch / 2) for s, pitch in windows
        ]
        self._integrals.append(surface.SlabIntegral(problem, surface.facet_nodes(problem, tags.TIP)))
        self.stations = np.array([0.0] + [s for s, _ in windows] + [manipulator.length])

    def frames(self, array: np.ndarray | None = None) -> np.ndarray:
        """(stations, 4, 4) section frames of the current state (or of a state array); the same on all
        ranks."""
        positions = self.problem.nodes + self.problem.displacement(array)
        rows = self.comm.allreduce(
            np.array([integral.moments(positions) for integral in self._integrals]), op=MPI.SUM
        )
        motions = np.array([np.eye(4)] + [FitMoments(row).pose() for row in rows])
        return frame_at(motions, self.stations)

    def segment_strains(self, frames: np.ndarray) -> RodStrains:
        """RodStrains of shape (segments, 3): mean of the per-pitch strains between the chambers of each
        segment.

        A segment of one chamber is measured between its ends.
        """
        e, k = [], []
        for stations, start, segment in zip(
            self.segment_stations, self.manipulator.starts, self.manipulator.segments
        ):
            index = [int(np.argmin(abs(self.stations - s))) for s in stations]
            if len(index) < 2:
                index = [int(np.argmin(abs(self.stations - s))) for s in (start, start + segment.length)]
            relative = se3.inverse_pose(frames[index[:-1]]) @ frames[index[1:]]
            strains = RodStrains.from_relative_pose(relative, np.diff(self.stations[index]))
            e.append(strains.e.mean(0))
            k.append(strains.k.mean(0))
        return RodStrains(np.array(e), np.array(k))
