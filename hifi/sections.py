"""Section frames and rod strains of a deformed body, measured as `base.frames` defines them."""

import numpy as np
from mpi4py import MPI

from base import se3
from base.frames import FitMoments, frame_at
from base.strains import RodStrains
from geometry import cad
from hifi import surface


class SectionFrames:
    """Frames at stations along a manipulator: best rigid fits of the channel's wall over one pitch around each.

    Surface integrals use the mid-edge rule, exact for the quadratic displacement on plane facets. The base frame is the
    clamp's; the tip frame is the fit of the tip face. `stations` (n,) are undeformed arc lengths in mm.
    """

    def __init__(self, problem, manipulator):
        self.problem, self.manipulator = problem, manipulator
        self.comm = problem.mesh.comm
        self._channel = self._samples(cad.CHANNEL)
        self._tip = self._samples(cad.TIP)
        channel = cad.channel_range(manipulator)
        windows, self.segment_stations = [], []
        for segment, start in zip(manipulator.segments, manipulator.starts):
            s = np.arange(2 * segment.chambers - 1) * segment.pitch / 2 + start + segment.chamber_positions[0]
            self.segment_stations.append(s[::2])
            windows += [(x, segment.pitch) for x in s]
            joint = start + segment.length
            if joint < manipulator.length - 1e-9:
                windows.append((joint, segment.pitch))
        windows = [self._wide_enough(s, pitch) for s, pitch in windows if channel[1] - channel[0] > pitch]
        self._windows = sorted(windows)
        self.stations = np.array([0.0] + [s for s, _ in self._windows] + [manipulator.length])

    def _samples(self, tag):
        """(nodes (3 n,), weights (3 n,)) of the mid-edge rule on the tagged facets of this rank."""
        facets = surface.facet_nodes(self.problem, tag)
        weights = np.repeat(surface.reference_areas(self.problem, facets) / 3, 3)
        return facets[:, 3:].ravel(), weights

    def _inside(self, s, width):
        nodes, weights = self._channel
        return np.abs(self.problem.nodes[nodes, 0] - s) <= width / 2

    def _wide_enough(self, s, width):
        """The window, widened until it holds enough wall to define a rotation on a coarse mesh."""
        while self.comm.allreduce(int(self._inside(s, width).sum()), op=MPI.SUM) < 18 and width < self.manipulator.length:
            width *= 1.25
        return s, width

    def _moments(self, samples, chosen, displacement):
        nodes, weights = samples[0][chosen], samples[1][chosen]
        X = self.problem.nodes[nodes]
        return FitMoments.of(X, X + displacement[nodes], weights).values

    def frames(self, array=None):
        """(stations, 4, 4) section frames of the current state (or of a state array); the same on all ranks."""
        u = self.problem.displacement(array)
        rows = [self._moments(self._channel, self._inside(*window), u) for window in self._windows]
        rows.append(self._moments(self._tip, slice(None), u))
        rows = self.comm.allreduce(np.array(rows), op=MPI.SUM)
        motions = np.array([np.eye(4)] + [FitMoments(row).pose() for row in rows])
        return frame_at(motions, self.stations)

    def segment_strains(self, frames):
        """RodStrains of shape (segments, 3): mean of the per-pitch strains between the chambers of each segment.

        A segment of one chamber, or one without channel wall, is measured between its ends.
        """
        e, k = [], []
        for stations, start, segment in zip(self.segment_stations, self.manipulator.starts, self.manipulator.segments):
            index = [int(np.argmin(abs(self.stations - s))) for s in stations]
            if len(index) < 2 or max(abs(self.stations[index] - stations)) > 1e-9:
                index = [int(np.argmin(abs(self.stations - s))) for s in (start, start + segment.length)]
            relative = se3.inverse_pose(frames[index[:-1]]) @ frames[index[1:]]
            strains = RodStrains.from_relative_pose(relative, np.diff(self.stations[index]))
            e.append(strains.e.mean(0))
            k.append(strains.k.mean(0))
        return RodStrains(np.array(e), np.array(k))
