"""This process as a node of the ROS graph: its start, its options, its log and its end."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
import xmlrpc.client
from typing import Any

import rosgraph
import rospkg
import rospy

from ros_visualise.errors import OpenError
from ros_visualise.printing import Shown, say
from ros_visualise.signals import STOPPED, Wish, interrupt, note

_CHECK_S = 0.5
_CLOCK_S = 1.5  # as long as nodes that are launched together take to start
_PACKAGE = "package://"

_wish = Wish()

_SAY = {
    logging.DEBUG: rospy.logdebug,
    logging.INFO: rospy.loginfo,
    logging.WARNING: rospy.logwarn,
    logging.ERROR: rospy.logerr,
    logging.CRITICAL: rospy.logfatal,
}


def begin(name: str) -> None:
    """Register as a node, send what the package logs to rosout, and end when the master does.

    A node without its master cannot be reached by anybody new, nor be asked to end: roslaunch's own
    would stay behind.
    """
    _return_to_where_it_was_typed()
    _wait_for_master()
    interrupt()
    try:
        rospy.init_node(name, disable_signals=True)  # its own handler may wait for itself
    except (KeyboardInterrupt, rospy.ROSInitException):  # asked to end before it has begun
        sys.exit(STOPPED)
    note(_wish)
    log = logging.getLogger("ros_visualise")
    to_rosout = _ToRosout()
    to_rosout.setFormatter(Shown())
    log.addHandler(to_rosout)
    log.setLevel(logging.INFO)
    threading.Thread(target=_watch_master, name="master watch", daemon=True).start()
    threading.Thread(target=_watch_clock, name="clock watch", daemon=True).start()


def arguments() -> list[str]:
    """What stands on the command line beside remappings and private parameters."""
    return list(rospy.myargv())[1:]


def option(name: str, default: Any) -> Any:
    """A private ROS parameter that is read once."""
    return rospy.get_param(f"~{name}", default)


def resolve(name: str) -> str:
    """A topic's name on the graph, remapped as this node was told to."""
    return str(rospy.resolve_name(name))


def find_file(url: str) -> str:
    """The path of ``package://PACKAGE/FILE``; other texts as they are.

    Raises:
        OpenError: there is no such package.
    """
    if not url.startswith(_PACKAGE):
        return url
    package, _, file = url.removeprefix(_PACKAGE).partition("/")
    try:
        return os.path.join(rospkg.RosPack().get_path(package), file)
    except rospkg.ResourceNotFound:
        raise OpenError(f"{url}: no package {package!r}; rospack find {package}") from None


def is_over() -> bool:
    """Whether this node has to end."""
    return _wish.asked or bool(rospy.is_shutdown())


def end(reason: str) -> None:
    """Leave the graph."""
    rospy.signal_shutdown(reason)


class _ToRosout(logging.Handler):
    """Hands log records to rospy, which prints them and publishes them on /rosout."""

    def emit(self, record: logging.LogRecord) -> None:
        _SAY[max(level for level in _SAY if level <= max(record.levelno, logging.DEBUG))](
            "%s", self.format(record)
        )


def _return_to_where_it_was_typed() -> None:
    """roslaunch starts nodes in ROS_HOME; a path that a person gave it is meant from elsewhere."""
    typed_in = os.environ.get("PWD", "")
    if os.path.isdir(typed_in) and os.path.samefile(os.getcwd(), rospkg.get_ros_home()):
        os.chdir(typed_in)


def _wait_for_master() -> None:
    if not rosgraph.is_master_online():
        uri = rosgraph.get_master_uri()
        say(f"no ROS master at {uri} yet, waiting; start one with: roscore")
    while not rosgraph.is_master_online():
        time.sleep(_CHECK_S)


def _watch_clock() -> None:
    """Say that no time passes, as after a launch file that left ``/use_sim_time`` behind."""
    time.sleep(_CLOCK_S)
    if not is_over() and not rospy.rostime.is_wallclock() and not rospy.get_time():
        logging.getLogger(__name__).warning(
            "/use_sim_time is set, and nobody publishes /clock: no time passes. If nobody is going"
            " to: rosparam delete /use_sim_time, and start this node again"
        )


def _watch_master() -> None:
    master = xmlrpc.client.ServerProxy(rosgraph.get_master_uri())
    missed = 0
    while not rospy.is_shutdown():
        try:
            master.getPid(rospy.get_name())
            missed = 0
        except (OSError, xmlrpc.client.Error):
            missed += 1
        if missed == 2:  # a single call may fail on a busy network
            rospy.logwarn("the ROS master is gone: this node ends")
            end("no master")
        time.sleep(_CHECK_S)
