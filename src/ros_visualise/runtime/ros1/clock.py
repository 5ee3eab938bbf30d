"""The time of the ROS graph, and a warning where simulated time does not advance."""

from __future__ import annotations

import logging
import math
import time
import xmlrpc.client
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy

from ros_visualise.core.rate import Clock, SimulatedClock, WallClock
from ros_visualise.runtime.ros1.errors import MASTER, UNANSWERED, translated
from ros_visualise.runtime.ros1.registration import BoundedTransport


def ros_clock() -> Clock:
    """Simulated time where ``/use_sim_time`` is set, else the time of day."""
    with translated(MASTER):
        is_simulated = rospy.get_param("/use_sim_time", False)
    if not is_simulated:
        return WallClock()
    return SimulatedClock(lambda: int(rospy.Time.now().to_nsec()))


log = logging.getLogger(__name__)

_LOOK_S = 0.3
_PATIENCE_S = 1.5
"""Longest time from a node's registration to that of its ``/clock``."""
_LAUNCH_S = 30.0
"""Longest time until a process is a node, and until a node answers."""
_MASTER = "master"


def watch_clock(is_over: Callable[[], bool]) -> None:
    """Warn once, as after a launch file that left ``/use_sim_time`` behind."""
    begun_s = settled_s = time.monotonic()
    while not (is_over() or rospy.rostime.is_wallclock() or rospy.get_time()):
        expected_s = _expected_s()
        now_s = time.monotonic()
        if now_s - begun_s < expected_s:
            settled_s = now_s
        elif now_s - settled_s > _PATIENCE_S:
            log.warning(
                "/use_sim_time is set and nothing publishes /clock: simulated time is not"
                " advancing. If no clock is expected: rosparam delete /use_sim_time, and restart"
                " this node"
            )
            return
        time.sleep(_LOOK_S)


def _expected_s() -> float:
    """Seconds from this node's start for which a clock may be expected, as the graph is now.

    A simulation or a recording may open slowly: a node that publishes ``/clock`` is waited for as
    long as it answers.
    """
    master = rosgraph.Master(rospy.get_name())
    try:
        state = master.getSystemState()
        nodes = {node.removeprefix("/") for kind in state for _, there in kind for node in there}
        clocks = [node for topic, there in state[0] if topic == "/clock" for node in there]
        answers = [_answers(master, node) for node in clocks]
        if True in answers:
            return math.inf
        return _LAUNCH_S if None in answers or _launched() - nodes else 0.0
    except UNANSWERED as error:
        log.debug("cannot read the graph: %s", error)
        return math.inf


def _answers(master: Any, node: str) -> bool | None:
    """True if a node answers: the master still lists killed ones; None if it may be busy."""
    try:
        proxy = xmlrpc.client.ServerProxy(master.lookupNode(node), transport=BoundedTransport())
        return bool(proxy.getPid(rospy.get_name()))
    except (ConnectionRefusedError, rosgraph.MasterException):
        return False
    except UNANSWERED:
        return None


def _launched() -> set[str]:
    """The names of the nodes that roslaunch runs as processes, without the first slash."""
    names: set[str] = set()
    for uri in rospy.get_param("/roslaunch/uris", {}).values():
        roslaunch: Any = xmlrpc.client.ServerProxy(uri, transport=BoundedTransport())
        try:
            processes = roslaunch.get_node_names()[2]
        except UNANSWERED:  # it has ended and left its address behind
            continue
        names |= {process.rpartition("-")[0] or _MASTER for process in processes}
    return names - {_MASTER}
