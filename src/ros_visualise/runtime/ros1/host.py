"""A process of ours as a node of a ROS 1 graph; see `ros_visualise.runtime.middleware.Host`."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterable
from functools import partial
from typing import Any

import rospkg
import rospy

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.printing import forward_log
from ros_visualise.core.signals import DONE, StopRequest, interrupt, note
from ros_visualise.runtime.middleware import Handle, Host, Managed
from ros_visualise.runtime.ros1.clock import watch_clock
from ros_visualise.runtime.ros1.errors import MASTER, translated
from ros_visualise.runtime.ros1.reconfigure_server import starting_values
from ros_visualise.runtime.ros1.registration import keep_registered, wait_for_master
from ros_visualise.runtime.ros1.repairs import mend_handshakes, mend_pollers
from ros_visualise.runtime.ros1.transport import Ros1Transport

_PACKAGE = "package://"
_LOOK_S = 1.0

_log = logging.getLogger(__name__)

_SAY = {
    logging.DEBUG: partial(rospy.logdebug, "%s"),
    logging.INFO: partial(rospy.loginfo, "%s"),
    logging.WARNING: partial(rospy.logwarn, "%s"),
    logging.ERROR: partial(rospy.logerr, "%s"),
    logging.CRITICAL: partial(rospy.logfatal, "%s"),
}


class Ros1Host(Host):
    """A node of the ROS graph of the master that ``ROS_MASTER_URI`` names."""

    flag = "{0}:={1} (for an executable: _{0}:={1})"

    def __init__(self) -> None:
        self._stop_request = StopRequest()

    def begin(self, name: str) -> Ros1Transport:
        """Register as a node, again with each new master, and log to rosout.

        Without its master a node goes on, unless ``~end_with_master`` is set.
        """
        _return_to_where_it_was_typed()
        wait_for_master()
        mend_pollers()
        mend_handshakes()
        stop = interrupt(DONE)
        try:
            with translated(MASTER):
                rospy.init_node(name, disable_signals=True)  # its own handler may wait for itself
            note(self._stop_request)
        except (KeyboardInterrupt, RosVisualiseError):
            if stop.asked:  # before it has begun
                sys.exit(DONE)
            raise
        forward_log(_SAY)
        ends = self.option("end_with_master", False)
        keep_registered(self._end_without_master if ends else _go_on_without_master)
        supervision.start("clock watch", partial(watch_clock, self.is_over), again_s=_LOOK_S)
        return Ros1Transport()

    def end(self) -> None:
        rospy.signal_shutdown("done")

    def is_over(self) -> bool:
        return self._stop_request.asked or bool(rospy.is_shutdown())

    def arguments(self) -> list[str]:
        return list(rospy.myargv())[1:]

    @translated(MASTER)
    def option(self, name: str, default: Any) -> Any:
        return rospy.get_param(f"~{name}", default)

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        return starting_values(params, namespace, known)

    def find_file(self, url: str) -> str:
        if not url.startswith(_PACKAGE):
            return url
        package, _, file = url.removeprefix(_PACKAGE).partition("/")
        with translated(url):
            return os.path.join(rospkg.RosPack().get_path(package), file)

    def manage(self, managed: Managed) -> Handle:
        raise UsageError("ROS 1 has no managed nodes; start the node without the option managed")

    def _end_without_master(self) -> None:
        _log.warning("lost the ROS master; shutting down")
        self._stop_request.asked = True


def _return_to_where_it_was_typed() -> None:
    """roslaunch starts nodes in ROS_HOME; a path that a person gave it is meant from elsewhere."""
    typed_in = os.environ.get("PWD", "")
    if os.path.isdir(typed_in) and os.path.samefile(os.getcwd(), rospkg.get_ros_home()):
        os.chdir(typed_in)


def _go_on_without_master() -> None:
    _log.warning("lost the ROS master; will continue without it and register again when it is back")
