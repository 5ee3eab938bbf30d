"""The service by which cameracalibrator hands a camera its calibration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from sensor_msgs.srv import SetCameraInfo, SetCameraInfoResponse

from ros_visualise.data import CameraInfo
from ros_visualise.messages import from_message
from ros_visualise.runtime.bridge.services import answer


class SetCameraInfoService:
    """Offers a sensor_msgs/SetCameraInfo.

    Args:
        name: of the service.
        take: gets the calibration; an error that it raises is the answer.
    """

    def __init__(self, name: str, take: Callable[[CameraInfo], None]) -> None:
        self._take = take
        self._service = rospy.Service(name, SetCameraInfo, self._answer)

    def _answer(self, request: Any) -> SetCameraInfoResponse:
        return SetCameraInfoResponse(
            *answer(lambda: self._take(from_message(request.camera_info, CameraInfo)))
        )

    def close(self) -> None:
        """Offer it no longer."""
        self._service.shutdown()
