"""Noticing that no time passes: ``/use_sim_time`` is set, and nobody publishes ``/clock``."""

from __future__ import annotations

import http.client
import logging
import time
import xmlrpc.client
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy

from ros_visualise.runtime.ros1.registration import BoundedTransport

log = logging.getLogger(__name__)

_LOOK_S = 0.3
_PATIENCE_S = 1.5
"""For so long a node may have begun, and not published ``/clock`` yet."""
_LAUNCH_S = 30.0
"""Processes that have not become nodes in so long a time are none."""
_MASTER = "master"
_ERRORS = (OSError, http.client.HTTPException, xmlrpc.client.Error, rosgraph.MasterException)


def watch_clock(is_over: Callable[[], bool]) -> None:
    """Say it once, as after a launch file that left ``/use_sim_time`` behind.

    Where roslaunch is starting other nodes, they are given time: one may be who publishes it.
    """
    begun_s = settled_s = time.monotonic()
    while not (is_over() or rospy.rostime.is_wallclock() or rospy.get_time()):
        now_s = time.monotonic()
        try:
            nodes, has_clock = _look()
            if has_clock:
                return
            if now_s - begun_s < _LAUNCH_S and _launched() - nodes:
                settled_s = now_s
        except _ERRORS as error:
            log.debug("the graph cannot be looked at: %s", error)
        if now_s - settled_s > _PATIENCE_S:
            log.warning(
                "/use_sim_time is set, and nobody publishes /clock: no time passes. If nobody is"
                " going to: rosparam delete /use_sim_time, and start this node again"
            )
            return
        time.sleep(_LOOK_S)


def _look() -> tuple[set[str], bool]:
    """The last names of all nodes, and whether one publishes ``/clock``."""
    master = rosgraph.Master(rospy.get_name())
    state = master.getSystemState()
    nodes = {node.rpartition("/")[2] for kind in state for _, there in kind for node in there}
    clocks = [node for topic, there in state[0] if topic == "/clock" for node in there]
    return nodes, any(_is_alive(master, node) for node in clocks)


def _is_alive(master: rosgraph.Master, node: str) -> bool:
    """Whether a node answers: the master still lists those that were killed."""
    try:
        proxy = xmlrpc.client.ServerProxy(master.lookupNode(node), transport=BoundedTransport())
        return bool(proxy.getPid(rospy.get_name()))
    except _ERRORS:
        return False


def _launched() -> set[str]:
    """The last names of the nodes that roslaunch runs as processes."""
    names: set[str] = set()
    for uri in rospy.get_param("/roslaunch/uris", {}).values():
        roslaunch: Any = xmlrpc.client.ServerProxy(uri, transport=BoundedTransport())
        try:
            processes = roslaunch.get_node_names()[2]
        except _ERRORS:  # it has ended and left its address behind
            continue
        names |= {process.rpartition("-")[0] or _MASTER for process in processes}
    return names - {_MASTER}
