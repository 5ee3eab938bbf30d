"""The last seconds of odometry, for images that are processed later."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

from ros_visualise.geometry.rigid import Pose, interpolate
from ros_visualise.landmarks.navigation.motion import GAP_NS, OdometryStep, step_between


class OdometryBuffer:
    """Poses of the robot in the odometry's frame, by time."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._poses: list[Pose] = []

    @property
    def newest_ns(self) -> int | None:
        """Time of the last pose."""
        return self._stamps_ns[-1] if self._stamps_ns else None

    @property
    def newest(self) -> Pose:
        """The last pose."""
        return self._poses[-1]

    @property
    def oldest_ns(self) -> int | None:
        """Time of the first pose in the buffer."""
        return self._stamps_ns[0] if self._stamps_ns else None

    def add(self, stamp_ns: int, pose: Pose) -> OdometryStep | None:
        """Add a pose newer than all others; returns the step to it from the last one."""
        step = None
        if self._stamps_ns:
            step = step_between(self._poses[-1], pose, self._stamps_ns[-1], stamp_ns)
        self._stamps_ns.append(stamp_ns)
        self._poses.append(pose)
        return step

    def at(self, stamp_ns: int) -> Pose:
        """The pose at a time between the first and the last, interpolated."""
        after = bisect_left(self._stamps_ns, stamp_ns)
        if self._stamps_ns[after] == stamp_ns:
            return self._poses[after]
        start, end = self._stamps_ns[after - 1], self._stamps_ns[after]
        part = (stamp_ns - start) / (end - start)
        return interpolate(self._poses[after - 1], self._poses[after], part)

    def steps(self, from_ns: int, to_ns: int) -> list[OdometryStep]:
        """The motions from one time to another."""
        inner = slice(bisect_right(self._stamps_ns, from_ns), bisect_left(self._stamps_ns, to_ns))
        stamps = [from_ns, *self._stamps_ns[inner], to_ns]
        poses = [self.at(from_ns), *self._poses[inner], self.at(to_ns)]
        return [
            step_between(a, b, start, end, self._is_guess(start) or self._is_guess(end))
            for a, b, start, end in zip(poses, poses[1:], stamps, stamps[1:], strict=False)
        ]

    def _is_guess(self, stamp_ns: int) -> bool:
        """True if the time is inside a gap."""
        after = bisect_left(self._stamps_ns, stamp_ns)
        if self._stamps_ns[after] == stamp_ns:
            return False
        return self._stamps_ns[after] - self._stamps_ns[after - 1] > GAP_NS

    def forget(self, before_ns: int) -> None:
        """Forget older poses, except the last of them."""
        count = max(bisect_right(self._stamps_ns, before_ns) - 1, 0)
        del self._stamps_ns[:count], self._poses[:count]
