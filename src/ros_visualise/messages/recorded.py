"""Recorded messages: bytes and a type, decoded on demand."""

from __future__ import annotations

import struct
import threading
from dataclasses import dataclass, replace
from typing import Any

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.core.message import OBJECT_BYTES
from ros_visualise.data import CameraInfo, CompressedImage, Detections, Header, Image
from ros_visualise.messages import data_class, from_message, to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.qos import VOLATILE, QoS
from ros_visualise.vision.compression import decompress

_NS = 1_000_000_000
_CDR_ALIGN = 4
_LOCKING = threading.Lock()
STANDARD = Definitions("cdr")
"""The types of ROS 2."""


@dataclass(frozen=True)
class TopicType:
    """The type of a topic's messages: ``name`` as ``sensor_msgs/msg/Image``.

    ``definitions`` has types that ROS itself lacks, else it may be None.

    A topic of a recording may also have properties that are only copied: ``offered_qos``, the QoS
    profiles of its publishers as a YAML list of rosbag2; ``callerids``, the names of the ROS 1
    nodes that published it; and ``labels``, other metadata of an MCAP file by name.
    """

    name: str
    definitions: Definitions | None = None
    qos: QoS = VOLATILE
    offered_qos: str = ""
    callerids: tuple[str, ...] = ()
    labels: tuple[tuple[str, str], ...] = ()

    @property
    def data_class(self) -> type:
        """Class of its decoded messages; `Recorded` for unknown types."""
        found = data_class(self.name)
        return Image if found is CompressedImage else found or Recorded


class Recorded:
    """One message of a recording.

    Args:
        type_name: as ``sensor_msgs/msg/Image``.
        data: its bytes.
        definitions: the types of its recording.
        stamp_ns: time of recording.
        calibration: for an image or detections, the message with the camera's calibration.
        publish_ns: time of sending; by default the time of recording.
        sequence: its number among those of its publisher; 0 if missing.
    """

    plotted = True  # as of `ros_visualise.data.Message`
    __slots__ = (
        "_content",
        "_header",
        "_lock",
        "calibration",
        "data",
        "definitions",
        "publish_ns",
        "sequence",
        "stamp_ns",
        "type_name",
    )

    def __init__(
        self,
        type_name: str,
        data: bytes | memoryview,
        definitions: Definitions,
        stamp_ns: int,
        calibration: Recorded | None = None,
        publish_ns: int | None = None,
        sequence: int = 0,
    ) -> None:
        self.type_name = type_name
        self.data = data
        self.definitions = definitions
        self.stamp_ns = stamp_ns
        self.calibration = calibration
        self.publish_ns = stamp_ns if publish_ns is None else publish_ns
        self.sequence = sequence
        self._header: Header | None = None
        self._content: Any = None
        self._lock: threading.Lock | None = None

    @property
    def nbytes(self) -> int:
        """Approximate size in memory, bytes."""
        return len(self.data) + OBJECT_BYTES

    @property
    def header(self) -> Header:
        """Its own header, read without decoding the rest; else one with the time of recording."""
        if self._header is None:
            self._header = self._read_header()
        return self._header

    @property
    def message(self) -> Any:
        """The ROS message, decoded anew at each call: an object with the type's fields.

        Raises:
            DamagedMessage: the bytes cannot be decoded.
        """
        return self.definitions.read(self.type_name, self.data)

    @property
    def content(self) -> Any:
        """One of `ros_visualise.data`, decoded once; itself if its type is unknown.

        A compressed image is an `Image`.

        Raises:
            DamagedMessage: the bytes cannot be decoded, or the message contradicts itself.
        """
        if self._content is None:
            with _LOCKING:  # most are never decoded and need no lock
                lock = self._lock = self._lock or threading.Lock()
            with lock:
                if self._content is None:
                    self._content = self._decode()
        return self._content

    def _decode(self) -> Any:
        kind = data_class(self.type_name)
        if kind is None:
            return self
        try:
            found: Any = from_message(self.message, kind)
            if isinstance(found, CompressedImage):
                found = decompress(found)
        except AttributeError as error:
            raise DamagedMessage(
                f"{self.type_name}: differs from the standard definition"
            ) from error
        except (ValueError, TypeError) as error:
            raise DamagedMessage(f"{self.type_name}: {error}") from error
        if not found.has_header:
            return replace(found, header=self.header)
        if isinstance(found, (Image, Detections)) and self.calibration is not None:
            info = self.calibration.content
            if isinstance(info, CameraInfo):
                found = replace(found, camera_info=replace(info, header=found.header))
        return found

    def _read_header(self) -> Header:
        if not self.definitions.starts_with_header(self.type_name):
            return Header(self.stamp_ns)
        try:
            return _parse_header(memoryview(self.data), self.definitions.encoding == "ros1")
        except (struct.error, IndexError, UnicodeDecodeError):
            return Header(self.stamp_ns)


def content(message: Any) -> Any:
    """A message, decoded if it is a recorded one.

    Raises:
        DamagedMessage: as `Recorded.content`.
    """
    return message.content if isinstance(message, Recorded) else message


def as_ros(message: Any) -> Any:
    """The ROS message of a recorded one, or of one of ours.

    Raises:
        DamagedMessage: as `Recorded.message`.
    """
    return message.message if isinstance(message, Recorded) else to_message(message, STANDARD.types)


def recorded_ns(message: Any) -> int:
    """Time of recording; the stamp of a message that is not from a recording."""
    found = message.stamp_ns if isinstance(message, Recorded) else message.header.stamp_ns
    return int(found)


def _parse_header(data: memoryview, is_ros1: bool) -> Header:
    if is_ros1:
        _, sec, nanosec, length = struct.unpack_from("<IIII", data)
        start, end = 16, 16 + length
    else:
        order = "<" if data[1] & 1 else ">"
        sec, nanosec, length = struct.unpack_from(f"{order}iII", data, _CDR_ALIGN)
        start, end = _CDR_ALIGN + 12, _CDR_ALIGN + 12 + max(length, 1) - 1
    if end > len(data):
        raise struct.error("the name of the frame is truncated")
    return Header(sec * _NS + nanosec, str(data[start:end], "utf-8"))
