"""A process of ours as a node of a ROS 2 graph; see `ros_visualise.runtime.middleware.Host`."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from ros_visualise.core.printing import forward_log
from ros_visualise.core.signals import StopRequest, note
from ros_visualise.runtime.bridge.parameter_values import given_values
from ros_visualise.runtime.middleware import Handle, Host, Managed
from ros_visualise.runtime.ros2.clock import watch_clock
from ros_visualise.runtime.ros2.errors import translated
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.transport import Ros2Transport

_PACKAGE = "package://"


class Ros2Host(Host):
    """A node of the ROS 2 graph of ``ROS_DOMAIN_ID``."""

    flag = "{0}:={1} (for an executable: --ros-args -p {0}:={1})"

    def __init__(self) -> None:
        self._stop_request = StopRequest()
        self._transport: Ros2Transport | None = None

    def begin(self, name: str) -> Ros2Transport:
        note(self._stop_request)  # who leaves while he joins would be seen for another ten seconds
        session = Ros2Session(name, sys.argv)
        forward_log(_levels(session.node))
        session.start("clock watch", partial(watch_clock, session.node, self.is_over))
        self._transport = Ros2Transport(session)
        return self._transport

    def end(self) -> None:
        if self._transport is not None:
            self._transport.close()

    def is_over(self) -> bool:
        return self._stop_request.asked or (
            self._transport is not None and self._transport.session.is_over
        )

    def arguments(self) -> list[str]:
        return list(remove_ros_args(sys.argv))[1:]

    def option(self, name: str, default: Any) -> Any:
        value = self._begun.session.option(name, default)
        self._begun.desk.show(name, value)
        return value

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        self._begun.desk.expect(namespace)
        given = self._begun.session.given(namespace)
        return given_values(params, given, known, f"{namespace}.".lstrip("."))

    def find_file(self, url: str) -> str:
        if not url.startswith(_PACKAGE):
            return url
        package, _, file = url.removeprefix(_PACKAGE).partition("/")
        with translated(url):
            return f"{get_package_share_directory(package)}/{file}"

    def manage(self, managed: Managed) -> Handle:
        return self._begun.session.manage(managed)

    @property
    def _begun(self) -> Ros2Transport:
        assert self._transport is not None, "begin comes first"
        return self._transport


def _levels(node: Node) -> dict[int, Callable[[str], object]]:
    """The function that logs a text on each level; rclpy wants a line of code for each of them."""
    logger = node.get_logger()
    return {
        logging.DEBUG: lambda text: logger.debug(text),
        logging.INFO: lambda text: logger.info(text),
        logging.WARNING: lambda text: logger.warning(text),
        logging.ERROR: lambda text: logger.error(text),
        logging.CRITICAL: lambda text: logger.fatal(text),
    }
