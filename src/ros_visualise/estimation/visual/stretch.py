"""One stretch of a camera's way, from its first view to a loss: its window, and what left it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.keyframes import Keyframe
from ros_visualise.estimation.visual.window import KeyframeWindow
from ros_visualise.geometry import se3


class VisualPose(NamedTuple):
    """Pose of the left camera in that of the first image, T_first_camera.

    Attributes:
        covariance: (6, 6) of its twist in the first camera's frame.
        in_metres: False while the scale is unknown.
        is_lost: True for the last known pose, with the covariance of what may have happened since.
    """

    stamp_ns: int
    R: Floats
    p: Floats
    covariance: Floats
    in_metres: bool
    is_lost: bool = False

    def scaled(self, factor: float) -> VisualPose:
        """The same in other units."""
        by = np.repeat([factor, 1.0], 3)
        covariance = by[:, None] * self.covariance * by
        return self._replace(p=self.p * factor, covariance=covariance)


@dataclass(eq=False)
class Stretch:
    """See the module.

    Attributes:
        window: its frame is that of the first view, whose origin has moved by ``offset`` (3,).
        start: T_first_map.
        in_metres: True if the scale is known.
        scale_sigma: standard deviation of lengths that is common to all, as a fraction.
        between: key of a keyframe -> images after it, located in it.
        covariances: key of a keyframe -> of its twist, in the frame of the first view.
        left: poses that left the window, in the frame of the first view.
    """

    window: KeyframeWindow
    start: VisualPose
    in_metres: bool
    scale_sigma: float = 0.0
    offset: Floats = field(default_factory=lambda: np.zeros(3))
    between: dict[int, list[VisualPose]] = field(default_factory=dict)
    covariances: dict[int, Floats] = field(default_factory=dict)
    left: list[VisualPose] = field(default_factory=list)

    def settle(self) -> None:
        """Note the newest keyframe's covariance, and move the origin to the oldest one."""
        newest = self.window.newest
        change = se3.adjoint(np.eye(3), -self.offset)
        seen = self.window.sightings()
        self.covariances[newest.key] = change @ self.window.covariance(seen) @ change.T
        self.between.setdefault(newest.key, [])
        oldest = self.window.slide(seen)
        if oldest is not None:
            self.left += self._of(oldest)
        by = -self.window.frames[0].p
        self.window.shift(by)
        self.offset = self.offset + by

    def at(self, stamp_ns: int, R: Floats, p: Floats, own: Floats) -> VisualPose:
        """A pose of the window, whose error beside the newest keyframe's is ``own`` (6, 6)."""
        change = se3.adjoint(np.eye(3), -self.offset)
        covariance = self.covariances[self.window.newest.key] + change @ own @ change.T
        return self._placed(VisualPose(stamp_ns, R, p - self.offset, covariance, self.in_metres))

    def scale(self, factor: float) -> None:
        """Multiply all lengths."""
        self.window.scale(factor)
        self.offset = self.offset * factor
        self.left = [one.scaled(factor) for one in self.left]
        self.between = {
            key: [one.scaled(factor) for one in several] for key, several in self.between.items()
        }
        by = np.repeat([factor, 1.0], 3)
        self.covariances = {key: by[:, None] * P * by for key, P in self.covariances.items()}

    def taken(self, all_of_it: bool = False) -> list[VisualPose]:
        """The poses that change no more, or all; they are kept no longer."""
        if all_of_it:
            self.left += [one for frame in self.window.frames for one in self._of(frame)]
        left, self.left = self.left, []
        return [self._placed(one._replace(in_metres=self.in_metres)) for one in left]

    def points(self) -> Floats:
        """(N, 3) points of the map, in the frame of the first image."""
        points: Floats = (self.window.positions() - self.offset) @ self.start.R.T
        return points + self.start.p

    def _of(self, frame: Keyframe) -> list[VisualPose]:
        """A keyframe and the images after it, in the frame of the first view."""
        p, P = frame.p - self.offset, self.covariances[frame.key]
        found = [VisualPose(frame.stamp_ns, frame.R, p, P, self.in_metres)]
        ahead = se3.adjoint(frame.R, p)
        for one in self.between.pop(frame.key, []):
            covariance = P + ahead @ one.covariance @ ahead.T
            R, place = frame.R @ one.R, frame.R @ one.p + p
            found.append(VisualPose(one.stamp_ns, R, place, covariance, self.in_metres))
        return found

    def _placed(self, pose: VisualPose) -> VisualPose:
        start = self.start
        change = se3.adjoint(start.R, start.p)
        way = start.R @ pose.p
        covariance = start.covariance + change @ pose.covariance @ change.T
        covariance[:3, :3] += self.scale_sigma**2 * np.outer(way, way)
        return pose._replace(R=start.R @ pose.R, p=way + start.p, covariance=covariance)
