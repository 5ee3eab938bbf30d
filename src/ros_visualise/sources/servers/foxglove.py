"""A client of the Foxglove WebSocket protocol, both of its subprotocols.

Source: "Foxglove WebSocket protocol v1", docs/spec.md of github.com/foxglove/ws-protocol until July
2025.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import msgspec
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from msgspec import Meta, Struct

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Encoding
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sinks.encoding import Encoder
from ros_visualise.sources.recordings.mcap_file import describe_channel
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.storage import Channel
from ros_visualise.sources.servers import LONGEST_NAME, Frame, Received

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
_MESSAGE = 1
_HEAD = struct.Struct("<BIQ")
_OWN_HEAD = struct.Struct("<BI")
_MOST_CHANNELS, _LONGEST_NOTE = 5000, 300

_Number = Annotated[int, Meta(ge=0, lt=2**32)]


class _Advert(Struct, rename="camel"):
    id: _Number
    topic: str
    encoding: str
    schema_name: str = ""
    schema: str = ""
    schema_encoding: str | None = None


class _TextMessage(Struct, rename="camel"):
    """Any message in JSON, as far as it is of use here."""

    op: str
    channels: list[_Advert] = []
    channel_ids: list[_Number] = []
    capabilities: list[str] = []
    supported_encodings: list[str] | None = None
    level: int = 0
    message: str = ""


_DECODER = msgspec.json.Decoder(_TextMessage)


class FoxgloveDialect:
    """See `ros_visualise.sources.servers.Dialect`."""

    def __init__(self, schemas: Schemas) -> None:
        self._schemas = schemas
        self.channels: dict[str, Channel] = {}
        self.is_listed = self.accepts = False
        self.notes: list[str] = []
        self._numbers: dict[str, int] = {}  # topic -> channel
        self._subscribed: dict[int, Channel] = {}  # channel, also the subscription's number
        self._published: dict[tuple[str, str], int] = {}
        self._encodings = ["cdr"]
        self._encoders: dict[Encoding, Encoder] = {}

    def begin(self) -> Iterator[Frame]:
        return iter(())

    def follow(self, topics: Mapping[str, Channel]) -> Iterator[Frame]:
        added = {
            self._numbers[topic]: channel
            for topic, channel in self.channels.items()
            if self._numbers[topic] not in self._subscribed
            and topic in topics
            and channel.definitions is not None
            and channel.is_like(topics[topic])
        }
        if added:
            self._subscribed |= added
            numbers = [{"id": number, "channelId": number} for number in added]
            yield _text("subscribe", subscriptions=numbers)

    def hear(self, frame: Frame, now_ns: int) -> Received | None:
        if isinstance(frame, str):
            self._hear_text(frame)
            return None
        if not frame or frame[0] != _MESSAGE:
            return None
        if len(frame) < _HEAD.size:
            raise DamagedMessage("a message without a header")
        _, number, log_ns = _HEAD.unpack_from(frame)
        channel = self._subscribed.get(number)
        if channel is None or channel.definitions is None:
            return None  # it was on its way
        data = memoryview(frame)[_HEAD.size :]
        stamp_ns = min(log_ns, 2**63 - 1) or now_ns
        message = Recorded(channel.type_name, data, channel.definitions, stamp_ns)
        return Received(channel.topic, message)

    def publish(self, topic: str, message: Recorded) -> Iterator[Frame]:
        is_ros1 = "cdr" not in self._encodings and "ros1" in self._encodings
        encoding: Encoding = "ros1" if is_ros1 else "cdr"
        encoder = self._encoders.setdefault(encoding, Encoder(encoding))
        declared = encoder.declare(TopicType(message.type_name, message.definitions))
        data = encoder.encode(message)
        key = topic, declared.name
        if key not in self._published:
            self._published[key] = len(self._published) + 1
            about = {"id": self._published[key], "topic": topic, "encoding": encoding}
            about |= {"schemaName": declared.name, "schema": declared.text}
            about["schemaEncoding"] = "ros1msg" if is_ros1 else "ros2msg"
            yield _text("advertise", channels=[about])
        yield _OWN_HEAD.pack(_MESSAGE, self._published[key]) + bytes(data)

    def _hear_text(self, frame: str) -> None:
        try:
            heard = _DECODER.decode(frame)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise DamagedMessage(f"malformed: {error}") from None
        if heard.op == "serverInfo":
            self.accepts = "clientPublish" in heard.capabilities
            self._encodings = heard.supported_encodings or ["cdr"]
        elif heard.op == "advertise":
            self.is_listed = True
            for advert in heard.channels:
                self._advertise(advert)
        elif heard.op == "unadvertise":
            for topic in [t for t, number in self._numbers.items() if number in heard.channel_ids]:
                self._subscribed.pop(self._numbers.pop(topic), None)
                del self.channels[topic]
        elif heard.op == "status" and heard.level > 0:
            self.notes.append(heard.message[:_LONGEST_NOTE])

    def _advertise(self, advert: _Advert) -> None:
        if advert.topic in self.channels or len(advert.topic) > LONGEST_NAME:
            return
        if len(self.channels) >= _MOST_CHANNELS:
            raise DamagedMessage(f"more than {_MOST_CHANNELS} topics")
        self._numbers[advert.topic] = advert.id
        self.channels[advert.topic] = _described(advert, self._schemas)


def _described(advert: _Advert, schemas: Schemas) -> Channel:
    """A channel, as that of an MCAP file."""
    encoding = advert.schema_encoding
    if encoding is None:  # of older servers
        encoding = {"cdr": "ros2msg", "ros1": "ros1msg"}.get(advert.encoding, "")
    is_text = encoding in ("ros1msg", "ros2msg", "ros2idl")
    data = advert.schema.encode("utf-8", "replace") if is_text else b""
    schema = Schema(id=1, name=advert.schema_name, encoding=encoding, data=data)
    channel = McapChannel(
        id=1, topic=advert.topic, message_encoding=advert.encoding, metadata={}, schema_id=1
    )
    return describe_channel(channel, schema, schemas)


def _text(op: str, **fields: Any) -> str:
    return msgspec.json.encode({"op": op, **fields}).decode()
