"""A client of rosbridge: messages in JSON, or in CBOR where the server knows that.

Source: "rosbridge v2.0 Protocol Specification", ROSBRIDGE_PROTOCOL.md of
github.com/RobotWebTools/rosbridge_suite; arrays in CBOR: RFC 8746.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cbor2
import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Encoding
from ros_visualise.messages.filling import fill, plain
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings.schemas import Schemas, ros_name
from ros_visualise.sources.recordings.storage import Channel
from ros_visualise.sources.servers import Frame, Received

_WITH_TYPES = "/rosapi/topics_and_raw_types"
_LISTS = (_WITH_TYPES, "/rosapi/topics")  # older servers know only the second
_NO_ROSAPI = "the server does not list its topics; start rosapi_node beside rosbridge"
_MOST_CHANNELS = 5000
_ARRAYS = {
    **{64: ">u1", 65: ">u2", 66: ">u4", 67: ">u8", 69: "<u2", 70: "<u4", 71: "<u8"},
    **{72: ">i1", 73: ">i2", 74: ">i4", 75: ">i8", 77: "<i2", 78: "<i4", 79: "<i8"},
    **{81: ">f4", 82: ">f8", 85: "<f4", 86: "<f8"},
}
"""Tag of an array in CBOR -> type of its numbers."""


class RosbridgeDialect:
    """See `ros_visualise.sources.servers.Dialect`."""

    accepts = True

    def __init__(self, schemas: Schemas) -> None:
        self._schemas = schemas
        self.channels: dict[str, Channel] = {}
        self.is_listed = False
        self.notes: list[str] = []
        self._is_ros1 = False
        self._subscribed: set[str] = set()
        self._published: set[tuple[str, str]] = set()

    def begin(self) -> Iterator[Frame]:
        for service in _LISTS:
            yield _text("call_service", service=service, id=service)

    def follow(self, topics: Mapping[str, Channel]) -> Iterator[Frame]:
        for topic, channel in topics.items():
            there = self.channels.get(topic)
            if there is None or topic in self._subscribed or not channel.is_like(there):
                continue
            self._subscribed.add(topic)
            yield _text(
                "subscribe", topic=topic, type=self._sent(channel.type_name), compression="cbor"
            )

    def hear(self, frame: Frame, now_ns: int) -> Received | None:
        heard = _parse(frame)
        op, topic = heard.get("op"), heard.get("topic")
        if op == "service_response":
            self._list(heard)
        elif op == "status" and heard.get("level") in ("error", "warning"):
            self.notes.append(str(heard.get("msg", ""))[:1000])
        elif op == "publish" and isinstance(topic, str) and topic in self._subscribed:
            channel = self.channels[topic]
            data = self._written(channel.type_name, channel, heard.get("msg"))
            assert channel.definitions is not None
            return Received(topic, Recorded(channel.type_name, data, channel.definitions, now_ns))
        return None

    def publish(self, topic: str, message: Recorded) -> Iterator[Frame]:
        channel = self.channels.get(topic)
        if channel is not None and channel.type_name != message.type_name:
            raise DamagedMessage(f"{topic} is of type {channel.type_name}")
        key = topic, message.type_name
        if key not in self._published:
            self._published.add(key)
            yield _text("advertise", topic=topic, type=self._sent(message.type_name))
        yield _text("publish", topic=topic, msg=plain(message.message))

    def _written(self, type_name: str, channel: Channel, values: Any) -> memoryview:
        types = channel.definitions
        assert types is not None
        try:
            return types.write(type_name, fill(types.store, type_name, values))
        except DamagedMessage:
            raise
        except Exception as error:  # the library raises what it happens to meet
            raise DamagedMessage(f"{type_name}: cannot be read: {error}") from error

    def _list(self, response: Mapping[str, Any]) -> None:
        """Learn the topics from the answer of rosapi."""
        if self.is_listed:
            return
        values, service = response.get("values"), response.get("id")
        if response.get("result") is False or not isinstance(values, Mapping):
            if service == _LISTS[-1]:
                self.notes.append(_NO_ROSAPI)
            return
        topics, types = _texts(values.get("topics")), _texts(values.get("types"))
        texts = _texts(values.get("typedefs_full_text")) or [""] * len(topics)
        self._is_ros1 = not any("/msg/" in name for name in types)
        for topic, name, text in list(zip(topics, types, texts, strict=False))[:_MOST_CHANNELS]:
            self.channels[topic] = self._described(topic, ros_name(name), text)
        self.is_listed = True

    def _described(self, topic: str, type_name: str, text: str) -> Channel:
        found = Channel(topic, type_name)
        encoding: Encoding = "ros1" if self._is_ros1 else "cdr"
        return self._schemas.complete(found, encoding, text, "", is_idl=False)

    def _sent(self, type_name: str) -> str:
        return type_name.replace("/msg/", "/") if self._is_ros1 else type_name


def _parse(frame: Frame) -> Mapping[str, Any]:
    try:
        heard = json.loads(frame) if isinstance(frame, str) else cbor2.loads(frame, **_BOUNDS)
    except (ValueError, TypeError, OverflowError, RecursionError, cbor2.CBORError) as error:
        raise DamagedMessage(f"malformed: {error}") from None
    if not isinstance(heard, dict):
        raise DamagedMessage("malformed: not an object")
    return heard


def _array(tag: cbor2.CBORTag, _: bool) -> Any:
    """The numbers of a tagged array; of another tag its content."""
    if tag.tag in _ARRAYS and isinstance(tag.value, bytes):
        return np.frombuffer(tag.value, _ARRAYS[tag.tag])
    return tag.value


_BOUNDS: dict[str, Any] = {"tag_hook": _array, "max_depth": 64, "strict_hashable_types": True}


def _texts(found: Any) -> Sequence[str]:
    is_one = isinstance(found, list) and all(isinstance(one, str) for one in found)
    return found if is_one else ()


def _text(op: str, **fields: Any) -> str:
    return json.dumps({"op": op, **fields})
