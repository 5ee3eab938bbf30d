"""Where the names of a detector's classes are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ros_visualise.core.message import Message
from ros_visualise.data.fields import header, read_header
from ros_visualise.data.header import Header


@dataclass(frozen=True)
class VisionInfo(Message):
    """What made detections, as vision_msgs/VisionInfo; sent once, and kept for who comes late.

    ``method`` names the detector. ``database_location`` says where the names of its classes are;
    with us it is the file that has them in the order of `Hypothesis.number`, unless a parameter of
    the detector says otherwise.
    ``database_version`` counts how often that list has changed.
    """

    type_name: ClassVar[str] = "vision_msgs/msg/VisionInfo"
    plotted: ClassVar[bool] = False

    method: str
    database_location: str = ""
    database_version: int = 0
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a vision_msgs/msg/VisionInfo."""
        return {
            "header": header(self.header),
            "method": self.method,
            "database_location": self.database_location,
            "database_version": self.database_version,
        }

    @classmethod
    def read(cls, message: Any) -> VisionInfo:
        """What a vision_msgs/msg/VisionInfo says."""
        return cls(
            str(message.method),
            str(message.database_location),
            int(message.database_version),
            read_header(message.header),
        )
