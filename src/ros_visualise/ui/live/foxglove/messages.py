"""Messages of the protocol: those of viewers are parsed and checked, those of ours are packed."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import msgspec
from msgspec import Meta, Struct

NEWER, OLDER = SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
_MOST = 2000  # names or numbers in a list
_MESSAGE, _TIME, _SERVICE_RESPONSE, _PLAYBACK_STATE = 1, 2, 3, 5
_SERVICE_REQUEST, _PLAYBACK_CONTROL = 2, 3
_SERVICE_HEAD, _CONTROL_HEAD = struct.Struct("<III"), struct.Struct("<BfBQI")
_LONGEST_NAME, _LONGEST_STATUS = 200, 1000

Uint32 = Annotated[int, Meta(ge=0, lt=2**32)]
Name = Annotated[str, Meta(max_length=_LONGEST_NAME)]
Names = Annotated[list[Name], Meta(max_length=_MOST)]


class BadRequest(ValueError):
    """A message of a viewer that is malformed or unsupported; the text is for its user."""


class ChannelSubscription(Struct, rename="camel"):
    """A number that the viewer chose, and a channel."""

    id: Uint32
    channel_id: Uint32


class Subscribe(Struct, tag_field="op", tag="subscribe"):
    """Send messages of channels."""

    subscriptions: Annotated[list[ChannelSubscription], Meta(max_length=_MOST)]


class Unsubscribe(Struct, tag_field="op", tag="unsubscribe", rename="camel"):
    """Send no more messages."""

    subscription_ids: Annotated[list[Uint32], Meta(max_length=_MOST)]


class GetParameters(Struct, tag_field="op", tag="getParameters", rename="camel"):
    """Send parameters; without names, all."""

    parameter_names: Names = []
    id: Name | None = None


class GivenParameter(Struct):
    """A new value of a parameter, of any type."""

    name: Name
    value: Any = None


class SetParameters(Struct, tag_field="op", tag="setParameters"):
    """Change parameters."""

    parameters: Annotated[list[GivenParameter], Meta(max_length=_MOST)]
    id: Name | None = None


class FollowParameters(Struct, tag_field="op", tag="subscribeParameterUpdates", rename="camel"):
    """Send parameters whenever they change; without names, all."""

    parameter_names: Names = []


class LeaveParameters(Struct, tag_field="op", tag="unsubscribeParameterUpdates", rename="camel"):
    """End that; without names, for all."""

    parameter_names: Names = []


class CallService(NamedTuple):
    """Call a service."""

    service_id: int
    call_id: int
    encoding: str


class ControlPlayback(NamedTuple):
    """Play or pause, at a speed, from a time on.

    ``seek_ns``: nanoseconds; None: from the current one.
    """

    playing: bool
    speed: float
    seek_ns: int | None
    id: str


_TextRequest = (
    Subscribe | Unsubscribe | GetParameters | SetParameters | FollowParameters | LeaveParameters
)
Request = _TextRequest | CallService | ControlPlayback
_decoder: msgspec.json.Decoder[_TextRequest] = msgspec.json.Decoder(_TextRequest)


def parse(message: str | bytes) -> Request:
    """The request in a message.

    Raises:
        BadRequest: it is malformed or unsupported.
    """
    try:
        if isinstance(message, str):
            return _decoder.decode(message)
        if message[:1] == bytes([_SERVICE_REQUEST]):
            return _parse_call(message)
        if message[:1] == bytes([_PLAYBACK_CONTROL]):
            return _parse_control(message)
    except struct.error:
        raise BadRequest("malformed request: it is too short") from None
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise BadRequest(f"malformed or unsupported request: {error}") from None
    raise BadRequest("unsupported binary request")


def _parse_call(message: bytes) -> CallService:
    service, call, length = _SERVICE_HEAD.unpack_from(message, 1)
    return CallService(service, call, _text(message, 1 + _SERVICE_HEAD.size, length))


def _parse_control(message: bytes) -> ControlPlayback:
    command, speed, seeks, time_ns, length = _CONTROL_HEAD.unpack_from(message, 1)
    if command > 1 or not math.isfinite(speed):
        raise ValueError("unknown command, or a speed that is not a number")
    name = _text(message, 1 + _CONTROL_HEAD.size, length)
    return ControlPlayback(command == 0, speed, time_ns if seeks else None, name)


def _text(message: bytes, start: int, length: int) -> str:
    if length > _LONGEST_NAME or start + length > len(message):
        raise ValueError("a length exceeds the message, or is too large")
    return message[start : start + length].decode()


def as_text(op: str, **fields: Any) -> str:
    """A message in JSON; fields that are None are omitted."""
    given = {name: value for name, value in fields.items() if value is not None}
    return msgspec.json.encode({"op": op, **given}).decode()


def status(level: int, text: str, id: str | None = None) -> str:
    """A note for the viewer's user, of level 0 (info), 1 (warning) or 2 (error)."""
    return as_text("status", level=level, message=text[:_LONGEST_STATUS], id=id)


def split_ns(time_ns: int) -> Mapping[str, int]:
    """A time for ``serverInfo``."""
    return {"sec": min(max(time_ns, 0) // 10**9, 2**32 - 1), "nsec": max(time_ns, 0) % 10**9}


def message_head(subscription: int, log_ns: int) -> bytes:
    """Head of a message, before its bytes."""
    return struct.pack("<BIQ", _MESSAGE, subscription, _unsigned(log_ns))


def time_message(time_ns: int) -> bytes:
    """The present time."""
    return struct.pack("<BQ", _TIME, _unsigned(time_ns))


def service_response(call: CallService, success: bool, text: str) -> bytes:
    """The response to a call of a ``std_srvs/srv/Trigger``, in CDR."""
    encoding, written = call.encoding.encode(), text.encode() + b"\0"
    head = struct.pack("<BIII", _SERVICE_RESPONSE, call.service_id, call.call_id, len(encoding))
    trigger = struct.pack("<4sB3xI", b"\0\1\0\0", success, len(written)) + written
    return head + encoding + trigger


def playback_state(
    status: int, time_ns: int, speed: float, did_seek: bool, request_id: str = ""
) -> bytes:
    """The state of playback; ``status``: 0 playing, 1 paused, 3 ended."""
    name = request_id.encode()
    head = struct.pack(
        "<BBQfBI", _PLAYBACK_STATE, status, _unsigned(time_ns), speed, did_seek, len(name)
    )
    return head + name


def _unsigned(time_ns: int) -> int:
    return min(max(time_ns, 0), 2**64 - 1)
