"""Our data <-> ROS messages, with message classes provided by the caller.

    message = to_message(image, typestore.types)
    image = from_message(message, Image)

``types`` maps names as ``sensor_msgs/msg/Image`` to classes that are made from their fields in
order, as a rosbags typestore's ``types`` does; genpy's classes fit too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar, cast

from ros_visualise.data import Header, Message
from ros_visualise.data.fields import Fields, Types, build

T = TypeVar("T", bound=Message)


def data_class(type_name: str) -> type[Message] | None:
    """Our class for a ROS type, or None for an unknown one."""
    return Message.kinds.get(type_name)


def to_message(data: Any, types: Types, header: Header | None = None) -> Any:
    """The ROS message for ``data``; pixels and points are not copied.

    Args:
        data: one of our messages.
        types: ROS type name -> class.
        header: a header in place of its own.

    Raises:
        ValueError: the message cannot store a value, such as a stamp before 1970.
    """
    if header is not None:
        data = replace(data, header=header)
    return build(Fields(data.type_name, data.fields()), types)


def from_message(message: Any, data_class: type[T]) -> T:
    """Our message for a ROS message of ``data_class``.

    Pixels and points are not copied: the message must not be changed any more.

    Raises:
        ValueError: it contradicts itself, or ``data_class`` cannot store a value.
    """
    return cast(T, data_class.read(message))
