"""What every message is: data, its ROS type, and what it costs to let it wait."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

OBJECT_BYTES = 1024
"""About what Python takes for a message beside its data."""


class Message:
    """What can travel on a topic; each kind is a frozen dataclass with a `Header`.

    Attributes:
        type_name: its ROS type, as ``sensor_msgs/msg/Image``.
        waiting: how many may wait for a node that is busy, before the oldest are dropped.
        plotted: whether it has single numbers, which can be plotted over time.
        has_header: whether the ROS message says when and where; what has none gets the time at
            which it came.
        renamed: ROS 1 and ROS 2 differ in more than what the message library converts by itself.
    """

    type_name: ClassVar[str]
    waiting: ClassVar[int] = 256
    plotted: ClassVar[bool] = True
    has_header: ClassVar[bool] = True
    renamed: ClassVar[bool] = False

    @property
    def nbytes(self) -> int:
        """About the bytes that it takes in memory."""
        return OBJECT_BYTES + sum(map(_bytes_of, vars(self).values()))

    def fields(self) -> dict[str, Any]:
        """The fields of the ROS message, by the names of ROS 2 in lower case.

        Raises:
            ValueError: it holds what the message cannot.
        """
        raise NotImplementedError

    @classmethod
    def read(cls, message: Any) -> Message:
        """What a ROS message says.

        Raises:
            ValueError: it contradicts itself, or holds what this class cannot.
        """
        raise NotImplementedError


def _bytes_of(value: Any) -> int:
    if isinstance(value, str | bytes):
        return len(value)
    if isinstance(value, Iterable) and not hasattr(value, "nbytes"):
        return sum(map(_bytes_of, value))
    return int(getattr(value, "nbytes", 0))
