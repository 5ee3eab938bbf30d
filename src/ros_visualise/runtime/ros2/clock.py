"""The time of the ROS 2 graph."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from ros_visualise.core.rate import Clock, SimulatedClock, WallClock

log = logging.getLogger(__name__)

_LOOK_S = 0.1
_PATIENCE_S = 15.0  # a simulation may take as long before it begins


def ros_clock(node: Node) -> Clock:
    """Simulated time where ``use_sim_time`` is set, else the time of day."""
    clock: Any = node.get_clock()
    return SimulatedClock(lambda: clock.now().nanoseconds) if uses_sim_time(node) else WallClock()


def uses_sim_time(node: Node) -> bool:
    """True if the node's time is that of /clock."""
    return bool(node.get_clock().ros_time_is_active)


def watch_clock(node: Node, is_over: Callable[[], bool]) -> None:
    """Warn once if ``use_sim_time`` is set and /clock is not published: then no time passes."""
    clock: Any = node.get_clock()
    end_s = time.monotonic() + _PATIENCE_S
    while uses_sim_time(node) and not (is_over() or clock.now().nanoseconds):
        if time.monotonic() > end_s:
            log.warning(
                "use_sim_time is set and nothing publishes /clock: simulated time is not advancing."
                " If no clock is expected, restart %s with -p use_sim_time:=false",
                node.get_fully_qualified_name(),
            )
            return
        time.sleep(_LOOK_S)
