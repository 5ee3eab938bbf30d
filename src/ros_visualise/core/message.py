"""The base class of all messages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

OBJECT_BYTES = 1024
"""Approximate size of a message without its data."""


class Message:
    """Data that travels on a topic; each kind is a frozen dataclass with a `Header`.

    A kind is known once it is defined, unless as ``known=False``, here or in another package.

    Attributes:
        kinds: kinds by the ROS types that they are read from.
        type_name: its ROS type, as ``sensor_msgs/msg/Image``.
        waiting: how many may wait for a node that is busy, before the oldest are dropped.
        plotted: it has single numbers, which can be plotted over time.
        has_header: its ROS message has a header; without one it is stamped with its arrival.
        renamed: ROS 1 and ROS 2 differ in more than what the message library converts by itself.
        also_read: other ROS types whose messages are read as this kind, and never written.
        has_calibration: messages may carry the calibration of their camera.
        on_topics: nodes take and publish it; others are only decoded.
    """

    kinds: ClassVar[dict[str, type[Message]]] = {}
    type_name: ClassVar[str]
    also_read: ClassVar[tuple[str, ...]] = ()
    has_calibration: ClassVar[bool] = False
    on_topics: ClassVar[bool] = True
    waiting: ClassVar[int] = 256
    plotted: ClassVar[bool] = True
    has_header: ClassVar[bool] = True
    renamed: ClassVar[bool] = False

    def __init_subclass__(cls, known: bool = True) -> None:
        super().__init_subclass__()
        if known and "type_name" in vars(cls):
            Message.kinds |= dict.fromkeys((cls.type_name, *cls.also_read), cls)

    @property
    def nbytes(self) -> int:
        """Approximate size in memory, bytes."""
        return OBJECT_BYTES + sum(map(_bytes_of, vars(self).values()))

    def fields(self) -> dict[str, Any]:
        """Fields of the ROS message, by their ROS 2 names in lower case.

        Raises:
            ValueError: the ROS message cannot hold its values.
        """
        raise NotImplementedError

    @classmethod
    def read(cls, message: Any) -> Message:
        """The message that a ROS message holds.

        Raises:
            ValueError: it contradicts itself, or this class cannot hold its values.
        """
        raise NotImplementedError


def _bytes_of(value: Any) -> int:
    if isinstance(value, str | bytes):
        return len(value)
    if isinstance(value, Iterable) and not hasattr(value, "nbytes"):
        return sum(map(_bytes_of, value))
    return int(getattr(value, "nbytes", 0))


def topic_kinds() -> list[type[Message]]:
    """All kinds of messages that nodes take and publish."""
    return [kind for kind in dict.fromkeys(Message.kinds.values()) if kind.on_topics]
