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
    each, at a bulkhead over half a pitch of channel on either side of it.

    Surface integrals are exact for the quadratic displacement, cut at the window's ends. The base frame is
    the clamp's; the tip frame is the fit of the tip face. `stations` (n,) are undeformed arc lengths in mm.
    """

    def __init__(self, problem: MixedField, manipulator: Manipulator):
        self.problem, self.manipulator = problem, manipulator
        self.comm = problem.mesh.comm
        channels = [tags.cavity_tags(group)[1] for group in range(1, len(manipulator.groups) + 1)]
        wall = surface.facet_nodes(problem, *channels)
        windows, self.segment_stations, segments = [], [], manipulator.segments
        for i, (segment, start) in enumerate(zip(segments, manipulator.starts)):
            half, (first, last) = segment.pitch / 2, manipulator.channels[segment.group - 1]
            if segment.chambers:
                own = start + np.arange(2 * segment.chambers - 1) * half + segment.chamber_positions[0]
            else:
                own = start + np.arange(half, segment.length, half)
                own = own[(own - half >= first) & (own + half <= last)]
            self.segment_stations.append(own[::2])
            windows += [(s, s - half, s + half) for s in own]
            for following in segments[i + 1 : i + 2]:
                joint, walls = start + segment.length, (0.0, 0.0)
                if following.group != segment.group:
                    walls = segment.end_wall, following.end_wall
                windows.append((joint, joint - walls[0] - half, joint + walls[1] + half))
        windows = sorted(windows)
        self._integrals = [surface.SlabIntegral(problem, wall, low, high) for _, low, high in windows]
        self._integrals.append(surface.SlabIntegral(problem, surface.facet_nodes(problem, tags.TIP)))
        self.stations = np.array([0.0] + [s for s, _, _ in windows] + [manipulator.length])

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
