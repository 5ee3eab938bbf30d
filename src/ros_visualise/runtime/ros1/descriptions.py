"""Descriptions of robots, which ROS 1 keeps on its parameter server, as latched topics.

ROS 2 has them on topics of the same name, where the rest of the package expects them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from xmlrpc.client import ServerProxy

import rosgraph
import rospy

from ros_visualise.core import supervision
from ros_visualise.core.errors import Unreachable
from ros_visualise.data import Text
from ros_visualise.runtime.ros1.errors import MASTER, translated
from ros_visualise.runtime.ros1.registration import BoundedTransport

SERVER = "/parameter_server"
"""The node that these topics seem to come from."""

_NAME = "robot_description"
_AGAIN_S = 2.0


@contextmanager
def asking_master() -> Iterator[Any]:
    """The master, whose answers are not waited for for ever."""
    master = rosgraph.Master(rospy.get_name())
    with ServerProxy(master.master_uri, BoundedTransport()) as proxy:
        master.handle = proxy
        yield master


def is_description(name: str) -> bool:
    """True if a parameter or a topic of this full name describes a robot."""
    return name.rpartition("/")[2] == _NAME


def is_parameter(name: str) -> bool:
    """True if a robot's description is on the parameter server, and on no topic."""
    if not is_description(name):
        return False
    try:
        with translated(MASTER), asking_master() as master:
            return bool(master.hasParam(name)) and name not in dict(master.getTopicTypes())
    except Unreachable:
        return False


class RobotDescription:
    """Takes a robot's description now, and whenever it is another one.

    See `ros_visualise.runtime.middleware.Transport.subscribe`.

    Args:
        name: full name of the parameter.
        take, reject: as of `Transport.subscribe`.
    """

    dropped = 0

    def __init__(
        self, name: str, take: Callable[[Any], None], reject: Callable[[str], None]
    ) -> None:
        self._name, self._take, self._reject = name, take, reject
        self._last: object = None
        self._closed = threading.Event()
        supervision.start(name, self._run, again_s=_AGAIN_S)

    def close(self) -> None:
        """Look no more."""
        self._closed.set()

    def _run(self) -> None:
        while not self._closed.is_set():
            supervision.attempt(self._name, self._look)
            self._closed.wait(_AGAIN_S)

    def _look(self) -> None:
        try:
            with translated(MASTER), asking_master() as master:
                found = master.getParam(self._name) if master.hasParam(self._name) else None
        except Unreachable:
            return  # as the registration reports
        if found is None or found == self._last or self._closed.is_set():
            return
        self._last = found
        if isinstance(found, str):
            self._take(Text(found))
        else:
            self._reject(f"must be a string, not {type(found).__name__}")
