"""This process as a node of the ROS graph: its start, its options, its log and its end."""

from __future__ import annotations

import logging
import os
import sys
from functools import partial
from typing import Any

import rospkg
import rospy

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.core.signals import DONE, Wish, interrupt, note
from ros_visualise.runtime.bridge.logged import log_to
from ros_visualise.runtime.ros1.clock_watch import watch_clock
from ros_visualise.runtime.ros1.errors import asking
from ros_visualise.runtime.ros1.handshakes import mend_handshakes
from ros_visualise.runtime.ros1.pollers import mend_pollers
from ros_visualise.runtime.ros1.registration import keep_registered, wait_for_master

_PACKAGE = "package://"
_LOOK_S = 1.0

_log = logging.getLogger(__name__)
_wish = Wish()

_SAY = {
    logging.DEBUG: partial(rospy.logdebug, "%s"),
    logging.INFO: partial(rospy.loginfo, "%s"),
    logging.WARNING: partial(rospy.logwarn, "%s"),
    logging.ERROR: partial(rospy.logerr, "%s"),
    logging.CRITICAL: partial(rospy.logfatal, "%s"),
}


def begin(name: str) -> None:
    """Register as a node, with each master that there is, and send what is logged to rosout.

    Without its master a node goes on, unless ``~end_with_master`` is set.
    """
    _return_to_where_it_was_typed()
    wait_for_master()
    mend_pollers()
    mend_handshakes()
    stop = interrupt(DONE)
    try:
        with asking("the ROS master"):
            rospy.init_node(name, disable_signals=True)  # its own handler may wait for itself
        note(_wish)
    except (KeyboardInterrupt, RosVisualiseError):
        if stop.asked:  # before it has begun
            sys.exit(DONE)
        raise
    log_to(_SAY)
    keep_registered(_end_without_master if option("end_with_master", False) else _say_alone)
    supervision.start("clock watch", partial(watch_clock, is_over), again_s=_LOOK_S)


def arguments() -> list[str]:
    """What stands on the command line beside remappings and private parameters."""
    return list(rospy.myargv())[1:]


def option(name: str, default: Any) -> Any:
    """A private ROS parameter that is read once."""
    with asking("the ROS master"):
        return rospy.get_param(f"~{name}", default)


def resolve(name: str) -> str:
    """A topic's name on the graph, remapped as this node was told to; the node's own for ``~``."""
    return str(rospy.resolve_name(name)) if name != "~" else str(rospy.get_name())


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


def _return_to_where_it_was_typed() -> None:
    """roslaunch starts nodes in ROS_HOME; a path that a person gave it is meant from elsewhere."""
    typed_in = os.environ.get("PWD", "")
    if os.path.isdir(typed_in) and os.path.samefile(os.getcwd(), rospkg.get_ros_home()):
        os.chdir(typed_in)


def _say_alone() -> None:
    _log.warning("lost the ROS master; this node goes on, and registers again when it comes back")


def _end_without_master() -> None:
    _log.warning("lost the ROS master; shutting down")
    _wish.asked = True
