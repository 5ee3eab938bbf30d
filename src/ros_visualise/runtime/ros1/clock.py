"""The time of the ROS graph."""

from __future__ import annotations

import threading

import rospy

from ros_visualise.rate import Clock, WallClock

_STEP_S = 0.005


class SimClock:
    """The time that somebody publishes on /clock."""

    def now_ns(self) -> int:
        """Nanoseconds as /clock has them; 0 until it has come."""
        return int(rospy.Time.now().to_nsec())

    def monotonic_ns(self) -> int:
        """The same: playing keeps to simulated time, at whatever speed that passes."""
        return self.now_ns()

    def wait(self, condition: threading.Condition, until_ns: int | None) -> None:
        """Wait for a notification, or look at the clock again."""
        condition.wait(None if until_ns is None else _STEP_S)


def ros_clock() -> Clock:
    """Simulated time where ``/use_sim_time`` is set, else the time of day."""
    return SimClock() if rospy.get_param("/use_sim_time", False) else WallClock()
