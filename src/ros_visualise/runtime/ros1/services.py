"""Services of a ROS 1 node: actions, and a camera's calibration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from sensor_msgs.srv import SetCameraInfo, SetCameraInfoResponse
from std_srvs.srv import Trigger, TriggerResponse

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import CameraInfo
from ros_visualise.messages import from_message
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.runtime.ros1.errors import translated


class Ros1Service:
    """Offers a service that answers with success and a text.

    Args:
        name: of the service.
        kind, response: its class, and that of its answers.
        act: is given the request.
    """

    def __init__(
        self, name: str, kind: Any, response: Any, act: Callable[[Any], str | None]
    ) -> None:
        self._service = rospy.Service(
            name, kind, lambda request: response(*answer(lambda: act(request)))
        )

    def close(self) -> None:
        """Offer it no longer."""
        self._service.shutdown()


def trigger(name: str, act: Callable[[], str | None]) -> Ros1Service:
    """Offer a std_srvs/Trigger."""
    return Ros1Service(name, Trigger, TriggerResponse, lambda _: act())


def set_camera_info(name: str, take: Callable[[CameraInfo], None]) -> Ros1Service:
    """Offer a sensor_msgs/SetCameraInfo, by which cameracalibrator hands on its result."""

    def taken(request: Any) -> None:
        take(from_message(request.camera_info, CameraInfo))

    return Ros1Service(name, SetCameraInfo, SetCameraInfoResponse, taken)


def call(service: str) -> None:
    """Call a std_srvs/Trigger.

    Raises:
        Unreachable: it does not answer.
        RosVisualiseError: its answer is that it failed.
    """
    with translated(service):
        response = rospy.ServiceProxy(service, Trigger)()
    if not response.success:
        raise RosVisualiseError(f"{service.rpartition('/')[0]}: {response.message}")
