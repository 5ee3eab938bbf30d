"""The time of the ROS 2 graph."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage

from ros_visualise.core.rate import Clock, SimulatedClock, WallClock
from ros_visualise.runtime.ros2.session import Session

log = logging.getLogger(__name__)

_LOOK_S = 0.1
_PERIOD_S = 0.01
_PATIENCE_S = 15.0  # a simulation may take as long before it begins
_NS = 1_000_000_000


class ClockPublisher:
    """Publishes /clock, a hundred times a second.

    Args:
        session: of this process.
        now_ns: gives the time.
    """

    def __init__(self, session: Session, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._publisher = session.node.create_publisher(ClockMessage, "/clock", 1)
        self._closed = threading.Event()
        self._thread = session.start(self._run, "/clock", again_s=_PERIOD_S)

    def close(self) -> None:
        """Time stands still."""
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        message = ClockMessage()
        while not self._closed.wait(_PERIOD_S):
            message.clock.sec, message.clock.nanosec = divmod(self._now_ns(), _NS)
            self._publisher.publish(message)


def ros_clock(node: Node) -> Clock:
    """Simulated time where ``use_sim_time`` is set, else the time of day."""
    clock: Any = node.get_clock()
    return SimulatedClock(lambda: clock.now().nanoseconds) if uses_sim_time(node) else WallClock()


def uses_sim_time(node: Node) -> bool:
    """Whether the node's time is that of /clock."""
    return bool(node.get_clock().ros_time_is_active)


def watch_clock(node: Node, is_over: Callable[[], bool]) -> None:
    """Say it once if ``use_sim_time`` is set and nobody publishes /clock: then no time passes."""
    clock: Any = node.get_clock()
    end_s = time.monotonic() + _PATIENCE_S
    while uses_sim_time(node) and not (is_over() or clock.now().nanoseconds):
        if time.monotonic() > end_s:
            log.warning(
                "use_sim_time is set, and nobody publishes /clock: no time passes; if nobody is"
                " going to: start %s again with -p use_sim_time:=false",
                node.get_fully_qualified_name(),
            )
            return
        time.sleep(_LOOK_S)
