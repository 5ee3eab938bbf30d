"""Services of the ROS 2 graph that ask a node to do something."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.srv import SetCameraInfo
from std_srvs.srv import Trigger

from ros_visualise.core.errors import RosVisualiseError, Unreachable
from ros_visualise.data import CameraInfo
from ros_visualise.messages import from_message
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.runtime.ros2.types import DEFINITIONS

_FIND_S = 2.0
_ANSWER_S = 60.0


class Ros2Service:
    """Offers a service that answers with ``success`` and a text.

    Args:
        node: of this process.
        kind: the service's class.
        name: of the service.
        act: is given the request.
        text: the answer's field for the text.
    """

    def __init__(
        self, node: Node, kind: Any, name: str, act: Callable[[Any], str | None], text: str
    ) -> None:
        self._act, self._text = act, text
        self._node: Node | None = node
        self._service = node.create_service(
            kind, name, self._answer, callback_group=ReentrantCallbackGroup()
        )

    def _answer(self, request: Any, response: Any) -> Any:
        response.success, text = answer(lambda: self._act(request))
        setattr(response, self._text, text)
        return response

    def close(self) -> None:
        """Offer it no longer."""
        node, self._node = self._node, None
        if node is not None:
            node.destroy_service(self._service)


def trigger(node: Node, name: str, act: Callable[[], str | None]) -> Ros2Service:
    """Offer a std_srvs/Trigger."""
    return Ros2Service(node, Trigger, name, lambda _: act(), "message")


def set_camera_info(node: Node, name: str, take: Callable[[CameraInfo], None]) -> Ros2Service:
    """Offer a sensor_msgs/SetCameraInfo."""

    def taken(request: Any) -> None:
        data = serialize_message(request.camera_info)  # read as those on topics are
        take(from_message(DEFINITIONS.read(CameraInfo.type_name, data), CameraInfo))

    return Ros2Service(node, SetCameraInfo, name, taken, "status_message")


def call(node: Node, service: str) -> None:
    """Ask a node elsewhere on the graph to do something.

    Raises:
        Unreachable: no such service, or no answer comes.
        RosVisualiseError: it has answered that it did not.
    """
    client = node.create_client(Trigger, service)
    try:
        if not client.wait_for_service(_FIND_S):
            raise Unreachable(f"{service}: no such service")
        given = result_of(client.call_async(Trigger.Request()), _ANSWER_S)
    finally:
        node.destroy_client(client)
    if given is None:
        raise Unreachable(f"{service}: no answer")
    if not given.success:
        raise RosVisualiseError(f"{service.rpartition('/')[0]}: {given.message}")


def result_of(future: Any, timeout_s: float) -> Any:
    """The answer to a call; None where none comes in time, and then its client forgets the call.

    Not to be called on a thread that answers services.
    """
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if done.wait(timeout_s):
        return future.result()
    future.cancel()
    return None
