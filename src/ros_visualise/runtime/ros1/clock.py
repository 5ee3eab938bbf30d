"""The time of the ROS graph."""

from __future__ import annotations

import rospy

from ros_visualise.core.rate import Clock, SimulatedClock, WallClock
from ros_visualise.runtime.ros1.errors import MASTER, translated


def ros_clock() -> Clock:
    """Simulated time where ``/use_sim_time`` is set, else the time of day."""
    with translated(MASTER):
        is_simulated = rospy.get_param("/use_sim_time", False)
    if not is_simulated:
        return WallClock()
    return SimulatedClock(lambda: int(rospy.Time.now().to_nsec()))
