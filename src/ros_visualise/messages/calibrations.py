"""Topics of the calibrations of images, and access to these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import CameraInfo, CompressedImage, Detections, Image
from ros_visualise.messages import data_class
from ros_visualise.messages.recorded import Recorded, TopicType

CAMERA_INFO = TopicType(CameraInfo.type_name)
_COMPRESSED = CompressedImage.type_name
_CALIBRATED = (Image, CompressedImage, Detections)


def info_topic(image_topic: str) -> str:
    """The topic of an image's calibration.

    For ``/camera/image_raw`` it is ``/camera/camera_info`` beside it, as ROS expects. An image of
    another name is one of several in its namespace, with its calibration below it:
    ``/edges/camera_info`` for ``/edges``, and one without distortion for ``/camera/image_rect``.
    """
    base, _, name = image_topic.rpartition("/")
    is_raw = name.startswith("image") and not name.startswith("image_rect")
    return f"{base if is_raw else image_topic}/camera_info"


def calibration_topic(topic: str, known: Mapping[str, TopicType]) -> str | None:
    """The known topic with the calibration of an image or of detections; None if missing.

    It is `info_topic`, else that of the namespace, which ``/cam/left`` may share with others. A
    compressed image, ``/cam/image_raw/compressed``, has that of the image; detections have that of
    an image of their name.
    """
    if topic not in known or data_class(known[topic].name) not in _CALIBRATED:
        return None
    image = topic.rpartition("/")[0] if known[topic].name == _COMPRESSED else topic
    for name in (info_topic(image), f"{image.rpartition('/')[0]}/camera_info"):
        if name in known and known[name].name == CAMERA_INFO.name:
            return name
    return None


def calibration_of(message: Any) -> CameraInfo | None:
    """The calibration of an image, with its header; None if missing.

    Args:
        message: an `Image`, or a `Recorded` one, which is not decoded.
    """
    info = _known_calibration(message) if isinstance(message, Recorded) else message.camera_info
    if not isinstance(info, CameraInfo) or not info.K.any():  # all zero: not calibrated
        return None
    return replace(info, header=message.header)


def _known_calibration(image: Recorded) -> Any:
    try:
        return None if image.calibration is None else image.calibration.content
    except DamagedMessage:
        return None
