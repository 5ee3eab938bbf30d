"""The time of the ROS graph."""

from __future__ import annotations

import threading
from collections.abc import Callable

import genpy
import rospy
from rosgraph_msgs.msg import Clock as ClockMessage

from ros_visualise import supervision
from ros_visualise.rate import Clock, WallClock
from ros_visualise.runtime.bridge.simulated_time import SimulatedClock

_PERIOD_S = 0.01


class ClockPublisher:
    """Publishes /clock, a hundred times a second.

    Args:
        now_ns: gives the time.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._publisher = rospy.Publisher("/clock", ClockMessage, queue_size=1)
        self._closed = threading.Event()
        self._thread = supervision.start("clock", self._run, again_s=_PERIOD_S)

    def close(self) -> None:
        """Time stands still."""
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closed.wait(_PERIOD_S):
            try:
                self._publisher.publish(ClockMessage(genpy.Time(*divmod(self._now_ns(), 10**9))))
            except rospy.ROSException:  # this node is about to leave the graph
                return


def ros_clock() -> Clock:
    """Simulated time where ``/use_sim_time`` is set, else the time of day."""
    if not rospy.get_param("/use_sim_time", False):
        return WallClock()
    return SimulatedClock(lambda: int(rospy.Time.now().to_nsec()))
