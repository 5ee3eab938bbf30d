"""The time of the ROS graph."""

from __future__ import annotations

import threading
from collections.abc import Callable

import genpy
import rospy
from rosgraph_msgs.msg import Clock as ClockMessage

from ros_visualise.core import supervision
from ros_visualise.core.rate import Clock, SimulatedClock, WallClock
from ros_visualise.runtime.ros1.errors import MASTER, translated
from ros_visualise.runtime.ros1.topics import Publisher

_PERIOD_S = 0.01


class ClockPublisher:
    """Publishes /clock, a hundred times a second.

    Args:
        now_ns: gives the time.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._publisher = Publisher("/clock", ClockMessage)
        self._closed = threading.Event()
        self._thread = supervision.start("clock", self._run, again_s=_PERIOD_S)

    def close(self) -> None:
        """Time stands still."""
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closed.wait(_PERIOD_S):
            self._publisher.publish(ClockMessage(genpy.Time(*divmod(self._now_ns(), 10**9))))


def ros_clock() -> Clock:
    """Simulated time where ``/use_sim_time`` is set, else the time of day."""
    with translated(MASTER):
        is_simulated = rospy.get_param("/use_sim_time", False)
    if not is_simulated:
        return WallClock()
    return SimulatedClock(lambda: int(rospy.Time.now().to_nsec()))
