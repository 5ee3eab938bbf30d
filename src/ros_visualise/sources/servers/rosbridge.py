"""A client of rosbridge: messages as their bytes in CBOR, or field by field in CBOR or JSON.

Bytes are asked for where the server gives the definitions of its types. rosbridge itself drops
messages with fixed arrays or lists of texts where they are asked for in CBOR field by field.

Source: "rosbridge v2.0 Protocol Specification", ROSBRIDGE_PROTOCOL.md of
github.com/RobotWebTools/rosbridge_suite; arrays in CBOR: RFC 8746.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cbor2
import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Encoding
from ros_visualise.messages.filling import fill, plain
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings.schemas import Schemas, ros_name
from ros_visualise.sources.recordings.storage import Channel
from ros_visualise.sources.servers import LONGEST_NAME, Frame, Received

_WITH_TYPES = "/rosapi/topics_and_raw_types"
_LISTS = (_WITH_TYPES, "/rosapi/topics")  # older servers know only the second
_NO_ROSAPI = "the server does not list its topics; start rosapi_node beside rosbridge"
_MOST_CHANNELS, _LONGEST_NOTE = 5000, 300
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
        self._has_types = False
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
            how = {"type": self._sent(channel.type_name), "compression": self._compression(there)}
            yield _text("subscribe", topic=topic, **how)

    def hear(self, frame: Frame, now_ns: int) -> Received | None:
        heard = _parse(frame)
        op, topic = heard.get("op"), heard.get("topic")
        if op == "service_response":
            self._list(heard)
        elif op == "status" and heard.get("level") in ("error", "warning"):
            self.notes.append(str(heard.get("msg", ""))[:_LONGEST_NOTE])
        elif op == "publish" and isinstance(topic, str) and topic in self._subscribed:
            return Received(topic, self._message(self.channels[topic], heard.get("msg"), now_ns))
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

    def _compression(self, channel: Channel) -> str:
        if self._has_types:
            return "cbor-raw"
        types = channel.definitions
        return (
            "cbor" if types is not None and _fits_cbor(types.store, channel.type_name) else "none"
        )

    def _message(self, channel: Channel, values: Any, now_ns: int) -> Recorded:
        """A message, of its bytes or of its fields."""
        types, name = channel.definitions, channel.type_name
        assert types is not None
        data = values.get("bytes") if self._has_types and isinstance(values, dict) else None
        if not isinstance(data, bytes):
            try:
                data = types.write(name, fill(types.store, name, values))
            except DamagedMessage:
                raise
            except Exception as error:  # the library raises what it happens to meet
                raise DamagedMessage(f"{name}: cannot be read: {error}") from error
        return Recorded(name, data, types, now_ns)

    def _list(self, response: Mapping[str, Any]) -> None:
        """Learn the topics from the answer of rosapi."""
        if self.is_listed:
            return
        values, service = response.get("values"), response.get("id")
        if response.get("result") is False or not isinstance(values, Mapping):
            if service == _LISTS[-1]:
                self.notes.append(_NO_ROSAPI)
                self.is_listed = True
            return
        topics, types = _texts(values.get("topics")), _texts(values.get("types"))
        texts = _texts(values.get("typedefs_full_text")) or [""] * len(topics)
        self._has_types = service == _WITH_TYPES
        self._is_ros1 = not any("/msg/" in name for name in types)
        for topic, name, text in list(zip(topics, types, texts, strict=False))[:_MOST_CHANNELS]:
            if len(topic) <= LONGEST_NAME:
                self.channels[topic] = self._described(topic, ros_name(name), text)
        self.is_listed = True

    def _described(self, topic: str, type_name: str, text: str) -> Channel:
        found = Channel(topic, type_name)
        encoding: Encoding = "ros1" if self._is_ros1 else "cdr"
        return self._schemas.complete(found, encoding, text, "", is_idl=False)

    def _sent(self, type_name: str) -> str:
        return type_name.replace("/msg/", "/") if self._is_ros1 else type_name


def _fits_cbor(store: Typestore, type_name: str) -> bool:
    """True if rosbridge sends all messages of a type in CBOR, field by field."""
    fields: Any = store.fielddefs[type_name][1]
    for _, (sort, about) in fields:
        element = about[0] if sort == Nodetype.SEQUENCE else (sort, about)
        is_text = element[0] == Nodetype.BASE and element[1][0] == "string"
        if sort == Nodetype.ARRAY or (sort == Nodetype.SEQUENCE and is_text):
            return False
        if element[0] == Nodetype.NAME and not _fits_cbor(store, element[1]):
            return False
    return True


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
