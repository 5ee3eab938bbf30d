"""The calibration of a camera."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Fields, field_of, header, read_header
from ros_visualise.data.header import Header


@dataclass(frozen=True, eq=False)
class CameraInfo(Message):
    """A pinhole camera's calibration, as in sensor_msgs/CameraInfo.

    ``K`` is 3x3, ``R`` 3x3 and ``P`` 3x4, row-major and in pixels, origin at the centre of the
    top-left pixel; ``D`` are the distortion coefficients of ``distortion_model``. The calibration
    that goes with an image has the image's header.
    """

    type_name = "sensor_msgs/msg/CameraInfo"
    plotted = False

    height: int
    width: int
    K: npt.NDArray[np.float64]
    D: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))
    R: npt.NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    P: npt.NDArray[np.float64] | None = None
    distortion_model: str = "plumb_bob"
    header: Header = Header()

    @property
    def projection(self) -> npt.NDArray[np.float64]:
        """``P``, or where it is not given, ``K`` and a column of zeros."""
        return np.column_stack([self.K, np.zeros(3)]) if self.P is None else self.P

    @classmethod
    def uncalibrated(cls, height: int, width: int) -> CameraInfo:
        """The calibration of an uncalibrated camera: its size, and ``K`` all zero."""
        zero = np.zeros((3, 4))
        return cls(height, width, K=zero[:, :3], D=np.zeros(0), P=zero, distortion_model="")

    def fields(self) -> dict[str, Any]:
        matrices = {"d": self.D, "k": self.K, "r": self.R, "p": self.projection}
        whole_image = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
        return {
            "header": header(self.header),
            "height": self.height,
            "width": self.width,
            "distortion_model": self.distortion_model,
            **{name: np.asarray(m, np.float64).ravel() for name, m in matrices.items()},
            "binning_x": 0,
            "binning_y": 0,
            "roi": Fields("sensor_msgs/msg/RegionOfInterest", {**whole_image, "do_rectify": False}),
        }

    @classmethod
    def read(cls, message: Any) -> CameraInfo:
        """The calibration of the images, read from a sensor_msgs/msg/CameraInfo.

        ROS has that of the whole sensor, and its binning and region of interest; here the size, K
        and P account for these.
        """

        def matrix(name: str, *shape: int) -> Any:
            return np.array(field_of(message, name), np.float64).reshape(shape)

        width, height, to_image = _binned_region(message)
        return cls(
            height=height,
            width=width,
            K=to_image @ matrix("k", 3, 3),
            D=matrix("d", -1),
            R=matrix("r", 3, 3),
            P=to_image @ matrix("p", 3, 4),
            distortion_model=str(message.distortion_model),
            header=read_header(message.header),
        )


def _binned_region(message: Any) -> tuple[int, int, npt.NDArray[np.float64]]:
    """Width and height of images, and the 3x3 matrix from pixels of the sensor to theirs.

    Source: image_geometry, PinholeCameraModel, which shifts no pixel by half a bin.
    """
    roi = message.roi
    is_part = roi.width and roi.height
    x, y = (roi.x_offset, roi.y_offset) if is_part else (0, 0)
    width, height = (roi.width, roi.height) if is_part else (message.width, message.height)
    step_x, step_y = max(message.binning_x, 1), max(message.binning_y, 1)
    to_image = np.diag([1 / step_x, 1 / step_y, 1.0]) @ [[1, 0, -x], [0, 1, -y], [0, 0, 1]]
    return int(width // step_x), int(height // step_y), to_image
