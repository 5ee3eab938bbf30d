"""Messages that still hold later: static frames, latched topics, calibrations, parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import CameraInfo, ParameterEvent, Transforms
from ros_visualise.data.header import Header
from ros_visualise.data.poses import is_static
from ros_visualise.messages.recorded import TopicType, content

_ALWAYS = (CameraInfo.type_name, ParameterEvent.type_name)


def replaced(topic: str, message: Any) -> list[tuple[str, ...]]:
    """Keys of the messages that a message replaces: its topic, for transforms also the frames."""
    return _replaced(topic, _content(message))


def _replaced(topic: str, decoded: Any) -> list[tuple[str, ...]]:
    if not isinstance(decoded, Transforms):
        return [(topic,)]
    return [(topic, one.child_frame_id) for one in decoded.transforms]


def _content(message: Any) -> Any:
    """The decoded message; None if it is damaged."""
    try:
        return content(message)
    except DamagedMessage:
        return None


class Latched:
    """Keeps what holds until something newer comes: what is latched, frames that do not move,
    calibrations, and all parameters.
    """

    def __init__(self) -> None:
        self._topics: set[str] = set()
        self._last: dict[tuple[str, ...], Any] = {}

    def add(self, topic: str, kind: TopicType) -> None:
        """Follow a topic, if its messages hold later too."""
        if kind.qos.transient_local or is_static(topic) or kind.name in _ALWAYS:
            self._topics.add(topic)

    def keep(self, topic: str, message: Any) -> None:
        """Keep a message in place of what it replaces."""
        if topic not in self._topics:
            return
        decoded = _content(message)
        if isinstance(decoded, ParameterEvent):
            self._keep_parameters(topic, decoded)
            return
        for key in _replaced(topic, decoded):
            self._last.pop(key, None)  # the newest comes last
            self._last[key] = message

    def messages(self, stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """Topics and messages, each message once; parameters as they are at that time."""
        seen: set[int] = set()
        for (topic, *_), message in self._last.items():
            if id(message) in seen:
                continue
            seen.add(id(message))
            if isinstance(message, ParameterEvent):
                message = ParameterEvent(message.node, new=message.new, header=Header(stamp_ns))
            yield topic, message

    def _keep_parameters(self, topic: str, event: ParameterEvent) -> None:
        known = self._last.get((topic, event.node))
        before = {} if known is None else known.new
        values = {**before, **event.new, **event.changed}
        self._last[topic, event.node] = ParameterEvent(event.node, new=values)
